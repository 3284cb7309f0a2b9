"""Run the viewer: ``python -m viewer`` and the command ``viewer``."""

from __future__ import annotations

import sys


def main() -> int:
    """Run the command line and return its exit code."""
    try:
        from viewer.interrupts import program
    except KeyboardInterrupt:  # a few milliseconds in which nobody else looks after signals
        sys.stderr.write("viewer: interrupted\n")
        return 130
    return program(_run)


def _run() -> int:
    from viewer.cli import run

    return run(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
