"""The syntax of source files, parsed once per run."""

import ast
import gc
from functools import cache
from pathlib import Path


@cache
def parsed(path: Path) -> ast.Module:
    """Return the syntax of a file."""
    # Syntax trees are large and stay: each collection would scan all of them, three times as long
    # as parsing takes, and walking through them five times as long. So none is scanned ever again.
    enabled = gc.isenabled()
    gc.disable()
    try:
        return ast.parse(path.read_text("utf-8"))
    finally:
        gc.freeze()
        if enabled:
            gc.enable()
