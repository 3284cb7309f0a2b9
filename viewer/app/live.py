"""What other programs do in the window: scenes, poses, time and camera that they send."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import field, replace
from typing import Any, NamedTuple

import numpy as np

from viewer.app.actors.following import stop_following
from viewer.app.closing import Closing
from viewer.app.core.saved_work import SavedWork
from viewer.app.core.scene_version import ActorVersion, SceneVersion
from viewer.app.core.state import AppState
from viewer.data_classes import dataclass
from viewer.live.messages import Message, MessageError, told_of
from viewer.live.objects import unpack
from viewer.live.server import Request, Server
from viewer.live.vmc import Receiver, Sender, TPose, is_humanoid, perform, performed, t_pose
from viewer.phrases import counted
from viewer.rendering.camera import Camera
from viewer.rendering.options import DisplayOptions
from viewer.rigs.pose import Pose, pose_key
from viewer.rigs.scene import Actor, Scene

_CAMERA = {"azimuth": (-1e9, 1e9), "inclination": (-90.0, 90.0), "distance": (1e-9, 1e12)}
"""Numbers of a camera that programs may set, and their limits."""
_SWITCH = 1e-3
"""Seconds after which a thread that computes lets another one run. With the usual 5 ms, each packet
that arrives during a frame waits so long before it is read."""


@dataclass(slots=True)
class Live:
    """The server of a window that other programs may change."""

    server: Server | None = None
    vmc_in: Receiver | None = None
    vmc_out: Sender | None = None
    """Motion in VMC protocol, of the first humanoid of the scene."""
    humanoid: TPose | None = None
    """That humanoid, once it was moved or sent."""
    sent: object = None
    """Key of the pose that was sent last."""
    version: SceneVersion | None = None
    """The scene at the end of the last frame."""
    lacks_humanoid: Scene | None = None
    """Scene without a humanoid, about which a message was shown."""
    usual_switch: float = field(default_factory=sys.getswitchinterval, init=False)
    """What ``_SWITCH`` replaces until ``close``."""

    def __post_init__(self) -> None:
        if self.server is not None:
            sys.setswitchinterval(min(_SWITCH, self.usual_switch))

    @property
    def has_news(self) -> bool:
        """Whether something was received that the next frame must show."""
        parts = (self.server, self.vmc_in)
        return any(part is not None and part.has_news for part in parts)

    def wake_by(self, wake: Callable[[], None]) -> None:
        """Let threads call a function when a frame has to be drawn."""
        if self.server is not None:
            self.server.wake = wake
        if self.vmc_in is not None:
            self.vmc_in.wake = wake

    def lines(self) -> list[tuple[str, str]]:
        """Return what was received, for the Stats panel."""
        if self.server is None:
            return []
        counts = self.server.counts
        messages = f"{counted(counts.messages, 'message')}, {counts.refused:,} refused"
        found = [("Live", f"{counted(counts.clients, 'program')}, {messages}")]
        if self.vmc_in is not None:
            packets = self.vmc_in.counts
            text = f"{counted(packets.packets, 'packet')}, {packets.malformed:,} malformed"
            found.append(("VMC in", text))
        if self.vmc_out is not None:
            packets = self.vmc_out.counts
            found.append(("VMC out", counted(packets.packets, "packet")))
        return found

    def close(self) -> None:
        """End all connections."""
        sys.setswitchinterval(self.usual_switch)
        for part in (self.server, self.vmc_in, self.vmc_out):
            if part is not None:
                part.close()


def advance_live(state: AppState) -> None:
    """Obey what programs have sent since the last frame; none of it is an edit of the user."""
    live = state.of(Live)
    server = live.server
    if server is None:
        return
    server.follow(state.scene.actors)
    _note_poses(state, live, server, _by_user)
    for request in server.take():
        try:
            answer = _ACTIONS[request.message.do](state, server, request)
        except Exception as problem:  # a mistake of the program, which must not end the window
            request.refuse(told_of(problem))
        else:
            server.follow(state.scene.actors)
            request.answer(*answer)
    poses = server.take_poses()
    for number, pose in poses.items():
        actor = server.actors.get(number)
        # The actor may have been replaced since the pose was checked.
        if actor is not None and _fits(actor.own_pose, pose):
            actor.pose = pose
    if _perform(state, live) or poses:
        state.history.follow(state.update_version(), state.clock.time)
    _note_poses(state, live, server, lambda state, one: False)
    _send_performance(state, live)
    state.stats.live = live.lines()


def _note_poses(
    state: AppState,
    live: Live,
    server: Server,
    is_edit: Callable[[AppState, ActorVersion], bool],
) -> None:
    """Let programs read the poses that have changed since the last call and are edits."""
    if state.version is live.version:
        return
    before = () if live.version is None else live.version.actors
    live.version = state.version
    known = {one.actor: one.pose for one in before}
    numbers = {actor: number for number, actor in server.actors.items()}
    changed = [
        one
        for one in state.version.actors
        if one.actor in numbers and one.pose != known.get(one.actor, one.pose)
    ]
    if changed:
        server.note(
            {
                numbers[one.actor]: one.actor.pose.copy() if is_edit(state, one) else None
                for one in changed
            }
        )


def _by_user(state: AppState, one: ActorVersion) -> bool:
    """Return whether the user has set a pose, not the clock."""
    return one.clip is None or state.history.is_by_hand(one)


def _perform(state: AppState, live: Live) -> bool:
    """Move the humanoid of the scene as a performer does; return whether it moved."""
    receiver = live.vmc_in
    if receiver is None or not receiver.has_news:
        return False
    given = receiver.take()
    actor = _humanoid(state, live) if given.is_loaded else None
    if actor is None or live.humanoid is None:
        return False
    actor.pose = perform(live.humanoid, actor.pose, given)
    return True


def _send_performance(state: AppState, live: Live) -> None:
    """Send the pose of the humanoid of the scene if it has changed."""
    sender = live.vmc_out
    actor = None if sender is None else _humanoid(state, live)
    if sender is None or actor is None or live.humanoid is None:
        return
    key = actor.figure, pose_key(actor.pose)
    if key != live.sent:
        live.sent = key
        sender.send(performed(live.humanoid, actor.pose))


def _humanoid(state: AppState, live: Live) -> Actor | None:
    """Return the first humanoid of the scene; without one, show a message once."""
    known = live.humanoid
    for actor in state.scene.actors:
        if known is not None and actor.figure is known.figure:
            return actor
    for actor in state.scene.actors:
        if is_humanoid(actor.figure):
            live.humanoid = t_pose(actor.figure)
            return actor
    live.humanoid = None
    if live.lacks_humanoid is not state.scene:
        live.lacks_humanoid = state.scene
        state.say(
            "VMC: expected a figure with the bones of a humanoid, found none; open one, such as "
            "a VRM character"
        )
    return None


def _fits(own: Pose | None, pose: Pose) -> bool:
    """Return whether a pose has as many numbers as an actor's own."""
    if own is None:
        return False
    return (own.dofs.shape, own.rotations.shape) == (pose.dofs.shape, pose.rotations.shape)


