"""Options of the camera and the display, shared by the commands that draw."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from viewer.commands._scalar import add_scalar_arguments, scalar_notes, set_scalar
from viewer.commands._settings import add_settings, settings_of, stated
from viewer.data_classes import dataclass, setting
from viewer.errors import ViewerError
from viewer.loading import MotionSettings
from viewer.phrases import listed, printable
from viewer.rendering.camera import Camera, camera_from_view, facing_camera, fit, front_azimuth
from viewer.rendering.gpu.program import SHADING_CHOICES
from viewer.rendering.options import BACKGROUNDS, DisplayOptions, parse_color
from viewer.rigs.arrays import Floats
from viewer.rigs.inspection.front import FRONTS, Front, WantedFront, front_axes, guess_front
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.scene import Scene
from viewer.rigs.skinning import Skinning

if TYPE_CHECKING:
    from viewer.rigs.captures.cameras import CameraView

_DRAWN = (
    *("bones", "background", "samples", "quality", "shadows", "flat", "wireframe", "normals"),
    *("texture", "vertex_colors", "grid", "keypoints", "captured_keypoints", "reduced", "xray"),
    *("joint_names", "joint_axes", "cameras"),
)
# Options that ask for a view of their own.
VIEWS = ("azimuth", "inclination", "distance", "orthographic", "look_at", "follow")


@dataclass(slots=True)
class ViewOptions:
    """The camera, and what is hidden from it."""

    azimuth: float | None = setting(None, "degrees about the up axis", metavar="A")
    front: WantedFront = setting(
        "auto",
        "the axis that the figures face, as in --front=-z; the initial view looks from there "
        "(default: {default}, estimated from the figures)",
        choices=("auto", *FRONTS),
        metavar="AXIS",
    )
    inclination: float | None = setting(None, "degrees above the horizon", metavar="I")
    distance: float | None = setting(
        None,
        "distance from the target, in scene units (default: the whole scene is visible)",
        metavar="D",
    )
    look_at: str | None = setting(
        None,
        "aim at a joint or an actor instead of the centre: head, fox/head, or 1:pelvis for a "
        "captured person; --distance sets how close (in videos: where it is at the start)",
        metavar="NAME",
    )
    orthographic: bool = setting(False, "parallel projection")
    view: str | None = setting(
        None,
        "look through a calibrated camera of a capture, by name or number from 1",
        metavar="NAME|N",
    )
    hide_part: list[str] = setting(
        [],
        "hide parts of meshes or bodies, by name or pattern; may be repeated",
        metavar="NAME|GLOB",
    )
    follow: str | None = setting(
        None,
        "follow an actor or joint with the camera: fox, head, or fox/head; captured people by "
        "number: 1 or 1:pelvis (a single picture: aim at it)",
        metavar="NAME",
    )

    @property
    def fits(self) -> bool:
        """Whether the distance is free: neither it, nor a view or an aim is requested."""
        return (self.distance, self.view, self.look_at) == (None, None, None)


def add_camera_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the camera; by default it frames the scene."""
    group = parser.add_argument_group("camera")
    names = "azimuth", "front", "inclination", "distance", "look_at", "orthographic", "view"
    add_settings(group, ViewOptions, *names)
    add_settings(group, DisplayOptions, "image_brightness")


