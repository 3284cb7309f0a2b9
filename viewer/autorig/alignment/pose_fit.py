"""Fitting of a template's pose and proportions to a target by joint rotations and limb scales.

Articulated iterative closest points (Pellegrini et al. 2008): vertices of the template are matched
with the target's surface, points of the target with the template's vertices, and every iteration
moves all joints simultaneously (``solve_step``). Corresponding points may be far apart at first, as
for lowered and outstretched arms, and come closer with every iteration.

One iteration solves a linear problem for joint rotations and limb scales. With x a vertex aligned
with the target, m the mean of all x, c_j a joint, w_vj the weight of vertex v, s_vj the sum of its
weights for joint j and all below it, and P_j, Q_j and R_j the projections onto the limb's axis and
the two axes across it::

    e_j = w_vj (x - c_j) + sum over joints k directly below j of s_vk (c_k - c_j)
    x'  = x + w x (x - m) + t + u (x - m) + sum_j s_vj w_j x (x - c_j)
            + sum_j (l_j P_j + g_j Q_j + h_j R_j) e_j

The rotations w_j, the growths l_j along and g_j and h_j across the limbs, and w, t and u of the
whole figure minimise the mean of::

    (n . (x' - q))^2    over pairs of a vertex and a point q of the target with the normal n
    f |x' - q|^2        over vertices and the target's points closest to them, in any direction

The second sum constrains the ends of limbs, which planes do not. Marks, vertices whose positions in
the target are known, add a third sum of |x' - q|^2. All lengths are divided by the target's size.
Small penalties on rotations and growths, per step and since the start, preserve what the surface
does not determine, such as the rotation of a limb about its own axis.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.autorig.alignment.icp import Side
from viewer.autorig.alignment.proportions import Limbs, limbs_of, resized
from viewer.autorig.alignment.similarity import Similarity
from viewer.data_classes import dataclass
from viewer.progress import offer, report_fraction
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import (
    matrix_to_euler,
    matrix_to_quaternion,
    quaternion_to_matrix,
    rotation_vector_to_matrix,
)
from viewer.rigs.geometry.samples import even_vertices
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.kinematics import skinning_matrices, world_matrices, world_rotations
from viewer.rigs.mesh import vertex_normals
from viewer.rigs.pose import Pose, dof_rotations, joint_rotations, placement_matrix, rotation_rows
from viewer.rigs.skeleton import Skeleton, clamp_dofs
from viewer.rigs.skinning.lbs import move

_ROUNDS = 32  # number of iterations
_MARK_ROUNDS = 24  # number of iterations of a fit to marks only
_NEARING = 16  # number of iterations over which the search radius shrinks
_VERTICES = 1500  # number of template vertices that are matched with the target
_FAR, _NEAR = 0.25, 0.03  # ratio of the search radius to the size, at the start and at the end
_SAME_WAY = 0.5  # cosine of 60 degrees between the normals of a pair
_STILL = 2e-3  # rotation in radians; iterations end when no joint rotates by more
_FEWEST = 50  # minimum number of pairs for fitting a pose
_SMALLEST, _LARGEST = np.log(0.2), np.log(5.0)  # limits of the logarithms of limb scales
_HOLD = 0.2  # f: weight of point-to-point relative to point-to-plane distances

# Penalties on the squares of total rotations (radians) and total growths (logarithms).
_ROTATED, _GROWN = 3e-6, 3e-5
# The former if there are marks: for bending, and for twisting a limb about its own axis.
_BENDING, _TWISTING = 3e-5, 1e-4
_NOW = 1e-5  # penalty on rotations and growths within one iteration
_WHOLE = 1e-7  # penalty on moving the whole figure, as a surface may slide along itself

# Maximum rotation of a joint per iteration for which the linearisation is valid, radians.
_MOST = 0.3
_GROWTH = 0.2  # maximum growth (logarithm) of the whole figure or a limb per iteration
_FIXED = 1e6  # penalty on fixed unknowns


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """A template fitted to a target."""

    figure: Figure
    """Figure with resized limbs."""
    pose: Pose
    """DOFs are within their limits; the joints' quaternions contain the remaining rotation."""
    similarity: Similarity
    """Map from the posed figure to the target."""
    rotated: Floats
    """(J, 3). Total rotation vectors of the joints, radians."""
    grown: Floats
    """(3, J). Logarithms of the scales along the limbs, their sides and the third axes."""

    @property
    def bend(self) -> float:
        """Root mean square rotation of the joints, radians."""
        return float(np.sqrt(np.mean(self.rotated**2)))


