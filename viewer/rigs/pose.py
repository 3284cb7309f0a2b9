"""Poses: DOFs, local transforms, shape weights and placement of one figure."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from viewer.arguments import check_type
from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.phrases import counted, printable
from viewer.rigs.arrays import Floats, Ints, frozen, span
from viewer.rigs.checked_fields import are_finite, checked
from viewer.rigs.constraints.evaluation import constrained_matrices
from viewer.rigs.geometry.rotation import (
    matrix_to_euler,
    matrix_to_quaternion,
    matrix_to_rotation_vector,
    quaternion_entries,
    quaternion_to_matrix,
    rotation_vector_to_matrix,
)
from viewer.rigs.geometry.transform import affine_matrices
from viewer.rigs.memo import Memo, NumberKey
from viewer.rigs.skeleton import FIRST_ROTATION, Skeleton, clamp_dofs, find_joint
from viewer.rigs.watched_arrays import unwatched, watched

if TYPE_CHECKING:
    from viewer.rigs.skin import Skin

_orders: Memo[Skeleton, _AxisProducts] = Memo()
_ball_rows: Memo[Skeleton, Ints] = Memo()
_Indices = NDArray[np.intp]
_IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])


_PER_JOINT = 10  # a translation, a quaternion and three scale factors


@checked
@watched("values", "shape_weights")
@dataclass(slots=True, eq=False)
class Pose:
    """The mutable state of one figure; arrays are changed in place.

    ``pose["left_knee"]`` is the joint's rotation relative to its parent as a rotation vector (3,),
    radians; assigning one rotates the joint.

    ``rest_pose`` makes one.
    """

    # All numbers of the joints are one array, so that poses are copied, compared and gathered at
    # once. Its parts are views: what is assigned to them is copied.

    values: Floats = field(metadata={"shape": (None,)})
    """(D + 10 J + 3,). DOFs, translations, rotations, scales and ``figure_translation``."""
    n_dofs: int
    """D."""
    shape_weights: Floats = field(default_factory=lambda: np.zeros(0), metadata={"shape": (None,)})
    """(S,). Weights of the figure's blend shapes; missing trailing weights are treated as 0."""
    figure_scale: float = 1.0
    """Scale of the whole skinned figure about its origin, applied after skinning."""
    skeleton: Skeleton | None = field(default=None, repr=False)
    """The joints that ``pose["left_knee"]`` names."""
    posed: PosedSkeleton | None = field(default=None, init=False, repr=False)
    """Cached matrices; up to date if they have the key of the current values."""
    handed: object = field(default_factory=object, init=False, repr=False)
    """Another object whenever the values or the shape weights were asked for or set."""
    _key: NumberKey | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        of_joints = self.values.size - self.n_dofs - 3
        if self.n_dofs < 0 or of_joints < 0 or of_joints % _PER_JOINT:
            raise RigError(
                f"values of a pose with {counted(self.n_dofs, 'DOF')}: expected three more and "
                f"{_PER_JOINT} per joint, found {printable(self.values.shape)}"
            )

    @property
    def dofs(self) -> Floats:
        """(D,). Lengths or radians."""
        return self.values[: self.n_dofs]

    @dofs.setter
    def dofs(self, values: ArrayLike) -> None:
        _fill("dofs", self.dofs, values)

    @property
    def translations(self) -> Floats:
        """(J, 3). Offsets from the skeleton's rest translations, which follow the shape."""
        return pose_arrays_of(self.values, self.n_dofs).translations

    @translations.setter
    def translations(self, values: ArrayLike) -> None:
        _fill("translations", self.translations, values)

    @property
    def rotations(self) -> Floats:
        """(J, 4). Local rotations before the DOFs, as quaternions (x, y, z, w)."""
        return pose_arrays_of(self.values, self.n_dofs).rotations

    @rotations.setter
    def rotations(self, values: ArrayLike) -> None:
        _fill("rotations", self.rotations, values)

    @property
    def scales(self) -> Floats:
        """(J, 3). Local scale factors."""
        return pose_arrays_of(self.values, self.n_dofs).scales

    @scales.setter
    def scales(self, values: ArrayLike) -> None:
        _fill("scales", self.scales, values)

    @property
    def figure_translation(self) -> Floats:
        """(3,). Translation of the whole skinned figure, applied after its scale."""
        return self.values[-3:]

    @figure_translation.setter
    def figure_translation(self, values: ArrayLike) -> None:
        _fill("figure_translation", self.figure_translation, values)

    @property
    def skinning_key(self) -> NumberKey:
        """Key of all values except the figure's placement, the same object until a value changes.

        Poses with equal keys have the same joints and need no second skinning.
        """
        arrays = unwatched("values")(self)[:-3], unwatched("shape_weights")(self)
        self._key = NumberKey(*arrays) if self._key is None else self._key.updated(*arrays)
        return self._key

    def __getitem__(self, joint: str) -> Floats:
        """Return a joint's rotation relative to its parent as a rotation vector, radians: (3,)."""
        skeleton, index = self._find(joint)
        return matrix_to_rotation_vector(joint_rotations(skeleton, self)[index])

    def __setitem__(self, joint: str, rotation: ArrayLike) -> None:
        """Rotate a joint relative to its parent by a rotation vector, radians: (3,)."""
        skeleton, index = self._find(joint)
        try:
            vector = np.asarray(rotation, dtype=np.float64)
        except (TypeError, ValueError):
            vector = np.zeros(0)
        if vector.shape != (3,) or not np.isfinite(vector).all():
            raise RigError(f"{joint}: expected a rotation vector (3,), found {rotation!r}")
        joints, turned = np.array([index], dtype=np.int32), rotation_vector_to_matrix(vector)[None]
        set_joint_rotations(skeleton, self, joints, turned, "quaternion")

    def _find(self, joint: str) -> tuple[Skeleton, int]:
        """Return the skeleton, and the index of a joint in it."""
        check_type("joint", joint, str)
        if self.skeleton is None:
            raise RigError(f"{joint}: expected the pose of an actor, found one without joint names")
        return self.skeleton, find_joint(self.skeleton, joint)

    def check_fits(self, skeleton: Skeleton, what: str = "pose") -> None:
        """Raise ``RigError`` unless this is a pose of a skeleton, or of one like it."""
        wanted = skeleton.n_dofs, skeleton.n_joints
        found = self.n_dofs, (unwatched("values")(self).size - self.n_dofs - 3) / _PER_JOINT
        if wanted != found:
            raise RigError(
                f"{what}: expected {counted(wanted[0], 'DOF')} of {counted(wanted[1], 'joint')}, "
                f"found {found[0]} of {found[1]:g}"
            )

    def copy(self) -> Pose:
        """Return a pose that shares no array with this one."""
        values, weights = unwatched("values")(self), unwatched("shape_weights")(self)
        numbers = values.copy(), self.n_dofs, weights.copy()
        return Pose(*numbers, self.figure_scale, self.skeleton)


