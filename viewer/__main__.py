"""Run the viewer: ``python -m viewer`` and the command ``viewer``."""

import gc
import os
import sys

# The threads of OpenBLAS busy-wait for 2**26 clock cycles before they sleep, even right after numpy
# is imported: 20 to 40 ms of processor time for each. They wake up fast enough after 2**20 cycles.
_SPIN = ("OPENBLAS_THREAD_TIMEOUT", "20")
# NVIDIA's driver keeps compiled shaders for the next start, but for the root user, who runs most
# containers, only if told to.
_SHADERS = ("__GL_SHADER_DISK_CACHE", "1")


def main() -> int:
    """Run the command line and return its exit code."""
    try:
        received = _record_signals()
        return _run(received)
    except KeyboardInterrupt:  # before the first statement above had its effect
        sys.stderr.write("viewer: interrupted\n")
        return 130


def _record_signals() -> list[int]:
    """Record signals from now on, in the list that is returned.

    Until then a signal ends Python itself: without a word, or with a traceback of its imports. So
    nothing may be imported here: the module ``signal`` takes longer than all of Python's start.
    """
    import _signal  # type: ignore[import-not-found]

    received = list[int]()

    def record(number: int, _: object) -> None:
        received.append(number)

    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(_signal, name, None)
        # As in ``viewer.interrupts``: nohup and shells ignore signals for background jobs.
        if number is not None and _signal.getsignal(number) not in (_signal.SIG_IGN, None):
            _signal.signal(number, record)
    return received


def _run(received: list[int]) -> int:
    # Garbage collection during imports would find nothing; ``run`` resumes it.
    gc.disable()
    os.environ.setdefault(*_SPIN)
    os.environ.setdefault(*_SHADERS)
    from viewer.interrupts import watch_program

    watch_program(received)
    from viewer.cli import run

    return run(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
