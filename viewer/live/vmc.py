"""VMC protocol: the motion of humanoids between programs, as OSC messages over UDP.

::

    /VMC/Ext/OK         int loaded ...                       whether a character is loaded
    /VMC/Ext/T          float seconds
    /VMC/Ext/Root/Pos   name, position (3), quaternion (4) ...
    /VMC/Ext/Bone/Pos   name, position (3), quaternion (4)   relative to the parent bone
    /VMC/Ext/Blend/Val  name, weight
    /VMC/Ext/Blend/Apply                                     the weights since the last one

(protocol.vmc.info/english, "Marionette".) Positions are in metres, in Unity's axes: x right, y up,
z ahead, left-handed; bones have the names of Unity's humanoids. Both VRM 0.x and 1.0 characters
face +z there, so one change of axes serves both: ours are those of VRM 1.0, right-handed with the
figure's left side at +x, hence F = diag(-1, 1, 1).

A rotation is relative to the T-pose, in which all bones have the axes of the character. With
F R F for the rotations R, D_b = F R_root F ... F R_b F down to a bone b is its rotation from the
T-pose. If B turns the figure's axes to those of VRM and T_b is the joint's rotation in the T-pose,
its rotation in the figure is::

    W_b = B^T D_b B T_b                                      and back, D_b = B W_b (B T_b)^T
"""

from __future__ import annotations

import math
import socket
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import OutputError, RigError, ViewerError, reason_of
from viewer.exporters.vrm.canonical_pose import in_t_pose, standing, unit_rotation, vrm_axes
from viewer.exporters.vrm.humanoid import human_bones
from viewer.formats._vrm.bones import modern_bone
from viewer.live.osc import LARGEST, OscError, bundles, message_bytes, messages_of
from viewer.phrases import printable
from viewer.rigs.arrays import Floats
from viewer.rigs.expressions import OLD_PRESETS
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.geometry.rotation import matrix_to_quaternion, quaternion_to_matrix
from viewer.rigs.humanoid import HUMAN_BONES, SPINE_BONES, ancestors_of, parent_bone
from viewer.rigs.kinematics import posed_skeleton, world_matrices
from viewer.rigs.pose import Pose, joint_rotations, placement_matrix, set_joint_rotations
from viewer.rigs.retargeting.retarget import expression_columns
from viewer.rigs.shape import shaped_skeleton
from viewer.rigs.units import METRES

PORT = 39539
"""Usual port of programs that receive."""

_FLIP_PLACE = np.array([-1.0, 1.0, 1.0])
_FLIP_TURN = np.array([1.0, -1.0, -1.0, 1.0])  # F R F of a quaternion (x, y, z, w)
_MOST_EXPRESSIONS = 500
_AGAIN = 0.25  # seconds after which an unchanged pose is sent again
_MOST = 1e9  # largest coordinate in metres, and largest weight
_SHORTEST = 1e-3  # metres; shorter legs of a performer do not scale its path
_UNIT = 0.01  # error of the length of a unit quaternion, beyond that of single precision


_OLD_BONES = {
    bone.replace("ThumbMetacarpal", "ThumbIntermediate") for bone in (*HUMAN_BONES, *SPINE_BONES)
}
UNITY = {bone[:1].upper() + bone[1:]: modern_bone(bone) for bone in _OLD_BONES}
"""Bones of VRM 1.0 by their names in Unity, which has the bones of VRM 0.x."""
_UNITY_NAMES = {bone: name for name, bone in UNITY.items()}
_OLD_PRESETS = {new: old for old, new in OLD_PRESETS.items()}


class Place(NamedTuple):
    """Position (3,) in metres and rotation (3, 3) of a bone relative to its parent, VRM's axes."""

    position: Floats
    rotation: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Performance:
    """What a performer has sent: the latest place of each bone, and weights of expressions."""

    root: Place = Place(np.zeros(3), np.eye(3))
    bones: Mapping[str, Place] = field(default_factory=dict)
    expressions: Mapping[str, float] = field(default_factory=dict)
    is_loaded: bool = True
    """Whether the performer has a character."""


@dataclass(slots=True)
class Counts:
    """Packets of one direction."""

    packets: int = 0
    malformed: int = 0


def _no_address(option: str, host: str, port: int, problem: Exception) -> str:
    return f"{option} {printable(host, 60)}:{port}: {reason_of(problem)}"


