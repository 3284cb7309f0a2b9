"""Kinds of images in material libraries, detected from their pixels if not stated."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Bytes

__all__ = ["is_cut_out", "is_normal_map"]

_SAMPLES = 128  # maximum number of rows and columns that are sampled
_ERROR = 0.2  # tolerance of a normal's length, for 8-bit and compressed images
_MOST = 0.95  # minimum fraction of pixels that fulfil a criterion
_SOLID = 16, 239  # opacities below and above are treated as 0 and 1


def is_normal_map(image: Bytes) -> bool:
    """Return whether an image, (H, W, 4) uint8, contains unit normals in tangent space.

    Blender, Substance and others write normal maps as ``map_Bump``, which is meant for heights.
    """
    normals = _sampled(image)[..., :3].reshape(-1, 3) / 127.5 - 1.0
    is_unit = np.abs(np.linalg.norm(normals, axis=1) - 1.0) < _ERROR
    # Heights are grey: their vectors point along (1, 1, 1).
    is_outward = normals[:, 2] > np.maximum(normals[:, 0], normals[:, 1])
    return bool((is_unit & is_outward).mean() > _MOST)


def is_cut_out(opacity: Bytes) -> bool:
    """Return whether opacities, (H, W) uint8, are nearly all 0 or 1, as for leaves and hair."""
    values = _sampled(opacity)
    return bool(((values < _SOLID[0]) | (values > _SOLID[1])).mean() > _MOST)


def _sampled(image: Bytes) -> Bytes:
    """Return evenly spaced rows and columns of an image."""
    rows, columns = (max(side // _SAMPLES, 1) for side in image.shape[:2])
    return image[::rows, ::columns]
