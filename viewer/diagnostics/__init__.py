"""Faults and remarks as data: what was found, where, and with which values.

A :class:`Diagnostic` names its message by a key, ``"W004.vertices"``: the stable code before the
dot, and which of the code's messages after it. Severity, title and cure of a code are in
``codes.py``; every message is a template in ``wording/``. Nothing recovers meaning from text.
"""

from __future__ import annotations

from viewer.diagnostics.codes import CODES, SEVERITIES, Code
from viewer.diagnostics.collector import Collector
from viewer.diagnostics.diagnostic import Diagnostic, Part
from viewer.diagnostics.phrase import Phrase
from viewer.diagnostics.wording import MESSAGES

__all__ = [
    "CODES",
    "MESSAGES",
    "SEVERITIES",
    "Code",
    "Collector",
    "Diagnostic",
    "Part",
    "Phrase",
]
