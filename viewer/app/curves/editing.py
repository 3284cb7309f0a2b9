"""Edits of the chosen actor's clip: new clips, keys, tangents and range.

Each edit replaces the clip by a new one, so that undo restores the old one. ``KeyedMotion`` is what
the Curves panel edits: keys of DOFs, or of transforms.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TypeAlias

import numpy as np

from viewer.app.core.state import AppState
from viewer.app.curves.data import Curve, channel_of, keyed_values
from viewer.app.files.files import ask_where_to_write
from viewer.app.files.saving import save_files
from viewer.data_classes import dataclass
from viewer.formats import FORMATS, file_stem, write
from viewer.rigs.arrays import Floats
from viewer.rigs.motion.clip import Channel, Clip, Extrapolation, Tangent, slopes
from viewer.rigs.motion.clip_edit import (
    add_key,
    clip_from_pose,
    delete_keys,
    key_pose,
    move_keys,
    set_extrapolation,
    set_key,
    set_range,
    set_tangent,
    with_channel,
)
from viewer.rigs.motion.transform_clip import Interpolation, TransformChannel, TransformClip
from viewer.rigs.number_text import number_text
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.transform_keys.edit import (
    add_transform_key,
    delete_transform_keys,
    joint_values,
    key_transform_pose,
    move_transform_keys,
    set_clip_interpolation,
    set_transform_key,
    set_transform_slope,
)
from viewer.rigs.transform_keys.euler_curves import TransformRow, key_values, row_values, rows_of

_GAP = 1e-3  # minimum distance between dragged keys, seconds
KeyPlace = tuple[int, int]
"""Row of a curve and index of one of its keys."""
_SECONDS = 2.0  # duration of a new clip


@dataclass(slots=True)
class Curves:
    """State of the Curves panel; the edited clip belongs to the actor."""

    rows: tuple[int, ...] = ()
    """Selected curves as rows of ``curves_of``, in the order of selection."""
    keys: frozenset[KeyPlace] = frozenset()
    """Selected keys: (row, key)."""
    filter: str = ""
    """Text that the names of listed curves must contain."""
    wants_fit: bool = True
    """Whether the axes are fitted in the next frame."""
    wants_scroll: bool = False
    """Whether the list scrolls to the first selected curve in the next frame."""
    owner: tuple[int, str, int] = (-1, "", 0)
    """Key of the actor, motion and number of curves for which ``rows`` are valid."""
    joint: int = -1
    """Joint whose curves were last selected."""

    def choose(self, rows: tuple[int, ...]) -> None:
        """Select curves, and fit the axes to them."""
        self.rows, self.keys, self.wants_fit = rows, frozenset(), True


@dataclass(frozen=True, slots=True, eq=False)
class DofKeys:
    """A clip of DOFs, whose rows are those of the DOF table."""

    clip: Clip
    skeleton: Skeleton

    def keys(self, row: int) -> tuple[Floats, Floats] | None:
        """Return the times and values of a curve's keys, (N,) each; None without keys."""
        channel = channel_of(self.clip, row)
        return None if channel is None else (channel.times, channel.values)

    def slopes(self, row: int) -> Floats | None:
        """Return the slopes at two or more keys of a curve, which can be dragged: (N, 2)."""
        channel = channel_of(self.clip, row)
        return None if channel is None or len(channel.times) < 2 else slopes(channel)

    def tangents(self, row: int) -> Sequence[tuple[Tangent, Tangent]] | None:
        """Return the tangents before and after each key of a curve."""
        channel = channel_of(self.clip, row)
        return None if channel is None else channel.tangents

    def extrapolation(self, row: int) -> tuple[Extrapolation, Extrapolation] | None:
        """Return the extrapolation before and after the keys of a curve."""
        channel = channel_of(self.clip, row)
        return None if channel is None else channel.extrapolation

    def interpolation(self, row: int) -> None:
        """Return None: tangents of keys determine the interpolation."""

    def shown_first(self, curves: Sequence[Curve], rows: tuple[int, ...]) -> tuple[int, ...]:
        """Return those of some curves that are shown before one is chosen: all."""
        return rows

    def values(self, rows: tuple[int, ...], times: Floats) -> Floats:
        """Return the values of some curves at many times: (T, C); those without keys are 0."""
        return keyed_values(self.clip, rows, times)

    def wraps(self, row: int) -> bool:
        """Return False: angles of DOFs are not limited to one revolution."""
        return False

    def moved(self, places: Iterable[KeyPlace], dt: float, dv: float, gap: float) -> Clip:
        """Move keys together; they stop at unselected keys."""
        keys: dict[int, list[int]] = {}
        for row, key in places:
            keys.setdefault(row, []).append(key)
        clip = self.clip
        for row, chosen in keys.items():
            clip = with_channel(clip, row, partial(move_keys, keys=chosen, dt=dt, dv=dv, gap=gap))
        return clip

    def placed(self, place: KeyPlace, time: float | None, value: float | None, gap: float) -> Clip:
        """Set the time or value of one key; a typed time may equal a neighbour's."""
        return self._changed([place[0]], lambda old: set_key(old, place[1], time, value))

    def added(self, rows: Iterable[int], time: float, actor: Actor) -> Clip:
        """Add keys on curves."""
        return self._changed(rows, lambda old: add_key(old, time)[0])

    def deleted(self, places: Iterable[KeyPlace]) -> Clip:
        """Delete keys."""
        clip, places = self.clip, list(places)
        for row in {row for row, _ in places}:
            keys = [key for place, key in places if place == row]
            clip = with_channel(clip, row, partial(delete_keys, keys=keys))
        return clip

    def with_tangent(self, places: Iterable[KeyPlace], side: int, to: Tangent) -> Clip:
        """Set the tangent rule or slope on one side of keys: 0 incoming, 1 outgoing."""
        clip = self.clip
        for row, key in places:
            clip = with_channel(clip, row, partial(set_tangent, key=key, side=side, tangent=to))
        return clip

    def extrapolated(self, rows: Iterable[int], side: int, mode: Extrapolation) -> Clip:
        """Set the extrapolation of some curves before (0) or after (1) their keys."""
        return self._changed(rows, partial(set_extrapolation, side=side, mode=mode))

    def interpolated(self, rows: Iterable[int], mode: Interpolation) -> Clip:
        """Return the same clip; see ``interpolation``."""
        return self.clip

    def ranged(self, start: float, end: float) -> Clip:
        """Set the playback range, seconds."""
        return set_range(self.clip, start, end)

    def posed(self, actor: Actor, time: float, only_changed: bool) -> Clip:
        """Key an actor's pose at a time."""
        return key_pose(self.clip, self.skeleton, actor.pose, time, only_changed)

    def _changed(self, rows: Iterable[int], change: Callable[[Channel], Channel]) -> Clip:
        clip = self.clip
        for row in rows:
            clip = with_channel(clip, row, change)
        return clip


