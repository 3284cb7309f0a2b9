"""Submissions: folders and zip archives, each compared with one reference.

Submitted archives come from anyone: files are unpacked only if they are needed, below limits of
number, size and compression ratio, and never outside the temporary folder. From each submission the
files are chosen that match the reference's in name or kind; junk of operating systems is ignored.
"""

from __future__ import annotations

import errno
import os
import re
import shutil
import stat
import tempfile
import zipfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase, wording
from viewer.errors import FormatError, reason_of
from viewer.formats import SUFFIXES, Source
from viewer.formats._archive.zip import (
    DAMAGE,
    StoredFile,
    check_members,
    check_names,
    check_ratio,
)
from viewer.media.unfinished import new_prefix
from viewer.phrases import counted, listed, printable

_DEEPEST = 3  # maximum number of levels of nested archives
_COMPANIONS = {  # suffixes of files that models refer to
    *(".bin", ".mtl", ".png", ".jpg", ".jpeg", ".bmp", ".tga", ".gif", ".webp", ".tif", ".tiff"),
    *SUFFIXES,
}

_ARCHIVES = (".zip", ".rar", ".7z", ".tar", ".tgz", ".tar.gz", ".tar.bz2", ".tar.xz")
_JUNK_FOLDERS = {"__macosx", "__pycache__"}
_JUNK_FILES = {"thumbs.db", "desktop.ini"}

MOST_BYTES = 2 << 30
"""Maximum number of bytes unpacked from one archive."""

MOST_FILES = 5_000
"""Maximum number of files unpacked from one archive."""

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EMFILE, errno.ENFILE)
_DAMAGE = (*DAMAGE, NotImplementedError)
_QUOTED = re.compile(r"""'.*'|".*\"""", re.DOTALL)  # names in messages

# Parts of the messages of zipfile and zlib, and what they mean.
_REASONS = {
    "not a zip file": "its table of contents at the end is missing: incomplete, or not a zip "
    "archive",
    "truncated": "its data ends too early",
    "crc": "a file in it differs from its checksum",
    "magic number": wording.ZIP_HEADER,
    "differ": wording.ZIP_HEADER,
    "overlap": "files in it overlap",
}


@dataclass(frozen=True, slots=True)
class Submission:
    """The files of a submission to compare."""

    files: tuple[Path, ...]
    """Files to open together, or one folder."""
    base: Path | None = None
    """Temporary folder with the unpacked archive, removed at the end; None for a folder."""


