"""Frame files of an EasyMocap recording and their frames on a common timeline."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import field
from pathlib import Path

from viewer.data_classes import dataclass
from viewer.diagnostics import wording
from viewer.formats._published_models import published_names
from viewer.formats._source import Source
from viewer.phrases import Remedy, counted, listed, printable

BODIES = ("smpl_full", "smplfull", "smpl")
"""Folders of body parameters, the most complete first."""
POINTS = "keypoints3d"
"""Folder of keypoints."""
_SUFFIX = ".json"

# Maximum number of frames of a timeline: this many for every file, plus a constant.
_MOST_HOLES = 10
_FEW = 1000
_NUMBERED = re.compile(r"(.*?)([0-9]+)(\D*)")


@dataclass(slots=True)
class FrameFolder:
    """The frame files of one folder."""

    path: Path
    """The folder."""
    has_bodies: bool = True
    has_points: bool = True
    """Data to read from its files."""
    names: dict[int, str] = field(default_factory=dict)
    """File names by frame, counted from the first frame of the recording."""


@dataclass(slots=True)
class FrameFiles:
    """All frame files of a recording."""

    folders: list[FrameFolder]
    """Folders, which are read in this order for each frame."""
    frames: list[int] = field(default_factory=list)
    """Frames with a file, ascending."""
    n_frames: int = 0
    first_frame: int = 0
    """Length of the timeline, and the file number of its first frame."""


def find_frames(source: Source) -> FrameFiles:
    """Find the frame files of an EasyMocap output folder, one of its subfolders, or a file."""
    if not source.is_folder:
        folder = FrameFolder(source.path.parent)
        return _on_timeline(source, [folder], [[source.path.name]])
    names, inside = _look(source, source.path)
    folders = _folders(source, names, inside)
    found = []
    for folder in folders:
        names, inside = _look(source, folder.path)
        if not names and inside:
            names = _first_camera(source, folder, inside)
        found.append(names)
    if not any(found):
        models = published_names(source.path)
        if models:
            raise source.fault(
                wording.MODEL_FOLDER,
                names=listed(models, 12),
                remedy=Remedy(
                    "choose it with File > Models > Choose model folder",
                    "name it with --model-path",
                ),
            )
        raise source.fault(
            "F002.capture-frames: expected frame files (smpl_full, smplfull, smpl, "
            "keypoints3d: 000000.json …), found none"
        )
    first = ((folder.path, names[0]) for folder, names in zip(folders, found, strict=True) if names)
    source.also_read += [(path / name).parent for path, name in first]
    return _on_timeline(source, folders, found)


def _look(source: Source, folder: Path) -> tuple[list[str], list[str]]:
    """Return the names of a folder's frame files and of its subfolders, sorted."""
    files, folders, others = [], [], []
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                is_frame = entry.name.lower().endswith(_SUFFIX) and entry.name[0] != "."
                if is_frame and entry.is_file():
                    files.append(entry.name)
                elif entry.is_dir():
                    folders.append(entry.name)
                elif is_frame:
                    others.append(entry.name)
    except OSError as problem:
        name, reason = printable(folder.name, 100), str(problem.strerror or problem)
        raise source.fault(
            "F001.capture-folder: {item}: cannot be read: {reason}", item=name, reason=reason
        ) from None
    if others:
        source.warn("F007.capture-no-files: ignored (not files): {names}", names=listed(others))
    return sorted(files), sorted(folders)


def _folders(source: Source, names: list[str], inside: list[str]) -> list[FrameFolder]:
    """Return the folders with frames: known subfolders, or the folder that was opened."""
    bodies = [name for name in BODIES if name in inside]
    points = [POINTS] if POINTS in inside else []
    if not bodies and not points:
        return [FrameFolder(source.path)]
    if len(bodies) > 1:
        source.warn(
            "F007.capture-beside: read {name}/, ignored {others}/ in the same folder",
            name=bodies[0],
            others=" and ".join(bodies[1:]),
        )
    if names:
        source.warn(
            "F007.capture-files: ignored files next to the frame folders: {names}",
            names=listed(names),
        )
    both = bool(bodies and points)
    return [
        FrameFolder(source.path / name, name != POINTS or not both, name == POINTS or not both)
        for name in (*bodies[:1], *points)
    ]


def _first_camera(source: Source, folder: FrameFolder, inside: list[str]) -> list[str]:
    """Descend into the first subfolder with frames: each view may have its own subfolder."""
    holding = [(name, files) for name in inside if (files := _look(source, folder.path / name)[0])]
    if not holding:
        return []
    first, files = holding[0]
    if len(holding) > 1:
        others = [name for name, _ in holding[1:]]
        source.warn(
            "F007.capture-camera: read {folder}/{name}, ignored other cameras: {others}",
            folder=folder.path.name,
            name=first,
            others=listed(others),
        )
    folder.path = folder.path / first
    return files


def _on_timeline(source: Source, folders: list[FrameFolder], found: list[list[str]]) -> FrameFiles:
    """Assign a frame to every file: by number, with gaps, if possible; otherwise consecutively."""
    files = FrameFiles(folders)
    place: dict[str, int] = {}
    numbered = [_numbered(names) for names in found]
    if all(numbers or not names for numbers, names in zip(numbered, found, strict=True)):
        numbers = {name: number for part in numbered for name, number in part.items()}
        foreign = [name for names in found for name in names if name not in numbers]
        if foreign:
            source.warn(
                "F007.capture-foreign: ignored files that are not named like the frames: {names}",
                names=listed(list(dict.fromkeys(foreign))),
            )
        found = [[name for name in names if name in numbers] for names in found]
        order = sorted(set(numbers.values()))
        first, last = order[0], order[-1]
        if last - first < _MOST_HOLES * len(order) + _FEW:
            place = {name: number - first for name, number in numbers.items()}
            files.first_frame = first
        else:
            source.warn(
                "F007.capture-numbers: {n} numbered from {first} to {last}: treated as consecutive",
                n=counted(len(order), "frame"),
                first=first,
                last=last,
            )
            rank = {number: index for index, number in enumerate(order)}
            place = {name: rank[number] for name, number in numbers.items()}
    else:
        names = sorted({name for names in found for name in names}, key=_stem)
        place = {name: index for index, name in enumerate(names)}
    for folder, names in zip(folders, found, strict=True):
        _put(source, folder, ((place[name], name) for name in names))
    files.frames = sorted(set(place.values()))
    files.n_frames = files.frames[-1] + 1
    return files


def _stem(name: str) -> str:
    return name[: -len(_SUFFIX)]


def _numbered(names: list[str]) -> dict[str, int]:
    """Return the numbers in the names of most files, which differ by them only; none if few do.

    >>> _numbered(["f01.json", "f02.json", "notes_2024.json"])
    {'f01.json': 1, 'f02.json': 2}
    """
    parts = {name: match for name in names if (match := _NUMBERED.fullmatch(_stem(name)))}
    counts = Counter((match[1], match[3]) for match in parts.values())
    if not counts:
        return {}
    usual = ("", "") if ("", "") in counts else counts.most_common(1)[0][0]
    if 2 * counts[usual] < len(names):
        return {}
    return {name: int(match[2]) for name, match in parts.items() if (match[1], match[3]) == usual}


def _put(source: Source, folder: FrameFolder, frames: Iterable[tuple[int, str]]) -> None:
    doubled = []
    for frame, name in frames:
        if folder.names.setdefault(frame, name) != name:
            doubled.append(name)
    if doubled:
        source.warn(
            "C005.capture-twice: omitted frames that occur in more than one file: {names}",
            names=listed(doubled),
        )
