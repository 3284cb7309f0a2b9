"""Make a figure from arrays: a square tube, bound to two joints, as a glTF file."""

import numpy as np

import viewer

rings, sides = np.linspace(0.0, 2.0, 9), np.radians([45.0, 135.0, 225.0, 315.0])
y, angle = (grid.ravel() for grid in np.meshgrid(rings, sides, indexing="ij"))
outward = np.stack([np.cos(angle), 0.0 * y, np.sin(angle)], axis=1)
corner = np.arange(4 * 8)  # lower corner of each side; the next one follows in the same ring
after = corner + 1 - 4 * (corner % 4 == 3)
quads = np.stack([corner, corner + 4, after + 4, after], axis=1)
triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
mesh = viewer.Mesh(0.2 * outward + np.outer(y, [0.0, 1.0, 0.0]), outward, triangles)

skeleton = viewer.Skeleton(
    names=("root", "elbow"),
    parents=np.array([-1, 0]),
    rest_translations=np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    rest_rotations=np.array([[0.0, 0.0, 0.0, 1.0]] * 2),
    rest_scales=np.ones((2, 3)),
    dof_joints=np.array([1]),
    dof_kinds=np.array([5]),  # the elbow rotates about z
    rest_dofs=np.zeros(1),
    dof_limits=np.array([[-2.0, 2.0]]),
)
upper = np.clip(2.0 * y - 1.5, 0.0, 1.0)  # weight of the elbow: 0 to 1 around y = 1
inverse_bind = np.tile(np.eye(4), (2, 1, 1))
inverse_bind[1, 1, 3] = -1.0  # the elbow is at y = 1
skin = viewer.Skin(
    starts=np.arange(0, 2 * len(y) + 1, 2, dtype=np.int32),  # two influences per vertex
    joints=np.tile([0, 1], len(y)),
    weights=np.stack([1.0 - upper, upper], axis=1).ravel(),
    inverse_bind=inverse_bind,
)

figure = viewer.Figure("tube", mesh=mesh, skeleton=skeleton, skin=skin)
pose = viewer.rest_pose(skeleton)
pose.dofs[0] = np.pi / 2
positions, _ = viewer.deform(figure, pose)  # (V, 3), float64
print(f"the end of the tube is at {positions[-4:].mean(axis=0).round(6) + 0.0}")
viewer.export(viewer.Actor(figure, pose), "tube.glb")
