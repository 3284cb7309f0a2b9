"""Conversion of a file's animations to animations of its figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from collections.abc import Set as AbstractSet
from typing import TypeAlias

from viewer.errors import FormatError
from viewer.formats._scene_graph.content import NodeAnimation, NodeChannel
from viewer.rig.arrays import Ints
from viewer.rig.motion.transform_clip import Animation, TransformChannel, TransformClip

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
    return tuple(
        Animation(
            animation.name,
            animation.start,
            animation.end,
            _clip(animation, read, number),
            animation.pointer,
            number,
        )
        for number, (animation, read) in enumerate(
            zip(animations, _bound(readers, joints, columns), strict=True)
        )
        if any(node in joints or node in columns or node in beside for node in animation.nodes)
    )


def _bound(
    readers: list[Reader], joints: Mapping[int, int], columns: Mapping[int, Ints]
) -> list[Callable[[], tuple[TransformChannel, ...]]]:
    """Return a function per animation that returns the channels of one figure."""

    def bound(read: Reader) -> Callable[[], tuple[TransformChannel, ...]]:
        def channels() -> tuple[TransformChannel, ...]:
            found: dict[tuple[str, object], TransformChannel] = {}
            for number, channel in enumerate(read()):
                moved = _channel(channel, joints, columns)
                if moved is not None:
                    # Nodes that share blend shapes have equal keys, so one channel is enough.
                    shapes = None if moved.shapes is None else moved.shapes.tobytes()
                    found.setdefault((moved.path, shapes or number), moved)
            return tuple(found.values())

        return channels

    return [bound(read) for read in readers]


def _clip(
    animation: NodeAnimation, channels: Callable[[], tuple[TransformChannel, ...]], number: int
) -> Callable[[], TransformClip]:
    start, end, extras = animation.start, animation.end, animation.extras
    return lambda: TransformClip(animation.name, channels(), start, end, extras, number)


def _channel(
    channel: NodeChannel, joints: Mapping[int, int], columns: Mapping[int, Ints]
) -> TransformChannel | None:
    """Return the channel of a joint or of blend shapes; None if it moves another figure."""
    is_shape = channel.path == "weights"
    if channel.node not in (columns if is_shape else joints):
        return None
    return TransformChannel(
        -1 if is_shape else joints[channel.node],
        channel.path,
        channel.times,
        channel.values,
        channel.interpolation,
        channel.tangents,
        columns[channel.node] if is_shape else None,
    )
