"""Reader of EasyMocap's output: a folder of JSON files, one per frame, with numbered people.

::

    out/smpl/000000.json          body parameters; smpl_full/ or smplfull/ take precedence
    out/keypoints3d/000000.json   3D keypoints of the same frames
    out/smpl/01/000000.json       fits of single views: the first view is read
    intri.yml, extri.yml          cameras, in that folder or one of the two above it
    images/01/000000.jpg          camera images, in one of the same folders

    frame    [person, …]  or  {"annots": [person, …], …}
    person   {"id": 0, "Rh": [[3]], "Th": [[3]], "poses": [[P]], "shapes": [[10]],
              "expression": [[10]], "handl": [[n]], "handr": [[n]],
              "keypoints3d": [[x, y, z, c], …], "handl3d", "handr3d", "face3d"}

File names that differ only in a number have the frame numbers, with gaps; files named otherwise are
ignored. Names without numbers are sorted. An ``id`` may be a number, also as text, or a name.
Bodies are V = R(Rh) X(poses, shapes) + Th, rotated about the model's origin. The files have no
frame rate.
"""

from __future__ import annotations

from pathlib import Path

from viewer.diagnostics import Diagnostic
from viewer.errors import FormatError
from viewer.formats._source import Source
from viewer.formats.easymocap.cameras import find_cameras
from viewer.formats.easymocap.files import find_frames
from viewer.formats.easymocap.images import find_images
from viewer.formats.easymocap.reading import Options, Reading
from viewer.media.file_names import folder_name
from viewer.phrases import counted
from viewer.rig.captures.capture import Capture

_LEVELS = 3  # number of folders that may contain the cameras, from the folder of the frames upwards


def read(source: Source) -> Capture:
    """Open a recording with default options; only its first people have been read."""
    return open_capture(source)


def open_capture(
    source: Source,
    frame_rate: float = 30.0,
    flat_hands: bool | None = None,
    up: str = "",
    legacy_expression: bool = False,
    layout: str = "",
    images: Path | None = None,
) -> Capture:
    """Open a recording.

    ``frame_rate``: frames per second. ``flat_hands``: whether hand components exclude the mean
    hand; by default, they do for SMPL-X and MANO, but not for SMPL+H. ``up``: one of "y", "z",
    "-y", "-z" or "", up axis of the world; empty to estimate it from the people. ``layout``: layout
    of keypoints, see ``keypoint_layout``, to choose between layouts with the same number of points:
    ``"h36m"``, ``"panoptic"``. ``images``: folder of the cameras' image folders; by default
    ``images`` next to the recording. Returns a recording of which only the first people have been
    read. Errors that concern the files as a whole are in the source's warnings. Raises
    ``FormatError`` if there are no frames, no person in any frame, or no camera in the given
    folder.
    """
    files = find_frames(source)
    options = Options(
        _name(source), frame_rate, flat_hands, up, legacy_expression, layout, source.max_size
    )
    looking = Reading(files, options)
    if not any(part.bodies or part.points for part in looking.parts()):
        raise _refusal(source, len(files.frames), looking.first_fault)
    folder = files.folders[0].path.absolute()
    parents = [folder, *folder.parents][:_LEVELS]
    views, notes = find_cameras(parents, source.max_size)
    frames = range(files.first_frame, files.first_frame + files.n_frames)
    found = find_images(parents, views, frame_rate, frames, images)
    if found is not None:
        views = tuple(found.sized(view) for view in views)
    return Capture(
        options.name,
        files.n_frames,
        files.first_frame,
        lambda: Reading(files, options).parts(),
        up,
        views,
        looking.body_layout.model if looking.body_layout else "",
        tuple(notes),
        found,
    )


def _name(source: Source) -> str:
    """Return a recording's name, ignoring its ``smpl`` folder, whose name is always the same."""
    return folder_name(source.path) if source.is_folder else source.path.stem


def _refusal(source: Source, count: int, fault: Diagnostic | None) -> FormatError:
    if fault is None:
        return source.fault(
            "F002.capture-people: expected people, found none in {n}", n=counted(count, "frame")
        )
    if not source.is_folder:
        return FormatError(fault)
    return source.fault(
        "F002.capture-people-fault: expected people, found none in {n}; first error: {problem}",
        n=counted(count, "frame"),
        problem=fault,
    )
