"""Left-right symmetry: a figure's mirror plane, its joint pairs, and mirrored poses."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from viewer.arguments import check_type
from viewer.diagnostics import Phrase, note
from viewer.errors import RigError
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.vectors import reflected
from viewer.rigs.kinematics import rest_world_rotations, world_rotations
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.pose import Pose, joint_rotations, set_joint_rotations
from viewer.rigs.retargeting.joint_names import joint_meanings, sided_words
from viewer.rigs.shape import rest_joints
from viewer.rigs.skeleton import Skeleton, clamp_dofs

# Maximum distance of a joint from its counterpart's mirror image, relative to the figure's size.
_NEAR = 0.02
_OTHER = {"left": "right", "right": "left"}


def mirror_axis(figure: Figure) -> int:
    """Return the axis of symmetry: the map's best, or else 1 for z-up figures and 0 for others."""
    if figure.symmetry is None or figure.mesh is None:
        return 1 if figure.up == "z" else 0
    errors = [_mirror_distances(figure, axis).max() for axis in range(3)]
    return int(np.argmin(errors))


def asymmetry(figure: Figure) -> Floats:
    """Return rest vertices' distances from mirrored counterparts (V,); RigError without a map."""
    if figure.symmetry is None or figure.mesh is None:
        raise RigError(f"figure {figure.name} has no symmetry map")
    return _mirror_distances(figure, mirror_axis(figure))


def _mirror_distances(figure: Figure, axis: int) -> Floats:
    mesh = figure.require_mesh()
    assert figure.symmetry is not None  # checked by the callers
    images = reflected(mesh.positions[figure.symmetry], axis)
    return np.linalg.norm(mesh.positions - images, axis=1)


def joint_partners(figure: Figure) -> Ints:
    """Return each joint's mirror counterpart (J,), nearest at the same depth; itself if central.

    RigError if a joint has none within 2 % of the figure's size.
    """
    skeleton = figure.skeleton
    if skeleton is None:
        raise RigError(
            note("F004.mirror: figure {figure} has no skeleton to mirror", figure=figure.name)
        )
    joints = rest_joints(figure)
    axis = mirror_axis(figure)
    mirrored = reflected(joints, axis, joints[0, axis])
    depths = np.zeros(skeleton.n_joints, dtype=int)
    for joint, parent in enumerate(skeleton.parents):
        depths[joint] = depths[parent] + 1 if parent >= 0 else 0
    distances = np.linalg.norm(mirrored[:, None] - joints[None], axis=2)
    distances[depths[:, None] != depths[None]] = np.inf
    partners = distances.argmin(axis=1).astype(np.int32)
    size = box_size(bounding_box(joints))
    far = np.flatnonzero(distances[np.arange(len(joints)), partners] > _NEAR * size)
    if len(far) or (partners[partners] != np.arange(len(joints))).any():
        name = skeleton.names[int(far[0])] if len(far) else Phrase("two joints")
        raise RigError(
            note(
                "F004.asymmetric: {joint} has no mirror counterpart: the skeleton is not symmetric",
                joint=name,
            )
        )
    return partners


def posing_partners(figure: Figure) -> Ints:
    """Return counterparts (J,) for mirrored poses; -1 for joints of one side, such as a sword.

    They are ``joint_partners`` if the skeleton is symmetric. Otherwise stated human bones and names
    (``Ear_L``, ``Ear_R``) find them, and joints in the mirror plane are their own. RigError if the
    file states no human bones.
    """
    try:
        return joint_partners(figure)
    except RigError:
        skeleton = figure.skeleton
        if skeleton is None or skeleton.humanoid is None:
            raise
    keys = [
        _sided(meaning) if meaning else named
        for meaning, named in zip(
            joint_meanings(skeleton), sided_words(skeleton.names), strict=True
        )
    ]
    partners = word_partners(keys)
    is_own = partners == np.arange(skeleton.n_joints)
    joints, axis = rest_joints(figure), mirror_axis(figure)
    pairs = np.flatnonzero((partners >= 0) & ~is_own)
    plane = joints[pairs if len(pairs) else [0], axis].mean()
    near = np.abs(joints[:, axis] - plane) <= _NEAR * box_size(bounding_box(joints))
    partners[is_own & ~near] = -1
    return partners


