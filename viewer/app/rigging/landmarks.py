"""Landmarks: pairs of corresponding points of template and target, clicked in the view."""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.fitting import fit_points
from viewer.app.core.state import AppState
from viewer.app.core.view_frame import ViewFrame, view_frame
from viewer.app.rigging.placing import (
    aligned_template,
    ghost_place,
    posed_template,
    set_aside,
    target_place,
)
from viewer.app.rigging.sources import target_mesh
from viewer.app.rigging.state import Landmark, Rigging, Template
from viewer.app.view.state import Picking
from viewer.rig.arrays import Floats
from viewer.rig.geometry.ray_hit import RayHit, first_hit, surface_point
from viewer.rig.geometry.transform import apply_transform
from viewer.rig.mesh import Mesh

__all__ = ["draw_landmarks", "show_both", "take_click"]

_TEMPLATE_INK, _TARGET_INK = (0.35, 0.70, 1.0, 1.0), (1.0, 0.75, 0.30, 1.0)
_RIM = (0.0, 0.0, 0.0, 0.8)
_DOT = 5.0  # radius, window coordinates


def show_both(state: AppState) -> None:
    """Show the template next to the target, and fit the view to both."""
    view, template = state.of(Rigging), aligned_template(state)
    if template is None or view.target is None:
        return
    set_aside(state)
    mesh = posed_template(view, template)
    points = (
        apply_transform(ghost_place(state, template), mesh.positions),
        apply_transform(target_place(view.target), target_mesh(state).positions),
    )
    fit_points(state, np.concatenate(points))


def take_click(state: AppState) -> None:
    """Use a click for a landmark: on the template first, then on the target."""
    picking, view, template = state.of(Picking), state.of(Rigging), aligned_template(state)
    wanted = picking.wanted
    if wanted is None or wanted[2] or template is None:
        return
    picking.wanted = None
    x, y, _, _ = state.view_rect
    place = (wanted[0] + x, wanted[1] + y)
    if view.pending is None:
        mesh, matrix, what = (
            posed_template(view, template),
            ghost_place(state, template),
            "template",
        )
    else:
        assert view.target is not None  # tools need a target
        mesh, matrix, what = target_mesh(state), target_place(view.target), "target"
    hit = _hit(view_frame(state), mesh, matrix, place)
    if hit is None:
        state.say_status(f"Landmarks: click on the {what}")
    elif view.pending is None:
        view.pending = hit
        state.say_status("Landmarks: now the same point of the target")
    else:
        view.landmarks.append(Landmark(view.pending, hit))
        view.pending = None
        count = len(view.landmarks)
        state.say_status(f"{count} landmark{'s' * (count != 1)}")


def _hit(frame: ViewFrame, mesh: Mesh, matrix: Floats, place: tuple[float, float]) -> RayHit | None:
    """Return the point of a mesh that is visible at a position in the window."""
    origin, direction = frame.ray(place)
    back = np.asarray(np.linalg.inv(matrix), dtype=np.float64)
    return first_hit(
        mesh.positions,
        mesh.triangles,
        np.asarray(apply_transform(back, origin[None])[0]),
        back[:3, :3] @ direction,
    )


def draw_landmarks(state: AppState, template: Template) -> None:
    """Draw all pairs as numbered dots, and the first point of an incomplete pair."""
    view = state.of(Rigging)
    assert view.target is not None  # checked by the caller
    posed, place = posed_template(view, template), ghost_place(state, template)
    for number, pair in enumerate(view.landmarks, start=1):
        _draw_dot(state, posed, place, pair.template, str(number), _TEMPLATE_INK)
        _draw_dot(
            state, target_mesh(state), target_place(view.target), pair.target, str(number),
            _TARGET_INK,
        )  # fmt: skip
    if view.pending is not None:
        text = f"{len(view.landmarks) + 1}?"
        _draw_dot(state, posed, place, view.pending, text, _TEMPLATE_INK)


def _draw_dot(
    state: AppState,
    mesh: Mesh,
    matrix: Floats,
    hit: RayHit,
    text: str,
    color: tuple[float, float, float, float],
) -> None:
    point = surface_point(mesh.positions, mesh.triangles, hit)
    seen = view_frame(state).place(apply_transform(matrix, point[None])[0])
    if seen is None:
        return
    ink, rim = imgui.get_background_draw_list(), imgui.get_color_u32(_RIM)
    ink.add_circle_filled(seen, _DOT + 1.5, rim)
    ink.add_circle_filled(seen, _DOT, imgui.get_color_u32(color))
    for shift, shade in ((1.0, rim), (0.0, imgui.get_color_u32(color))):
        ink.add_text((seen[0] + _DOT + 3.0 + shift, seen[1] - 16.0 + shift), shade, text)
