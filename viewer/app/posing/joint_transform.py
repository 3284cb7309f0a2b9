"""Rows of the Joints panel for the translation and scale of a joint."""

from __future__ import annotations

import math

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.fields import drag_float, in_row, slider_float
from viewer.app.core.state import AppState
from viewer.app.core.widgets import is_reset, note_item, plain_zero, show_tooltip
from viewer.app.posing.posing import HeldVector, Posing, pause_for_edit
from viewer.data_classes import dataclass
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import matrix_to_rotation_vector, rotation_vector_to_matrix
from viewer.rigs.memo import Memo
from viewer.rigs.mesh import box_size
from viewer.rigs.motion.transform_clip import TransformClip
from viewer.rigs.number_text import number_text
from viewer.rigs.pose import Pose, joint_rotations, rotation_rows, set_joint_rotations
from viewer.rigs.posing.pose_vector import PoseLayout, own_numbers
from viewer.rigs.skeleton import Skeleton

_DRAGS = "drag, or Ctrl+click to type a value; double-click to reset"
_LABEL_WIDTH = 4.2  # width of a label, in font sizes
_LARGEST = 1e9
_NOTICEABLE = 1e-4  # tolerance for rounding, relative to the longest bone or a scale of 1
_animated: Memo[TransformClip, frozenset[int]] = Memo()
_SAME = 1e-9  # tolerance for equal rotations
_rotations: Memo[Skeleton, Floats] = Memo()
_numbers: Memo[Skeleton, Floats] = Memo()


@dataclass(slots=True)
class _Unlocked:
    """Joints of the chosen actor whose translation and scale are listed on request."""

    joints: frozenset[int] = frozenset()
    """Indices of the joints."""
    n_choices: int = -1
    """The state's ``n_choices`` for which the indices are valid."""


def unlocked_joints(state: AppState) -> frozenset[int]:
    """Return the joints whose translation and scale the user has shown."""
    unlocked = state.of(_Unlocked)
    return unlocked.joints if unlocked.n_choices == state.n_choices else frozenset()


def toggle_transform(state: AppState, joint: int) -> None:
    """Show or hide translation and scale of a joint of the chosen actor."""
    state.put(_Unlocked(unlocked_joints(state) ^ {joint}, state.n_choices))


def moved_joints(state: AppState) -> frozenset[int]:
    """Return the joints whose translation and scale are listed: animated or unlocked ones."""
    clip = state.actor.transforms
    if clip is None:
        return unlocked_joints(state)
    skeleton = state.actor.figure.require_skeleton()
    animated = _animated.get(clip, skeleton, lambda: _animated_joints(clip, skeleton))
    return unlocked_joints(state) | animated


def _animated_joints(clip: TransformClip, skeleton: Skeleton) -> frozenset[int]:
    """Return the joints that a clip translates or scales noticeably away from rest."""
    # Many exporters write channels for every joint, most of them without effect.
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
    _draw_row(state, f"{label}.translation", "move", joint, pose.translations, speed)
    if is_reset(f"{label}: translation from rest, along the parent's axes\n{_DRAGS}"):
        pose.translations[joint] = 0.0


def draw_scale(state: AppState, pose: Pose, joint: int, label: str) -> None:
    """Draw the scale factors of a joint along its own axes."""
    _draw_row(state, f"{label}.scale", "scale", joint, pose.scales, 0.005)
    if is_reset(f"{label}: scale along its own axes\n{_DRAGS}"):
        pose.scales[joint] = state.actor.figure.require_skeleton().rest_scales[joint]


def _draw_row(
    state: AppState, name: str, text: str, joint: int, values: Floats, speed: float
) -> None:
    """Draw a label and three fields, which change a joint's row of values (J, 3)."""
    imgui.align_text_to_frame_padding()
    start = imgui.get_cursor_pos_x()
    imgui.text_disabled(text)
    imgui.same_line(start + _LABEL_WIDTH * imgui.get_font_size())
    imgui.set_next_item_width(-1.0)

    def draw(hidden: str, axis: int) -> None:
        shown = plain_zero(float(values[joint, axis]), "%.4f")
        changed, moved = drag_float(state, hidden, shown, speed, "%.4f")
        if changed and abs(moved) < _LARGEST:
            values[joint, axis] = moved
        if imgui.is_item_activated():
            pause_for_edit(state)
        note_item(state, f"{name} {'xyz'[axis]}")

    in_row(f"##{text}{joint}", range(3), draw)
    note_item(state, name)