@dataclass(frozen=True, slots=True, eq=False)
class Marks:
    """Vertices of the template with known positions in the target."""

    vertices: Ints
    """(M,)."""
    targets: Floats
    """(M, 3)."""
    weights: Floats
    """(M,). Of the squared gaps, relative to their mean over the surfaces."""
    kept: Floats
    """(M,). Fractions of the weights that are left at the end of a fit to surfaces; 1 for
    landmarks."""

    def chosen(self, rows: Bools) -> Marks | None:
        """Return some of the marks, (M,) bool; None for none."""
        if not rows.any():
            return None
        return Marks(self.vertices[rows], self.targets[rows], self.weights[rows], self.kept[rows])


def start_of(template: Figure, pose: Pose, similarity: Similarity) -> Fitted:
    """Return the state before any fit."""
    n_joints = template.require_skeleton().n_joints
    zeros = np.zeros((n_joints, 3)), np.zeros((3, n_joints))
    return Fitted(template, pose.copy(), similarity, *zeros)


def fit_marks(template: Figure, start: Fitted, limbs: Limbs, marks: Marks, size: float) -> Fitted:
    """Rotate joints and scale limbs until marked vertices are at their positions."""
    parents = template.require_skeleton().parents
    state = start
    for _ in range(_MARK_ROUNDS):
        aligned = _aligned_template(state, limbs)
        total = (state.rotated - start.rotated, state.grown - start.grown)
        step = solve_step(aligned, limbs, parents, None, size, *total, True, marks)
        state = _moved(template, limbs, state, step)
        if np.abs(step.rotation_vectors).max(initial=0.0) < _STILL:
            break
    return state


def fit_pose(
    template: Figure,
    start: Fitted,
    far: Side,
    near: Side,
    scales: bool,
    marks: Marks | None = None,
    reach: float = _FAR,
    since: Fitted | None = None,
) -> Fitted:
    """Rotate a template's joints and scale its limbs, both sides alike, to match the target.

    ``reach``: search radius at the beginning over the size, smaller if the start is close.
    ``since``: the state in which nothing is rotated or grown yet, by default ``start``.
    """
    mesh, skeleton, _ = template.attached()
    limbs = limbs_of(template)
    chosen = even_vertices(mesh.positions, mesh.triangles, _VERTICES)
    state, since = start, since or start
    for number in range(_ROUNDS):
        report_fraction(number / _ROUNDS, "fitting pose and proportions")
        aligned = _aligned_template(state, limbs)
        offer(FittedJoints(aligned.joints, skeleton.parents))
        late = min(number / _NEARING, 1.0)
        target = far if late < 1.0 else near
        pairs = _pairs(aligned, chosen, target, target.size * reach * (_NEAR / reach) ** late)
        if len(pairs.vertices) < _FEWEST:
            break
        parents, size = skeleton.parents, target.size
        total = (state.rotated - since.rotated, state.grown - since.grown)
        faded = marks and replace(marks, weights=marks.weights * marks.kept**late)
        step = solve_step(aligned, limbs, parents, pairs, size, *total, scales, faded)
        state = _moved(template, limbs, state, step)
        if late == 1.0 and np.abs(step.rotation_vectors).max(initial=0.0) < _STILL:
            break
    return state


