"""Edits of a figure's joints: moved, added, removed, renamed, mirrored. At rest, its mesh stays.

A joint j moves the vertices bound to it by M[j] = W[j] B[j], with its world matrix at rest and its
inverse bind matrix. An edit gives it another W'[j], and B'[j] = inv(W'[j]) M[j]: then the mesh at
rest is the same, even if it differs from the bind pose, and only the centres of rotation change.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.phrases import counted, printable
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import (
    matrix_to_quaternion,
    nearest_rotations,
    quaternion_to_matrix,
)
from viewer.rigs.geometry.transform import affine_matrices
from viewer.rigs.hierarchy import descendants, path_to_root
from viewer.rigs.humanoid import Humanoid
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.pose import Pose, dof_rotations, joint_offsets, rest_pose
from viewer.rigs.retargeting.joint_names import other_side, sided_words
from viewer.rigs.retargeting.mirror import word_partners
from viewer.rigs.skeleton import FIRST_ROTATION, Skeleton, joint_label
from viewer.rigs.skin import merged

_NEAR = 0.02  # distance of a joint from the mirror plane, or from its image, relative to the size
_ALONG = 1e-6  # sine of the angle up to which a plane's normal counts as a coordinate axis


@dataclass(frozen=True, slots=True, eq=False)
class Plane:
    """The points with ``normal . p = offset``."""

    normal: Floats
    """(3,). Unit vector, to the figure's left."""
    offset: float

    def distance(self, point: Floats) -> float:
        """Return how far a point (3,) is on the left."""
        return float(point @ self.normal) - self.offset

    def image(self, point: Floats) -> Floats:
        """Return the mirror image of a point (3,)."""
        return point - 2.0 * self.distance(point) * self.normal

    @property
    def reflection(self) -> Floats:
        """The linear part (3, 3)."""
        return np.eye(3) - 2.0 * np.outer(self.normal, self.normal)

    @property
    def axis(self) -> int:
        """The coordinate axis along the normal, -1 for none."""
        axis = int(np.abs(self.normal).argmax())
        return axis if np.linalg.norm(np.delete(self.normal, axis)) <= _ALONG else -1


@dataclass(frozen=True, slots=True, eq=False)
class _Joints:
    """The joints that a figure should have, parents before children."""

    names: list[str]
    parents: list[int]
    worlds: list[Floats]
    """Matrices (4, 4) at rest."""
    sources: list[int]
    """The present joint that each was, -1 for a new one."""
    models: dict[int, int]
    """The present joint whose DOFs a new one gets mirrored."""


def no_edit(figure: Figure) -> str:
    """Return the reason why the joints of a figure cannot be edited."""
    if figure.mesh is None or not figure.is_attached:
        return "this figure has no mesh with a skin"
    skeleton = figure.require_skeleton()
    shapes = figure.blend_shapes
    if figure.joint_regressor is not None or figure.parameters is not None:
        return "the joints of a body model follow its shape"
    if skeleton.posing is not None or (shapes is not None and shapes.space is not None):
        return "the joints of a body model follow its shape"
    return ""


def prepared(figure: Figure) -> tuple[Figure, list[str]]:
    """Return a figure without what another skeleton makes invalid, and the names of what it had."""
    lost: list[str] = []
    if figure.animations:
        lost.append(counted(len(figure.animations), "animation"))
    if figure.correctives is not None:
        lost.append("pose correctives")
    if figure.hands:
        lost.append("hand poses")
    changed = replace(
        figure,
        animations=(),
        correctives=None,
        hands=(),
        pose_layout=None,
        record=None,
        keypoints=None,
        fields=(),
    )
    return changed, lost


def at_rest(skeleton: Skeleton, pose: Pose) -> Skeleton:
    """Return a skeleton whose rest pose is a given one; its limits are widened to include it."""
    low, high = skeleton.dof_limits.T
    return replace(
        skeleton,
        dof_limits=np.stack([np.minimum(low, pose.dofs), np.maximum(high, pose.dofs)], axis=1),
        rest_translations=skeleton.rest_translations + pose.translations,
        rest_rotations=pose.rotations,
        rest_scales=pose.scales,
        rest_dofs=pose.dofs,
    )


def rest_worlds(figure: Figure) -> Floats:
    """Return the joints' matrices at rest in figure space: (J, 4, 4)."""
    skeleton = figure.require_skeleton()
    return world_matrices(skeleton, rest_pose(skeleton))


