"""Rendering to images and videos, without a display or window.

One pose is drawn as an image, with or without the window's panels; a motion as a video, numbered
images or a contact sheet, frame by frame; with ``--onion``, several of its poses in one image.
Options that have no effect on the requested kind of output are refused before anything is read.
"""

from __future__ import annotations

import argparse
import contextlib
import re
import string
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from viewer.commands._cleanup import add_cleanup_arguments
from viewer.commands._frames import Frames, add_frame_arguments, parse_range
from viewer.commands._pose import add_pose_arguments, add_skinning_arguments, use_file_method
from viewer.commands._scalar import choose_subject, scalar_text
from viewer.commands._scene import (
    SceneOptions,
    add_capture_arguments,
    add_file_arguments,
    inputs_of,
    open_scene,
    print_warnings,
    scene_options,
)
from viewer.commands._sequence import Request, recording_of
from viewer.commands._settings import add_settings, settings_of, stated
from viewer.commands._view import (
    VIEWS,
    ViewOptions,
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
from viewer.data_classes import dataclass
from viewer.errors import UnsupportedFormatError, ViewerError
from viewer.formats import check_targets
from viewer.interrupts import deferred, hold
from viewer.media.image import PICTURES
from viewer.media.video_kinds import VIDEOS
from viewer.phrases import printable
from viewer.rendering.camera import Camera
from viewer.rendering.options import SIZE, DisplayOptions
from viewer.rigs.arrays import Bytes, Floats
from viewer.rigs.mesh import bounding_box
from viewer.rigs.scene import Scene, scene_points
from viewer.rigs.skinning import Skinning
from viewer.streams import summary_stream

if TYPE_CHECKING:
    from viewer.media.picture_sinks import PictureSink, SheetSink
    from viewer.media.video import VideoSink
    from viewer.rendering.recorder import Recording

_OPAQUE = (".jpg", ".jpeg", ".bmp", ".ppm")  # formats without transparency
# Sequences.
_FIELD = re.compile(r"\{frame[:!}]")  # the frame number in the name of an image
_MOST_CELLS = 1000  # of a contact sheet
_MOST_POSES = 100  # in one image
_NARROW, _WIDE = 0.4, 2.5  # aspect ratios of the cells of contact sheets


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.usage = "%(prog)s [FILES ...] -o FILE [options]"
    add_file_arguments(parser)
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
        help=f"in pixels (default: {SIZE[0]}x{SIZE[1]}; with --overlay, the size of the video)",
    )
    group.add_argument(
        "--overlay",
        metavar="VIDEO",
        help="draw the people over the video they were captured from: in camera space, seen "
        "through its camera (needs PyAV)",
    )
    group.add_argument("--panels", action="store_true", help="draw the window's panels too")
    group.add_argument("--gpu", type=int, metavar="N", help="use EGL device N (see doctor)")
    add_capture_arguments(parser, gaps="view")
    add_cleanup_arguments(parser)
    add_frame_arguments(parser, "A:B[:STEP]")
    group = parser.add_argument_group("videos, numbered images, contact sheets")
    add_settings(group, Request, "turntable", "contact_sheet", "onion", "speed")
    add_settings(group, ViewOptions, "follow")
    add_settings(group, Request, "video_quality")
    add_pose_arguments(parser)
    add_camera_arguments(parser)
    add_display_arguments(parser)
    add_skinning_arguments(parser)


@dataclass(slots=True, eq=False)
class Drawing:
    """What is drawn, how, and where it is written."""

    asked: SceneOptions
    view: ViewOptions
    options: DisplayOptions
    request: Request
    size: tuple[int, int]
    force: bool
    """Whether existing files are replaced."""
    panels: bool
    device: int | None
    """Index of the EGL device."""
    is_chosen: bool
    """Whether the quality was chosen."""

    def check(self, files: Sequence[Path], scene: Scene | None = None) -> None:
        """Raise if a file must not be replaced."""
        check_targets(files, inputs_of(self.asked, scene), self.force)