def _aligned_template(state: Fitted, limbs: Limbs) -> AlignedTemplate:
    mesh, skeleton, skin = state.figure.attached()
    world = world_matrices(skeleton, state.pose)
    palette = skinning_matrices(world, skin.inverse_bind)
    place = placement_matrix(state.pose)
    posed = move(mesh.positions, skin, palette)[0]
    positions = state.similarity.apply(apply_transform(place, posed))
    joints = state.similarity.apply(apply_transform(place, world[:, :3, 3]))
    axes, sides = (
        unit(np.einsum("jab,jb->ja", palette[:, :3, :3], own)) @ state.similarity.rotation.T
        for own in (limbs.axes, limbs.sides)
    )
    normals = vertex_normals(positions, mesh.triangles)
    return AlignedTemplate(positions, normals, joints, axes, sides)


def _pairs(aligned: AlignedTemplate, chosen: Ints, target: Side, reach: float) -> Pairs:
    """Match in both directions; distant points and those on the border of a hole are ignored."""
    points = aligned.positions[chosen]
    found = target.find(points)
    near = found.usable & (np.linalg.norm(found.positions - points, axis=1) <= reach)
    facing = np.einsum("na,na->n", found.normals, aligned.normals[chosen]) >= _SAME_WAY
    asked = target.samples
    from scipy import spatial

    # Marks inside the template have no normal.
    surface = np.flatnonzero(aligned.normals.any(axis=1)).astype(np.int32)
    distances, nearest = spatial.cKDTree(aligned.positions[surface]).query(asked.positions)
    nearest = surface[nearest]
    same_way = np.einsum("na,na->n", asked.normals, aligned.normals[nearest]) >= _SAME_WAY
    towards = (distances <= reach) & same_way
    away = near & facing
    return Pairs(
        np.concatenate([chosen[away], nearest[towards]]),
        np.concatenate([found.positions[away], asked.positions[towards]]),
        np.concatenate([found.normals[away], asked.normals[towards]]),
        chosen[near],
        found.positions[near],
    )


def _moved(template: Figure, limbs: Limbs, state: Fitted, step: PoseStep) -> Fitted:
    """Return the state after an iteration. The whole figure moves by x' = e^u R (x - m) + m + t."""
    similarity, skeleton = state.similarity, state.figure.require_skeleton()
    growths = state.grown + step.limb_growths
    growths = np.clip(0.5 * (growths + growths[:, limbs.partners]), _SMALLEST, _LARGEST)
    pose = state.pose.copy()
    _rotate_joints(skeleton, pose, similarity, step.rotation_vectors)
    figure = resized(template, limbs, *np.exp(growths))
    rotation, growth = rotation_vector_to_matrix(step.rotation), float(np.exp(step.growth))
    shift = growth * rotation @ (similarity.shift - step.middle) + step.middle + step.shift
    moved = Similarity(
        growth * similarity.scale, rotation @ similarity.rotation, shift, similarity.factors
    )
    return Fitted(figure, pose, moved, state.rotated + step.rotation_vectors, growths)


def _rotate_joints(
    skeleton: Skeleton, pose: Pose, similarity: Similarity, rotations: Floats
) -> None:
    """Rotate joints by rotation vectors in the target's frame, in place."""
    parents = skeleton.parents
    within = joint_rotations(skeleton, pose)
    world = world_rotations(parents, within)
    below = np.flatnonzero(parents >= 0).astype(np.int32)
    # A joint whose parent has the axes P in the figure, which the alignment rotated by A, is
    # rotated by the vector (A P)^T w within its parent.
    axes = similarity.rotation @ world[parents[below]]
    local = np.einsum("jba,jb->ja", axes, rotations[below])
    turned = rotation_vector_to_matrix(local) @ within[below]
    # DOFs take what their limits allow, and quaternions the remainder.
    rows = rotation_rows(skeleton)[below]
    ball = rows[:, 0] >= 0
    base = quaternion_to_matrix(skeleton.rest_rotations[below[ball]])
    pose.dofs[rows[ball]] = matrix_to_euler(np.swapaxes(base, 1, 2) @ turned[ball])
    pose.dofs[:] = clamp_dofs(skeleton, pose.dofs)
    held = dof_rotations(skeleton, pose.dofs)[below]
    pose.rotations[below] = matrix_to_quaternion(turned @ np.swapaxes(held, 1, 2))