_Answer = tuple[dict[str, Any], Actor | None]
_NOTHING: _Answer = ({}, None)


def _scene_of(request: Request) -> Scene:
    """Return the scene that a program wants to show."""
    up, time = request.message.facts.get("up"), request.message.facts.get("time")
    if up not in ("y", "z"):
        raise MessageError('scene: expected an up axis "y" or "z"')
    if not isinstance(request.content, tuple) or not request.content:
        raise MessageError("scene: expected actors, found none")
    seconds = None if time is None else request.message.number("time")
    return Scene(list(request.content), world_up=up, time=seconds)


class FirstScene(NamedTuple):
    """What a window shows when it opens."""

    scene: Scene
    camera: Camera | None
    options: DisplayOptions | None


def answer_first_scene(server: Server, request: Request) -> FirstScene | None:
    """Return the scene of a program before there is a window; refuse anything else."""
    try:
        if request.message.do != "scene":
            raise MessageError(f"{request.message.do}: expected a scene first")
        scene, message = _scene_of(request), request.message
        found = {
            name: None if name not in message.facts else unpack(message.facts[name], message.arrays)
            for name in ("camera", "options")
        }
        camera, options = found["camera"], found["options"]
        if not isinstance(camera, Camera | None) or not isinstance(options, DisplayOptions | None):
            raise MessageError("scene: expected a camera and display options")
    except Exception as problem:  # as in ``advance_live``
        request.refuse(told_of(problem))
        return None
    request.answer(_numbers_of(server, scene))
    return FirstScene(scene, camera, options)


def _numbers_of(server: Server, scene: Scene) -> dict[str, Any]:
    server.follow(scene.actors)
    return {"numbers": [server.number_of(actor) for actor in scene.actors]}


def _show_scene(state: AppState, server: Server, request: Request) -> _Answer:
    scene = _scene_of(request)
    state.show_scene(scene, ())
    stop_following(state)
    return _numbers_of(server, scene), None


