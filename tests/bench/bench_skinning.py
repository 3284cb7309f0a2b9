"""A frame of a changed pose (kinematics, palette, skinning, drawing), compared with a static frame.
Both draw all faces at 1280 x 720, one sample per pixel, with the same fragment shader; the static
frame is the same mesh posed before.
"""

import numpy as np
from measure import interleaved, report

import viewer
from viewer.rendering.offscreen import Offscreen, default_camera
from viewer.rendering.options import DisplayOptions
from viewer.rigs.figure import Figure
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.mesh import Mesh
from viewer.rigs.pose import rest_pose
from viewer.rigs.scene import Actor, Scene, scene_box
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.skin import Skin

SIZE = 1280, 720
GOAL = 1.2
N_VERTICES, N_JOINTS, MOST = 11_239, 62, 13


def synthetic() -> Figure:
    """Return a ball of 11,239 vertices with 1 to 13 influences each, on a chain of 62 joints."""
    rng = np.random.default_rng(0)
    rings = sides = 105
    p, a = np.meshgrid(
        np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, sides + 1), indexing="ij"
    )
    normals = np.stack([np.sin(p) * np.sin(a), np.cos(p), np.sin(p) * np.cos(a)], -1)
    normals = np.concatenate([normals.reshape(-1, 3), [[0.0, 1.0, 0.0]] * 3])
    positions = normals * [0.25, 0.8, 0.25]
    corner = (np.arange(rings)[:, None] * (sides + 1) + np.arange(sides)).ravel()
    below = corner + sides + 1
    triangles = np.stack([corner, below, below + 1, corner, below + 1, corner + 1], 1)
    skeleton = Skeleton(
        names=tuple(f"j{i}" for i in range(N_JOINTS)),
        parents=np.arange(N_JOINTS, dtype=np.int32) - 1,
        rest_translations=[[0.0, -0.8, 0.0], *[[0.0, 1.6 / N_JOINTS, 0.0]] * (N_JOINTS - 1)],
        rest_rotations=np.tile([0.0, 0.0, 0.0, 1.0], (N_JOINTS, 1)),
        rest_scales=np.ones((N_JOINTS, 3)),
        dof_joints=np.repeat(np.arange(N_JOINTS, dtype=np.int32), 3),
        dof_kinds=np.tile(np.array([3, 4, 5], dtype=np.int32), N_JOINTS),
        rest_dofs=np.zeros(3 * N_JOINTS),
        dof_limits=np.tile([-np.inf, np.inf], (3 * N_JOINTS, 1)),
    )
    # The vertices within a patch of 3 x 9 have equally many influences, as on a painted figure.
    patches = np.clip(1 + rng.poisson(2.46, (rings // 3 + 1, sides // 9 + 1)), 1, MOST)
    patches[5, 5] = MOST
    grid = patches[np.arange(rings + 1)[:, None] // 3, np.arange(sides + 1) // 9]
    counts = np.append(grid.ravel(), [1, 1, 1])
    starts = np.concatenate([[0], np.cumsum(counts)])
    owners = np.repeat(np.arange(len(positions)), counts)
    offsets = np.arange(starts[-1]) - starts[owners]
    near = np.rint((positions[:, 1] + 0.8) / 1.6 * N_JOINTS - counts / 2).astype(int)
    weights = rng.uniform(0.1, 1.0, starts[-1])
    weights /= np.bincount(owners, weights)[owners]
    skin = Skin(
        starts=starts.astype(np.int32),
        joints=np.clip(near[owners] + offsets, 0, N_JOINTS - 1).astype(np.int32),
        weights=weights,
        inverse_bind=np.linalg.inv(world_matrices(skeleton, rest_pose(skeleton))),
    )
    mesh = Mesh(positions, normals, triangles.reshape(-1, 3).astype(np.int32))
    assert mesh.n_vertices == N_VERTICES
    return Figure("synthetic", mesh, skeleton, skin)


def main(rounds: int = 60) -> None:
    """Print the ratio for the bundled figure and for the synthetic one."""
    for figure in (viewer.load().actors[0].figure, synthetic()):
        assert figure.mesh is not None and figure.skin is not None
        shown = (
            f"{figure.name}: {figure.mesh.n_vertices} vertices, {figure.skin.n_joints} joints, "
            f"{len(figure.skin.joints)} influences"
        )
        times = measure(figure, rounds)
        report(shown, times, (*times,), GOAL)


def measure(figure: Figure, rounds: int) -> dict[str, list[float]]:
    """Time three skinned and three static frames per round."""
    options = DisplayOptions(background="transparent", grid=False, samples=1)
    actor = Actor(figure)
    scene = Scene([actor])
    camera, box = default_camera(scene, SIZE), scene_box(scene)
    dofs = actor.pose.dofs
    rest, rng = dofs.copy(), np.random.default_rng(1)
    with Offscreen() as offscreen, offscreen.context:
        target = offscreen.target(SIZE, 1)

        def draw() -> None:
            offscreen.renderer.draw(scene, camera, options, target, box)
            offscreen.context.finish()

        def static() -> None:
            for _ in range(3):
                draw()

        def skinned() -> None:
            for _ in range(3):
                dofs[:] = rest + rng.normal(0.0, 0.01, len(rest))
                draw()

        work = {"skinned, 3 frames": skinned, "static, 3 frames": static}
        return interleaved(work, rounds)


if __name__ == "__main__":
    main()