@contextmanager
def opened(
    path: str | Path,
    expected: Sequence[str] = (),
    alike: Sequence[str] = (),
    temporary: Path | None = None,
) -> Iterator[Submission]:
    """Open a folder or a zip archive; unpacked files are removed at the end.

    Links that lead out of the folder count as missing files: a submission can't use the files of
    others. ``expected``, ``alike``: patterns of its files; see ``choose``. ``temporary``: folder
    for unpacked files; the system's temporary folder if omitted or missing.
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
    elif path.exists() and _suffix_of(path.name) != ".zip":
        raise FormatError.fault(
            "F002.submission-kind: expected a folder or a zip archive, found a {suffix} file",
            path,
            suffix=path.suffix or "different",
        )
    place = Path(tempfile.gettempdir())
    if temporary is not None and temporary.is_dir():
        place = temporary
    prefix = new_prefix(place, "viewer-submission")
    with tempfile.TemporaryDirectory(prefix=prefix, dir=place) as name:
        folder = Path(name)
        chosen, base = _unpack(path, folder, expected, alike)
        yield Submission(tuple(base / one for one in chosen), base)


def _names_in(folder: Path) -> list[str]:
    """Return the relative paths of all files in a folder, except junk and outbound links."""
    names = []
    root = folder.resolve()

    def fail(problem: OSError) -> None:
        raise FormatError.fault("F001.submission: {reason}", folder, reason=reason_of(problem))

    for place, folders, files in os.walk(folder, onerror=fail):
        inside = Path(place).relative_to(folder)
        folders[:] = [name for name in folders if not _is_junk((inside / name / "x").as_posix())]
        for name in files:
            file = Path(place) / name
            if file.is_symlink() and not file.resolve().is_relative_to(root):
                continue
            names.append((inside / name).as_posix())
    return [name for name in names if not _is_junk(name)]


def _unpack(
    path: Path, folder: Path, expected: Sequence[str], alike: Sequence[str]
) -> tuple[_Chosen, Path]:
    """Unpack the chosen files of an archive, or of the only one in it; return its folder, too."""
    shown = path
    for depth in range(_DEEPEST):
        base = folder / str(depth)
        with _open_archive(path, shown, _is_junk) as archive:
            inner = _lone_archive([*archive.members])
            if inner is not None:
                archive.unpack([inner], base)
                path, shown = base / inner, shown / inner
                continue
            chosen = choose([*archive.members], expected, alike, shown)
            archive.unpack(_needed(archive, chosen), base)
            return chosen, base
    raise FormatError.fault(
        "F002.submission-nested: expected files to compare, found archives nested {depth} deep",
        shown,
        depth=_DEEPEST,
    )


def _lone_archive(names: Sequence[str]) -> str | None:
    """Return the only archive of a submission, as course platforms often nest them, or None."""
    inner = [name for name in names if _suffix_of(name) == ".zip"]
    is_lone = len(inner) == 1 and not any(_suffix_of(name) in _COMPANIONS for name in names)
    return inner[0] if is_lone else None


def _needed(archive: _Archive, chosen: _Chosen) -> Iterable[str]:
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
            _suffix_of(name) in _COMPANIONS
            and any(PurePosixPath(name).is_relative_to(one) for one in folders)
        )
    ]


@dataclass(frozen=True, slots=True)
class _Found:
    """Submissions, and other files."""

    submissions: tuple[Path, ...]
    """Folders and archives."""
    ignored: tuple[Path, ...] = ()
    """Other files next to them."""


def is_archive(path: str) -> bool:
    """Return whether a file is named like an archive; only zip archives are opened."""
    return path.lower().endswith(_ARCHIVES)


def find_submissions(paths: Sequence[str | Path]) -> _Found:
    """Return the submissions that paths refer to, in the order of the paths, then by name."""
    # One of several paths is a submission. A single folder is a submission if it directly contains
    # readable files; otherwise, each of its folders and archives is one.
    given = [Path(path) for path in paths]
    entries = _entries(given[0]) if len(given) == 1 else []
    inside = [one for one in entries if one.is_dir() or is_archive(one.name)]
    if not inside or any(_is_rig_file(entry) for entry in entries):
        return _Found(tuple(dict.fromkeys(given)))
    return _Found(tuple(inside), tuple(one for one in entries if one not in inside))


def _entries(folder: Path) -> list[Path]:
    if not folder.is_dir():
        return []
    return sorted(one for one in folder.iterdir() if not _is_junk(one.name))


def _is_rig_file(file: Path) -> bool:
    # Grade tables are often next to the submissions.
    suffix = _suffix_of(file.name)
    return file.is_file() and suffix in SUFFIXES and suffix not in (".txt", ".json")


_Chosen = tuple[str, ...]
"""Paths of the files to open together, or of one folder."""


def _is_junk(name: str) -> bool:
    """Return whether a file was added by an operating system or is hidden.

    >>> _is_junk("__MACOSX/._arm.skel"), _is_junk("a/.DS_Store"), _is_junk("a/arm.skel")
    (True, True, False)
    """
    *folders, last = name.lower().split("/")
    return (
        any(part.startswith(".") for part in (*folders, last))
        or any(part in _JUNK_FOLDERS for part in folders)
        or last in _JUNK_FILES
    )


def _suffix_of(name: str) -> str:
    """Return the last suffix of a path, in lower case."""
    return PurePosixPath(name).suffix.lower()


def patterns_of(reference: Iterable[str | Path]) -> list[str]:
    """Return the patterns that find the same kinds of files as those of the reference.

    >>> patterns_of(["solution/Arm.SKEL", "solution/arm.skin"])
    ['*.skel', '*.skin']
    """
    return [f"*{_suffix_of(Path(file).name)}" for file in reference if _suffix_of(Path(file).name)]


def choose(
    names: Sequence[str], expected: Sequence[str], alike: Sequence[str], path: Path
) -> _Chosen:
    """Return the files of a submission to compare.

    The files nearest to the top of the folder are preferred, since submissions often contain
    build folders, backups and the course's own data. ``names``: paths relative to the submission,
    with slashes; without junk. ``expected``: patterns of the required files: each matches one file.
    A pattern with a slash is compared with the whole path, otherwise with the name. ``alike``:
    patterns from the reference (``patterns_of``), used without ``expected`` unless none matches:
    then the folder nearest to the top that has readable files is compared.
    """
    if not expected and not any(_matches(name, one) for one in alike for name in names):
        return (_readable_folder(names, path),)
    found = []
    for pattern, count in Counter(expected or alike).items():
        matching = _nearest([name for name in names if _matches(name, pattern)])
        if len(matching) != count:
            key = "F002.submission-missing: expected {expected} matching {pattern}, found {names}"
            if len(matching) > count:
                key = (
                    "F002.submission-several: expected {expected} matching {pattern}, found "
                    "{names}; "
                    "--expect names the files to use"
                )
            raise FormatError.fault(
                key,
                path,
                expected=counted(count, "file"),
                pattern=pattern,
                names=listed(matching or _offered(names)),
            )
        found += matching
    return tuple(dict.fromkeys(found))


def _matches(name: str, pattern: str) -> bool:
    compared = name if "/" in pattern else name.rpartition("/")[2]
    return fnmatchcase(compared.lower(), pattern.lower())


def _nearest(names: Sequence[str]) -> list[str]:
    depth = min((name.count("/") for name in names), default=0)
    return sorted(name for name in names if name.count("/") == depth)


def _offered(names: Iterable[str]) -> list[str]:
    """Return the files to list in the message about a missing one: readable files, or else all."""
    names = sorted(names)
    return [name for name in names if _choosing_is_rig_file(name)] or names


def _choosing_is_rig_file(name: str) -> bool:
    suffix = _suffix_of(name)
    return suffix in SUFFIXES and suffix != ".txt"


def _is_table(name: str) -> bool:
    """Return whether a file may belong to a folder in a known format, such as PIG."""
    return _suffix_of(name) == ".txt"


def _readable_folder(names: Sequence[str], path: Path) -> str:
    for is_wanted in (_choosing_is_rig_file, _is_table):
        nearest = _nearest([name for name in names if is_wanted(name)])
        folders = sorted({name.rpartition("/")[0] or "." for name in nearest})
        if len(folders) == 1:
            return folders[0]
        if folders:
            raise FormatError.fault(
                "F002.submission-folders: expected one folder with files to compare, found "
                "{names}; --expect names the files to use",
                path,
                names=listed(folders),
            )
    raise FormatError.fault(
        "F002.submission-empty: expected files to compare, found {names}",
        path,
        names=listed(sorted(names)),
    )


@dataclass(frozen=True, slots=True)
class _Archive:
    """An open zip archive."""

    shown: Path
    """Path for messages; that of a nested archive begins with that of the outer one."""
    size: int
    """Size of its file in bytes."""
    archive: zipfile.ZipFile
    members: dict[str, zipfile.ZipInfo]
    """Files by path with slashes, without folders."""

    def unpack(self, names: Iterable[str], folder: Path) -> int:
        """Write members to an empty folder; return their total size in bytes."""
        members = {name: self.members[name] for name in names}
        self._check(members)
        try:
            for name, member in members.items():
                target = folder.joinpath(*name.split("/"))
                target.parent.mkdir(parents=True, exist_ok=True)
                with self.archive.open(member) as packed, target.open("xb") as file:
                    shutil.copyfileobj(packed, file, 1 << 20)
        except _DAMAGE as problem:
            if _is_full(problem):
                raise
            raise self.fault(wording.SUBMISSION_ZIP, reason=_reason(problem)) from None
        return sum(member.file_size for member in members.values())

    def _check(self, members: dict[str, zipfile.ZipInfo]) -> None:
        check_members(members.items(), self.fault)
        for name, member in members.items():
            if stat.S_ISLNK(member.external_attr >> 16):
                raise self.fault(
                    "F002.submission-link: {item}: expected a file, found a symbolic link",
                    item=printable(name, 80),
                )
        # zipfile never returns more bytes of a member than the central directory states.
        total = sum(member.file_size for member in members.values())
        if len(members) > MOST_FILES:
            raise self.fault(
                "F001.submission-count: expected at most {most}, found {found}",
                most=counted(MOST_FILES, "file"),
                found=len(members),
            )
        if total > MOST_BYTES:
            raise self.fault(
                "F001.submission-size: expected at most {most:,.0f} bytes of files, found "
                "{found:,.0f}",
                most=MOST_BYTES,
                found=total,
            )
        check_ratio(total, self.size, self.fault)

    def fault(self, key: str, **values: Any) -> FormatError:
        """Return the error about this archive, with the values of its sentence."""
        return FormatError.fault(key, self.shown, **values)


@contextmanager
def _open_archive(path: Path, shown: Path, is_junk: Callable[[str], bool]) -> Iterator[_Archive]:
    """Open a zip archive whose paths all stay inside it, junk excepted."""
    try:
        storage = StoredFile(Source(path))
        with storage.open() as file, zipfile.ZipFile(file) as archive:
            infos = [info for info in archive.infolist() if not info.is_dir()]
            pairs = [(_path_of(info, shown), info) for info in infos]
            pairs = [(name, info) for name, info in pairs if not is_junk(name)]
            opened = _Archive(shown, storage.size, archive, dict(pairs))
            check_names([name for name, _ in pairs], opened.fault)
            yield opened
    except _DAMAGE as problem:
        if _is_full(problem):
            raise
        raise FormatError.fault(wording.SUBMISSION_ZIP, shown, reason=_reason(problem)) from None


def _path_of(info: zipfile.ZipInfo, shown: Path) -> str:
    """Return a member's path inside the archive; some Windows programs write backslashes."""
    parts = PurePosixPath(info.filename.replace("\\", "/")).parts
    windows = PureWindowsPath(info.filename)
    if not parts or parts[0] == "/" or ".." in parts or windows.drive or windows.root:
        raise FormatError.fault(
            "F002.submission-outside: {item}: expected a path inside the archive, found one "
            "that leads outside",
            shown,
            item=printable(info.filename, 80),
        )
    return "/".join(parts)


def _is_full(problem: Exception) -> bool:
    """Return whether an error was caused by the disk instead of the archive."""
    return isinstance(problem, OSError) and problem.errno in _FULL


def _reason(problem: Exception) -> str | Phrase:
    """Return what is wrong with an archive, without the terms of the library that reads it."""
    if isinstance(problem, OSError) and problem.strerror:
        return printable(problem.strerror, 100)
    if isinstance(problem, EOFError):  # it has no message
        return Phrase("its data ends too early")
    text = _QUOTED.sub("", str(problem)).lower()
    return Phrase(
        next(
            (key for part, key in _REASONS.items() if part in text),
            "its compressed data is invalid",
        )
    )
