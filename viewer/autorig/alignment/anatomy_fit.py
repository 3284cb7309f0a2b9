"""Starts of a fit from anatomy: the template's limbs are put where the target's limbs are.

A search for the similarity that aligns two surfaces fails if the proportions differ: a figure with
a large head fits another one best upside down. The points of the anatomy (``body_points``) of
template and target correspond to each other, whatever the proportions. They become vertices of the
template, with the weights of the surface around them, and the fit of pose and proportions starts by
moving them to their counterparts. The radii there give the girths of the limbs.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.autorig.alignment.orientation_search import axis_direction, stated_front
from viewer.autorig.alignment.pose_fit import (
    Fitted,
    Marks,
    fit_marks,
    start_of,
)
from viewer.autorig.alignment.proportions import Limbs, limbs_of, resized
from viewer.autorig.alignment.similarity import Similarity
from viewer.autorig.anatomy import (
    Anatomy,
    BodyPoints,
    LimbPair,
    Plan,
    anatomy_of,
    body_points,
    feet_ahead,
    plans_of,
)
from viewer.data_classes import dataclass
from viewer.progress import report_fraction
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import nearest_rotations
from viewer.rigs.inspection.front import clear_front
from viewer.rigs.kinematics import skinning_matrices, world_matrices, world_rotations
from viewer.rigs.mesh import Mesh
from viewer.rigs.pose import Pose, joint_rotations, placement_matrix, set_joint_rotations
from viewer.rigs.retargeting.mirror import mirror_axis
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skin import owners, skin_from_entries, weight_sums
from viewer.rigs.skinning import deform

NO_LANDMARKS = np.zeros((0, 2, 3))
"""Pairs of points of template and target, (N, 2, 3)."""
_AROUND = 1.3  # vertices around a point, up to this multiple of the distance from the surface
_FEWEST = 8  # minimum number of vertices whose weights a point gets
# Weights of the marks when nothing else is fitted: their sum, and that of each landmark.
_ALL_MARKS, _LANDMARK = 1.0, 0.5
FADED = 0.1
"""Fraction of the weight of a point of the anatomy at the end of a fit to surfaces."""
_USUAL_FRONT = np.array([0.0, 0.0, 1.0])
_SURE_FEET = 0.03  # reach of feet over the height, above which it decides the facing
_GIRTHS = (np.log(0.25), np.log(4.0))  # limits of the logarithms of girths
_THINNEST = 0.5  # radius in voxels below which girths are not estimated from it


@dataclass(frozen=True, slots=True, eq=False)
class TemplateBody:
    """A template with its anatomy."""

    figure: Figure
    pose: Pose
    positions: Floats
    """(V, 3). Posed vertices."""
    anatomy: Anatomy
    points: BodyPoints
    is_quadruped: bool
    left: Floats
    """(3,). Unit vector to its left."""


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """A template whose limbs are at those of a target."""

    marked: Figure
    """The template, with marks as additional vertices."""
    fitted: Fitted
    marks: Marks
    plan: Plan
    legs: tuple[LimbPair, ...]
    """The target's pairs of limbs that stand on the ground."""
    is_sure: bool
    """Whether the facing is known: given, or shown by the feet."""
    is_usual: bool
    """Whether it faces as glTF prescribes: +z, if y is up."""
    error: float
    """Root mean square distance of the marks from their positions, over the target's size."""


def template_body(figure: Figure, pose: Pose, positions: Floats) -> TemplateBody | None:
    """Return the anatomy of a posed template; None if it lacks two pairs of limbs."""
    mesh = figure.require_mesh()
    up, left = axis_direction(figure.up), left_of(figure, pose)
    front = np.cross(left, up)
    anatomy = anatomy_of(positions, mesh.triangles, up, left)
    standing = [pair for pair in anatomy.pairs[:2] if anatomy.stands(pair)]
    is_quadruped = len(standing) == 2
    plans = plans_of(anatomy, is_quadruped, front)
    if not plans:
        return None
    points = body_points(anatomy, plans[0], is_quadruped)
    return TemplateBody(figure, pose, positions, anatomy, points, is_quadruped, left)