def moved(figure: Figure, places: Mapping[int, Floats]) -> Figure:
    """Return a figure with some joints at other places (3,) at rest; all others stay."""
    joints = _present(figure)
    for joint, place in places.items():
        joints.worlds[joint] = _placed(joints.worlds[joint], place)
    return _with_joints(figure, joints, {})


def with_below(figure: Figure, joint: int, place: Floats) -> dict[int, Floats]:
    """Return the places of a joint and of all joints below it that move along with it."""
    worlds = rest_worlds(figure)
    below = np.flatnonzero(descendants(figure.require_skeleton().parents, joint)).tolist()
    shift = place - worlds[joint, :3, 3]
    return {one: worlds[one, :3, 3] + shift for one in below}


def added(figure: Figure, parent: int, place: Floats, name: str = "") -> Figure:
    """Return a figure with one more joint, the last, that rotates freely."""
    joints = _present(figure)
    matrix = _placed(np.eye(4), place)
    joints.names.append(name or free_name(joints.names))
    joints.parents.append(parent)
    joints.worlds.append(matrix)
    joints.sources.append(-1)
    return _with_joints(figure, joints, {})


def free_name(names: Iterable[str], base: str = "joint") -> str:
    """Return a name that no joint has, nor with a side: ``joint``, then ``joint_2``, and so on."""
    known, number, name = set(names), 1, base
    while known & {name, f"{name}_left", f"{name}_right"}:
        number += 1
        name = f"{base}_{number}"
    return name


def removed(figure: Figure, chosen: set[int]) -> Figure:
    """Return a figure without some joints: their children and weights go to the joint above.

    A root can be removed if one joint is below it, which takes its place.
    """
    skeleton = figure.require_skeleton()
    parents = skeleton.parents.tolist()
    old = [one for one in range(len(parents)) if one not in chosen]
    heirs: dict[int, int] = {}
    for joint in sorted(chosen):
        above = parents[joint]
        while above in chosen:
            above = parents[above]
        if above < 0:
            tops = [one for one in old if _above(parents, one, chosen) < 0]
            below = [one for one in tops if joint in path_to_root(parents, one)]
            if len(below) != 1:
                raise RigError(
                    f"{joint_label(skeleton, joint)} is a root with "
                    f"{counted(len(below), 'joint')} below it: only a root with one can be removed"
                )
            above = below[0]
        heirs[joint] = above
    joints = _present(figure)
    place = {joint: row for row, joint in enumerate(old)}
    left = _Joints(
        names=[joints.names[one] for one in old],
        parents=[place.get(_above(parents, one, chosen), -1) for one in old],
        worlds=[joints.worlds[one] for one in old],
        sources=old,
        models={},
    )
    return _with_joints(figure, left, heirs)


def _above(parents: list[int], joint: int, without: set[int]) -> int:
    """Return the nearest joint above one that is not left out, -1 for none."""
    above = parents[joint]
    while above in without:
        above = parents[above]
    return above


def renamed(figure: Figure, joint: int, name: str) -> Figure:
    """Return a figure with another name of a joint."""
    skeleton = figure.require_skeleton()
    names = (*skeleton.names[:joint], name, *skeleton.names[joint + 1 :])
    return replace(figure, skeleton=replace(skeleton, names=names))


def partners(figure: Figure, plane: Plane) -> list[int]:
    """Return the counterpart of each joint (J,): itself in the plane, -1 for none.

    The names of both sides tell, or the places of joints whose names have no side.
    """
    skeleton, places = figure.require_skeleton(), rest_worlds(figure)[:, :3, 3]
    words = sided_words(skeleton.names)
    found = word_partners(words).tolist()
    near = _NEAR * _size(figure)
    for joint, (side, _) in enumerate(words):
        if side or abs(plane.distance(places[joint])) <= near:
            continue
        apart = np.linalg.norm(places - plane.image(places[joint]), axis=1)
        other = int(apart.argmin())
        found[joint] = other if apart[other] <= near and other != joint else -1
    return found


def is_central(figure: Figure, plane: Plane, place: Floats) -> bool:
    """Return whether a place (3,) counts as one in the mirror plane."""
    return abs(plane.distance(place)) <= _NEAR * _size(figure)


def _size(figure: Figure) -> float:
    return float(np.ptp(figure.require_mesh().positions, axis=0).max())


