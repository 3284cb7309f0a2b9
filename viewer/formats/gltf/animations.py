"""Animations of a glTF document: names, ranges and nodes; keys are read on first playback.

A channel moves a node by its index, or by a JSON pointer (``KHR_animation_pointer``): translation,
rotation, scale or weights of morph targets. Pointers to anything else are counted and reported.
"""

from __future__ import annotations

import math
import re
from dataclasses import field, replace
from functools import partial
from operator import le
from typing import Any, cast

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import wording
from viewer.errors import FormatError
from viewer.formats._scene_graph.content import NodeAnimation, NodeChannel, NodeMesh, NodeTree
from viewer.formats.gltf.document import Document
from viewer.formats.gltf.elements import Element, Table
from viewer.phrases import counted, listed, rounded
from viewer.rigs.arrays import Floats
from viewer.rigs.motion.transform_clip import TRANSFORM_PATHS, Interpolation, TransformPath

_SAME_TIME = 1e-4  # rounding error of times in JSON, seconds
_TINY = 1e-12  # minimum length of a quaternion with a direction

_INTERPOLATIONS: dict[str, Interpolation] = {
    "LINEAR": "linear",
    "STEP": "step",
    "CUBICSPLINE": "cubic",
}
_KINDS = {"translation": "VEC3", "rotation": "VEC4", "scale": "VEC3", "weights": "SCALAR"}
_WIDTHS = {"translation": 3, "rotation": 4, "scale": 3}

_NODE_POINTER = re.compile(r"/nodes/([0-9]{1,9})/(translation|rotation|scale|weights)")
_MESH_POINTER = re.compile(r"/meshes/([0-9]{1,9})/weights")
_INDEX = re.compile(r"/[0-9]+")
_OF_NODES = frozenset(TRANSFORM_PATHS) - {"weights"}


@dataclass(frozen=True, slots=True)
class _Moved:
    """Target of a channel."""

    path: str
    """Entry of ``TRANSFORM_PATHS``; for other targets, a name for messages."""
    nodes: tuple[int, ...]
    """Nodes that the channel animates; empty if it has no visible effect."""

    @property
    def transform_path(self) -> TransformPath:
        """Path of a channel that animates nodes."""
        return cast("TransformPath", self.path)


class Targets:
    """Nodes that channels can animate."""

    def __init__(self, tree: NodeTree, meshes: tuple[NodeMesh, ...]) -> None:
        self._tree, self._meshes = tree, meshes
        self._with_shapes = {
            node
            for node, mesh in enumerate(tree.meshes.tolist())
            if mesh >= 0 and meshes[mesh].target_names
        }

    def n_shapes(self, node: int) -> int:
        """Return the number of morph targets of a node's mesh."""
        mesh = int(self._tree.meshes[node])
        return len(self._meshes[mesh].target_names) if mesh >= 0 else 0

    def moves(self, node: object, path: object) -> bool:
        """Return whether a channel of this node and path, as in the file, has a visible effect."""
        if type(node) is not int or not 0 <= node < self._tree.n_nodes:
            return False
        return node in self._with_shapes if path == "weights" else path in TRANSFORM_PATHS

    def moves_all(self, ends: list[Any]) -> bool:
        """Return whether all of tens of thousands of targets, as in the file, have an effect."""
        # A target that is no object or lacks a member raises TypeError or KeyError.
        nodes, paths = {end["node"] for end in ends}, {end["path"] for end in ends}
        if set(map(type, nodes)) == {int} and paths.issubset(_OF_NODES):
            return min(nodes) >= 0 and max(nodes) < self._tree.n_nodes
        return all(self.moves(end["node"], end["path"]) for end in ends)

    def of(self, channel: Element) -> _Moved:
        """Return the target of a channel."""
        target = channel.part("target")
        if target is None:
            raise channel.wrong("target", "an object")
        path = target.text("path")
        if path == "pointer":
            return self._pointed(target)
        node = target.index("node", self._tree.n_nodes, "nodes")
        return _Moved(path, (node,) if self.moves(node, path) else ())

    def _pointed(self, target: Element) -> _Moved:
        """Return the target of a JSON pointer (KHR_animation_pointer)."""
        extension = target.extension("KHR_animation_pointer")
        pointer = "" if extension is None else extension.text("pointer")
        if match := _NODE_POINTER.fullmatch(pointer):
            node, path = int(match[1]), match[2]
            return _Moved(path, (node,) if self.moves(node, path) else ())
        if match := _MESH_POINTER.fullmatch(pointer):
            mesh = int(match[1])
            # Weights of a node override the weights of its mesh.
            users = (node for node in self._with_shapes if self._tree.meshes[node] == mesh)
            nodes = (node for node in users if node not in self._tree.shape_weights)
            return _Moved("weights", tuple(sorted(nodes)))
        return _Moved(_INDEX.sub("", pointer).removeprefix("/")[:60] or "pointer", ())


