"""Run every benchmark, or those named: ``python tests/bench/run.py start skinning``."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path

NAMES = ("start", "memory", "skinning", "read")

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

for name in sys.argv[1:] or NAMES:
    import_module(f"bench_{name}").main()
