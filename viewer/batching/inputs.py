"""Inputs of a batch: patterns, folders, lists of files, in natural order and without duplicates."""

from __future__ import annotations

import glob
import os
import re
import sys
from collections.abc import Collection, Iterable, Iterator, Sequence
from pathlib import Path

from viewer.data_classes import dataclass
from viewer.errors import ViewerError, reason_of
from viewer.formats import FORMATS, all_suffixes
from viewer.formats._published_models import published_names
from viewer.media.file_names import natural_key
from viewer.phrases import counted, listed, printable

_AMBIGUOUS = (".txt", ".json")  # usually notes and settings, not poses
_WILD = re.compile(r"[*?[]")
# Files next to the motions of AMASS, in its first and second release.
_SHAPE_FILES = re.compile(r"shape\.npz|.*_stagei\.npz")


@dataclass(frozen=True)
class Inputs:
    """The inputs that the arguments of a batch select."""

    paths: tuple[str, ...]
    """Files, and folders that are one input each, sorted; spelled as given."""
    base: str
    """Absolute path of the folder that contains all arguments. It depends only on the arguments,
    not on the files that a pattern happens to match."""
    folders: frozenset[str] = frozenset()
    """The paths that are folders."""
    notes: tuple[str, ...] = ()
    """Messages about duplicates and skipped files."""


def find_inputs(
    words: Iterable[str],
    lists: Iterable[str] = (),
    suffixes: Collection[str] = (),
    keeps_folders: bool = False,
    output: str = "",
) -> Inputs:
    """Find the inputs of a batch.

    ``words``: files, folders, patterns such as ``data/**/*.npz`` (a name that exists is not a
    pattern), ``@list.txt`` for a list, and ``-`` for a list on standard input. ``lists``: files
    with one path per line, or separated by null bytes, as by ``find -print0``. ``suffixes``: of the
    files taken from a folder; by default, those that identify a format. ``keeps_folders``: whether
    each folder is one input, as recordings and models that consist of a folder always are.
    ``output``: folder of the outputs, whose files are not inputs of a batch that is resumed.
    """
    wanted = {suffix.lower() for suffix in suffixes} or {*all_suffixes()} - {*_AMBIGUOUS}
    search = _Search(wanted, keeps_folders, os.path.abspath(output) if output else "")
    for name in lists:
        search.add_list(name)
    for word in words:
        if word == "-":
            search.add_list(word)
        elif word.startswith("@") and not os.path.lexists(word):
            search.add_list(word[1:])
        elif os.path.lexists(word) or not _WILD.search(word):
            search.add_named(word)
        else:
            search.add_pattern(word)
    if not search.roots:
        raise ViewerError("expected files, folders or patterns, found none")
    return search.result()


def is_recording(folder: str | Path) -> bool:
    """Return whether a folder is a single recording or model, recognised by its files."""
    try:
        names = os.listdir(folder)
    except OSError:
        return False
    kinds = [key for key, kind in FORMATS.items() if not {*kind.files}.isdisjoint(names)]
    if kinds:
        # Folders of body models often have a subfolder "smpl", as recordings do.
        return kinds != ["easymocap"] or not published_names(Path(folder))
    frames = [name for name in names if not name.startswith(".")]
    return bool(frames) and all(re.fullmatch(r"\d+\.json", name) for name in frames)