@dataclass(frozen=True, slots=True, eq=False)
class TransformKeys:
    """A clip of transforms, whose rows are indices into ``rows_of``."""

    clip: TransformClip
    skeleton: Skeleton

    def row(self, row: int) -> TransformRow:
        """Return the component that a curve shows."""
        return rows_of(self.clip, self.skeleton)[row]

    def channel(self, row: int) -> TransformChannel | None:
        """Return the channel of a curve; None for rotations without keys."""
        index = self.row(row).channel
        return None if index < 0 else self.clip.channels[index]

    def keys(self, row: int) -> tuple[Floats, Floats] | None:
        """Return the times and values of a curve's keys."""
        channel = self.channel(row)
        if channel is None:
            return None
        return channel.times, key_values(channel, self.skeleton)[:, self.row(row).component]

    def slopes(self, row: int) -> Floats | None:
        """Return the slopes at cubic keys; None for rotations, whose angles have other slopes."""
        channel = self.channel(row)
        if channel is None or channel.tangents is None or channel.path == "rotation":
            return None
        return channel.tangents[:, :, self.row(row).component]

    def tangents(self, row: int) -> None:
        """Return None: keys have slopes, but no rules."""

    def extrapolation(self, row: int) -> None:
        """Return None: the first and the last key are held."""

    def interpolation(self, row: int) -> Interpolation | None:
        """Return the interpolation between the keys of a curve."""
        channel = self.channel(row)
        return None if channel is None else channel.interpolation

    def shown_first(self, curves: Sequence[Curve], rows: tuple[int, ...]) -> tuple[int, ...]:
        """Return those of some curves that are shown before one is chosen: angles with keys."""
        moving = tuple(row for row in rows if self.channel(row) is not None)
        return tuple(row for row in moving if curves[row].is_angle) or moving or rows

    def values(self, rows: tuple[int, ...], times: Floats) -> Floats:
        """Return the values of some curves at many times: (T, C)."""
        return row_values(self.clip, self.skeleton, rows, times)

    def wraps(self, row: int) -> bool:
        """Return whether a curve is an angle, which jumps by full rotations."""
        return self.row(row).path == "rotation"

    def moved(self, places: Iterable[KeyPlace], dt: float, dv: float, gap: float) -> TransformClip:
        """Move keys, and all components that share them, up to unselected keys."""
        return move_transform_keys(self.clip, self.skeleton, places, dt, dv, gap)

    def placed(
        self, place: KeyPlace, time: float | None, value: float | None, gap: float
    ) -> TransformClip:
        """Set the time or value of one key."""
        return set_transform_key(self.clip, self.skeleton, place, time, value, gap)

    def added(self, rows: Iterable[int], time: float, actor: Actor) -> TransformClip:
        """Add keys on curves; rotations without keys get the values of the actor's pose."""
        clip, now = self.clip, joint_values(self.skeleton, actor.pose)
        # The components of a channel share their keys.
        wanted = {(row.path, row.joint, row.channel): row for row in map(self.row, rows)}
        for row in wanted.values():
            value = now[row.path][row.joint] if row.channel < 0 else None
            clip = add_transform_key(clip, row, time, value)
        return clip

    def deleted(self, places: Iterable[KeyPlace]) -> TransformClip:
        """Delete keys, including all components that share them."""
        return delete_transform_keys(self.clip, self.skeleton, places)

    def with_tangent(self, places: Iterable[KeyPlace], side: int, to: Tangent) -> TransformClip:
        """Set the slope on one side of cubic keys."""
        clip = self.clip
        if isinstance(to, str):
            return clip  # there are no rules
        for row, key in places:
            clip = set_transform_slope(clip, self.row(row), key, side, to)
        return clip

    def extrapolated(self, rows: Iterable[int], side: int, mode: Extrapolation) -> TransformClip:
        """Return the same clip; see ``extrapolation``."""
        return self.clip

    def interpolated(self, rows: Iterable[int], mode: Interpolation) -> TransformClip:
        """Set the interpolation of the channels of some curves."""
        channels = sorted({self.row(row).channel for row in rows} - {-1})
        return set_clip_interpolation(self.clip, channels, mode)

    def ranged(self, start: float, end: float) -> TransformClip:
        """Set the playback range, seconds."""
        return set_range(self.clip, start, end)

    def posed(self, actor: Actor, time: float, only_changed: bool) -> TransformClip:
        """Key an actor's pose at a time."""
        pose = actor.pose
        return key_transform_pose(self.clip, actor.figure, pose, time, only_changed)


