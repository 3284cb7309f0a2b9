"""Server of a window: programs of the same user and machine send it figures, poses and settings.

It listens on the loopback address only. A file that only the user can read has the port and a
random token, which a client must prove to know. A thread per client reads and checks messages;
those that touch the scene wait in a queue for the frame loop. Poses do not wait: the latest one of
each actor is shown in the next frame.
"""

from __future__ import annotations

import contextlib
import queue
import secrets
import socket
import threading
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import ViewerError
from viewer.live.connection_file import file_path, read_file, write_file
from viewer.live.handshake import Greeting, is_alive
from viewer.live.messages import (
    FIRST,
    BrokenStreamError,
    Message,
    MessageError,
    Values,
    packed,
    read,
    receiver,
    told_of,
)
from viewer.live.objects import pack, unpack
from viewer.phrases import printable
from viewer.rigs.pose import Pose
from viewer.rigs.scene import Actor, pose_actors, time_span
from viewer.rigs.skinning import deform

_MOST_CLIENTS = 16
_MOST_WAITING = 64  # requests in the queue; further clients wait
_FIRST_SECONDS = 5.0  # in which a client must prove to know the token
_ANSWER_SECONDS = 60.0  # in which the frame loop must answer

POSE = ("dofs", "translations", "rotations", "scales", "shape_weights", "figure_translation")
"""Arrays of a message with a pose, in this order; the scale of the figure is a fact."""

REQUESTS = ("scene", "put", "remove", "look", "time", "camera", "get", "fetch", "close")
"""Messages that the frame loop answers."""


@dataclass(slots=True)
class Counts:
    """What a server has received."""

    clients: int = 0
    """Connected now."""
    messages: int = 0
    refused: int = 0
    """Messages that were malformed or could not be obeyed, and clients without the token."""


class Request:
    """A message that waits for the frame loop."""

    def __init__(self, message: Message, content: Any) -> None:
        self.message, self.content = message, content
        self.facts: Mapping[str, Any] = {}
        self.object: Any = None
        """Answer, and an object that belongs to it."""
        self.problem = ""
        self._is_done = threading.Event()

    def answer(self, facts: Mapping[str, Any], sent: Any = None) -> None:
        """Answer with facts and an object."""
        self.facts, self.object = facts, sent
        self._is_done.set()

    def refuse(self, problem: str) -> None:
        """Answer with an error."""
        self.problem = problem
        self._is_done.set()

    def wait(self) -> Message:
        """Return the answer once there is one."""
        if not self._is_done.wait(_ANSWER_SECONDS):
            raise ViewerError(f"{self.message.do}: the window did not answer")
        if self.problem:
            raise ViewerError(self.problem)
        arrays: list[Values] = []
        told = {"object": pack(self.object, arrays)} if self.object is not None else {}
        return Message("ok", {**self.facts, **told}, arrays)


class Edit(NamedTuple):
    """A pose that the user has set in the window."""

    number: int
    """Later edits have larger numbers."""
    pose: Pose


@dataclass(slots=True)
class _Poses:
    """Poses on their way to the window and from it, by the number of their actor."""

    lock: threading.Lock = field(default_factory=threading.Lock)
    latest: dict[int, Pose] = field(default_factory=dict)
    """Poses of programs that are shown in the next frame."""
    edits: dict[int, Edit] = field(default_factory=dict)
    """Poses that the user has set and nothing has changed since."""
    n_edits: int = 0

    def put(self, actor: int, pose: Pose) -> None:
        """Let a program's pose replace those before it, also one of the user that is unread."""
        with self.lock:
            self.latest[actor] = pose
            self.edits.pop(actor, None)

    def note(self, poses: Mapping[int, Pose | None]) -> None:
        """Note poses that the user has set; None for an actor that something else has moved."""
        with self.lock:
            for actor, pose in poses.items():
                if pose is None:
                    self.edits.pop(actor, None)
                elif actor not in self.latest:  # else a program's pose replaces it in this frame
                    self.n_edits += 1
                    self.edits[actor] = Edit(self.n_edits, pose)

    def since(self, number: int) -> dict[int, Edit]:
        """Return the edits after one."""
        with self.lock:
            return {actor: edit for actor, edit in self.edits.items() if edit.number > number}


