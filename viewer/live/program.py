"""A window in another process, which shows what a program changes: its poses, actors and time."""

from __future__ import annotations

import atexit
import contextlib
import os
import selectors
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import NoneType
from typing import Any, NamedTuple, Self

import numpy as np

from viewer.arguments import check_type
from viewer.data_classes import dataclass
from viewer.errors import RenderError, ViewerError
from viewer.live.connection_file import file_path, read_file
from viewer.live.handshake import NotTheWindowError, join
from viewer.live.messages import (
    Message,
    MessageError,
    Values,
    packed,
    read,
    receiver,
    told_of,
)
from viewer.live.objects import pack, unpack
from viewer.live.server import POSE
from viewer.near_names import name_hint
from viewer.phrases import printable
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.memo import NumberKey
from viewer.rigs.pose import Pose
from viewer.rigs.scene import Actor, Motion, Scene
from viewer.rigs.shape import shaped

_RATE = 60.0  # times per second at which changes are looked for
_RETRY_SECONDS = 1.0  # after which changes that were refused are sent again
_START_SECONDS = 60.0  # in which a new window must listen
_ANSWER_SECONDS = 90.0  # longer than a window may take
_CLOSE_SECONDS = 5.0


class _ClosedError(ViewerError):
    """The window was closed by the user or this program."""


class _Look(NamedTuple):
    """How an actor is drawn."""

    visible: bool
    color: tuple[float, ...] | None
    opacity: float
    placement: bytes


class _Content(NamedTuple):
    """A key of what is sent as a whole: the figure and the motion."""

    figure: Figure
    clip: Motion | None
    offset: float
    name: str
    hidden_parts: frozenset[int]
    weights: bytes


@dataclass(slots=True)
class _Sent:
    """What the window has of an actor."""

    number: int
    """The window's number of the actor."""
    content: _Content
    look: _Look
    pose: NumberKey


