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
from viewer.exporters.html.packing import Packer, earlier_corners
from viewer.progress import report
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.blendshapes import BlendShapes
from viewer.rigs.figure import Figure
from viewer.rigs.file_record import Json
from viewer.rigs.geometry.quaternion import align_signs
from viewer.rigs.geometry.rotation import matrix_to_quaternion
from viewer.rigs.kinematics import posed_skeleton
from viewer.rigs.material import Material
from viewer.rigs.mesh import Mesh, bounding_box, box_size
from viewer.rigs.pose import Pose
from viewer.rigs.shape import pose_weights, rest_joints, shaped, shaped_skeleton, shaped_skin
from viewer.rigs.skeleton import FIRST_ROTATION
from viewer.rigs.skin import Skin, bind_positions, owners
from viewer.rigs.skinning import Skinning
from viewer.rigs.skinning.dqs import split_palette

FINE = 2e-6
"""Step of rounded positions, relative to the figure's size: several such errors, and those of
float32, stay below 1e-5 of the size."""

_EQUAL = 1e-9  # relative difference of lengths that counts as none
_NORMAL_TOLERANCE = 2e-3  # of unit normals: 0.1 degrees
_COARSEST_WEIGHT = 0.01
_DEVIATIONS = 5.0
_SHARE_OF_FIELDS = 2.0  # in FINE: errors of displacements beside those of joints
_MOST_NUMBERS = 30_000_000  # of a model's correctives that are compared with principal fields
_COARSE, _FINEST = 2.0**-10, 2.0**-22  # limits of the step of quaternions and stretches
_RIGID = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 1.0])  # stretch of a joint that does not scale
_EVEN = 1e-4  # relative difference of scales, beyond the rounding of single-precision files
_SCALE_STEP = 1e-7  # largest step of the scale of the whole figure


@dataclass(frozen=True, slots=True, eq=False)
class RestSurface:
    """The rest vertices of a figure in F poses, and their normals."""

    shapes: Fields
    correctives: Fields
    """Displacements of the vertices by changing blend shapes, and by pose correctives."""
    normals: Floats
    """(V, 3). Rest normals of the frames that do not compute them from the changed surface."""
    normal_fields: Fields
    """Their displacements, if the blend shapes specify them."""
    recomputed: Bools
    """(F,). Whether a frame computes its rest normals from the surface without correctives."""

    @property
    def mean(self) -> Floats:
        """Mean displacement (V, 3) of the vertices."""
        return self.shapes.mean + self.correctives.mean


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """A figure in F poses."""

    rest: Figure
    """The figure in the shape of the first pose, whose joints the tracks move."""
    surface: RestSurface | None
    """The surface that the joints move; None without a mesh."""
    looks: dict[int, list[Material]]
    """The materials of all frames, by their index, for those that blend shapes may change."""
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
    surface = None if figure.mesh is None else _surface(figure, poses, weights, how)
    looks = _looks(figure, weights)
    return Tracks(rest, surface, looks, model, rotations, places, upper, joints)


def _surface(
    figure: Figure, poses: Sequence[Pose | None], weights: Sequence[Floats], how: Skinning
) -> RestSurface:
    """Return how blend shapes and pose correctives change the rest surface in each pose."""
    rest, blend = shaped(figure, weights[0]), figure.blend_shapes
    mesh, tolerance = rest.require_mesh(), FINE * size_of(rest)
    normals, recomputed = mesh.normals, np.zeros(len(poses), np.bool_)
    still = Fields(
        np.zeros((mesh.n_vertices, 3)),
        np.zeros((len(poses), 0)),
        np.zeros((0, mesh.n_vertices, 3)),
    )
    if blend is None or all(np.array_equal(row, weights[0]) for row in weights):
        correctives = _correctives(figure, poses, how, tolerance, True)
        return RestSurface(still, correctives or still, normals, still, recomputed)
    shapes = principal_fields(*_columns(blend, weights, BlendShapes.displacement), tolerance)
    turns = still
    if blend.normal_offsets is None:
        # Like ``shaped``: without any weight, the surface has the normals of its file.
        recomputed = np.array([row.any() for row in weights])
        normals = normals if recomputed.all() else figure.require_mesh().normals
    else:
        columns = _columns(blend, weights, _normal_displacement)
        turns = principal_fields(*columns, _NORMAL_TOLERANCE)
        normals = normals + turns.mean
    # Normals are computed from the surface without correctives, which a mean would be part of.
    correctives = _correctives(figure, poses, how, tolerance, False)
    return RestSurface(shapes, correctives or still, normals, turns, recomputed)


_Linear = Callable[[Floats], Floats]


