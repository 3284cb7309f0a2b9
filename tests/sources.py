"""The syntax of source files, parsed once per run."""

import ast
import gc
from functools import cache
from pathlib import Path


@cache
def parsed(path: Path) -> ast.Module:
    """Return the syntax of a file."""
    # Syntax trees are large and stay: each collection would scan all of them, three times as long
    # as parsing takes.
    enabled = gc.isenabled()
    gc.disable()
    try:
        return ast.parse(path.read_text("utf-8"))
    finally:
        if enabled:
            gc.enable()
