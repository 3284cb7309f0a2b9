"""Hands panel: sliders of the principal components of hand poses, and flat and mean hands."""

from __future__ import annotations

import math

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.fields import begin_field, slider_float, slider_int
from viewer.app.core.state import AppState
from viewer.app.core.widgets import button, note_item, plain_zero, same_line_if_room
from viewer.app.files.files import offer_files
from viewer.app.posing.posing import Posing
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import matrix_to_rotation_vector, rotation_vector_to_matrix
from viewer.rigs.hands import Hand, hand_coefficients, hand_vectors
from viewer.rigs.memo import Memo
from viewer.rigs.pose import Pose, joint_rotations, set_joint_rotations

_REACH = 3.0  # range of a slider; larger values can be typed
_CLAMP = int(imgui.SliderFlags_.always_clamp)
_coefficients: Memo[Hand, Floats] = Memo()


def draw(state: AppState) -> None:
    """Draw the panel for the chosen actor."""
    posing = state.of(Posing)
    figure, pose = state.actor.figure, state.actor.own_pose
    if not figure.hands or pose is None:
        offer_files(state, "This figure has no hand components: open a body model with hands.")
        return
    most = min(len(hand.components) for hand in figure.hands)
    changed, count = slider_int(
        state,
        begin_field("Components##components"),
        min(posing.n_hand_components, most),
        1,
        most,
        "%d",
        _CLAMP,
    )
    note_item(state, "components")
    if changed:
        posing.n_hand_components = count
    if imgui.begin_child("hands", (0.0, 0.0), imgui.ChildFlags_.nav_flattened):
        for hand in figure.hands:
            _draw_hand(state, figure, pose, hand)
    imgui.end_child()


def _draw_hand(state: AppState, figure: Figure, pose: Pose, hand: Hand) -> None:
    side = hand.side or "hand"
    imgui.separator_text(side.capitalize())
    for name, flat in (("flat", True), ("mean", False)):
        if button(state, f"{name.capitalize()}###{side} {name}"):
            _rotate(figure, pose, hand, hand_vectors(hand, np.zeros(0), flat))
        note_item(state, f"{side} {name}")
        if flat:
            same_line_if_room("Mean")
    assert figure.skeleton is not None  # hands imply a skeleton
    vectors = matrix_to_rotation_vector(joint_rotations(figure.skeleton, pose)[hand.joints])
    values = _coefficients.get(
        hand,
        vectors.tobytes(),
        lambda: hand_coefficients(hand, vectors, flat=False, count=len(hand.components)),
    )
    for index in range(min(state.of(Posing).n_hand_components, len(hand.components))):
        field = begin_field(f"{side.capitalize()} {index}##{side} {index}")
        shown = plain_zero(float(values[index]), "%.2f")
        changed, value = slider_float(state, field, shown, -_REACH, _REACH)
        note_item(state, f"{side} component {index}")
        if changed and math.isfinite(value) and abs(value) < 1e3:
            # The other components, and the residual outside their span, stay unchanged.
            step = (value - values[index]) * hand.components[index].reshape(-1, 3)
            _rotate(figure, pose, hand, vectors + step)


def _rotate(figure: Figure, pose: Pose, hand: Hand, vectors: Floats) -> None:
    assert figure.skeleton is not None
    set_joint_rotations(figure.skeleton, pose, hand.joints, rotation_vector_to_matrix(vectors))