class Live:
    """A connection to a window; changes of the actors in ``scene`` are shown at once.

    A thread looks for them 60 times per second: new poses and numbers changed in place, colours,
    placements and visibility, actors added to or removed from ``scene.actors``, and ``scene.time``.
    It also changes the poses of these actors, in place, as the user does in the window; a pose that
    the program has changed itself is sent instead.
    """

    _owns = False
    """Whether the window closes when the connection ends, even if the program was killed."""

    def __init__(self, path: str | Path | None = None) -> None:
        self.scene = Scene([])
        """The actors that this program shows; those of others are fetched by ``live[name]``."""
        self._sent: dict[Actor, _Sent] = {}
        self._time: float | None = None
        self._n_edits = 0
        """Number of the last edit of the user that was read."""
        self._lock = threading.RLock()
        self._is_over = threading.Event()
        self._loss: ViewerError = _ClosedError("the window was closed")
        self._problem = ""
        """Error with which the thread's last look ended."""
        self._socket = _connected(file_path(path), self._owns)
        self._receive = receiver(self._socket)
        self._arrivals = selectors.DefaultSelector()
        self._arrivals.register(self._socket, selectors.EVENT_READ)
        _CONNECTIONS.add(self)
        threading.Thread(target=self._follow, name="live", daemon=True).start()

    @property
    def is_open(self) -> bool:
        """Whether the window is still there."""
        return not self._is_over.is_set()

    def close(self) -> None:
        """End the connection; the window stays, with all that it shows."""
        if self.is_open:
            with contextlib.suppress(ViewerError):
                self.update()
        self._leave()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __getitem__(self, name: str) -> Actor:
        """Return an actor by its name; one that the window has of others is fetched."""
        with self._lock:
            own = [actor for actor in self.scene.actors if name in (actor.name, actor.title)]
            if own:
                self._read_edits()
                return own[0]
            shown = self._get()["actors"]
            for number, title in shown:
                if name == title:
                    return self._fetched(number)
        hint = name_hint(name, [title for _, title in shown])
        raise ViewerError(f'no actor "{printable(name, 60)}"; {hint}')

    def _fetched(self, number: int) -> Actor:
        answer = self._ask("fetch", {"actor": number})
        actor = unpack(answer.facts["object"], answer.arrays)
        if not isinstance(actor, Actor):
            raise MessageError(f"fetch: expected an actor, found {type(actor).__name__}")
        self.scene.actors.append(actor)
        self._sent[actor] = _Sent(number, _content(actor), _look(actor), _pose_key(actor))
        return actor

    def show(self, scene: Scene, **facts: Any) -> None:
        """Replace what the window shows; from now on, changes of this scene are shown."""
        check_type("scene", scene, Scene)
        with self._lock:
            sent, arrays = [_sendable(actor) for actor in scene.actors], list[Values]()
            if not sent:
                raise ViewerError("show: expected a scene with actors, found an empty one")
            told = {"object": pack(tuple(sent), arrays), "up": scene.up, "time": scene.time}
            told |= {name: pack(each, arrays) for name, each in facts.items() if each is not None}
            numbers = self._ask("scene", told, arrays).facts["numbers"]
            for actor in scene.actors:
                _note_springs(actor)
            self.scene, self._time = scene, scene.time
            self._sent = {
                actor: _Sent(number, _content(actor), _look(actor), _pose_key(actor))
                for actor, number in zip(scene.actors, numbers, strict=True)
            }

    def add(self, what: Figure | Actor) -> Actor:
        """Add a figure or an actor to what the window shows; return the actor."""
        check_type("add", what, Figure, Actor)
        actor = Actor(what) if isinstance(what, Figure) else what
        with self._lock:
            self.scene.actors.append(actor)
            try:
                self.update()
            except ViewerError:
                self.scene.actors.remove(actor)
                raise
        return actor

    def remove(self, actor: Actor) -> None:
        """Remove an actor from what the window shows, and from ``scene``."""
        with self._lock:
            if actor not in self.scene.actors:
                raise ViewerError(f"remove: expected an actor of the scene, found {actor!r}")
            self.scene.actors.remove(actor)
            self.update()

    def update(self) -> None:
        """Send all changes now, and wait until the window has them; read those of the user.

        Raises ``ViewerError`` if a change does not fit.
        """
        with self._lock:
            self._require_open()
            try:
                self._read_edits()
                self._send_all()
            except ViewerError:
                raise
            except Exception as problem:  # a value that cannot be converted
                raise ViewerError(told_of(problem)) from problem

    def _read_edits(self) -> None:
        """Set the poses that the user has set in the window, unless the program has changed them.

        They are not sent back: the window has them.
        """
        if not self._sent:
            return
        answer = self._ask("edits", {"since": self._n_edits})
        actors = {sent.number: (actor, sent) for actor, sent in self._sent.items()}
        for row, (number, edit, scale) in enumerate(answer.facts["edits"]):
            self._n_edits = max(self._n_edits, edit)
            if number in actors:
                values, weights = answer.arrays[2 * row : 2 * row + 2]
                _set_pose(*actors[number], values, weights, scale)

    def _send_all(self) -> None:
        for actor in [each for each in self._sent if each not in self.scene.actors]:
            self._ask("remove", {"actor": self._sent[actor].number})
            del self._sent[actor]
        for actor in [*self.scene.actors]:
            self._send_object(actor)
        if self.scene.time is not None and self.scene.time != self._time:
            self._ask("time", {"time": float(self.scene.time)})
            self._time = self.scene.time
        for actor, sent in self._sent.items():
            self._send_changes(actor, sent)

    def _send_object(self, actor: Actor) -> None:
        """Send an actor that is new or has another figure or motion."""
        content, known = _content(actor), self._sent.get(actor)
        if known is not None and known.content == content:
            return
        # Taken first: what the program changes while the actor is sent is then sent, too.
        look, pose = _look(actor), _pose_key(actor)
        arrays: list[Values] = []
        told: dict[str, Any] = {"object": pack(_sendable(actor), arrays)}
        if known is not None:
            told["actor"] = known.number
        number = self._ask("put", told, arrays).facts["number"]
        if known is None or known.content.clip is not actor.clip:
            _note_springs(actor)
        self._sent[actor] = _Sent(number, content, look, pose)

    def _send_changes(self, actor: Actor, sent: _Sent) -> None:
        look = _look(actor)
        if look != sent.look:
            told = {
                "actor": sent.number,
                "visible": look.visible,
                "color": look.color,
                "opacity": look.opacity,
            }
            self._ask("look", told, [np.asarray(actor.placement, np.float64)])
            sent.look = look
        pose = actor.own_pose
        if pose is None:
            return
        key = sent.pose.updated(*_numbers(pose))
        if key is sent.pose:
            return
        shown = _without_shapes(pose) if _needs_files(actor) else pose
        facts = {"actor": sent.number, "figure_scale": float(pose.figure_scale)}
        self._ask("pose", facts, [np.asarray(getattr(shown, name), float) for name in POSE])
        sent.pose = key

    @property
    def time(self) -> float:
        """Seconds on the window's timeline."""
        return float(self._get()["time"])

    @time.setter
    def time(self, seconds: float) -> None:
        check_type("time", seconds, float)
        self._ask("time", {"time": float(seconds)})

    @property
    def camera(self) -> dict[str, Any]:
        """``azimuth``, ``inclination``, ``distance`` and ``target``; some of them may be set."""
        found: dict[str, Any] = self._get()["camera"]
        return found

    @camera.setter
    def camera(self, values: Mapping[str, Any]) -> None:
        plain = {
            name: np.asarray(value, float).tolist() if name == "target" else float(value)
            for name, value in values.items()
        }
        self._ask("camera", plain)

    @property
    def selection(self) -> tuple[str, ...]:
        """The names of the actor that is chosen in the window, and of the selected joint if any."""
        return tuple(self._get()["selection"])

    @property
    def counts(self) -> dict[str, int]:
        """Clients of the window now, messages that it received, and those that it refused."""
        found: dict[str, int] = self._get()["counts"]
        return found

    def _get(self) -> Mapping[str, Any]:
        return self._ask("get", {}).facts

    def _ask(self, do: str, facts: Mapping[str, Any], arrays: Sequence[Values] = ()) -> Message:
        """Send a message and return the answer; raises ``ViewerError`` for one that is an error."""
        data = packed(Message(do, facts, arrays))
        with self._lock:
            self._require_open()
            try:
                self._socket.sendall(data)
                answer = read(self._receive)
            except (OSError, EOFError):
                self._lose()
                raise self._loss from None
            except BaseException:  # such as Ctrl-C: a part of a message may remain in the stream
                self._leave()
                raise
        if answer.do == "error":
            raise ViewerError(f"{do}: {answer.text('text')}")
        return answer

    def _require_open(self) -> None:
        """Raise if the window was closed, also if nothing has been sent since."""
        # Between an answer and the next message, only the end of the stream can arrive.
        if self.is_open and self._arrivals.select(0.0):
            self._lose()
        if not self.is_open:
            raise self._loss

    def _follow(self) -> None:
        """Look for changes until the connection ends."""
        due = time.monotonic()
        while not self._is_over.wait(max(due - time.monotonic(), 0.0)):
            try:
                self.update()
                self._problem = ""
                # A look that took long is not made up for.
                due = max(due + 1.0 / _RATE, time.monotonic())
            except _ClosedError:
                return
            except ViewerError as problem:
                if str(problem) != self._problem:
                    sys.stderr.write(f"viewer: {problem}\n")
                    self._problem = str(problem)
                due = time.monotonic() + _RETRY_SECONDS

    def _lose(self) -> None:
        """End the connection because the window has ended it."""
        self._leave()

    def _leave_to_parent(self) -> None:
        """Let go of the connection in a fork, whose messages would mix with those of its parent."""
        # The thread that may hold the locks does not exist here.
        self._lock, self._is_over = threading.RLock(), threading.Event()
        self._loss = _ClosedError("expected the process that opened the connection, found a fork")
        self._leave()

    def _leave(self) -> None:
        with self._lock:  # the thread may be about to use them
            if self.is_open:
                self._is_over.set()
                self._arrivals.close()
                self._socket.close()


