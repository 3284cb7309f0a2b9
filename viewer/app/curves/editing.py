"""Edits of the chosen actor's clip in the Curves panel; each replaces the clip by a new one."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial

import numpy as np

from viewer.app.core.state import AppState
from viewer.app.curves.data import channel_of, keyed_values
from viewer.app.curves.state import Curves, KeyPlace
from viewer.rig.motion.clip import Channel, Clip, Extrapolation, Tangent
from viewer.rig.motion.clip_edit import (
    add_key,
    delete_keys,
    move_keys,
    set_extrapolation,
    set_key,
    set_range,
    set_tangent,
    with_channel,
)

__all__ = [
    "add_key_at",
    "change_tangent",
    "clip_of",
    "delete_chosen",
    "drop_missing",
    "extrapolate",
    "focused_rows",
    "move_chosen",
    "nearest_row",
    "place_key",
    "set_clip_range",
]

_GAP = 1e-3  # smallest distance of keys when dragging, seconds


def clip_of(state: AppState) -> Clip | None:
    """Return the chosen actor's clip if it has keys to edit."""
    clip = state.actor.clip
    return clip if isinstance(clip, Clip) else None


def _change(state: AppState, rows: Iterable[int], change: Callable[[Channel], Channel]) -> None:
    clip = clip_of(state)
    if clip is None:
        return
    for row in rows:
        clip = with_channel(clip, row, change)
    state.actor.clip = clip


def drop_missing(view: Curves, clip: Clip) -> None:
    """Deselect keys that no longer exist because they were undone or deleted."""
    counts = {channel.target: len(channel.times) for channel in clip.channels}
    view.keys = frozenset(place for place in view.keys if place[1] < counts.get(place[0], 0))


def focused_rows(view: Curves) -> tuple[int, ...]:
    """Return the curves with selected keys, otherwise all shown curves."""
    return tuple(sorted({row for row, _ in view.keys})) or view.rows


def move_chosen(state: AppState, dt: float, dv: float) -> None:
    """Move the selected keys of all curves; they stop at unselected keys."""
    keys: dict[int, list[int]] = {}
    for row, key in state.of(Curves).keys:
        keys.setdefault(row, []).append(key)
    for row, chosen in keys.items():
        _change(state, [row], partial(move_keys, keys=chosen, dt=dt, dv=dv, gap=_GAP))


def place_key(
    state: AppState, place: KeyPlace, time: float | None = None, value: float | None = None
) -> None:
    """Set the time or value of one key."""
    row, key = place
    _change(state, [row], lambda old: set_key(old, key, time, value))


def add_key_at(state: AppState, rows: Iterable[int], time: float) -> None:
    """Add keys on curves and select them."""
    clip, places = clip_of(state), set[KeyPlace]()
    if clip is None:
        return
    for row in rows:
        old = channel_of(clip, row) or Channel(row, np.zeros(0), np.zeros(0), ())
        new, key = add_key(old, time)
        clip = with_channel(clip, row, partial(_instead, new))
        places.add((row, key))
    state.actor.clip, state.of(Curves).keys = clip, frozenset(places)


def _instead(new: Channel, _: Channel) -> Channel:
    return new


def nearest_row(clip: Clip, view: Curves, time: float, value: float, factors: list[float]) -> int:
    """Return the shown curve nearest to a value at a time, -1 if none is shown."""
    if not view.rows:
        return -1
    values = keyed_values(clip, view.rows, np.array([time]))[0] * factors
    return view.rows[int(np.abs(values - value).argmin())]


def delete_chosen(state: AppState) -> None:
    """Delete the selected keys."""
    curves = state.of(Curves)
    for row in {row for row, _ in curves.keys}:
        keys = [key for place, key in curves.keys if place == row]
        _change(state, [row], partial(delete_keys, keys=keys))
    curves.keys = frozenset()


def change_tangent(state: AppState, places: Iterable[KeyPlace], side: int, to: Tangent) -> None:
    """Set the tangent on one side of keys: 0 incoming, 1 outgoing."""
    for row, key in places:
        _change(state, [row], partial(set_tangent, key=key, side=side, tangent=to))


def extrapolate(state: AppState, side: int, mode: Extrapolation) -> None:
    """Set the extrapolation of the curves in focus before (0) or after (1) their keys."""
    _change(state, focused_rows(state.of(Curves)), lambda old: set_extrapolation(old, side, mode))


def set_clip_range(state: AppState, start: float, end: float) -> None:
    """Set the clip's own time range, seconds."""
    clip = clip_of(state)
    if clip is not None:
        state.actor.clip = set_range(clip, start, end)
