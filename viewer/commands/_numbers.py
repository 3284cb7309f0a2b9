"""Numbers on the command line."""

from __future__ import annotations

import argparse
import math


def number(text: str) -> float:
    """Return a finite number; argparse words the refusal."""
    value = float(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"expected a finite number, found {text}")
    return value
