"""Rigs from the bundled templates, compared with the artists' rigs of the same meshes.

Measured by ``evaluate_rig.py`` on the characters beside it, ``../shared/data/rigging``, with
default settings: distance of 14 joints with a common meaning (mean and largest), L1 distance of
weights by body part, same dominant part, mean distance of vertices in five poses; all lengths as
percentages of the longest side. Quadrupeds take the fox as template. Names select characters;
``--sheets FOLDER`` draws the five poses of each, the artist's above ours.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from bench_binding import CHARACTERS, truth_of
from scipy import sparse

import viewer
from viewer.autorig.confidence import confidence
from viewer.autorig.pipeline import transfer
from viewer.errors import RigError
from viewer.loading import bundled_body, bundled_files, load
from viewer.media.image import save_image
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.mesh import Mesh, vertex_normals
from viewer.rigs.pose import rest_pose
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skinning import joint_matrices

# Of the joint error (median of humanoids, mean of quadrupeds) and the mean deformation, percent of
# the longest side.
HUMANOID_GOALS, QUADRUPED_GOAL = {"joint": 3.0, "deformation": 1.5}, 4.0
_GAP = 1.1  # distance between the poses of a sheet, relative to the figure's size


def main() -> None:
    if not CHARACTERS.exists():
        print(f"{CHARACTERS}: not there, nothing measured")
        return
    sys.path.insert(0, str(CHARACTERS))
    import evaluate_rig

    parser = argparse.ArgumentParser()
    parser.add_argument("names", nargs="*")
    parser.add_argument("--sheets", type=Path)
    given = parser.parse_args()
    templates = {
        is_quadruped: load(*files).actors[0].figure
        for is_quadruped, files in ((False, [bundled_body()]), (True, bundled_files()))
    }
    found: dict[bool, list[dict[str, float]]] = {False: [], True: []}
    refused = []
    for path in sorted(CHARACTERS.glob("*.npz")):
        truth = truth_of(evaluate_rig, path) if path.stem in (given.names or [path.stem]) else None
        if truth is None:
            continue
        is_quadruped = "fup_l" in truth["sem"]
        start = time.process_time()
        try:
            rig = rigged(evaluate_rig, truth, templates[is_quadruped], is_quadruped)
        except RigError as problem:
            refused.append(path.stem)
            print(f"  {path.stem:<14} refused: {problem}")
            continue
        taken = time.process_time() - start
        score = evaluate_rig.compare(truth, rig, is_quadruped)
        found[is_quadruped].append(score)
        print(
            f"  {path.stem:<14} {len(truth['V']):6} vertices   joints {score['joint_mean']:.1f} "
            f"(most {score['joint_max']:.1f}, {score['joint_worst']})   L1 {score['l1']:.2f}   "
            f"same part {score['dom']:.0f} %   deformation {score['def_mean']:.2f}   "
            f"confidence {rig['confidence']:.2f}   {taken:.1f} s",
            flush=True,
        )
        if given.sheets is not None:
            given.sheets.mkdir(parents=True, exist_ok=True)
            save_image(given.sheets / f"{path.stem}.png", _sheet(evaluate_rig, truth, rig))
    for is_quadruped, scores in found.items():
        if scores:
            _summarise(scores, is_quadruped)
    print(f"refused: {', '.join(refused) or 'none'}")


def _summarise(scores: list[dict[str, float]], is_quadruped: bool) -> None:
    joints = np.array([score["joint_mean"] for score in scores])
    deformation = float(np.mean([score["def_mean"] for score in scores]))
    below = f"below 6 %: {np.mean(joints < 6.0):.0%}"
    if is_quadruped:
        print(
            f"quadrupeds: mean joint error {joints.mean():.2f} % (goal: {QUADRUPED_GOAL}), "
            f"{below}; mean deformation {deformation:.2f} %"
        )
        return
    print(
        f"humanoids: median joint error {np.median(joints):.2f} % (goal: "
        f"{HUMANOID_GOALS['joint']}), {below} (goal: 90%); mean deformation {deformation:.2f} % "
        f"(goal: {HUMANOID_GOALS['deformation']})"
    )


def rigged(evaluate_rig, truth, template: Figure, is_quadruped: bool):
    """Return a rig as ``evaluate_rig.compare`` expects it, and its confidence."""
    triangles = truth["F"].astype(np.int32)
    mesh = Mesh(truth["V"], vertex_normals(truth["V"], triangles), triangles)
    result = transfer(template, rest_pose(template.skeleton), mesh)
    skin, skeleton = result.figure.skin, result.figure.skeleton
    shape = (skin.n_vertices, skin.n_joints)
    weights = sparse.csr_array((skin.weights, skin.joints, skin.starts), shape=shape).toarray()
    return {
        "W": weights,
        "J": joint_matrices(result.figure, result.pose)[:, :3, 3],
        "parents": np.array(skeleton.parents),
        "sem": evaluate_rig.mapping("rfox" if is_quadruped else "body", list(skeleton.names)),
        "confidence": confidence(result.findings),
    }


def _sheet(evaluate_rig, truth, rig) -> np.ndarray:
    """Return a picture of the five poses: the artist's rig above, ours below."""
    is_quadruped = "fup_l" in truth["sem"]
    frame = evaluate_rig.frame(truth["J"], truth["sem"], is_quadruped)
    size = float(np.ptp(truth["V"], axis=0).max())
    actors = []
    for row, body in enumerate((truth, rig)):
        for column, pose in enumerate(evaluate_rig.poses(frame, is_quadruped).values()):
            turned = {body["sem"][key]: turn for key, turn in pose.items() if key in body["sem"]}
            moves = evaluate_rig.globals_(body["J"], body["parents"], turned)
            triangles = truth["F"].astype(np.int32)
            posed = evaluate_rig.lbs(truth["V"], body["W"], moves)
            mesh = Mesh(posed, vertex_normals(posed, triangles), triangles)
            place = translation_matrix(_GAP * size * np.array([column, -row, 0.0]))
            actors.append(Actor(Figure(f"{row} {column}", mesh), placement=place))
    return viewer.render(
        Scene(actors), (1600, 720), azimuth=20.0, inclination=8.0, orthographic=True
    )


if __name__ == "__main__":
    main()