class Window(Live):
    """A window that this program has opened in another process; it closes with the program."""

    _owns = True

    def __init__(self, scene: Scene, **facts: Any) -> None:
        check_type("scene", scene, Scene)
        self._pid = os.getpid()
        self._folder = Path(tempfile.mkdtemp(prefix="viewer-"))
        self._process = _started(self._folder)
        try:
            super().__init__(_waited(self._process, self._folder))
            self.show(scene, **facts)
        except BaseException:
            self._end()
            raise
        atexit.register(self.close)

    def close(self) -> None:
        """Close the window."""
        atexit.unregister(self.close)
        if os.getpid() != self._pid:
            return  # a fork of the program ends, not the program
        if self.is_open:
            with contextlib.suppress(ViewerError):
                self._ask("close", {})
        self._leave()
        self._end()

    def _lose(self) -> None:
        """End the connection, and find out whether the window has failed."""
        super()._lose()
        with contextlib.suppress(subprocess.TimeoutExpired):
            code = self._process.wait(_CLOSE_SECONDS)
            if code != 0:
                self._loss = _failure(self._folder, code)

    def _end(self) -> None:
        """Wait for the process, and end it if it does not end by itself."""
        try:
            self._process.wait(_CLOSE_SECONDS)
        except subprocess.TimeoutExpired:
            self._process.terminate()
            self._process.wait(_CLOSE_SECONDS)
        shutil.rmtree(self._folder, ignore_errors=True)


