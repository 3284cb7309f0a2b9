"""Array types, and the validation of every array of a rig."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import numpy as np
from numpy.typing import DTypeLike, NDArray

from viewer.errors import RigError
from viewer.phrases import printable

Item = TypeVar("Item", bound=np.generic)

_MOST_NUMBERS = 1 << 22  # in a temporary array

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Bools = NDArray[np.bool_]
Bytes = NDArray[np.uint8]
Arrays = dict[str, NDArray[np.generic]]
"""Arrays of any types by name, to be written to an archive."""


def span(rows: NDArray[Item]) -> slice | NDArray[Item]:
    """Return rows as a slice if they are consecutive: indexing with it copies nothing."""
    is_range = len(rows) and bool((np.diff(rows) == 1).all())
    return slice(int(rows[0]), int(rows[-1]) + 1) if is_range else rows


def runs_of(flags: Bools) -> list[tuple[int, int]]:
    """Return the runs of True as half-open ranges: [F, T, T, F] has the one run (1, 3)."""
    edges = np.flatnonzero(np.diff(flags, prepend=False, append=False)).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def largest_first(rows: NDArray[Item], sizes: Floats) -> NDArray[Item]:
    """Return rows in the order of their sizes (N,), the largest first; equal ones stay in order."""
    return rows[np.argsort(-sizes[rows], kind="stable")]


def blocks_of_rows(count: int, width: int) -> Iterator[slice]:
    """Yield slices of ``count`` rows, as many at a time as fit into a temporary array."""
    step = max(1, _MOST_NUMBERS // max(width, 1))
    for first in range(0, count, step):
        yield slice(first, min(first + step, count))


class Deferred:
    """An array in a file, read on first use and then cached.

    ``load`` reads the array, and ``blocks`` yields it in blocks of a given number of rows, each
    valid until the next one; both may raise a ``FormatError``.
    """

    __slots__ = ("_by_blocks", "_load", "_values", "dtype", "shape")

    is_sparse = False
    """Whether the array is expected to be mostly zero, and stored without the zeros."""

    def __init__(
        self,
        shape: tuple[int, ...],
        dtype: DTypeLike,
        load: Callable[[], NDArray[Any]],
        blocks: Callable[[int], Iterator[NDArray[Any]]] | None = None,
    ) -> None:
        self.shape, self.dtype, self._load = shape, np.dtype(dtype), load
        self._by_blocks = blocks
        self._values: NDArray[Any] | None = None

    @property
    def is_loaded(self) -> bool:
        """Whether the values are in memory."""
        return self._values is not None

    def values(self) -> NDArray[Any]:
        """Return the array, read-only; raises ``FormatError`` if it can no longer be read."""
        if self._values is None:
            values = self._load()
            values.flags.writeable = False
            self._values = values
        return self._values

    def blocks(self, count: int) -> Iterator[NDArray[Any]]:
        """Yield blocks of at most ``count`` rows, each valid until the next; see ``values``."""
        if self._by_blocks is not None and self._values is None:
            yield from self._by_blocks(count)
            return
        values = self.values()
        for start in range(0, len(values), count):
            yield values[start : start + count]

    def check(self) -> None:
        """Read the array; raises ``FormatError`` if it is damaged."""
        self.values()

    def columns(self, indices: Ints) -> Floats:
        """Return some columns of all rows, such as the offsets (P, N, 3) of N vertices."""
        return self.values()[:, indices].astype(np.float64, copy=False)

    def total(self, weights: Floats) -> Floats | None:
        """Return the sum of the rows times their weights; None if it needs ``values``."""
        return None


def deferred(values: NDArray[Any] | Deferred) -> Deferred:
    """Return an array, read-only once it is used, as one that is read on first use."""
    if isinstance(values, Deferred):
        return values
    return Deferred(values.shape, values.dtype, lambda: values)


def frozen(
    name: str, values: object, shape: tuple[int | None, ...], dtype: DTypeLike = np.float64
) -> NDArray[Any]:
    """Return a read-only copy of ``values``, or ``values`` itself if nothing can modify its memory.

    ``None`` in ``shape`` allows any length of an axis. Raises ``RigError`` if the shape differs, a
    number is not finite, or an integer type is required and a value has a fraction.
    """
    array = _converted(name, values, np.dtype(dtype))
    require_shape(name, array.shape, shape)
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise RigError(f"{name}: expected finite numbers, found {_first_not_finite(array)}")
    if (array is values or array.base is not None) and _is_writeable_by_others(array):
        array = array.copy()
    array.flags.writeable = False
    return array


def require_shape(name: str, found: tuple[int, ...], shape: tuple[int | None, ...]) -> None:
    """Raise ``RigError`` if a shape is not as expected; ``None`` allows any length of an axis."""
    if len(found) != len(shape) or any(
        wanted not in (None, size) for size, wanted in zip(found, shape, strict=True)
    ):
        wanted_text = " x ".join("any" if wanted is None else str(wanted) for wanted in shape)
        found_text = " x ".join(map(str, found)) or "a single number"
        raise RigError(f"{name}: expected shape {wanted_text}, found {found_text}")


def freeze_fields(
    owner: Any, dtype: DTypeLike = np.float64, /, **shapes: tuple[int | None, ...]
) -> None:
    """Pass fields of a frozen dataclass through ``frozen``, each with its shape, in this order.

    Fields that may be None stay None. Of an array that is read on first use, only the shape is
    checked.
    """
    for name, shape in shapes.items():
        values = getattr(owner, name)
        if values is None and "None" in owner.__dataclass_fields__[name].type:
            continue
        if isinstance(values, Deferred):
            require_shape(name, values.shape, shape)
        else:
            object.__setattr__(owner, name, frozen(name, values, shape, dtype))


def freeze(array: NDArray[Item]) -> NDArray[Item]:
    """Make a new array, and those whose memory it uses, read-only, so that ``frozen`` keeps it."""
    owner: object = array
    while isinstance(owner, np.ndarray):
        owner.flags.writeable = False
        owner = owner.base
    return array


def _is_writeable_by_others(array: NDArray[np.generic]) -> bool:
    """Return whether another reference can still change the array's memory."""
    owner: object = array
    while isinstance(owner, np.ndarray):
        if owner.flags.writeable:
            return True
        if owner.base is None:
            return False
        owner = owner.base
    # Bytes are immutable; the memory of any other owner may change.
    return not isinstance(owner, bytes)


def _converted(name: str, values: object, dtype: np.dtype[np.generic]) -> NDArray[Any]:
    """Convert values to an array of a type; an integer type rejects fractions."""
    try:
        given = np.asarray(values)
    except ValueError:
        raise RigError(f"{name}: expected numbers, found rows of different lengths") from None
    if given.dtype == dtype:
        return given
    try:
        with np.errstate(invalid="ignore"):
            array = given.astype(dtype)
    except (TypeError, ValueError):
        found = printable(given.tolist() if given.size > 1 else repr(given.item()), 60)
        raise RigError(f"{name}: expected numbers, found {found}") from None
    if dtype.kind != "f" and not np.array_equal(array, given):
        raise RigError(f"{name}: expected whole numbers that fit {dtype}")
    return array


def _first_not_finite(array: NDArray[np.generic]) -> str:
    """Return the first NaN or infinity of an array and its index, for a message."""
    index = tuple(int(axis[0]) for axis in np.nonzero(~np.isfinite(array)))
    place = ", ".join(map(str, index))
    return f"{array[index]} at index {place}"
