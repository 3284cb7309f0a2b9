"""Vertex attributes in single precision, or quantised as KHR_mesh_quantization allows."""

from __future__ import annotations

from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.export._gltf.document import VERTICES, Document
from viewer.rig.arrays import Floats

__all__ = ["EXTENSION", "Encoding"]

EXTENSION = "KHR_mesh_quantization"
_SHORT, _WORD, _BYTE = 32767, 65535, 255

Integers = NDArray[np.integer]


@dataclass(slots=True, eq=False)
class Encoding:
    """Writer of vertex attributes.

    Attributes
    ----------
    document : Document
        Modified in place.
    center, reach : (3,), float
        Quantised positions are (p - center) / reach, in -1 to 1.
    is_quantized : bool
        Whether attributes are integers.
    errors : dict of float
        Largest rounding error of each kind of attribute: ``positions`` in figure units, ``normals``
        in radians, ``uvs``, ``weights``.
    """

    document: Document
    center: Floats = field(default_factory=lambda: np.zeros(3))
    reach: float = 1.0
    is_quantized: bool = False
    errors: dict[str, float] = field(default_factory=dict)

    @property
    def decoding(self) -> Floats:
        """T(center) S(reach): from stored positions to the figure's, (4, 4)."""
        matrix = np.eye(4)
        matrix[:3, :3] *= self.reach
        matrix[:3, 3] = self.center
        return matrix

    def positions(self, values: Floats, is_placed: bool = True) -> int:
        """Add positions (R, 3); those that ``decoding`` does not transform are not quantised."""
        if not (self.is_quantized and is_placed):
            return self.document.array(values, "VEC3", VERTICES, bounds=True)
        return self._lengths(values - self.center)

    def offsets(self, values: Floats, is_placed: bool = True) -> int:
        """Add offsets of positions (R, 3)."""
        if not (self.is_quantized and is_placed):
            return self.document.array(values, "VEC3", VERTICES, bounds=True)
        return self._lengths(values)

    def _lengths(self, values: Floats) -> int:
        stored = np.rint(values / self.reach * _SHORT).astype(np.int16)
        self._note("positions", np.abs(stored * (self.reach / _SHORT) - values))
        return self.document.integers(stored, "VEC3", True)

    def normals(self, values: Floats) -> int:
        """Add unit vectors (R, 3)."""
        if not self.is_quantized:
            return self.document.array(values, "VEC3", VERTICES)
        stored = np.rint(values * _SHORT).astype(np.int16)
        back = stored / np.linalg.norm(stored, axis=1, keepdims=True)
        self._note("normals", np.linalg.norm(back - values, axis=1))
        return self.document.integers(stored, "VEC3")

    def normal_offsets(self, values: Floats) -> int:
        """Add offsets of normals (R, 3); those beyond the range are not quantised."""
        if not self.is_quantized or np.abs(values).max(initial=0.0) > 1.0:
            return self.document.array(values, "VEC3", VERTICES)
        return self.document.integers(np.rint(values * _SHORT).astype(np.int16), "VEC3")

    def uvs(self, values: Floats) -> int:
        """Add texture coordinates (R, 2); repeating ones are not quantised."""
        if not self.is_quantized or values.min(initial=0.0) < 0.0 or values.max(initial=0.0) > 1.0:
            return self.document.array(values, "VEC2", VERTICES)
        stored = np.rint(values * _WORD).astype(np.uint16)
        self._note("uvs", np.abs(stored / _WORD - values))
        return self.document.integers(stored, "VEC2")

    def colors(self, values: Floats) -> int:
        """Add colours (R, 4), 0 to 1."""
        if not self.is_quantized:
            return self.document.array(values, "VEC4", VERTICES)
        bytes_ = np.rint(values * _BYTE)
        is_exact = np.abs(bytes_ / _BYTE - values).max(initial=0.0) < 1e-7
        stored = bytes_.astype(np.uint8) if is_exact else np.rint(values * _WORD).astype(np.uint16)
        return self.document.integers(stored, "VEC4")

    def influences(
        self, sets: list[tuple[NDArray[np.unsignedinteger], Floats]]
    ) -> list[tuple[int, int]]:
        """Add sets of joints and weights (R, 4); return their accessors."""
        if not self.is_quantized:
            return [
                (
                    self.document.array(joints, "VEC4", VERTICES),
                    self.document.array(weights, "VEC4", VERTICES),
                )
                for joints, weights in sets
            ]
        every = np.concatenate([weights for _, weights in sets], axis=1)
        stored = _summing(every)
        self._note("weights", np.abs(stored / _WORD - every))
        added = []
        for number, (joints, _) in enumerate(sets):
            own = stored[:, 4 * number : 4 * number + 4]
            used = np.where(own > 0, joints, 0).astype(joints.dtype)
            added.append(
                (
                    self.document.array(used, "VEC4", VERTICES),
                    self.document.integers(own, "VEC4"),
                )
            )
        return added

    def _note(self, kind: str, errors: Floats) -> None:
        self.errors[kind] = max(self.errors.get(kind, 0.0), float(errors.max(initial=0.0)))


def _summing(weights: Floats) -> NDArray[np.uint16]:
    """Return 16-bit weights that sum to 65535 exactly, as glTF requires (largest remainders)."""
    exact = weights / weights.sum(axis=1, keepdims=True) * _WORD
    stored = np.floor(exact).astype(np.int64)
    missing = _WORD - stored.sum(axis=1)
    order = np.argsort(stored - exact, axis=1, kind="stable")
    rank = np.empty_like(order)
    np.put_along_axis(rank, order, np.broadcast_to(np.arange(order.shape[1]), order.shape), axis=1)
    return (stored + (rank < missing[:, None])).astype(np.uint16)


def quantized(document: Document, positions: Floats, offsets: list[Floats]) -> Encoding:
    """Return an encoding whose range contains positions (V, 3) and their offsets (V, 3)."""
    low, high = positions.min(axis=0), positions.max(axis=0)
    most = max((float(np.abs(each).max(initial=0.0)) for each in offsets), default=0.0)
    reach = max(0.5 * float((high - low).max()), most)
    return Encoding(document, 0.5 * (low + high), reach or 1.0, is_quantized=True)
