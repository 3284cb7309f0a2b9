"""Keywords and special numbers of ``.skel`` files."""

from __future__ import annotations

__all__ = ["KEYWORDS", "UNLIMITED"]

UNLIMITED = 100_000.0
"""CSE169's value for "no limit", which some files contain."""

KEYWORDS = frozenset(
    (b"offset", b"boxmin", b"boxmax", b"pose", b"rotxlimit", b"rotylimit", b"rotzlimit")
) | {b"balljoint"}
"""Words that begin an item of a joint, and cannot be part of a name."""
