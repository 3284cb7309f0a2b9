"""Fields of public classes that a user's program may set: they must have the types they state.

Importing ``beartype`` takes 0.9 times as long as importing numpy, ``typeguard`` 0.8 and
``pydantic`` 0.4, while all rules here are made in 3 ms, at first use. None of the three converts
what numpy returns without copying arrays that are changed in place.
"""

from __future__ import annotations

import ast
import builtins
import math
import operator
import sys
from collections.abc import Callable, Collection, Mapping, Sequence, Set
from dataclasses import Field, fields
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Any, Literal, NamedTuple, TypeAlias, TypeVar, Union, get_args, get_origin

import numpy as np

from viewer.arguments import type_name
from viewer.errors import RigError
from viewer.near_names import name_hint
from viewer.phrases import printable
from viewer.rigs.arrays import Floats, frozen

_FLOAT = np.dtype(np.float64)
_Class = TypeVar("_Class", bound=type)


def checked(cls: _Class) -> _Class:
    """Return a dataclass whose fields must have the types that their annotations state.

    They are checked when an instance is made and, unless it is frozen, when a field is set. Numbers
    of numpy, sequences in the place of tuples and sets in that of frozen ones are converted. The
    metadata of a field may have its ``choices``, its ``limits``, and the ``shape`` of an array that
    is changed in place: it is kept if it fits, else converted. ``frozen`` checks other arrays.
    """
    rules: dict[str, _Rule] = {}

    def fill() -> None:
        # At first use: annotations name classes of modules that import this one.
        found = {each.name: _rule(cls, each) for each in fields(cls)}
        rules.update({name: rule for name, rule in found.items() if rule is not None})

    put = object.__setattr__
    made: Any = cls
    if "__setattr__" in vars(cls):  # frozen
        inner = vars(cls).get("__post_init__")

        def __post_init__(self: object) -> None:  # noqa: N807
            if not rules:
                fill()
            for name, (exact, read) in rules.items():
                given = getattr(self, name, None)
                if type(given) not in exact:
                    value = read(name, given)
                    if value is not given:
                        put(self, name, value)
            if inner is not None:
                inner(self)

        made.__post_init__ = __post_init__
        return cls

    def __setattr__(self: object, name: str, value: object) -> None:  # noqa: N807
        if not rules:
            fill()
        rule = rules.get(name)
        if rule is not None and type(value) not in rule[0]:
            value = rule[1](name, value)
        put(self, name, value)

    made.__setattr__ = __setattr__
    return cls


_Read: TypeAlias = "Callable[[str, Any], object]"
"""Returns the value to keep of a field's name and the value that was given, or raises."""


class _Rule(NamedTuple):
    """The check of a field."""

    exact: frozenset[type]
    """Types whose values are right, whatever they are. Looking at more takes far longer."""
    read: _Read


def _keep(name: str, value: object) -> object:
    return value


class _Kind(NamedTuple):
    """What a part of an annotation allows."""

    text: str
    fits: Callable[[Any], bool]
    """Whether a value is of this kind, as far as that can be seen without its elements."""
    convert: _Read = _keep
    """What is kept of a value that fits."""
    exact: frozenset[type] = frozenset()
    """Types all of whose values fit and are kept."""

    def read(self, name: str, value: Any) -> object:
        """Return what is kept of a value; ``RigError`` if it does not fit."""
        if not self.fits(value):
            raise RigError(f"{name}: expected {self.text}, found {_found(value)}")
        return self.convert(name, value)


def _found(value: object) -> str:
    """Return what an error says about a value of another type or length."""
    size: object = ""
    if isinstance(value, np.ndarray):
        size = " x ".join(map(str, value.shape))
    elif isinstance(value, Sequence) and not _is_text(value):
        size = len(value)
    return type(value).__name__ + (f" of {size}" if size != "" else "")