@dataclass(frozen=True, slots=True, eq=False)
class AlignedTemplate:
    """A template's vertices and joints in the target's frame."""

    positions: Floats
    normals: Floats
    """(V, 3). Vertices of the template."""
    joints: Floats
    axes: Floats
    sides: Floats
    """(J, 3). Joints of the template, and unit vectors along and across their limbs."""


@dataclass(frozen=True, slots=True, eq=False)
class FittedJoints:
    """Joints of a template that is being fitted: an intermediate result."""

    places: Floats
    """(J, 3). In the target's frame."""
    parents: Ints
    is_chosen: bool = False
    """Whether this is the fit that is kept; others are tried, and may be far from the target."""


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Corresponding vertices of the template and points of the target."""

    vertices: Ints
    """(N,). Vertices of the template, matched with points that face the same way."""
    targets: Floats
    normals: Floats
    """(N, 3). Points of the target and the normals there."""
    ends: Ints
    """(M,). Vertices of the template, regardless of their orientation."""
    end_targets: Floats
    """(M, 3). The points of the target closest to them."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseStep:
    """Result of an iteration, in the target's frame."""

    middle: Floats
    """(3,). Centre of the whole figure's rotation and scaling."""
    rotation: Floats
    shift: Floats
    """(3,). Rotation vector and shift of the whole figure; the shift in the target's unit."""
    growth: float
    """Logarithm of the whole figure's scale."""
    rotation_vectors: Floats
    """(J, 3). Rotation vectors of the joints; 0 for roots, which rotate with the whole figure."""
    limb_growths: Floats
    """(3, J). Logarithms of the limbs' scales, as in ``Fitted.grown``."""


@dataclass(frozen=True, slots=True, eq=False)
class _Frame:
    """Quantities from which the columns of the linear problem are built."""

    middle: Floats
    size: float
    aligned: AlignedTemplate
    limbs: Limbs
    parents: Ints


def solve_step(
    aligned: AlignedTemplate,
    limbs: Limbs,
    parents: Ints,
    pairs: Pairs | None,
    size: float,
    rotated: Floats,
    grown: Floats,
    scales: bool,
    marks: Marks | None = None,
) -> PoseStep:
    """Solve the linear problem above after rotations (J, 3) and growths (3, J) in total.

    Without ``pairs``, only the marks count.
    """
    n_joints = len(parents)
    below = np.flatnonzero(parents >= 0)
    known = pairs.vertices if pairs is not None else marks.vertices if marks is not None else None
    assert known is not None  # one of them is given
    middle = aligned.positions[known].mean(axis=0)
    frame = _Frame(middle, size, aligned, limbs, parents)
    count = 7 + 3 * len(below) + 3 * n_joints
    matrix, right = np.zeros((count, count)), np.zeros(count)
    if pairs is not None:
        matrix, right = _equations(frame, pairs.vertices, pairs.targets, pairs.normals)
        for axis in np.eye(3):
            normals = np.broadcast_to(axis, pairs.end_targets.shape)
            more, values = _equations(frame, pairs.ends, pairs.end_targets, normals)
            matrix += _HOLD * more
            right += _HOLD * values
        matrix, right = matrix / len(pairs.vertices), right / len(pairs.vertices)
    if marks is not None:
        for axis in np.eye(3):
            normals = np.broadcast_to(axis, marks.targets.shape)
            more, values = _equations(
                frame, marks.vertices, marks.targets, normals, np.sqrt(marks.weights)
            )
            matrix += more
            right += values
    # Marks along a limb leave its rotation about its own axis to chance, as a round head does.
    both = (_ROTATED, _ROTATED) if marks is None else (_BENDING, _TWISTING)
    penalty = _penalties(aligned.axes[below], n_joints, *both)
    right[7:] -= penalty @ np.concatenate([rotated[below].ravel(), grown.ravel()])
    matrix[7:, 7:] += penalty
    now = np.full(len(right), _NOW)
    now[:7] = _WHOLE
    if not scales:
        now[6], now[-3 * n_joints :] = _FIXED, _FIXED
    solved = np.asarray(np.linalg.solve(matrix + np.diag(now), right), dtype=np.float64)
    rotations = np.zeros((n_joints, 3))
    rotations[below] = solved[7 : 7 + 3 * len(below)].reshape(-1, 3)
    # The linearisation holds for small steps only, so larger ones are cut; the next iteration goes
    # on.
    angles = np.linalg.norm(rotations, axis=1, keepdims=True)
    rotations = rotations * (_MOST / np.maximum(angles, _MOST))
    growths = np.clip(solved[-3 * n_joints :].reshape(3, -1), -_GROWTH, _GROWTH)
    growth = min(max(float(solved[6]), -_GROWTH), _GROWTH)
    return PoseStep(middle, solved[:3], size * solved[3:6], growth, rotations, growths)