class _Search:
    """The paths found so far."""

    def __init__(self, suffixes: set[str], keeps_folders: bool, output: str) -> None:
        self.suffixes, self.keeps_folders, self.output = suffixes, keeps_folders, output
        self.roots: list[str] = []  # folders that contain the arguments
        self._found: dict[tuple[str, str], str] = {}
        self._real: dict[str, str] = {}  # real paths of folders
        self._folders: set[str] = set()
        self._n_repeated = 0
        self._n_skipped = self._n_outputs = 0
        self._without_motion: dict[str, int] = {}  # number of files by name

    def add_named(self, path: str) -> None:
        """Add a file, or a folder and its contents."""
        if not os.path.exists(path):
            raise ViewerError(f"{printable(path, 300)}: no such file or folder")
        is_folder = os.path.isdir(path)
        if not is_folder or self._is_input(path):
            self.roots.append(os.path.dirname(os.path.abspath(path)))
            self._add(path, is_folder)
            return
        self.roots.append(os.path.abspath(path))
        before = self._n_seen
        for each, is_folder in self._inside(path):
            if not self._is_output(each) and not self._is_shape(each):
                self._add(each, is_folder)
        if self._n_seen == before:
            raise ViewerError(
                f"{printable(path, 300)}: no file in this folder has a suffix of a known format; "
                f"use a pattern to select other files"
            )

    def add_list(self, name: str) -> None:
        """Add the paths in a file, or on standard input."""
        for path in _listed(name):
            self.add_named(path)

    def add_pattern(self, pattern: str) -> None:
        """Add the files that match a pattern, and the folders that are inputs."""
        head = pattern[: _WILD.search(pattern).start()]  # type: ignore[union-attr]
        self.roots.append(os.path.abspath(os.path.dirname(head)))
        before = self._n_seen
        for path in glob.iglob(pattern, recursive=True):
            is_folder = os.path.isdir(path)
            is_input = self._is_input(path) if is_folder else not self._is_shape(path)
            if is_input and not self._is_output(path):
                self._add(path, is_folder)
        if self._n_seen == before:
            raise ViewerError(f"{printable(pattern, 300)}: no file matches this pattern")

    def result(self) -> Inputs:
        """Return all inputs, sorted."""
        notes = []
        if self._n_repeated:
            notes.append(f"{counted(self._n_repeated, 'path')} named more than once, used once")
        if self._n_skipped:
            text = counted(self._n_skipped, "file")
            notes.append(f"{text} in folders skipped: unknown suffix")
        if self._without_motion:
            text = counted(sum(self._without_motion.values()), "file")
            names = listed([printable(name, 60) for name in sorted(self._without_motion)])
            notes.append(f"{text} of AMASS without a motion skipped: {names}")
        if self._n_outputs:
            notes.append(f"{counted(self._n_outputs, 'file')} in the folder of the outputs omitted")
        paths = sorted(self._found.values(), key=natural_key)
        return Inputs(tuple(paths), _common(self.roots), frozenset(self._folders), tuple(notes))

    @property
    def _n_seen(self) -> int:
        return len(self._found) + self._n_repeated

    def _is_output(self, path: str) -> bool:
        """Return whether a path is in the output folder, if that folder is within the last root."""
        if not self.output or not self.output.startswith(os.path.join(self.roots[-1], "")):
            return False
        found = f"{os.path.abspath(path)}{os.sep}".startswith(f"{self.output}{os.sep}")
        self._n_outputs += found
        return found

    def _is_shape(self, path: str) -> bool:
        """Return whether a file of AMASS has the shape of a subject, but no motion; count it."""
        name = os.path.basename(path)
        found = _SHAPE_FILES.fullmatch(name.lower()) is not None
        if found:
            self._without_motion[name] = self._without_motion.get(name, 0) + 1
        return found

    def _is_input(self, folder: str) -> bool:
        return self.keeps_folders or is_recording(folder)

    def _add(self, path: str, is_folder: bool = False) -> None:
        path = os.path.normpath(path)
        folder, name = os.path.split(path)
        if folder not in self._real:
            # Links to folders may form loops; linked files keep the names of their links.
            self._real[folder] = os.path.realpath(folder or ".")
        key = (self._real[folder], name)
        if key in self._found:
            self._n_repeated += 1
        else:
            self._found[key] = path
            if is_folder:
                self._folders.add(path)

    def _inside(self, top: str) -> Iterator[tuple[str, bool]]:
        """Yield visible files and recordings below a folder, each with whether it is a folder."""
        visited, left = set[tuple[int, int]](), [top]
        while left:  # not recursive: folders may be thousands of levels deep
            folder = left.pop()
            try:
                status = os.stat(folder)
                with os.scandir(folder) as found:
                    entries = [entry for entry in found if not entry.name.startswith(".")]
            except OSError as problem:
                raise ViewerError(f"{printable(folder, 300)}: {reason_of(problem)}") from None
            entries.sort(key=lambda entry: entry.name)
            identity = status.st_dev, status.st_ino
            if identity in visited:
                continue
            visited.add(identity)
            inner = []
            for entry in entries:
                if entry.is_dir():
                    if is_recording(entry.path):
                        yield entry.path, True
                    else:
                        inner.append(entry.path)
                elif os.path.splitext(entry.name)[1].lower() in self.suffixes:
                    yield entry.path, False
                else:
                    self._n_skipped += 1
            # If two links lead to the same folder, the first one is followed.
            left += reversed(inner)


def _listed(name: str) -> list[str]:
    """Return the paths in a file, or on standard input for ``-``."""
    shown = "standard input" if name == "-" else printable(name, 300)
    try:
        if name == "-":
            if sys.stdin is None:
                raise ViewerError("standard input is closed: expected a list of paths")
            data = sys.stdin.buffer.read()
        else:
            data = Path(name).read_bytes()
    except OSError as problem:
        raise ViewerError(f"{shown}: {reason_of(problem)}") from None
    separator = b"\0" if b"\0" in data else b"\n"
    lines = [os.fsdecode(line.rstrip(b"\r")) for line in data.split(separator)]
    paths = [line for line in lines if line.strip()]
    if not paths:
        raise ViewerError(f"{shown}: expected one path per line, found none")
    return paths


def _common(folders: Sequence[str]) -> str:
    """Return the deepest folder that contains all of some absolute folders."""
    try:
        return os.path.commonpath({*folders})
    except ValueError:  # the folders are on several drives
        return ""
