"""Joblib files as bytes, written without joblib."""

from typing import Any

import numpy as np
from formats.pickle_bytes import element_type, finished, named, shape, unicode, whole
from formats.torch.torch_bytes import value
from numpy.typing import NDArray


def wrapper(
    sides: tuple[int, ...],
    dtype: bytes,
    order: str = "C",
    alignment: bytes = whole(16),
    kind: bytes = named("numpy", "ndarray"),
) -> bytes:
    """Return the description of an array, without its bytes."""
    pairs = {
        "subclass": kind,
        "shape": shape(*sides),
        "order": unicode(order),
        "dtype": dtype,
        "allow_mmap": b"\x88",
        "numpy_array_alignment_bytes": alignment,
    }
    state = b"}(" + b"".join(unicode(key) + of for key, of in pairs.items()) + b"u"
    return named("joblib.numpy_pickle", "NumpyArrayWrapper") + b")\x81" + state + b"b"


def aligned_array(values: NDArray[Any]) -> bytes:
    """Return an array as written by joblib since 1.1, with three bytes of padding."""
    is_fortran = values.flags.f_contiguous and not values.flags.c_contiguous
    order, code = "F" if is_fortran else "C", values.dtype.str
    size = values.itemsize if code[1] in "SU" else -1
    dtype = element_type(code[1:], code[0], size)
    data = values.tobytes("F" if is_fortran else "C")
    return wrapper(values.shape, dtype, order) + b"\x03\xff\xff\xff" + data


def old_array(values: NDArray[Any]) -> bytes:
    """Return an array as written by joblib before 1.1, without padding."""
    dtype = element_type(values.dtype.str[1:], values.dtype.str[0])
    state = wrapper(values.shape, dtype, alignment=b"N")
    key = unicode("numpy_array_alignment_bytes") + b"N"
    return state.replace(key, b"") + values.tobytes()


def joblib_file(given: Any, aligned: bool = True) -> bytes:
    """Return a file with a value in which arrays follow their descriptions."""
    write = aligned_array if aligned else old_array
    return finished(value(given, lambda values: write(np.asarray(values))))
