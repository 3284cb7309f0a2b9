"""Programs forked from a process that has imported the viewer, to save the time of imports.

A forked program starts at its first line, with default signal handlers, and ends as any program
does: exit functions run, and the interpreter is shut down.
"""

import gc
import json
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path

from children import listening

ROOT = Path(__file__).resolve().parents[1]
VIEWER = "import sys; from viewer.__main__ import main; sys.exit(main())"
PATIENCE = 100.0  # timeout of a program in seconds
# All modules that a command imports after its first one.
IMPORTED = (
    "numpy",
    "moderngl",
    "PIL.Image",
    "PIL.PngImagePlugin",
    "av",
    "rich.progress",
    "viewer.cli",
    "viewer.commands.convert",
    "viewer.commands.info",
    "viewer.commands.lint",
    "viewer.commands.render",
    "viewer.commands.render",
    "viewer.formats.anim",
    "viewer.formats.ply",
    "viewer.formats.skel",
    "viewer.formats.skin",
    "viewer.media.picture_sinks",
    "viewer.media.video",
    "viewer.rendering.offscreen",
    "viewer.rendering.passes.late_passes",
    "viewer.rendering.sampling",
    "viewer.rendering.recorder",
)


class Forked:
    """A forked program, as far as tests need it like one of ``subprocess``."""

    def __init__(self, connection: socket.socket, failed, streams: list[int]) -> None:
        self._connection, self._failed, self._streams = connection, failed, streams
        self._output = dict.fromkeys(streams, b"")
        self.returncode: int | None = None
        self.pid = self._number()

    def _number(self) -> int:
        return struct.unpack("i", self._connection.recv(4, socket.MSG_WAITALL) or self._failed())[0]

    def poll(self) -> int | None:
        if self.returncode is None and select.select([self._connection], [], [], 0.0)[0]:
            self.returncode = self._number()
        return self.returncode

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)

    def communicate(self, timeout: float = PATIENCE) -> tuple[bytes, ...]:
        """Return what the program has written until its end."""
        end = time.monotonic() + timeout
        while self._streams:
            left = max(end - time.monotonic(), 0.0)
            ready = select.select(self._streams, [], [], left)[0]
            if not ready:
                raise TimeoutError(f"the program runs for longer than {timeout:g} s")
            for stream in ready:
                data = os.read(stream, 1 << 16)
                self._output[stream] += data
                if not data:
                    os.close(stream)
                    self._streams.remove(stream)
        if self.returncode is None:
            self.returncode = self._number()
        return tuple(self._output.values())


class Forker:
    """The process that is forked, for one program at a time; it has no threads and no OpenGL."""

    def __init__(self, modules=IMPORTED, **environment: str) -> None:
        self._connection, other = socket.socketpair()
        self._connection.settimeout(PATIENCE)
        self._started: Forked | None = None
        with other:
            self._process = subprocess.Popen(
                listening(__file__, other.fileno(), *modules),
                env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
                pass_fds=[other.fileno()], stdin=subprocess.DEVNULL,
                # These are pipes because forked programs replace them with their own pipes.
                stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            )  # fmt: skip

    def start(self, program, arguments, folder, environment=None) -> Forked:
        """Start a program like ``python -c``, its output captured."""
        self._end()
        place = [dict(environment or os.environ), str(folder)]
        request = json.dumps([place, program, *map(str, arguments)]).encode()
        pipes = [os.pipe() for _ in range(2)]
        socket.send_fds(self._connection, [request], [writing for _, writing in pipes])
        for _, writing in pipes:
            os.close(writing)
        self._started = Forked(self._connection, self._failed, [reading for reading, _ in pipes])
        return self._started

    def _end(self) -> None:
        """End a program that a failed test has left: its exit code would be taken for a pid."""
        if self._started is not None and self._started.returncode is None:
            self._started.kill()
            self._started.communicate()

    def run(self, program, arguments, folder, environment=None) -> subprocess.CompletedProcess:
        """Run a program to its end."""
        started = self.start(program, arguments, folder, environment)
        streams = started.communicate()
        return subprocess.CompletedProcess(arguments, started.returncode, *streams)

    def _failed(self):
        raise RuntimeError(self._process.communicate(timeout=PATIENCE)[1].decode())

    def close(self) -> None:
        self._end()
        self._connection.close()
        assert self._process.communicate(timeout=PATIENCE) == (b"", b"")


def serve(connection: socket.socket) -> tuple[list, list[int]]:
    """Fork for each request; return in the forked process, with the request and its streams."""
    while True:
        request, streams, *_ = socket.recv_fds(connection, 1 << 20, 2)
        if not request:
            connection.close()
            sys.exit()
        pid = os.fork()
        if not pid:
            connection.close()
            return json.loads(request), streams
        for stream in streams:
            os.close(stream)
        connection.sendall(struct.pack("i", pid))
        _, status = os.waitpid(pid, 0)
        connection.sendall(struct.pack("i", os.waitstatus_to_exitcode(status)))


if __name__ == "__main__":
    for module in sys.argv[2:]:
        import_module(module)
    gc.freeze()
    request, (out, err) = serve(socket.socket(fileno=int(sys.argv[1])))
    (environment, place), source, *given = request
    os.environ.clear()
    os.environ.update(environment)
    for handle, copy in ((out, 1), (err, 2)):
        os.dup2(handle, copy)
        os.close(handle)
    os.chdir(place)
    sys.argv = ["-c", *given]
    exec(compile(source, "<string>", "exec"), {"__name__": "__main__"})
