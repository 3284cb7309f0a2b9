"""Cameras and their images: ``intri.yml`` and ``extri.yml``, written by OpenCV's FileStorage.

::

    %YAML:1.0
    ---
    names:
      - "01"
    K_01: !!opencv-matrix
      rows: 3
      cols: 3
      dt: d
      data: [ 1200., 0., 512., 0., …
          … ]
    dist_01: …   H_01: 1080   W_01: 1920         in intri.yml; D_01 is the same as dist_01
    R_01: …      Rot_01: …    T_01: …            in extri.yml: rotation vector, matrix, translation

No other YAML syntax is supported. The images of a camera are in a folder with its name.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from pathlib import Path

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note, wording
from viewer.errors import FormatError, reason_of
from viewer.formats._source import Source, remark_on
from viewer.formats._text.numbers import to_number
from viewer.formats._text.words import number_key
from viewer.media.image import decode_picture, picture_dimensions
from viewer.phrases import axes, listed, printable, quoted
from viewer.rigs.arrays import Floats
from viewer.rigs.captures.cameras import CameraImage, CameraView
from viewer.rigs.geometry.rotation import are_rotations, rotation_vector_to_matrix

_INTRINSIC, _EXTRINSIC = "intri.yml", "extri.yml"
_KEY = re.compile(rb"([^\s:\-#\"][^\s:]*|\"[^\"\r\n]*\")[ \t]*:(?:[ \t]+|$)(.*)")
_PART = re.compile(rb"[ \t]+(rows|cols|dt|data)[ \t]*:[ \t]*(.*)")
_ITEM = re.compile(rb"[ \t]*-[ \t]*(.*)")
_MOST = 100_000  # maximum number of elements of a matrix
_NEAR = 1e-3  # tolerance for a rotation matrix; calibrations have few digits
_LARGEST = 1e9  # maximum pixels in a calibration, and maximum distance of a camera in scene units
_SHORTEST = 1e-3  # minimum focal length, pixels
_MOST_BENT = 1e6  # maximum distortion coefficient
Value = Floats | list[str] | str


@dataclass(frozen=True, slots=True, eq=False)
class _Storage:
    """Content of a FileStorage file."""

    source: Source
    """The file."""
    values: dict[str, Value] = field(default_factory=dict)
    """Matrices, lists of strings and single strings by name."""
    lines: dict[str, int] = field(default_factory=dict)
    """Line of each key."""

    def fault(self, key: str, *, item: str, **values: object) -> FormatError:
        """Return an error at the line of an item or, if it is missing, of the cameras' names."""
        end = self.source.line(self.source.end)
        line = self.lines.get(item, self.lines.get("names", end))
        return _fault(self.source, key, line, item=printable(item, 40), **values)


def _fault(source: Source, key: str, line: int, **values: object) -> FormatError:
    return FormatError(Diagnostic(key, source.path, line, values=values))


def find_cameras(
    folders: Sequence[Path], max_size: int
) -> tuple[tuple[CameraView, ...], list[Diagnostic]]:
    """Return the cameras of the first folder with calibration files, and notes on their errors."""
    for folder in folders:
        there = [name for name in (_INTRINSIC, _EXTRINSIC) if (folder / name).is_file()]
        if len(there) == 2:
            try:
                return _cameras(*(Source.open(folder / name, max_size) for name in there))
            except FormatError as problem:
                return (), [
                    remark_on("F007.cameras: {problem}; cameras omitted", problem.diagnostic)
                ]
        if there:
            lacking = _EXTRINSIC if there == [_INTRINSIC] else _INTRINSIC
            return (), [
                note(
                    "F007.cameras-beside: no {name} in the same folder; cameras omitted",
                    folder / there[0],
                    name=lacking,
                )
            ]
    return (), []


def _cameras(
    intrinsic: Source, extrinsic: Source
) -> tuple[tuple[CameraView, ...], list[Diagnostic]]:
    inner, outer = read_storage(intrinsic), read_storage(extrinsic)
    views, notes = [], []
    for name in _names(inner, outer):
        try:
            views.append(_camera(name, inner, outer))
        except FormatError as problem:
            notes.append(remark_on(wording.CAMERA, problem.diagnostic))
    return tuple(views), notes


