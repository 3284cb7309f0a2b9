"""Display of files in a window, or in an image if there is no display."""

from __future__ import annotations

import argparse
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from viewer.commands._cleanup import add_cleanup_arguments
from viewer.commands._frames import add_frame_arguments
from viewer.commands._pose import (
    add_pose_arguments,
    add_skinning_arguments,
    apply_pose,
    use_file_method,
)
from viewer.commands._scene import (
    SceneOptions,
    add_capture_arguments,
    add_file_arguments,
    begin_scene,
    clean,
    finish,
    print_warnings,
    scene_options,
)
from viewer.commands._settings import number, settings_of, stated
from viewer.commands._view import (
    ViewOptions,
    add_camera_arguments,
    add_display_arguments,
    camera_of,
    display_of,
    follow_notes,
    hide_parts,
    look_through_video,
    warn_of_missing,
)
from viewer.formats import free_path, opened_text
from viewer.media.state_files import to_stderr
from viewer.phrases import printable
from viewer.progress import Cancelled
from viewer.rendering.camera import Camera
from viewer.rendering.gpu.index_sets import prepare_scene
from viewer.rendering.options import SIZE, DisplayOptions
from viewer.rigs.arrays import Floats
from viewer.rigs.mesh import bounding_box
from viewer.rigs.scene import Scene, scene_points
from viewer.rigs.skinning import Skinning

if TYPE_CHECKING:
    from viewer.app.live import Live
    from viewer.loading.capturing import Builder


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.usage = "%(prog)s [FILES ...] [options]"
    add_file_arguments(parser)
    group = parser.add_argument_group("window")
    group.add_argument("--play", action="store_true", help="play motions immediately")
    group.add_argument(
        "--scale", type=_scale, metavar="S", help="scale of the interface, such as 1.5"
    )
    add_capture_arguments(parser, gaps="view")
    add_cleanup_arguments(parser)
    add_frame_arguments(parser)
    add_pose_arguments(parser)
    add_camera_arguments(parser)
    add_display_arguments(parser)
    add_skinning_arguments(parser)
    # Options that are not given default to the user's preferences.
    parser.set_defaults(samples=None, quality=None, up=None)


def _scale(text: str) -> float:
    value = number(text)
    if not 0.25 <= value <= 8.0:
        raise argparse.ArgumentTypeError(f"expected 0.25 to 8, found {text}")
    return value


def run(arguments: argparse.Namespace) -> int:
    """Open the window, or write the image that it would show."""
    from viewer.app.display import NoDisplay, find_display

    asked = _asked(arguments)
    try:
        find_display()
    except NoDisplay as problem:
        for text in asked.problems:
            to_stderr(text)
        start = asked.begin()
        for builder in start.builders:
            finish(builder, start.scene, asked.scene.changes)
        box = bounding_box(start.points)
        from viewer.commands._scalar import choose_subject
        from viewer.commands.render import draw_scene
        from viewer.formats import save_image

        print_warnings(choose_subject(start.scene, asked.options))
        path = free_path(Path.cwd(), start.scene.title, ".png")
        save_image(path, draw_scene(start.scene, SIZE, start.camera, asked.options, box))
        print(f"{problem}; drew {printable(path, 300)} instead")
        return 0
    return open_window(arguments, asked)


class _Asked(NamedTuple):
    """What options ask for, with defaults from the user's preferences."""

    scene: SceneOptions
    view: ViewOptions
    options: DisplayOptions
    given: Collection[str]
    problems: list[str]
    """Messages about damaged preferences."""

    def begin(self) -> _Start:
        """Open and pose the files."""
        return _start(self.scene, self.view, self.options, self.given)


def _asked(arguments: argparse.Namespace) -> _Asked:
    from viewer.app.preferences.preferences import load_preferences

    problems: list[str] = []
    preferences = load_preferences(problems.append)
    if arguments.samples is None:
        arguments.samples = preferences.samples
    arguments.quality = arguments.quality or preferences.quality
    arguments.up = arguments.up or preferences.up or None
    options, scene = display_of(arguments), scene_options(arguments)
    view = settings_of(ViewOptions, arguments)
    return _Asked(scene, view, options, stated(Skinning, arguments), problems)


def open_window(
    arguments: argparse.Namespace, asked: _Asked | None = None, live: Live | None = None
) -> int:
    """Open files in a window, which ``live`` lets other programs change; return when it closes."""
    from viewer.app.opening import Opening, watch

    asked = asked or _asked(arguments)
    opening = Opening(_title(asked.scene.files), asked.begin)
    try:
        shell = watch(opening, arguments.scale)
    except Cancelled:
        return 0  # the window was closed
    try:
        start = opening.result()
    except BaseException:
        if shell is not None:
            shell.release()
        raise
    from viewer.app.window import show

    show(
        start.scene,
        camera=start.camera,
        options=asked.options,
        paths=asked.scene.paths,
        scale=arguments.scale,
        fit_distance=asked.view.fits,
        builders=start.builders,
        plays=arguments.play,
        motion=asked.scene.motion,
        shell=shell,
        messages=asked.problems,
        live=live,
    )
    return 0


class _Start(NamedTuple):
    """A scene that is ready to be shown, its points, and captures that are not yet complete."""

    scene: Scene
    builders: list[Builder]
    points: Floats
    camera: Camera


def _start(
    asked: SceneOptions, view: ViewOptions, options: DisplayOptions, given: Collection[str]
) -> _Start:
    """Open and pose the files, and print warnings; ``given`` are the stated fields of skinning."""
    scene, builders = begin_scene(asked)
    if asked.frames.is_one or not asked.changes.is_empty:
        for builder in builders:
            finish(builder, scene, asked.changes)  # determines who is present at that time
    clean(scene, asked.changes)
    print_warnings(apply_pose(scene, asked.pose, asked.frames))
    print_warnings(use_file_method(scene, options.skinning, given))
    print_warnings(look_through_video(view, asked.motion, scene))
    hide_parts(view, scene, options)
    print_warnings(warn_of_missing(scene, options) + follow_notes(view, scene))
    prepare_scene(scene)
    points = scene_points(scene, options.show)
    return _Start(scene, builders, points, camera_of(view, scene, points, SIZE))


def _title(files: Sequence[str]) -> str:
    names = [opened_text(Path(file)) for file in files]
    return " + ".join(names) or "the bundled figure"
