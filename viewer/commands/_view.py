"""Options that aim the camera and choose what is shown; shared by the commands that draw."""

from __future__ import annotations

import argparse
import re

from viewer.commands._numbers import number
from viewer.commands._pose import add_skinning_arguments, skinning_of
from viewer.errors import ViewerError, printable
from viewer.rendering.camera import Camera, camera_from_view, fit
from viewer.rendering.ground_pass import parse_color
from viewer.rendering.options import BACKGROUNDS, SHOWN, DisplayOptions
from viewer.rendering.program import SHADING
from viewer.rig.arrays import Floats
from viewer.rig.camera_view import CameraView
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.scalars import SCALARS, compute, length_text, missing_part
from viewer.rig.scene import Scene

__all__ = [
    "add_camera_arguments",
    "add_display_arguments",
    "camera_of",
    "display_of",
    "hide_parts",
    "parse_size",
    "scalar_text",
    "warn_of_missing",
]


def add_camera_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that aim the camera; what is not given fits the scene."""
    parser.add_argument("--azimuth", type=number, metavar="A", help="degrees about the up axis")
    parser.add_argument("--inclination", type=number, metavar="I", help="degrees above the horizon")
    parser.add_argument("--distance", type=number, metavar="D", help="from the target, in units")
    parser.add_argument(
        "--view", metavar="NAME|N", help="look through a calibrated camera of a capture"
    )
    parser.add_argument("--orthographic", action="store_true", help="parallel projection")


def add_display_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that choose what is shown and how."""
    parser.add_argument("--show", choices=SHOWN, default="skin", help="default: skin")
    parser.add_argument("--shading", choices=SHADING, default="phong", help="default: phong")
    parser.add_argument(
        "--background",
        default="gradient",
        metavar="NAME|#rrggbb",
        help="gradient, transparent or a colour",
    )
    parser.add_argument("--samples", type=int, default=4, metavar="N", help="samples a pixel")
    for name, text in (
        ("flat", "one normal per triangle"),
        ("wireframe", "edges on top"),
        ("normals", "vertex normals as lines"),
        ("no-texture", "plain colour instead of the texture"),
        ("no-grid", "leave out the ground grid"),
    ):
        parser.add_argument(f"--{name}", action="store_true", help=text)
    parser.add_argument(
        "--scalar", choices=SCALARS, help="show a number of each vertex as a colour"
    )
    parser.add_argument("--keypoints", action="store_true", help="keypoints as markers")
    parser.add_argument("--reduced", action="store_true", help="the coarser mesh, if there is one")
    parser.add_argument(
        "--hide-part",
        action="append",
        default=[],
        metavar="NAME",
        help="leave out a body part; may be repeated",
    )
    add_skinning_arguments(parser)


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
    """Return the camera asked for; its distance fits the points unless it is given."""
    if arguments.view is not None:
        return camera_from_view(_find_view(scene, arguments.view), size, scene.up)
    camera = Camera(up=scene.up, orthographic=arguments.orthographic)
    if arguments.azimuth is not None:
        camera.azimuth = arguments.azimuth
    if arguments.inclination is not None:
        if not -90 <= arguments.inclination <= 90:
            raise ViewerError(f"--inclination: expected -90 to 90, found {arguments.inclination:g}")
        camera.inclination = arguments.inclination
    fit(camera, points, size[0] / size[1])
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


def _find_view(scene: Scene, text: str) -> CameraView:
    """Return a calibrated camera by its name, or by its number counted from 1."""
    for view in scene.views:
        if view.name == text:
            return view
    if text.isdecimal() and 1 <= int(text) <= len(scene.views):
        return scene.views[int(text) - 1]
    names = ", ".join(printable(view.name, 40) for view in scene.views) or "none"
    raise ViewerError(f'--view: no camera "{printable(text, 60)}"; there are: {names}')


def display_of(arguments: argparse.Namespace) -> DisplayOptions:
    """Return the display options asked for."""
    if arguments.background not in BACKGROUNDS:
        parse_color(arguments.background)
    if arguments.samples < 1:
        raise ViewerError(f"--samples: expected at least 1, found {arguments.samples}")
    return DisplayOptions(
        show=arguments.show,
        shading="scalar" if arguments.scalar else arguments.shading,
        scalar=arguments.scalar or DisplayOptions().scalar,
        flat=arguments.flat,
        wireframe=arguments.wireframe,
        normals=arguments.normals,
        texture=not arguments.no_texture,
        grid=not arguments.no_grid,
        background=arguments.background,
        samples=arguments.samples,
        skinning=skinning_of(arguments),
        keypoints=arguments.keypoints,
        reduced=arguments.reduced,
    )


def hide_parts(arguments: argparse.Namespace, scene: Scene, options: DisplayOptions) -> None:
    """Set the body parts that are left out, by name or index, of the first figure that has any.

    Raises
    ------
    ViewerError
        If no figure has a part of this name; the message lists those there are.
    """
    if not arguments.hide_part:
        return
    parts = next((a.figure.body_parts for a in scene.actors if a.figure.body_parts), None)
    if parts is None:
        raise ViewerError("--hide-part: no figure has body parts")
    names = [name.lower() for name in parts.names]
    hidden = []
    for wanted in arguments.hide_part:
        if wanted.lower() not in names:
            raise ViewerError(
                f'--hide-part: no part "{wanted}"; there are: {", ".join(parts.names)}'
            )
        hidden.append(names.index(wanted.lower()))
    options.hidden_parts = tuple(sorted(set(hidden)))


def warn_of_missing(scene: Scene, options: DisplayOptions) -> list[str]:
    """Return what was asked to be shown and no figure has, one line each."""
    figures = [actor.figure for actor in scene.actors]
    notes = []
    if options.shading == "scalar":
        missing = [missing_part(options.scalar, figure) for figure in figures]
        if all(missing):
            title = SCALARS[options.scalar].title
            notes.append(f"--scalar {options.scalar}: {title}: no figure has {missing[0]}")
    if options.reduced and not any(figure.reduced for figure in figures):
        notes.append("--reduced: no figure has a reduced mesh")
    if options.keypoints and not any(figure.keypoints for figure in figures):
        notes.append("--keypoints: no figure has keypoints")
    return notes


def scalar_text(scene: Scene, options: DisplayOptions) -> str:
    """Return what the ends of the colour map stand for, for the line that names the picture."""
    if options.shading != "scalar" or options.show == "skeleton":
        return ""
    largest = [
        float(compute(options.scalar, actor.figure, actor.pose, options.skinning).max())
        for actor in scene.actors
        if actor.figure.mesh is not None and actor.visible
    ]
    text = length_text(scene.actors[0].figure, max(largest, default=0.0))
    return f", {SCALARS[options.scalar].title}: 0 to {text}"
