"""Make a figure from arrays, animate it, and write it as a glTF file: a tube with an elbow."""

import numpy as np

import viewer

y, angle = np.repeat(np.linspace(0.0, 2.0, 9), 4), np.radians(np.tile([45, 135, 225, 315], 9))
vertices = np.stack([0.2 * np.cos(angle), y, 0.2 * np.sin(angle)], axis=1)
low = np.arange(4 * 8)  # lower corner of each side; the next one follows in the same ring
after = low + 1 - 4 * (low % 4 == 3)
faces = np.stack([low, low + 4, after + 4, after], axis=1)
elbow = np.clip(2.0 * y - 1.5, 0.0, 1.0)  # weight of the elbow: 0 to 1 around y = 1
weights = np.stack([1.0 - elbow, elbow], axis=1)

joints = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
tube = viewer.figure(vertices, faces, weights=weights, joints=joints, names=["root", "elbow"])
rotations = np.zeros((31, 2, 3))  # rotation vectors: the elbow bends by 90 degrees in a second
rotations[:, 1, 2] = np.linspace(0.0, np.pi / 2, 31)
actor = viewer.animate(tube, rotations, fps=30)
end = actor.vertices(time=1.0)[-4:].mean(axis=0)
print(f"the end of the tube moves to {end.round(6) + 0.0}")
viewer.export(actor, "tube.glb")
