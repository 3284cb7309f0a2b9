"""Allowlist of the names that a pickle may use, and of their permitted uses.

``find`` looks up a pair of module and name in a literal table. It imports nothing and returns a
stand-in. ``call``, ``create`` and ``build`` accept exactly what numpy, scipy, chumpy, torch, joblib
and Python themselves write. All four raise ``InvalidValueError`` for anything else.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeGuard

from viewer.diagnostics import Phrase, wording
from viewer.formats._archive.values import Opaque
from viewer.formats._pickle.tensors import CALLS as TORCH_CALLS
from viewer.formats._pickle.tensors import ROLES as TORCH_ROLES
from viewer.formats._pickle.values import Array, Dtype, Instance, Span, StandIn, is_sizes, noun
from viewer.formats._source import InvalidValueError
from viewer.phrases import listed, printable

# Numpy 2 and scipy 1.8 renamed modules; files keep the old names. A rule for prefixes would be
# unsafe: numpy.testing.runstring executes any string.
_FACTORIES = ("dict", "list", "int", "float")  # allowed factories of defaultdict
_ROLES = {
    ("numpy", "ndarray"): "ndarray",
    ("numpy", "dtype"): "dtype",
    ("numpy.core.multiarray", "_reconstruct"): "reconstruct",
    ("numpy._core.multiarray", "_reconstruct"): "reconstruct",
    ("numpy.core.multiarray", "scalar"): "scalar",
    ("numpy._core.multiarray", "scalar"): "scalar",
    ("numpy.core.numeric", "_frombuffer"): "frombuffer",
    ("numpy._core.numeric", "_frombuffer"): "frombuffer",
    ("scipy.sparse.csc", "csc_matrix"): "csc",
    ("scipy.sparse._csc", "csc_matrix"): "csc",
    ("scipy.sparse._csc", "csc_array"): "csc",
    ("scipy.sparse.csr", "csr_matrix"): "csr",
    ("scipy.sparse._csr", "csr_matrix"): "csr",
    ("scipy.sparse._csr", "csr_array"): "csr",
    ("scipy.sparse.coo", "coo_matrix"): "coo",
    ("scipy.sparse._coo", "coo_matrix"): "coo",
    ("scipy.sparse._coo", "coo_array"): "coo",
    ("chumpy.ch", "Ch"): "Ch",
    ("chumpy.ch", "ChHandle"): "Ch",
    ("chumpy.ch", "MatVecMult"): "expression",
    ("chumpy.ch_ops", "add"): "expression",
    ("chumpy.ch_ops", "dot"): "expression",
    ("chumpy.reordering", "Select"): "Select",
    ("chumpy.reordering", "transpose"): "expression",
    ("chumpy.reordering", "Concatenate"): "expression",
    ("chumpy.reordering", "AtleastNd"): "expression",
    ("copy_reg", "_reconstructor"): "reconstructor",
    ("copyreg", "_reconstructor"): "reconstructor",
    ("__builtin__", "object"): "object",
    ("builtins", "object"): "object",
    ("__builtin__", "set"): "set",
    ("builtins", "set"): "set",
    ("__builtin__", "bytes"): "bytes",  # Python 3 writes b"" in this form in old protocols
    ("builtins", "bytes"): "bytes",
    ("collections", "OrderedDict"): "dict",
    ("collections", "defaultdict"): "defaultdict",
    **{("builtins", name): "type" for name in _FACTORIES},
    **{("__builtin__", name): "type" for name in _FACTORIES},
    ("_codecs", "encode"): "encode",
    ("joblib.numpy_pickle", "NumpyArrayWrapper"): "joblib",
    **TORCH_ROLES,
}
# Wrappers of joblib before 0.10, which store each array in a separate file.
_OLD_WRAPPERS = ("NDArrayWrapper", "ZNDArrayWrapper")
SPARSE = ("csc", "csr", "coo")
"""Roles of sparse matrices."""
_CLASSES = {*SPARSE, "Ch", "Select", "expression", "joblib"}
_ORDERS = {"<", ">", "=", "|"}
_LONGEST_NAME = 200
_LONGEST_KEY = 1 << 16
_LARGEST_KEY = 1 << 60
_MOST_ARGUMENTS = 8
_WRONG = object()  # returned for a call with unusual arguments


def find(module: str, name: str) -> StandIn:
    """Return a new stand-in for a name, or raise if it is not in the table."""
    full = ".".join(printable(part[:_LONGEST_NAME]) for part in (module, name))
    role = _ROLES.get((module, name))
    if module.startswith("joblib.numpy_pickle") and name in _OLD_WRAPPERS:
        raise InvalidValueError(
            "expected arrays in the file, found {name}, which stores them in separate files: "
            "load and save it again with joblib 0.10 or later",
            name=full,
        )
    if role is None:
        raise InvalidValueError(
            'expected arrays and plain data, found the global "{name}", which is not allowed; '
            "nothing was executed",
            name=full,
        )
    return StandIn(full, role)


def call(function: object, arguments: object) -> tuple[object, int]:
    """Return the result of calling a ``StandIn``, and the number of copied items."""
    if not isinstance(function, StandIn) or function.role not in (*_CALLS, *TORCH_CALLS):
        raise InvalidValueError(
            "expected a call of a known function, found a call of {found}", found=noun(function)
        )
    if isinstance(arguments, tuple) and len(arguments) <= _MOST_ARGUMENTS:
        made = _called(function.role, arguments)
        if made is not _WRONG:
            copies = function.role in ("dict", "scalar", "set")
            sizes = [len(each) for each in arguments if isinstance(each, list | Span)]
            return made, sum(sizes) if copies else 0
    found = [*map(noun, arguments)] if isinstance(arguments, tuple) else []
    raise InvalidValueError(wording.PICKLE_ARGUMENTS, name=function.name, found=listed(found))


def _called(role: str, arguments: tuple[object, ...]) -> object:
    if role in _CALLS:
        return _CALLS[role](arguments)
    made = TORCH_CALLS[role](arguments)
    return _WRONG if made is None else made


def create(of: object, arguments: object) -> Instance:
    """Return a new object of a class, whose state is set later by ``build``."""
    if not isinstance(of, StandIn) or of.role not in _CLASSES or arguments != ():
        raise InvalidValueError(
            "expected a new instance of a known class, found {found}", found=noun(of)
        )
    return Instance(of)


def build(target: object, state: object) -> None:
    """Set the state of an object, without setting attributes or calling methods."""
    if isinstance(target, Array):
        _build_array(target, state)
    elif isinstance(target, Dtype):
        _build_dtype(target, state)
    elif isinstance(target, Instance):
        if not isinstance(state, dict):
            problem = Phrase(
                "expected a dict as the state of {name}, found {found}",
                name=target.of.name,
                found=noun(state),
            )
            raise InvalidValueError(problem)
        target.state = state
    else:
        raise InvalidValueError(
            "expected an object that accepts a state, found {found}", found=noun(target)
        )


def as_key(value: object) -> str | bytes | int:
    """Return a string, bytes, or a number that hashes to itself, as the key of a dict."""
    # Objects are refused so that their hashes are never computed, and large numbers because they
    # could be chosen so that all hashes collide.
    if isinstance(value, str | bytes):
        return value
    if isinstance(value, Span) and len(value) <= _LONGEST_KEY:
        return value.raw() if value.coding is None else value.text()
    if type(value) is int and abs(value) < _LARGEST_KEY:
        return value
    raise InvalidValueError(
        "expected a string or a number as a key, found {found}", found=noun(value)
    )


def _is_text(value: object, text: str) -> bool:
    """Return whether a value is this string; long values are not decoded."""
    return isinstance(value, Span) and len(value) == len(text) and value.raw() == text.encode()


def _short(value: object, longest: int = 32) -> str | None:
    return value.text() if isinstance(value, Span) and len(value) <= longest else None


def _is_flag(value: object) -> bool:
    return isinstance(value, int) and value in (0, 1)


def _reconstruct(arguments: tuple[object, ...]) -> object:
    match arguments:
        case (StandIn(role="ndarray"), (0,), letter) if _is_text(letter, "b"):
            return Array()
    return _WRONG


def _dtype(arguments: tuple[object, ...]) -> object:
    match arguments:
        case (code, align, copy) if _is_flag(align) and _is_flag(copy):
            text = _short(code)
            return _WRONG if text is None else Dtype(printable(text))
    return _WRONG


def _scalar(arguments: tuple[object, ...]) -> object:
    match arguments:
        case (Dtype() as dtype, Span() as payload):
            if dtype.code in ("S", "S0", "U", "U0") and len(payload) == 0:
                return Span(b"", 0, 0, "utf-8" if dtype.code[0] == "U" else None)
            array = Array()
            array.fill((), dtype, False, payload)
            return Opaque(array.what) if array.dtype is None else array.values().item()
        case (Dtype() as dtype, _):
            return Opaque(dtype.what()) if dtype.dtype() is None else _WRONG
    return _WRONG


def _frombuffer(arguments: tuple[object, ...]) -> object:
    match arguments:
        case (Span() as payload, Dtype() as dtype, shape, order, *more) if is_sizes(shape):
            letter = _short(order)
            array = Array()
            array.fill(shape, dtype, letter == "F", payload)
            if letter in ("C", "F") and not more:
                return array
            if letter == "K" and len(more) == 1 and _is_order(more[0], len(shape)):
                array.axes = more[0]
                return array
    return _WRONG


def _is_order(axes: object, n_axes: int) -> TypeGuard[tuple[int, ...]]:
    return is_sizes(axes) and sorted(axes) == list(range(n_axes))


def _set(arguments: tuple[object, ...]) -> object:
    match arguments:
        case ():
            return []
        case (list() as items,):
            return list(items)  # a list, so that no value of the file is ever hashed
    return _WRONG


def _dict(arguments: tuple[object, ...]) -> object:
    match arguments:
        case ():
            return {}
        case (list() as pairs,):
            made: dict[object, object] = {}
            for pair in pairs:
                if not isinstance(pair, list | tuple) or len(pair) != 2:
                    return _WRONG
                made[as_key(pair[0])] = pair[1]
            return made
    return _WRONG


def _defaultdict(arguments: tuple[object, ...]) -> object:
    """Return a plain dict: missing keys are never looked up, so its factory is never called."""
    match arguments:
        case () | (None,) | (StandIn(role="type" | "dict" | "set"),):
            return {}
    return _WRONG


def _encode(arguments: tuple[object, ...]) -> object:
    match arguments:
        case (Span(coding="utf-8" | "raw-unicode-escape") as text, coding):
            return text.packed() if _is_text(coding, "latin1") else _WRONG
    return _WRONG


def _bytes(arguments: tuple[object, ...]) -> object:
    return Span(b"", 0, 0) if arguments == () else _WRONG


def _reconstructor(arguments: tuple[object, ...]) -> object:
    match arguments:
        case (StandIn(role=role) as of, StandIn(role="object"), None) if role in _CLASSES:
            return Instance(of)
    return _WRONG


_CALLS: dict[str, Callable[[tuple[object, ...]], object]] = {
    "reconstruct": _reconstruct,
    "dtype": _dtype,
    "scalar": _scalar,
    "frombuffer": _frombuffer,
    "set": _set,
    "dict": _dict,
    "defaultdict": _defaultdict,
    "encode": _encode,
    "bytes": _bytes,
    "reconstructor": _reconstructor,
}


def _build_array(target: Array, state: object) -> None:
    match state:
        case (1, shape, Dtype() as dtype, order, payload) if is_sizes(shape) and _is_flag(order):
            if isinstance(payload, Span):
                target.fill(shape, dtype, bool(order), payload)
                return
            if isinstance(payload, list) and dtype.code.startswith("O"):
                target.what, target.items = dtype.what(), payload
                target.shape, target.is_fortran = shape, bool(order)
                return
    raise InvalidValueError("expected the state of an array, found {found}", found=noun(state))


def _build_dtype(target: Dtype, state: object) -> None:
    match state:
        case (3 | 4, order, sub, names, fields, size, int(), int(), *_) if len(state) <= 9:
            letter = _short(order)
            if letter is None or letter not in _ORDERS:
                raise InvalidValueError(
                    "expected the byte order of an array, found {found}", found=noun(order)
                )
            if any(part is not None for part in (sub, names, fields)):
                target.code = "V"  # records may have any size
            target.order = letter
            dtype = target.dtype()
            if dtype is None or size in (-1, dtype.itemsize):
                return
    raise InvalidValueError("expected the state of a dtype, found {found}", found=noun(state))
