"""Animations of a glTF document: names, ranges and nodes. Keys are read on first playback."""

from __future__ import annotations

import math
from dataclasses import field, replace
from functools import partial
from operator import le
from typing import Any

from viewer.data_classes import dataclass
from viewer.errors import FormatError
from viewer.formats._gltf.channels import read_channels, sampler_of
from viewer.formats._gltf.document import Document
from viewer.formats._gltf.elements import Element, Table
from viewer.formats._gltf.keys import read_times
from viewer.formats._gltf.target_paths import Targets
from viewer.formats._nodes.content import NodeAnimation, NodeChannel

__all__ = ["read_animations"]

_SAME_TIME = 1e-4  # rounding error of times in JSON, seconds


@dataclass(slots=True)
class _Unused:
    """Channels without visible effect."""

    n: int = 0
    names: dict[str, None] = field(default_factory=dict)
    pointer: str = ""


def read_animations(document: Document, targets: Targets) -> tuple[NodeAnimation, ...]:
    """Return the animations that are valid, except for keys that are read later.

    An invalid animation is omitted with a warning. The keys of the first one are read, because it
    is played by default; if errors are only recorded, all keys are read.
    """
    table = document.table("animations")
    unused = _Unused()
    found: list[NodeAnimation] = []
    for index in range(len(table)):
        try:
            animation = _animation(document, targets, table[index], unused)
            reads = not found or document.source.diagnostics.keeps_errors
            found.append(_checked(animation) if reads else animation)
        except FormatError as problem:
            _leave_out(document, problem, index)
    if unused.n:
        names = list(unused.names)
        document.source.warn("F007.gltf-channels", unused.pointer, n=unused.n, names=names)
    return tuple(found)


def _leave_out(document: Document, problem: FormatError, index: int) -> None:
    if document.source.diagnostics.keeps_errors:
        document.source.diagnostics.add(problem.diagnostic)
        return
    pointer = problem.diagnostic.pointer or f"/animations/{index}"
    document.source.warn("G005.animation", pointer, problem=problem.diagnostic.message)


def _checked(animation: NodeAnimation) -> NodeAnimation:
    channels = animation.read()
    return replace(animation, read=lambda: channels)


def _animation(
    document: Document, targets: Targets, animation: Element, unused: _Unused
) -> NodeAnimation:
    """Return an animation whose keys have not been read yet."""
    channels, samplers = animation.table("channels"), animation.table("samplers")
    plain = _plain_channels(channels.items, samplers.items, targets)
    nodes, inputs = plain or _any_channels(document, targets, animation, unused)
    start, end = _range(document, animation, inputs)
    read = partial(_channels, document, targets, animation, (start, end))
    name, pointer = animation.text("name"), animation.pointer
    extras = animation.values.get("extras")
    return NodeAnimation(name, start, end, frozenset(nodes), read, pointer, extras)


def _channels(
    document: Document, targets: Targets, animation: Element, declared: tuple[float, float]
) -> tuple[NodeChannel, ...]:
    """Return the channels of an animation; warn if the declared range is wrong."""
    channels = read_channels(document, targets, animation)
    start, end = declared
    first = min((float(channel.times[0]) for channel in channels), default=start)
    last = max((float(channel.times[-1]) for channel in channels), default=end)
    if max(abs(first - start), abs(last - end)) > _SAME_TIME:
        animation.warn("G005.range", "samplers", start=start, end=end, first=first, last=last)
    return channels


def _plain_channels(
    channels: list[Any], samplers: list[Any], targets: Targets
) -> tuple[set[int], set[int]] | None:
    """Return the nodes and the time accessors of channels; None if any is invalid or unusual.

    Files may have tens of thousands of channels, nearly all in the form that is handled here.
    This function takes less time than parsing the JSON.
    """
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
        sampler = samplers[sampler_of(channels[index], samplers)]
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
    """Return the least minimum and the largest maximum that accessors declare.

    None if any is invalid. Each of thousands of channels may have its own accessor, so the check of
    valid ones is short.
    """
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
    times = read_times(document, sampler)
    return float(times[0]), float(times[-1])
