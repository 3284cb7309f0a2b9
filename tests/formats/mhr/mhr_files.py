"""A tiny MHR model with the keys of its portable files, and its forward model computed with states.
A state is a translation, a quaternion (x, y, z, w) and a scale, as in Momentum: states are
multiplied, and map points to t + q (s p). No matrices are used.
"""

import numpy as np

PARENTS = (-1, 0, 1, 1, 3)
N_JOINTS, N_VERTICES, N_OUTPUTS = len(PARENTS), 7, 6
N_IDENTITY, N_EXPRESSIONS = 45, 3
N_SHAPES = N_IDENTITY + N_EXPRESSIONS
_RIGID = ("root_tx", "root_ty", "root_tz", "root_rx")
NAMES = (*_RIGID, "hip_ry", "knee_rz", "twist", "scale_all", "arm")
LIMITED = {5: (-0.5, 2.0), 6: (-1.0, 1.0), 4: (-0.25, 0.75)}


def rig(**changes):
    """Return the arrays of ``rig.npz``."""
    generator = np.random.default_rng(3)
    transform = np.zeros((7 * N_JOINTS, len(NAMES) + N_SHAPES), np.float32)
    for parameter in range(3):
        transform[parameter, parameter] = 1.0
    transform[3, 3] = 1.0  # root rx
    transform[7 * 2 + 4, 4] = -1.0  # joint 2 ry
    transform[7 * 3 + 5, 5] = 1.0  # joint 3 rz
    transform[[7 * 3 + 3, 7 * 4 + 3], 6] = 0.75, 0.25  # rx of two joints
    transform[[6, 7 * 3 + 6], 7] = 1.0, -0.5  # scales
    transform[[7 * 4 + 1, 7 * 4 + 6], 8] = 2.0, 0.5  # length and scale of the last joint
    mask = generator.random((N_OUTPUTS, 6 * (N_JOINTS - 2))) < 0.5
    chosen = np.stack(np.nonzero(mask))
    bind = np.zeros((N_JOINTS, 8), np.float32)
    bind[:, :3] = generator.uniform(-2.0, 2.0, (N_JOINTS, 3))
    bind[:, 3:7] = unit(generator.normal(size=(N_JOINTS, 4)))
    bind[:, 7] = 1.0
    arrays = {
        "schema_version": np.array(1, np.int64),
        "source_momentum_version": np.array("0.1"),
        "parameter_transform": transform,
        "pose_parameters": np.arange(transform.shape[1]) < 7,
        "rigid_parameters": np.arange(transform.shape[1]) < 4,
        "scaling_parameters": np.isin(np.arange(transform.shape[1]), (7, 8)),
        "active_joints": np.ones(N_JOINTS, np.bool_),
        "parameter_names": np.array([*NAMES, *(f"blend_{k}" for k in range(N_SHAPES))]),
        "joint_offsets": generator.uniform(-9.0, 9.0, (N_JOINTS, 3)).astype(np.float32),
        "joint_prerotations": unit(generator.normal(size=(N_JOINTS, 4))).astype(np.float32),
        "joint_parents": np.array(PARENTS, np.int32),
        "joint_names": np.array([f"joint_{j}" for j in range(N_JOINTS)]),
        "fk_indices": np.array([[1, 2, 3, 4], [0, 1, 1, 3]], np.int64),
        "fk_sizes": np.array([1, 2, 1], np.int64),
        "inverse_bind_pose": bind,
        "limit_min": np.array([low for low, _ in LIMITED.values()], np.float32),
        "limit_max": np.array([high for _, high in LIMITED.values()], np.float32),
        "limit_weight": np.ones(len(LIMITED), np.float32),
        "limit_parameter_index": np.array(list(LIMITED), np.int32),
        "0.sparse_indices": chosen.astype(np.int64),
        "0.sparse_weight": generator.normal(size=chosen.shape[1]).astype(np.float32),
        "posedirs_sparse_mask": mask,
    }
    return arrays | changes