def straightened(figure: Figure, pose: Pose) -> Pose:
    """Return a pose whose joints above pairs bend in the mirror plane of the bind pose only.

    They decide on which side limbs and ears are. All others, such as limbs and the tail, keep their
    rotations relative to their parents.
    """
    _, skeleton, skin = figure.attached()
    parents, partners = skeleton.parents, limbs_of(figure).partners
    numbers = np.arange(skeleton.n_joints, dtype=np.int32)
    carries = np.zeros(skeleton.n_joints, dtype=bool)
    for joint in range(skeleton.n_joints - 1, 0, -1):
        # Children come after their parents.
        if parents[joint] >= 0:
            carries[parents[joint]] |= partners[joint] != joint or carries[joint]
    carries &= partners == numbers
    local = joint_rotations(skeleton, pose)
    posed = world_rotations(parents, local)
    bind = np.asarray(np.linalg.inv(skin.inverse_bind), dtype=np.float64)
    bound = nearest_rotations(bind[:, :3, :3])[0]
    # A joint rotated by D since the bind pose, in the axes of its root's, is rotated by F D F in
    # the mirrored pose, with the reflection F. The mean of both has no twist and no sideways bend.
    flip = np.where(np.arange(3) == mirror_axis(figure), -1.0, 1.0)
    turned, straight = posed @ np.swapaxes(bound, 1, 2), posed.copy()
    roots = numbers.copy()
    for joint in np.flatnonzero(parents >= 0).tolist():
        parent = parents[joint]
        roots[joint] = roots[parent]
        if carries[joint]:
            root = turned[roots[joint]]
            own = root.T @ turned[joint]
            mean = nearest_rotations(own + flip[:, None] * own * flip)[0]
            straight[joint] = root @ mean @ bound[joint]
        else:
            straight[joint] = straight[parent] @ local[joint]
        local[joint] = straight[parent].T @ straight[joint]
    found = pose.copy()
    set_joint_rotations(skeleton, found, numbers, local)
    return found


def left_of(figure: Figure, pose: Pose) -> Floats:
    """Return the unit vector to the left of a posed template: (3,)."""
    # Figures of VRM 0 face -z, those of Blender -y; their joints' names say so.
    front = clear_front(Scene([Actor(figure, pose)], world_up=figure.up))
    return np.cross(axis_direction(figure.up), axis_direction(front or stated_front(figure.up)))


def starts_of(
    body: TemplateBody, target: Anatomy, front: Floats | None, landmarks: Floats = NO_LANDMARKS
) -> list[Start]:
    """Return a start for each likely plan of the target, the one with the least error first.

    ``landmarks``: (N, 2, 3), points of the template and of the target that coincide.
    """
    plans = plans_of(target, body.is_quadruped, front)
    found = []
    for number, plan in enumerate(plans):
        report_fraction(number / len(plans), "fitting limbs")
        # Feet point to the front; stumps and hooves say little.
        feet = feet_ahead(target, plan, body.is_quadruped)
        if front is not None or feet >= -_SURE_FEET:
            is_sure = front is not None or feet > _SURE_FEET
            found.append(_start(body, target, plan, is_sure, landmarks))
    return sorted(found, key=lambda start: start.error)


