"""Deformation on the CPU in float64, compared with scipy's product of weights and matrices."""

import numpy as np
from bench_skinning import synthetic
from measure import interleaved, median_ratio, report
from scipy.sparse import csr_matrix

from viewer.rigs.kinematics import skinning_matrices, world_matrices
from viewer.rigs.pose import rest_pose
from viewer.rigs.skinning.lbs import move

GOAL = 1.3
FRAMES = 32


def main(rounds: int = 60) -> None:
    """Print the ratios for one frame and for a batch."""
    figure = synthetic()
    mesh, skeleton, skin = figure.mesh, figure.skeleton, figure.skin
    assert mesh is not None and skeleton is not None and skin is not None
    pose, rng = rest_pose(skeleton), np.random.default_rng(0)
    palettes = []
    for _ in range(FRAMES):
        pose.dofs[:] = rng.normal(0.0, 0.05, len(pose.dofs))
        palettes.append(skinning_matrices(world_matrices(skeleton, pose), skin.inverse_bind))
    stack = np.stack(palettes)
    shape = (skin.n_vertices, skin.n_joints)
    parts = skin.weights.copy(), skin.joints.copy(), skin.starts.copy()
    sparse = csr_matrix(parts, shape=shape)
    sparse.sum_duplicates()
    rows = np.ascontiguousarray(palettes[0][:, :3].reshape(-1, 12))
    homogeneous = np.concatenate([mesh.positions, np.ones((skin.n_vertices, 1))], axis=1)

    def with_scipy() -> np.ndarray:
        blended = (sparse @ rows).reshape(-1, 3, 4)
        return np.einsum("vab,vb->va", blended, homogeneous)

    difference = np.abs(with_scipy() - move(mesh.positions, skin, stack[0])[0]).max()
    assert difference < 1e-12, difference
    single = {
        "viewer, positions": lambda: move(mesh.positions, skin, stack[0]),
        "scipy, product and positions": with_scipy,
        "scipy, product alone": lambda: sparse @ rows,
    }
    times, names = interleaved(single, rounds), tuple(single)
    report(f"deform {skin.n_vertices} vertices, {skin.n_joints} joints", times, names[:2], GOAL)
    print(f"  against the product alone: {median_ratio(times, names[0], names[2]):.2f}\n")
    columns = np.ascontiguousarray(stack[:, :, :3].transpose(1, 0, 2, 3).reshape(62, -1))

    def batch_with_scipy() -> np.ndarray:
        blended = (sparse @ columns).reshape(-1, FRAMES, 3, 4)
        return np.einsum("vfab,vb->fva", blended, homogeneous)

    batch = {
        "viewer, one after the other": lambda: [move(mesh.positions, skin, p) for p in stack],
        "scipy, one product": batch_with_scipy,
    }
    report(f"{FRAMES} frames", interleaved(batch, rounds // 3), (*batch,), GOAL)


if __name__ == "__main__":
    main()
