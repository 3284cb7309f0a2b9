"""Tensors of torch in pickles: storages whose bytes stay in the file, and strided views of them.

A tensor is ``_rebuild_tensor_v2(storage, offset, size, stride, …)``: element (i, j, …) is at offset
+ i stride[0] + j stride[1] + … of the storage. Several tensors may share a storage, and expanded
tensors have strides of 0. All values are checked against the storage before it is read.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase, wording
from viewer.formats._archive.values import item_count, shaped
from viewer.formats._archive.zip import MAX_RATIO, SMALL
from viewer.formats._pickle.values import Span, StandIn, is_sizes
from viewer.formats._source import InvalidValueError
from viewer.phrases import axes, counted
from viewer.rigs.arrays import Deferred

_STORAGES = {
    "FloatStorage": "f4",
    "DoubleStorage": "f8",
    "HalfStorage": "f2",
    "BFloat16Storage": "bfloat16",
    "LongStorage": "i8",
    "IntStorage": "i4",
    "ShortStorage": "i2",
    "CharStorage": "i1",
    "ByteStorage": "u1",
    "BoolStorage": "b1",
    "UntypedStorage": "u1",
}
_DTYPES = {
    "float32": "f4", "float64": "f8", "float16": "f2", "bfloat16": "bfloat16", "bool": "b1",
    **{f"int{8 * size}": f"i{size}" for size in (1, 2, 4, 8)},
    **{f"uint{8 * size}": f"u{size}" for size in (1, 2, 4, 8)},
}  # fmt: skip
_LONGEST_KEY = 200


@dataclass(slots=True, eq=False)
class Storage:
    """A flat array in a file, read at most once, regardless of how many tensors use it."""

    code: str
    """Element type: a numpy code without byte order, or ``"bfloat16"``."""
    count: int
    """Number of elements."""
    load: Callable[[], bytes | memoryview] | None = None
    """Returns exactly its bytes; None until the file has been found to contain them."""
    order: Literal["<", ">"] = "<"
    """Either "<" or ">". Byte order."""
    _bytes: NDArray[np.uint8] | None = None

    @property
    def size(self) -> int:
        """Size in bytes."""
        return self.count * _stored(self.code).itemsize

    def flat(self, code: str) -> NDArray[np.generic]:
        """Return the elements as a type of this size, as stored."""
        if self._bytes is None:
            if self.load is None:
                raise InvalidValueError(wording.TENSOR_NO_STORAGE)
            self._bytes = np.frombuffer(self.load(), np.uint8)
        dtype = _stored(code).newbyteorder(self.order)
        whole = len(self._bytes) // dtype.itemsize * dtype.itemsize
        return self._bytes[:whole].view(dtype)


@dataclass(frozen=True, slots=True, eq=False)
class Tensor:
    """A strided view of a storage; offset and strides are in elements."""

    storage: Storage
    code: str
    offset: int
    shape: tuple[int, ...]
    strides: tuple[int, ...]

    def __post_init__(self) -> None:
        size = _stored(self.code).itemsize
        n_items = item_count(self.shape, size)
        room = self.storage.size // size
        last = self.offset + sum(
            (side - 1) * stride for side, stride in zip(self.shape, self.strides, strict=True)
        )
        if n_items is None or (n_items and last >= room) or self.offset > room:
            values = {"shape": axes(self.shape), "strides": self.strides, "offset": self.offset}
            raise InvalidValueError(
                "expected a tensor within {found} of its storage, found {shape} with strides "
                "{strides} from element {offset}",
                **values,
                found=counted(room, "element"),
            )
        if n_items * size > max(SMALL, MAX_RATIO * self.storage.size):
            raise InvalidValueError(
                "expected a tensor of at most {most} times the size of its storage, found {shape} "
                "elements",
                shape=axes(self.shape),
                most=MAX_RATIO,
            )

    def deferred(self, fail: Callable[[Phrase], Exception]) -> Deferred:
        """Return the deferred array; bfloat16, which numpy lacks, as float32."""
        dtype = np.float32 if self.code == "bfloat16" else np.dtype(self.code)
        return Deferred(self.shape, dtype, partial(self._load, fail))

    def _load(self, fail: Callable[[Phrase], Exception]) -> NDArray[np.generic]:
        try:
            flat = self.storage.flat(self.code)[self.offset :]
        except InvalidValueError as problem:
            raise fail(problem.problem) from None
        if math.prod(self.shape) == 0:
            values = np.empty(self.shape, flat.dtype)
        else:
            steps = tuple(stride * flat.itemsize for stride in self.strides)
            view = np.lib.stride_tricks.as_strided(flat, self.shape, steps, writeable=False)
            values = np.array(view, order="C")
        if self.code == "bfloat16":
            # A bfloat16 is the upper half of a float32.
            return (values.astype(np.uint32) << 16).view(np.float32)
        return shaped(values.reshape(-1), self.shape, False)


def storage_of(persistent: object) -> tuple[str, Storage] | None:
    """Return key and storage of a persistent id ("storage", type, key, place, count), or None."""
    match persistent:
        case (
            Span(coding=str()) as word,
            StandIn(role="torch-storage") as kind,
            Span(coding=str()) as key,
            Span(),
            int() as count,
            *views,
        ) if len(word) == 7 and len(key) <= _LONGEST_KEY and views in ([], [None]):
            if word.raw() == b"storage" and not isinstance(count, bool) and 0 <= count < 1 << 60:
                return key.text(), Storage(_STORAGES[kind.name.rpartition(".")[2]], count)
    return None


def _stored(code: str) -> np.dtype[np.generic]:
    return np.dtype("u2" if code == "bfloat16" else code)


def _tensor(arguments: tuple[object, ...]) -> object:
    match arguments:
        case (Storage() as storage, int() as offset, size, stride, *more) if len(more) <= 3:
            return _view(storage, storage.code, offset, size, stride)
    return None


def _tensor_of_type(arguments: tuple[object, ...]) -> object:
    match arguments:
        case (Storage() as storage, int() as offset, size, stride, _, _, StandIn() as kind, *more):
            if kind.role == "torch-dtype" and len(more) <= 1:
                code = _DTYPES[kind.name.rpartition(".")[2]]
                return _view(storage, code, offset, size, stride)
    return None


def _view(storage: Storage, code: str, offset: int, size: object, stride: object) -> object:
    if not is_sizes(size) or not is_sizes(stride) or len(size) != len(stride) or offset < 0:
        return None
    return Tensor(storage, code, offset, size, stride)


def _parameter(arguments: tuple[object, ...]) -> object:
    return arguments[0] if len(arguments) == 3 and isinstance(arguments[0], Tensor) else None


def _size(arguments: tuple[object, ...]) -> object:
    return arguments[0] if len(arguments) == 1 and is_sizes(arguments[0]) else None


def _device(arguments: tuple[object, ...]) -> object:
    is_known = 1 <= len(arguments) <= 2 and isinstance(arguments[0], Span)
    return arguments[0] if is_known else None


ROLES = {
    **{("torch", name): "torch-storage" for name in _STORAGES},
    ("torch.storage", "UntypedStorage"): "torch-storage",
    **{("torch", name): "torch-dtype" for name in _DTYPES},
    ("torch", "Size"): "torch-size",
    ("torch", "device"): "torch-device",
    ("torch._utils", "_rebuild_tensor"): "torch-tensor",
    ("torch._utils", "_rebuild_tensor_v2"): "torch-tensor",
    ("torch._utils", "_rebuild_tensor_v3"): "torch-tensor-v3",
    ("torch._utils", "_rebuild_parameter"): "torch-parameter",
    ("torch.storage", "_load_from_bytes"): "torch-bytes",
}
"""Roles of torch's names; "torch-bytes" is a separate file, see ``_torch.py``."""

CALLS: dict[str, Callable[[tuple[object, ...]], object]] = {
    "torch-tensor": _tensor,
    "torch-tensor-v3": _tensor_of_type,
    "torch-parameter": _parameter,
    "torch-size": _size,
    "torch-device": _device,
}
"""Results of calls by role; None for unusual arguments."""
