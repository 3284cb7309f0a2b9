"""Inputs of ``viewer diff``: files, files joined by "+", or folders that contain a rig."""

from __future__ import annotations

from pathlib import Path

from viewer.errors import FormatError
from viewer.formats import FORMATS, Source, detect
from viewer.phrases import all_of


def input_files(text: str) -> list[Path]:
    """Return the files that one argument refers to: ``A``, ``A+B``, or a folder.

    A folder is in a known format (PIG, EasyMocap), or has rig files that are all opened together,
    such as a student's submission.

    >>> input_files("arm.skel+arm.skin") == [Path("arm.skel"), Path("arm.skin")]
    True
    """
    path = Path(text)
    if not path.exists() and "+" in text:
        parts = [part for part in text.split("+") if part]
        return _existing(parts) or [Path(part) for part in parts]
    if not path.is_dir() or _is_known_folder(path):
        return [path]
    suffixes = [suffix for kind in FORMATS.values() for suffix in kind.suffixes if suffix != ".txt"]
    files = sorted(file for file in path.iterdir() if file.suffix.lower() in suffixes)
    if not files:
        known = list(dict.fromkeys(suffixes))
        raise FormatError.fault(
            "F002.no-rig: expected a folder with rig files ({suffixes}), found none",
            path,
            suffixes=all_of(known),
        )
    return files


def _existing(parts: list[str]) -> list[Path] | None:
    """Return existing files with these names joined; names of folders may contain "+" too."""
    for count in range(len(parts), 0, -1):
        path = Path("+".join(parts[:count]))
        if path.exists():
            rest = _existing(parts[count:])
            if rest is not None:
                return [path, *rest]
    return None if parts else []


def _is_known_folder(path: Path) -> bool:
    try:
        detect(Source.open(path))
    except FormatError:
        return False
    return True
