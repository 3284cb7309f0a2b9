"""Images for the cameras of a capture: the frames of a video, or a folder of numbered images."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic
from viewer.errors import RigError
from viewer.formats._video_images import VideoImages
from viewer.formats.easymocap.images import ImageFolders, find_images
from viewer.loading.settings import MotionSettings
from viewer.rig.captures.camera_images import CameraImages
from viewer.rig.captures.camera_view import CameraView
from viewer.rig.captures.capture import Capture

__all__ = ["filmed"]

_NAME = "video"  # name of the camera for captures that have none
_ALIKE = 0.005  # maximum relative difference of equal frame rates, such as 29.97 and 30


def filmed(
    capture: Capture, views: Sequence[CameraView], settings: MotionSettings, rate: float
) -> tuple[list[CameraView], CameraImages | None, list[Diagnostic]]:
    """Return the cameras of a capture and their images, from the requested video or folder.

    Parameters
    ----------
    capture : Capture
        The capture. Without a camera, people in camera space get one with the size of the images.
    views : sequence of CameraView
        Its cameras. A camera without a size gets that of its images.
    settings : MotionSettings
        Provides the video or the folder of images.
    rate : float
        Frames per second of the capture.

    Returns
    -------
    views : list of CameraView
        The cameras.
    images : CameraImages or None
        Images of one of them.
    notes : list of Diagnostic
        Messages about assumptions.

    Raises
    ------
    RigError
        If the capture has no camera, or several of which none has the video's name.
    """
    found = [*views]
    if settings.video is not None:
        first = capture.first_frame / rate
        video = VideoImages(settings.video, first, first + capture.n_frames / rate)
        notes = _rate_notes(settings.video, video.rate, rate)
        if not found and capture.is_in_camera:
            found, said = _assumed(video.size, settings.video)
            notes += said
        index = _camera_of(found, settings.video)
        view = found[index]
        found[index] = view if view.size is not None else replace(view, size=video.size)
        video.cameras = (view.name,)
        return found, video, notes
    if settings.images is None or capture.images is not None:
        return found, capture.images, []
    frames, notes = range(capture.first_frame, capture.first_frame + capture.n_frames), []
    if not found and capture.is_in_camera:
        size = ImageFolders({_NAME: settings.images}, rate, frames).size_of(_NAME)
        if size is not None:
            found, notes = _assumed(size, settings.images)
    images = find_images([], found, rate, frames, settings.images)
    return [images.sized(view) for view in found] if images else found, images, notes


def _rate_notes(path: Path, video: float, rate: float) -> list[Diagnostic]:
    if abs(video / rate - 1.0) <= _ALIKE:
        return []
    return [Diagnostic("F007.video-rate", path, values={"video": video, "rate": rate})]


def _camera_of(views: Sequence[CameraView], path: Path) -> int:
    """Return the index of the camera that recorded a video: the only one, or one of its name."""
    if not views:
        raise RigError(Diagnostic("F001.video-camera", path))
    names = [view.name for view in views]
    if len(views) > 1 and path.stem not in names:
        raise RigError(Diagnostic("F001.video-cameras", path, values={"names": names}))
    return names.index(path.stem) if path.stem in names else 0


def _assumed(size: tuple[int, int], path: Path) -> tuple[list[CameraView], list[Diagnostic]]:
    """Return a camera at the origin whose focal length is the diagonal of its images."""
    focal = float(np.hypot(*size))
    intrinsic = np.array(
        [[focal, 0.0, size[0] / 2.0], [0.0, focal, size[1] / 2.0], [0.0, 0.0, 1.0]]
    )
    values = {"focal": focal, "width": size[0], "height": size[1]}
    note = Diagnostic("F007.assumed-camera", path, values=values)
    return [CameraView(_NAME, intrinsic, np.eye(3), np.zeros(3), size)], [note]
