"""Placement of the template: aligned with the target, moved by hand, or next to it."""

from __future__ import annotations

from typing import Literal

import numpy as np

from viewer.app.core.state import AppState
from viewer.app.rigging.rigging import Placing, Rigging, Template, current_template, target_mesh
from viewer.autorig.alignment.similarity import Similarity
from viewer.autorig.alignment.surface_alignment import AlignmentSettings
from viewer.diagnostics import Diagnostic
from viewer.rendering.camera import camera_axes
from viewer.rendering.passes.ghost_pass import Ghost, GhostStyle
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import nearest_rotations
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.mesh import Mesh, bounding_box, box_size
from viewer.rigs.pose import placement_matrix, pose_key
from viewer.rigs.scene import Actor
from viewer.rigs.skinning import deform

# Messages about the fit of the template, which remain valid when it is moved.
_DONE = ("R003.pose", "R003.not-fitted")
_GAP = 1.25  # distance between target and template side by side, relative to their mean width


def target_place(actor: Actor) -> Floats:
    """Return the matrix that places an actor's mesh in the scene: (4, 4)."""
    return actor.placement @ placement_matrix(actor.own_pose) if actor.own_pose else actor.placement


def posed_template(view: Rigging, template: Template) -> Mesh:
    """Return the template's mesh in its current pose; cached until the pose changes."""
    key = (template.figure, pose_key(template.pose))
    if view.ghost_figure is None or view.ghost_key != key:
        positions, normals = deform(template.figure, template.pose)
        assert template.figure.mesh is not None  # templates have meshes
        mesh = Mesh(positions, normals, template.figure.mesh.triangles)
        view.ghost_key, view.ghost_figure = key, Figure(template.figure.name, mesh)
    mesh_now = view.ghost_figure.mesh
    assert mesh_now is not None  # the figure has a mesh
    return mesh_now


def box_fit(template: Mesh, target: Mesh) -> Similarity:
    """Return the similarity that aligns the centres and diagonals of two bounding boxes."""
    boxes = [bounding_box(mesh.positions[mesh.triangles.ravel()]) for mesh in (template, target)]
    scale = (box_size(boxes[1]) or 1.0) / (box_size(boxes[0]) or 1.0)
    shift = boxes[1].mean(axis=0) - scale * boxes[0].mean(axis=0)
    return Similarity(scale, np.eye(3), shift, np.ones(3))


def placing_now(state: AppState) -> Placing | None:
    """Return the template's placement; None if it belongs to another target or template."""
    rigging, template = state.of(Rigging), current_template(state)
    placing = rigging.placing
    if placing is None or template is None or rigging.target is None:
        return None
    mesh, figure = placing.meshes
    return placing if mesh is target_mesh(state) and figure is template.figure else None


def is_posed_since(state: AppState) -> bool:
    """Return whether the template's pose has changed since it was aligned with the target."""
    placing, template = placing_now(state), current_template(state)
    return placing is not None and template is not None and placing.pose != pose_key(template.pose)


def aligned_template(state: AppState) -> Template | None:
    """Return the template as fitted to the target; None if it has not been read yet."""
    placing, template = placing_now(state), current_template(state)
    if placing is None or template is None or placing.fitted is None or is_posed_since(state):
        return template
    return placing.fitted


def similarity_now(state: AppState, template: Template) -> Similarity:
    """Return the similarity that places the template, from bounding boxes until it is aligned."""
    placing = placing_now(state)
    if placing is not None:
        return placing.similarity
    return box_fit(posed_template(state.of(Rigging), template), target_mesh(state))


def as_similarity(matrix: Floats, like: Similarity | None = None) -> Similarity:
    """Return the similarity nearest to a matrix (4, 4); its scale is the axes' geometric mean."""
    linear = np.asarray(matrix, dtype=np.float64)[:3, :3]
    own = np.ones(3)
    if like is not None and not like.is_plain:
        own = np.linalg.norm(linear, axis=0)
        own = own / np.cbrt(np.prod(own))
    # The determinant of a scaled rotation s R is s^3. A float32 gizmo may leave a shear, which the
    # nearest rotation drops; a vanishing scale stays above 0.
    linear = linear / own
    scale = float(np.cbrt(max(np.linalg.det(linear), 1e-30)))
    rotation = np.asarray(nearest_rotations(linear / scale)[0], dtype=np.float64)
    shift = np.asarray(matrix, dtype=np.float64)[:3, 3]
    return Similarity(scale, rotation, shift, np.ones(3), own)


def move_by_hand(state: AppState, template: Template, similarity: Similarity) -> None:
    """Move the template; the error of the new placement is still unknown."""
    own, before = current_template(state), placing_now(state)
    assert own is not None  # only an existing template can be moved
    fitted: Template | None = None
    kept: tuple[Diagnostic, ...] = ()
    if before is not None and before.fitted is template:
        fitted, kept = template, tuple(line for line in before.lines if line.key in _DONE)
    state.of(Rigging).placing = Placing(
        similarity=similarity,
        alignment=None,
        settings=AlignmentSettings(matrix=similarity.matrix),
        fitted=fitted,
        lines=kept,
        meshes=(target_mesh(state), own.figure),
        pose=pose_key(own.pose),
    )


def set_aside(state: AppState) -> None:
    """Show the template to the right of the target, as seen from the camera."""
    view, template = state.of(Rigging), aligned_template(state)
    view.aside = np.zeros(3)
    if template is None or view.target is None:
        return
    mesh = posed_template(view, template)
    place = target_place(view.target)
    placed = place @ similarity_now(state, template).matrix
    right = camera_axes(state.camera)[0]
    spans = [
        np.ptp((mesh_.positions @ matrix[:3, :3].T) @ right)
        for mesh_, matrix in ((mesh, placed), (target_mesh(state), place))
    ]
    view.aside = _GAP * 0.5 * (spans[0] + spans[1]) * right


def ghost_of(state: AppState) -> Ghost | None:
    """Return the template to be drawn over the scene; None if it is hidden."""
    view, template = state.of(Rigging), aligned_template(state)
    if template is None or view.target is None or not template.figure.is_attached:
        return None
    style: Literal[""] | GhostStyle = ""
    if view.tool == "landmarks":
        style = "solid"
    elif view.tool or placing_now(state) is not None:
        style = view.ghost or ("wireframe" if view.tool else "")
    if not style:
        return None
    posed_template(view, template)
    figure, place, old = view.ghost_figure, ghost_place(state, template), view.shown
    assert figure is not None  # the template has just been posed
    if old is None or (old.figure, old.style) != (figure, style) or (old.placement != place).any():
        return Ghost(figure, place, style)
    return old


def ghost_place(state: AppState, template: Template) -> Floats:
    """Return the matrix that places the posed template in the scene: (4, 4)."""
    view = state.of(Rigging)
    assert view.target is not None  # checked by the callers
    matrix = target_place(view.target) @ similarity_now(state, template).matrix
    if view.tool == "landmarks":
        matrix = translation_matrix(view.aside) @ matrix
    return np.asarray(matrix)
