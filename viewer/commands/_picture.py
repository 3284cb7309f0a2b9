"""``viewer.render``: one picture as an array, with the settings of the command ``render``."""

from __future__ import annotations

import dataclasses
from dataclasses import replace

from viewer.commands._scalar import scalar_notes
from viewer.commands._view import ViewOptions, camera_of
from viewer.errors import ViewerError
from viewer.near_names import name_hint
from viewer.phrases import printable
from viewer.rendering.camera import Camera
from viewer.rendering.camera_views import with_cameras
from viewer.rendering.gpu.program import SHADING_CHOICES
from viewer.rendering.offscreen import render as draw
from viewer.rendering.options import SIZE, DisplayOptions, Quality
from viewer.rig.arrays import Bytes
from viewer.rig.motion.evaluation import pose_actors
from viewer.rig.scene import Actor, Scene, scene_points


def render(
    scene: Scene | Actor,
    size: tuple[int, int] = SIZE,
    camera: Camera | None = None,
    options: DisplayOptions | None = None,
    *,
    time: float | None = None,
    look_at: str | None = None,
    distance: float | None = None,
    azimuth: float | None = None,
    inclination: float | None = None,
    orthographic: bool = False,
    scalar: str | None = None,
    background: str | None = None,
    quality: Quality | None = None,
) -> Bytes:
    """Draw a scene or one actor without a window.

    The context is created on first use and cached, one per thread; use ``Offscreen`` to manage it.
    Afterwards no context is current in this thread.

    Parameters
    ----------
    scene : Scene or Actor
        What is drawn, in its current pose; actors keep their pose.
    size : (int, int)
        Width and height in pixels.
    camera : Camera, optional
        Camera; by default one that frames the scene, with the settings below.
    options : DisplayOptions, optional
        Display options; shadows are drawn (quality normal) if omitted.
    time : float, optional
        Seconds of the motions; the current pose if omitted.
    look_at : str, optional
        Joint or actor at which the camera aims: ``"head"``, ``"fox/head"``, ``"1:pelvis"``.
    distance : float, optional
        Distance from the target, scene units.
    azimuth, inclination : float, optional
        Degrees about the up axis, and above the horizon.
    orthographic : bool
        Parallel projection.
    scalar : str, optional
        Numbers that are shown as colours, such as ``"weight:left_knee"``.
    background : str, optional
        ``"gradient"``, ``"white"``, ``"environment"``, ``"transparent"`` or ``"#rrggbb"``.
    quality : "draft", "normal" or "final", optional
        Without or with shadows, or with soft shadows and ambient occlusion.

    Returns
    -------
    (H, W, 4) uint8
        sRGB and alpha, first row at the top.

    Raises
    ------
    ViewerError
        If a setting has no such value, or the driver cannot draw an image of this size.
    RigError
        If there is no such joint, actor or quantity.
    RenderError
        If there is no usable OpenGL.

    >>> import viewer
    >>> viewer.render(viewer.load(), size=(64, 48)).shape
    (48, 64, 4)
    """
    if isinstance(scene, Actor):
        scene = Scene([scene])
    if not isinstance(scene, Scene):
        raise ViewerError(f"render: expected a scene or an actor, found {type(scene).__name__}")
    shown = replace(DisplayOptions(quality="normal") if options is None else options)
    shown.background = background or shown.background
    shown.quality = quality or shown.quality
    if scalar is not None:
        shown.scalar, shown.shading = scalar, "scalar"
    check_choices(shown)
    if time is not None:
        scene = replace(scene, actors=[actor.copy() for actor in scene.actors])
        pose_actors(scene.actors, time)
    view = ViewOptions(
        look_at=look_at,
        distance=distance,
        azimuth=azimuth,
        inclination=inclination,
        orthographic=orthographic,
    )
    if view != ViewOptions() and camera is not None:
        raise ViewerError("camera: expected it or settings of the view, found both")
    try:
        for note in scalar_notes(scene, shown):
            raise ViewerError(note)
        if camera is None and view != ViewOptions():
            points = with_cameras(scene, shown, scene_points(scene, shown.show))
            camera = camera_of(view, scene, points, size)
    except ViewerError as problem:
        # Messages of the command name its options.
        raise type(problem)(str(problem).removeprefix("--").removeprefix("scalar ")) from None
    return draw(scene, size, camera, shown)


def check_choices(options: DisplayOptions) -> None:
    """Raise ViewerError if a display option has none of its possible values."""
    for each in dataclasses.fields(options):
        choices = SHADING_CHOICES if each.name == "shading" else each.metadata.get("choices")
        value = getattr(options, each.name)
        if choices and value not in choices:
            hint = name_hint(str(value), [*choices])
            raise ViewerError(f'{each.name}: no value "{printable(value, 60)}"; {hint}')