class Receiver:
    """Receives packets in a thread, until ``close``; malformed ones are ignored and counted."""

    def __init__(self, host: str, port: int) -> None:
        self.counts = Counts()
        self.wake: Callable[[], None] = lambda: None
        self._pending: dict[str, float] = {}
        self._latest = self._shown = Performance()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except (OSError, TypeError) as problem:  # TypeError: a name that cannot be encoded
            self._socket.close()
            raise ViewerError(_no_address("--vmc-in", host, port, problem)) from None
        self.port = int(self._socket.getsockname()[1])
        self._socket.settimeout(_AGAIN)  # so that the thread notices the end
        self._is_over = False
        self._thread = threading.Thread(target=self._run, name="vmc in", daemon=True)
        self._thread.start()

    @property
    def has_news(self) -> bool:
        """Whether something has been received since ``take``."""
        return self._shown is not self._latest

    def take(self) -> Performance:
        """Return all that was received, once it is shown."""
        self._shown = self._latest
        return self._shown

    def close(self) -> None:
        """Stop receiving."""
        self._is_over = True
        self._thread.join()
        self._socket.close()

    def _run(self) -> None:
        while not self._is_over:
            try:
                data = self._socket.recv(LARGEST)
            except OSError:
                continue  # nothing has arrived
            self.receive(data)

    def receive(self, data: bytes) -> None:
        """Take over a packet, all of it or nothing."""
        self.counts.packets += 1
        try:
            performance = self._latest
            pending = dict(self._pending)
            for address, arguments in messages_of(data):
                performance = _after(performance, pending, address, arguments)
        except OscError:
            self.counts.malformed += 1
        else:
            self._latest, self._pending = performance, pending
        self.wake()


def _after(
    now: Performance, pending: dict[str, float], address: str, arguments: Sequence[Any]
) -> Performance:
    """Return a performance after a message; other messages of the protocol change nothing."""
    match address:
        case "/VMC/Ext/Bone/Pos":
            name, place = _place(arguments)
            if name not in UNITY:
                raise OscError(f"unknown bone {printable(name, 40)}")
            return replace(now, bones={**now.bones, UNITY[name]: place})
        case "/VMC/Ext/Root/Pos":
            return replace(now, root=_place(arguments)[1])
        case "/VMC/Ext/Blend/Val":
            if len(arguments) != 2 or not isinstance(arguments[0], str):
                raise OscError("expected a name and a weight")
            pending[arguments[0]] = _moderate(arguments[1:])[0]
            if len(pending) > _MOST_EXPRESSIONS:
                raise OscError(f"expected at most {_MOST_EXPRESSIONS} expressions")
        case "/VMC/Ext/Blend/Apply":
            # Another program may send the other expressions. The latest are last: they win over
            # the same one by another name, and stay if there are too many.
            kept = {name: now.expressions[name] for name in now.expressions if name not in pending}
            given = [*kept.items(), *pending.items()][-_MOST_EXPRESSIONS:]
            pending.clear()
            return replace(now, expressions=dict(given))
        case "/VMC/Ext/OK":
            is_loaded = bool(arguments) and arguments[0] == 1
            return now if is_loaded == now.is_loaded else replace(now, is_loaded=is_loaded)
        case "/VMC/Ext/T":
            _finite(arguments)
    return now


def _place(arguments: Sequence[Any]) -> tuple[str, Place]:
    """Return the name and the place of a bone, in VRM's axes; later versions add scales."""
    if len(arguments) < 8 or not isinstance(arguments[0], str):
        raise OscError("expected a name and seven numbers")
    numbers = np.array(_finite(arguments[1:8]))
    _moderate(arguments[1:4])
    turn = numbers[3:] * _FLIP_TURN
    length = float(np.linalg.norm(turn))
    if abs(length - 1.0) > _UNIT:
        raise OscError(f"expected a unit quaternion, found one of length {length:g}")
    return arguments[0], Place(numbers[:3] * _FLIP_PLACE, quaternion_to_matrix(turn / length))


def _finite(arguments: Sequence[Any]) -> list[float]:
    for each in arguments:
        if isinstance(each, bool) or not isinstance(each, int | float) or not math.isfinite(each):
            raise OscError(f"expected finite numbers, found {printable(repr(each), 40)}")
    return [float(each) for each in arguments]


