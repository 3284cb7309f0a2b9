"""The motion of one figure as tracks: joints as rotations, places and stretches for each frame.

A skinning matrix M moves the bind position b of its joint to p, rotates by R and stretches by a
symmetric S: M x = p + R S (x - b). Rounding errors of rotations are therefore relative to the joint
and do not add up along the skeleton, and places are those of the joints, which the page draws.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from viewer.data_classes import dataclass
from viewer.exporters.html.offsets import Fields, principal_fields
from viewer.exporters.html.packing import Packer
from viewer.progress import report
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.file_record import Json
from viewer.rigs.geometry.quaternion import align_signs
from viewer.rigs.kinematics import posed_skeleton
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.pose import Pose
from viewer.rigs.shape import pose_weights, rest_joints, shaped, shaped_skeleton, shaped_skin
from viewer.rigs.skin import Skin, bind_positions, owners
from viewer.rigs.skinning import Skinning
from viewer.rigs.skinning.dqs import split_palette

FINE = 2e-6
"""Step of rounded positions, relative to the figure's size: several such errors, and those of
float32, stay below 1e-5 of the size."""

_EQUAL = 1e-9  # relative difference of lengths that counts as none
_COARSE, _FINEST = 2.0**-10, 2.0**-22  # limits of the step of quaternions and stretches
_SCALE_STEP = 1e-7  # largest step of the scale of the whole figure


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """A figure in F poses."""

    rest: Figure
    """The figure in the shape of the first pose, whose joints the tracks move."""
    offsets: Fields | None
    """Displacements of its rest vertices, from those of ``rest`` without offsets; None without a
    mesh."""
    model: Floats
    """(F, 4). Translation and scale of the whole figure, after skinning."""
    rotations: Floats
    places: Floats
    stretches: Floats
    """(F, J, 4), (F, J, 3), (F, J, 6). R as quaternions, p, and the upper triangle of S."""
    joints: Floats
    """(F, N, 3). Places of the skeleton's joints."""


def tracks_of(figure: Figure, poses: Sequence[Pose | None], how: Skinning) -> Tracks:
    """Return the tracks of a figure in some poses; None is the pose of a file without joints."""
    weights = [figure.rest_shape_weights if pose is None else pose.shape_weights for pose in poses]
    rest = shaped(figure, weights[0])
    model = np.array([[0.0, 0.0, 0.0, 1.0]] * len(poses))
    skin, known = rest.skin, figure.skeleton
    n_bound = 0 if skin is None or known is None else skin.n_joints
    matrices = np.tile(np.eye(4), (len(poses), n_bound, 1, 1))
    joints = np.zeros((len(poses), 0 if known is None else known.n_joints, 3))
    for frame, pose in enumerate(poses):
        report(frame, len(poses), "frames")
        if pose is None:
            continue
        model[frame] = *pose.figure_translation, pose.figure_scale
        if known is None:
            continue
        posed = posed_skeleton(shaped_skeleton(figure, pose.shape_weights), pose)
        joints[frame] = posed.world[:, :3, 3]
        if n_bound:
            matrices[frame] = posed.palette(shaped_skin(figure, pose.shape_weights))
    binds = np.zeros((0, 3)) if skin is None or not n_bound else bind_positions(skin)
    flat = matrices.reshape(-1, 4, 4)
    duals, stretches = split_palette(flat, np.tile(binds, (len(poses), 1)))
    rotations = duals[:, :4].reshape(len(poses), n_bound, 4).copy()
    align_signs(rotations)
    places = np.einsum("fjab,jb->fja", matrices[..., :3, :3], binds) + matrices[..., :3, 3]
    upper = stretches[:, *np.triu_indices(3)].reshape(len(poses), n_bound, 6)
    fine = FINE * size_of(rest)
    offsets = None if figure.mesh is None else _offsets(figure, poses, weights, how, fine)
    return Tracks(rest, offsets, model, rotations, places, upper, joints)


