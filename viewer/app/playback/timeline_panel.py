"""Timeline panel: playback buttons, settings and tracks; actions on time and the playback range."""

from __future__ import annotations

import math

from imgui_bundle import imgui

from viewer.app.core.clock import FASTEST, MODES
from viewer.app.core.fields import begin_field, drag_int, in_row
from viewer.app.core.reasons import no_motion
from viewer.app.core.state import AppState
from viewer.app.core.text_fields import number_field, whole_field
from viewer.app.core.widgets import (
    button,
    checkbox,
    choice,
    disabled,
    explain,
    key_name,
    note_item,
    same_line_if_room,
    slider,
    with_key,
)
from viewer.app.files.files import Files, offer_files
from viewer.app.playback.animations import animation_texts, choose_animation, played
from viewer.app.playback.tracks import draw_tracks
from viewer.rigs.memo import Memo
from viewer.rigs.motion.sampled_clip import with_rate
from viewer.rigs.number_text import number_text
from viewer.rigs.scene import Actor, Motion

_WIDEST_LIST = 16.0  # maximum width of the list of animations, in font sizes
_CLAMP = imgui.SliderFlags_.always_clamp
_gaps: Memo[Motion, bool] = Memo()
_LIMITS = (0.01, 1000.0)
"""Lowest and highest rate that can be set, frames per second."""


def draw(state: AppState) -> None:
    """Draw the panel."""
    if state.actor.figure.animations:
        texts = {str(index): text for index, text in animation_texts(state.actor).items()}
        width = min(max(map(len, texts.values())) * 0.6 + 2.0, _WIDEST_LIST)
        new = choice(state, "Animation", str(played(state.actor)), texts, width)
        explain("motion of this file, played by all of its figures ([ and ])")
        choose_animation(state, int(new))
    if not state.clock.has_motion:
        offer_files(state, f"There is {no_motion(state)}.")
        return
    if state.actor.figure.animations:
        same_line_if_room("M" * 12)
    _draw_transport(state)
    same_line_if_room("000000")
    clock = state.clock
    shown = clock.frame + clock.first_frame
    frame = whole_field(state, begin_field("Frame##frame", 4.5), shown)
    note_item(state, "Frame")
    explain("current frame")
    if frame is not None and frame != shown:
        clock.playing = False
        clock.seek(clock.frame_time(frame - clock.first_frame))
    first, last = (clock.first_frame + number for number in clock.frame_range)
    text = f"of {first} to {last}    {number_text(clock.time, '.3f')} s"
    same_line_if_room(text)
    imgui.text_unformatted(text)
    same_line_if_room("M" * 9)
    foreign = foreign_rate(state)
    with disabled(state, foreign):
        typed = number_field(state, begin_field("Frames per second##rate", 4.0), rate_of(state))
        note_item(state, "Frame rate")
        explain("play the same frames faster or slower", foreign)
    if typed is not None:
        set_rate(state, typed)
    _draw_settings(state)
    draw_tracks(state)


def _draw_transport(state: AppState) -> None:
    clock = state.clock
    if button(state, "|<"):
        go_to_end(state, last=False)
    explain(with_key(state, "first frame of the range", "Home"))
    imgui.same_line()
    if button(state, "<"):
        step(state, -1)
    explain(with_key(state, "one frame back", "Left"))
    imgui.same_line()
    # Both labels have the same width, or the following buttons would move.
    width = imgui.calc_text_size("Pause").x + 2 * imgui.get_style().frame_padding.x
    if imgui.button("Pause###play" if clock.playing else "Play###play", (width, 0.0)):
        play(state)
    note_item(state, "Play")
    explain(with_key(state, "play or pause", "Space"))
    imgui.same_line()
    if button(state, ">"):
        step(state, 1)
    explain(with_key(state, "one frame forward", "Right"))
    imgui.same_line()
    if button(state, ">|"):
        go_to_end(state, last=True)
    explain(with_key(state, "last frame of the range", "End"))


def _draw_settings(state: AppState) -> None:
    clock = state.clock
    clock.mode = choice(state, "Mode", clock.mode, MODES, width=7.0)
    explain("behaviour at the end of the range")
    if clock.mode != "run on":
        clock.time = min(max(clock.time, clock.whole[0]), clock.whole[1])
    same_line_if_room("M" * 12)
    clock.speed = slider(
        state, "Speed", clock.speed, -FASTEST, FASTEST, "%.2f x", _CLAMP, width=8.0
    )
    if imgui.is_item_clicked(imgui.MouseButton_.right):
        clock.speed = 1.0
    explain("seconds of motion per second; right-click to reset to 1")
    same_line_if_room("M" * 14)
    _draw_range(state)
    same_line_if_room("Interpolate gaps")
    gapless = _no_gaps(state)
    clock.interpolate_gaps = checkbox(state, "Interpolate gaps", clock.interpolate_gaps, gapless)
    text = "interpolate missing frames of captures between the frames before and after the gap"
    explain(text, gapless)


