"""Parsing of numbers on the command line."""

from __future__ import annotations

import argparse
import math


def number(text: str) -> float:
    """Return a finite number; argparse prefixes the error with the option."""
    value = float(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"expected a finite number, found {text}")
    return value
