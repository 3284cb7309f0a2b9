"""Run the viewer: ``python -m viewer`` and the command ``viewer``."""

import gc
import sys


def main() -> int:
    """Run the command line and return its exit code."""
    # Garbage collection during imports would find nothing; ``run`` resumes it.
    gc.disable()
    try:
        from viewer.interrupts import watch_program

        watch_program()
    except KeyboardInterrupt:  # the handlers are not installed yet
        sys.stderr.write("viewer: interrupted\n")
        return 130
    from viewer.cli import run

    return run(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
