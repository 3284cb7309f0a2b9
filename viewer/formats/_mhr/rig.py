"""The rig of MHR, ``rig.npz``: skeleton, parameter transform and bind pose."""

from __future__ import annotations

import numpy as np

from viewer.formats._archive.checking import are_indices, finite
from viewer.formats._archive.values import Archive
from viewer.rig.arrays import Floats
from viewer.rig.bodies.model_parameters import PER_JOINT, ModelParameters, driven_dofs
from viewer.rig.bodies.network_feature import NetworkFeature
from viewer.rig.geometry.rotation import quaternion_to_matrix
from viewer.rig.skeleton import Skeleton

__all__ = ["bind_matrices", "read_feature", "read_parameters", "read_skeleton"]

_VERSION = 1


def read_skeleton(archive: Archive, parameters: ModelParameters) -> Skeleton:
    """Return the skeleton, with a DOF for each joint parameter that model parameters drive."""
    offsets = _floats(archive, "joint_offsets", (None, 3), "joints")
    count = len(offsets)
    parents = archive.array("joint_parents", (count,)).values()
    places = np.arange(count)
    is_root = parents < 0
    wrong = np.flatnonzero((parents >= places) | (parents % 1 != 0) | (is_root != (places == 0)))
    if len(wrong):
        joint = int(wrong[0])
        key = "F002.root" if joint == 0 else "S001.parent"
        found = float(parents[joint])
        raise archive.fault(key, item="joint_parents", joint=joint, found=found)
    rotations = _quaternions(archive, "joint_prerotations", count)
    joints, kinds = driven_dofs(parameters.transform)
    return Skeleton(
        names=tuple(map(str, archive.array("joint_names", (count,), "SU").values().tolist())),
        parents=np.where(is_root, -1, parents).astype(np.int32),
        rest_translations=offsets,
        rest_rotations=rotations,
        rest_scales=np.ones((count, 3)),
        dof_joints=joints,
        dof_kinds=kinds,
        rest_dofs=np.zeros(len(joints)),
        # Momentum's limits are soft: fitted parameters may exceed them, and are shown unchanged.
        dof_limits=np.tile([-np.inf, np.inf], (len(joints), 1)),
    )


def read_parameters(archive: Archive, n_shapes: int) -> ModelParameters:
    """Return the model parameters, without those of the blend shapes, which come last."""
    version = archive.array("schema_version", ()).values()
    if int(version) != _VERSION:
        raise archive.fault("F002.mhr-version", item="schema_version", found=int(version))
    n_joints = archive.array("joint_offsets", (None, 3)).shape[0]
    transform = _floats(archive, "parameter_transform", (PER_JOINT * n_joints, None))
    names = archive.array("parameter_names", (transform.shape[1],), "SU").values().tolist()
    count = transform.shape[1] - n_shapes
    if count < 0 or transform[:, count:].any():
        found = transform.shape[1]
        raise archive.fault(
            "F002.mhr-parameters", item="parameter_transform", found=found, n=n_shapes
        )
    return ModelParameters(tuple(map(str, names[:count])), transform[:, :count])


def read_feature(archive: Archive, n_joints: int, n_weights: int) -> NetworkFeature:
    """Return the feature of the correctives."""
    indices = archive.array("0.sparse_indices", (2, None)).values()
    entries = _floats(archive, "0.sparse_weight", (indices.shape[1],))
    for row, end in enumerate((n_weights, 6 * (n_joints - 2))):
        if not are_indices(indices[row], end):
            raise archive.fault("F002.mhr-index", item="0.sparse_indices", last=end - 1)
    outputs, inputs = indices.astype(np.int32)
    return NetworkFeature(n_joints, n_weights, outputs, inputs, entries)


def bind_matrices(archive: Archive, n_joints: int) -> Floats:
    """Return the inverse bind matrices, stored as translation, quaternion and scale: (J, 4, 4)."""
    key = "inverse_bind_pose"
    rows = _floats(archive, key, (n_joints, 8), "bindings")
    if not rows[:, 3:7].any(axis=1).all():
        raise archive.fault("F002.mhr-quaternion", item=key)
    matrices = np.tile(np.eye(4), (n_joints, 1, 1))
    matrices[:, :3, :3] = quaternion_to_matrix(rows[:, 3:7]) * rows[:, 7:, None]
    matrices[:, :3, 3] = rows[:, :3]
    return matrices


def _quaternions(archive: Archive, key: str, count: int) -> Floats:
    values = _floats(archive, key, (count, 4))
    if not values.any(axis=1).all():
        raise archive.fault("F002.mhr-quaternion", item=key)
    return values / np.linalg.norm(values, axis=1, keepdims=True)


def _floats(archive: Archive, key: str, shape: tuple[int | None, ...], part: str = "") -> Floats:
    return finite(archive, key, archive.array(key, shape).values())