def _names(inner: _Storage, outer: _Storage) -> list[str]:
    """Return the cameras that one of the files lists, or those that have a matrix K."""
    for file in (inner, outer):
        listed = file.values.get("names")
        if isinstance(listed, list):
            return list(dict.fromkeys(listed))
    return [key.removeprefix("K_") for key in inner.values if key.startswith("K_")]


def _camera(name: str, inner: _Storage, outer: _Storage) -> CameraView:
    matrix = _matrix(inner, f"K_{name}", (3, 3))
    focal = matrix[[0, 1], [0, 1]]
    if not (focal > 0).all() or not np.allclose(matrix[2], [0, 0, 1]):
        raise inner.fault(
            "F002.camera-focal: {item}: focal lengths must be positive and the last row must "
            "be 0 0 1",
            item=f"K_{name}",
        )
    if not (focal.min() >= _SHORTEST and focal.max() <= _LARGEST):
        raise inner.fault(
            "F002.camera-focal-range: {item}: expected focal lengths of {low:g} to {high:g} "
            "pixels, found {first:g} and {second:g}",
            item=f"K_{name}",
            low=_SHORTEST,
            high=_LARGEST,
            first=float(focal[0]),
            second=float(focal[1]),
        )
    _check_size(inner, f"K_{name}", matrix[:2])
    lens = next((key for key in (f"dist_{name}", f"D_{name}") if key in inner.values), "")
    values = inner.values.get(lens)
    distortion = values.ravel() if isinstance(values, np.ndarray) else np.zeros(0)
    _check_size(inner, lens, distortion, _MOST_BENT)
    translation = _matrix(outer, f"T_{name}", (3,))
    _check_size(outer, f"T_{name}", translation)
    sizes = [inner.values.get(f"{axis}_{name}") for axis in "WH"]
    width, height = [_pixels(size) for size in sizes]
    return CameraView(
        name,
        matrix,
        _rotation(outer, name),
        translation,
        (width, height) if width and height else None,
        distortion,
    )


def _check_size(file: _Storage, key: str, values: Floats, largest: float = _LARGEST) -> None:
    """Refuse numbers that are too large for rendering in single precision."""
    worst = float(values.ravel()[np.abs(values).argmax()]) if values.size else 0.0
    if abs(worst) > largest:
        raise file.fault(
            "F003.camera-limit: {item}: expected numbers within ±{limit:g}, found {found:g}",
            item=key,
            limit=largest,
            found=worst,
        )


def _rotation(file: _Storage, name: str) -> Floats:
    """Return R: the matrix if the file has one, otherwise the rotation of the rotation vector."""
    if f"Rot_{name}" not in file.values:
        return rotation_vector_to_matrix(_matrix(file, f"R_{name}", (3,)))
    rotation = _matrix(file, f"Rot_{name}", (3, 3))
    if not are_rotations(rotation, _NEAR):
        raise file.fault("F002.camera-rotation: {item}: not a rotation matrix", item=f"Rot_{name}")
    return rotation


def _matrix(file: _Storage, key: str, shape: tuple[int, ...]) -> Floats:
    value = file.values.get(key)
    if value is None:
        raise file.fault("F002.camera-no-key: {item}: key not found", item=key, shape=shape)
    if not isinstance(value, np.ndarray):
        raise file.fault(
            "F002.camera-other: {item}: expected {shape} numbers, found a value that is not a "
            "numeric matrix",
            item=key,
            shape=axes(shape),
        )
    if value.size != np.prod(shape) or (len(shape) == 2 and value.shape != shape):
        raise file.fault(
            "F002.camera-shape: {item}: expected {shape} numbers, found {found}",
            item=key,
            shape=axes(shape),
            found=axes(value.shape),
        )
    return value.reshape(shape)


def _pixels(value: Value | None) -> int:
    number = to_number(value.encode()) if isinstance(value, str) else None
    return int(number) if number is not None and 0 < number < 1 << 20 else 0


@dataclass(slots=True)
class _Matrix:
    """A matrix that is being read line by line."""

    key: str
    line: int
    rows: int = -1
    columns: int = -1
    data: list[bytes] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)  # line of each number
    is_open: bool = False  # whether the list of numbers continues on the next line


