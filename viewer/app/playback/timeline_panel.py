"""Timeline panel: playback buttons, settings, ruler and tracks; actions on time and its range."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.clock import FASTEST, MODES, Clock
from viewer.app.core.fields import begin_field, drag_int, in_row
from viewer.app.core.reasons import no_motion
from viewer.app.core.state import AppState
from viewer.app.core.text_fields import number_field, whole_field
from viewer.app.core.theme import faint
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
from viewer.phrases import printable
from viewer.rigs.arrays import Floats, runs_of
from viewer.rigs.memo import Memo
from viewer.rigs.motion.clip import Clip
from viewer.rigs.motion.sampled_clip import with_rate
from viewer.rigs.motion.transform_clip import TransformChannel, TransformClip
from viewer.rigs.number_text import number_text, round_step
from viewer.rigs.scene import Actor, Motion
from viewer.rigs.srgb import encode_color

_WIDEST_LIST = 16.0  # maximum width of the list of animations, in font sizes
_CLAMP = int(imgui.SliderFlags_.always_clamp)
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


# Ruler and tracks: the presence of each actor over time, and the current time.

_NAME_WIDTH = 9.0  # width of the actors' names, in font sizes
_TICK_GAP = 5.0  # font sizes: minimum distance between two numbers on the ruler
_TICK_ASIDE = 3.0  # points between a tick of the ruler and its number
_TIME = (1.0, 0.62, 0.25, 1.0)
_PLAIN = (0.44, 0.62, 0.80)  # sRGB colour of the tracks of actors without their own colour
_QUIET = 0.6  # opacity of the tracks of unchosen actors
_CHOSEN_EDGE = 0.85  # opacity of the edge of the chosen actor's track
_NARROWEST = 0.35  # minimum width of a bar, in font sizes: single frames must be visible
_NARROWEST_GAP = 1.0  # points between two bars of minimum width
_OUTSIDE = (0.0, 0.0, 0.0, 0.35)
_KEY, _KEY_SIZE = (0.0, 0.0, 0.0, 0.55), 0.16  # RGBA colour; size relative to the height of a track
_LINE, _TEXT, _BACK = 0.13, 0.6, 0.03
_times: Memo[Clip | TransformClip, Floats] = Memo(kept=4)


def draw_tracks(state: AppState) -> None:
    """Draw the ruler and the tracks; dragging moves by whole frames, with Alt continuously."""
    size = imgui.get_font_size()
    moving = [index for index, actor in enumerate(state.scene.actors) if actor.clip is not None]
    height = imgui.get_text_line_height_with_spacing()
    low, high = state.clock.whole
    if not imgui.begin_child("##tracks"):
        imgui.end_child()
        return
    corner = imgui.get_cursor_screen_pos()
    left = corner.x + _NAME_WIDTH * size
    width = max(imgui.get_content_region_avail().x - _NAME_WIDTH * size - 0.5 * size, 1.0)
    scale = width / max(high - low, 1e-9)
    area = (left, corner.y, width, height * (len(moving) + 1))
    _draw_names(state, moving, height)
    imgui.set_cursor_screen_pos((left, corner.y))
    imgui.invisible_button("##scrub", (max(width, 1.0), area[3]))
    note_item(state, "Scrubber")
    if imgui.is_item_active() and imgui.is_mouse_down(imgui.MouseButton_.left):
        time = low + (imgui.get_mouse_pos().x - left) / scale
        state.clock.scrub(time, between=imgui.get_io().key_alt)
    first = max(0, int((imgui.get_scroll_y() - height) / height))
    last = first + int(imgui.get_window_height() / height) + 3
    draw_list, gap = imgui.get_window_draw_list(), 0.16 * height
    back = imgui.get_color_u32(faint(_BACK))
    edge = imgui.get_color_u32(faint(_CHOSEN_EDGE))
    for row in range(first, min(last, len(moving))):
        index = moving[row]
        top = corner.y + height * (row + 1)
        chosen, actor = index == state.chosen_actor, state.scene.actors[index]
        upper, lower = top + gap, top + height - gap
        draw_list.add_rect_filled((left, upper), (left + width, lower), back)
        red, green, blue = encode_color(actor.color) if actor.color is not None else _PLAIN
        color = imgui.get_color_u32((red, green, blue, 1.0 if chosen else _QUIET))
        assert actor.clip is not None  # only moving actors have tracks
        spans = present_spans(actor.clip, 1.0 / scale)
        places = [left + (time + actor.offset - low) * scale for span in spans for time in span]
        for x0, x1 in bars(places, _NARROWEST * size, left + width):
            draw_list.add_rect_filled((x0, upper), (x1, lower), color, 2.0)
            if chosen:
                draw_list.add_rect((x0, upper), (x1, lower), edge, 2.0)
        if chosen:
            _draw_keys(state, area, top, height)
    _draw_ruler(state.clock, area)
    _draw_time(state.clock, area)
    imgui.end_child()


def _draw_names(state: AppState, moving: list[int], height: float) -> None:
    """Draw the actors' names; a click chooses one."""
    width = (_NAME_WIDTH - 0.5) * imgui.get_font_size()
    imgui.dummy((width, height - imgui.get_style().item_spacing.y))
    for index in moving:
        actor = state.scene.actors[index]
        imgui.push_id(index)
        text = printable(actor.name, 40)
        if not actor.is_drawn:
            imgui.push_style_color(imgui.Col_.text, faint(_TEXT))
        if imgui.selectable(text, index == state.chosen_actor, 0, (width, 0.0))[0]:
            state.select_actor(index)
        if not actor.is_drawn:
            imgui.pop_style_color()
        note_item(state, f"track {index}")
        imgui.pop_id()