def _moderate(arguments: Sequence[Any]) -> list[float]:
    """Return numbers with which the pose and the vertices stay finite."""
    numbers = _finite(arguments)
    for each in numbers:
        if abs(each) > _MOST:
            raise OscError(f"expected numbers up to {_MOST:g}, found {each:g}")
    return numbers


@dataclass(frozen=True, slots=True, eq=False)
class TPose:
    """A humanoid figure in the T-pose that the rotations of VMC refer to."""

    figure: Figure
    bones: Mapping[str, int]
    """Joint of each human bone."""
    axes: Floats
    """B (3, 3): from the figure's axes to those of VRM."""
    rotations: Mapping[str, Floats]
    """B T_b (3, 3) of each bone."""
    places: Mapping[str, Floats]
    """Positions of the bones in metres, in VRM's axes, above the ground: (3,)."""
    scale: float
    """Metres per unit of the figure."""
    hips: Floats
    """(3,). Position of the hips in the figure's rest pose, in its own axes and unit."""

    @property
    def leg(self) -> float:
        """Length of the left leg, metres."""
        return _length([self.places[f"left{bone}"] for bone in ("UpperLeg", "LowerLeg", "Foot")])


def _length(points: Sequence[Floats]) -> float:
    return float(sum(np.linalg.norm(b - a) for a, b in pairwise(points)))


def t_pose(figure: Figure) -> TPose:
    """Return a figure's T-pose; ``RigError`` if it is no humanoid with all required bones."""
    bones = human_bones(figure)
    rest = figure_pose(figure)
    still = standing(figure, rest, bones)
    if figure.require_skeleton().humanoid is None:
        # The rest pose of a VRM character is its T-pose, by the specification.
        still, _ = in_t_pose(still, bones)
    world = world_matrices(still.require_skeleton(), figure_pose(still))
    return TPose(
        figure,
        bones,
        vrm_axes(figure, rest, bones),
        {bone: unit_rotation(world[joint]) for bone, joint in bones.items()},
        {bone: world[joint, :3, 3] for bone, joint in bones.items()},
        METRES.get(figure.unit, 1.0),
        world_matrices(figure.require_skeleton(), rest)[bones["hips"], :3, 3],
    )


def perform(how: TPose, pose: Pose, given: Performance) -> Pose:
    """Return a pose with the bones and expressions of a performance; others stay."""
    figure, posed = how.figure, pose.copy()
    skeleton = shaped_skeleton(figure, pose.shape_weights)
    turned = {"": given.root.rotation}
    for bone in sorted(given.bones, key=lambda each: len(ancestors_of(each))):
        turned[bone] = turned[parent_bone(bone, given.bones)] @ given.bones[bone].rotation
    joints = {how.bones[bone]: bone for bone in turned if bone in how.bones}
    local = joint_rotations(skeleton, posed)
    worlds = local.copy()
    for joint, parent in enumerate(skeleton.parents.tolist()):
        above = np.eye(3) if parent < 0 else worlds[parent]
        if joint in joints:
            bone = joints[joint]
            worlds[joint] = how.axes.T @ turned[bone] @ how.rotations[bone]
            local[joint] = above.T @ worlds[joint]
        else:
            worlds[joint] = above @ local[joint]
    moved = np.array(sorted(joints), np.int32)
    if len(moved):
        set_joint_rotations(skeleton, posed, moved, local[moved], "quaternion")
    if "hips" in given.bones:
        _place_hips(how, posed, given)
    for name, column in expression_columns(given.expressions, figure).items():
        if column < len(posed.shape_weights):  # a program may send fewer
            posed.shape_weights[column] = given.expressions[name]
    return posed


def _place_hips(how: TPose, posed: Pose, given: Performance) -> None:
    """Move the figure so that its hips are where those of the performer are, for its own size."""
    root, hips = given.root, given.bones["hips"]
    # Longer legs make longer steps. Without the bones of the legs, sizes are taken as equal.
    steps = [given.bones.get(f"left{bone}") for bone in ("LowerLeg", "Foot")]
    theirs = sum(float(np.linalg.norm(each.position)) for each in steps if each is not None)
    ratio = how.leg / theirs if all(steps) and theirs > _SHORTEST else 1.0
    wanted = ratio * (root.position + root.rotation @ hips.position)
    offset = how.axes.T @ (wanted - how.places["hips"]) / how.scale
    skeleton = shaped_skeleton(how.figure, posed.shape_weights)
    now = posed_skeleton(skeleton, posed).world[how.bones["hips"], :3, 3]
    posed.figure_translation = how.hips + offset - posed.figure_scale * now