def _columns(
    blend: BlendShapes,
    weights: Sequence[Floats],
    displacement: Callable[[BlendShapes, Floats], Floats],
) -> tuple[Floats, _Linear]:
    """Return weights (F, P), and the linear displacement that they have from the first frame."""
    if blend.is_linear and blend.rules is None:
        return np.stack(weights) - weights[0], lambda some: displacement(blend, some)
    # The displacement of each shape that occurs: rules and shape spaces need not be linear.
    rows, row_of = np.unique(np.stack(weights), axis=0, return_inverse=True)
    shapes, used = np.stack([displacement(blend, row) for row in rows]), row_of.reshape(-1)
    shapes -= shapes[used[0]].copy()
    return np.eye(len(rows))[used], lambda some: np.einsum("s,sva->va", some, shapes)


def _normal_displacement(blend: BlendShapes, weights: Floats) -> Floats:
    found = blend.normal_displacement(weights)
    assert found is not None  # the shapes have offsets of normals
    return found


def _correctives(
    figure: Figure,
    poses: Sequence[Pose | None],
    how: Skinning,
    tolerance: float,
    is_centered: bool,
) -> Fields | None:
    """Return how pose correctives displace the rest vertices in each pose."""
    correctives, skeleton = figure.correctives, figure.skeleton
    present = [pose for pose in poses if pose is not None]
    if correctives is None or skeleton is None or not how.correctives:
        return None
    if len(present) < len(poses):
        return None
    found = [
        pose_weights(correctives, shaped_skeleton(figure, pose.shape_weights), pose)
        for pose in present
    ]
    weights = np.stack(found)
    fewest = principal_fields(weights, correctives.displacement, tolerance, is_centered)
    # Each corrective displaces few vertices, the principal fields all of them: where many fields
    # are needed, those of the model take less space, as zeros do not.
    kept = np.flatnonzero(np.abs(weights).max(axis=0, initial=0.0) > 0.0)
    if not len(fewest.fields) or len(kept) * fewest.mean.size > _MOST_NUMBERS:
        return fewest
    scale = np.abs(weights[:, kept]).max(axis=0)
    unit = np.eye(weights.shape[1])[kept]
    own = np.stack([correctives.displacement(row) for row in unit * scale[:, None]])
    if np.count_nonzero(np.abs(own) > tolerance / len(own)) > fewest.fields.size:
        return fewest
    return Fields(np.zeros_like(fewest.mean), weights[:, kept] / scale, own)


def _looks(figure: Figure, weights: Sequence[Floats]) -> dict[int, list[Material]]:
    """Return the materials that blend shapes may change, in all frames."""
    blend = figure.blend_shapes
    if figure.mesh is None or blend is None or blend.material_binds is None:
        return {}
    materials, binds = figure.mesh.materials, blend.material_binds
    changed = [binds.changed(materials, blend.shown(row)) for row in weights]
    return {
        index: [each.get(index, materials[index]) for each in changed]
        for index in sorted({index for each in changed for index in each})
    }


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
        if np.abs(tracks.stretches - _RIGID).max() > _EQUAL:
            motion["stretches"] = packer.add(tracks.stretches, np.repeat(step, 6))
    n_joints = tracks.joints.shape[1]
    is_bound = tracks.joints.shape == tracks.places.shape
    if n_joints and not (is_bound and np.abs(tracks.joints - tracks.places).max() <= 0.5 * fine):
        motion["joints"] = packer.add(tracks.joints, fine)
    if tracks.surface is not None:
        assert mesh is not None  # the surface is that of the mesh
        _pack_surface(tracks.surface, mesh, fine, packer, motion)
    return motion


def pack_dofs(tracks: Tracks, pose: Pose | None, packer: Packer) -> Json:
    """Add the rotation DOFs that sliders may change; return members of ``joints``, or none.

    Sliders need joints whose rotations follow from their own DOFs, and which are scaled evenly:
    then a rotation of a joint moves all below it by a rigid motion.
    """
    skeleton, skin = tracks.rest.require_skeleton(), tracks.rest.skin
    if pose is None or skin is None or tracks.rotations.shape[1] != skeleton.n_joints:
        return {}
    binds = np.linalg.inv(skin.inverse_bind)[:, :3, :3]
    sizes = np.cbrt(np.linalg.det(binds))
    first, _, _, second, _, third = np.moveaxis(np.abs(tracks.stretches), -1, 0)
    sides = tracks.stretches[..., [1, 2, 4]]
    even = np.abs(np.stack([second - first, third - first, *np.moveaxis(sides, -1, 0)])) <= _EVEN
    square = np.einsum("jba,jbc->jac", binds, binds) - sizes[:, None, None] ** 2 * np.eye(3)
    is_even = even.all() and bool((np.abs(square) <= _EVEN * sizes[:, None, None] ** 2).all())
    if skeleton.posing is not None or skeleton.constraints or not is_even or sizes.min() <= 0.0:
        return {}
    rows = np.flatnonzero(skeleton.dof_kinds >= FIRST_ROTATION)
    joints, axes = skeleton.dof_joints[rows], skeleton.dof_kinds[rows] - FIRST_ROTATION
    # The angles about an axis that occurs twice do not follow from the rotation.
    counts = np.zeros((skeleton.n_joints, 3), np.int32)
    np.add.at(counts, (joints, axes), 1)
    used = np.all(counts[joints] <= 1, axis=1)
    if not used.any():
        return {}
    limits = np.clip(skeleton.dof_limits[rows[used]], -np.pi, np.pi)
    return {
        "binds": packer.add(matrix_to_quaternion(binds / sizes[:, None, None]), _FINEST),
        "rests": packer.add(pose.rotations, _FINEST),
        "dofs": {
            "joints": joints[used].tolist(),
            "axes": axes[used].tolist(),
            "rows": rows[used].tolist(),
            "limits": limits.tolist(),
        },
    }


