"""Lazy import of SciPy, which only rigging needs."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from viewer.errors import RigError


def scipy_part(name: str) -> ModuleType:
    """Import a submodule of SciPy, such as ``sparse.linalg``; RigError if it is not installed."""
    try:
        return import_module(f"scipy.{name}")
    except ModuleNotFoundError:
        raise RigError("rigging needs scipy: pip install scipy") from None
