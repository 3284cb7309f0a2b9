"""Rotations of a body in any of the usual forms, distinguished by the shapes of their arrays.

::

    rotation vectors  (N, J, 3)     (N, 3 J)
    matrices          (N, J, 3, 3)  (N, 9 J)
    6D                (N, J, 6)     (N, 6 J)   two columns of a matrix, one after the other

A single frame may lack the axis of frames.
"""

from __future__ import annotations

import math

import numpy as np

from viewer.data_classes import dataclass
from viewer.formats._archive.values import Archive
from viewer.formats._video_mocap.numbers import rows, six, vectors_of
from viewer.rig.arrays import Floats

__all__ = ["Form", "form_of", "rotation_vectors", "shape_form"]

_TITLES = {3: "rotation vectors", 6: "6D rotations", 9: "matrices"}


@dataclass(frozen=True, slots=True)
class Form:
    """Layout of rotations in an array: frames, joints, and numbers per rotation."""

    n_frames: int
    n_joints: int
    size: int

    @property
    def title(self) -> str:
        """Name of the form."""
        return _TITLES[self.size]


def form_of(archive: Archive, key: str, joints: tuple[int, ...]) -> Form | None:
    """Return the form of an array; None if it does not have one of these numbers of joints.

    Parameters
    ----------
    archive : Archive
        Archive that contains the array.
    key : str
        Its key.
    joints : tuple of int
        Possible numbers of joints.
    """
    return shape_form(archive.shape(key), joints)


def shape_form(shape: tuple[int, ...], joints: tuple[int, ...]) -> Form | None:
    """Return the form of an array of a shape; see ``form_of``."""
    sizes: tuple[int, ...] = ()
    lead: tuple[int, ...] = ()
    if shape[-2:] == (3, 3) and (len(shape) != 2 or joints == (1,)):
        lead, sizes = shape[:-2], (9,)
    elif len(shape) >= 2 and shape[-1] in (3, 6) and math.prod(shape[:-1]) > 0:
        lead, sizes = shape[:-1], (shape[-1],)
    for size in sizes:
        for frames, count in ((lead[:-1], lead[-1:]), (lead, ())):
            n_joints = math.prod(count)
            if len(frames) <= 1 and n_joints in joints:
                return Form(math.prod(frames), n_joints, size)
    return _flat_form(shape, joints)


def _flat_form(shape: tuple[int, ...], joints: tuple[int, ...]) -> Form | None:
    for size in _TITLES if 1 <= len(shape) <= 2 else ():
        if shape[-1] % size == 0 and shape[-1] // size in joints:
            return Form(math.prod(shape[:-1]), shape[-1] // size, size)
    return None


def rotation_vectors(archive: Archive, key: str, form: Form) -> Floats:
    """Return the rotations as rotation vectors: (N, J, 3)."""
    found = rows(archive, key, archive.shape(key))
    count = form.n_frames, form.n_joints
    if form.size == 9:
        return vectors_of(archive, key, found.reshape(*count, 3, 3))
    found = found.reshape(*count, form.size)
    return six(archive, key, found) if form.size == 6 else np.asarray(found)
