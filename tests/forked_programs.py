"""Programs forked from a process that has imported the viewer, to save the time of imports.

A forked program starts at its first line, with default signal handlers, and ends as any program
does: exit functions run, and the interpreter is shut down.
"""

import gc
import json
import os
import socket
import subprocess
import sys
from importlib import import_module
from pathlib import Path

from children import listening

ROOT = Path(__file__).resolve().parents[1]
PATIENCE = 100.0  # timeout of a program in seconds
# All modules that a run imports after its first one.
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


class Forker:
    """The process that is forked; it has no threads and no OpenGL context."""

    def __init__(self) -> None:
        self._connection, other = socket.socketpair()
        self._connection.settimeout(PATIENCE)
        with other:
            self._process = subprocess.Popen(
                listening(__file__, other.fileno()),
                env={**os.environ, "PYTHONPATH": str(ROOT)},
                pass_fds=[other.fileno()], stdin=subprocess.DEVNULL,
                # These are pipes because forked programs replace them with their own pipes.
                stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            )  # fmt: skip

    def run(self, program, arguments, folder) -> subprocess.CompletedProcess:
        """Run a program like ``python -c``, its output captured."""
        request = json.dumps([program, *map(str, arguments), str(folder)]).encode()
        pipes = [os.pipe() for _ in range(2)]
        socket.send_fds(self._connection, [request], [writing for _, writing in pipes])
        for _, writing in pipes:
            os.close(writing)
        streams = []
        for reading, _ in pipes:  # too short to fill a pipe
            with os.fdopen(reading, "rb") as stream:
                streams.append(stream.read())
        code = int(self._connection.recv(16) or self._failed())
        return subprocess.CompletedProcess(arguments, code, *streams)

    def _failed(self):
        raise RuntimeError(self._process.communicate(timeout=PATIENCE)[1].decode())

    def close(self) -> None:
        self._connection.close()
        assert self._process.communicate(timeout=PATIENCE) == (b"", b"")


def serve(connection: socket.socket) -> tuple[list[str], list[int]]:
    """Fork for each request; return in the forked process, with the request and its streams."""
    while True:
        request, streams, *_ = socket.recv_fds(connection, 1 << 16, 2)
        if not request:
            sys.exit()
        pid = os.fork()
        if not pid:
            connection.close()
            return json.loads(request), streams
        for stream in streams:
            os.close(stream)
        _, status = os.waitpid(pid, 0)
        connection.sendall(b"%d" % os.waitstatus_to_exitcode(status))


if __name__ == "__main__":
    for module in IMPORTED:
        import_module(module)
    gc.freeze()
    (source, *given, place), (out, err) = serve(socket.socket(fileno=int(sys.argv[1])))
    for handle, copy in ((out, 1), (err, 2)):
        os.dup2(handle, copy)
        os.close(handle)
    os.chdir(place)
    sys.argv = ["-c", *given]
    exec(compile(source, "<string>", "exec"), {"__name__": "__main__"})
