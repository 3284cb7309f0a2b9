"""Edits of the chosen actor's clip in the Curves panel; each replaces the clip by a new one."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

import numpy as np

from viewer.app.core.state import AppState
from viewer.app.curves.dof_keys import DofKeys
from viewer.app.curves.keyed import KeyedMotion, keyed_of
from viewer.app.curves.state import Curves, KeyPlace
from viewer.app.curves.transform_keys import TransformKeys
from viewer.rig.motion.clip import Extrapolation, Tangent
from viewer.rig.motion.clip_edit import set_extrapolation, with_channel
from viewer.rig.motion.transform_clip import Interpolation

__all__ = [
    "add_key_at",
    "change_slope",
    "change_tangent",
    "delete_chosen",
    "drop_missing",
    "extrapolate",
    "focused_rows",
    "interpolate",
    "move_chosen",
    "nearest_row",
    "place_key",
    "set_clip_range",
]

_GAP = 1e-3  # minimum distance between dragged keys, seconds


def drop_missing(view: Curves, keyed: KeyedMotion, n_rows: int) -> None:
    """Deselect keys that no longer exist because they were undone or deleted."""
    found = set()
    for row, key in view.keys:
        keys = keyed.keys(row) if row < n_rows else None
        if keys is not None and key < len(keys[0]):
            found.add((row, key))
    if len(found) < len(view.keys):
        view.keys = frozenset(found)


def focused_rows(view: Curves) -> tuple[int, ...]:
    """Return the curves with selected keys, otherwise all shown curves."""
    return tuple(sorted({row for row, _ in view.keys})) or view.rows


def move_chosen(state: AppState, dt: float, dv: float) -> None:
    """Move the selected keys of all curves; they stop at unselected keys."""
    keyed = keyed_of(state.actor)
    if keyed is not None:
        state.actor.clip = keyed.moved(state.of(Curves).keys, dt, dv, _GAP)


def place_key(
    state: AppState, place: KeyPlace, time: float | None = None, value: float | None = None
) -> None:
    """Set the time or value of one key."""
    keyed = keyed_of(state.actor)
    if keyed is not None:
        state.actor.clip = keyed.placed(place, time, value, _GAP)


def add_key_at(state: AppState, rows: Iterable[int], time: float) -> None:
    """Add keys on curves and select them."""
    keyed, rows = keyed_of(state.actor), tuple(rows)
    if keyed is None:
        return
    state.actor.clip = keyed.added(rows, time, state.actor)
    changed = keyed_of(state.actor)
    places = set()
    for row in rows:
        keys = None if changed is None else changed.keys(row)
        if keys is not None:
            places.add((row, int(np.abs(keys[0] - time).argmin())))
    state.of(Curves).keys = frozenset(places)


def nearest_row(
    keyed: KeyedMotion, view: Curves, time: float, value: float, factors: list[float]
) -> int:
    """Return the shown curve nearest to a value at a time, -1 if none is shown."""
    if not view.rows:
        return -1
    values = keyed.values(view.rows, np.array([time]))[0] * factors
    return view.rows[int(np.abs(values - value).argmin())]


def delete_chosen(state: AppState) -> None:
    """Delete the selected keys."""
    curves, keyed = state.of(Curves), keyed_of(state.actor)
    # Without selected keys, an equal clip would be an undo step that changes nothing.
    if keyed is not None and curves.keys:
        state.actor.clip = keyed.deleted(curves.keys)
    curves.keys = frozenset()


def change_slope(state: AppState, places: Iterable[KeyPlace], side: int, to: float) -> None:
    """Set the slope on one side of keys: 0 incoming, 1 outgoing."""
    keyed = keyed_of(state.actor)
    if keyed is not None:
        state.actor.clip = keyed.sloped(places, side, to)


def change_tangent(state: AppState, places: Iterable[KeyPlace], side: int, to: Tangent) -> None:
    """Set the tangent rule or slope on one side of the keys of DOFs."""
    keyed = keyed_of(state.actor)
    if isinstance(keyed, DofKeys):
        state.actor.clip = keyed.with_tangent(places, side, to)


def extrapolate(state: AppState, side: int, mode: Extrapolation) -> None:
    """Set the extrapolation of the curves in focus before (0) or after (1) their keys."""
    keyed = keyed_of(state.actor)
    if isinstance(keyed, DofKeys):
        clip = keyed.clip
        for row in focused_rows(state.of(Curves)):
            clip = with_channel(clip, row, partial(set_extrapolation, side=side, mode=mode))
        state.actor.clip = clip


def interpolate(state: AppState, mode: Interpolation) -> None:
    """Set the interpolation of the channels of the curves in focus."""
    keyed = keyed_of(state.actor)
    if isinstance(keyed, TransformKeys):
        state.actor.clip = keyed.interpolated(focused_rows(state.of(Curves)), mode)


def set_clip_range(state: AppState, start: float, end: float) -> None:
    """Set the clip's own time range, seconds."""
    keyed = keyed_of(state.actor)
    if keyed is not None:
        state.actor.clip = keyed.ranged(start, end)