def read_storage(source: Source) -> _Storage:
    """Return the content of a FileStorage file; errors name the unsupported line."""
    file = _Storage(source)
    values = file.values
    matrix: _Matrix | None = None
    listed: list[str] | None = None
    for number, line in _lines(source.data):
        key = None if matrix is not None and matrix.is_open else _KEY.fullmatch(line)
        if key is not None:
            _close(source, matrix, values)
            matrix, listed = None, None
            name, rest = _text(key[1]), key[2].strip()
            if name in values:
                raise _fault(
                    source,
                    'F002.camera-twice: expected unique keys, found "{found}" again',
                    number,
                    found=name,
                )
            file.lines[name] = number
            if rest.startswith(b"!!opencv-matrix"):
                matrix = _Matrix(name, number)
            elif rest.startswith(b"[") and rest.endswith(b"]"):
                values[name] = [_text(word) for word in rest[1:-1].split(b",") if word.strip()]
            elif rest:
                values[name] = _text(rest)
            else:
                values[name] = listed = []
        elif matrix is not None:
            _continue(source, matrix, line, number)
        elif listed is not None and (item := _ITEM.fullmatch(line)):
            listed.append(_text(item[1]))
        else:
            raise _fault(
                source,
                "F002.camera-value: expected `name: value`, found {found}",
                number,
                found=quoted(line.strip()),
            )
    _close(source, matrix, values)
    return file


