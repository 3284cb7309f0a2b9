"""Locations of shaders, assets, manual and examples, in a checkout and in a wheel."""

from __future__ import annotations

from pathlib import Path

from viewer.errors import ViewerError

_PACKAGE = Path(__file__).resolve().parent


def resource(kind: str, *parts: str) -> Path:
    """Return the path of a file that ships in one of its folders, such as "shaders"."""
    # The folders are inside the package in a wheel, and next to it in a checkout.
    for base in (_PACKAGE, _PACKAGE.parent):
        path = base.joinpath(kind, *parts)
        if path.exists():
            return path
    wanted = Path(kind, *parts)
    raise ViewerError(f"the installation lacks {wanted}: install skinning-viewer again")
