"""Rendering to images and videos, without a display or window."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from viewer.commands._cleanup import add_cleanup_arguments
from viewer.commands._output import PICTURES, inputs_of
from viewer.commands._pose import add_pose_arguments, add_skinning_arguments, use_file_method
from viewer.commands._scalar import choose_subject, scalar_text
from viewer.commands._scene import (
    add_capture_arguments,
    add_file_arguments,
    open_scene,
    print_warnings,
)
from viewer.commands._sequence.frame_numbers import add_frame_arguments
from viewer.commands._sequence.recording import add_sequence_arguments, draw_sequence, request_of
from viewer.commands._view import (
    VIEWS,
    add_camera_arguments,
    add_display_arguments,
    camera_notes,
    camera_of,
    display_of,
    follow_notes,
    hide_parts,
    look_through_video,
    parse_size,
    warn_of_missing,
)
from viewer.errors import UnsupportedFormatError, ViewerError
from viewer.formats import check_targets
from viewer.interrupts import deferred
from viewer.media.video_kinds import VIDEOS
from viewer.phrases import printable
from viewer.rendering.camera import Camera
from viewer.rendering.camera_views import with_cameras
from viewer.rendering.options import DisplayOptions
from viewer.rig.arrays import Bytes, Floats
from viewer.rig.mesh import bounding_box
from viewer.rig.scene import Scene, scene_points
from viewer.streams import summary_stream

if TYPE_CHECKING:
    from viewer.commands._sequence.shots import Request

__all__ = ["add_arguments", "run"]

_SIZE = "1280x720"
_OPAQUE = (".jpg", ".jpeg", ".bmp", ".ppm")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.usage = "%(prog)s [FILES ...] -o FILE [options]"
    add_file_arguments(parser)
    _add_output_arguments(parser)
    add_capture_arguments(parser, gaps="view")
    add_cleanup_arguments(parser)
    add_frame_arguments(parser, "A:B[:STEP]")
    add_sequence_arguments(parser)
    add_pose_arguments(parser)
    add_camera_arguments(parser)
    add_display_arguments(parser)
    add_skinning_arguments(parser)


def _add_output_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("output")
    group.add_argument(
        "-o",
        "--output",
        required=True,
        metavar="FILE",
        help="an image (.png, .jpg, …), a video (.mp4, .webm, .gif), or numbered images, such "
        "as frame_{frame:05}.png",
    )
    group.add_argument("--force", action="store_true", help="replace existing files")
    group.add_argument(
        "--size",
        metavar="WxH",
        help="in pixels (default: 1280x720; with --overlay, the size of the video)",
    )
    group.add_argument(
        "--overlay",
        metavar="VIDEO",
        help="draw the people over the video they were captured from: in camera space, seen "
        "through its camera (needs PyAV)",
    )
    group.add_argument("--panels", action="store_true", help="draw the window's panels too")
    group.add_argument("--gpu", type=int, metavar="N", help="use EGL device N (see doctor)")


def run(arguments: argparse.Namespace) -> int:
    """Render the images, write them, and print their names."""
    _check_overlay(arguments)
    size = parse_size(_SIZE if arguments.size is None else arguments.size)
    output = Path(arguments.output)
    _check_suffix(arguments, output)
    request = request_of(arguments, output)
    if request is None or request.kind != "pictures":
        check_targets([output], inputs_of(arguments), arguments.force)
    options = display_of(arguments)
    is_still = request is None or request.kind == "onion"
    if arguments.quality is None and (not is_still or arguments.panels):
        options.quality = "normal"
    _check_device(arguments.gpu)
    if options.background == "transparent" and output.suffix.lower() in _OPAQUE:
        print_warnings([f"{printable(output)}: this format has no transparency"])
    scene = open_scene(arguments)
    use_file_method(arguments, scene, options.skinning)
    print_warnings(look_through_video(arguments, scene))
    if arguments.overlay is not None:
        size = _overlay_size(arguments, scene) or size
    hide_parts(arguments, scene, options)
    print_warnings(choose_subject(scene, options))
    print_warnings(warn_of_missing(scene, options) + camera_notes(arguments, scene, options))
    if request is not None and request.kind == "onion":
        _draw_onion(request, arguments, scene, options, size)
    elif request is not None and (request.is_certain or any(a.clip for a in scene.actors)):
        line = draw_sequence(request, arguments, scene, options, size)
        print(line, file=summary_stream(output))
    else:
        _draw_still(arguments, scene, options, size)
    return 0


def _check_overlay(arguments: argparse.Namespace) -> None:
    """Let an overlay be a video that is seen through its camera.

    Raises ViewerError if other options contradict that.
    """
    if arguments.overlay is None:
        return
    for name in ("video", "images", "view", *VIEWS):
        if getattr(arguments, name) not in (None, False):
            other = name.replace("_", "-")
            raise ViewerError(f"--overlay and --{other}: expected one of them, found both")
    arguments.video, arguments.no_grid = arguments.overlay, True


def _overlay_size(arguments: argparse.Namespace, scene: Scene) -> tuple[int, int] | None:
    """Return the size of the video, unless another one is requested.

    Raises ViewerError if no file is a capture.
    """
    if scene.images is None:
        raise ViewerError("--overlay: expected a capture with a camera, found none")
    return None if arguments.size else scene.images.size_of(scene.images.cameras[0])


def _check_device(device: int | None) -> None:
    """Check the graphics device before anything is read."""
    if device is not None:
        from viewer.rendering.gpu.context import check_device

        check_device(device)


def _draw_still(
    arguments: argparse.Namespace, scene: Scene, options: DisplayOptions, size: tuple[int, int]
) -> None:
    from viewer.formats import save_image

    output = Path(arguments.output)
    check_targets([output], inputs_of(arguments, scene), arguments.force)
    points = scene_points(scene, options.show)
    box = bounding_box(points)
    if arguments.follow is not None:
        arguments.look_at = arguments.follow  # like one frame of a video that follows it
    print_warnings(follow_notes(arguments, scene))
    camera = camera_of(arguments, scene, with_cameras(scene, options, points), size)
    if arguments.panels:
        fits = (arguments.distance, arguments.view, arguments.look_at) == (None, None, None)
        pixels = _draw_panels(scene, size, camera, options, box, arguments.gpu, fits)
    else:
        is_chosen = arguments.quality is not None
        pixels = draw_scene(scene, size, camera, options, box, arguments.gpu, is_chosen)
    save_image(output, pixels)
    grid = f", grid {_grid_step(points):g}" if options.grid else ""
    colors = scalar_text(scene, options)
    line = f"{printable(output)}: {size[0]} x {size[1]}{grid}{colors}"
    print(line, file=summary_stream(output))


def _draw_onion(
    request: Request,
    arguments: argparse.Namespace,
    scene: Scene,
    options: DisplayOptions,
    size: tuple[int, int],
) -> None:
    """Draw several poses of a motion in one image."""
    from viewer.commands._sequence.shots import shots_of
    from viewer.formats import save_image
    from viewer.rig.motion.onion import onion

    shots = shots_of(request, arguments, scene)
    check_targets([request.output], inputs_of(arguments, scene), arguments.force)
    print_warnings(shots.notes)
    poses = onion(scene, shots.times.tolist(), interpolate=arguments.interpolate_gaps)
    points = scene_points(poses, options.show)
    camera = camera_of(arguments, poses, with_cameras(poses, options, points), size)
    is_chosen = arguments.quality is not None
    box = bounding_box(points)
    pixels = draw_scene(poses, size, camera, options, box, arguments.gpu, is_chosen)
    save_image(request.output, pixels)
    frames = ", ".join(map(str, shots.numbers))
    line = f"{printable(request.output)}: {size[0]} x {size[1]}, poses of frames {frames}"
    print(line, file=summary_stream(request.output))


def _check_suffix(arguments: argparse.Namespace, output: Path) -> None:
    """Check that the suffix is that of an image or video."""
    suffix = output.suffix.lower()
    try:
        is_ours = output.is_file() or not output.exists()
    except (OSError, ValueError):
        return  # reported by check_targets
    if suffix not in ("", *PICTURES, *VIDEOS) and is_ours:
        # Overwriting an input is worse, so it is reported first.
        check_targets([output], inputs_of(arguments), force=True)
        raise UnsupportedFormatError(
            f"{printable(output, 300)}: expected an image ({', '.join(PICTURES)}) or a video "
            f"({', '.join(VIDEOS)}), found {suffix}"
        )


def draw_scene(
    scene: Scene,
    size: tuple[int, int],
    camera: Camera,
    options: DisplayOptions,
    box: Floats,
    device: int | None = None,
    is_chosen: bool = False,
) -> Bytes:
    """Return the scene's pixels, (H, W, 4) uint8; the driver's limitations are printed.

    The default quality is lowered if drawing it in software would take long.
    """
    from viewer.rendering.gpu.context import thread_graphics
    from viewer.rendering.offscreen import Offscreen
    from viewer.rendering.sampling import limit_passes, time_note

    def report_time(seconds: float, count: int) -> None:
        print_warnings(time_note(seconds, count), "note")

    with deferred(), Offscreen(graphics=thread_graphics(device)) as offscreen:
        notes = [] if is_chosen else limit_passes(options, scene, size, offscreen.context)
        print_warnings(notes, "note")
        pixels = offscreen.render(scene, size, camera, options, box, report_time)
        print_warnings(offscreen.renderer.notes)
        if options.joint_names:
            left_out, n_seen = offscreen.renderer.names_left_out
            if left_out:
                reason = "would cover others" if left_out > 1 else "would cover another"
                print_warnings([f"{left_out} of {n_seen} joint names omitted: they {reason}"])
        return pixels


def _draw_panels(
    scene: Scene,
    size: tuple[int, int],
    camera: Camera,
    options: DisplayOptions,
    box: Floats,
    device: int | None,
    fits: bool,
) -> Bytes:
    from viewer.app.core.state import AppState
    from viewer.app.headless import HeadlessApp
    from viewer.diagnostics.template import in_window
    from viewer.rendering.gpu.context import thread_graphics

    if min(size) < 200:
        raise ViewerError(f"--panels needs at least 200 x 200 pixels, found {size[0]} x {size[1]}")
    with in_window():
        state = AppState(scene, camera=camera, options=options, box=box)
        with deferred(), HeadlessApp(state, size, graphics=thread_graphics(device)) as app:
            return app.picture(fits)


def _grid_step(points: Floats) -> float:
    from viewer.rendering.passes.ground_pass import grid_step

    return grid_step(bounding_box(points))