def _draw_range(state: AppState) -> None:
    """Draw the start and end frame of the playback range."""
    clock = state.clock
    rate, origin = clock.frame_rate, clock.origin
    first = round((clock.start - origin) * rate) + clock.first_frame
    last = round((clock.end - origin) * rate) + clock.first_frame
    lowest, highest = (clock.first_frame + number for number in clock.frame_range)
    moved: dict[bool, int] = {}

    def draw_end(hidden: str, frame: int) -> None:
        is_last = hidden.endswith("1")
        limits = (first, highest) if is_last else (lowest, last)
        changed, typed = drag_int(state, hidden, frame, limits)
        if changed:
            moved[is_last] = typed

    in_row(begin_field("Range", 9.0), (first, last), draw_end)
    note_item(state, "Range")
    first_key, last_key = key_name(state, "I"), key_name(state, "O")
    text = f"frames to play; {first_key} and {last_key} set them to the current frame"
    explain(f"{text}\nright-click resets them to all frames")
    if imgui.is_item_clicked(imgui.MouseButton_.right):
        clock.set_range(*clock.whole)
    elif moved:
        # An untouched end keeps its exact time.
        start, end = (
            clock.frame_time(moved[is_last] - clock.first_frame) if is_last in moved else kept
            for is_last, kept in ((False, clock.start), (True, clock.end))
        )
        clock.set_range(start, end)


def _no_gaps(state: AppState) -> str:
    """Return the reason why gaps cannot be interpolated; empty if they can or files are read."""
    if state.of(Files).stream is not None or any(
        _has_gaps(actor.clip) for actor in state.scene.actors if actor.clip is not None
    ):
        return ""
    return "no motion has missing frames"


def _has_gaps(clip: Motion) -> bool:
    timing = clip.timing
    if timing is None:
        return False
    return _gaps.get(clip, None, lambda: not timing.holds or not timing.present.all())


def rate_of(state: AppState) -> float:
    """Return the frame rate of the chosen actor's motion, frames per second."""
    clip = state.actor.captured
    return state.clock.frame_rate if clip is None else clip.frame_rate


def foreign_rate(state: AppState) -> str:
    """Return the reason why the actor's rate cannot be set: another actor defines the frames."""
    clock = state.clock
    if not clock.has_frames or state.actor.captured is not None:
        return ""
    return "the frames belong to another motion: select its actor"


def set_rate(state: AppState, rate: float) -> None:
    """Set the frames per second of the chosen actor's capture; keyed clips get no new samples."""
    if foreign_rate(state) or rate == rate_of(state):
        return
    if not (math.isfinite(rate) and _LIMITS[0] <= rate <= _LIMITS[1]):
        low, high = _LIMITS
        state.say(f"frames per second: expected {low:g} to {high:g}, found {rate:g}")
        return
    if state.actor.captured is None:
        state.clock.count_by(rate)
        state.say_status(f"Frames of keyed clips are numbered at {rate:g} frames per second")
        return
    together = [actor for actor in state.scene.actors if _is_together(actor, state.actor)]
    for actor in together:
        if actor.captured is not None:
            actor.clip = with_rate(actor.captured, rate)
    who = f" for {len(together)} actors of this capture" if len(together) > 1 else ""
    state.say_status(f"{rate:g} frames per second{who}")


def _is_together(one: Actor, other: Actor) -> bool:
    """Return whether two actors are identical or belong to the same capture."""
    first, second = one.captured, other.captured
    if one is other:
        return True
    if first is None or second is None:
        return False
    if one.person is None or other.person is None or first.name != second.name:
        return False
    a, b = first.timing, second.timing
    return (a.frame_rate, a.n_frames, a.first_frame, a.start) == (
        b.frame_rate, b.n_frames, b.first_frame, b.start,
    )  # fmt: skip


def play(state: AppState) -> None:
    """Play or pause."""
    if not state.clock.has_motion:
        state.say_status(no_motion(state))
        return
    state.clock.toggle()
    state.say_status("Playing" if state.clock.playing else "Paused")


def step(state: AppState, frames: int) -> None:
    """Step by some frames, forwards or backwards."""
    if state.clock.has_motion:
        state.clock.step(frames)


def go_to_end(state: AppState, last: bool) -> None:
    """Go to the first or last frame of the playback range."""
    clock = state.clock
    if clock.has_motion:
        clock.seek(clock.end if last else clock.start)


def range_in(state: AppState) -> None:
    """Start the playback range at the current time."""
    clock = state.clock
    if clock.has_motion:
        clock.set_range(clock.time, max(clock.end, clock.time))
        state.say_status(f"The range starts at {number_text(clock.start, '.3f')} s")


def range_out(state: AppState) -> None:
    """End the playback range at the current time."""
    clock = state.clock
    if clock.has_motion:
        clock.set_range(min(clock.start, clock.time), clock.time)
        state.say_status(f"The range ends at {number_text(clock.end, '.3f')} s")
