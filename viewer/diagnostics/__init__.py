"""Faults and remarks as data: what was found, where, and with which values.

A :class:`Diagnostic` names its message by a key, ``"W004.vertices"``: the stable code before the
dot, and which of the code's messages after it. Severity, title and cure of a code are in
``wording/``, and so is every message, a template. Nothing recovers meaning from text.
"""

from __future__ import annotations

from viewer.diagnostics.codes import SEVERITIES, Code
from viewer.diagnostics.collector import Collector
from viewer.diagnostics.describing import described
from viewer.diagnostics.diagnostic import Diagnostic, Part
from viewer.diagnostics.phrase import Phrase
from viewer.diagnostics.wording import CODES, MESSAGES

__all__ = [
    "CODES",
    "MESSAGES",
    "SEVERITIES",
    "Code",
    "Collector",
    "Diagnostic",
    "Part",
    "Phrase",
    "described",
]