class Server:
    """Listens from ``start`` to ``close``; ``wake`` is called when a frame has to be drawn."""

    def __init__(self, path: str | Path | None = None) -> None:
        self.path = file_path(path)
        existing = read_file(self.path)
        if existing is not None and is_alive(existing):
            raise ViewerError(
                f"{printable(self.path, 300)}: expected no other window, found that of process "
                f"{existing.pid}: close it, or name another file with --connection-file"
            )
        self.counts = Counts()
        self.wake: Callable[[], None] = lambda: None
        self.actors: dict[int, Actor] = {}
        """The actors of the scene by their number, which no other actor ever gets."""
        self._n_actors = 0
        self._poses = _Poses()
        self._requests: queue.Queue[Request] = queue.Queue(_MOST_WAITING)
        self._token = secrets.token_urlsafe(32)
        self._clients: set[socket.socket] = set()
        self._is_over = self._has_file = False
        self._socket = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._socket.getsockname()[1])

    def start(self) -> None:
        """Write the file that lets programs in, and listen in threads."""
        write_file(self.path, self.port, self._token)
        self._has_file = True
        threading.Thread(target=self._accept, name="live", daemon=True).start()

    def close(self) -> None:
        """Stop listening, remove the file, and end all connections."""
        self._is_over = True
        if self._has_file:
            with contextlib.suppress(OSError):
                self.path.unlink()
        # Closing alone would not end a call of ``accept`` in another thread.
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        for request in self.take():
            request.refuse("the window was closed")
        for client in [*self._clients]:
            with contextlib.suppress(OSError):
                client.shutdown(socket.SHUT_RDWR)

    # Called by the frame loop.

    @property
    def has_news(self) -> bool:
        """Whether something waits for the frame loop."""
        return bool(self._poses.latest) or not self._requests.empty()

    def take(self, wait: float = 0.0) -> list[Request]:
        """Return the requests that wait; without any, wait for one for some seconds."""
        found = list[Request]()
        with contextlib.suppress(queue.Empty):
            while True:
                found.append(self._requests.get(wait > 0.0 and not found, wait or None))
        return found

    def take_poses(self) -> dict[int, Pose]:
        """Return the poses that were received since the last call, by the actor's number."""
        with self._poses.lock:
            found, self._poses.latest = self._poses.latest, {}
        return found

    def note(self, poses: Mapping[int, Pose | None]) -> None:
        """Let programs read poses that the user has set, by the actor's number.

        None takes back the one of an actor that something else has moved.
        """
        self._poses.note(poses)

    def follow(self, actors: Iterable[Actor]) -> None:
        """Give numbers to the actors that a scene has now."""
        known = {id(actor): number for number, actor in self.actors.items()}
        now = dict[int, Actor]()
        for actor in actors:
            number = known.get(id(actor))
            if number is None:
                self._n_actors += 1
                number = self._n_actors
            now[number] = actor
        self.actors = now  # replaced, never changed: threads of clients read it

    def number_of(self, actor: Actor) -> int:
        """Return the number of an actor of the scene."""
        return next(number for number, known in self.actors.items() if known is actor)

    # Threads.

    def _accept(self) -> None:
        while not self._is_over:
            try:
                client, _ = self._socket.accept()
            except OSError:
                return  # closed
            if len(self._clients) >= _MOST_CLIENTS:
                self.counts.refused += 1
                client.close()
                continue
            self._clients.add(client)
            threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        """Answer one client until it leaves; what it has sent stays, unless it owns the window."""
        self.counts.clients += 1
        greeting = Greeting(self._token)
        try:
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            # However slowly a client sends, it does not occupy a place for long without the token.
            receive = receiver(client, _FIRST_SECONDS)
            while not self._is_over:
                is_known = greeting.is_over
                try:
                    message = read(receive) if is_known else read(receive, FIRST)
                    self.counts.messages += message.do != "edits"  # asked for 60 times per second
                    answer = self._answer(message) if is_known else greeting.answer(message)
                    if greeting.is_over and not is_known:
                        receive = receiver(client)
                        client.settimeout(None)
                except (EOFError, OSError):
                    return
                except Exception as problem:  # handed to the client, whose mistake it may be
                    self.counts.refused += 1
                    self.wake()
                    client.sendall(packed(Message("error", {"text": told_of(problem)})))
                    if not is_known or isinstance(problem, BrokenStreamError):
                        return
                else:
                    client.sendall(packed(answer))
        except OSError:
            return  # it left before it was answered
        finally:
            self.counts.clients -= 1
            self._clients.discard(client)
            client.close()
            if greeting.owns:
                self._requests.put(Request(Message("close", {}), None))
            self.wake()

    def _answer(self, message: Message) -> Message:
        if message.do == "pose":
            number = message.index("actor")
            pose = self._pose(message, self._actor(number))
            self._poses.put(number, pose)
            self.wake()
            return Message("ok", {})
        if message.do == "edits":
            return self._edits(message.index("since"))
        if message.do not in REQUESTS:
            raise MessageError(f"unknown message {printable(message.do, 60)}")
        if "actor" in message.facts and message.do != "put":
            self._actor(message.index("actor"))
        request = Request(message, _content(message))
        self._requests.put(request, timeout=_ANSWER_SECONDS)
        self.wake()
        if self._is_over:
            raise ViewerError("the window was closed")
        return request.wait()

    def _actor(self, number: int) -> Actor:
        found = self.actors.get(number)
        if found is None:
            raise MessageError(f"no actor {number}: it was removed, or the scene was replaced")
        return found

    def _edits(self, since: int) -> Message:
        """Return the poses that the user has set since an edit, of actors that are still there."""
        told, arrays = list[list[float]](), list[Values]()
        for actor, edit in self._poses.since(since).items():
            if actor in self.actors:
                told.append([actor, edit.number, float(edit.pose.figure_scale)])
                arrays += [edit.pose.values, edit.pose.shape_weights]
        return Message("ok", {"edits": told}, arrays)

    def _pose(self, message: Message, actor: Actor) -> Pose:
        """Return the pose of a message, which must fit the actor's figure."""
        pose = actor.pose.copy()
        for index, name in enumerate(POSE):
            is_free = name == "shape_weights"
            shape = (None,) if is_free else getattr(pose, name).shape
            setattr(pose, name, message.array(index, shape))
        if len(pose.shape_weights) > actor.figure.n_shapes:
            raise MessageError(
                f"pose: expected at most {actor.figure.n_shapes} shape weights, found "
                f"{len(pose.shape_weights)}"
            )
        lengths = np.linalg.norm(pose.rotations, axis=1, keepdims=True)
        if not lengths.all():
            raise MessageError("pose: expected unit quaternions, found zeros")
        pose.rotations /= lengths
        pose.figure_scale = message.number("figure_scale")
        return pose


def _content(message: Message) -> Any:
    """Return the object of a message, checked as far as that needs no scene."""
    if "object" not in message.facts:
        return None
    found = unpack(message.facts["object"], message.arrays)
    for actor in found if message.do == "scene" and isinstance(found, tuple) else (found,):
        if not isinstance(actor, Actor):
            raise MessageError(f"{message.do}: expected an actor, found {type(actor).__name__}")
        _check(actor)
    return found


def _check(actor: Actor) -> None:
    """Pose and skin an actor once: what does not fit is refused before drawing."""
    if actor.clip is not None:
        pose_actors([actor.copy()], time_span([actor])[0])
    if actor.figure.mesh is not None and actor.figure.mesh.n_vertices == 0:
        raise MessageError("expected at least one vertex")
    if actor.figure.mesh is not None and actor.own_pose is not None:
        posed, _ = deform(actor.figure, actor.pose)
        if not np.isfinite(posed).all():
            raise MessageError("expected finite vertices")
