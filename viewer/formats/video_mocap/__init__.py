"""Reader of results of video motion capture: people reconstructed from a video.

Each tool writes different files, which are recognised by their contents: see the modules of this
folder. People keep their IDs and the frames in which they are visible.
"""

from __future__ import annotations

from dataclasses import replace

from viewer.diagnostics import wording
from viewer.formats._archive.checking import archive_of
from viewer.formats._source import Source
from viewer.formats.video_mocap.results import Options, Results, capture_of
from viewer.formats.video_mocap.tools import TOOLS, folder_tool, module_of, tool_of
from viewer.phrases import listed, printable
from viewer.rig.captures.capture import Capture

_LISTED = 12  # maximum number of keys listed in a message


def read(source: Source) -> Capture:
    """Open results with default options; see ``open_results``."""
    return open_results(source)


def open_results(
    source: Source,
    frame_rate: float | None = None,
    space: str = "",
    up: str = "",
    average_shape: bool = False,
    video_rate: float | None = None,
) -> Capture:
    """Open results of a tool.

    ``frame_rate``: frames per second; the tool's rate by default, or 30 if it has none. ``space``:
    one of "world", "camera" or "", the space of the bodies; the world by default, if the file has
    it. ``up``: one of "y", "z", "-y", "-z" or "", up axis of the space; the tool's up axis by
    default. ``video_rate``: frames per second of the video, for tools that do not store a rate.
    Returns the people, and the camera if the file determines it. Raises ``FormatError`` if no
    tool's results are recognised, their arrays contradict each other, or they do not have the
    requested space.
    """
    results = _folder(source) if source.is_folder else _file(source)
    return capture_of(source, results, Options(frame_rate, space, up, average_shape, video_rate))


def _file(source: Source) -> Results:
    archive = archive_of(source)
    tool = tool_of(archive)
    if tool is None:
        raise source.fault(
            "F002.video-unknown: expected results of video motion capture, found keys {found}",
            found=listed(list(archive.keys), 12),
        )
    found: Results = module_of(tool).read(source, archive)
    unread = [printable(key, 40) for key in sorted(archive.unread())]
    ignored = (("not needed", listed(unread, _LISTED)),) if unread else ()
    return replace(found, facts=(*found.facts, *ignored))


def _folder(source: Source) -> Results:
    names = {path.name for path in source.path.iterdir()}
    single = next((row.files for row in TOOLS.values() if row.files in names), None)
    if single is not None:
        return _file(source.inside(single))
    tool = folder_tool(source, names)
    if tool is None:
        raise source.fault(wording.UNKNOWN_FOLDER)
    found: Results = module_of(tool).read_folder(source, names)
    return found
