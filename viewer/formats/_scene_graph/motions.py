"""Conversion of a file's animations to animations of its figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from collections.abc import Set as AbstractSet
from functools import partial
from typing import TypeAlias

from viewer.errors import FormatError
from viewer.formats._scene_graph.content import NodeAnimation, NodeChannel
from viewer.rigs.arrays import Ints
from viewer.rigs.motion.transform_clip import Animation, TransformChannel, TransformClip

Reader: TypeAlias = Callable[[], tuple[NodeChannel, ...]]
"""Returns the channels of an animation."""


def read_once(animations: tuple[NodeAnimation, ...]) -> list[Reader]:
    """Return a function per animation that returns its channels, which are read only once."""
    return [_once(animation.read) for animation in animations]


def _once(read: Reader) -> Reader:
    kept: list[tuple[NodeChannel, ...]] = []
    problems: list[FormatError] = []

    def channels() -> tuple[NodeChannel, ...]:
        if problems:
            raise problems[0]
        if not kept:
            try:
                kept.append(read())
            except FormatError as problem:
                problems.append(problem)
                raise
        return kept[0]

    return channels


def animations_of(
    animations: tuple[NodeAnimation, ...],
    readers: list[Reader],
    joints: Mapping[int, int],
    columns: Mapping[int, Ints],
    beside: AbstractSet[int] = frozenset(),
) -> tuple[Animation, ...]:
    """Return the animations that move a joint, a blend shape, or a camera node in ``beside``."""

    def clip(number: int) -> TransformClip:
        channels: dict[tuple[str, object], TransformChannel] = {}
        for at, channel in enumerate(readers[number]()):
            is_shape = channel.path == "weights"
            if channel.node not in (columns if is_shape else joints):
                continue
            shapes = columns[channel.node] if is_shape else None
            # Nodes that share blend shapes have equal keys, so one channel is enough.
            key = channel.path, at if shapes is None else shapes.tobytes()
            channels.setdefault(
                key,
                TransformChannel(
                    -1 if is_shape else joints[channel.node],
                    channel.path,
                    channel.times,
                    channel.values,
                    channel.interpolation,
                    channel.tangents,
                    shapes,
                    channel.key_times,
                ),
            )
        each = animations[number]
        played = tuple(channels.values())
        return TransformClip(
            each.name, played, each.start, each.end, each.extras, number, each.rate
        )

    return tuple(
        Animation(each.name, each.start, each.end, partial(clip, number), each.pointer, number)
        for number, each in enumerate(animations)
        if any(node in joints or node in columns or node in beside for node in each.nodes)
    )
