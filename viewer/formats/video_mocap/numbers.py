"""Checked arrays of results: finite, of the expected shape, within limits.

Rotations of a body have any of these forms, distinguished by the shapes of their arrays::

    rotation vectors  (N, J, 3)     (N, 3 J)
    matrices          (N, J, 3, 3)  (N, 9 J)
    6D                (N, J, 6)     (N, 6 J)   two columns of a matrix, one after the other

A single frame may lack the axis of frames.
"""

from __future__ import annotations

import math
import re

import numpy as np
from numpy.typing import ArrayLike, NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import wording
from viewer.formats._archive.checking import finite, finite_or_nan, within_reach
from viewer.formats._archive.values import Archive, Axes
from viewer.formats._source import Source
from viewer.phrases import counted, rounded
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.rotation import (
    matrix_to_rotation_vector,
    nearest_rotations,
    six_to_matrix,
)

Frames = NDArray[np.int64]
# Maximum number of frames of all people: 18 hours of one person, about a gigabyte.
_MOST_ROWS = 2_000_000
_PERSON = re.compile(r"-?[0-9]{1,9}")
_SMALLEST = 1e-3  # minimum determinant; a rotation has 1, a missing rotation 0
_TITLES = {3: "rotation vectors", 6: "6D rotations", 9: "matrices"}  # by numbers per rotation


class RowBudget:
    """Limit of the number of frames of all people, which dicts that share arrays could multiply."""

    def __init__(self, archive: Archive, most: int = _MOST_ROWS) -> None:
        self._archive, self._most, self._left = archive, most, most

    def spend(self, count: int) -> None:
        """Deduct a number of frames; more than in any plausible recording are refused."""
        self._left -= max(count, 1)
        if self._left < 0:
            raise self._archive.source.fault(
                "F002.video-rows: expected at most {most} frames of all people, found more",
                most=self._most,
            )


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


def has(archive: Archive | None, *keys: str) -> bool:
    """Return whether an archive has all of some keys."""
    return archive is not None and all(archive.has(key) for key in keys)


def person_number(key: str) -> int | None:
    """Return the number of a person from a key, or None if the key is not a number."""
    return int(key) if _PERSON.fullmatch(key) else None


def rows(archive: Archive, key: str, shape: Axes) -> Floats:
    """Return numbers of a shape, one row per frame; NaN in place of invalid ones."""
    return finite_or_nan(archive, key, archive.array(key, shape).values())


def places(archive: Archive, key: str, count: int) -> Floats:
    """Return translations (N, 3), also from (N, 1, 3); NaN beyond the limit of all motions."""
    is_nested = len(archive.array(key).shape) == 3
    found = rows(archive, key, (count, 1, 3) if is_nested else (count, 3)).reshape(count, 3)
    return within_reach(archive, key, found)


def pose_of(archive: Archive, rotations: str, translations: str) -> tuple[Floats, Floats] | None:
    """Return rotations (N, 3, 3) and translations (N, 3) of a camera; None without both keys."""
    if not has(archive, rotations, translations):
        return None
    count = (archive.array(translations).shape or (0,))[0]
    return rotations_of(archive, rotations, (count, 3, 3)), places(archive, translations, count)


def frames_of(archive: Archive, key: str, count: int) -> Frames:
    """Return frame numbers, integers in any order: (N,); of a table, those in its first column."""
    shape = (count, None) if len(archive.array(key).shape) == 2 else (count,)
    found = archive.array(key, shape).values()
    found = finite(archive, key, found[:, 0] if found.ndim == 2 else found)
    if (found != np.floor(found)).any() or (np.abs(found) > 1 << 40).any():
        raise archive.fault(
            "F002.video-frame-numbers: {item}: expected integer frame numbers, found values of "
            "a different type",
            item=key,
        )
    return found.astype(np.int64)


def first_rows(source: Source, frames: ArrayLike) -> tuple[Frames, Ints]:
    """Return different frames in order, and the first row of each; warn if others are ignored."""
    numbers = np.asarray(frames, dtype=np.int64)
    found, first = np.unique(numbers, return_index=True)
    if len(found) < len(numbers):
        source.warn(
            "F007.video-same-frame: {n} ignored: the person is in an earlier row of the same frame",
            n=counted(len(numbers) - len(found), "row"),
        )
    return found, first.astype(np.int32)


def numbers(archive: Archive, key: str, count: int) -> Floats:
    """Return a fixed count of numbers, in an array of any shape or a list."""
    values = finite(archive, key, archive.array(key).values().reshape(-1))
    if len(values) != count:
        raise archive.fault(
            wording.VIDEO_COUNT, item=key, expected=counted(count, "number"), found=len(values)
        )
    return values


def sole(archive: Archive, key: str) -> float:
    """Return a single number, which may be an array with one element."""
    return float(numbers(archive, key, 1)[0])


def intrinsics_of(focal: Floats | float, center: Floats) -> Floats:
    """Return K for focal lengths (N,), (N, 2) or a single one, and image centres (N, 2), pixels."""
    lengths = np.atleast_1d(np.asarray(focal, dtype=np.float64))
    centers = np.atleast_2d(center)
    count = max(len(lengths), len(centers))
    matrix = np.zeros((count, 3, 3))
    matrix[:, 0, 0] = lengths if lengths.ndim == 1 else lengths[:, 0]
    matrix[:, 1, 1] = lengths if lengths.ndim == 1 else lengths[:, 1]
    matrix[:, :2, 2] = centers
    matrix[:, 2, 2] = 1.0
    return matrix


def form_of(archive: Archive, key: str, joints: tuple[int, ...]) -> Form | None:
    """Return the form of an array; None if it does not have one of these numbers of joints."""
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


def matrices(archive: Archive, key: str, shape: Axes) -> Floats:
    """Return rotation vectors of matrices (..., 3, 3) near a rotation; I for zero, else NaN."""
    return vectors_of(archive, key, rows(archive, key, shape))


def rotations_of(archive: Archive, key: str, shape: Axes) -> Floats:
    """Return exactly orthogonal rotation matrices; see ``matrices``."""
    return _rotations(archive, key, rows(archive, key, shape))


def vectors_of(archive: Archive, key: str, found: Floats) -> Floats:
    """Return rotation vectors of matrices (..., 3, 3) that were read from a key."""
    return matrix_to_rotation_vector(_rotations(archive, key, found))


def _rotations(archive: Archive, key: str, found: Floats) -> Floats:
    is_invalid: Bools = np.asarray(np.isnan(found).any(axis=(-2, -1)))
    is_missing: Bools = np.asarray(~found.any(axis=(-2, -1)))
    found = np.where((is_missing | is_invalid)[..., None, None], np.eye(3), found)
    determinants = np.linalg.det(found)
    is_flat = determinants < _SMALLEST
    if is_flat.any():
        worst = float(determinants.min())
        archive.leave_gap(wording.VIDEO_ROTATION, item=key, found=rounded(worst))
        is_invalid |= is_flat
    return np.where(is_invalid[..., None, None], np.nan, nearest_rotations(found)[0])


def six(archive: Archive, key: str, found: Floats) -> Floats:
    """Return rotation vectors of 6D rotations (..., 6): two columns (Zhou et al. 2019)."""
    matrices, lengths = six_to_matrix(found)
    is_flat = lengths < _SMALLEST
    if is_flat.any():
        worst = float(lengths[is_flat].min())
        archive.leave_gap(wording.VIDEO_ROTATION, item=key, found=rounded(worst))
    return matrix_to_rotation_vector(np.where(is_flat[..., None, None], np.nan, matrices))