def add_display_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the display."""
    group = parser.add_argument_group("display")
    add_settings(group, DisplayOptions, "show")
    add_settings(group, DisplayOptions, "shading", choices=SHADING_CHOICES)
    add_settings(group, DisplayOptions, "metallic", "roughness", "matcap")
    add_scalar_arguments(group)
    add_settings(group, DisplayOptions, *_DRAWN)
    add_settings(group, MotionSettings, "springs")
    add_settings(group, DisplayOptions, "opacity")
    add_settings(group, ViewOptions, "hide_part")


def parse_size(text: str) -> tuple[int, int]:
    """Return the width and height of ``1280x720``."""
    found = re.fullmatch(r"(\d{1,6})[xX](\d{1,6})", text)
    if not found:
        raise ViewerError(f'--size: expected WIDTHxHEIGHT in pixels, found "{text}"')
    size = int(found[1]), int(found[2])
    if min(size) < 1:
        raise ViewerError(f"--size: expected at least 1 x 1 pixels, found {text}")
    return size


def camera_of(options: ViewOptions, scene: Scene, points: Floats, size: tuple[int, int]) -> Camera:
    """Return the requested camera; it frames the points unless its distance is given."""
    if options.view is not None:
        if options.look_at is not None:
            raise ViewerError("--view and --look-at: expected one of them, found both")
        view = _find_view(scene, options.view)
        from viewer.rigs.captures.carried_view import view_in

        camera = camera_from_view(view, size, scene.up, seen=view_in(view, scene))
        camera.front = front_azimuth(_front_of(options, scene), scene.up)
        return camera
    camera = facing_camera(_front_of(options, scene), scene.up, options.orthographic)
    if options.azimuth is not None:
        camera.azimuth = options.azimuth
    if options.inclination is not None:
        if not -90 <= options.inclination <= 90:
            raise ViewerError(f"--inclination: expected -90 to 90, found {options.inclination:g}")
        camera.inclination = options.inclination
    fit(camera, points, size[0] / size[1])
    if options.look_at is not None:
        from viewer.rendering.framing import find_follow

        camera.target = find_follow(scene, options.look_at).origin
    if options.distance is not None:
        if options.distance <= 0:
            raise ViewerError(f"--distance: expected more than 0, found {options.distance:g}")
        limit = 1e4 * (box_size(bounding_box(points)) or 1.0)
        if options.distance > limit:
            raise ViewerError(
                f"--distance: expected at most {limit:g}, 10000 times the figure's size, "
                f"found {options.distance:g}"
            )
        camera.distance = options.distance
    return camera


def _front_of(options: ViewOptions, scene: Scene) -> Front:
    """Return the requested front, or the one estimated from the figures."""
    front = options.front
    if front == "auto":
        return guess_front(scene)
    if front not in front_axes(scene.up):
        axes = ", ".join(front_axes(scene.up))
        raise ViewerError(f"--front: expected {axes} (the up axis is {scene.up}), found {front}")
    return front


def _find_view(scene: Scene, text: str) -> CameraView:
    """Return a calibrated camera by its name, or by its number counted from 1."""
    from viewer.near_names import name_hint

    for view in scene.views:
        if view.name == text:
            return view
    if text.isdecimal() and 1 <= int(text) <= len(scene.views):
        return scene.views[int(text) - 1]
    hint = name_hint(text, [view.name for view in scene.views])
    raise ViewerError(f'--view: no camera is called "{printable(text, 60)}"; {hint}')


def display_of(arguments: argparse.Namespace) -> DisplayOptions:
    """Return the requested display options."""
    if arguments.background not in BACKGROUNDS:
        parse_color(arguments.background)
    is_overlay = getattr(arguments, "overlay", None) is not None
    brightness = {"image_brightness": 1.0} if is_overlay else {}
    options = settings_of(
        DisplayOptions,
        arguments,
        quality=arguments.quality or "final",
        scalar_range=None,
        skinning=settings_of(Skinning, arguments),
        **({} if arguments.image_brightness is not None else brightness),
    )
    set_scalar(options, stated(DisplayOptions, arguments), arguments.scalar_range)
    return options


def look_through_video(view: ViewOptions, motion: MotionSettings, scene: Scene) -> list[str]:
    """Look through the camera of a given video, unless another view is requested; return notes."""
    option = "--video" if motion.video is not None else "--images"
    is_given = motion.video is not None or motion.images is not None
    if not is_given or view.view is not None or scene.images is None:
        return []
    asked = [name for name in VIEWS if getattr(view, name) not in (None, False)]
    if asked:
        other = asked[0].replace("_", "-")
        return [f"{option}: not drawn, because --{other} asks for another view"]
    names = scene.images.cameras
    if len(names) > 1:
        return [f"{option}: not drawn; choose a camera with --view: {listed(names)}"]
    view.view = names[0]
    return []


def camera_notes(
    view: ViewOptions, motion: MotionSettings, scene: Scene, options: DisplayOptions
) -> list[str]:
    """Return messages about calibrated cameras: their images, and lens distortion."""
    seen = None if view.view is None else _find_view(scene, view.view)
    drawn = scene.views if options.cameras else [] if seen is None else [seen]
    notes: list[str] = []
    if drawn:
        from viewer.rendering.camera_views import image_notes, lens_notes

        notes = [note for one in drawn for note in image_notes(scene, one)]
        notes += [] if seen is None else lens_notes(scene, seen)
    if options.cameras and not scene.views:
        notes.append("--cameras: no file has calibrated cameras")
    for option, given in (("--images", motion.images), ("--video", motion.video)):
        if given is not None and scene.images is None:
            notes.append(f"{option}: no file is a capture with calibrated cameras")
    return notes


def follow_notes(view: ViewOptions, scene: Scene) -> list[str]:
    """Return a message if several joints or actors have the name that the camera aims at."""
    option, name = "--follow", view.follow
    if name is None:
        option, name = "--look-at", view.look_at
    if name is None:
        return []
    from viewer.rendering.framing import follow_candidates

    actors = [scene.actors[i] for i, _ in follow_candidates(scene, name)]
    # A person's body and keypoints count as one match.
    others = [
        actor for actor in actors[1:] if actor.person is None or actor.person != actors[0].person
    ]
    if not others:
        return []
    # Actors without a number are all different.
    count = len({-1 - i if a.person is None else a.person for i, a in enumerate(actors)})
    person, called = others[0].person, printable(name, 60)
    how = "" if person is None else f" ({option} {person}:{called} selects another)"
    return [
        f"{option} {called}: {count} match; the first one, {printable(actors[0].name, 60)}, is "
        f"chosen{how}"
    ]


def hide_parts(view: ViewOptions, scene: Scene, options: DisplayOptions) -> None:
    """Hide parts of meshes, and body parts of the first figure that has any, by name."""
    from viewer.near_names import name_hint

    if not view.hide_part:
        return
    parts = next((a.figure.body_parts for a in scene.actors if a.figure.body_parts), None)
    of_body = () if parts is None else parts.names
    of_meshes = [() if a.figure.mesh is None else a.figure.mesh.parts for a in scene.actors]
    everything = (*of_body, *(name for names in of_meshes for name in names))
    known = tuple(dict.fromkeys(filter(None, everything)))
    if not known:
        raise ViewerError("--hide-part: no figure has parts")
    hidden: set[int] = set()
    for wanted in view.hide_part:
        if not _named(wanted, known):
            hint = name_hint(wanted, known)
            raise ViewerError(f'--hide-part: no part is called "{printable(wanted, 60)}"; {hint}')
        hidden |= _named(wanted, of_body)
        for actor, names in zip(scene.actors, of_meshes, strict=True):
            actor.hidden_parts |= _named(wanted, names)
    options.hidden_parts = tuple(sorted(hidden))


def _named(wanted: str, names: Sequence[str]) -> set[int]:
    """Return the indices of the names that a name or pattern matches, regardless of case."""
    pattern = wanted.lower()
    return {
        index
        for index, name in enumerate(names)
        if name.lower() == pattern or fnmatchcase(name.lower(), pattern)
    }


def warn_of_missing(scene: Scene, options: DisplayOptions) -> list[str]:
    """Return messages about requested items that no figure has."""
    figures = [actor.figure for actor in scene.actors]
    notes = scalar_notes(scene, options)
    if options.reduced and not any(figure.reduced for figure in figures):
        notes.append("--reduced: no figure has a reduced mesh")
    if options.keypoints and not any(figure.keypoints for figure in figures):
        notes.append("--keypoints: no figure has keypoints")
    return notes + _joint_notes(scene, options)


def _joint_notes(scene: Scene, options: DisplayOptions) -> list[str]:
    """Return messages about requested joint markers that are not visible."""
    has_one = any(actor.figure.skeleton is not None for actor in scene.actors)
    if has_one and options.show != "binding":
        return []
    why = "no joints are shown in the bind pose" if has_one else "no figure has a skeleton"
    names = "xray", "joint_names", "joint_axes"
    requested = [name for name in names if getattr(options, name)]
    return [f"--{name.replace('_', '-')}: {why}" for name in requested]