def performed(how: TPose, pose: Pose) -> Performance:
    """Return the bones and expressions of a pose."""
    skeleton = shaped_skeleton(how.figure, pose.shape_weights)
    world = posed_skeleton(skeleton, pose).world
    turned = {
        bone: how.axes @ unit_rotation(world[joint]) @ how.rotations[bone].T
        for bone, joint in how.bones.items()
    }
    bones = {}
    for bone, joint in how.bones.items():
        above = parent_bone(bone, how.bones)
        if above:
            # Bones keep their length: the position relative to the parent is that of the T-pose.
            bones[bone] = Place(
                how.places[bone] - how.places[above], turned[above].T @ turned[bone]
            )
        else:
            place = (placement_matrix(pose) @ world[joint])[:3, 3] - how.hips
            position = how.places[bone] + how.scale * how.axes @ place
            bones[bone] = Place(position, turned[bone])
    shapes = how.figure.blend_shapes
    rules = None if shapes is None else shapes.rules
    weights = {}
    if shapes is not None and rules is not None:
        for index, row in enumerate(rules.rows.tolist()):
            if row < len(pose.shape_weights):
                preset = rules.presets[index] if index < len(rules.presets) else ""
                value = float(np.clip(pose.shape_weights[row], 0.0, 1.0))
                weights[preset or shapes.names[row]] = value
    return Performance(bones=bones, expressions=weights)


def packets_of(given: Performance, seconds: float) -> Sequence[bytes]:
    """Return a performance as packets, at a time in seconds."""
    parts = [message_bytes("/VMC/Ext/OK", int(given.is_loaded))]
    parts.append(message_bytes("/VMC/Ext/T", float(seconds)))
    places = [("/VMC/Ext/Root/Pos", "root", given.root)]
    places += [
        ("/VMC/Ext/Bone/Pos", _UNITY_NAMES[bone], each) for bone, each in given.bones.items()
    ]
    for address, name, place in places:
        turn = matrix_to_quaternion(place.rotation) * _FLIP_TURN
        position = place.position * _FLIP_PLACE
        parts.append(message_bytes(address, name, *position.tolist(), *turn.tolist()))
    for name, weight in given.expressions.items():
        parts.append(message_bytes("/VMC/Ext/Blend/Val", _old_name(name), float(weight)))
    if given.expressions:
        parts.append(message_bytes("/VMC/Ext/Blend/Apply"))
    return bundles(parts)


def _old_name(name: str) -> str:
    """Return the name in VRM 0.x of an expression, as most programs know it, such as Blink_L."""
    old = _OLD_PRESETS.get(name)
    if old is None:
        return name
    return name[:1].upper() + name[1:] if old == name.lower() else old.title()


class Sender:
    """Sends the latest performance when it changes, and again while it does not."""

    def __init__(self, host: str, port: int) -> None:
        self.counts = Counts()
        self._latest: Performance | None = None
        self._is_over, self._is_new = False, threading.Event()
        self._started = time.monotonic()
        try:
            self._to = socket.getaddrinfo(host, port, socket.AF_INET, socket.SOCK_DGRAM)[0][4]
        except (OSError, UnicodeError) as problem:
            raise OutputError(_no_address("--vmc-out", host, port, problem)) from None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._thread = threading.Thread(target=self._run, name="vmc out", daemon=True)
        self._thread.start()

    def send(self, performance: Performance) -> None:
        """Send another performance."""
        self._latest = performance
        self._is_new.set()

    def close(self) -> None:
        """Stop sending."""
        self._is_over = True
        self._is_new.set()
        self._thread.join()
        self._socket.close()

    def _run(self) -> None:
        while not self._is_over:
            self._is_new.wait(_AGAIN)
            self._is_new.clear()
            if self._latest is None or self._is_over:
                continue
            for data in packets_of(self._latest, time.monotonic() - self._started):
                try:
                    self._socket.sendto(data, self._to)
                except OSError:  # nobody listens there, which may change
                    self.counts.malformed += 1
                else:
                    self.counts.packets += 1


def is_humanoid(figure: Figure) -> bool:
    """Return whether performers can move a figure."""
    try:
        return figure.skeleton is not None and bool(human_bones(figure))
    except RigError:
        return False
