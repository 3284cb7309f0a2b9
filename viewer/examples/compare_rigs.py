"""Compare two skins of one character where it matters: in poses, in lengths of the file."""

from dataclasses import replace

import numpy as np

import viewer

reference = viewer.load().actors[0].figure
skeleton, skin = reference.require_skeleton(), reference.require_skin()
# The other rig has weights in tenths. Yours: viewer.load("mine.skel", "mine.skin")
other = replace(reference, skin=replace(skin, weights=skin.weights.round(1)))
scaled = viewer.Skinning(normalize=True)  # rounded weights do not add up to 1

worst = 0.0
for seed in range(20):
    random = np.random.default_rng(seed)
    pose = viewer.rest_pose(skeleton)
    pose.dofs[:] += random.uniform(-0.3, 0.3, skeleton.n_dofs) * (skeleton.dof_kinds >= 3)
    expected, _ = viewer.deform(reference, pose)
    found, _ = viewer.deform(other, pose, scaled)
    worst = max(worst, float(np.linalg.norm(found - expected, axis=1).max()))
print(f"largest distance: {worst:.4f}, of a figure {np.ptp(expected, axis=0).max():.4f} long")
