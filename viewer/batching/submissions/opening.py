"""Access to the files of one submission, unpacked if necessary."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from viewer.batching.submissions.choosing import Chosen, choose, is_junk, suffix_of
from viewer.batching.submissions.unpacking import Archive, open_archive
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.errors import FormatError
from viewer.formats import SUFFIXES
from viewer.media.unfinished import new_prefix

__all__ = ["Submission", "opened"]

_DEEPEST = 3  # maximum number of levels of nested archives
_COMPANIONS = {  # suffixes of files that models refer to
    *(".bin", ".mtl", ".png", ".jpg", ".jpeg", ".bmp", ".tga", ".gif", ".webp", ".tif", ".tiff"),
    *SUFFIXES,
}


@dataclass(frozen=True, slots=True)
class Submission:
    """The files of a submission to compare.

    Attributes
    ----------
    files : tuple of Path
        Files to open together, or one folder.
    base : Path or None
        Temporary folder with the unpacked archive, removed at the end; None for a folder.
    """

    files: tuple[Path, ...]
    base: Path | None = None


@contextmanager
def opened(
    path: str | Path,
    expected: Sequence[str] = (),
    alike: Sequence[str] = (),
    temporary: Path | None = None,
) -> Iterator[Submission]:
    """Open a folder or a zip archive; unpacked files are removed at the end.

    Links that lead out of the folder count as missing files: a submission can't use the files of
    others.

    Parameters
    ----------
    path : str or Path
        The submission.
    expected, alike : sequence of str
        Patterns of its files; see ``choose``.
    temporary : Path, optional
        Folder for unpacked files; the system's temporary folder if omitted or missing.

    Raises
    ------
    FormatError
        If it is not a readable folder or archive, or the files to compare can't be chosen.
    """
    path = Path(path)
    if path.is_dir():
        names = _names_in(path)
        inner = _lone_archive(names)
        if inner is None:
            chosen = choose(names, expected, alike, path)
            yield Submission(tuple(path / name for name in chosen))
            return
        path /= inner
    elif path.exists() and suffix_of(path.name) != ".zip":
        values = {"suffix": path.suffix or "different"}
        raise FormatError(Diagnostic("F002.submission-kind", path, values=values))
    place = _existing(temporary) or Path(tempfile.gettempdir())
    prefix = new_prefix(place, "viewer-submission")
    with tempfile.TemporaryDirectory(prefix=prefix, dir=place) as name:
        folder = Path(name)
        chosen, base = _unpack(path, folder, expected, alike)
        yield Submission(tuple(base / one for one in chosen), base)


def _existing(folder: Path | None) -> Path | None:
    return folder if folder is not None and folder.is_dir() else None


def _names_in(folder: Path) -> list[str]:
    """Return the relative paths of all files in a folder, except junk and outbound links."""
    names = []
    root = folder.resolve()

    def fail(problem: OSError) -> None:
        values = {"reason": problem.strerror or str(problem)}
        raise FormatError(Diagnostic("F001.submission", folder, values=values))

    for place, folders, files in os.walk(folder, onerror=fail):
        inside = Path(place).relative_to(folder)
        folders[:] = [name for name in folders if not is_junk((inside / name / "x").as_posix())]
        for name in files:
            file = Path(place) / name
            if file.is_symlink() and not file.resolve().is_relative_to(root):
                continue
            names.append((inside / name).as_posix())
    return [name for name in names if not is_junk(name)]


def _unpack(
    path: Path, folder: Path, expected: Sequence[str], alike: Sequence[str]
) -> tuple[Chosen, Path]:
    """Unpack the chosen files of an archive, or of the only archive in it.

    Returns the chosen paths and the folder that they are relative to.
    """
    shown = path
    for depth in range(_DEEPEST):
        base = folder / str(depth)
        with open_archive(path, shown, is_junk) as archive:
            inner = _lone_archive([*archive.members])
            if inner is not None:
                archive.unpack([inner], base)
                path, shown = base / inner, shown / inner
                continue
            chosen = choose([*archive.members], expected, alike, shown)
            archive.unpack(_needed(archive, chosen), base)
            return chosen, base
    raise FormatError(Diagnostic("F002.submission-nested", shown, values={"depth": _DEEPEST}))


def _lone_archive(names: Sequence[str]) -> str | None:
    """Return the only archive of a submission, as course platforms often nest them, or None."""
    inner = [name for name in names if suffix_of(name) == ".zip"]
    is_lone = len(inner) == 1 and not any(suffix_of(name) in _COMPANIONS for name in names)
    return inner[0] if is_lone else None


def _needed(archive: Archive, chosen: Chosen) -> Iterable[str]:
    """Return the chosen files, and textures and buffers next to them, which they may need."""
    files = [name for name in chosen if name in archive.members]
    folders = {PurePosixPath(name).parent for name in files} or {
        PurePosixPath(name) for name in chosen
    }
    return [
        name
        for name in archive.members
        if name in files
        or (
            suffix_of(name) in _COMPANIONS
            and any(PurePosixPath(name).is_relative_to(one) for one in folders)
        )
    ]