KeyedMotion: TypeAlias = DofKeys | TransformKeys
"""A keyed motion; every edit returns a new motion. Rows are as in ``curves_of``."""


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


def change_tangent(state: AppState, places: Iterable[KeyPlace], side: int, to: Tangent) -> None:
    """Set the tangent rule or slope on one side of keys: 0 incoming, 1 outgoing."""
    keyed = keyed_of(state.actor)
    if keyed is not None:
        state.actor.clip = keyed.with_tangent(places, side, to)


def extrapolate(state: AppState, side: int, mode: Extrapolation) -> None:
    """Set the extrapolation of the curves in focus before (0) or after (1) their keys."""
    keyed = keyed_of(state.actor)
    if keyed is not None:
        state.actor.clip = keyed.extrapolated(focused_rows(state.of(Curves)), side, mode)


def interpolate(state: AppState, mode: Interpolation) -> None:
    """Set the interpolation of the channels of the curves in focus."""
    keyed = keyed_of(state.actor)
    if keyed is not None:
        state.actor.clip = keyed.interpolated(focused_rows(state.of(Curves)), mode)


def set_playback_range(state: AppState, start: float, end: float) -> None:
    """Set the clip's own time range, seconds."""
    keyed = keyed_of(state.actor)
    if keyed is not None:
        state.actor.clip = keyed.ranged(start, end)


def keyed_of(actor: Actor) -> KeyedMotion | None:
    """Return an actor's motion if it has keys to edit."""
    clip, skeleton = actor.clip, actor.figure.skeleton
    if skeleton is None:
        return None
    if clip is not None and clip.kind == "curves":
        return DofKeys(clip, skeleton)
    return None if actor.transforms is None else TransformKeys(actor.transforms, skeleton)


def can_have_keys(state: AppState) -> bool:
    """Return whether the chosen actor can get a clip: it has joints and no motion yet."""
    return state.actor.own_pose is not None and state.actor.clip is None


def new_clip(state: AppState) -> None:
    """Create a clip of the chosen actor's constant pose, with one key per DOF."""
    actor = state.actor
    if actor.own_pose is None or actor.figure.skeleton is None or actor.clip is not None:
        return
    actor.clip = clip_from_pose(actor.figure.skeleton, actor.own_pose, actor.title, 0.0, _SECONDS)
    state.say_status("New clip: this pose held for two seconds")


def key_present_pose(state: AppState, only_changed: bool = False) -> None:
    """Key the pose at the current time."""
    actor, keyed = state.actor, keyed_of(state.actor)
    if keyed is None or actor.own_pose is None:
        return
    time = state.clock.time - actor.offset
    actor.clip = new = keyed.posed(actor, time, only_changed)
    added = new.n_keys - keyed.clip.n_keys
    state.say_status(f"Pose keyed at {number_text(time, '.3f')} s: {added} new keys")


def ask_for_clip(state: AppState) -> None:
    """Ask where to save the chosen actor's clip."""
    name = f"{file_stem(state.actor.name)}_edited.anim"
    ask_where_to_write(state, save_clip, "Save clip: .anim", FORMATS["anim"].suffixes, name)


def save_clip(state: AppState, path: Path) -> None:
    """Write the chosen actor's clip if it is keyed."""
    clip = state.actor.clip
    if clip is not None and clip.kind == "curves":
        save_files(state, lambda: write(clip, path), [path], saved=[clip])