def _fill(name: str, array: Floats, values: ArrayLike) -> None:
    """Set an array of a pose to values, or one row of them for all joints."""
    # Much faster than what says why values do not fit.
    is_array = type(values) is np.ndarray and values.dtype == array.dtype
    if is_array and np.shape(values) == array.shape and are_finite(np.asarray(values)):
        array[:] = values
        return
    try:
        given = np.broadcast_to(np.asarray(values, dtype=np.float64), array.shape)
    except (TypeError, ValueError):
        raise RigError(f"{name}: expected numbers of shape {array.shape}") from None
    array[:] = frozen(name, given, array.shape)


class PoseArrays(NamedTuple):
    """The values of one or many poses that move joints; see ``Pose``."""

    dofs: Floats
    """(..., D)."""
    translations: Floats
    """(..., J, 3)."""
    rotations: Floats
    """(..., J, 4)."""
    scales: Floats
    """(..., J, 3)."""

    def rows(self, rows: _Indices) -> PoseArrays:
        """Return the values of some of many poses, in the order of the rows."""
        which = span(rows)
        return PoseArrays(*(part[which] for part in self))


def pose_arrays_of(values: Floats, n_dofs: int) -> PoseArrays:
    """Return the parts of ``Pose.values``, (..., D + 10 J + 3), as views."""
    batch, n_joints = values.shape[:-1], (values.shape[-1] - n_dofs - 3) // _PER_JOINT
    ends = n_dofs, n_dofs + 3 * n_joints, n_dofs + 7 * n_joints
    return PoseArrays(
        values[..., :n_dofs],
        values[..., n_dofs : ends[1]].reshape(*batch, n_joints, 3),
        values[..., ends[1] : ends[2]].reshape(*batch, n_joints, 4),
        values[..., ends[2] : -3].reshape(*batch, n_joints, 3),
    )


