"""Dataclasses that compile nothing when their module is imported.

For a frozen class, ``dataclasses.dataclass`` compiles four functions, which takes 0.5 ms; this was
a quarter of the start-up time of short commands. Here ``__init__`` is compiled for the first
instance, and the other methods are shared. Fields and slots are those of the standard library.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from operator import attrgetter
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

__all__ = ["dataclass", "setting"]


def setting(default: Any, help: str = "", **metadata: Any) -> Any:
    """Return a field of a settings class, from which options of commands are made.

    ``default``: its only statement; a list is copied. ``help``: text of the option, in which
    ``{default}`` stands for the default. ``metadata``: other facts, which
    ``viewer.commands._settings`` lists; panels use ``choices``, ``limits``, and for sliders
    ``unit``, the format of the number, ``logarithmic``, and ``slider``, ends within the limits.
    """
    of = {"default_factory": default.copy} if isinstance(default, list) else {"default": default}
    return dataclasses.field(**of, metadata={"help": help, **metadata})


_MOST_NUMBERS = 16
"""Numbers of an array in the text of an instance: a matrix, but no list of vertices."""


class _Factory:
    """Default of parameters whose field has a factory."""

    def __repr__(self) -> str:
        return "<factory>"


if TYPE_CHECKING:
    from dataclasses import dataclass
else:

    def dataclass(
        cls: type | None = None,
        /,
        *,
        frozen: bool = False,
        eq: bool = True,
        slots: bool = False,
        weakref_slot: bool = False,
        kw_only: bool = False,
    ) -> Any:
        """Turn a class into a dataclass, as ``dataclasses.dataclass`` does.

        ``cls``: the class, if the decorator has no arguments. ``InitVar`` is not supported.
        """
        options = {"slots": slots, "weakref_slot": weakref_slot, "kw_only": kw_only}

        def decorate(cls: type) -> type:
            if cls.__doc__ is None:
                # The standard decorator would derive it from the signature, which takes long.
                cls.__doc__ = f"{cls.__name__}({', '.join(cls.__annotations__)})"
            made = dataclasses.dataclass(init=False, repr=False, eq=False, **options)(cls)
            _add_methods(made, frozen, eq)
            return made

        return decorate if cls is None else decorate(cls)


def _add_methods(cls: type, frozen: bool, eq: bool) -> None:
    """Add the methods that a class does not define itself."""
    fields = dataclasses.fields(cls)
    methods: dict[str, Any] = {"__init__": _init(cls, frozen), "__repr__": _repr}
    if eq:
        compared = [field.name for field in fields if field.compare]
        methods |= {"__eq__": _equal(_values(compared)), "__hash__": None}
        if frozen:
            hashed = [f.name for f in fields if (f.compare if f.hash is None else f.hash)]
            values = _values(hashed)

            def __hash__(self: object) -> int:  # noqa: N807
                return hash(values(self))

            methods["__hash__"] = __hash__
    if frozen:
        methods |= _refusals(cls, frozenset(field.name for field in fields))
        if "__slots__" in cls.__dict__:
            methods |= {"__getstate__": _state, "__setstate__": _set_state}
    own = {*cls.__dict__}
    if "__eq__" in own and cls.__dict__.get("__hash__") is None:
        own.discard("__hash__")  # Python adds None to classes that define ``__eq__``
    for name, method in methods.items():
        if name not in own:
            setattr(cls, name, method)
    if cls.__dict__["__init__"] is methods["__init__"]:
        cls.__signature__ = _Signature(cls, frozen)  # type: ignore[attr-defined]


def _init(cls: type, frozen: bool) -> Callable[..., None]:
    """Return an ``__init__`` that a compiled one replaces when it is first called."""
    compiled: list[Callable[..., None]] = []

    def __init__(self: object, *args: object, **kwargs: object) -> None:  # noqa: N807
        if not compiled:
            compiled.append(_compiled_init(cls, frozen))
        if cls.__dict__.get("__init__") is __init__:
            # A function that wraps this one stays.
            cls.__init__ = compiled[0]  # type: ignore[misc]
        compiled[0](self, *args, **kwargs)

    return __init__


def _compiled_init(cls: type, frozen: bool) -> Callable[..., None]:
    """Return a function that assigns the fields, as that of the standard library does."""
    names: dict[str, Any] = {"__set__": object.__setattr__, "__factory__": _Factory()}
    parameters, keywords = ["self"], ["*"]
    lines = []
    for field in dataclasses.fields(cls):
        name = value = field.name
        default = ""
        if field.default is not dataclasses.MISSING:
            names[f"__default_{name}__"] = field.default
            default = f"=__default_{name}__"
            value = name if field.init else f"__default_{name}__"
        elif field.default_factory is not dataclasses.MISSING:
            names[f"__new_{name}__"] = field.default_factory
            default = "=__factory__"
            value = f"__new_{name}__()"
            if field.init:
                value += f" if {name} is __factory__ else {name}"
        elif not field.init:
            continue  # assigned by ``__post_init__``
        if field.init:
            (keywords if field.kw_only else parameters).append(name + default)
        lines.append(f"__set__(self, {name!r}, {value})" if frozen else f"self.{name} = {value}")
    if hasattr(cls, "__post_init__"):
        lines.append("self.__post_init__()")
    if len(keywords) > 1:
        parameters += keywords
    body = "\n    ".join(lines or ["pass"])
    exec(f"def __init__({', '.join(parameters)}):\n    {body}", names)
    init: Callable[..., None] = names["__init__"]
    init.__qualname__, init.__module__ = f"{cls.__qualname__}.__init__", cls.__module__
    init.__annotations__ = {f.name: f.type for f in dataclasses.fields(cls) if f.init}
    return init


class _Signature:
    """Parameters of a class for ``inspect.signature``: ``__init__`` may not be compiled yet."""

    def __init__(self, cls: type, frozen: bool) -> None:
        self._cls, self._frozen = cls, frozen

    def __get__(self, instance: object, owner: Any) -> object:
        inits = [each.__dict__["__init__"] for each in owner.__mro__ if "__init__" in vars(each)]
        if instance is not None or inits[0] is not self._cls.__dict__["__init__"]:
            # The signature of an instance is that of ``__call__``; a subclass has its own.
            raise AttributeError("__signature__")
        import inspect

        found = inspect.signature(_compiled_init(self._cls, self._frozen))
        return found.replace(parameters=list(found.parameters.values())[1:])


@recursive_repr()
def _repr(self: Any) -> str:
    shown = [
        f"{f.name}={_short(getattr(self, f.name))}" for f in dataclasses.fields(self) if f.repr
    ]
    return f"{type(self).__qualname__}({', '.join(shown)})"


def _short(value: Any) -> str:
    """Return a value as text; of a large array, only its type and shape."""
    # Anything with these is an array of numpy, which short commands do not import.
    is_array = hasattr(value, "dtype") and hasattr(value, "shape")
    if is_array and value.size > _MOST_NUMBERS:
        return f"<{value.dtype} {value.shape}>"
    return repr(value)


def _values(names: list[str]) -> Callable[[object], Any]:
    """Return a function from an instance to the tuple of some of its fields."""
    if len(names) > 1:
        return attrgetter(*names)
    return lambda instance: tuple(getattr(instance, name) for name in names)


def _equal(values: Callable[[object], Any]) -> Callable[[object, object], bool]:
    def __eq__(self: object, other: object) -> bool:  # noqa: N807
        if other.__class__ is not self.__class__:
            return NotImplemented
        return bool(values(self) == values(other))

    return __eq__


def _refusals(cls: Any, names: frozenset[str]) -> dict[str, Any]:
    """Return the methods of a frozen class that refuse to assign and to delete its fields."""

    def __setattr__(self: object, name: str, value: object) -> None:  # noqa: N807
        if type(self) is cls or name in names:
            raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
        super(cls, self).__setattr__(name, value)

    def __delattr__(self: object, name: str) -> None:  # noqa: N807
        if type(self) is cls or name in names:
            raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")
        super(cls, self).__delattr__(name)

    return {"__setattr__": __setattr__, "__delattr__": __delattr__}


def _state(self: Any) -> list[object]:
    """Return the fields for ``pickle`` and ``copy``."""
    return [getattr(self, field.name) for field in dataclasses.fields(self)]


def _set_state(self: Any, state: list[object]) -> None:
    for field, value in zip(dataclasses.fields(self), state, strict=True):
        object.__setattr__(self, field.name, value)