def run(arguments: argparse.Namespace) -> int:
    """Render the images, write them, and print their names."""
    if arguments.overlay is not None:
        for name in ("video", "images", "view", *VIEWS):
            if getattr(arguments, name) not in (None, False):
                other = name.replace("_", "-")
                raise ViewerError(f"--overlay and --{other}: expected one of them, found both")
        arguments.video, arguments.no_grid = arguments.overlay, True
    size = SIZE if arguments.size is None else parse_size(arguments.size)
    output = Path(arguments.output)
    asked, view = scene_options(arguments), settings_of(ViewOptions, arguments)
    _check_suffix(asked, output)
    request = settings_of(Request, arguments, output=output)
    quality = arguments.video_quality is not None
    complete(request, asked.frames, view, arguments.panels, has_quality=quality)
    if request.kind != "pictures":
        check_targets([output], inputs_of(asked), arguments.force)
    options, is_chosen = display_of(arguments), arguments.quality is not None
    if not is_chosen and (not request.is_still or arguments.panels):
        options.quality = "normal"
    if arguments.gpu is not None:
        from viewer.rendering.gpu.context import check_device

        check_device(arguments.gpu)
    if options.background == "transparent" and output.suffix.lower() in _OPAQUE:
        print_warnings([f"{printable(output)}: this format has no transparency"])
    scene = open_scene(asked)
    print_warnings(use_file_method(scene, options.skinning, stated(Skinning, arguments)))
    print_warnings(look_through_video(view, asked.motion, scene))
    if arguments.overlay is not None:
        if scene.images is None:
            raise ViewerError("--overlay: expected a capture with a camera, found none")
        if arguments.size is None:
            size = scene.images.size_of(scene.images.cameras[0]) or size
    hide_parts(view, scene, options)
    print_warnings(choose_subject(scene, options))
    notes = camera_notes(view, asked.motion, scene, options)
    print_warnings(warn_of_missing(scene, options) + notes)
    drawing = Drawing(
        *(asked, view, options, request, size),
        *(arguments.force, arguments.panels, arguments.gpu, is_chosen),
    )
    if request.kind == "onion":
        _draw_onion(drawing, scene)
    elif request.kind and (request.is_certain or any(a.clip for a in scene.actors)):
        print(draw_sequence(drawing, scene), file=summary_stream(output))
    else:
        _draw_still(drawing, scene)
    return 0


def _draw_still(drawing: Drawing, scene: Scene) -> None:
    from viewer.formats import save_image
    from viewer.rendering.camera_views import with_cameras

    options, view, size = drawing.options, drawing.view, drawing.size
    output = drawing.request.output
    drawing.check([output], scene)
    points = scene_points(scene, options.show)
    box = bounding_box(points)
    if view.follow is not None:
        view.look_at = view.follow  # like one frame of a video that follows it
    print_warnings(follow_notes(view, scene))
    camera = camera_of(view, scene, with_cameras(scene, options, points), size)
    if drawing.panels:
        pixels = _draw_panels(scene, size, camera, options, box, drawing.device, view.fits)
    else:
        is_chosen = drawing.is_chosen
        pixels = draw_scene(scene, size, camera, options, box, drawing.device, is_chosen)
    save_image(output, pixels)
    grid = f", grid {_grid_step(points):g}" if options.grid else ""
    colors = scalar_text(scene, options)
    line = f"{printable(output)}: {size[0]} x {size[1]}{grid}{colors}"
    print(line, file=summary_stream(output))


def _draw_onion(drawing: Drawing, scene: Scene) -> None:
    """Draw several poses of a motion in one image."""
    from viewer.formats import save_image
    from viewer.rendering.camera_views import with_cameras
    from viewer.rigs.motion.onion import onion

    asked, options, size = drawing.asked, drawing.options, drawing.size
    output = drawing.request.output
    frames, pose = asked.frames, asked.pose
    recording, notes = recording_of(drawing.request, frames, pose, scene, options)
    drawing.check([output], scene)
    print_warnings(notes)
    poses = onion(scene, recording.times.tolist(), interpolate=recording.interpolate)
    points = scene_points(poses, options.show)
    camera = camera_of(drawing.view, poses, with_cameras(poses, options, points), size)
    box = bounding_box(points)
    pixels = draw_scene(poses, size, camera, options, box, drawing.device, drawing.is_chosen)
    save_image(output, pixels)
    numbers = ", ".join(map(str, recording.numbers))
    line = f"{printable(output)}: {size[0]} x {size[1]}, poses of frames {numbers}"
    print(line, file=summary_stream(output))


def _check_suffix(asked: SceneOptions, output: Path) -> None:
    """Check that the suffix is that of an image or video."""
    suffix = output.suffix.lower()
    try:
        is_ours = output.is_file() or not output.exists()
    except (OSError, ValueError):
        return  # reported by check_targets
    if suffix not in ("", *PICTURES, *VIDEOS) and is_ours:
        # Overwriting an input is worse, so it is reported first.
        check_targets([output], inputs_of(asked), force=True)
        check_format(output)


