"""Bodies in many poses as plain arrays: joints, skinning matrices, rest mesh displacements.

With a palette M, a rest mesh v, blend shapes d and pose correctives p::

    v'_f = sum_j w_j M_fj [v + sum_s b_fs d_s + sum_p c_fp d_p, 1] + t_f

All arrays are float64, whether they come from a figure or from a file that was read back.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import quaternion_to_matrix
from viewer.rigs.geometry.transform import affine_matrices
from viewer.rigs.motion.evaluation import (
    Frames,
    frames_between,
    pose_of,
    world_frames,
)
from viewer.rigs.shape import joint_shifts
from viewer.rigs.skin import Skin, has_influence, owners, skin_from_entries, skin_rows
from viewer.rigs.skinning import Skinning, deform, skin_used
from viewer.rigs.skinning.lbs import move

Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """The pose-independent data of a body."""

    positions: Floats
    """(V, 3): rest mesh in the reference shape."""
    skin: Skin
    """Skin in which every vertex has an influence; the last joint is the whole figure."""
    shapes: Floats | None = None
    """(S, V, 3): blend shapes whose weights change over time."""
    correctives: Floats | None = None
    """(P, V, 3): pose correctives."""


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """The pose-dependent data of a body in F poses."""

    places: Floats
    """(F, J, 3): joint positions."""
    palette: Floats
    """Skinning matrices; the last one is that of the whole figure. Without a body, it is the only
    one."""
    shifts: Floats
    """(F, 3): translations added to the vertices after skinning, independent of weights."""
    weights: Floats
    """(F, S) or (1, S): weights of the blend shapes, relative to the reference shape."""
    corrective_weights: Floats
    """(F, P): weights of the correctives; no columns if there are none."""


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """One of two compared bodies."""

    body: Body | None
    """The body; None without a mesh."""
    poses: Callable[[Rows], Poses]
    """Function from frame indices to poses."""
    exact: Callable[[int], Floats] | None = None
    """Function from one frame index to its vertices (V, 3), if skinning is not linear."""


def figure_side(
    figure: Figure,
    frames: Frames,
    how: Skinning,
    reference: Floats,
    columns: Rows | None = None,
) -> Side:
    """Return an animated, unshaped figure as a side; ``columns`` are its changing blend shapes."""
    chosen = changing(frames, reference) if columns is None else columns
    body = None if figure.mesh is None else _body(figure, how, reference, chosen)
    corrects = body is not None and body.correctives is not None

    def poses(rows: Rows) -> Poses:
        part = frames_between(frames, rows)
        if body is None and figure.skeleton is not None:
            return bare_poses(world_frames(figure, part)[..., :3, 3], part)
        shifts = part.figure_translations
        world = np.zeros((len(rows), 0, 4, 4))
        if figure.skeleton is not None:
            world = world_frames(figure, replace(part, figure_translations=np.zeros_like(shifts)))
        weights = part.shape_weights[:, chosen] - reference[chosen]
        corrective_weights = np.zeros((len(rows), 0))
        if corrects:
            differences = quaternion_to_matrix(part.rotations[:, 1:]) - np.eye(3)
            corrective_weights = differences.reshape(len(rows), -1)
        matrices = world[:, :0] if body is None else _skinning(figure, part, world)
        palette = anchored(matrices, part.figure_scales)
        places = world[..., :3, 3] + shifts[:, None]
        return Poses(places, palette, shifts, weights, corrective_weights)

    def exact(row: int) -> Floats:
        return deform(figure, pose_of(figure, frames, row), how)[0]

    shapes = figure.blend_shapes
    is_linear = how.method == "lbs" or not figure.is_attached
    is_linear &= shapes is None or shapes.is_linear or len(chosen) == 0
    return Side(body, poses, None if is_linear or body is None else exact)


def linear_as_opened(how: Skinning) -> Skinning:
    """Return LBS of the figure as it was opened, the reference of motions without a mesh."""
    return replace(how.unreduced(), method="lbs")


def bare_poses(places: Floats, frames: Frames) -> Poses:
    """Return poses without a mesh: positions of joints (F, J, 3) in some frames."""
    palette = anchored(np.zeros((len(places), 0, 4, 4)), frames.figure_scales)
    none = np.zeros((len(places), 0))
    return Poses(places, palette, frames.figure_translations, none, none)


def changing(frames: Frames, still: Floats) -> Rows:
    """Return the blend shapes whose weights ever differ from the reference shape: indices."""
    return np.flatnonzero((frames.shape_weights != still).any(axis=0))


def anchored(palette: Floats, scales: Floats) -> Floats:
    """Return skinning matrices (F, J, 4, 4), followed by the matrix of the whole figure."""
    whole = affine_matrices(scales[:, None, None, None] * np.eye(3), np.zeros(3))
    return np.concatenate([palette, whole], axis=1)


def _body(figure: Figure, how: Skinning, still: Floats, columns: Rows) -> Body:
    mesh, shapes = figure.require_mesh(), figure.blend_shapes
    n_joints = 0 if figure.skeleton is None else figure.skeleton.n_joints
    positions = mesh.positions
    if shapes is not None and still.any():
        positions = positions + shapes.displacement(still)
    directions = None
    if shapes is not None and len(columns):
        directions = shapes.direction_values()[columns]
    correctives = None
    # Correctives with a special feature are not measured, because neither body has them.
    given = figure.correctives if how.correctives and figure.is_attached else None
    if given is not None and given.feature is None:
        correctives = given.values()
    skin = None if figure.skin is None else skin_used(figure.skin, how)
    return Body(
        positions,
        _held(skin if figure.is_attached else None, len(positions), n_joints),
        directions,
        correctives,
    )


def _held(skin: Skin | None, n_vertices: int, n_joints: int) -> Skin:
    """Return a skin in which vertices without influence follow the whole figure."""
    if skin is None:
        bound = np.tile(np.eye(4), (n_joints + 1, 1, 1))
        rows = np.arange(n_vertices, dtype=np.int32)
        return skin_from_entries(
            n_vertices, rows, np.full(n_vertices, n_joints), np.ones(n_vertices), bound
        )
    free = np.flatnonzero(~has_influence(skin)).astype(np.int32)
    return skin_from_entries(
        n_vertices,
        np.concatenate([owners(skin), free]),
        np.concatenate([skin.joints, np.full(len(free), n_joints)]),
        np.concatenate([skin.weights, np.ones(len(free))]),
        np.concatenate([skin.inverse_bind, np.eye(4)[None]]),
    )


def _skinning(figure: Figure, frames: Frames, world: Floats) -> Floats:
    """Return skinning matrices, with inverse bind matrices for the shapes of the frames."""
    if figure.skin is None or not figure.is_attached:
        return np.broadcast_to(np.eye(4), world.shape)
    bound = figure.skin.inverse_bind
    if not frames.shape_weights.any():
        return world @ bound
    moved = joint_shifts(figure, frames.shape_weights)
    bound = np.tile(bound, (len(moved), 1, 1, 1))
    bound[..., :3, 3] -= np.einsum("fjab,fjb->fja", bound[..., :3, :3], moved)
    return world @ bound


def body_rows(body: Body, rows: Ints) -> Body:
    """Return a body with a selection of its vertices, which may be repeated."""
    every = len(rows) == len(body.positions) and (rows == np.arange(len(rows))).all()
    if every:
        return body
    return Body(
        body.positions[rows],
        skin_rows(body.skin, rows),
        None if body.shapes is None else body.shapes[:, rows],
        None if body.correctives is None else body.correctives[:, rows],
    )


def poses_of(poses: Poses, rows: Rows) -> Poses:
    """Return a selection of the poses."""
    weights = poses.weights if len(poses.weights) == 1 else poses.weights[rows]
    return Poses(
        poses.places[rows],
        poses.palette[rows],
        poses.shifts[rows],
        weights,
        poses.corrective_weights[rows],
    )


def vertices(body: Body, poses: Poses) -> Floats:
    """Return the vertices of all poses: (F, V, 3)."""
    count, shape = len(poses.palette), body.positions.shape
    rest = np.broadcast_to(body.positions, (count, *shape))
    for directions, weights in (
        (body.shapes, poses.weights),
        (body.correctives, poses.corrective_weights),
    ):
        if directions is not None and weights.any():
            moved = weights @ directions.reshape(len(directions), -1)
            rest = rest + moved.reshape(-1, *shape)
    found = np.empty((count, *shape))
    for row in range(count):
        found[row] = move(rest[row], body.skin, poses.palette[row])[0] + poses.shifts[row]
    return found