def _lines(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield non-empty lines without comments, with their numbers."""
    for number, line in enumerate(data.splitlines(), start=1):
        bare = line.strip()
        if bare and not bare.startswith((b"%", b"#")) and bare not in (b"---", b"..."):
            yield number, line.rstrip()


def _text(word: bytes) -> str:
    return word.strip().strip(b"\"'").decode("utf-8", "replace")


def _continue(source: Source, matrix: _Matrix, line: bytes, number: int) -> None:
    """Parse one line of a matrix."""
    part = None if matrix.is_open else _PART.fullmatch(line)
    if part is None and not matrix.is_open:
        raise _fault(
            source,
            "F002.camera-part: expected rows, cols, dt or data, found {found}",
            number,
            found=quoted(line.strip()),
        )
    text = line.strip() if part is None else part[2].strip()
    if part is not None and part[1] in (b"rows", b"cols"):
        size = to_number(text)
        if size is None or size != int(size) or not 0 <= size <= _MOST:
            raise _fault(
                source,
                "F002.camera-size: expected a size, found {found}",
                number,
                found=quoted(text),
            )
        if part[1] == b"rows":
            matrix.rows = int(size)
        else:
            matrix.columns = int(size)
        return
    if part is not None and part[1] == b"dt":
        return
    if part is not None:
        if not text.startswith(b"["):
            raise _fault(
                source,
                "F002.camera-data: expected a list of numbers in brackets, found {found}",
                number,
                found=quoted(text),
            )
        text, matrix.is_open = text[1:], True
    numbers, bracket, _ = text.partition(b"]")
    matrix.is_open = not bracket
    words = numbers.replace(b",", b" ").split()
    matrix.data += words
    matrix.lines += [number] * len(words)


def _close(source: Source, matrix: _Matrix | None, values: dict[str, Value]) -> None:
    """Convert a complete matrix to an array."""
    if matrix is None:
        return
    if min(matrix.rows, matrix.columns) < 0:
        lacking = "rows" if matrix.rows < 0 else "cols"
        raise _fault(
            source,
            "F002.camera-lacks: {item}: expected rows, cols and data, found no {name}",
            matrix.line,
            item=matrix.key,
            name=lacking,
        )
    numbers = [to_number(word) for word in matrix.data]
    if None in numbers:
        at = numbers.index(None)
        word = matrix.data[at]
        item = printable(matrix.key, 60)
        raise _fault(source, number_key(word), matrix.lines[at], item=item, found=quoted(word))
    if matrix.is_open or matrix.rows * matrix.columns != len(numbers):
        raise _fault(
            source,
            "F002.camera-count: {item}: expected {shape} numbers, found {found}",
            matrix.line,
            found=len(numbers),
            item=matrix.key,
            shape=axes((matrix.rows, matrix.columns)),
        )
    array = np.array(numbers, dtype=np.float64).reshape(matrix.rows, matrix.columns)
    values[matrix.key] = array


_FOLDER = "images"
_SUFFIXES = (".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp")
_PLAIN, _ENDING = re.compile(r"[0-9]+"), re.compile(r"([0-9]{1,9})$")
_MOST_NAMED = 5  # maximum number of missing frames listed in a message


class ImageFolders:
    """Images in folders; the last image shown for each camera is cached."""

    def __init__(self, folders: dict[str, Path], frame_rate: float, frames: range) -> None:
        self._rate, self._frames = frame_rate, frames
        self._files = {name: _from_first(_numbered(f), frames) for name, f in folders.items()}
        self._folders = folders
        self._shown: dict[str, tuple[int, CameraImage | None]] = {}
        self._faults: dict[Path, str] = {}

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of the cameras that have images."""
        return tuple(name for name, files in self._files.items() if files)

    def at(self, camera: str, seconds: float) -> CameraImage | None:
        """Return the image at a time; see ``viewer.rigs.captures.cameras``."""
        files = self._files.get(camera, {})
        number = self._frames.start + round(seconds * self._rate)
        known = self._shown.get(camera)
        if known is not None and known[0] == number:
            return known[1]
        image = self._read(files[number]) if number in files else None
        self._shown[camera] = number, image
        return image

    def _read(self, path: Path) -> CameraImage | None:
        try:
            return CameraImage(decode_picture(path, path.read_bytes()))
        except FormatError as problem:
            self._faults[path] = str(problem)
        except OSError as problem:
            self._faults[path] = str(note(wording.PICTURE, path, reason=reason_of(problem)))
        return None

    def size_of(self, camera: str) -> tuple[int, int] | None:
        """Return the size of a camera's first image, pixels; None if it has no images."""
        files = self._files.get(camera, {})
        return picture_dimensions(files[min(files)]) if files else None

    def sized(self, view: CameraView) -> CameraView:
        """Return a camera with the size of its images if the calibration does not state it."""
        size = None if view.size is not None else self.size_of(view.name)
        return view if size is None else replace(view, size=size)

    def notes_of(self, camera: str) -> list[str]:
        """Return messages about a camera's missing or unreadable images."""
        paths = set(self._files.get(camera, {}).values())
        notes = [text for path, text in self._faults.items() if path in paths]
        missing = [number for number in self._frames if number not in self._files.get(camera, {})]
        if missing and camera in self._folders:
            folder = printable(self._folders[camera])
            named = listed([str(number) for number in missing], _MOST_NAMED)
            which = f"{len(missing)} of {len(self._frames)} frames have no image: {named}"
            notes.append(f"{folder}: {which}")
        return notes


def find_images(
    parents: Sequence[Path],
    views: Sequence[CameraView],
    frame_rate: float,
    frames: range,
    given: Path | None = None,
) -> ImageFolders | None:
    """Return calibrated cameras' images, in the given folder or an ``images`` nearby; or None."""
    for parent in [given] if given is not None else [each / _FOLDER for each in parents]:
        folders = {
            view.name: parent / view.name for view in views if Path(view.name).name == view.name
        }
        there = {name: folder for name, folder in folders.items() if folder.is_dir()}
        if not there and given is not None and len(views) == 1 and _numbered(given):
            there = {views[0].name: given}
        if there:
            return ImageFolders(there, frame_rate, frames)
    if given is not None:
        values = {"names": listed([view.name for view in views])}
        key = (
            "F001.camera-images: expected a folder of images for a camera ({names}), found none"
            if views
            else "F001.camera-images-cameras: images need calibrated cameras: intri.yml and "
            "extri.yml next to the recording, found none"
        )
        raise FormatError(note(key, given, **values))
    return None


def _numbered(folder: Path) -> dict[int, Path]:
    """Return the images of a folder by frame number."""
    try:
        files = sorted(folder.iterdir())
    except OSError:
        return {}  # all frames are then reported as missing
    pictures = [path for path in files if path.suffix.lower() in _SUFFIXES]
    plain = {int(path.stem): path for path in pictures if _PLAIN.fullmatch(path.stem)}
    ends = ((_ENDING.search(path.stem), path) for path in pictures)
    return plain or {int(found[1]): path for found, path in ends if found}


def _from_first(files: dict[int, Path], frames: range) -> dict[int, Path]:
    """Return images by a capture's frames; images that count from 1 are moved to frame 0."""
    # Programs that save the frames of a video often count from 1, whereas captures count from 0.
    is_shifted = files and min(files) == frames.start + 1 == 1 and max(files) == frames.stop
    return {number - 1: path for number, path in files.items()} if is_shifted else files