def pose_values(figure: Figure, pose: Pose, how: Skinning, center: Floats) -> dict[str, Floats]:
    """Return the values of a pose that a page holds until its time changes; see ``tracks.js``.

    ``center`` (3,) is that of the page's mesh, to which rest vertices are relative.
    """
    tracks = tracks_of(figure, [pose], how)
    found = {"model": tracks.model[0], "joints": tracks.joints[0]}
    if tracks.rest.skin is not None and tracks.rotations.size:
        found |= {
            "rotations": tracks.rotations[0],
            "places": tracks.places[0],
            "binds": bind_positions(tracks.rest.skin),
        }
        if np.abs(tracks.stretches[0] - _RIGID).max() > _EQUAL:
            found["stretches"] = tracks.stretches[0]
    changes_rest = figure.blend_shapes is not None or figure.correctives is not None
    if tracks.surface is not None and changes_rest:
        found["rest"] = tracks.rest.require_mesh().positions + tracks.surface.mean - center
        found["restNormals"] = tracks.surface.normals
    return {name: values.reshape(-1) for name, values in found.items()}


def _pack_surface(
    surface: RestSurface, mesh: Mesh, fine: float, packer: Packer, motion: Json
) -> None:
    """Add what changes the rest surface to the members of the figure's ``motion``."""
    both = surface.shapes, surface.correctives
    near = earlier_corners(mesh.triangles, mesh.n_vertices)
    fields = np.concatenate([each.fields for each in both])
    if len(fields):
        weights = np.concatenate([each.weights for each in both], axis=1)
        motion["nShapes"] = len(surface.shapes.fields)
        error = _SHARE_OF_FIELDS * fine
        _pack_fields(("weights", "fields"), weights, fields, near, error, packer, motion)
    turns = surface.normal_fields
    if len(turns.fields):
        names = "normalWeights", "normalFields"
        _pack_fields(names, turns.weights, turns.fields, near, _NORMAL_TOLERANCE, packer, motion)
    if surface.recomputed.any():
        motion["recomputed"] = packer.add(surface.recomputed)


def _pack_fields(
    names: tuple[str, str],
    weights: Floats,
    fields: Floats,
    near: Ints,
    fine: float,
    packer: Packer,
    motion: Json,
) -> None:
    """Add weights (F, K) and fields (K, V, 3) whose sums may have errors of ``fine``."""
    count, largest = len(fields), np.abs(fields).max(axis=(1, 2))
    # Errors of K fields add up at random, as the square root of K.
    steps = np.full(count, _COARSEST_WEIGHT)
    np.divide(fine, np.sqrt(count) * largest, out=steps, where=largest > 0.0)
    motion[names[0]] = packer.add(weights, np.minimum(steps, _COARSEST_WEIGHT))
    # A field that is rounded to steps s_k has errors of variance s_k^2 / 12, which its weight w_fk
    # multiplies. With s_k = s / (r_k sqrt K) and r_k^2 the mean of w_fk^2, all fields contribute
    # alike, and the sum has the deviation s / sqrt 12 in a usual frame, ``peak`` times that in the
    # worst. One of a million errors is beyond five deviations.
    usual = np.sqrt(np.square(weights).mean(axis=0))
    used = np.where(usual > 0.0, usual, 1.0)
    peak = np.sqrt(np.square(weights / used).mean(axis=1).max(initial=1.0))
    coarse = fine * np.sqrt(12.0) / (_DEVIATIONS * peak * np.sqrt(count) * used)
    rows = np.moveaxis(fields, 0, 1).reshape(fields.shape[1], -1)
    motion[names[1]] = packer.add(rows, np.repeat(coarse, 3), near)
