"""Options of the camera and the display, shared by the commands that draw."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from viewer.commands._numbers import number
from viewer.commands._pose import skinning_of
from viewer.commands._scalar import add_scalar_arguments, scalar_notes, set_scalar
from viewer.errors import ViewerError
from viewer.phrases import listed, printable
from viewer.rendering.camera import Camera, camera_from_view, facing_camera, fit, front_azimuth
from viewer.rendering.gpu.program import SHADING_CHOICES
from viewer.rendering.options import (
    BACKGROUNDS,
    BONES,
    MATCAPS,
    QUALITIES,
    SHOWN,
    DisplayOptions,
    parse_color,
)
from viewer.rig.arrays import Floats
from viewer.rig.inspection.front import FRONTS, Front, front_axes, guess_front
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.scene import Scene

if TYPE_CHECKING:
    from viewer.rig.captures.cameras import CameraView

_SWITCHES = (
    ("no-shadows", "omit shadows"),
    ("flat", "use one normal per triangle"),
    ("wireframe", "draw triangle edges"),
    ("normals", "draw vertex normals"),
    ("no-texture", "use plain colours instead of textures"),
    ("no-vertex-colors", "omit vertex colours"),
    ("no-grid", "omit the ground grid"),
    ("keypoints", "draw a model's keypoints"),
    ("no-captured-keypoints", "hide the keypoints of captures"),
    ("reduced", "draw the coarser mesh, if there is one"),
    ("xray", "draw bones that are visible through the skin"),
    ("joint-names", "label joints; labels that would overlap are omitted"),
    ("joint-axes", "draw the axes of joints: x red, y green, z blue"),
    ("cameras", "draw the frusta of a capture's calibrated cameras, with their images"),
)

_DIMMED = 0.6  # brightness of a camera's image
# Options that ask for a view of their own.
VIEWS = ("azimuth", "inclination", "distance", "orthographic", "look_at", "follow")


def add_camera_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the camera; by default it frames the scene."""
    group = parser.add_argument_group("camera")
    group.add_argument("--azimuth", type=number, metavar="A", help="degrees about the up axis")
    group.add_argument(
        "--front",
        choices=("auto", *FRONTS),
        default="auto",
        metavar="AXIS",
        help="the axis that the figures face, as in --front=-z; the initial view looks from there "
        "(default: auto, estimated from the figures)",
    )
    group.add_argument("--inclination", type=number, metavar="I", help="degrees above the horizon")
    group.add_argument(
        "--distance",
        type=number,
        metavar="D",
        help="distance from the target, in scene units (default: the whole scene is visible)",
    )
    group.add_argument(
        "--look-at",
        metavar="NAME",
        help="aim at a joint or an actor instead of the centre: head, fox/head, or 1:pelvis for a "
        "captured person; --distance sets how close (in videos: where it is at the start)",
    )
    group.add_argument("--orthographic", action="store_true", help="parallel projection")
    group.add_argument(
        "--view",
        metavar="NAME|N",
        help="look through a calibrated camera of a capture, by name or number from 1",
    )
    group.add_argument(
        "--image-brightness",
        type=number,
        metavar="0..1",
        help="brightness of the camera's image behind the scene, with --view; 0 hides it (default: "
        "0.6; 1 with --overlay)",
    )