def _offsets(
    figure: Figure,
    poses: Sequence[Pose | None],
    weights: Sequence[Floats],
    how: Skinning,
    tolerance: float,
) -> Fields:
    """Return how shapes and pose correctives displace the rest vertices in each pose."""
    mesh, blend = figure.require_mesh(), figure.blend_shapes
    columns, displacements = list[Floats](), list[Callable[[Floats], Floats]]()
    changes = np.stack(weights) - weights[0]
    if not changes.any() or blend is None:
        pass  # the shape is that of ``rest``
    elif blend.is_linear and blend.rules is None:
        columns.append(changes)
        displacements.append(blend.displacement)
    else:
        # The displacement of each shape that occurs: rules and shape spaces need not be linear.
        rows, row_of = np.unique(np.stack(weights), axis=0, return_inverse=True)
        shapes, used = np.stack([blend.displacement(row) for row in rows]), row_of.reshape(-1)
        shapes -= shapes[used[0]].copy()
        columns.append(np.eye(len(rows))[used])
        displacements.append(lambda some: np.einsum("s,sva->va", some, shapes))
    correctives, skeleton = figure.correctives, figure.skeleton
    if correctives is not None and skeleton is not None and how.correctives:
        found = [
            pose_weights(correctives, shaped_skeleton(figure, pose.shape_weights), pose)
            for pose in poses
            if pose is not None
        ]
        if len(found) == len(poses):
            columns.append(np.stack(found))
            displacements.append(correctives.displacement)
    if not columns:
        none = np.zeros((0, mesh.n_vertices, 3))
        return Fields(np.zeros((mesh.n_vertices, 3)), np.zeros((len(poses), 0)), none)
    edges = np.cumsum([each.shape[1] for each in columns])[:-1]

    def displacement(some: Floats) -> Floats:
        parts = zip(displacements, np.split(some, edges), strict=True)
        total: Floats = np.sum([displace(own) for displace, own in parts], axis=0)
        return total

    return principal_fields(np.concatenate(columns, axis=1), displacement, tolerance)


def size_of(figure: Figure) -> float:
    """Return the size of a figure, on which all steps depend; 1 for a point."""
    points = np.zeros((1, 3)) if figure.skeleton is None else rest_joints(figure)
    if figure.mesh is not None and figure.mesh.n_vertices:
        points = figure.mesh.positions
    return box_size(bounding_box(points)) or 1.0


def levers(skin: Skin, positions: Floats) -> Floats:
    """Return the distance from each joint to its farthest vertex, in the bind pose: (J,)."""
    apart = np.linalg.norm(positions[owners(skin)] - bind_positions(skin)[skin.joints], axis=1)
    farthest = np.zeros(skin.n_joints)
    np.maximum.at(farthest, skin.joints, np.where(skin.weights == 0.0, 0.0, apart))
    return farthest


def pack_tracks(tracks: Tracks, packer: Packer) -> Json:
    """Add the tracks to the file; return the members of the figure's ``motion``."""
    size = size_of(tracks.rest)
    fine = FINE * size
    n_frames, n_bound = tracks.rotations.shape[:2]
    # The scale moves the farthest joint most, and a small scale also needs small steps.
    reach = max(
        size, *(float(np.abs(each).max(initial=0.0)) for each in (tracks.places, tracks.joints))
    )
    seen = min(float(np.abs(tracks.model[:, 3]).max()), 1.0) or 1.0
    steps = [seen * fine] * 3 + [seen * min(_SCALE_STEP, fine / reach)]
    motion: Json = {"n": n_frames, "model": packer.add(tracks.model, steps)}
    skin, mesh = tracks.rest.skin, tracks.rest.mesh
    if n_bound and skin is not None:
        lever = np.full(n_bound, size) if mesh is None else levers(skin, mesh.positions)
        # An error d of a quaternion rotates by about 2 d, which moves a vertex by 2 d times its
        # distance from the joint.
        ratio = np.divide(fine, 2.0 * lever, out=np.ones(n_bound), where=lever > 0.0)
        step = np.clip(ratio, _FINEST, _COARSE)
        motion["rotations"] = packer.add(tracks.rotations, np.repeat(step, 4))
        motion["places"] = packer.add(tracks.places, fine)
        rigid = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 1.0])
        if np.abs(tracks.stretches - rigid).max() > _EQUAL:
            motion["stretches"] = packer.add(tracks.stretches, np.repeat(step, 6))
    n_joints = tracks.joints.shape[1]
    is_bound = tracks.joints.shape == tracks.places.shape
    if n_joints and not (is_bound and np.abs(tracks.joints - tracks.places).max() <= 0.5 * fine):
        motion["joints"] = packer.add(tracks.joints, fine)
    if tracks.offsets is not None and len(tracks.offsets.fields):
        fields = tracks.offsets.fields
        count = len(fields)
        largest = np.abs(fields).max(axis=(1, 2))
        # Errors of K fields add up at random, as the square root of K.
        motion["weights"] = packer.add(
            tracks.offsets.weights, np.minimum(fine / (np.sqrt(count) * largest), 0.01)
        )
        rows = np.moveaxis(fields, 0, 1).reshape(fields.shape[1], -1)
        motion["fields"] = packer.add(rows, fine / np.sqrt(count))
    return motion