def is_ball(figure: Figure, joint: int) -> bool:
    """Return whether a joint of a body model has three unlimited DOFs about x, y and z."""
    skeleton = figure.skeleton
    if skeleton is None or figure.pose_layout is None:
        return False
    rows = rotation_rows(skeleton)[joint]
    return rows[0] >= 0 and bool(np.isinf(skeleton.dof_limits[rows]).all())


def draw_vector_component(
    state: AppState, figure: Figure, pose: Pose, joint: int, axis: int, label: str
) -> None:
    """Draw the slider of one component of a joint's rotation vector, and apply it."""
    skeleton = figure.skeleton
    assert skeleton is not None  # checked by the panel
    vector = _shown_vector(state, figure, pose, joint)
    factor = math.degrees(1.0) if state.in_degrees else 1.0
    text = "%.1f\N{DEGREE SIGN}" if state.in_degrees else "%.4f rad"
    reach = math.pi * factor
    changed, moved = slider_float(
        state,
        f"##vector{joint}.{axis}",
        plain_zero(float(vector[axis]) * factor, text),
        -reach,
        reach,
        text,
    )
    note_item(state, f"{label}.r{'xyz'[axis]}")
    becomes_zero = is_reset(
        f"{label}: component of the rotation vector\n"
        "Ctrl+click to type a value, double-click to set it to 0"
    )
    if becomes_zero or (changed and math.isfinite(moved) and abs(moved) < 1e6):
        vector[axis] = 0.0 if becomes_zero else moved / factor
        rotation = rotation_vector_to_matrix(vector)
        joints = np.array([joint], dtype=np.int32)
        set_joint_rotations(skeleton, pose, joints, rotation[None])
        state.of(Posing).held_vector = HeldVector(joint, vector, rotation, state.n_choices)


def _shown_vector(state: AppState, figure: Figure, pose: Pose, joint: int) -> Floats:
    """Return a joint's rotation vector: the edited vector as long as it matches the rotation."""
    posing = state.of(Posing)
    assert figure.skeleton is not None  # checked by the caller
    rotation = _rotations_of(figure.skeleton, pose)[joint]
    held = posing.held_vector
    if held is not None and (held.joint, held.n_choices) == (joint, state.n_choices):
        if np.abs(held.rotation - rotation).max() < _SAME:
            return held.vector.copy()
        posing.held_vector = None
    return matrix_to_rotation_vector(rotation)


def draw_own_numbers(state: AppState, figure: Figure, pose: Pose, joint: int) -> None:
    """Draw the three values of a joint in the body model's pose vector."""
    layout, skeleton = figure.pose_layout, figure.skeleton
    if layout is None or skeleton is None:
        return
    numbers = _numbers_of(layout, skeleton, pose)[joint]
    kind = "angles z y x" if layout.is_euler[joint] else "vector"
    imgui.text_disabled(
        f"file: {'  '.join(number_text(number, '.4f') for number in numbers.tolist())}"
    )
    note_item(state, f"own {joint}")
    if imgui.is_item_hovered():
        start = int(layout.starts[joint])
        show_tooltip(f"numbers {start} to {start + 2} of the file's pose vector: {kind}, radians")


def _rotations_of(skeleton: Skeleton, pose: Pose) -> Floats:
    """Return the rotations of all joints, (J, 3, 3), computed once for all rows of the panel."""
    return _rotations.get(skeleton, pose.skinning_key, lambda: joint_rotations(skeleton, pose))


def _numbers_of(layout: PoseLayout, skeleton: Skeleton, pose: Pose) -> Floats:
    """Return the numbers of all joints, (J, 3), computed once for all rows of the panel."""
    key = (layout, pose.skinning_key)
    return _numbers.get(skeleton, key, lambda: own_numbers(layout, _rotations_of(skeleton, pose)))
