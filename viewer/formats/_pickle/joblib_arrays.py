"""Arrays in joblib's pickles, whose bytes follow the wrapper that describes them.

::

    array   = BUILD of a NumpyArrayWrapper, [n, n bytes of padding], the values
    wrapper = {subclass, shape, order: "C" or "F", dtype, allow_mmap, numpy_array_alignment_bytes}

Only files since joblib 1.1 have padding. An array of objects is a separate pickle.
"""

from __future__ import annotations

from collections.abc import Callable

from viewer.diagnostics import Phrase
from viewer.formats._archive.element_types import item_count
from viewer.formats._misfit import MisfitError
from viewer.formats._pickle.machine import Machine
from viewer.formats._pickle.values import Array, Dtype, Instance, Span, StandIn, is_sizes

__all__ = ["take_array"]


def take_array(machine: Machine, wrapper: Instance, run: Callable[[Machine], object]) -> object:
    """Return the array behind a wrapper, and skip its bytes.

    Parameters
    ----------
    machine : Machine
        At the end of the wrapper.
    wrapper : Instance
        The wrapper, with its state.
    run : callable
        Executes a nested pickle.

    Raises
    ------
    MisfitError
        If the wrapper is not one that joblib writes.
    FormatError
        If the file has fewer bytes than the wrapper declares.
    """
    state = wrapper.state or {}
    shape, dtype, order = state.get("shape"), state.get("dtype"), state.get("order")
    kind, padding = state.get("subclass"), state.get("numpy_array_alignment_bytes")
    is_usual = isinstance(kind, StandIn) and kind.role == "ndarray"
    if not is_usual or not is_sizes(shape) or not isinstance(dtype, Dtype):
        raise MisfitError(Phrase("joblib-wrapper", name=wrapper.of.name))
    if not isinstance(order, Span) or order.raw() not in (b"C", b"F"):
        raise MisfitError(Phrase("joblib-wrapper", name=wrapper.of.name))
    if dtype.code.startswith("O"):
        return _objects(machine, run)
    if padding is not None:
        machine.skip(machine.number(1))
    found = dtype.dtype()
    n_items = None if found is None else item_count(shape, found.itemsize)
    if found is None or n_items is None:
        # The size of the elements is unknown, and therefore also the position at which the pickle
        # continues.
        raise MisfitError(Phrase("joblib-dtype", dtype=dtype.what(), shape=shape))
    start = machine.skip(n_items * found.itemsize)
    array = Array()
    array.fill(shape, dtype, order.raw() == b"F", Span(machine.data, start, machine.at))
    return array


def _objects(machine: Machine, run: Callable[[Machine], object]) -> object:
    inner = machine.nested(machine.data, machine.at, machine.end)
    inner.load_bytes = machine.load_bytes
    found = run(inner)
    machine.at = inner.at
    machine.rejoin(inner)
    if not isinstance(found, Array):
        raise MisfitError(Phrase("joblib-objects"))
    return found
