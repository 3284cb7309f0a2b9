"""Runner of all or the named benchmarks: ``python tests/bench/run.py start skinning``."""

import sys
from importlib import import_module
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "formats")]

known = sorted(path.stem.removeprefix("bench_") for path in HERE.glob("bench_*.py"))
chosen = sys.argv[1:] or known
sys.argv[1:] = []  # the benchmarks have arguments of their own
for name in chosen:
    import_module(f"bench_{name}").main()