def mirrored(figure: Figure, joint: int, plane: Plane) -> Figure:
    """Return a figure whose joints at and below one have mirror images, made or moved.

    The images have the names of the other side. Names without a side get one: ``_left`` and
    ``_right``.
    """
    skeleton, places = figure.require_skeleton(), rest_worlds(figure)[:, :3, 3]
    chain = np.flatnonzero(descendants(skeleton.parents, joint)).tolist()
    chain = [one for one in chain if not is_central(figure, plane, places[one])]
    if not chain:
        label = printable(joint_label(skeleton, joint), 40)
        raise RigError(f"{label} is in the plane of symmetry, as are all joints below it")
    known, joints = partners(figure, plane), _present(figure)
    image: dict[int, int] = {}
    for one in chain:
        world = joints.worlds[one]
        place = plane.image(world[:3, 3])
        other = known[one]
        if other >= 0 and other != one:
            if other in chain:
                # Both sides are below the joint: the selected side would be overwritten by itself.
                raise RigError(
                    f"{printable(joint_label(skeleton, joint), 40)} has joints of both sides below "
                    "it: select a joint of one side"
                )
            joints.worlds[other] = _placed(joints.worlds[other], place)
            image[one] = other
            continue
        name = joints.names[one]
        if not other_side(name):
            sides = ("left", "right") if plane.distance(world[:3, 3]) > 0.0 else ("right", "left")
            others = (*joints.names[:one], *joints.names[one + 1 :])
            joints.names[one] = f"{free_name(others, name)}_{sides[0]}"
        new = np.eye(4)
        # F R F with a reflection F is a rotation again.
        new[:3, :3] = plane.reflection @ world[:3, :3] @ plane.reflection
        above = int(skeleton.parents[one])
        image[one] = len(joints.names)
        # A parent without a side, such as a chest, is that of both sides.
        side = image.get(above, known[above] if above >= 0 and known[above] >= 0 else above)
        joints.names.append(other_side(joints.names[one]))
        joints.parents.append(side)
        joints.worlds.append(_placed(new, place))
        joints.sources.append(-1)
        if plane.axis >= 0:
            joints.models[image[one]] = one
    return _with_joints(figure, joints, {}, plane.axis)


def _present(figure: Figure) -> _Joints:
    skeleton = figure.require_skeleton()
    count = skeleton.n_joints
    worlds = [*rest_worlds(figure)]
    return _Joints([*skeleton.names], skeleton.parents.tolist(), worlds, [*range(count)], models={})


def _placed(world: Floats, place: Floats) -> Floats:
    """Return a matrix (4, 4) with another translation."""
    found = world.copy()
    found[:3, 3] = place
    return found


def _with_joints(
    figure: Figure, joints: _Joints, heirs: Mapping[int, int], axis: int = -1
) -> Figure:
    """Return a figure with other joints. ``heirs``: who gets the weights of a joint left out.

    ``axis``: along which the DOFs of joints with a model are mirrored.
    """
    old = figure.require_skeleton()
    is_same = joints.sources == [*range(old.n_joints)]
    if not is_same and (old.constraints or old.springs is not None):
        what = "constraints" if old.constraints else "springs"
        raise RigError(f"this skeleton has {what}: its joints can be moved, not added or removed")
    skeleton = _rebuilt(old, joints, axis)
    worlds, before = world_matrices(skeleton, rest_pose(skeleton)), rest_worlds(figure)
    skin = figure.require_skin()
    motions = before @ skin.inverse_bind
    place = {source: row for row, source in enumerate(joints.sources) if source >= 0}
    # A new joint has no weights: it moves as its parent.
    kept: list[Floats] = []
    for row, source in enumerate(joints.sources):
        above = joints.parents[row]
        kept.append(motions[source] if source >= 0 else kept[above] if above >= 0 else np.eye(4))
    flat = np.abs(np.linalg.det(worlds[:, :3, :3])) < np.finfo(float).tiny
    if flat.any():
        label = printable(joint_label(skeleton, int(flat.argmax())), 40)
        raise RigError(f"{label}: expected a joint with a scale, found 0")
    inverse = np.asarray(np.linalg.inv(worlds), dtype=np.float64) @ np.stack(kept)
    owner = np.array(
        [place[heirs.get(joint, joint)] for joint in range(old.n_joints)], dtype=np.int32
    )
    bound = replace(skin, joints=owner[skin.joints], inverse_bind=inverse)
    return replace(figure, skeleton=skeleton, skin=merged(bound) if heirs else bound)