_CONNECTIONS: weakref.WeakSet[Live] = weakref.WeakSet()
"""All connections of this process."""


def _after_fork() -> None:
    for live in _CONNECTIONS:
        live._leave_to_parent()


if hasattr(os, "register_at_fork"):  # not on Windows
    os.register_at_fork(after_in_child=_after_fork)


def connect(path: str | Path | None = None) -> Live:
    """Connect to a window that ``viewer serve`` has opened on this machine.

    Parameters
    ----------
    path
        The connection file that ``viewer serve`` printed; by default the usual one.

    Returns
    -------
    Live
        A context manager with ``add``, ``remove``, ``show``, ``update``, ``time``, ``camera`` and
        ``selection``; ``live["name"]`` is an actor of the window. What is changed on actors is
        shown at once. At the end, the window keeps what it shows.

    Raises
    ------
    ViewerError
        If no window listens.
    """
    check_type("path", path, str, Path, NoneType)
    return Live(path)


def _connected(path: Path, owns: bool) -> socket.socket:
    """Return a connection to the window of a connection file."""
    known, name = read_file(path), printable(path, 300)
    if known is None:
        raise ViewerError(
            f"{name}: expected the connection file of a window, found none: start viewer serve"
        )
    try:
        stream = join(known, owns)
    except ConnectionRefusedError:
        raise ViewerError(
            f"{name}: expected a window on port {known.port}, found none: start viewer serve"
        ) from None
    except OSError:
        raise ViewerError(f"{name}: the window on port {known.port} did not answer") from None
    except NotTheWindowError:
        raise ViewerError(
            f"{name}: expected a window on port {known.port}, found another program: the window "
            "has crashed; start viewer serve"
        ) from None
    except ViewerError as problem:
        raise ViewerError(f"{name}: {problem}") from None
    stream.settimeout(_ANSWER_SECONDS)
    # Poses are small and must not wait to be sent together.
    stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return stream


def _started(folder: Path) -> subprocess.Popen[bytes]:
    """Start the process of a window, which imports this package from where it is."""
    home = str(Path(__file__).resolve().parents[2])
    paths = [home, *filter(None, [os.environ.get("PYTHONPATH")])]
    command = [sys.executable, "-m", "viewer", "serve", "--wait"]
    with (folder / "errors.txt").open("wb") as errors:
        return subprocess.Popen(
            [*command, "--connection-file", str(folder / "window.json")],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=errors,
            start_new_session=True,  # Ctrl-C in the program's terminal is for the program
        )