@dataclass(slots=True)
class _Unused:
    """Channels without visible effect."""

    n: int = 0
    names: dict[str, None] = field(default_factory=dict)
    pointer: str = ""


def read_animations(document: Document, targets: Targets) -> tuple[NodeAnimation, ...]:
    """Return the valid animations; only the keys of the first, which plays by default, are read."""
    table = document.table("animations")
    unused = _Unused()
    found: list[NodeAnimation] = []
    for index in range(len(table)):
        try:
            element = table[index]
            channels, samplers = element.table("channels"), element.table("samplers")
            plain = _plain_channels(channels.items, samplers.items, targets)
            nodes, inputs = plain or _any_channels(document, targets, element, unused)
            start, end = _range(document, element, inputs)
            animation = NodeAnimation(
                element.text("name"),
                start,
                end,
                frozenset(nodes),
                partial(_channels, document, targets, element, (start, end)),
                element.pointer,
                element.values.get("extras"),
            )
            reads = not found or document.source.diagnostics.keeps_errors
            found.append(_checked(animation) if reads else animation)
        except FormatError as problem:
            _leave_out(document, problem, index)
    if unused.n:
        names = list(unused.names)
        document.source.warn(
            "F007.gltf-channels: {n} no visible effect: {names}",
            unused.pointer,
            n=counted(unused.n, "animation channel", "has", "have"),
            names=listed(names),
        )
    return tuple(found)


def _leave_out(document: Document, problem: FormatError, index: int) -> None:
    if document.source.diagnostics.keeps_errors:
        document.source.diagnostics.add(problem.diagnostic)
        return
    pointer = problem.diagnostic.pointer or f"/animations/{index}"
    document.source.warn(
        "G005.animation: {problem}: animation omitted", pointer, problem=problem.diagnostic.message
    )


def _checked(animation: NodeAnimation) -> NodeAnimation:
    channels = animation.read()
    return replace(animation, read=lambda: channels)


def _plain_channels(
    channels: list[Any], samplers: list[Any], targets: Targets
) -> tuple[set[int], set[int]] | None:
    """Return the nodes and time accessors of channels; None if any is invalid or unusual."""
    try:
        ends = [item["target"] for item in channels]
        if not targets.moves_all(ends):
            return None
        used = {item["sampler"] for item in channels}
        if set(map(type, used)) - {int} or min(used, default=0) < 0:
            return None
        inputs = {samplers[index]["input"] for index in used}
    except (KeyError, TypeError, IndexError):
        return None
    return {end["node"] for end in ends}, inputs


def _any_channels(
    document: Document, targets: Targets, animation: Element, unused: _Unused
) -> tuple[set[int], set[int]]:
    """Return the nodes and the time accessors of channels of any form; raises FormatError."""
    channels, samplers = animation.table("channels"), animation.table("samplers")
    nodes: set[int] = set()
    inputs: set[int] = set()
    for index in range(len(channels)):
        moved = targets.of(channels[index])
        sampler = samplers[_sampler_of(channels[index], samplers)]
        if moved.nodes:
            nodes.update(moved.nodes)
            inputs.add(sampler.index("input", len(document.accessors), "accessors"))
        else:
            unused.n += 1
            unused.names.setdefault(moved.path)
            unused.pointer = unused.pointer or channels[index].pointer
    return nodes, inputs