def check_format(output: Path) -> None:
    """Raise for a suffix of neither an image nor a video."""
    suffix = output.suffix.lower()
    if suffix not in ("", *PICTURES, *VIDEOS):
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
    """Return the scene's pixels, (H, W, 4) uint8; the driver's limitations are printed."""
    # The default quality is lowered if drawing it in software would take long.
    from viewer.commands._progress import shown_progress
    from viewer.rendering.gpu.context import thread_graphics
    from viewer.rendering.offscreen import Offscreen
    from viewer.rendering.sampling import limit_passes, time_note

    def report_time(seconds: float, count: int) -> None:
        print_warnings(time_note(seconds, count), "note")

    with deferred(), Offscreen(graphics=thread_graphics(device)) as offscreen:
        notes = [] if is_chosen else limit_passes(options, scene, size, offscreen.context)
        print_warnings(notes, "note")
        with shown_progress("drawing"):
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
    from viewer.phrases import in_window
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


def complete(
    request: Request, frames: Frames, view: ViewOptions, panels: bool, has_quality: bool
) -> None:
    """Set the requested output's kind and range of frames; refuse options that do not fit it."""
    output = request.output
    request.range = None if frames.frames is None else parse_range(frames.frames)
    asks = request.range is not None or request.turntable is not None
    if request.contact_sheet is not None:
        request.kind = "sheet"
    elif request.onion is not None:
        request.kind = "onion"
    elif _FIELD.search(str(output)):
        request.kind = "pictures"
    elif output.suffix.lower() == ".gif":
        wants = asks or view.follow is not None or request.speed is not None
        if wants or not (frames.is_one or panels):
            request.kind, request.is_certain = "video", wants
    elif output.suffix.lower() in VIDEOS:
        request.kind = "video"
    elif asks:
        request.kind = "pictures"
    if request.kind and panels:
        raise ViewerError("--panels: applies to single images only, not to videos or sequences")
    frames.check()
    if view.follow is not None and view.look_at is not None:
        raise ViewerError("--follow and --look-at: expected one of them, found both")
    _check_onion(request, frames, view)
    given = {"speed": request.speed is not None, "video-quality": has_quality}
    for option, is_given in given.items():
        if is_given and request.kind != "video":
            raise ViewerError(f"--{option}: applies to videos only: {', '.join(VIDEOS)}")
    suffix, speed, cells = request.output.suffix.lower(), request.speed, request.contact_sheet
    if has_quality and suffix == ".gif":
        raise ViewerError("--video-quality: applies to .mp4 and .webm, not to a GIF")
    if speed is not None and not 1e-3 <= abs(speed) <= 1e3:
        raise ViewerError(f"--speed: expected 0.001 to 1000 or their negatives, found {speed:g}")
    if cells is not None and not 1 <= cells <= _MOST_CELLS:
        raise ViewerError(f"--contact-sheet: expected 1 to {_MOST_CELLS} frames, found {cells}")
    if request.kind == "sheet" and suffix in (".mp4", ".webm"):
        raise ViewerError(
            "--contact-sheet: expected an image file name, such as .png, found a video"
        )
    if request.kind == "pictures":
        # Check the frame field of a name: ``{frame}`` or ``{frame:05}``.
        name = str(output)
        try:
            fields = [part for part in string.Formatter().parse(name) if part[1] is not None]
        except ValueError:
            fields = []
        is_good = fields and all(
            field == "frame" and conversion is None and re.fullmatch(r"0?\d{0,2}d?", spec or "")
            for _, field, spec, conversion in fields
        )
        if not is_good:
            raise ViewerError(
                "--output: expected {frame} or {frame:05} in the name of numbered images, as in "
                f'frame_{{frame:05}}.png, found "{printable(name)}"'
            )
        # A GIF may be either an image or a video.
        if suffix in VIDEOS and suffix not in PICTURES:
            raise UnsupportedFormatError(
                f"{printable(output, 300)}: expected an image ({', '.join(PICTURES)}) for one file "
                f"per frame, found {suffix}"
            )


def _check_onion(request: Request, frames: Frames, view: ViewOptions) -> None:
    poses = request.onion
    if poses is None:
        return
    others = {
        "contact-sheet": request.contact_sheet,
        "turntable": request.turntable,
        "follow": view.follow,
        "frame": frames.frame,
        "time": frames.time,
    }
    for name, value in others.items():
        if value is not None:
            raise ViewerError(f"--onion and --{name}: expected one of them, found both")
    if not 2 <= poses <= _MOST_POSES:
        raise ViewerError(f"--onion: expected 2 to {_MOST_POSES} poses, found {poses}")
    if request.output.suffix.lower() in (".mp4", ".webm"):
        raise ViewerError("--onion: expected the name of a picture, such as .png, found a video")