class PoseKey(NamedTuple):
    """All values of a pose at one moment, to compare and to restore; see ``pose_of``."""

    numbers: NumberKey
    """The pose's ``skinning_key``."""
    n_dofs: int
    scale: float
    """The pose's ``figure_scale``."""
    translation: tuple[float, ...]
    """The pose's ``figure_translation``."""


def pose_key(pose: Pose) -> PoseKey:
    """Return a key that identifies the pose. Nothing is copied unless a value has changed."""
    place = tuple(unwatched("values")(pose)[-3:].tolist())
    return PoseKey(pose.skinning_key, pose.n_dofs, pose.figure_scale, place)


def pose_of(key: PoseKey) -> Pose:
    """Return a new pose with the values of a key."""
    values = np.append(key.numbers.array(0), key.translation)
    return Pose(values, key.n_dofs, key.numbers.array(1), key.scale)


def placement_matrix(pose: Pose) -> Floats:
    """Return T(figure_translation) S(figure_scale): (4, 4), applied after skinning."""
    return affine_matrices(pose.figure_scale * np.eye(3), pose.figure_translation)


def rest_pose(skeleton: Skeleton) -> Pose:
    """Return a new pose with the values stored in the file, clamped to the limits.

    Parameters
    ----------
    skeleton
        Provides the rest transforms and DOF values.

    Returns
    -------
    Pose
        Pose that shares no array with the skeleton.
    """
    check_type("skeleton", skeleton, Skeleton)
    parts = (
        *(clamp_dofs(skeleton, skeleton.rest_dofs), np.zeros(3 * skeleton.n_joints)),
        *(skeleton.rest_rotations.ravel(), skeleton.rest_scales.ravel(), np.zeros(3)),
    )
    return Pose(np.concatenate(parts), skeleton.n_dofs, skeleton=skeleton)


def zero_pose(skeleton: Skeleton) -> Pose:
    """Return the rest pose with all DOFs at 0."""
    pose = rest_pose(skeleton)
    pose.dofs[:] = 0.0
    return pose


def local_matrices(skeleton: Skeleton, pose: Pose) -> Floats:
    """Build L = T(rest + translation + DOFs) R(quaternion) R(DOFs) S(scale) of joints (J, 4, 4).

    Joints with a constraint follow their source instead.
    """
    # The first row of a joint's DOFs is applied first: rows x, y, z give Rz Ry Rx (CSE169 course
    # notes, "rotation about x first, then y, then z").
    turns = joint_rotations(skeleton, pose)
    return affine_matrices(
        *local_transforms(skeleton, turns, pose.dofs, pose.translations, pose.scales)
    )


