"""Run Python in a separate process that receives signals, however the tests were started."""

from __future__ import annotations

import sys

# A signal that is ignored when a program starts stays ignored, as after nohup, in a shell's
# background and on many machines that run tests. Not in preexec_fn: that forks a process that may
# have threads.
_LISTEN = (
    "import os, signal, sys\n"
    "for name in ('SIGINT', 'SIGTERM', 'SIGHUP'):\n"
    "    signal.signal(getattr(signal, name), signal.SIG_DFL)\n"
    "os.execv(sys.executable, [sys.executable, *sys.argv[1:]])\n"
)


def listening(*arguments: object) -> list[str | bytes]:
    """Return a command: Python with these arguments, in which no signal is ignored."""
    given = [one if isinstance(one, bytes) else str(one) for one in arguments]
    return [sys.executable, "-I", "-S", "-c", _LISTEN, *given]