def draw_sequence(drawing: Drawing, scene: Scene) -> str:
    """Draw and write all frames; return a line about the written files."""
    from viewer.commands._progress import shown_progress
    from viewer.rendering.camera_views import with_cameras
    from viewer.rendering.framing import (
        find_follow,
        fit_turntable,
        frame_motion,
        framed_poses,
        level_shifts,
        seen_aspect,
    )
    from viewer.rendering.gpu.context import thread_graphics
    from viewer.rendering.gpu.target import check_size
    from viewer.rendering.offscreen import Offscreen
    from viewer.rendering.recorder import record

    asked, request, view = drawing.asked, drawing.request, drawing.view
    options, size = drawing.options, drawing.size
    recording, notes = recording_of(request, asked.frames, asked.pose, scene, options)
    outputs = [request.output]
    if request.kind == "pictures":
        pattern = str(request.output)
        outputs = [Path(pattern.format(frame=number)) for number in recording.numbers]
    drawing.check(outputs, scene)
    if view.follow is not None:
        recording.follow = find_follow(scene, view.follow)
    elif request.kind == "sheet" and view.view is None and recording.moves:
        recording.shifts = level_shifts(recording)
    points, recording.box = frame_motion(recording)
    points = with_cameras(scene, options, points, framed_poses(recording))
    aspect = seen_aspect(camera_of(view, scene, points, size), points)
    recording.size = size
    sink = _sink(request, recording, outputs, aspect)
    print_warnings([*notes, *follow_notes(view, scene), *sink.notes])
    frame_size = recording.size
    recording.camera = camera_of(view, scene, points, frame_size)
    if view.distance is None and view.look_at is None:
        shape = frame_size[0] / frame_size[1]
        fit_turntable(recording.camera, points, shape, recording.turntable)
    title = f"drawing {printable(outputs[0].name)}"
    hold()
    with Offscreen(graphics=thread_graphics(drawing.device)) as offscreen, offscreen.context:
        if request.kind == "sheet":
            cells = f"cells of a contact sheet of {size[0]} x {size[1]} pixels"
            check_size(offscreen.context, frame_size, cells)
        steps = record(recording, offscreen.renderer, sink)
        # The drawing is closed while the context still exists, even after an error.
        try:
            with shown_progress(title), contextlib.closing(steps):
                for _ in steps:
                    pass
        except BaseException:  # also Ctrl-C
            if sink.n_kept:
                kept = f"{sink.n_kept} of {len(outputs)} pictures were written, and are kept"
                print_warnings([kept])
            raise
        print_warnings(offscreen.renderer.notes)
    return _summary(request, recording, outputs, sink, request.skips(asked.frames.fps))


def _sink(
    request: Request,
    recording: Recording,
    outputs: list[Path],
    aspect: float,
) -> PictureSink | SheetSink | VideoSink:
    """Return the sink of the frames, which have the size of the cells in a contact sheet."""
    size = recording.size
    if request.kind == "video":
        from viewer.media.video import VideoSink

        is_transparent = recording.options.background == "transparent"
        return VideoSink(outputs[0], size, recording.rate, request.video_quality, is_transparent)
    from viewer.media.picture_sinks import PictureSink, SheetSink

    if request.kind == "sheet":
        sheet = SheetSink(outputs[0], size, recording.numbers, min(max(aspect, _NARROW), _WIDE))
        recording.size = sheet.cell
        return sheet
    return PictureSink(outputs)


def _summary(
    request: Request,
    recording: Recording,
    outputs: list[Path],
    sink: PictureSink | SheetSink | VideoSink,
    skips: bool,
) -> str:
    name, count, seconds = printable(outputs[0]), recording.n_frames, recording.seconds
    frames = "1 frame" if count == 1 else f"{count} frames"
    pixels = "{} x {}".format(*recording.size)
    weight = f"{sink.n_bytes / 1e6:.2f} MB"
    if request.kind == "video":
        own = "at the motion's own speed; --fps sets it"
        remark = f" (one of {request.step} frames, {own})" if skips else ""
        rate = f"{recording.rate:g} frames per second{remark}"
        return f"{name}: {frames}, {seconds:.3g} s, {pixels}, {rate}, {weight}"
    if request.kind == "sheet":
        return f"{name}: {frames} of {pixels}, {weight}"
    last = f" to {printable(outputs[-1].name)}" if count > 1 else ""
    return f"{name}{last}: {frames}, {seconds:.3g} s, {pixels}, {weight}"
