"""Identity of functions, by which ``resume`` detects whether a job has changed."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from functools import partial
from hashlib import blake2b
from types import CellType, CodeType
from typing import Any

from viewer.version import VERSION

__all__ = ["identity_of"]


def identity_of(function: Callable[..., Any]) -> str:
    """Return a string that is the same in all processes, and changes if the function does.

    It covers code, defaults, bound arguments, variables of enclosing functions and the program's
    version, but not the code of other functions that it calls.
    """
    total = blake2b(digest_size=8)
    for part in _parts(function, set()):
        total.update(part + b"\0")
    return f"{getattr(function, '__qualname__', type(function).__qualname__)} {total.hexdigest()}"


def _parts(value: Any, seen: set[int]) -> Iterator[bytes]:
    yield VERSION.encode()
    if id(value) in seen:  # the function is recursive
        return
    seen.add(id(value))
    if isinstance(value, partial):
        for one in (value.func, *value.args, *sorted(value.keywords.items())):
            yield from _parts(one, seen)
        return
    inner = getattr(value, "__func__", value)
    if inner is not value:  # the value is a method
        yield from _parts(value.__self__, seen)
    code = getattr(inner, "__code__", None)
    if not isinstance(code, CodeType):
        yield _pickled(value)
        return
    yield f"{inner.__module__}.{inner.__qualname__}".encode()
    yield from _code_parts(code)
    yield from (_pickled(inner.__defaults__), _pickled(inner.__kwdefaults__))
    for cell in inner.__closure__ or ():
        if _is_set(cell):
            yield from _parts(cell.cell_contents, seen)


def _code_parts(code: CodeType) -> Iterator[bytes]:
    yield code.co_code
    yield repr(code.co_names).encode()  # names of the functions and attributes used
    for one in code.co_consts:
        if isinstance(one, CodeType):  # its repr contains an address
            yield from _code_parts(one)
        else:  # the order of sets of str varies between processes
            yield repr(sorted(map(repr, one)) if isinstance(one, frozenset) else one).encode()


def _is_set(cell: CellType) -> bool:
    try:
        _ = cell.cell_contents
    except ValueError:
        return False
    return True


def _pickled(value: Any) -> bytes:
    """Return a pickle, or the name of the type if pickling fails."""
    try:
        return pickle.dumps(_without_sets(value))
    except (pickle.PicklingError, AttributeError, TypeError, RecursionError):
        return f"{type(value).__module__}.{type(value).__qualname__}".encode()


def _without_sets(value: Any) -> Any:
    """Return data whose sets are sorted lists: their order varies between processes."""
    if isinstance(value, set | frozenset):
        return [type(value).__name__, *sorted(map(_pickled, value))]
    if type(value) in (list, tuple):
        return type(value)(map(_without_sets, value))
    if type(value) is dict:
        return {key: _without_sets(one) for key, one in value.items()}
    return value
