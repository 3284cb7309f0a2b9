"""Deformation of meshes bound to their artists' skeletons, compared with the artists' weights.

Measured by ``evaluate_rig.py`` on the characters beside it, ``../shared/data/rigging``: the mean
distance of vertices from the artist's result in five poses, as a percentage of the longest side;
the same for the 95th percentile; L1 distance of weights by body part. Names select characters.
Processor time of a first binding, and of binding the same mesh again after an edit of one joint, as
in the window (goal: below 1 s for 10,000 vertices).
"""

import sys
import time
from pathlib import Path

import numpy as np
from scipy import sparse

from viewer.autorig.pipeline import transfer
from viewer.autorig.settings import BINDING, TransferSettings
from viewer.autorig.weights.weight_transfer import WeightSettings
from viewer.rigs.figure import Figure
from viewer.rigs.hierarchy import depth_first
from viewer.rigs.joint_edits import rest_worlds
from viewer.rigs.mesh import Mesh, vertex_normals
from viewer.rigs.pose import rest_pose
from viewer.rigs.skeleton import Skeleton, ball_skeleton

CHARACTERS = Path(__file__).resolve().parents[3] / "shared" / "data" / "rigging"
GOALS = {"heat": 0.6, "voxel": 0.8}
"""Percent of the longest side, over all characters."""


def main() -> None:
    if not CHARACTERS.exists():
        print(f"{CHARACTERS}: not there, nothing measured")
        return
    sys.path.insert(0, str(CHARACTERS))
    import evaluate_rig

    chosen = [name for name in sys.argv[1:] if (CHARACTERS / f"{name}.npz").exists()]
    found: dict[str, list[float]] = {method: [] for method in BINDING}
    for path in sorted(CHARACTERS.glob("*.npz")):
        if chosen and path.stem not in chosen:
            continue
        truth = truth_of(evaluate_rig, path)
        if truth is None:
            continue
        cells = []
        for method in BINDING:
            skeleton, mesh, order = parts_of(truth, np.load(path)["parents"])
            weights, taken = bound(skeleton, mesh, method)
            figure = Figure("artist", skeleton=skeleton)
            last = skeleton.n_joints - 1
            moves = {last: rest_worlds(figure)[last, :3, 3] + 0.01 * np.ptp(mesh.positions)}
            again = bound(places_moved(skeleton, moves), mesh, method)[1]
            weights = weights[:, np.argsort(order)]
            is_quadruped = "fup_l" in truth["sem"]
            score = evaluate_rig.compare(truth, {**truth, "W": weights}, is_quadruped)
            found[method].append(score["def_mean"])
            cells.append(
                f"{method} {score['def_mean']:.2f} (95 %: {score['def_p95']:.1f}) L1 "
                f"{score['l1']:.2f} {taken:.2f} s, again {again:.2f} s"
            )
        print(f"  {path.stem:<14} {len(truth['V']):6} vertices   {'   '.join(cells)}")
    for method, values in found.items():
        mean = float(np.mean(values)) if values else 0.0
        verdict = "met" if mean <= GOALS[method] else "missed"
        print(f"{method}: mean deformation {mean:.3f} % (goal: {GOALS[method]} %, {verdict})")


def truth_of(evaluate_rig, path: Path):
    """Return the artist's rig, or None if its joints have no known meaning."""
    if str(np.load(path)["family"]) not in evaluate_rig.FAM:
        return None
    return evaluate_rig.truth(path)


def parts_of(truth, parents) -> tuple[Skeleton, Mesh, np.ndarray]:
    """Return the artist's joints and mesh, and the order of the joints."""
    order = depth_first(np.asarray(parents))
    places = np.argsort(order)
    above = np.array([places[p] if p >= 0 else -1 for p in np.asarray(parents)[order]])
    names = tuple(str(truth["names"][joint]) for joint in order)
    skeleton = ball_skeleton(names, above.astype(np.int32), truth["J"][order])
    triangles = truth["F"].astype(np.int32)
    return skeleton, Mesh(truth["V"], vertex_normals(truth["V"], triangles), triangles), order


def places_moved(skeleton: Skeleton, moves: dict[int, np.ndarray]) -> Skeleton:
    """Return a skeleton of ball joints with some of them at other places."""
    places = rest_worlds(Figure("artist", skeleton=skeleton))[:, :3, 3].copy()
    for joint, place in moves.items():
        places[joint] = place
    return ball_skeleton(skeleton.names, skeleton.parents, places)


def bound(skeleton: Skeleton, mesh: Mesh, method: str) -> tuple[np.ndarray, float]:
    """Return the weights (V, J) of the bound mesh, four for each vertex, and the seconds taken."""
    how = TransferSettings(method=method, weights=WeightSettings(max_influences=4))
    start = time.process_time()
    rigged = transfer(Figure("artist", skeleton=skeleton), rest_pose(skeleton), mesh, how)
    taken = time.process_time() - start
    skin = rigged.figure.skin
    shape = (skin.n_vertices, skin.n_joints)
    rows = sparse.csr_array((skin.weights, skin.joints, skin.starts), shape=shape).toarray()
    return rows, taken


if __name__ == "__main__":
    main()
