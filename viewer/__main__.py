"""Run the viewer: ``python -m viewer`` and the command ``viewer``."""

import gc
import os
import sys

# The threads of OpenBLAS busy-wait for 2**26 clock cycles before they sleep, even right after numpy
# is imported: 20 to 40 ms of processor time for each. They wake up fast enough after 2**20 cycles.
_SPIN = ("OPENBLAS_THREAD_TIMEOUT", "20")


def main() -> int:
    """Run the command line and return its exit code."""
    # Garbage collection during imports would find nothing; ``run`` resumes it.
    gc.disable()
    os.environ.setdefault(*_SPIN)
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
