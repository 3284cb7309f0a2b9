"""Reader of results of video motion capture: people reconstructed from a video.

Each tool writes different files, which are recognised by their contents: see the modules of this
folder. People keep their IDs and the frames in which they are visible.
"""

from __future__ import annotations

from dataclasses import replace

from viewer.diagnostics import wording
from viewer.formats._archive.checking import archive_of
from viewer.formats._source import Source
from viewer.formats.video_mocap.results import Options as Options
from viewer.formats.video_mocap.results import Results, capture_of
from viewer.formats.video_mocap.tools import (
    TOOLS,
    folder_tool,
    module_of,
    read_results,
    tool_of,
)
from viewer.phrases import listed, printable
from viewer.rigs.captures.capture import Capture

_LISTED = 12  # maximum number of keys listed in a message


def read(source: Source, options: Options | None = None) -> Capture:
    """Read people, and the camera if the file determines it, from results of a tool."""
    results = _folder(source) if source.is_folder else _file(source)
    return capture_of(source, results, options or Options())


def _file(source: Source) -> Results:
    archive = archive_of(source)
    tool = tool_of(archive)
    if tool is None:
        raise source.fault(
            "F002.video-unknown: expected results of video motion capture, found keys {found}",
            found=listed(list(archive.keys), 12),
        )
    found = read_results(tool, source, archive)
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
        raise source.fault(wording.UNKNOWN_FOLDER, folder=printable(source.path))
    found: Results = module_of(tool).read_folder(source, names)
    return found
