"""Commands that run Python in a separate process in which no signal is ignored."""

import sys

# A signal that is ignored when a program starts stays ignored: after nohup, in background jobs of a
# shell, and on many CI runners. A preexec_fn is no alternative, because it would run in a fork of a
# process that may have threads.
_LISTEN = (
    "import os, signal, sys\n"
    "for name in ('SIGINT', 'SIGTERM', 'SIGHUP'):\n"
    "    signal.signal(getattr(signal, name), signal.SIG_DFL)\n"
    "os.execv(sys.executable, [sys.executable, *sys.argv[1:]])\n"
)


def listening(*arguments: object) -> list[str | bytes]:
    """Return a command that runs Python with these arguments and ignores no signal."""
    given = [one if isinstance(one, bytes) else str(one) for one in arguments]
    return [sys.executable, "-I", "-S", "-c", _LISTEN, *given]