def add_display_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the display."""
    group = parser.add_argument_group("display")
    group.add_argument(
        "--show",
        choices=SHOWN,
        default="skin",
        help="parts of the figures; binding is the skin in the bind pose (default: skin)",
    )
    _add_shading_arguments(group)
    add_scalar_arguments(group)
    group.add_argument(
        "--bones",
        choices=BONES,
        default="auto",
        help="style of skeletons (default: auto, the boxes of files that have them, otherwise "
        "octahedra)",
    )
    group.add_argument(
        "--background",
        default="gradient",
        metavar="NAME|#rrggbb",
        help="gradient, white, environment (the studio, out of focus), transparent, or a colour "
        "(default: gradient)",
    )
    group.add_argument(
        "--samples", type=int, default=4, metavar="N", help="samples per pixel (default: 4)"
    )
    group.add_argument(
        "--quality",
        choices=QUALITIES,
        metavar="NAME",
        help="draft: no shadows; normal: shadows; final: soft shadows, ambient occlusion and "
        "smoother edges (default: final for pictures, normal for videos)",
    )
    _add_switches(group)
    group.add_argument(
        "--opacity",
        type=number,
        default=1.0,
        metavar="0..1",
        help="opacity of the figures (default: 1)",
    )
    group.add_argument(
        "--hide-part",
        action="append",
        default=[],
        metavar="NAME|GLOB",
        help="hide parts of meshes or bodies, by name or pattern; may be repeated",
    )


def _add_switches(group: argparse._ArgumentGroup) -> None:
    for name, text in _SWITCHES:
        group.add_argument(f"--{name}", action="store_true", help=text)
    group.add_argument(
        "--springs",
        choices=("on", "off"),
        default="on",
        help="simulate spring joints, such as hair in VRM files, while a motion plays "
        "(default: on)",
    )


def _add_shading_arguments(group: argparse._ArgumentGroup) -> None:
    """Add the options of surfaces."""
    group.add_argument(
        "--shading",
        choices=SHADING_CHOICES,
        default="auto",
        help="shading of surfaces; auto is pbr for figures with metallic-roughness materials, else "
        "phong (default: auto)",
    )
    for name, default in (("metallic", 0.0), ("roughness", 0.6)):
        group.add_argument(
            f"--{name}",
            type=number,
            default=default,
            metavar="0..1",
            help=f"value for materials that do not specify one, with --shading pbr (default: "
            f"{default:g})",
        )
    group.add_argument(
        "--matcap",
        choices=MATCAPS,
        default="clay",
        help="picture for --shading matcap (default: clay)",
    )


def parse_size(text: str) -> tuple[int, int]:
    """Return the width and height of ``1280x720``."""
    found = re.fullmatch(r"(\d{1,6})[xX](\d{1,6})", text)
    if not found:
        raise ViewerError(f'--size: expected WIDTHxHEIGHT in pixels, found "{text}"')
    size = int(found[1]), int(found[2])
    if min(size) < 1:
        raise ViewerError(f"--size: expected at least 1 x 1 pixels, found {text}")
    return size


def camera_of(
    arguments: argparse.Namespace, scene: Scene, points: Floats, size: tuple[int, int]
) -> Camera:
    """Return the requested camera; it frames the points unless its distance is given."""
    if arguments.view is not None:
        if arguments.look_at is not None:
            raise ViewerError("--view and --look-at: expected one of them, found both")
        view = _find_view(scene, arguments.view)
        from viewer.rig.captures.carried_view import view_in

        camera = camera_from_view(view, size, scene.up, seen=view_in(view, scene))
        camera.front = front_azimuth(_front_of(arguments, scene), scene.up)
        return camera
    camera = facing_camera(_front_of(arguments, scene), scene.up, arguments.orthographic)
    if arguments.azimuth is not None:
        camera.azimuth = arguments.azimuth
    if arguments.inclination is not None:
        if not -90 <= arguments.inclination <= 90:
            raise ViewerError(f"--inclination: expected -90 to 90, found {arguments.inclination:g}")
        camera.inclination = arguments.inclination
    fit(camera, points, size[0] / size[1])
    if arguments.look_at is not None:
        from viewer.rendering.framing import find_follow

        camera.target = find_follow(scene, arguments.look_at).origin
    if arguments.distance is not None:
        if arguments.distance <= 0:
            raise ViewerError(f"--distance: expected more than 0, found {arguments.distance:g}")
        limit = 1e4 * (box_size(bounding_box(points)) or 1.0)
        if arguments.distance > limit:
            raise ViewerError(
                f"--distance: expected at most {limit:g}, 10000 times the figure's size, "
                f"found {arguments.distance:g}"
            )
        camera.distance = arguments.distance
    return camera


def _front_of(arguments: argparse.Namespace, scene: Scene) -> Front:
    """Return the requested front, or the one estimated from the figures."""
    front: Front = arguments.front
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
    if arguments.samples < 1:
        raise ViewerError(f"--samples: expected at least 1, found {arguments.samples}")
    for name in ("metallic", "roughness", "image-brightness", "opacity"):
        value = getattr(arguments, name.replace("-", "_"))
        if value is not None and not 0.0 <= value <= 1.0:
            raise ViewerError(f"--{name}: expected 0 to 1, found {value:g}")
    options = DisplayOptions(
        show=arguments.show,
        shading=arguments.shading,
        matcap=arguments.matcap,
        metallic=arguments.metallic,
        roughness=arguments.roughness,
        flat=arguments.flat,
        wireframe=arguments.wireframe,
        normals=arguments.normals,
        texture=not arguments.no_texture,
        vertex_colors=not arguments.no_vertex_colors,
        grid=not arguments.no_grid,
        bones=arguments.bones,
        background=arguments.background,
        samples=arguments.samples,
        quality=arguments.quality or "final",
        shadows=not arguments.no_shadows,
        skinning=skinning_of(arguments),
        keypoints=arguments.keypoints,
        captured_keypoints=not arguments.no_captured_keypoints,
        reduced=arguments.reduced,
        xray=arguments.xray,
        joint_names=arguments.joint_names,
        joint_axes=arguments.joint_axes,
        opacity=arguments.opacity,
        cameras=arguments.cameras,
        image_brightness=_brightness(arguments),
    )
    set_scalar(arguments, options)
    return options


def _brightness(arguments: argparse.Namespace) -> float:
    if arguments.image_brightness is not None:
        return float(arguments.image_brightness)
    return 1.0 if getattr(arguments, "overlay", None) is not None else _DIMMED


def look_through_video(arguments: argparse.Namespace, scene: Scene) -> list[str]:
    """Look through the camera of a given video, unless another view is requested; return notes."""
    option = "--video" if arguments.video is not None else "--images"
    is_given = arguments.video is not None or arguments.images is not None
    if not is_given or arguments.view is not None or scene.images is None:
        return []
    asked = [name for name in VIEWS if getattr(arguments, name, None) not in (None, False)]
    if asked:
        other = asked[0].replace("_", "-")
        return [f"{option}: not drawn, because --{other} asks for another view"]
    names = scene.images.cameras
    if len(names) > 1:
        return [f"{option}: not drawn; choose a camera with --view: {listed(names)}"]
    arguments.view = names[0]
    return []


def camera_notes(arguments: argparse.Namespace, scene: Scene, options: DisplayOptions) -> list[str]:
    """Return messages about calibrated cameras: their images, and lens distortion.

    Raises ViewerError if there is no such camera, or its files lack the size of its images.
    """
    seen = None if arguments.view is None else _find_view(scene, arguments.view)
    drawn = scene.views if options.cameras else [view for view in [seen] if view is not None]
    notes: list[str] = []
    if drawn:
        from viewer.rendering.camera_views import image_notes, lens_notes

        notes = [note for view in drawn for note in image_notes(scene, view)]
        notes += [] if seen is None else lens_notes(scene, seen)
    if options.cameras and not scene.views:
        notes.append("--cameras: no file has calibrated cameras")
    for option, given in (("--images", arguments.images), ("--video", arguments.video)):
        if given is not None and scene.images is None:
            notes.append(f"{option}: no file is a capture with calibrated cameras")
    return notes


def follow_notes(arguments: argparse.Namespace, scene: Scene) -> list[str]:
    """Return a message if several joints or actors have the name that the camera aims at."""
    from viewer.rendering.framing import follow_candidates

    option, name = "--follow", getattr(arguments, "follow", None)
    if name is None:
        option, name = "--look-at", arguments.look_at
    actors = [] if name is None else [scene.actors[i] for i, _ in follow_candidates(scene, name)]
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


def hide_parts(arguments: argparse.Namespace, scene: Scene, options: DisplayOptions) -> None:
    """Hide parts of meshes, and body parts of the first figure that has any, by name.

    Raises ViewerError if no part has one of the names; the message lists the known ones.
    """
    from viewer.near_names import name_hint

    if not arguments.hide_part:
        return
    parts = next((a.figure.body_parts for a in scene.actors if a.figure.body_parts), None)
    of_body = () if parts is None else parts.names
    of_meshes = [() if a.figure.mesh is None else a.figure.mesh.parts for a in scene.actors]
    everything = (*of_body, *(name for names in of_meshes for name in names))
    known = tuple(dict.fromkeys(filter(None, everything)))
    if not known:
        raise ViewerError("--hide-part: no figure has parts")
    hidden: set[int] = set()
    for wanted in arguments.hide_part:
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