def _start(
    body: TemplateBody, target: Anatomy, plan: Plan, is_sure: bool, landmarks: Floats
) -> Start:
    points = body_points(target, plan, body.is_quadruped)
    own = body.points
    common = np.isfinite(own.positions).all(axis=1) & np.isfinite(points.positions).all(axis=1)
    ours, theirs = own.positions[common], points.positions[common]
    weights = np.minimum(own.weights, points.weights)[common]
    similarity = _similarity(body, target, plan, ours, theirs, weights)
    size, count = target.size, len(ours)
    reach = np.zeros(count + len(landmarks))
    reach[:count] = _AROUND * own.radii[common] + body.anatomy.solid.spacing
    marked, vertices = with_marks(
        body.figure, body.pose, body.positions, np.concatenate([ours, landmarks[:, 0]]), reach
    )
    shares = _ALL_MARKS * weights / weights.sum()
    marks = Marks(
        vertices,
        np.concatenate([theirs, landmarks[:, 1]]),
        np.concatenate([shares, np.full(len(landmarks), _LANDMARK)]),
        np.repeat([FADED, 1.0], [count, len(landmarks)]),
    )
    few, limbs = _only(marked, limbs_of(marked), vertices)
    alone = replace(marks, vertices=np.arange(len(vertices), dtype=np.int32))
    fitted = fit_marks(few, start_of(few, body.pose, similarity), limbs, alone, size)
    thin = _THINNEST * np.array([body.anatomy.solid.spacing, target.solid.spacing])
    ratios = np.log(
        np.maximum(points.radii[common], thin[1]) / np.maximum(own.radii[common], thin[0])
    ) - np.log(fitted.similarity.scale)
    # Landmarks have no radius.
    seen = replace(limbs, weights=limbs.weights[:count])
    girths = _girths(marked, seen, ratios)
    grown = np.stack([fitted.grown[0], girths, girths])
    fitted = replace(fitted, grown=grown, figure=resized(few, limbs, *np.exp(grown)))
    # Thicker limbs move the points near their ends a little.
    fitted = fit_marks(few, fitted, limbs, alone, size)
    error = _error(fitted, alone, size)
    whole = resized(marked, limbs_of(marked), *np.exp(fitted.grown))
    ahead = np.cross(plan.left, target.up)
    is_usual = bool(ahead @ _USUAL_FRONT > 0.5)
    legs = (plan.lower, plan.upper) if body.is_quadruped else (plan.lower,)
    fitted = replace(fitted, figure=whole)
    return Start(marked, fitted, marks, plan, legs, is_sure, is_usual, error)


def _only(figure: Figure, limbs: Limbs, vertices: Ints) -> tuple[Figure, Limbs]:
    """Return a figure with some of its vertices and no triangles, and the limbs of these."""
    mesh, _, skin = figure.attached()
    rows, columns = np.nonzero(limbs.weights[vertices])
    few = skin_from_entries(
        len(vertices),
        rows.astype(np.int32),
        columns.astype(np.int32),
        limbs.weights[vertices][rows, columns],
        skin.inverse_bind,
    )
    none = np.zeros((0, 3), dtype=np.int32)
    points = Mesh(mesh.positions[vertices], mesh.normals[vertices], none)
    kept = replace(limbs, weights=limbs.weights[vertices], fractions=limbs.fractions[vertices])
    return replace(figure, mesh=points, skin=few), kept


def _similarity(
    body: TemplateBody,
    target: Anatomy,
    plan: Plan,
    ours: Floats,
    theirs: Floats,
    weights: Floats,
) -> Similarity:
    """Return the map of the template's axes to the target's, with mean position and scale."""
    own_up = axis_direction(body.figure.up)
    own = np.stack([body.left, own_up, np.cross(body.left, own_up)], axis=1)
    other = np.stack([plan.left, target.up, np.cross(plan.left, target.up)], axis=1)
    rotation = other @ own.T
    share = weights / weights.sum()
    from_mean, to_mean = share @ ours, share @ theirs
    spreads = [
        float(np.sqrt(share @ ((points - mean) ** 2).sum(axis=1)))
        for points, mean in ((ours, from_mean), (theirs, to_mean))
    ]
    scale = spreads[1] / spreads[0]
    return Similarity(scale, rotation, to_mean - scale * rotation @ from_mean, np.ones(3))


def start_of_landmarks(
    figure: Figure, pose: Pose, positions: Floats, landmarks: Floats, similarity: Similarity
) -> tuple[Figure, Fitted, Marks]:
    """Return a template with landmarks (N, 2, 3) as marks, and fitted to them.

    ``positions``: (V, 3), its posed vertices; ``similarity``: fitted to the landmarks.
    """
    points, targets = landmarks[:, 0], landmarks[:, 1]
    marked, vertices = with_marks(figure, pose, positions, points, np.zeros(len(points)))
    marks = Marks(vertices, targets, np.full(len(points), _LANDMARK), np.ones(len(points)))
    few, limbs = _only(marked, limbs_of(marked), vertices)
    alone = replace(marks, vertices=np.arange(len(vertices), dtype=np.int32))
    size = similarity.scale * float(np.ptp(positions, axis=0).max())
    fitted = fit_marks(few, start_of(few, pose, similarity), limbs, alone, size)
    whole = resized(marked, limbs_of(marked), *np.exp(fitted.grown))
    return marked, replace(fitted, figure=whole), marks


