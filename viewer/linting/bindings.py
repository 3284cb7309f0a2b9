"""Checks of bind matrices: invertibility, and agreement with the skeleton at rest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from viewer.linting._finding import Finding
from viewer.linting._mirror import name_partners
from viewer.linting._subject import Indices, Subject
from viewer.phrases import counted, listed
from viewer.rigs.arrays import Bools, Floats, Ints, largest_first
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import angles_of_pairs, nearest_rotations
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.hierarchy import descendants
from viewer.rigs.inspection.faults import are_usable, bind_faults
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.pose import rest_pose
from viewer.rigs.shape import rest_joints
from viewer.rigs.skeleton import Skeleton, joint_labels
from viewer.rigs.skin import Skin, bind_positions, moves_vertices

# Fraction of the figure's size: smaller differences are rounding errors of old files.
_ELSEWHERE = 0.01
_ASTRAY = np.radians(5.0)  # smallest rotation of a joint that is seen
_SHORT = 1e-3  # relative length below which a bone has no direction
_SEVERAL = 8  # minimum number of joints that show what is usual
_FEW = 0.25  # maximum fraction of joints that are exceptions
_SHIFTED = 0.02  # smallest distance, in sizes, of a single joint from where it was bound


def check(subject: Subject) -> Iterator[Finding]:
    """Check the inverse bind matrices of a figure with a skin."""
    figure = subject.actor.figure
    if figure.skin is None or figure.skin.n_joints == 0:
        return
    yield from subject.faults(bind_faults(figure, subject.invalid))
    usable = subject.valid("bindings", figure.skin.n_joints) & are_usable(figure.skin)
    shifted = [*_shifted(subject, figure, usable)]
    named = [joint for found in shifted for joint in found.joints.tolist()]
    yield from _elsewhere(subject, figure, usable, named)
    yield from _rotated(subject, figure, usable)
    yield from shifted


def _elsewhere(
    subject: Subject, figure: Figure, usable: Bools, named: Sequence[int]
) -> Iterator[Finding]:
    """Compare the joints' bind positions with those of the skeleton.

    ``named``: joints of another finding, which move those below them.
    """
    skin, skeleton = figure.skin, figure.skeleton
    if skin is None or figure.mesh is None or skeleton is None:
        return
    known = _placed(subject, skeleton) & usable
    for joint in named:
        known &= ~descendants(skeleton.parents, joint)
    matrices = np.where(usable[:, None, None], skin.inverse_bind, np.eye(4))
    bound = np.linalg.inv(matrices)[:, :3, 3]
    own = world_matrices(skeleton, rest_pose(skeleton))[:, :3, 3]
    least = _ELSEWHERE * subject.size()
    if _is_bound_at_zero(skeleton, bound[known], known, least):
        return
    both = [np.linalg.norm(bound - joints, axis=1) for joints in (rest_joints(figure), own)]
    distances = min((np.where(known, part, 0.0) for part in both), key=np.max)
    away = np.flatnonzero(distances > least)
    if len(away) == 0:
        return
    away = largest_first(away, distances)
    first = int(away[0])
    yield subject.found(
        "B004.joints: {n} from the rest pose (worst: {joint} by {distance}), so the mesh is "
        "deformed at rest",
        n=counted(
            len(away), "joint", "has a bind pose that differs", "have bind poses that differ"
        ),
        joint=joint_labels(skeleton)[first],
        distance=subject.length(float(distances[first])),
        joints=away,
        at=("bindings", first),
    )


def _is_bound_at_zero(skeleton: Skeleton, bound: Floats, known: Bools, least: float) -> bool:
    """Return whether joints are bound where they are with all DOFs 0, up to one translation.

    Skins of the course are; the pose in the ``.skel`` and the root's motion move them from there.
    ``bound``: bind positions (K, 3) of the known joints. ``least``: distance that is a difference.
    """
    pose = rest_pose(skeleton)
    # One joint is always where another is, up to a translation.
    if len(pose.dofs) == 0 or len(bound) < 2:
        return False
    pose.dofs[:] = 0.0
    steps = bound - world_matrices(skeleton, pose)[known, :3, 3]
    return bool(np.linalg.norm(steps - steps.mean(axis=0), axis=1).max() <= least)


def _placed(subject: Subject, skeleton: Skeleton) -> Bools:
    """Return the joints whose place at rest is known: they and those above are valid: (J,)."""
    known = subject.valid("joints", skeleton.n_joints)
    for joint, parent in enumerate(skeleton.parents.tolist()):
        known[joint] &= parent < 0 or bool(known[parent])
    return known


def _rotated(subject: Subject, figure: Figure, usable: Bools) -> Iterator[Finding]:
    """Report single joints that are bound with another rotation than most."""
    skin, skeleton = figure.skin, figure.skeleton
    if skin is None or skeleton is None or figure.mesh is None:
        return
    known = _placed(subject, skeleton) & usable
    used = np.flatnonzero(moves_vertices(skin) & known)
    if len(used) < _SEVERAL:
        return
    angles = _angles_at_rest(skin, skeleton, used)
    # If the mesh is bound in another pose, bones still leave their joints in the same direction.
    if (angles > _ASTRAY).sum() > _FEW * len(used):
        angles = _angles_to_children(skin, skeleton, used)
    off = np.flatnonzero(angles > _ASTRAY)
    if len(off) == 0 or len(off) > _FEW * np.isfinite(angles).sum():
        return  # a note says that bind and rest pose differ
    off = largest_first(off, angles)
    joints, labels = used[off], joint_labels(skeleton)
    yield subject.found(
        "B007.rotations: {n} bound with a rotation that differs from the rest pose: {names} "
        "(worst: {joint} by {angle:.0f}°)",
        n=counted(len(joints), "joint", "is", "are"),
        names=listed([labels[joint] for joint in joints]),
        joint=labels[joints[0]],
        angle=float(np.degrees(angles[off[0]])),
        joints=joints,
        at=("bindings", int(joints[0])),
    )


def _shifted(subject: Subject, figure: Figure, usable: Bools) -> Iterator[Finding]:
    """Report single joints that are bound at another place than at rest, while most are not."""
    skin, skeleton = figure.skin, figure.skeleton
    if skin is None or skeleton is None or figure.mesh is None:
        return
    used = np.flatnonzero(moves_vertices(skin) & _placed(subject, skeleton) & usable)
    if len(used) < _SEVERAL:
        return
    # Where each joint (J) is at rest, and where the movement of each (R) would put it.
    moves = world_matrices(skeleton, rest_pose(skeleton))[used] @ skin.inverse_bind[used]
    places = bind_positions(skin)[used]
    put = np.einsum("rab,jb->rja", moves[:, :3, :3], places) + moves[:, None, :3, 3]
    apart = np.linalg.norm(put - np.einsum("jja->ja", put), axis=2)
    limit = _SHIFTED * subject.size()
    usual = int((apart < limit).sum(axis=1).argmax())
    distances, is_off = np.zeros((2, skeleton.n_joints))
    distances[used] = apart[usual]
    is_off[used] = apart[usual] > limit
    # Joints below one that is shifted move with it. Both sides are shifted in another pose.
    row = np.full(skeleton.n_joints, -1)
    row[used] = np.arange(len(used))
    partners, off = name_partners(skeleton), list[int]()
    for joint in np.flatnonzero(is_off).tolist():
        above, other = row[skeleton.parents[joint]], int(partners[joint])
        follows = skeleton.parents[joint] >= 0 and above >= 0 and apart[above, row[joint]] < limit
        if not follows and not (other not in (-1, joint) and is_off[other]):
            off.append(joint)
    if not off or is_off.sum() > 0.5 * len(used) or len(off) > _FEW * len(used):
        return  # a note says that bind and rest pose differ
    joints, labels = np.array(off)[np.argsort(-distances[off])], joint_labels(skeleton)
    yield subject.found(
        "B007.places: {n} bound elsewhere than at rest: {names} (worst: {joint} by {distance})",
        n=counted(len(joints), "joint", "is", "are"),
        names=listed([labels[joint] for joint in joints]),
        joint=labels[joints[0]],
        distance=subject.length(float(distances[joints[0]])),
        joints=joints,
        at=("bindings", int(joints[0])),
    )


def _angles_at_rest(skin: Skin, skeleton: Skeleton, used: Indices) -> Floats:
    """Return by how much joints (N,) rotate the mesh at rest, compared with most of them: (N,)."""
    worlds = world_matrices(skeleton, rest_pose(skeleton))[used]
    turns, _ = nearest_rotations((worlds @ skin.inverse_bind[used])[:, :3, :3])
    angles = angles_of_pairs(turns)
    # The pose of most joints is that of the mesh.
    return angles[int((angles < _ASTRAY).sum(axis=1).argmax())]


def _angles_to_children(skin: Skin, skeleton: Skeleton, used: Indices) -> Floats:
    """Return the angle of joints (N,) between their bones at rest and as bound; NaN without bones.

    Of several children, that with the smallest angle counts: one may have been moved.
    """
    smallest = np.full(skeleton.n_joints, np.inf)
    above, rest, bound = bone_directions(skin, skeleton, used)
    cosines = np.einsum("na,na->n", bound, rest)
    np.minimum.at(smallest, above, np.arccos(np.clip(cosines, -1.0, 1.0)))
    result = smallest[used]
    return np.where(np.isfinite(result), result, np.nan)


def bone_directions(skin: Skin, skeleton: Skeleton, below: Indices) -> tuple[Ints, Floats, Floats]:
    """Return parents (N,) of joints, and the unit vectors to these at rest and as bound: (N, 3).

    The position of a child, in the space of its parent, does not depend on the pose. Joints at
    their parents are left out.
    """
    rest = np.linalg.norm(skeleton.rest_translations[below], axis=1)
    apart = rest > _SHORT * np.abs(skeleton.rest_translations).max()
    below = below[(skeleton.parents[below] >= 0) & apart]
    above = skeleton.parents[below]
    matrices = skin.inverse_bind[above]
    bound = np.einsum("nab,nb->na", matrices[:, :3, :3], bind_positions(skin)[below])
    return above, unit(skeleton.rest_translations[below]), unit(bound + matrices[:, :3, 3])
