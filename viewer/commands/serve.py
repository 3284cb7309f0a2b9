"""A window that other programs on this machine move: Python programs, motion capture, avatars."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from viewer.commands import view
from viewer.commands._settings import add_settings, settings_of
from viewer.data_classes import dataclass, setting

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


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    view.add_arguments(parser)
    add_settings(parser.add_argument_group("other programs"), ServeOptions)


def run(arguments: argparse.Namespace) -> int:
    """Open the window, and listen until it is closed."""
    from viewer.app.display import find_display
    from viewer.app.live import Live
    from viewer.live.server import Server

    settings = settings_of(ServeOptions, arguments)
    find_display()
    server = Server(settings.connection_file or None)
    try:
        server.start()
        print(f"listening on 127.0.0.1:{server.port}; connection file {server.path}", flush=True)
        live = Live(server)
        if settings.wait:
            return _show_first_scene(server, live)
        return view.open_window(arguments, live=live)
    finally:
        server.close()


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
