"""Channels of an animation, read when the animation is first played."""

from __future__ import annotations

from dataclasses import field

import numpy as np

from viewer.data_classes import dataclass
from viewer.formats._gltf.document import Document
from viewer.formats._gltf.elements import Element, Table
from viewer.formats._gltf.keys import Keys, read_keys, read_times
from viewer.formats._gltf.target_paths import Moved, Targets
from viewer.formats._nodes.content import NodeChannel
from viewer.rig.arrays import Floats

__all__ = ["read_channels", "sampler_of"]


@dataclass(slots=True)
class _Reading:
    """Keys of an animation read so far; channels may share them."""

    document: Document
    targets: Targets
    samplers: Table
    times: dict[int, Floats] = field(default_factory=dict)
    keys: dict[tuple[int, str, int], Keys] = field(default_factory=dict)
    n_equal: int = 0
    """Number of keys dropped because the next key has the same time."""


def read_channels(
    document: Document, targets: Targets, animation: Element
) -> tuple[NodeChannel, ...]:
    """Return the channels of an animation that have a visible effect.

    Raises
    ------
    FormatError
        If a channel or its keys are invalid.
    """
    channels = animation.table("channels")
    reading = _Reading(document, targets, animation.table("samplers"))
    found: dict[tuple[int, str], NodeChannel] = {}
    for index in range(len(channels)):
        channel = channels[index]
        moved = targets.of(channel)
        for node in moved.nodes:
            if (node, moved.path) in found:
                channel.warn("G005.channel-twice", "target", node=node, path=moved.path)
            else:
                found[node, moved.path] = _channel(reading, channel, moved, node)
    if reading.n_equal:
        animation.warn("G005.equal-times", "samplers", n=reading.n_equal)
    return tuple(found.values())


def sampler_of(channel: Element, samplers: Table) -> int:
    """Return the index of a channel's sampler.

    Raises
    ------
    FormatError
        If the channel has no sampler.
    """
    return channel.required_index("sampler", len(samplers), "samplers")


def _channel(reading: _Reading, channel: Element, moved: Moved, node: int) -> NodeChannel:
    index = sampler_of(channel, reading.samplers)
    path, n_shapes = moved.transform_path, 0
    if path == "weights":
        n_shapes = reading.targets.n_shapes(node)
    keys = reading.keys.get((index, path, n_shapes))
    if keys is None:
        sampler = reading.samplers[index]
        times = _times(reading, sampler)
        keys = read_keys(reading.document, sampler, times, path, n_shapes)
        reading.keys[index, path, n_shapes] = keys
    return NodeChannel(node, path, keys.times, keys.values, keys.interpolation, keys.tangents)


def _times(reading: _Reading, sampler: Element) -> Floats:
    accessor = sampler.index("input", len(reading.document.accessors), "accessors")
    if accessor not in reading.times:
        times = read_times(reading.document, sampler)
        reading.times[accessor] = times
        reading.n_equal += int(np.count_nonzero(times[1:] == times[:-1]))
    return reading.times[accessor]