def lod(level=1, **changes):
    """Return the arrays of ``lodN.npz``, in which the level determines the shape."""
    generator = np.random.default_rng(level)
    weights = generator.random((N_VERTICES, 4)).astype(np.float32)
    offsets = generator.normal(size=(N_OUTPUTS, N_VERTICES, 3))
    weights[:, 3] = 5e-6  # ignored by the published skinning
    arrays = {
        "schema_version": np.array(1, np.int64),
        "lod": np.array(level, np.int64),
        "base_shape": generator.uniform(-9.0, 9.0, (N_VERTICES, 3)).astype(np.float32),
        "shape_vectors": generator.normal(size=(N_SHAPES, N_VERTICES, 3)).astype(np.float32),
        "faces": np.array([[0, 1, 2], [2, 3, 4], [4, 5, 6]], np.int32),
        "texcoords": generator.random((4, 2)).astype(np.float32),
        "texcoord_faces": np.array([[0, 1, 2], [1, 2, 3], [3, 0, 1]], np.int32),
        "skin_indices": generator.integers(0, N_JOINTS, (N_VERTICES, 4)).astype(np.int32),
        "skin_weights": weights,
        "corrective_blendshapes": offsets.astype(np.float32),
    }
    return arrays | changes


def write(folder, levels=(1,), rig_changes=None, lod_changes=None):
    """Write the files; arrays set to None are left out."""
    folder.mkdir(parents=True, exist_ok=True)
    contents = {"rig": rig(**(rig_changes or {}))}
    contents |= {f"lod{level}": lod(level, **(lod_changes or {})) for level in levels}
    for name, arrays in contents.items():
        kept = {key: value for key, value in arrays.items() if value is not None}
        np.savez_compressed(folder / f"{name}.npz", **kept)
    return folder


def unit(quaternions):
    return quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True)


def multiplied(first, second):
    """Return the Hamilton product of two quaternions."""
    u, a, v, b = first[:3], first[3], second[:3], second[3]
    return np.append(a * v + b * u + np.cross(u, v), a * b - u @ v)


def rotated(quaternion, point):
    axis, real = quaternion[:3], quaternion[3]
    return point + 2.0 * np.cross(axis, np.cross(axis, point) + real * point)


def about(axis, angle):
    return np.append(np.sin(0.5 * angle) * np.eye(3)[axis], np.cos(0.5 * angle))


def forward(identity, parameters, expression, level=1):
    """Return vertices and joint states by the published equations."""
    own, mesh = rig(), lod(level)
    whole = np.concatenate([parameters, np.zeros(N_SHAPES)])
    joints = (own["parameter_transform"].astype(np.float64) @ whole).reshape(-1, 7)
    states = []
    for joint, (tx, ty, tz, rx, ry, rz, octaves) in enumerate(joints):
        turn = multiplied(about(2, rz), multiplied(about(1, ry), about(0, rx)))
        turn = multiplied(unit(own["joint_prerotations"][joint].astype(np.float64)), turn)
        place = own["joint_offsets"][joint].astype(np.float64) + np.array([tx, ty, tz])
        scale = np.exp2(octaves)
        if PARENTS[joint] >= 0:
            t, q, s = states[PARENTS[joint]]
            place, turn, scale = t + s * rotated(q, place), multiplied(q, turn), s * scale
        states.append((place, turn, scale))
    coefficients = np.concatenate([identity, expression])
    rest = mesh["base_shape"] + np.tensordot(coefficients, mesh["shape_vectors"], 1)
    rest = rest + np.tensordot(outputs(own, joints), mesh["corrective_blendshapes"], 1)
    found = np.zeros((N_VERTICES, 3))
    bind = own["inverse_bind_pose"].astype(np.float64)
    for vertex in range(N_VERTICES):
        influences = mesh["skin_indices"][vertex], mesh["skin_weights"][vertex]
        for joint, weight in zip(*influences, strict=True):
            if weight > 1e-5:
                b = bind[joint]
                inside = b[:3] + rotated(unit(b[3:7]), b[7] * rest[vertex])
                t, q, s = states[joint]
                found[vertex] += weight * (t + rotated(q, s * inside))
    return found, states


def outputs(own, joints):
    """Return the outputs of the network; its inputs are two columns of each rotation."""
    columns = []
    for rx, ry, rz in joints[2:, 3:6]:
        turn = multiplied(about(2, rz), multiplied(about(1, ry), about(0, rx)))
        columns += [rotated(turn, np.eye(3)[0]) - np.eye(3)[0]]
        columns += [rotated(turn, np.eye(3)[1]) - np.eye(3)[1]]
    entered = np.concatenate(columns)
    matrix = np.zeros((N_OUTPUTS, len(entered)))
    matrix[tuple(own["0.sparse_indices"])] = own["0.sparse_weight"]
    return np.maximum(matrix @ entered, 0.0)