def word_partners(words: Sequence[tuple[str, str]]) -> Ints:
    """Return the joint of the other side with the same word (J,); itself without a side; or -1.

    ``words``: side and word of each joint, as of ``sided_words``. Words that several joints of a
    side have make no pairs.
    """
    counts, place = Counter(words), {word: joint for joint, word in enumerate(words)}
    partners = np.arange(len(words), dtype=np.int32)
    for joint, (side, word) in enumerate(words):
        if side:
            other = (_OTHER[side], word)
            partners[joint] = place[other] if counts[other] == 1 == counts[side, word] else -1
    return partners


def _sided(meaning: str) -> tuple[str, str]:
    """Return side and word: ``("left", "hip")`` of ``left_hip``, ``("", "neck")`` of ``neck``."""
    side, _, word = meaning.partition("_")
    return (side, word) if side in ("left", "right") else ("", meaning)


def mirror_pose(figure: Figure, pose: Pose) -> Pose:
    """Return the mirrored pose, with left and right exchanged.

    World rotations relative to the rest pose are reflected, D' = F D F, and each joint gets the
    rotation of its counterpart; rest rotations may therefore differ between the sides. Joints
    without a counterpart keep their local rotation.

    Parameters
    ----------
    figure
        Figure with a symmetric skeleton.
    pose
        Not modified.

    Returns
    -------
    Pose
        Mirrored pose with the same shape; the figure's translation is mirrored too.

    Raises
    ------
    RigError
        If the skeleton is not symmetric and the file states no human bones.
    """
    check_type("figure", figure, Figure)
    check_type("pose", pose, Pose)
    partners = posing_partners(figure)
    skeleton = figure.require_skeleton()
    is_alone = partners < 0
    partners = np.where(is_alone, np.arange(skeleton.n_joints), partners)
    flip = np.ones(3)
    flip[mirror_axis(figure)] = -1.0
    rest = rest_world_rotations(skeleton)
    present = joint_rotations(skeleton, pose)
    posed = world_rotations(skeleton.parents, present)
    # F D F with F = diag(flip) is a proper rotation again: the two reflections cancel out.
    deltas = posed @ np.swapaxes(rest, 1, 2)
    wanted = (flip[:, None] * deltas[partners] * flip) @ rest
    for joint in np.flatnonzero(is_alone & (skeleton.parents >= 0)):
        wanted[joint] = wanted[skeleton.parents[joint]] @ present[joint]
    local = wanted.copy()
    below = np.flatnonzero(skeleton.parents >= 0)
    local[below] = np.swapaxes(wanted[skeleton.parents[below]], 1, 2) @ wanted[below]
    mirrored = pose.copy()
    set_joint_rotations(skeleton, mirrored, np.arange(skeleton.n_joints, dtype=np.int32), local)
    _mirror_moves(skeleton, pose, mirrored, partners, flip, rest)
    mirrored.translations[is_alone] = pose.translations[is_alone]
    return mirrored


def _mirror_moves(
    skeleton: Skeleton, pose: Pose, mirrored: Pose, partners: Ints, flip: Floats, rest: Floats
) -> None:
    """Mirror the translations of the figure and of joints, and exchange scales."""
    mirrored.figure_translation[:] = pose.figure_translation * flip
    mirrored.scales[:] = pose.scales[partners]
    # A joint's translation is in its parent's frame: t' = P'^T F P t.
    parents = skeleton.parents
    frames = np.where((parents >= 0)[:, None, None], rest[parents], np.eye(3))
    carry = np.swapaxes(frames, 1, 2) @ (flip[:, None] * frames[partners])
    mirrored.translations[:] = np.einsum("jab,jb->ja", carry, pose.translations[partners])
    rows = np.flatnonzero(skeleton.dof_kinds < 3)
    joints, kinds = skeleton.dof_joints[rows], skeleton.dof_kinds[rows]
    moves = np.zeros((skeleton.n_joints, 3))
    moves[joints, kinds] = pose.dofs[rows]
    mirrored.dofs[rows] = np.einsum("jab,jb->ja", carry, moves[partners])[joints, kinds]
    mirrored.dofs[:] = clamp_dofs(skeleton, mirrored.dofs)