def local_transforms(
    skeleton: Skeleton, rotations: Floats, dofs: Floats, translations: Floats, scales: Floats
) -> tuple[Floats, Floats]:
    """Return linear parts (..., J, 3, 3) and places (..., J, 3), relative to parents."""
    places = skeleton.rest_translations + joint_offsets(skeleton, dofs, translations)
    if skeleton.constraints:
        first = (np.moveaxis(part, -2, 0) for part in (places, scales))
        turned = constrained_matrices(skeleton, np.moveaxis(rotations, -3, 0), *first)
        rotations = np.moveaxis(turned, 0, -3)
    if (scales == 1.0).all():
        return rotations, places
    laid_out = np.moveaxis(batch_last(scales, 2), (0, 1), (-2, -1))
    return rotations * laid_out[..., None, :], places


def batch_last(values: Floats, own: int) -> Floats:
    """Return values with their last ``own`` axes first, contiguous.

    Numpy computes with the numbers of many poses several times faster if they are consecutive in
    memory, not 3 or 9 at a time. Functions of many poses return views of such arrays.
    """
    return np.ascontiguousarray(np.moveaxis(values, range(-own, 0), range(own)))


def joint_offsets(skeleton: Skeleton, dofs: Floats, translations: Floats) -> Floats:
    """Return the joints' offsets from their rest translations, DOFs included: (..., J, 3)."""
    shape = np.broadcast_shapes(translations.shape[:-2], dofs.shape[:-1])
    spread = np.broadcast_to(translations, (*shape, *translations.shape[-2:]))
    first = np.moveaxis(spread, (-2, -1), (0, 1)).copy()
    moves = np.flatnonzero(skeleton.dof_kinds < FIRST_ROTATION)
    if len(moves):
        # A joint may have several translation DOFs along one axis: unlike +=, add.at sums them all.
        entries = skeleton.dof_joints[moves], skeleton.dof_kinds[moves]
        np.add.at(first, entries, np.moveaxis(dofs[..., moves], -1, 0))
    offsets = np.moveaxis(first, (0, 1), (-2, -1))
    if skeleton.posing is not None:
        offsets += skeleton.posing.translations(dofs)
    return offsets


def joint_rotations(skeleton: Skeleton, pose: Pose) -> Floats:
    """Return R(quaternion) R(DOFs) relative to parents (J, 3, 3), without constraints."""
    return local_rotations(skeleton, pose.rotations, pose.dofs)


def local_rotations(skeleton: Skeleton, quaternions: Floats, dofs: Floats) -> Floats:
    """Return R(quaternion) R(DOFs) (..., J, 3, 3) of quaternions (..., J, 4) and DOFs (..., D)."""
    # Most files use either quaternions or DOFs; the others are identities, which need no product.
    # Rows of all joints' numbers are compared several times faster than four numbers at a time.
    flat = quaternions.reshape(*quaternions.shape[:-2], -1)
    if (flat == np.tile(_IDENTITY, quaternions.shape[-2])).all():
        return dof_rotations(skeleton, dofs)
    beneath = quaternion_entries(*batch_last(quaternions, 2).swapaxes(0, 1))
    if skeleton.posing is None and not dofs[..., skeleton.dof_kinds >= FIRST_ROTATION].any():
        return np.moveaxis(beneath, (0, 1, 2), (-2, -1, -3))
    turns = np.moveaxis(dof_rotations(skeleton, dofs), (-2, -1, -3), (0, 1, 2))
    return np.moveaxis(np.einsum("ik...,kj...->ij...", beneath, turns), (0, 1, 2), (-2, -1, -3))


def dof_rotations(skeleton: Skeleton, dofs: Floats) -> Floats:
    """Multiply each joint's rotation DOFs (..., D), first row first, to (..., J, 3, 3)."""
    if skeleton.posing is not None:
        return skeleton.posing.rotations(dofs)
    return _order_of(skeleton).at(dofs)


def rotation_rows(skeleton: Skeleton) -> Ints:
    """Return ball joints' DOF rows about x, y, z (J, 3); -1 for joints with other rotations."""
    return _ball_rows.get(skeleton, None, lambda: _rows_of_balls(skeleton))


