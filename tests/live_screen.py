"""A window without OpenGL: its state, which a thread advances as the frame loop does."""

import threading
import time
from contextlib import contextmanager

from app.driver import make_state

import viewer
from viewer.app.live import Live, advance_live
from viewer.live.server import Server
from viewer.live.vmc import Receiver

PATIENCE = 60.0  # timeout of an expected event in seconds


class Screen:
    """A server with a scene; programs connect to ``path``."""

    def __init__(self, path, scene=None, vmc=False):
        self.path, self.server = path, Server(path)
        self.state = make_state(scene or viewer.load())
        receiver = Receiver("127.0.0.1", 0) if vmc else None
        self.live = self.state.put(Live(self.server, receiver))
        self.frame = threading.RLock()
        """Held during a frame: a test that edits holds it as well."""
        self._is_over = False
        self._thread = threading.Thread(target=self._run)
        self.server.start()
        self._thread.start()

    def _run(self):
        while not self._is_over:
            with self.frame:
                self.state.observe()
                if self.state.clock.pose(self.state.actor):
                    self.state.history.follow(self.state.update_version(), self.state.clock.time)
                advance_live(self.state)
            time.sleep(0.001)

    def wait(self, condition):
        """Wait until a condition of the state is true."""
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, "not seen"
            time.sleep(0.001)

    def close(self):
        self._is_over = True
        self._thread.join()
        self.live.close()


def can_undo(screen):
    """Return whether there was an edit of the user; it is undone."""
    state = screen.state
    with screen.frame:
        state.observe()
        return state.history.undo(state.scene, state.options, lambda time: None)


@contextmanager
def screen_at(path, scene=None, vmc=False):
    """Open a screen for the duration of a block."""
    screen = Screen(path, scene, vmc)
    try:
        yield screen
    finally:
        screen.close()