def _rule(cls: type, field: Field[Any]) -> _Rule | None:
    """Return the check of a field; None if it may be anything."""
    text = field.type.__name__ if isinstance(field.type, type) else str(field.type)
    kind = _kind(_parsed(text), vars(sys.modules[cls.__module__]))
    choices, limits = field.metadata.get("choices"), field.metadata.get("limits")
    shape = field.metadata.get("shape")
    if choices is not None:
        kind = _one_of((*choices, None) if "None" in text else choices)
    if shape is not None:
        kind = _either([_array(shape), _NOTHING]) if "None" in text else _array(shape)
    if kind is _ANYTHING:
        return None
    if limits is None:
        return _Rule(kind.exact, kind.read)
    low, high = limits
    wanted = f"{low:g} to {high:g}" if high < math.inf else f"{low:g} or more"

    def read(name: str, value: Any) -> object:
        found: Any = kind.read(name, value)
        if found is not None and not low <= found <= high:
            shown = min(max(found, -sys.float_info.max), sys.float_info.max)  # of huge integers
            raise RigError(f"{name}: expected {wanted}, found {shown:g}")
        return found

    return _Rule(frozenset(), read)


def _kind(node: ast.expr, known: Mapping[str, Any]) -> _Kind:
    """Return what an annotation allows; ``known``: names of its module."""
    match node:
        case ast.Constant(value=None):
            return _NOTHING
        case ast.Constant(value=str(text)):
            return _kind(_parsed(text), known)
        case ast.BinOp(left, ast.BitOr(), right):
            return _either([_kind(left, known), _kind(right, known)])
        case ast.Name(name) if name in _PLAIN:
            return _PLAIN[name]
        case ast.Name(name) if name in known or hasattr(builtins, name):
            return _kind_of(known.get(name) or getattr(builtins, name), known)
        case ast.Name(name):
            # Imported for type checkers only. Instances of a class exist only if it was imported;
            # a protocol has none and must be imported.
            return _Kind(name, lambda value: name in [each.__name__ for each in type(value).mro()])
        case ast.Subscript(ast.Name("Callable")):
            return _Kind("a function", callable)
        case ast.Subscript(ast.Name("tuple"), ast.Tuple([item, ast.Constant(value=end)])) if (
            end is ...
        ):
            return _sequence(tuple, _kind(item, known))
        case ast.Subscript(ast.Name("tuple"), ast.Tuple(items)):
            return _fixed([_kind(item, known) for item in items])
        case ast.Subscript(ast.Name("list"), item):
            return _sequence(list, _kind(item, known))
        case ast.Subscript(ast.Name("frozenset"), item):
            return _sequence(frozenset, _kind(item, known))
    return _ANYTHING


def _kind_of(found: Any, known: Mapping[str, Any]) -> _Kind:
    """Return what an annotation allows that has been evaluated: a class or an alias of types."""
    if isinstance(found, type) and get_origin(found) is None:
        if not getattr(found, "_is_protocol", False):
            exact = frozenset([found])
            return _Kind(type_name(found), lambda value: isinstance(value, found), exact=exact)
        methods = [name for name in vars(found) if not name.startswith("_")]
        return _Kind(found.__name__, lambda value: all(hasattr(value, each) for each in methods))
    if get_origin(found) is Literal:
        return _one_of(get_args(found))
    if get_origin(found) in (Union, UnionType):
        return _either([_kind_of(each, known) for each in get_args(found)])
    return _kind(_parsed(str(found)), known)


def _parsed(annotation: str) -> ast.expr:
    return ast.parse(annotation, mode="eval").body


def _either(kinds: Sequence[_Kind]) -> _Kind:
    def convert(name: str, value: object) -> object:
        return next(kind for kind in kinds if kind.fits(value)).convert(name, value)

    text = " or ".join(dict.fromkeys(kind.text for kind in kinds))
    exact = frozenset[type]().union(*(kind.exact for kind in kinds))
    return _Kind(text, lambda value: any(kind.fits(value) for kind in kinds), convert, exact)


def _one_of(choices: Collection[Any]) -> _Kind:
    """Return the kind of a value that is one of a few texts, or None."""

    def convert(name: str, value: Any) -> object:
        if value not in choices:
            hint = name_hint(value, [each for each in choices if isinstance(each, str)])
            raise RigError(f'{name}: no value "{printable(value, 60)}"; {hint}')
        return value

    def fits(value: object) -> bool:
        return isinstance(value, str) or (value is None and None in choices)

    text = " or ".join("None" if each is None else f'"{each}"' for each in choices)
    return _Kind(text, fits, convert)


_PLURALS = {"a number": "numbers", "an integer": "integers", "a text": "texts"}