def _rows_of_balls(skeleton: Skeleton) -> Ints:
    rows = np.full((skeleton.n_joints, 3), -1, dtype=np.int32)
    rotations = np.flatnonzero(skeleton.dof_kinds >= 3)
    counts = np.bincount(skeleton.dof_joints[rotations], minlength=skeleton.n_joints)
    rows[skeleton.dof_joints[rotations], skeleton.dof_kinds[rotations] - 3] = rotations
    is_ball = (counts == 3) & (rows >= 0).all(axis=1) & (np.diff(rows, axis=1) > 0).all(axis=1)
    rows[~is_ball] = -1
    rows.flags.writeable = False
    return rows


Beyond = Literal["cut", "dofs", "quaternion"]
"""Where a rotation beyond the limits of a ball joint goes: it is cut off at the limits, the DOFs
exceed them, or the quaternion beneath the DOFs has what they lack."""


def set_joint_rotations(
    skeleton: Skeleton, pose: Pose, joints: Ints, rotations: Floats, beyond: Beyond = "cut"
) -> None:
    """Set joints' rotations (N, 3, 3) relative to parents, in place, as ``rotate_joints`` does."""
    dofs = pose.dofs[None].copy()
    pose.rotations[joints] = rotate_joints(skeleton, dofs, joints, rotations[None], beyond)[0]
    pose.dofs[:] = dofs[0]


def rotate_joints(
    skeleton: Skeleton, dofs: Floats, joints: Ints, rotations: Floats, beyond: Beyond
) -> Floats:
    """Set DOFs (T, D), in place, to rotations (T, N, 3, 3) of joints; return quaternions (T, N, 4).

    A ball joint's DOFs become the angles about x, y, z; other joints keep their DOFs as near to 0
    as limits allow, and the quaternion has the rest.
    """
    joints = np.asarray(joints)
    rows = rotation_rows(skeleton)[joints]
    is_ball = rows[:, 0] >= 0
    # A slice copies nothing.
    balls = slice(None) if is_ball.all() else np.flatnonzero(is_ball)
    rest = skeleton.rest_rotations[joints]
    quaternions = np.broadcast_to(rest, (len(dofs), *rest.shape))
    within = np.swapaxes(quaternion_to_matrix(rest[balls]), -1, -2) @ rotations[:, balls]
    angles = matrix_to_euler(within)
    dofs[:, rows[balls]] = angles
    others = joints[~is_ball]
    if len(others):
        dofs[:, np.isin(skeleton.dof_joints, others) & (skeleton.dof_kinds >= 3)] = 0.0
    if beyond != "dofs":
        np.clip(dofs, *skeleton.dof_limits.T, out=dofs)
    has_rest = np.broadcast_to(~is_ball, quaternions.shape[:-1]).copy()
    if beyond == "quaternion":
        has_rest[:, balls] = (dofs[:, rows[balls]] != angles).any(axis=-1)
    if has_rest.any():
        # R = Q R(DOFs), so Q = R R(DOFs)^T has what the DOFs lack.
        held = dof_rotations(skeleton, dofs)[:, joints]
        left = matrix_to_quaternion(rotations @ np.swapaxes(held, -1, -2))
        quaternions = np.where(has_rest[..., None], left, quaternions)
    return quaternions


def _order_of(skeleton: Skeleton) -> _AxisProducts:
    def order() -> _AxisProducts:
        rows = np.flatnonzero(skeleton.dof_kinds >= FIRST_ROTATION)
        axes = skeleton.dof_kinds[rows] - FIRST_ROTATION
        return axis_products(skeleton.n_joints, skeleton.dof_joints[rows], axes, rows)

    return _orders.get(skeleton, None, order)


