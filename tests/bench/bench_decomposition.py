"""Error of skinning decompositions, and of Dem Bones with as many bones and its own settings.

Moving meshes: animals of ``../shared/data`` in their animations, and a waving cloth. Errors are RMS
and largest distances of all frames as a percentage of the size, from the float64 sum over bones;
times are processor seconds. Dem Bones (``pip install py-dem-bones``) is left out if it is missing.
"""

import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np

import viewer
from viewer.autorig.decomposition import Decomposition, DecompositionSettings, decompose
from viewer.rigs.motion.moving_mesh import moving_mesh

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
ANIMALS = ("gltf/fox-animations", "rigging/animated/spider-animations")
BONES = (8, 24)


def main() -> None:
    for name, positions, triangles in meshes():
        frames, vertices = positions.shape[:2]
        print(f"{name}: {frames} frames, {vertices} vertices")
        for bones in (0, *BONES):
            settings = DecompositionSettings(bones=bones)
            show("viewer", positions, lambda: decompose(positions[0], positions, settings))  # noqa: B023
            if bones and find_spec("py_dem_bones") is not None:
                show("Dem Bones", positions, lambda: dem_bones(positions, triangles, bones))  # noqa: B023


def meshes() -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    for name in ANIMALS:
        path = (DATA / name).with_suffix(".glb")
        if not path.exists():
            print(f"{path}: not there, not measured")
            continue
        moving = moving_mesh(viewer.load(path).actors[0])
        yield path.stem, moving.positions[::3], moving.figure.mesh.triangles
    side = np.linspace(0.0, 1.0, 30)
    x, y = (each.ravel() for each in np.meshgrid(side, side))
    phases = np.arange(40)[:, None]
    heights = 0.1 * x * np.sin(6 * x - 0.4 * phases) + 0.05 * x * np.cos(5 * y + 0.3 * phases)
    flat = np.broadcast_to(np.stack([x, y], axis=1), (40, 900, 2))
    corner = (np.arange(29) + 30 * np.arange(29)[:, None]).ravel()
    quads = corner[:, None] + [0, 1, 31, 30]
    triangles = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])
    yield "cloth", np.concatenate([flat, heights[:, :, None]], axis=2), triangles


def dem_bones(positions: np.ndarray, triangles: np.ndarray, bones: int) -> Decomposition:
    from py_dem_bones import solve_skinning

    found = solve_skinning(positions[0], positions, bones, faces=triangles, max_influences=4)
    return Decomposition(found.weights.T, found.transforms)


def show(who: str, positions: np.ndarray, run) -> None:
    started = time.process_time()
    found = run()
    seconds = time.process_time() - started
    rest, size = positions[0], np.ptp(positions[0], axis=0).max()
    off = -positions.copy()
    for bone, weights in enumerate(found.weights.T):
        matrices = found.transforms[:, bone]
        moved = rest @ matrices[:, :3, :3].transpose(0, 2, 1) + matrices[:, None, :3, 3]
        off += weights[:, None] * moved
    lengths = 100.0 * np.linalg.norm(off, axis=2) / size
    rms = np.sqrt(np.mean(lengths**2))
    print(
        f"  {who:10} {found.weights.shape[1]:3} bones: RMS {rms:.4f} %, largest "
        f"{lengths.max():.3f} %, {seconds:.1f} s"
    )


if __name__ == "__main__":
    main()
