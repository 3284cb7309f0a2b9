"""``viewer.render`` and ``viewer.video``, with the settings of the command ``render``."""

from __future__ import annotations

import dataclasses
import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import NoneType

import numpy as np

from viewer.arguments import check_type
from viewer.commands._frames import numbering_of
from viewer.commands._keywords import without_dashes
from viewer.commands._scalar import scalar_notes
from viewer.commands._scene import SceneOptions
from viewer.commands._sequence import Request, parse_turntable
from viewer.commands._view import ViewOptions, camera_of
from viewer.errors import RigError, ViewerError
from viewer.near_names import did_you_mean
from viewer.phrases import all_of, printable
from viewer.rendering.camera import Camera
from viewer.rendering.camera_views import with_cameras
from viewer.rendering.offscreen import render as draw
from viewer.rendering.options import SIZE, DisplayOptions, Quality
from viewer.rigs.arrays import Bytes
from viewer.rigs.scene import Actor, Scene, pose_actors, scene_of, scene_points


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
    **settings: object,
) -> Bytes:
    """Draw a scene or one actor without a window.

    The context is created on first use and cached, one per thread; use ``Offscreen`` to manage it.
    Afterwards no context is current in this thread.

    Parameters
    ----------
    scene
        What is drawn, in its current pose; actors keep their pose.
    size : (int, int)
        Width and height in pixels.
    camera
        Camera; by default one that frames the scene, with the settings below.
    options
        Display options; shadows are drawn (quality normal) if omitted.
    time
        Seconds of the motions; the current pose if omitted.
    look_at
        Joint or actor at which the camera aims: ``"head"``, ``"fox/head"``, ``"1:pelvis"``.
    distance
        Distance from the target, scene units.
    azimuth, inclination : float, optional
        Degrees about the up axis, and above the horizon.
    orthographic
        Parallel projection.
    scalar
        Numbers that are shown as colours, such as ``"weight:left_knee"``.
    background
        ``"gradient"``, ``"white"``, ``"environment"``, ``"transparent"`` or ``"#rrggbb"``.
    quality : "draft", "normal" or "final", optional
        Without or with shadows, or with soft shadows and ambient occlusion.
    settings
        Other fields of ``DisplayOptions``: ``shading="normals"``, ``wireframe=True``.

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
    settings |= {"background": background, "quality": quality, "scalar": scalar}
    scene, shown = scene_of(scene, "render"), display_options(render, options, settings)
    _check_types(size, distance, azimuth, inclination, look_at, orthographic)
    check_type("camera", camera, Camera, NoneType)
    if time is not None:
        scene = scene_at(scene, time)
    view = ViewOptions(
        look_at=look_at,
        distance=distance,
        azimuth=azimuth,
        inclination=inclination,
        orthographic=orthographic,
    )
    if view != ViewOptions() and camera is not None:
        raise ViewerError("camera: expected it or settings of the view, found both")
    with without_dashes():
        _check_scalar(scene, shown)
        if camera is None and view != ViewOptions():
            points = with_cameras(scene, shown, scene_points(scene, shown.show))
            camera = camera_of(view, scene, points, size)
    return draw(scene, size, camera, shown)


def video(
    scene: Scene | Actor,
    path: str | Path,
    size: tuple[int, int] = SIZE,
    options: DisplayOptions | None = None,
    *,
    frames: range | None = None,
    fps: float | None = None,
    speed: float | None = None,
    turntable: bool | float = False,
    look_at: str | None = None,
    follow: str | None = None,
    distance: float | None = None,
    azimuth: float | None = None,
    inclination: float | None = None,
    orthographic: bool = False,
    scalar: str | None = None,
    background: str | None = None,
    quality: Quality | None = None,
    **settings: object,
) -> None:
    """Record the motions of a scene or one actor; an existing file is replaced.

    Parameters
    ----------
    scene
        What is drawn. Without a motion, the camera must rotate.
    path
        ``.mp4``, ``.webm`` or ``.gif`` (they need PyAV), or numbered images, as in
        ``frame_{frame:05}.png``.
    size : (int, int)
        Width and height in pixels.
    options
        Display options; shadows are drawn (quality normal) if omitted.
    frames
        Numbers of the frames; the whole motion if omitted.
    fps
        Frames per second; those of the motion if omitted.
    speed
        0.5 is half as fast, -1 backwards.
    turntable
        Rotate the camera once during the motion, or in this number of seconds.
    look_at, follow : str, optional
        Joint or actor at which the camera aims at the start, or that it follows.
    distance, azimuth, inclination, orthographic, scalar, background, quality
        As in ``viewer.render``.
    settings
        Other fields of ``DisplayOptions``: ``shading="normals"``, ``wireframe=True``.

    Raises
    ------
    ViewerError
        If nothing moves, a setting has no such value, or PyAV is missing.
    OutputError
        If a file cannot be written.
    """
    # The command's other needs are not those of ``render``.
    from viewer.commands.render import Drawing, complete, draw_sequence

    settings |= {"background": background, "quality": quality, "scalar": scalar}
    scene, shown = scene_of(scene, "video"), display_options(video, options, settings)
    _check_types(size, distance, azimuth, inclination, look_at, orthographic)
    check_type("path", path, str, Path)
    check_type("frames", frames, range, NoneType)
    check_type("fps", fps, float, NoneType)
    check_type("speed", speed, float, NoneType)
    check_type("follow", follow, str, NoneType)
    view = ViewOptions(
        look_at=look_at,
        follow=follow,
        distance=distance,
        azimuth=azimuth,
        inclination=inclination,
        orthographic=orthographic,
    )
    asked = SceneOptions([])
    if frames is not None:
        asked.frames.frames = f"{frames.start}:{frames.stop}:{frames.step}"
    asked.frames.fps = fps
    request = Request(Path(path), speed=speed)
    with without_dashes():
        if turntable is not False:
            request.turntable = parse_turntable("" if turntable is True else str(turntable))
        complete(request, asked.frames, view, panels=False, has_quality=False)
        if request.kind not in ("video", "pictures"):
            raise ViewerError(
                "path: expected a video (.mp4, .webm, .gif) or numbered images, as in "
                f"frame_{{frame:05}}.png, found {printable(path, 300)}"
            )
        _check_scalar(scene, shown)
        draw_sequence(
            Drawing(
                *(asked, view, shown, request, size),
                force=True,
                panels=False,
                device=None,
                is_chosen=True,
            ),
            scene,
        )


def _check_types(
    size: tuple[int, int],
    distance: float | None,
    azimuth: float | None,
    inclination: float | None,
    look_at: str | None,
    orthographic: bool,
) -> None:
    """Raise RigError for settings of another type than pictures need."""
    is_size = isinstance(size, Sequence | np.ndarray) and not isinstance(size, str)
    if not is_size or len(size) != 2 or not all(isinstance(n, int | np.integer) for n in size):
        raise RigError(f"size: expected two integers, such as (640, 360), found {size!r}")
    angles = {"azimuth": azimuth, "inclination": inclination}
    for name, number in ({"distance": distance} | angles).items():
        check_type(name, number, float, NoneType)
        if number is not None and not math.isfinite(number):
            raise RigError(f"{name}: expected a finite number, found {number}")
    check_type("orthographic", orthographic, bool)
    check_type("look_at", look_at, str, NoneType)


def scene_at(scene: Scene, time: float) -> Scene:
    """Return a copy of a scene, posed at a time that its motions reach."""
    check_type("time", time, float)
    if not math.isfinite(time):
        raise ViewerError(f"time: expected seconds, found {time}")
    scene = replace(scene, actors=[actor.copy() for actor in scene.actors])
    if any(actor.clip is not None for actor in scene.actors):
        with without_dashes():
            time = numbering_of(scene.actors).checked_time(time)
        pose_actors(scene.actors, time)
    return scene


def display_options(
    function: Callable[..., object],
    options: DisplayOptions | None,
    settings: Mapping[str, object],
) -> DisplayOptions:
    """Return a copy of display options with the settings that are not None, all checked.

    ``function`` is named by the error for an unknown setting.
    """
    check_type("options", options, DisplayOptions, NoneType)
    shown = replace(DisplayOptions(quality="normal") if options is None else options)
    known = [each.name for each in dataclasses.fields(DisplayOptions)]
    for name, value in settings.items():
        if name not in known:
            named = inspect.signature(function).parameters.values()
            own = [each.name for each in named if each.kind is not each.VAR_KEYWORD]
            near = did_you_mean(name, [*own, *known])
            raise ViewerError(
                f"{function.__name__}: no option is called {printable(name, 60)}; "
                f"{f'{near} ' if near else ''}allowed: {all_of(sorted(known))}"
            )
        if value is not None:
            setattr(shown, name, value)
    if settings.get("scalar") is not None and settings.get("shading") is None:
        shown.shading = "scalar"
    return shown


def _check_scalar(scene: Scene, options: DisplayOptions) -> None:
    """Raise ViewerError if no figure has the numbers that are shown as colours."""
    notes = scalar_notes(scene, options)
    if notes:
        raise ViewerError(notes[0])