def _range(document: Document, animation: Element, inputs: set[int]) -> tuple[float, float]:
    """Return the times of the first and the last key in seconds, as declared by the accessors."""
    if not inputs:
        return 0.0, 0.0
    accessors = document.table("accessors")
    declared = _declared(accessors, inputs)
    if declared is not None:
        return declared
    ends: list[tuple[float, float]] = []
    for index in inputs:
        if type(index) is not int or not 0 <= index < len(accessors):
            samplers = animation.table("samplers")
            for place in range(len(samplers)):
                samplers[place].required_index("input", len(document.accessors), "accessors")
        ends.append(_declared(accessors, {index}) or _read_range(document, animation, index))
    return min(first for first, _ in ends), max(last for _, last in ends)


def _declared(accessors: Table, inputs: set[int]) -> tuple[float, float] | None:
    """Return the least minimum and the largest maximum of accessors; None if any is invalid."""
    try:
        if min(inputs) < 0 or set(map(type, inputs)) != {int}:
            return None
        used = [accessors.items[index] for index in inputs]
        lows, highs = ([one[end][0] for one in used] for end in ("min", "max"))
        if not all(map(le, lows, highs)):
            return None
        low, high = min(lows), max(highs)
        return (float(low), float(high)) if -math.inf < low <= high < math.inf else None
    except (KeyError, TypeError, IndexError, OverflowError):
        return None


def _read_range(document: Document, animation: Element, index: int) -> tuple[float, float]:
    """Return the first and the last time, read from the data."""
    samplers = animation.table("samplers")
    users = (samplers[place] for place in range(len(samplers)))
    sampler = next(user for user in users if user.values.get("input") == index)
    times = _read_times(document, sampler)
    return float(times[0]), float(times[-1])


@dataclass(slots=True)
class _Reading:
    """Keys of an animation read so far; channels may share them."""

    document: Document
    targets: Targets
    samplers: Table
    times: dict[int, Floats] = field(default_factory=dict)
    keys: dict[tuple[int, str, int], _Keys] = field(default_factory=dict)
    n_equal: int = 0
    """Number of keys dropped because the next key has the same time."""


@dataclass(frozen=True, slots=True, eq=False)
class _Keys:
    """Keys as in ``NodeChannel``."""

    times: Floats
    values: Floats
    interpolation: Interpolation
    tangents: Floats | None


def _channels(
    document: Document, targets: Targets, animation: Element, declared: tuple[float, float]
) -> tuple[NodeChannel, ...]:
    """Return the channels with a visible effect; warn if the declared range is wrong."""
    channels = animation.table("channels")
    reading = _Reading(document, targets, animation.table("samplers"))
    found: dict[tuple[int, str], NodeChannel] = {}
    for index in range(len(channels)):
        channel = channels[index]
        moved = targets.of(channel)
        for node in moved.nodes:
            if (node, moved.path) in found:
                channel.warn(
                    "G005.channel-twice: ignored second channel for {path} of node {node}",
                    "target",
                    node=node,
                    path=moved.path,
                )
            else:
                found[node, moved.path] = _channel(reading, channel, moved, node)
    if reading.n_equal:
        animation.warn(
            "G005.equal-times: {n} the same time as the next key: ignored",
            "samplers",
            n=counted(reading.n_equal, "key", "has", "have"),
        )
    start, end = declared
    first = min((float(channel.times[0]) for channel in found.values()), default=start)
    last = max((float(channel.times[-1]) for channel in found.values()), default=end)
    if max(abs(first - start), abs(last - end)) > _SAME_TIME:
        animation.warn(
            "G005.range: expected keys from {start} to {end} s as declared by the accessors, "
            "found {first} to {last} s",
            "samplers",
            start=rounded(start, 6),
            end=rounded(end, 6),
            first=rounded(first, 6),
            last=rounded(last, 6),
        )
    return tuple(found.values())


def _sampler_of(channel: Element, samplers: Table) -> int:
    """Return the index of a channel's sampler, which it must have."""
    return channel.required_index("sampler", len(samplers), "samplers")


def _channel(reading: _Reading, channel: Element, moved: _Moved, node: int) -> NodeChannel:
    index = _sampler_of(channel, reading.samplers)
    path, n_shapes = moved.transform_path, 0
    if path == "weights":
        n_shapes = reading.targets.n_shapes(node)
    keys = reading.keys.get((index, path, n_shapes))
    if keys is None:
        sampler = reading.samplers[index]
        accessor = sampler.index("input", len(reading.document.accessors), "accessors")
        if accessor not in reading.times:
            times = _read_times(reading.document, sampler)
            reading.times[accessor] = times
            reading.n_equal += int(np.count_nonzero(times[1:] == times[:-1]))
        times = reading.times[accessor]
        keys = _read_keys(reading.document, sampler, times, path, n_shapes)
        reading.keys[index, path, n_shapes] = keys
    return NodeChannel(node, path, keys.times, keys.values, keys.interpolation, keys.tangents)


