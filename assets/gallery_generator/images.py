"""Images of synthetic cameras: rendered by the viewer, then distorted by the lens."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.media.image import save_image
from viewer.rendering.camera import Camera
from viewer.rendering.offscreen import render
from viewer.rendering.options import DisplayOptions
from viewer.rigs.arrays import Bytes, Floats
from viewer.rigs.captures.cameras import CameraView
from viewer.rigs.scene import Scene, pose_actors

__all__ = ["write_images"]

_MARGIN = 1.3  # scale of the rendered image, from which the distorted image is sampled
_ITERATIONS = 30


def write_images(folder: Path, scene: Scene, frames: range, rate: float, numbers: range) -> None:
    """Write an image of the scene by each of its cameras for some frames.

    ``frames`` are all frames of the capture, ``numbers`` the frames to write.
    """
    options = DisplayOptions(background="#d3d5d0", grid=True, quality="normal")
    for number in numbers:
        pose_actors(scene.actors, (number - frames.start) / rate)
        for view in scene.views:
            wide = _widened(view)
            camera = Camera(up=scene.up, fixed=wide)
            assert wide.size is not None  # set by _widened
            pixels = render(scene, wide.size, camera, options)
            path = folder / "images" / view.name / f"{number:06}.jpg"
            path.parent.mkdir(parents=True, exist_ok=True)
            save_image(path, _bent(pixels, wide, view))


def _widened(view: CameraView) -> CameraView:
    """Return an ideal camera at the same position that also sees a margin."""
    assert view.size is not None  # synthetic cameras have a size
    size = round(_MARGIN * view.size[0]), round(_MARGIN * view.size[1])
    intrinsic = view.intrinsic.copy()
    intrinsic[:2, 2] += 0.5 * (np.array(size) - view.size)
    return replace(view, intrinsic=intrinsic, size=size, distortion=np.zeros(0))


def _bent(pixels: Bytes, wide: CameraView, view: CameraView) -> Bytes:
    """Return the distorted image: each pixel is looked up at its position in the ideal image."""
    assert view.size is not None  # synthetic cameras have a size
    rows, columns = np.mgrid[: view.size[1], : view.size[0]]
    places = np.stack([columns, rows, np.ones_like(rows)]).reshape(3, -1)
    bent = np.linalg.solve(view.intrinsic, places)[:2]
    ideal = bent.copy()
    k1, k2 = np.append(view.distortion, [0.0, 0.0])[:2]
    for _ in range(_ITERATIONS):
        r2 = (ideal**2).sum(axis=0)
        ideal = bent / (1.0 + k1 * r2 + k2 * r2**2)
    seen = (wide.intrinsic @ np.vstack([ideal, np.ones(ideal.shape[1])]))[:2]
    return _sampled(pixels, seen).reshape(*view.size[::-1], 4)


def _sampled(pixels: Bytes, places: Floats) -> Bytes:
    """Interpolate linearly between pixels at places, (2, N) columns and rows: (N, 4)."""
    limit = np.array(pixels.shape[1::-1])[:, None] - 1.001
    places = np.clip(places, 0.0, limit)
    (x, y), (u, v) = places.astype(int), places % 1.0
    found = sum(
        ((u if dx else 1.0 - u) * (v if dy else 1.0 - v))[:, None] * pixels[y + dy, x + dx]
        for dx in (0, 1)
        for dy in (0, 1)
    )
    return np.rint(found).astype(np.uint8)
