"""Runner of all or the named benchmarks: ``python tests/bench/run.py start skinning``."""

import sys
from importlib import import_module
from pathlib import Path

NAMES = [
    "start",
    "memory",
    "models",
    "skinning",
    "frames",
    "bodies",
    "deform",
    "instances",
    "materials",
    "structure",
    "motion",
    "big_files",
    "gltf",
    "nodes",
    "captures",
    "batch",
    "observing",
    "losses",
    "live",
    "lint",
    "faults",
    "feet",
    "transfer",
    "binding",
    "rigging",
    "decomposition",
    "video",
    "quality",
]

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "formats")]

chosen = sys.argv[1:] or NAMES
sys.argv[1:] = []  # the benchmarks have arguments of their own
for name in chosen:
    import_module(f"bench_{name}").main()