def _draw_keys(
    state: AppState, area: tuple[float, float, float, float], top: float, height: float
) -> None:
    """Mark the keys of the selected joint, or all keys, on the chosen actor's track."""
    low, high = state.clock.whole
    left, _, width, _ = area
    scale = width / max(high - low, 1e-9)
    # Marks closer than a point cannot be told apart.
    places = np.unique(np.round((key_times(state.actor, state.selected_joint) - low) * scale))
    draw_list, color = imgui.get_window_draw_list(), imgui.get_color_u32(_KEY)
    middle, half = top + 0.5 * height, _KEY_SIZE * height
    for x in (left + places[(places >= 0.0) & (places <= width)]).tolist():
        draw_list.add_line((x, middle - half), (x, middle + half), color, 1.0)


def bars(places: Sequence[float], narrowest: float, end: float) -> list[tuple[float, float]]:
    """Return the extents of bars, widened to ``narrowest`` as far as their neighbours let them."""
    found: list[tuple[float, float]] = []
    for number in range(0, len(places), 2):
        x0, x1 = places[number], places[number + 1]
        following = places[number + 2] - _NARROWEST_GAP if number + 2 < len(places) else end
        x1 = max(x1, min(x0 + narrowest, following))
        before = found[-1][1] + _NARROWEST_GAP if found else x1 - narrowest
        found.append((min(x0, max(x1 - narrowest, before)), x1))
    return found


def present_spans(clip: Motion, shortest: float) -> list[tuple[float, float]]:
    """Return when a motion's actor is present, clip seconds; shorter gaps would be invisible."""
    timing = clip.timing
    if timing is None:
        return [(clip.start, clip.end)]
    first, stop = np.array(runs_of(timing.present), dtype=np.int64).reshape(-1, 2).T
    starts = timing.start + first / timing.frame_rate
    ends = timing.start + (stop - 1) / timing.frame_rate
    split = np.flatnonzero(starts[1:] - ends[:-1] > max(shortest, 1.0 / timing.frame_rate) * 1.001)
    begins = starts[np.concatenate([[0], split + 1])] if len(starts) else starts
    stops = ends[np.concatenate([split, [len(ends) - 1]])] if len(ends) else ends
    return list(zip(begins.tolist(), stops.tolist(), strict=True))


def _draw_ruler(clock: Clock, area: tuple[float, float, float, float]) -> None:
    """Draw frame numbers and lines, and darken the time outside the playback range."""
    draw_list = imgui.get_window_draw_list()
    left, top, width, total = area
    low, high = clock.whole
    scale = width / max(high - low, 1e-9)
    line, color = imgui.get_color_u32(faint(_LINE)), imgui.get_color_u32(faint(_TEXT))
    first, last = (clock.first_frame + frame for frame in clock.frame_range)
    # Room for two numbers: the last number may be to the left of its tick.
    room = 2.0 * imgui.calc_text_size(str(last)).x + 3.0 * _TICK_ASIDE
    room = max(_TICK_GAP * imgui.get_font_size(), room)
    step = int(round_step(max(room / scale * clock.frame_rate, 1.0)))
    for number in range(math.ceil(first / step) * step, last + 1, step):
        x = left + (clock.frame_time(number - clock.first_frame) - low) * scale
        draw_list.add_line((x, top), (x, top + total), line)
        place = ruler_text_place(x, imgui.calc_text_size(str(number)).x, left + width)
        draw_list.add_text((place, top), color, str(number))
    dark = imgui.get_color_u32(_OUTSIDE)
    for start, end in ((low, clock.start), (clock.end, high)):
        if end > start:
            x0, x1 = left + (start - low) * scale, left + (end - low) * scale
            draw_list.add_rect_filled((x0, top), (x1, top + total), dark)


def ruler_text_place(x: float, length: float, end: float) -> float:
    """Return the start of a number on the ruler: right of its tick, or left of it at the end."""
    return x - _TICK_ASIDE - length if x + _TICK_ASIDE + length > end else x + _TICK_ASIDE


def _draw_time(clock: Clock, area: tuple[float, float, float, float]) -> None:
    draw_list = imgui.get_window_draw_list()
    left, top, width, total = area
    low, high = clock.whole
    fraction = (clock.time - low) / max(high - low, 1e-9)
    x = left + width * min(max(fraction, 0.0), 1.0)
    color = imgui.get_color_u32(_TIME)
    draw_list.add_line((x, top), (x, top + total), color, 2.0)
    half = 0.3 * imgui.get_font_size()
    draw_list.add_triangle_filled((x - half, top), (x + half, top), (x, top + 1.4 * half), color)


def key_times(actor: Actor, joint: int) -> Floats:
    """Return the increasing scene times (N,) of an actor's keys, in seconds."""
    clip, skeleton = actor.keyed, actor.figure.skeleton
    if skeleton is None or clip is None:
        return np.zeros(0)
    dof_joints = skeleton.dof_joints

    def found() -> Floats:
        # Most channels of a file share their times.
        lists = {}
        for channel in clip.channels:
            if isinstance(channel, TransformChannel):
                own = channel.joint
            else:
                own = int(dof_joints[channel.target])
            if joint < 0 or own == joint:
                lists[channel.times.tobytes()] = channel.times
        return np.unique(np.concatenate([np.zeros(0), *lists.values()]))

    return _times.get(clip, joint, found) + actor.offset
