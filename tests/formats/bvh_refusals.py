"""Refusals of BVH files given as text."""

from __future__ import annotations

from bvh_text import read
from faults import Fault, refusal_of


def refusal(text: str) -> Fault:
    return refusal_of(lambda: read(text))