def _put(state: AppState, server: Server, request: Request) -> _Answer:
    """Add an actor, or replace one."""
    actor, number = request.content, request.message.facts.get("actor")
    if not isinstance(actor, Actor):
        raise MessageError("put: expected an actor, found none")
    if number is None:
        state.scene.actors.append(actor)
        state.of(SavedWork).add_actors([actor])
        state.clock.pose(state.actor, again=True)
        state.history.add_actors(state.update_version())
        state.history.follow(state.version, state.clock.time)
        state.framing.restart(state.framing.is_fitting)
    else:
        old = server.actors.get(request.message.index("actor"))
        if old is None:
            raise MessageError(f"no actor {number}")
        actors = [actor if each is old else each for each in state.scene.actors]
        _exchange(state, actors)
    server.follow(state.scene.actors)
    return {"number": server.number_of(actor)}, None


def _remove(state: AppState, server: Server, request: Request) -> _Answer:
    old = _actor(server, request.message)
    actors = [actor for actor in state.scene.actors if actor is not old]
    if not actors:
        raise MessageError("remove: expected another actor: a window shows at least one")
    _exchange(state, actors)
    return _NOTHING


def _exchange(state: AppState, actors: Sequence[Actor]) -> None:
    """Show other actors in the same place, at the same time."""
    camera, fits, time, plays = (
        state.camera.copy(),
        state.framing.is_fitting,
        state.clock.time,
        state.clock.playing,
    )
    state.show_scene(replace(state.scene, actors=[*actors]), state.paths)
    stop_following(state)
    state.clock.seek(time)
    state.clock.playing = plays and state.clock.has_motion
    if not fits:
        state.camera, state.framing.is_fitting = camera, False


def _actor(server: Server, message: Message) -> Actor:
    found = server.actors.get(message.index("actor"))
    if found is None:
        raise MessageError(f"no actor {message.index('actor')}")
    return found


def _set_look(state: AppState, server: Server, request: Request) -> _Answer:
    """Set visibility, colour, opacity and placement."""
    message = request.message
    actor, color = _actor(server, message), None
    placement = message.array(0, (4, 4))
    if message.facts.get("color") is not None:
        red, green, blue = (min(max(each, 0.0), 1.0) for each in message.numbers("color", 3))
        color = red, green, blue
    actor.opacity = min(max(message.number("opacity"), 0.0), 1.0)
    actor.visible, actor.color = message.facts.get("visible") is True, color
    actor.placement = placement
    state.history.follow(state.update_version(), state.clock.time)
    return _NOTHING


def _set_time(state: AppState, server: Server, request: Request) -> _Answer:
    state.clock.seek(request.message.number("time"))
    state.clock.pose(state.actor)
    state.history.follow(state.update_version(), state.clock.time)
    return _NOTHING


def _set_camera(state: AppState, server: Server, request: Request) -> _Answer:
    facts = {name: value for name, value in request.message.facts.items() if name != "target"}
    unknown = [*facts.keys() - _CAMERA.keys()]
    if unknown:
        raise MessageError(f"camera: expected {', '.join([*_CAMERA, 'target'])}")
    message, camera = request.message, state.camera.copy()
    for name in facts:
        value, (low, high) = message.number(name), _CAMERA[name]
        if not low <= value <= high:
            raise MessageError(f"{name}: expected {low:g} to {high:g}, found {value:g}")
        setattr(camera, name, value)
    if "target" in message.facts:
        camera.target = np.array(message.numbers("target", 3))
    camera.fixed = None
    state.camera, state.framing.is_fitting = camera, False
    state.limit_camera()
    return _NOTHING


def _get(state: AppState, server: Server, request: Request) -> _Answer:
    counts = server.counts
    return {
        "actors": [[number, actor.name] for number, actor in server.actors.items()],
        "time": state.clock.time,
        "camera": _camera_facts(state.camera),
        "selection": _selection(state),
        "counts": {
            "clients": counts.clients,
            "messages": counts.messages,
            "refused": counts.refused,
        },
    }, None


def _camera_facts(camera: Camera) -> dict[str, Any]:
    facts: dict[str, Any] = {name: float(getattr(camera, name)) for name in _CAMERA}
    return {**facts, "target": camera.target.tolist()}


def _selection(state: AppState) -> list[str]:
    skeleton, joint = state.actor.figure.skeleton, state.selected_joint
    bones = [] if skeleton is None or joint < 0 else [skeleton.names[joint]]
    return [state.actor.name, *bones]


def _fetch(state: AppState, server: Server, request: Request) -> _Answer:
    return {}, _actor(server, request.message).copy()


def _close(state: AppState, server: Server, request: Request) -> _Answer:
    """Close the window; the program that has opened it knows what it shows."""
    state.of(Closing).is_over = True
    return _NOTHING


_ACTIONS: dict[str, Callable[[AppState, Server, Request], _Answer]] = {
    "scene": _show_scene,
    "put": _put,
    "remove": _remove,
    "look": _set_look,
    "time": _set_time,
    "camera": _set_camera,
    "get": _get,
    "fetch": _fetch,
    "close": _close,
}
