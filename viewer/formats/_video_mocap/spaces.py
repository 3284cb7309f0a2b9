"""Transfer of bodies between the spaces of a video by the camera's pose in each frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.formats._video_mocap.results import Track
from viewer.rig.arrays import Floats
from viewer.rig.geometry.rotation import matrix_to_rotation_vector

__all__ = ["inverse", "moved"]


def moved(track: Track, rotations: Floats, translations: Floats) -> Track:
    """Return a person whose vertices v become R v + T, with an R and T for each row.

    Parameters
    ----------
    track : Track
        Bodies in the given space, N rows.
    rotations, translations : (N, 3, 3), (N, 3)
        R and T.
    """
    places = np.zeros((0, 3)) if track.translations is None else track.translations
    return replace(
        track,
        translations=np.einsum("nij,nj->ni", rotations, places) + translations,
        world_rotations=matrix_to_rotation_vector(rotations),
    )


def inverse(rotations: Floats, translations: Floats) -> tuple[Floats, Floats]:
    """Return the inverse of x -> R x + T in each row: R^T and -R^T T."""
    turned = np.swapaxes(rotations, -1, -2)
    return turned, -np.einsum("nij,nj->ni", turned, translations)
