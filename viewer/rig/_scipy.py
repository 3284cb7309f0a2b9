"""SciPy, which only rigging needs: imported when asked for, missed with one line."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from viewer.errors import RigError


def scipy_part(name: str) -> ModuleType:
    """Import a part of SciPy.

    ``name``: below ``scipy``, such as ``sparse.linalg``.
    Raises RigError if SciPy is not installed: it is the optional extra ``rig``.
    """
    try:
        return import_module(f"scipy.{name}")
    except ModuleNotFoundError:
        raise RigError("rigging needs scipy: pip install scipy") from None
