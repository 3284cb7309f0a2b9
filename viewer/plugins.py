"""Plug-ins: rows of registries that other installed packages add through entry points.

A package states them in its ``pyproject.toml``; the name of an entry point is the key of a row::

    [project.entry-points."viewer.formats"]
    off = "viewer_off.off"                   # reads .off: a module with read(source)

    [project.entry-points."viewer.scalars"]
    height = "viewer_off.heights:HEIGHT"     # a viewer.rigs.scalars.Scalar

``viewer help plugins`` lists all groups. Entry points are looked up only if a registry lacks a key,
so programs without plug-ins start as fast, and rows of this program cannot be replaced. A module is
imported when its row is used. Any exception of a plug-in becomes an error of one line that names
its distribution.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import field
from functools import cache
from typing import Any, Literal, TypeAlias, get_args

from viewer.data_classes import dataclass
from viewer.errors import PluginError, ViewerError
from viewer.interrupts import Interrupted
from viewer.phrases import printable
from viewer.progress import Cancelled

Group: TypeAlias = Literal[
    "formats", "exporters", "scalars", "checks", "skinning", "commands", "panels", "tools"
]

GROUPS: tuple[Group, ...] = get_args(Group)

_PARTS: dict[Group, tuple[str, ...]] = {
    "formats": ("read",),
    "exporters": ("EXPORTER", "export"),
    "scalars": (),
    "checks": ("CODES", "check"),
    "skinning": ("METHOD", "SHADER", "deform"),
    "commands": ("add_arguments", "run"),
    "panels": ("draw",),
    "tools": ("recognises", "read"),
}
"""What the module of an entry point must have."""

_NOT_ITS_OWN = (
    ViewerError,
    BrokenPipeError,
    Cancelled,
    Interrupted,
    KeyboardInterrupt,
    GeneratorExit,
)
"""Errors with a text for users, and ends of the work: no mistakes of a plug-in."""

_is_enabled = True


@dataclass(frozen=True, slots=True)
class Plugin:
    """A row that a package adds to a registry."""

    group: Group
    """The registry."""
    name: str
    """Key of the row."""
    target: str
    """Module, and the object in it if it is not the module itself: ``module:object``."""
    distribution: str
    """Name and version of the installed package."""
    _failures: list[ViewerError] = field(default_factory=list, compare=False, repr=False)
    """The error of the import, which is tried once: menus and panels ask in every frame."""

    def load(self) -> Any:
        """Import the module, and return what the entry point names, with all that it must have."""
        if self._failures:
            raise self._failures[0].with_traceback(None)
        try:
            return self._imported()
        except ViewerError as problem:
            self._failures.append(problem)
            raise

    def _imported(self) -> Any:
        from importlib import import_module
        from operator import attrgetter

        module, _, name = self.target.partition(":")
        with self.guarded("cannot be imported"):
            found = import_module(module)
            found = attrgetter(name)(found) if name else found
        missing = [part for part in _PARTS[self.group] if not hasattr(found, part)]
        if missing:
            raise self.error(f"expected a module with {' and '.join(missing)}, found none")
        return found

    @contextmanager
    def guarded(self, what: str, may_exit: bool = False) -> Iterator[None]:
        """Turn exceptions of the plug-in into errors of one line; ``what`` failed."""
        try:
            yield
        except _NOT_ITS_OWN:
            raise
        except BaseException as problem:  # those of extension modules in Rust are no Exception
            if may_exit and isinstance(problem, SystemExit):
                raise
            reason = printable(f"{type(problem).__name__}: {problem}", 300)
            raise self.error(f"{what}: {reason}") from problem

    def error(self, problem: str) -> PluginError:
        """Return an error that names the distribution."""
        return PluginError(f"plug-in {self.distribution} ({self.group} {self.name}): {problem}")


def plugin_of(group: Group, name: str) -> Plugin | None:
    """Return the plug-in with a key, if plug-ins are enabled and one has it."""
    return next((found for found in plugins_of(group) if found.name == name), None)


def added_to(group: Group, own: Collection[str]) -> tuple[Plugin, ...]:
    """Return the plug-ins of a registry that are used: those whose keys are not its own."""
    return tuple(found for found in plugins_of(group) if found.name not in own)


def plugins_of(group: Group) -> tuple[Plugin, ...]:
    """Return the plug-ins of a registry, by name; of several with one name, the first."""
    first: dict[str, Plugin] = {}
    for found in installed_plugins(group):
        first.setdefault(found.name, found)
    return tuple(first.values())


def installed_plugins(group: Group) -> tuple[Plugin, ...]:
    """Return the plug-ins of a registry, by name and distribution, with those of equal names."""
    return _installed(group) if _is_enabled else ()


def are_enabled() -> bool:
    """Return whether installed plug-ins are used."""
    return _is_enabled


@contextmanager
def without_plugins() -> Iterator[None]:
    """Ignore installed plug-ins in the block."""
    global _is_enabled
    before, _is_enabled = _is_enabled, False
    try:
        yield
    finally:
        _is_enabled = before


@cache
def _installed(group: Group) -> tuple[Plugin, ...]:
    from importlib.metadata import entry_points

    found = []
    for each in entry_points(group=f"viewer.{group}"):
        # A suffix is also written as ".off" or "OFF".
        is_suffix = group in ("formats", "exporters")
        name = each.name.lower().removeprefix(".") if is_suffix else each.name
        package = "of an unknown package"
        if each.dist is not None:
            package = f"{each.dist.metadata['Name']} {each.dist.version}"
        found.append(Plugin(group, name, each.value.strip(), printable(package, 100)))
    return tuple(sorted(found, key=lambda each: (each.name, each.distribution)))