def _waited(process: subprocess.Popen[bytes], folder: Path) -> Path:
    """Return the connection file once the process listens."""
    path, deadline = folder / "window.json", time.monotonic() + _START_SECONDS
    while not path.exists():
        code = process.poll()
        if code is not None:
            raise _failure(folder, code)
        if time.monotonic() > deadline:
            process.kill()
            raise ViewerError(f"the window did not start within {_START_SECONDS:.0f} s")
        time.sleep(0.01)
    return path


def _failure(folder: Path, code: int) -> ViewerError:
    """Return the error with which the process of a window ended."""
    lines = (folder / "errors.txt").read_text("utf-8", "replace").splitlines()
    told = (lines or [f"exit code {code}"])[-1].removeprefix("viewer: ")
    kind = RenderError if code == RenderError.exit_code else ViewerError
    return kind(told.removeprefix("error: "))


def _set_pose(actor: Actor, sent: _Sent, values: Values, weights: Values, scale: float) -> None:
    """Set a pose of the window in place, unless the program has changed it or has other joints."""
    pose = actor.own_pose
    if pose is None or pose.values.shape != values.shape:
        return
    if sent.pose.updated(*_numbers(pose)) is not sent.pose:
        return
    if _needs_files(actor):
        weights = pose.shape_weights  # the window has their result
    edited = Pose(np.array(values), pose.n_dofs, np.array(weights), scale)
    # What the program changes meanwhile is kept if the user has not changed it, too.
    # Bits are compared, as in keys: 0.0 and -0.0 differ.
    changed = np.array(pose.values, float).view(np.int64) != edited.values.view(np.int64)
    pose.values[changed] = edited.values[changed]
    if not np.array_equal(pose.shape_weights, edited.shape_weights):
        pose.shape_weights = edited.shape_weights.copy()
    pose.figure_scale = scale
    sent.pose = NumberKey(*_numbers(edited))


def _needs_files(actor: Actor) -> bool:
    """Return whether the shapes of an actor are computed from the files of a model."""
    shapes = actor.figure.blend_shapes
    return shapes is not None and shapes.space is not None


def _sendable(actor: Actor) -> Actor:
    """Return an actor as it is sent; shapes that need the files of a model are applied to it."""
    pose = actor.own_pose
    if pose is None or not _needs_files(actor):
        return actor
    figure = replace(shaped(actor.figure, pose.shape_weights), blend_shapes=None)
    return replace(actor, figure=figure, own_pose=_without_shapes(pose))


def _note_springs(actor: Actor) -> None:
    """Tell the user of a program that the springs of an actor with a motion do not swing."""
    if actor.springs is not None and actor.clip is not None:
        name = printable(actor.name, 60)
        sys.stderr.write(f"viewer: {name}: its spring joints do not swing in the window\n")


def _without_shapes(pose: Pose) -> Pose:
    return replace(pose, shape_weights=np.zeros(0))


def _content(actor: Actor) -> _Content:
    pose = actor.own_pose
    weights = b"" if pose is None or not _needs_files(actor) else pose.shape_weights.tobytes()
    return _Content(actor.figure, actor.clip, actor.offset, actor.name, actor.hidden_parts, weights)


def _look(actor: Actor) -> _Look:
    # Programs may set arrays and numbers of NumPy.
    color = None if actor.color is None else tuple(float(each) for each in actor.color)
    placement = np.asarray(actor.placement).tobytes()
    return _Look(bool(actor.visible), color, float(actor.opacity), placement)


def _pose_key(actor: Actor) -> NumberKey:
    return NumberKey() if actor.own_pose is None else NumberKey(*_numbers(actor.own_pose))


def _numbers(pose: Pose) -> list[Floats]:
    """Return all numbers of a pose."""
    return [*(getattr(pose, name) for name in POSE), np.array([pose.figure_scale])]
