"""Refusals of BVH files given as text."""

from faults import Fault, refusal_of
from formats.bvh_text import read


def refusal(text: str) -> Fault:
    return refusal_of(lambda: read(text))
