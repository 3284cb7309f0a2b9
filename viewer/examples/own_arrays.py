"""Make a figure from arrays: a square tube, bound to two joints, as a glTF file."""

import numpy as np

import viewer
from viewer.rig.geometry.transform import translation_matrix
from viewer.rig.mesh import vertex_normals
from viewer.rig.skeleton import ball_skeleton
from viewer.rig.skin import skin_from_lists

y, angle = np.repeat(np.linspace(0.0, 2.0, 9), 4), np.radians(np.tile([45, 135, 225, 315], 9))
positions = np.stack([0.2 * np.cos(angle), y, 0.2 * np.sin(angle)], axis=1)
low = np.arange(4 * 8)  # lower corner of each side; the next one follows in the same ring
after = low + 1 - 4 * (low % 4 == 3)
triangles = np.concatenate(
    [np.stack([low, low + 4, after + 4], 1), np.stack([low, after + 4, after], 1)]
)

joints = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
skeleton = ball_skeleton(("root", "elbow"), np.array([-1, 0]), joints)
upper = np.clip(2.0 * y - 1.5, 0.0, 1.0)  # weight of the elbow: 0 to 1 around y = 1
skin = skin_from_lists([[(0, 1 - w), (1, w)] for w in upper], translation_matrix(-joints))

mesh = viewer.Mesh(positions, vertex_normals(positions, triangles), triangles)
figure = viewer.Figure("tube", mesh, skeleton, skin)
pose = viewer.rest_pose(skeleton)
pose.dofs[-1] = np.pi / 2  # the elbow, about z
bent, _ = viewer.deform(figure, pose)  # (V, 3), float64
print(f"the end of the tube is at {bent[-4:].mean(axis=0).round(6) + 0.0}")
viewer.export(viewer.Actor(figure, pose), "tube.glb")