def with_marks(
    figure: Figure, pose: Pose, positions: Floats, points: Floats, reach: Floats
) -> tuple[Figure, Ints]:
    """Return a template with points (P, 3) of its posed body as vertices, and their numbers.

    ``positions``: (V, 3), the posed vertices. Each point gets the mean weights of the vertices
    within its ``reach`` (P,), in the figure's unit; a point at a joint is attached to that joint.
    """
    from scipy import spatial

    mesh, skeleton, skin = figure.attached()
    world = placement_matrix(pose) @ world_matrices(skeleton, pose)
    palette, joints = skinning_matrices(world, skin.inverse_bind), world[:, :3, 3]
    used = np.unique(mesh.triangles)
    tree = spatial.cKDTree(positions[used])
    size = float(np.ptp(positions[used], axis=0).max())
    of, sums = owners(skin), weight_sums(skin)
    shares = skin.weights / np.where(sums > 0.0, sums, 1.0)[of]
    table = np.zeros((len(points), skin.n_joints))
    for row, (point, radius) in enumerate(zip(points, reach.tolist(), strict=True)):
        at = np.linalg.norm(joints - point, axis=1)
        if at.min() <= 1e-6 * size:
            table[row, int(at.argmin())] = 1.0
            continue
        near = tree.query_ball_point(point, radius)
        if len(near) < _FEWEST:
            near = tree.query(point, k=min(_FEWEST, len(used)))[1]
        chosen = np.isin(of, used[np.atleast_1d(near)])
        table[row] = np.bincount(skin.joints[chosen], shares[chosen], minlength=skin.n_joints)
        table[row] /= max(float(table[row].sum()), 1e-12)
    # In the bind pose, the point is where its blended matrix poses it to the given position.
    blended = np.einsum("pj,jab->pab", table, palette)
    rest = np.linalg.solve(blended[:, :3, :3], (points - blended[:, :3, 3])[..., None])[..., 0]
    count = len(mesh.positions)
    rows, columns = np.nonzero(table)
    grown = skin_from_entries(
        count + len(points),
        np.concatenate([of, rows + count]),
        np.concatenate([skin.joints, columns]),
        np.concatenate([skin.weights, table[rows, columns]]),
        skin.inverse_bind,
    )
    vertices = np.concatenate([mesh.positions, rest])
    normals = np.concatenate([mesh.normals, np.zeros_like(rest)])
    marked = Mesh(vertices, normals, mesh.triangles)
    plain = Figure(figure.name, marked, skeleton, grown, up=figure.up)
    return plain, np.arange(count, count + len(points), dtype=np.int32)


def _girths(figure: Figure, limbs: Limbs, ratios: Floats) -> Floats:
    """Return each joint's girth (J,): the mean over its marks, or that of its parent."""
    parents = figure.require_skeleton().parents
    weights = limbs.weights
    total = weights.sum(axis=0)
    means = weights.T @ ratios / np.maximum(total, 1e-12)
    overall = float(np.median(ratios))
    girths = np.where(total > 0.2, means, np.nan)
    for joint in range(len(parents)):
        if np.isnan(girths[joint]):
            girths[joint] = girths[parents[joint]] if parents[joint] >= 0 else overall
    return np.clip(0.5 * (girths + girths[limbs.partners]), *_GIRTHS)


def _error(fitted: Fitted, marks: Marks, size: float) -> float:
    posed = fitted.similarity.apply(deform(fitted.figure, fitted.pose)[0])
    gaps = posed[marks.vertices] - marks.targets
    squares = np.einsum("na,na->n", gaps, gaps)
    return float(np.sqrt(marks.weights @ squares / marks.weights.sum())) / size
