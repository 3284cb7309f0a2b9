"""Ball joints in the Joints panel: rotation vectors, and the raw pose values."""

from __future__ import annotations

import math

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.fields import slider_float
from viewer.app.core.state import AppState
from viewer.app.core.widgets import note_item, plain_zero, show_tooltip
from viewer.app.posing.state import HeldVector, Posing
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.geometry.rotation import matrix_to_rotation_vector, rotation_vector_to_matrix
from viewer.rig.memo import Memo
from viewer.rig.number_text import number_text
from viewer.rig.pose import Pose, joint_rotations
from viewer.rig.posing.pose_vector import (
    PoseLayout,
    own_numbers,
    rotation_rows,
    set_joint_rotations,
)
from viewer.rig.skeleton import Skeleton

__all__ = ["draw_own_numbers", "draw_vector_component", "is_ball"]

_SAME = 1e-9  # tolerance for equal rotations
_rotations: Memo[Skeleton, Floats] = Memo()
_numbers: Memo[Skeleton, Floats] = Memo()


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
    is_reset = False
    if imgui.is_item_hovered():
        show_tooltip(
            f"{label}: component of the rotation vector\n"
            "Ctrl+click to type a value, double-click to set it to 0"
        )
        is_reset = imgui.is_mouse_double_clicked(imgui.MouseButton_.left)
    if is_reset or (changed and math.isfinite(moved) and abs(moved) < 1e6):
        vector[axis] = 0.0 if is_reset else moved / factor
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
