"""A tiny SKEL model with the published keys, and a written-out forward pass for one pose."""

import numpy as np
from builders import rotation

PARENTS = (-1, 0, 1, 2, 3, 4, 0, 6, 7, 8, 9, 0, 11, 12, 12, 14, 15, 16, 17, 12, 19, 20, 21, 22)
N_VERTICES, N_SHAPES, N_JOINTS = 40, 4, 24
FIXED = (0, 5, 10, 13, 18, 23)
SMPL = (0, 2, 5, 8, 8, 11, 1, 4, 7, 7, 10, 3, 6, 15, 14, 17, 19, 0, 21, 13, 16, 18, 0, 20)
PINS = {
    3: (0.175895, -0.105208, 0.0186622),
    4: (-1.76818999, 0.906223, 1.8196),
    5: (-3.141589999, 0.6199010, 0),
    8: (0.175895, -0.105208, 0.0186622),
    9: (1.768189999, -0.906223, 1.8196),
    10: (-3.141589999, -0.6199010, 0),
}
HIP, SPINE = "zxy", "xzy"
AXES = {  # axis letters; capitals are negative axes
    **{0: HIP, 1: HIP, 2: "Z", 6: "zXY", 7: "Z", 11: SPINE, 12: SPINE, 13: SPINE},
    **{14: "yZX", 15: "xyz", 18: "xZ", 19: "yzx", 20: "xyz", 23: "XZ"},
}
OTHER = {
    16: (0.0494, 0.0366, 0.99810825),
    17: (-0.01716099, 0.99266564, -0.11966796),
    21: (-0.0494, -0.0366, 0.99810825),
    22: (0.01716099, -0.99266564, -0.11966796),
}


def arrays(seed=8):
    generator = np.random.default_rng(seed)
    weights = generator.random((N_VERTICES, N_JOINTS))
    regressor = generator.random((N_JOINTS, N_VERTICES))
    frames = np.tile(np.eye(4), (N_JOINTS, 1, 1))
    for joint in range(N_JOINTS):
        frames[joint, :3, :3] = rotation(generator.normal(size=3))
        frames[joint, :3, 3] = generator.normal(size=3)
    kintree = np.stack([np.array(PARENTS) % 2**32, np.arange(N_JOINTS)])
    return {
        "skin_template_v": generator.uniform(-1.0, 1.0, (N_VERTICES, 3)),
        "skin_template_f": np.stack([np.arange(N_VERTICES - 2) + k for k in range(3)], axis=1),
        "skel_template_v": np.zeros((3, 3)),
        "weights": weights / weights.sum(axis=1, keepdims=True),
        "shapedirs": generator.normal(size=(N_VERTICES, 3, N_SHAPES)),
        "posedirs": generator.normal(size=(N_VERTICES, 3, 207)),
        "J_regressor_osim": regressor / regressor.sum(axis=1, keepdims=True),
        "osim_kintree_table": kintree,
        "apose_rel_transfo": frames,
        "per_joint_rot": np.stack([rotation(generator.normal(size=3)) for _ in range(N_JOINTS)]),
    }


def axes_of(joint):
    """Return the axes of a joint's DOFs."""
    if joint in PINS:
        x, y, z = PINS[joint]
        frame = rotation([x, 0, 0]) @ rotation([0, y, 0]) @ rotation([0, 0, z])
        return [frame @ [0, 0, 1]]
    if joint in OTHER:
        return [np.array(OTHER[joint])]
    unit = dict(zip("xyz", np.eye(3), strict=True))
    return [unit[c.lower()] * (1 if c.islower() else -1) for c in AXES[joint]]


def aligning(source, target):
    """Return the shortest rotation from one direction to another."""
    a, b = source / np.linalg.norm(source), target / np.linalg.norm(target)
    axis = np.cross(a, b)
    angle = np.arctan2(np.linalg.norm(axis), a @ b)
    return rotation(angle * axis / np.linalg.norm(axis))


def bone_frames(model, joints, steps):
    frames = []
    for joint in range(N_JOINTS):
        learned = model["per_joint_rot"][joint]
        if joint in FIXED:
            frames.append(learned)
            continue
        child = PARENTS.index(joint)
        known = model["apose_rel_transfo"][child, :3, 3]
        wanted = steps[child]
        if joint in (16, 21):
            known = known + model["apose_rel_transfo"][child + 1, :3, 3]
            wanted = wanted + steps[child + 1]
        if joint == 12:
            wanted = steps[12]
        frames.append(aligning(learned @ known, wanted) @ learned)
    return frames


def curve(angle, length):
    if abs(angle) < 1e-5:
        return length * angle / 2, length * (1 - angle * angle / 6)
    return length / angle * (1 - np.cos(angle)), length / angle * np.sin(angle)


def arc(bending, extension, length):
    (x, y), (u, v) = curve(bending, length), curve(extension, length)
    return np.array([-x, y, 0]) + np.array([0, v, -u])


def blade(side, abduction, elevation, width, height):
    if side == "left":
        abduction, elevation = -abduction, -elevation
    sign = -1 if side == "right" else 1
    along = width / 4 * np.cos(elevation - np.pi / 4) * np.cos(abduction)
    up = -height / 2 * np.sin(elevation - np.pi / 4)
    return np.array([sign * along, up, width / 4 * np.sin(abduction)])


def forward(model, q, betas, place):
    """Return vertices and joints, as the published program computes them."""
    shaped = model["skin_template_v"] + model["shapedirs"] @ betas
    joints = model["J_regressor_osim"] @ shaped
    steps = np.array(
        [j - (joints[p] if p >= 0 else 0) for j, p in zip(joints, PARENTS, strict=True)]
    )
    rotations, start = [], 0
    for joint, bone in enumerate(bone_frames(model, joints, steps)):
        own = np.eye(3)
        for axis in axes_of(joint):
            own = rotation(q[start] * axis) @ own
            start += 1
        frame = bone @ model["apose_rel_transfo"][joint, :3, :3].T
        rotations.append(frame @ own @ frame.T)
    assert start == len(q)
    width = np.linalg.norm(joints[19] - joints[14])
    height = np.linalg.norm(joints[12] - joints[11])
    for joint, side, first in ((14, "right", 26), (19, "left", 36)):
        moved = blade(side, q[first], q[first + 1], width, height)
        steps[joint] += moved - blade(side, 0, 0, width, height)
    for joint, below, first in ((11, 0, 17), (12, 11, 20), (13, 12, 23)):
        length = abs(joints[joint, 1] - joints[below, 1])
        steps[joint] += arc(q[first], q[first + 1], length) - arc(0, 0, length)
    feature = np.zeros((24, 3, 3))
    for target, turn in zip(SMPL, rotations, strict=True):
        feature[target] = turn - np.eye(3)
    posed = shaped + model["posedirs"] @ feature[1:].ravel()
    worlds, places = [], []
    for joint, parent in enumerate(PARENTS):
        above = worlds[parent] if parent >= 0 else np.eye(3)
        at = places[parent] if parent >= 0 else np.zeros(3)
        worlds.append(above @ rotations[joint])
        places.append(at + above @ steps[joint])
    found = np.zeros_like(posed)
    for joint in range(N_JOINTS):
        moved = (posed - joints[joint]) @ worlds[joint].T + places[joint]
        found += model["weights"][:, joint, None] * moved
    return found + place, np.array(places) + place
