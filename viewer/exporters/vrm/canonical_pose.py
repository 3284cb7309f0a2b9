"""Figures in the form of VRM 1.0: in metres, y up, on the ground, facing +z, in a T-pose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from viewer.rigs.arrays import Floats
from viewer.rigs.blendshapes import BlendShapes
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.quaternion import between
from viewer.rigs.geometry.rotation import (
    matrix_to_quaternion,
    nearest_rotations,
    quaternion_to_matrix,
)
from viewer.rigs.geometry.vectors import axes_along, axis_vector, unit
from viewer.rigs.humanoid import Humanoid
from viewer.rigs.kinematics import joint_worlds, world_matrices
from viewer.rigs.placed_figure import placed
from viewer.rigs.pose import Pose, joint_rotations, local_matrices, rest_pose
from viewer.rigs.shape import shaped
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.units import METRES

_PAIRS = ("UpperLeg", "UpperArm")
_SMALL = 1e-6  # radians
_NEAR = 0.02  # fraction of the height within which a figure counts as standing on the ground
_TARGETS = {"Arm": (1.0, 0.0, 0.0), "Leg": (0.0, -1.0, 0.0)}
_BELOW = {"UpperArm": "LowerArm", "LowerArm": "Hand", "UpperLeg": "LowerLeg", "LowerLeg": "Foot"}


def standing(figure: Figure, pose: Pose, bones: Mapping[str, int]) -> Figure:
    """Return a figure in VRM's axes and unit, without DOFs; a shape that moves joints is baked."""
    shapes = figure.blend_shapes
    if figure.joint_regressor is not None and shapes is not None:
        figure, shapes = shaped(figure, pose.shape_weights), None
    skeleton = figure.require_skeleton()
    local = local_matrices(skeleton, pose)
    joints = world_matrices(skeleton, pose)[:, :3, 3]
    turn = _axes(figure, joints, bones)
    scale = METRES.get(figure.unit, 1.0)
    matrix = np.eye(4)
    matrix[:3, :3] = scale * turn
    # A VRM character keeps its height above the ground.
    if figure.record is None or figure.record.vrm is None:
        up = scale * turn[1]
        points = joints if figure.mesh is None else np.concatenate([joints, figure.mesh.positions])
        heights = points @ up
        low = float(heights.min())
        matrix[1, 3] = -low if abs(low) > _NEAR * float(np.ptp(heights)) else 0.0
    return _transformed(figure, shapes, pose, local, matrix, bones)


def facing_front(figure: Figure, bones: Mapping[str, int]) -> Figure:
    """Return a VRM 0.x character, which faces -z, rotated by 180 degrees about y."""
    skeleton = figure.require_skeleton()
    pose = rest_pose(skeleton)
    matrix = np.diag([-1.0, 1.0, -1.0, 1.0])
    local = local_matrices(skeleton, pose)
    return _transformed(figure, figure.blend_shapes, pose, local, matrix, bones)


def _transformed(
    figure: Figure,
    shapes: BlendShapes | None,
    pose: Pose,
    local: Floats,
    matrix: Floats,
    bones: Mapping[str, int],
) -> Figure:
    """Return a figure in a pose of its joints, moved by (4, 4), without DOFs."""
    skeleton = figure.require_skeleton()
    plain = Skeleton(
        names=skeleton.names,
        parents=skeleton.parents,
        rest_translations=local[:, :3, 3],
        rest_rotations=matrix_to_quaternion(joint_rotations(skeleton, pose)),
        rest_scales=pose.scales,
        dof_joints=np.zeros(0, np.int32),
        dof_kinds=np.zeros(0, np.int32),
        rest_dofs=np.zeros(0),
        dof_limits=np.zeros((0, 2)),
        auxiliary=skeleton.auxiliary,
        humanoid=Humanoid(dict(bones)),
        constraints=skeleton.constraints,
    )
    posed = replace(
        figure, skeleton=plain, up="y", unit="m", correctives=None, joint_regressor=None, hands=(),
        pose_layout=None, body_parts=None, keypoints=None, reduced=None, symmetry=None, fields=(),
        blend_shapes=shapes, animations=(),
    )  # fmt: skip
    return placed(posed, matrix)


def vrm_axes(figure: Figure, pose: Pose, bones: Mapping[str, int]) -> Floats:
    """Return the rotation from the axes of a figure in its rest pose to those of VRM: (3, 3)."""
    skeleton = figure.require_skeleton()
    return _axes(figure, world_matrices(skeleton, pose)[:, :3, 3], bones)


def _axes(figure: Figure, places: Floats, bones: Mapping[str, int]) -> Floats:
    """Return the rotation that turns the figure's left side to +x and its top to +y: (3, 3)."""
    up = axis_vector(figure.up)
    across = sum(places[bones[f"left{name}"]] - places[bones[f"right{name}"]] for name in _PAIRS)
    left = unit(np.asarray(across) - up * float(np.dot(across, up)))
    if not left.any():
        left = np.array([1.0, 0.0, 0.0])
    return axes_along(up, left).T


def in_t_pose(figure: Figure, bones: Mapping[str, int]) -> tuple[Figure, float]:
    """Return a figure with horizontal arms and vertical legs, and the largest rotation, radians."""
    skeleton = figure.require_skeleton()
    rotations, largest = skeleton.rest_rotations.copy(), 0.0
    for bone, sign in ((b, s) for s in (1.0, -1.0) for b in _BELOW):
        side = "left" if sign > 0.0 else "right"
        joint, below = bones[f"{side}{bone}"], bones[f"{side}{_BELOW[bone]}"]
        linear = quaternion_to_matrix(rotations) * skeleton.rest_scales[:, None, :]
        world = joint_worlds(skeleton.parents, linear, skeleton.rest_translations)
        away = unit(world[below, :3, 3] - world[joint, :3, 3])
        wanted = np.array(_TARGETS[bone[-3:]]) * (sign if bone.endswith("Arm") else 1.0)
        angle = float(np.arccos(np.clip(away @ wanted, -1.0, 1.0)))
        if angle < _SMALL or not away.any():
            continue
        largest = max(largest, angle)
        parent = int(skeleton.parents[joint])
        above = unit_rotation(world[parent]) if parent >= 0 else np.eye(3)
        own = quaternion_to_matrix(rotations[joint])
        turn = quaternion_to_matrix(between(away, wanted))
        rotations[joint] = matrix_to_quaternion(above.T @ turn @ above @ own)
    return replace(figure, skeleton=replace(skeleton, rest_rotations=rotations)), largest


def unit_rotation(matrix: Floats) -> Floats:
    """Return the rotation of a matrix without shear: (3, 3)."""
    linear = matrix[:3, :3]
    lengths = np.linalg.norm(linear, axis=0)
    # A scale of 0 flattens or hides what is below a joint.
    found: Floats = linear / lengths if lengths.all() else nearest_rotations(linear)[0]
    return found
