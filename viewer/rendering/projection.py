"""Projection of scene points into the image, computed on the CPU."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.view import View
from viewer.rigs.arrays import Bools, Floats

_USUAL_HEIGHT = 720.0  # height of an image in which marks have their standard size, pixels
_SCALES = 0.8, 4.0


@dataclass(frozen=True, slots=True, eq=False)
class Projected:
    """Projected points."""

    pixels: Floats
    """(N, 2). Position from the image's left and upper edges; arbitrary if the point is not
    visible."""
    depths: Floats
    """(N,). Normalised depth, -1 at the near plane to 1 at the far plane."""
    seen: Bools
    """(N,) bool. Whether the point is in front of the eye and within the image."""


def project(view: View, size: tuple[int, int], points: Floats) -> Projected:
    """Project points, (N, 3) in scene space, into the image: x = c_x / c_w with c = P V [p 1]."""
    clip = _clip(view, points)
    in_front = clip[:, 3] > 0.0
    w = np.where(in_front, clip[:, 3], 1.0)
    pixels, depths = _pixels(clip, w, size), clip[:, 2] / w
    inside = ((pixels >= 0.0) & (pixels < size)).all(axis=1) & (np.abs(depths) <= 1.0)
    return Projected(pixels, depths, in_front & inside)


def project_segments(
    view: View, size: tuple[int, int], starts: Floats, ends: Floats
) -> tuple[Floats, Bools]:
    """Project segments, ends (N, 3) in scene space, clipped at the near plane: -c_w <= c_z."""
    # The pixels, (N, 2, 2), from the image's left and upper edges, may lie outside the image; the
    # mask says which segments have a part beyond the near plane.
    clips = np.stack([_clip(view, starts), _clip(view, ends)], axis=1)
    away = clips[..., 2] + clips[..., 3]
    seen: Bools = np.any(away > 0.0, axis=1)
    behind = away <= 0.0
    span = away - away[:, ::-1]
    fraction = away / np.where(span == 0.0, 1.0, span)
    # The position is slightly beyond the plane, where w is not 0.
    clipped = clips + (fraction + 1e-6)[..., None] * (clips[:, ::-1] - clips)
    clips = np.where(behind[..., None], clipped, clips)
    w = clips[..., 3]
    return _pixels(clips, np.where(w > 0.0, w, 1.0), size), seen


def unproject(view: View, size: tuple[int, int], points: Floats, pixels: Floats) -> Floats:
    """Return the points, (N, 3), at pixels, (N, 2), with the depths of other points, (N, 3)."""
    # They are (P V)^-1 c with the points' own c_z and c_w, which must be in front of the eye.
    clip = _clip(view, points)
    clip[:, 0] = (2.0 * pixels[:, 0] / size[0] - 1.0) * clip[:, 3]
    clip[:, 1] = (1.0 - 2.0 * pixels[:, 1] / size[1]) * clip[:, 3]
    found = clip @ np.linalg.inv(view.projection @ view.matrix).T
    return np.asarray(found[:, :3] / found[:, 3:])


def picture_scale(size: tuple[int, int]) -> float:
    """Return the scale of marks in an image, 1 at a height of 720 pixels."""
    return float(np.clip(min(size[1], 0.75 * size[0]) / _USUAL_HEIGHT, *_SCALES))


def _clip(view: View, points: Floats) -> Floats:
    """Return points in clip space: (N, 4)."""
    matrix = view.projection @ view.matrix
    return points @ matrix[:, :3].T + matrix[:, 3]


def _pixels(clip: Floats, w: Floats, size: tuple[int, int]) -> Floats:
    """Return pixels from the left and upper edge: (..., 2)."""
    across = 0.5 * (1.0 + clip[..., 0] / w) * size[0]
    down = 0.5 * (1.0 - clip[..., 1] / w) * size[1]
    return np.stack([across, down], axis=-1)