@dataclass(frozen=True, slots=True, eq=False)
class _Factor:
    """A rotation about one axis, of joints that have no other in this factor."""

    axis: int
    joints: _Indices | slice
    rows: _Indices
    is_first: bool
    """Whether it is the first rotation of its joints."""

    def apply(self, entries: Floats, cosines: Floats, sines: Floats) -> None:
        """Multiply matrices with entries (3, 3, J, ...) from the left, by angles (N, ...)."""
        first, second = (self.axis + 1) % 3, (self.axis + 2) % 3
        if self.is_first:
            entries[first, first, self.joints] = entries[second, second, self.joints] = cosines
            entries[second, first, self.joints] = sines
            entries[first, second, self.joints] = -sines
            return
        # Only two rows change: their new values are the old ones, rotated.
        upper, lower = entries[first][:, self.joints], entries[second][:, self.joints]
        moved = cosines * upper - sines * lower, sines * upper + cosines * lower
        for row, values in zip((first, second), moved, strict=True):
            entries[row][:, self.joints] = values


class _AxisProducts:
    """Order in which the rotation DOFs of each joint are multiplied."""

    def __init__(self, n_joints: int, factors: list[_Factor]) -> None:
        self._n_joints, self._factors = n_joints, factors
        self._rows = np.concatenate([np.zeros(0, np.intp), *(one.rows for one in factors)])

    def at(self, dofs: Floats) -> Floats:
        """Return the products of rotation DOFs (..., D) as (..., J, 3, 3); identity without any."""
        entries = np.zeros((3, 3, self._n_joints, *dofs.shape[:-1]))
        for axis in range(3):
            entries[axis, axis] = 1.0
        # With t = tan(a/2), cos a = (1 - t^2) / (1 + t^2) and sin a = 2 t / (1 + t^2), to 3e-16.
        # Numpy's tangent takes a tenth of the time of its sine and cosine.
        tangents = np.tan(0.5 * np.moveaxis(dofs, -1, 0)[self._rows])
        squares = tangents * tangents
        factors = 1.0 / (1.0 + squares)
        cosines, sines = (1.0 - squares) * factors, 2.0 * tangents * factors
        start = 0
        for factor in self._factors:
            part = slice(start, start := start + len(factor.rows))
            factor.apply(entries, cosines[part], sines[part])
        return np.moveaxis(entries, (0, 1, 2), (-2, -1, -3))


def axis_products(n_joints: int, joints: Ints, axes: Ints, rows: _Indices) -> _AxisProducts:
    """Order rotations (N,) about ``axes`` 0 to 2 for multiplication, a joint's first row first."""
    factors = []
    for rank, of_rank in enumerate(_by_rank(joints)):
        for axis in range(3):
            chosen = of_rank[axes[of_rank] == axis]
            if len(chosen):
                turned = joints[chosen].astype(np.intp)
                every = np.array_equal(turned, np.arange(n_joints))
                where = slice(None) if every else turned
                factors.append(_Factor(axis, where, rows[chosen], rank == 0))
    return _AxisProducts(n_joints, factors)


def _by_rank(joints: Ints) -> list[_Indices]:
    """Return the indices of the first entries of all joints, of the second entries, and so on."""
    order = np.argsort(joints, kind="stable")
    ordered = joints[order]
    is_first = np.concatenate([[True], ordered[1:] != ordered[:-1]])[: len(ordered)]
    starts = np.maximum.accumulate(np.where(is_first, np.arange(len(ordered)), 0))
    rank = np.arange(len(ordered)) - starts
    return [order[rank == number] for number in range(int(rank.max(initial=-1)) + 1)]


class PosedSkeleton:
    """World (J, 4, 4) and skinning matrices of the pose ``key``, read-only, computed once."""

    __slots__ = ("_palette", "_skin", "key", "skeleton", "world")

    def __init__(self, skeleton: Skeleton, key: NumberKey, world: Floats) -> None:
        self.skeleton, self.key, self.world = skeleton, key, world
        world.flags.writeable = False
        self._skin: Skin | None = None
        self._palette: Floats = world

    def palette(self, skin: Skin) -> Floats:
        """Return the skinning matrices M[j] = W[j] inverse(B[j]), (J, 4, 4), read-only."""
        if self._skin is not skin:
            self._palette = self.world @ skin.inverse_bind
            self._palette.flags.writeable = False
            self._skin = skin
        return self._palette
