"""A window that other programs on this machine move: Python programs, motion capture, avatars."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from viewer.commands import view
from viewer.commands._settings import add_settings, settings_of
from viewer.data_classes import dataclass, setting
from viewer.errors import ViewerError
from viewer.phrases import printable

if TYPE_CHECKING:
    from viewer.app.live import Live
    from viewer.live.server import Server

_POLL = 0.1  # seconds between looks at signals while there is no window


@dataclass(slots=True)
class ServeOptions:
    """How other programs find the window."""

    connection_file: str = setting(
        "",
        "file with the port and the token for viewer.connect (default: in the user's runtime "
        "folder)",
        metavar="FILE",
    )
    wait: bool = setting(False, "open the window when a program sends a scene")
    vmc_in: str = setting(
        "",
        "move the first humanoid as motion capture in VMC protocol does, received at a UDP port "
        "(usually 39539), of this machine only unless an address of it is given",
        metavar="[HOST:]PORT",
    )
    vmc_out: str = setting(
        "",
        "send its motion in VMC protocol to a UDP port, of this machine unless a host is given",
        metavar="[HOST:]PORT",
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    view.add_arguments(parser)
    add_settings(parser.add_argument_group("other programs"), ServeOptions)


def run(arguments: argparse.Namespace) -> int:
    """Open the window, and listen until it is closed."""
    from viewer.app.display import find_display
    from viewer.app.live import Live
    from viewer.live.server import Server
    from viewer.live.vmc import Receiver, Sender

    settings = settings_of(ServeOptions, arguments)
    receives, sends = _address("--vmc-in", settings.vmc_in), _address("--vmc-out", settings.vmc_out)
    find_display()
    server = Server(settings.connection_file or None)
    live = Live(server)
    try:
        live.vmc_in = None if receives is None else Receiver(*receives)
        live.vmc_out = None if sends is None else Sender(*sends)
        server.start()
        print(f"listening on 127.0.0.1:{server.port}; connection file {server.path}", flush=True)
        if settings.wait:
            return _show_first_scene(server, live)
        return view.open_window(arguments, live=live)
    finally:
        live.close()


def _address(option: str, text: str) -> tuple[str, int] | None:
    """Return host and port of an option; None if it is not given."""
    if not text:
        return None
    host, _, port = text.rpartition(":")
    if not (port.isascii() and port.isdecimal() and 0 < int(port) < 65536):
        raise ViewerError(
            f"{option}: expected a port from 1 to 65535, or HOST:PORT, found {printable(text, 60)}"
        )
    return host or "127.0.0.1", int(port)


def _show_first_scene(server: Server, live: Live) -> int:
    """Wait for a scene, and show it in a window."""
    from viewer.app.live import answer_first_scene
    from viewer.interrupts import poll

    while True:
        for request in server.take(_POLL):
            if request.message.do == "close":
                request.answer({})
                return 0
            started = answer_first_scene(server, request)
            if started is not None:
                from viewer.app.window import show

                show(started.scene, started.camera, started.options, live=live)
                return 0
        poll()