def _rebuilt(old: Skeleton, joints: _Joints, axis: int) -> Skeleton:
    """Return a skeleton with given matrices at rest; joints keep their DOFs and axes."""
    pose, flip = rest_pose(old), np.ones(3)
    flip[axis] = -1.0  # used for models only, which need an axis
    # What the DOFs at rest add to the rest transform.
    shifts = joint_offsets(old, pose.dofs, np.zeros((old.n_joints, 3)))
    turns = dof_rotations(old, pose.dofs)
    count = len(joints.names)
    translations, scales = np.zeros((count, 3)), np.ones((count, 3))
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
    place = {source: row for row, source in enumerate(joints.sources) if source >= 0}
    worlds: list[Floats] = []
    for row, (source, above) in enumerate(zip(joints.sources, joints.parents, strict=True)):
        parent = np.eye(4) if above < 0 else worlds[above]
        wanted = np.asarray(np.linalg.solve(parent, joints.worlds[row]), dtype=np.float64)
        turn, shift, model = np.eye(3), np.zeros(3), joints.models.get(row, -1)
        if source >= 0:
            turn, shift = turns[source], shifts[source]
        elif model >= 0:
            turn, shift = flip[:, None] * turns[model] * flip, flip * shifts[model]
        translations[row] = wanted[:3, 3] - shift
        if source >= 0 and above == place.get(int(old.parents[source]), -1):
            rotations[row], scales[row] = old.rest_rotations[source], old.rest_scales[source]
        else:
            # The linear part is Q R S: the lengths of its columns are S, and Q follows. Shear by
            # uneven scales above cannot be represented; inverse bind matrices compensate for it.
            scales[row] = np.linalg.norm(wanted[:3, :3], axis=0)
            pure = nearest_rotations(wanted[:3, :3] / scales[row])[0] @ turn.T
            rotations[row] = matrix_to_quaternion(pure[None])[0]
        linear = quaternion_to_matrix(rotations[row][None])[0] @ turn * scales[row]
        worlds.append(parent @ affine_matrices(linear, wanted[:3, 3]))
    owners, kinds, values, limits = _dofs(old, joints, axis)
    human = old.humanoid
    if human is not None:
        bones = human.joints.items()
        human = Humanoid({bone: place[joint] for bone, joint in bones if joint in place})
    hidden = old.auxiliary
    if hidden is not None:
        hidden = np.array([source >= 0 and bool(hidden[source]) for source in joints.sources])
    return replace(
        old,
        names=tuple(joints.names),
        parents=np.array(joints.parents, dtype=np.int32),
        rest_translations=translations,
        rest_rotations=rotations,
        rest_scales=scales,
        dof_joints=owners,
        dof_kinds=kinds,
        rest_dofs=values,
        dof_limits=limits,
        boxes=None,
        boxes_from_bones=False,
        auxiliary=hidden,
        humanoid=human,
    )


def _dofs(old: Skeleton, joints: _Joints, axis: int) -> tuple[Ints, Ints, Floats, Floats]:
    """Return the DOF table: joints, kinds, values at rest and limits."""
    owners, kinds, values, limits = [], [], [], []
    for row, source in enumerate(joints.sources):
        model = joints.models.get(row, source)
        if model < 0:
            owners += [row] * 3
            kinds += [3, 4, 5]
            values += [0.0] * 3
            limits += [[-np.inf, np.inf]] * 3
            continue
        for dof in np.flatnonzero(old.dof_joints == model).tolist():
            kind, value = int(old.dof_kinds[dof]), float(old.rest_dofs[dof])
            ends = old.dof_limits[dof].tolist()
            if source < 0 and (kind % 3 == axis) != (kind >= FIRST_ROTATION):
                # Reflection along an axis reverses translations along it, and rotations about
                # the other two. Translations are in the axes of the joint above: they are mirror
                # images if these are symmetric.
                value, ends = -value, [-ends[1], -ends[0]]
            owners.append(row)
            kinds.append(kind)
            values.append(value)
            limits.append(ends)
    table = np.array(owners, dtype=np.int32), np.array(kinds, dtype=np.int32)
    return *table, np.array(values), np.array(limits).reshape(-1, 2)