def _sequence(
    made: type[tuple[Any, ...]] | type[list[Any]] | type[frozenset[Any]], item: _Kind
) -> _Kind:
    """Return the kind of a tuple, list or set with any number of elements of a kind."""

    def convert(name: str, value: Any) -> object:
        if type(value) is made and not value:
            return value
        found = [item.read(f"{name}[{place}]", each) for place, each in enumerate(value)]
        is_same = type(value) is made and all(map(operator.is_, found, value))
        return value if is_same else made(found)

    is_set = made is frozenset
    elements = _PLURALS.get(item.text, item.text)
    if elements[0].isdigit():
        elements = f"tuples of {elements}"

    def fits(value: object) -> bool:
        if isinstance(value, np.ndarray):
            return value.ndim > 0 and not is_set
        return isinstance(value, Set if is_set else Sequence) and not _is_text(value)

    return _Kind(f"{'a set' if is_set else 'a sequence'} of {elements}", fits, convert)


def _fixed(items: Sequence[_Kind]) -> _Kind:
    """Return the kind of a tuple with one element of each kind."""
    texts = [item.text for item in items]
    is_plain = len(set(texts)) == 1 and texts[0] in _PLURALS
    wanted = f"{len(items)} {_PLURALS[texts[0]]}" if is_plain else f"({', '.join(texts)})"

    def fits(value: object) -> bool:
        if isinstance(value, np.ndarray):
            return value.shape == (len(items),)
        return isinstance(value, Sequence) and not _is_text(value) and len(value) == len(items)

    def convert(name: str, value: Any) -> object:
        pairs = enumerate(zip(items, value, strict=True))
        found = tuple(item.read(f"{name}[{place}]", each) for place, (item, each) in pairs)
        is_same = type(value) is tuple and all(map(operator.is_, found, value))
        return value if is_same else found

    return _Kind(wanted, fits, convert)


def _is_text(value: object) -> bool:
    return isinstance(value, str | bytes)


def _array(shape: tuple[int | None, ...]) -> _Kind:
    """Return the kind of arrays of numbers that may be changed in place."""

    def convert(name: str, value: Any) -> object:
        is_kept = type(value) is np.ndarray and value.dtype == _FLOAT and value.flags.writeable
        # Much faster than ``frozen``, which says what is wrong.
        if is_kept and shape in (value.shape, (None,) * value.ndim) and are_finite(value):
            return value
        values = frozen(name, value.view() if is_kept else value, shape)
        return value if is_kept else values.copy()

    return _Kind("an array of numbers", lambda value: value is not None, convert)


def are_finite(values: Floats) -> bool:
    """Return whether no number is NaN or infinite, nor so large that its square may be."""
    # Twice as fast as ``isfinite``, and unlike a sum it never warns.
    return math.isfinite(np.vdot(values, values))


def _number(name: str, value: Any) -> object:
    try:
        number = value if type(value) in (float, int) else float(value)
        is_finite = math.isfinite(number)
    except OverflowError:  # an integer or a fraction that no float can hold
        raise RigError(f"{name}: expected a number up to {sys.float_info.max:.2g}") from None
    if not is_finite:
        raise RigError(f"{name}: expected a finite number, found {number}")
    return number


def _is_number(value: object) -> bool:
    return type(value) is float or (isinstance(value, Real) and not isinstance(value, bool))


def _is_integer(value: object) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool)


_NOTHING = _Kind("None", lambda value: value is None, exact=frozenset([NoneType]))
_ANYTHING = _Kind("anything", lambda value: True)
# ``frozen`` checks arrays of immutable objects and says what is wrong with them.
_ANY_ARRAY = _Kind("an array", lambda value: value is not None, exact=frozenset([np.ndarray]))
_PLAIN = {
    **dict.fromkeys(("Any", "object"), _ANYTHING),
    **dict.fromkeys(("Floats", "Ints", "Bools", "Bytes", "Deferred"), _ANY_ARRAY),
    "float": _Kind(type_name(float), _is_number, _number),
    "int": _Kind(type_name(int), _is_integer, lambda _, value: int(value), frozenset([int])),
    "bool": _Kind(
        *(type_name(bool), lambda value: isinstance(value, bool | np.bool_)),
        *(lambda _, value: bool(value), frozenset([bool])),
    ),
    "str": _Kind(type_name(str), lambda value: isinstance(value, str), exact=frozenset([str])),
}
"""Kinds by the name in annotations."""
