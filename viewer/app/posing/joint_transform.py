"""Rows of the Joints panel for the translation and scale of a joint."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.fields import drag_float, in_row
from viewer.app.core.state import AppState
from viewer.app.core.widgets import note_item, plain_zero, show_tooltip
from viewer.app.posing.clip_pause import pause_for_edit
from viewer.data_classes import dataclass
from viewer.rig.memo import Memo
from viewer.rig.mesh import box_size
from viewer.rig.motion.transform_clip import TransformClip
from viewer.rig.pose import Pose
from viewer.rig.skeleton import Skeleton

__all__ = [
    "draw_scale",
    "draw_translation",
    "moved_joints",
    "toggle_transform",
    "unlocked_joints",
]

_LABEL_WIDTH = 4.2  # width of a label, in font sizes
_LARGEST = 1e9
_NOTICEABLE = 1e-4  # tolerance for rounding, relative to the longest bone or a scale of 1
_animated: Memo[TransformClip, frozenset[int]] = Memo()


@dataclass(slots=True)
class _Unlocked:
    """Joints of the chosen actor whose translation and scale are listed on request.

    Attributes
    ----------
    joints : frozenset of int
        Indices of the joints.
    n_choices : int
        The state's ``n_choices`` for which the indices are valid.
    """

    joints: frozenset[int] = frozenset()
    n_choices: int = -1


def unlocked_joints(state: AppState) -> frozenset[int]:
    """Return the joints whose translation and scale the user has shown."""
    unlocked = state.of(_Unlocked)
    return unlocked.joints if unlocked.n_choices == state.n_choices else frozenset()


def toggle_transform(state: AppState, joint: int) -> None:
    """Show or hide translation and scale of a joint of the chosen actor."""
    state.put(_Unlocked(unlocked_joints(state) ^ {joint}, state.n_choices))


def moved_joints(state: AppState) -> frozenset[int]:
    """Return the joints whose translation and scale are listed: animated or unlocked ones."""
    clip = state.actor.clip
    if not isinstance(clip, TransformClip):
        return unlocked_joints(state)
    skeleton = state.actor.figure.require_skeleton()
    animated = _animated.get(clip, skeleton, lambda: _animated_joints(clip, skeleton))
    return unlocked_joints(state) | animated


def _animated_joints(clip: TransformClip, skeleton: Skeleton) -> frozenset[int]:
    """Return the joints that a clip translates or scales noticeably away from rest.

    Many exporters write channels for every joint, most of them without effect.
    """
    bones = np.linalg.norm(skeleton.rest_translations, axis=1)
    rests = {
        "translation": (skeleton.rest_translations, _NOTICEABLE * float(bones.max())),
        "scale": (skeleton.rest_scales, _NOTICEABLE),
    }
    return frozenset(
        channel.joint
        for channel in clip.channels
        if channel.path in rests
        and np.abs(channel.values - rests[channel.path][0][channel.joint]).max()
        > rests[channel.path][1]
    )


def draw_translation(state: AppState, pose: Pose, joint: int, label: str) -> None:
    """Draw a joint's translation relative to its rest position, along the parent's axes."""
    speed = 0.002 * (box_size(state.box) or 1.0)

    def draw_axis(hidden: str, axis: int) -> None:
        shown = plain_zero(float(pose.translations[joint, axis]), "%.4f")
        changed, moved = drag_float(state, hidden, shown, speed, "%.4f")
        if changed and abs(moved) < _LARGEST:
            pose.translations[joint, axis] = moved

    _draw_row(state, f"{label}.translation", "move", joint, draw_axis)
    if _is_reset(f"{label}: translation from rest, along the parent's axes"):
        pose.translations[joint] = 0.0


def draw_scale(state: AppState, pose: Pose, joint: int, label: str) -> None:
    """Draw the scale factors of a joint along its own axes."""
    skeleton = state.actor.figure.require_skeleton()

    def draw_axis(hidden: str, axis: int) -> None:
        shown = plain_zero(float(pose.scales[joint, axis]), "%.4f")
        changed, moved = drag_float(state, hidden, shown, 0.005, "%.4f")
        if changed and abs(moved) < _LARGEST:
            pose.scales[joint, axis] = moved

    _draw_row(state, f"{label}.scale", "scale", joint, draw_axis)
    if _is_reset(f"{label}: scale along its own axes"):
        pose.scales[joint] = skeleton.rest_scales[joint]


def _draw_row(
    state: AppState, name: str, text: str, joint: int, draw_axis: Callable[[str, int], None]
) -> None:
    """Draw a label and three fields."""
    imgui.align_text_to_frame_padding()
    start = imgui.get_cursor_pos_x()
    imgui.text_disabled(text)
    imgui.same_line(start + _LABEL_WIDTH * imgui.get_font_size())
    imgui.set_next_item_width(-1.0)

    def draw(hidden: str, axis: int) -> None:
        draw_axis(hidden, axis)
        if imgui.is_item_activated():
            pause_for_edit(state)
        note_item(state, f"{name} {'xyz'[axis]}")

    in_row(f"##{text}{joint}", range(3), draw)
    note_item(state, name)


def _is_reset(text: str) -> bool:
    """Show the tooltip of the last row, and return whether a double-click resets the row."""
    if not imgui.is_item_hovered():
        return False
    show_tooltip(f"{text}\ndrag, or Ctrl+click to type a value; double-click to reset")
    return imgui.is_mouse_double_clicked(imgui.MouseButton_.left)