def _penalties(axes: Floats, n_joints: int, bending: float, twisting: float) -> Floats:
    """Return the penalties on all rotations and growths as a quadratic form.

    ``axes``: unit vectors along the limbs of the rotating joints, (R, 3).
    """
    count = len(axes)
    penalties = np.diag(np.repeat([bending, _GROWN], [3 * count, 3 * n_joints]))
    # b |w|^2 + (t - b) (a . w)^2 for a rotation w of the limb with the axis a.
    own = (twisting - bending) * np.einsum("ja,jb->jab", axes, axes)
    for joint, block in enumerate(own):
        penalties[3 * joint : 3 * joint + 3, 3 * joint : 3 * joint + 3] += block
    # sum_j (g_j^2 + h_j^2) - (sum_j (g_j + h_j))^2 / 2J: only deviations from the mean girth are
    # penalised. All limbs become thicker under clothes; otherwise the figure as a whole would grow
    # instead, and extend beyond the target.
    penalties[-2 * n_joints :, -2 * n_joints :] -= _GROWN / (2 * n_joints)
    return penalties


def _equations(
    frame: _Frame,
    vertices: Ints,
    targets: Floats,
    normals: Floats,
    weights: Floats | None = None,
) -> tuple[Floats, Floats]:
    """Return the normal equations of n . (x' - q) = 0, with columns in the above order.

    ``weights``: (N,), factors of the equations.
    """
    x = frame.aligned.positions[vertices]
    count = len(x)
    arms = (x - frame.middle) / frame.size
    spokes = (x[:, None] - frame.aligned.joints) / frame.size
    below = np.flatnonzero(frame.parents >= 0)
    # n . (w x a) = w . (a x n)
    rotating = _cross(spokes[:, below], normals[:, None])
    rotating *= frame.limbs.fractions[vertices][:, below, None]
    reach = _reach(frame, vertices, spokes)
    across = np.einsum("na,nja->nj", normals, reach)
    along, wide = (
        np.einsum("nja,ja->nj", reach, axes) * (normals @ axes.T)
        for axes in (frame.aligned.axes, frame.aligned.sides)
    )
    grow = np.einsum("na,na->n", normals, arms)[:, None]
    rows = np.concatenate(
        [
            *(_cross(arms, normals), normals, grow, rotating.reshape(count, -1)),
            *(along, wide, across - along - wide),
        ],
        axis=1,
    )
    gaps = np.einsum("na,na->n", normals, targets - x) / frame.size
    if weights is not None:
        rows, gaps = rows * weights[:, None], gaps * weights
    return rows.T @ rows, rows.T @ gaps


def _reach(frame: _Frame, vertices: Ints, spokes: Floats) -> Floats:
    """Return e_j above, over the size: (N, J, 3)."""
    reach = frame.limbs.weights[vertices][:, :, None] * spokes
    fractions, joints = frame.limbs.fractions[vertices], frame.aligned.joints
    for joint in np.flatnonzero(frame.parents >= 0).tolist():
        parent = frame.parents[joint]
        step = (joints[joint] - joints[parent]) / frame.size
        reach[:, parent] += fractions[:, joint, None] * step
    return reach


def _cross(a: Floats, b: Floats) -> Floats:
    """Return a x b (..., 3); ``numpy.cross`` takes three times as long on arrays this large."""
    result = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        result[..., axis] = a[..., i] * b[..., j] - a[..., j] * b[..., i]
    return result
