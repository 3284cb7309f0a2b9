"""Size of HTML pages compared with the same figures and motions as quantised .glb files.

The goal is 1.4 times the .glb plus 250 kB, and 3 MB for 1,000 frames of a body of the SMPL family.
Sizes do not depend on the machine.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from measure import ROOT

import viewer
from viewer.rigs.scene import Actor, Scene

SHARED = ROOT.parent / "shared" / "data"
FACTOR, ADDED, LONGEST = 1.4, 250e3, 3e6
N_FRAMES = 1000


def walking(figure: viewer.Figure, seed: int = 1) -> Actor:
    """A motion of all joints as sums of five sines at up to 2 Hz, like captured ones, at 30 fps."""
    random = np.random.default_rng(seed)
    time = np.arange(N_FRAMES) / 30.0
    n_joints = figure.require_skeleton().n_joints
    rates = random.uniform(0.1, 2.0, size=(5, n_joints, 3))
    phases = random.uniform(0.0, 2.0 * np.pi, size=rates.shape)
    sizes = random.normal(size=rates.shape) * 0.1
    waves = np.sin(2.0 * np.pi * rates * time[:, None, None, None] + phases)
    turns = np.einsum("fkja,kja->fja", waves, sizes)
    path = np.stack([0.3 * np.sin(time), 0.02 * np.sin(9.0 * time), 1.2 * time], axis=1)
    return viewer.animate(figure, turns, translations=path, fps=30.0)


def cases() -> dict[str, Scene | Actor]:
    """Return figures and motions by a title."""
    found: dict[str, Scene | Actor] = {"fox": viewer.load("fox"), "body": viewer.load("body")}
    found["body, 1000 frames"] = walking(viewer.load("body")[0].figure)
    for title, *path in (
        ("Fox.glb", "gltf", "Fox.glb"),
        ("CesiumMan", "gltf", "cesium_man.gltf"),
        ("VRM", "gltf", "vrm0_sphere.vrm"),
        ("SMPL", "smpl_synthetic", "SMPL_NEUTRAL.npz"),
    ):
        file = SHARED.joinpath(*path)
        if file.exists():
            found[title] = viewer.load(file)
            if title == "SMPL":
                found["SMPL, 1000 frames"] = walking(found[title][0].figure)
    return found


def main() -> int:
    """Print sizes in kB; return 1 if a goal is missed."""
    is_missed = False
    print(f"{'figure':>18} {'page':>8} {'.glb':>8} {'page / goal':>12}")
    with TemporaryDirectory() as folder:
        for title, scene in cases().items():
            sizes = []
            for name in ("page.html", "page.glb"):
                path = Path(folder) / name
                viewer.export(scene, path, optimizes=name.endswith(".glb"))
                sizes.append(path.stat().st_size)
            page, glb = sizes
            # The .glb lacks the pose correctives of bodies, so their goal is a size.
            goal = LONGEST if "1000 frames" in title else FACTOR * glb + ADDED
            is_missed |= page > goal
            print(f"{title:>18} {page / 1e3:8.0f} {glb / 1e3:8.0f} {page / goal:12.2f}", flush=True)
    return int(is_missed)


if __name__ == "__main__":
    sys.exit(main())
