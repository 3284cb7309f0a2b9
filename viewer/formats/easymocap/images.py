"""Image folders of a capture: ``images/<camera>/000000.jpg``, one folder per camera."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from viewer.diagnostics import Diagnostic, wording
from viewer.errors import FormatError
from viewer.media.image import decode_picture, picture_dimensions
from viewer.phrases import listed, printable
from viewer.rig.captures.cameras import CameraImage, CameraView

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
        """Return the image at a time; see ``viewer.rig.captures.cameras``."""
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
            values = {"reason": str(problem.strerror or problem)}
            self._faults[path] = str(Diagnostic(wording.PICTURE, path, values=values))
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
        notes = [text for path, text in self._faults.items() if path in self._paths(camera)]
        missing = [number for number in self._frames if number not in self._files.get(camera, {})]
        if missing and camera in self._folders:
            folder = printable(self._folders[camera])
            named = listed([str(number) for number in missing], _MOST_NAMED)
            which = f"{len(missing)} of {len(self._frames)} frames have no image: {named}"
            notes.append(f"{folder}: {which}")
        return notes

    def _paths(self, camera: str) -> set[Path]:
        return set(self._files.get(camera, {}).values())


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
        raise FormatError(Diagnostic(key, given, values=values))
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