def _read_times(document: Document, sampler: Element) -> Floats:
    """Return the times of a sampler's keys: (N,) seconds, finite, in ascending order, N > 0."""
    accessor = sampler.required_index("input", len(document.accessors), "accessors")
    times = document.accessors.floats(accessor, ("SCALAR",), sampler.at("input"))[:, 0]
    if not len(times):
        raise sampler.fault(
            "F002.gltf-no-keys: expected at least one key time, found none", "input"
        )
    if not np.isfinite(times).all():
        key = int((~np.isfinite(times)).argmax())
        raise sampler.fault(wording.GLTF_KEYS, "input", index=key, found=float(times[key]))
    is_earlier = times[1:] < times[:-1]
    if is_earlier.any():
        key = int(is_earlier.argmax()) + 1
        found, before = float(times[key]), float(times[key - 1])
        raise sampler.fault(
            "F002.gltf-times: key {index}: expected ascending times, found {found} after {before}",
            "input",
            index=key,
            found=rounded(found, 6),
            before=rounded(before, 6),
        )
    return times


def _read_keys(
    document: Document, sampler: Element, times: Floats, path: TransformPath, n_shapes: int
) -> _Keys:
    """Return the keys at N times, with ``n_shapes`` weights each."""
    names = tuple(_INTERPOLATIONS)
    interpolation = _INTERPOLATIONS[sampler.choice("interpolation", names, "LINEAR")]
    accessor = sampler.required_index("output", len(document.accessors), "accessors")
    rows = document.accessors.floats(accessor, (_KINDS[path],), sampler.at("output"))
    width = _WIDTHS.get(path, n_shapes)
    per_key = 3 if interpolation == "cubic" else 1
    expected = len(times) * per_key * width
    if rows.size != expected:
        # The count is in elements of the accessor: vectors, or single weights.
        counts = {
            "expected": counted(expected // rows.shape[1], "element"),
            "found": len(rows),
            "keys": counted(len(times), "key"),
        }
        raise sampler.fault(
            "F002.gltf-outputs: expected {expected} for {keys}, found {found}", "output", **counts
        )
    keys = rows.reshape(len(times), per_key, width)
    bad = ~np.isfinite(keys)
    if bad.any():
        key, place, column = (int(axis[0]) for axis in np.nonzero(bad))
        found = float(keys[key, place, column])
        raise sampler.fault(wording.GLTF_KEYS, "output", index=key, found=found)
    if path == "rotation":
        is_whole = document.accessors[accessor].values.get("componentType") != 5126
        keys = _rotations(sampler, keys, is_whole)
    # Each key has an in-tangent, value and out-tangent; tangents are slopes per second (3.11.3.3).
    tangents = keys[:, (0, 2)] if per_key == 3 else None
    return _without_equal(_Keys(times, keys[:, per_key // 2], interpolation, tangents))


def _without_equal(keys: _Keys) -> _Keys:
    """Return the last of several keys at one time, because exporters repeat the final key."""
    is_last = keys.times[1:] > keys.times[:-1]
    if is_last.all():
        return keys
    is_kept = np.append(is_last, True)
    tangents = None if keys.tangents is None else keys.tangents[is_kept]
    return _Keys(keys.times[is_kept], keys.values[is_kept], keys.interpolation, tangents)


def _rotations(sampler: Element, keys: Floats, is_whole: bool) -> Floats:
    """Return quaternions of unit length; splines with floating-point keys are left unchanged."""
    middle = keys.shape[1] // 2
    lengths = np.linalg.norm(keys[:, middle], axis=1)
    if (lengths < _TINY).any():
        raise sampler.fault(
            "F002.gltf-rotation: key {index}: expected a rotation, found only zeros",
            "output",
            index=int((lengths < _TINY).argmax()),
        )
    return keys if middle and not is_whole else keys / lengths[:, None, None]
