"""Rigs made with default settings, compared with the artists' rigs of the same meshes.

Prints Markdown tables like those of ``../shared/research/rigging.md``, for the characters in
``../shared/data/rigging``. All lengths are percentages of the longest side, times are processor
seconds. Names select characters; ``--sheets FOLDER`` draws a picture of each: its skeletons at rest
and the poses in which it is measured, the artist's on the left, ours on the right.

- Humanoids and quadrupeds, rigged from the bundled body and fox, measured by ``evaluate_rig.py``:
  distance of joints with a common meaning, L1 distance of weights by body part, same dominant part,
  distance of vertices in five poses; and the last on the artist's joints, bound by ``heat`` and
  ``voxel``.
- Other shapes, with ``--auto``: distance of each joint from the nearest one of the other skeleton
  (CD-J2J), fraction of the joints with a counterpart within 5 % (IoU), and the deformation: the
  artist's joints are rotated at random, our rig is posed as similarly as it can be, and the rest is
  measured. How far the poses move the vertices is beside it.
"""

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from bench_binding import CHARACTERS, bound, parts_of, truth_of
from scipy import sparse
from scipy.spatial.transform import Rotation

import viewer
from viewer.autorig.confidence import confidence
from viewer.autorig.pipeline import transfer
from viewer.autorig.settings import BINDING
from viewer.errors import RigError
from viewer.loading import bundled_body, bundled_files, load
from viewer.media.image import save_image
from viewer.media.picture_sinks import write_label
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.mesh import Mesh, vertex_normals
from viewer.rigs.pose import rest_pose
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.skinning import joint_matrices

# Of the joint error (median of humanoids, mean of quadrupeds) and the mean deformation, percent of
# the longest side.
HUMANOID_GOALS, QUADRUPED_GOAL = {"joint": 3.0, "deformation": 1.5}, 4.0
SHAPE_GOALS = {"joint": 5.0, "deformation": 2.0}
"""CD-J2J and mean deformation, percent of the longest side."""
SHAPES = "spider", "snake", "bird"
"""Words in the names of the ``.glb`` files of other shapes."""

BINDINGS = " / ".join(BINDING) + " on true joints"
HUMANOID_TABLE = (
    f"| humanoid, template `body` | vertices | joint / deformation | largest joint error | L1 | "
    f"dom % | {BINDINGS} | confidence | CPU s |\n" + "|---" * 9 + "|"
)
QUADRUPED_TABLE = (
    f"| quadruped, template `fox` | vertices | joint % mean/max | CD-J2J | IoU@5% | L1 | dom % | "
    f"def mean/p95 | {BINDINGS} | confidence | CPU s |\n" + "|---" * 11 + "|"
)
SHAPE_TABLE = (
    "| other shape, `--auto` | vertices | joints ours / artist's | CD-J2J | IoU@5% | deformation | "
    "of | CPU s |\n" + "|---" * 8 + "|"
)

# Random poses of other shapes: their number, rotation of each joint about each axis in radians
# (22 degrees in all), vertices that are fitted, steps, and how much a rotation costs.
_POSES, _TURN, _FITTED, _STEPS, _DAMPING = 4, 0.22, 2500, 8, 1e-6
# Sheets: distance between the artist's figure and ours relative to their width, azimuth and
# inclination of the camera, degrees, pixels of a picture, pictures in a row, and the height in
# which their names are written, pixels.
_GAP, _VIEW, _PICTURE, _ACROSS, _LABEL = 1.1, (20.0, 8.0), (600, 450), 3, 180


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
    templates = {False: load(bundled_body()), True: load(*bundled_files())}
    paths = {path.stem: path for path in sorted(CHARACTERS.glob("*.npz"))}
    truths = {
        name: truth_of(evaluate_rig, path)
        for name, path in paths.items()
        if name in (given.names or paths)
    }
    refused: list[str] = []
    for is_quadruped, scene in templates.items():
        names = [
            name
            for name, truth in truths.items()
            if truth is not None and is_quadruped == ("fup_l" in truth["sem"])
        ]
        scores: list[dict[str, float]] = []
        if names:
            print("\n" + (QUADRUPED_TABLE if is_quadruped else HUMANOID_TABLE), flush=True)
        for name in names:
            truth, start = truths[name], time.process_time()
            try:
                rig = rigged(evaluate_rig, truth, scene.actors[0].figure, is_quadruped)
            except RigError as problem:
                refused.append(name)
                print(f"| {name} | {len(truth['V'])} | refused: {problem} |", flush=True)
                continue
            taken = time.process_time() - start
            scores.append(evaluate_rig.compare(truth, rig, is_quadruped))
            row = _row(scores[-1], is_quadruped, _on_true_joints(evaluate_rig, truth, paths[name]))
            cells = name, len(truth["V"]), *row, f"{rig['confidence']:.2f}", f"{taken:.1f}"
            print("| " + " | ".join(map(str, cells)) + " |", flush=True)
            if given.sheets is not None:
                _save_sheet(
                    given.sheets / f"{name}.png", truth, rig, _posed(evaluate_rig, truth, rig)
                )
        if scores:
            _summarise(scores, is_quadruped)
    others = {name: path for name, path in paths.items() if truths.get(name, ...) is None}
    others |= {path.stem: path for path in sorted((CHARACTERS / "animated").glob("*.glb"))}
    chosen = {name: path for name, path in others.items() if name in (given.names or others)}
    _print_shapes(evaluate_rig, chosen, given.sheets)
    print(f"\nrefused: {', '.join(refused) or 'none'}")


def _row(score: dict[str, float], is_quadruped: bool, bound_alike: str) -> tuple[str, ...]:
    """Return the cells of a character."""
    parts = f"{score['l1']:.2f}", f"{score['dom']:.0f}"
    if is_quadruped:
        return (
            f"{score['joint_mean']:.1f} / {score['joint_max']:.1f}",
            f"{score['cd']:.1f}",
            f"{score['iou']:.2f}",
            *parts,
            f"{score['def_mean']:.2f} / {score['def_p95']:.1f}",
            bound_alike,
        )
    whole = f"{score['joint_mean']:.1f} / {score['def_mean']:.1f} (p95 {score['def_p95']:.1f})"
    worst = f"{score['joint_max']:.1f} {score['joint_worst']}"
    return whole, worst, *parts, bound_alike


def _on_true_joints(evaluate_rig, truth, path: Path) -> str:
    """Return the deformations of both binding methods on the artist's joints."""
    skeleton, mesh, order = parts_of(truth, np.load(path)["parents"])
    found = []
    for method in BINDING:
        weights = bound(skeleton, mesh, method)[0][:, np.argsort(order)]
        score = evaluate_rig.compare(truth, {**truth, "W": weights}, "fup_l" in truth["sem"])
        found.append(f"{score['def_mean']:.2f}")
    return " / ".join(found)


def _print_shapes(evaluate_rig, shapes: dict[str, Path], sheets: Path | None) -> None:
    """Print the table of skeletons that are found in the mesh."""
    found = []
    for name, path in shapes.items():
        truth = _shape_of(path)
        if truth is None:
            continue
        if not found:
            print("\n" + SHAPE_TABLE)
        triangles, start = truth["F"].astype(np.int32), time.process_time()
        mesh = Mesh(truth["V"], vertex_normals(truth["V"], triangles), triangles)
        try:
            scene = viewer.rig(Actor(Figure(name, mesh)), auto=True)
        except RigError as problem:
            print(f"| {name} | {len(truth['V'])} | refused: {problem} |", flush=True)
            continue
        taken = time.process_time() - start
        (actor,) = scene.actors
        places = joint_matrices(actor.figure, actor.pose)[:, :3, 3]
        parents = np.array(actor.figure.skeleton.parents)
        weights = _weights_of(actor.figure.skin)
        live = [each["J"][each["W"].sum(axis=0) > 1e-6] for each in
                (truth, {"J": places, "W": weights})]  # fmt: skip
        size = float(np.ptp(truth["V"], axis=0).max())
        distance = evaluate_rig.cdj2j(*live, size)
        rig = {"J": places, "parents": parents, "W": weights}
        left, moved, posed = left_of_poses(evaluate_rig, truth, rig)
        if sheets is not None:
            _save_sheet(sheets / f"{name}.png", truth, rig, posed)
        found.append((distance, left))
        cells = (
            name, len(truth["V"]), f"{len(places)} / {len(truth['J'])}", f"{distance:.1f}",
            f"{evaluate_rig.iou(*live, size):.2f}", f"{left:.2f}", f"{moved:.1f}", f"{taken:.1f}",
        )  # fmt: skip
        print("| " + " | ".join(map(str, cells)) + " |", flush=True)
    if found:
        distance, left = np.mean(found, axis=0)
        print(
            f"\nother shapes: mean CD-J2J {distance:.1f} % (goal: {SHAPE_GOALS['joint']:g}), mean "
            f"deformation {left:.2f} % (goal: {SHAPE_GOALS['deformation']:g})"
        )


def _shape_of(path: Path):
    """Return the artist's mesh and rig in a file; None for a person or a quadruped."""
    if path.suffix == ".npz":
        stored = np.load(path)
        weights = np.zeros((len(stored["V"]), len(stored["J"])))
        rows = np.arange(len(weights))[:, None]
        np.add.at(weights, (rows, stored["joints"].astype(int)), stored["weights"])
        return {**{key: stored[key] for key in ("V", "F", "J", "parents")}, "W": weights}
    if not any(word in path.stem for word in SHAPES):
        return None
    figure = load(path).actors[0].figure
    places = np.linalg.inv(figure.skin.inverse_bind)[:, :3, 3]
    return {
        "V": figure.mesh.positions,
        "F": figure.mesh.triangles,
        "J": places,
        "parents": np.array(figure.skeleton.parents),
        "W": _weights_of(figure.skin),
    }


def _weights_of(skin) -> np.ndarray:
    shape = (skin.n_vertices, skin.n_joints)
    return sparse.csr_array((skin.weights, skin.joints, skin.starts), shape=shape).toarray()


def left_of_poses(evaluate_rig, truth, rig) -> tuple[float, float, dict[str, list[np.ndarray]]]:
    """Return how far the best pose of a rig is from random poses of the artist's, and these from
    the mesh at rest, as percentages of the longest side; and the vertices of both in each pose.
    """
    random, middle = np.random.default_rng(0), truth["V"].mean(axis=0)
    positions, size = truth["V"] - middle, float(np.ptp(truth["V"], axis=0).max())
    chosen = random.permutation(len(positions))[:_FITTED]
    left, moved, posed = [], [], {}
    for number in range(_POSES):
        turns = {
            joint: Rotation.from_rotvec(random.normal(0.0, _TURN, 3)).as_matrix()
            for joint in np.flatnonzero(truth["parents"] >= 0)
        }
        worlds = evaluate_rig.globals_(truth["J"] - middle, truth["parents"], turns)
        goal = evaluate_rig.lbs(positions, truth["W"], worlds)
        moves = _best_pose(
            positions[chosen], goal[chosen], rig["J"] - middle, rig["parents"], rig["W"][chosen]
        )
        fitted = evaluate_rig.lbs(positions, rig["W"], moves)
        left.append(np.linalg.norm(fitted - goal, axis=1)[chosen].mean())
        moved.append(np.linalg.norm(positions - goal, axis=1)[chosen].mean())
        posed[f"random pose {number + 1}"] = [goal, fitted]
    return 100.0 * float(np.mean(left)) / size, 100.0 * float(np.mean(moved)) / size, posed


def _best_pose(rest, goal, places, parents, weights) -> np.ndarray:
    """Return the motion (J, 4, 4) of each joint from rest to the pose of a rig nearest to a goal.

    Gauss-Newton steps over the rotations of all joints and the translation of the root, from rest.
    """
    count = len(places)
    above = np.eye(count, dtype=bool)  # whether a joint is below another one, or the same
    for joint in np.flatnonzero(parents >= 0):
        above[joint] |= above[parents[joint]]
    turns, shift = np.tile(np.eye(3), (count, 1, 1)), (goal - rest).mean(axis=0)
    damping = _DAMPING * len(rest) * float(np.ptp(rest, axis=0).max()) ** 2
    best, least = np.tile(np.eye(4), (count, 1, 1)), np.inf
    for _ in range(_STEPS):
        origins = np.empty_like(places)
        for joint, parent in enumerate(parents):
            offset = places[joint] + shift
            if parent >= 0:
                offset = origins[parent] + turns[parent] @ (places[joint] - places[parent])
            origins[joint] = offset
        each = np.einsum("jab,vjb->vja", turns, rest[:, None] - places) + origins
        posed = np.einsum("vj,vja->va", weights, each)
        error = float(np.linalg.norm(goal - posed, axis=1).mean())
        if error < least:
            best, least = best.copy(), error
            best[:, :3, :3] = turns
            best[:, :3, 3] = origins - np.einsum("jab,jb->ja", turns, places)
        # Rotating joint k by w moves a vertex by w x sum of its weights below k times its place
        # relative to k.
        total = weights @ above
        arms = np.einsum("vja,jk->vka", weights[:, :, None] * each, above.astype(float))
        arms -= total[:, :, None] * origins
        slopes = np.zeros((len(rest), 3, 3 * count + 3))
        for axis in range(3):
            turned = np.cross(np.eye(3)[axis], arms)
            slopes[:, :, axis : 3 * count : 3] = turned.transpose(0, 2, 1)
            slopes[:, axis, 3 * count + axis] = 1.0
        slopes = slopes.reshape(-1, 3 * count + 3)
        matrix = slopes.T @ slopes + damping * np.eye(3 * count + 3)
        step = np.linalg.solve(matrix, slopes.T @ (goal - posed).ravel())
        shift = shift + step[3 * count :]
        added = Rotation.from_rotvec(above @ step[: 3 * count].reshape(count, 3)).as_matrix()
        turns = added @ turns
    return best


def _summarise(scores: list[dict[str, float]], is_quadruped: bool) -> None:
    joints = np.array([score["joint_mean"] for score in scores])
    deformation = float(np.mean([score["def_mean"] for score in scores]))
    below = f"below 6 %: {np.mean(joints < 6.0):.0%}"
    if is_quadruped:
        print(
            f"\nquadrupeds: mean joint error {joints.mean():.2f} % (goal: {QUADRUPED_GOAL}), "
            f"{below}; mean deformation {deformation:.2f} %"
        )
        return
    print(
        f"\nhumanoids: median joint error {np.median(joints):.2f} % (goal: "
        f"{HUMANOID_GOALS['joint']}), {below} (goal: 90%); mean deformation {deformation:.2f} % "
        f"(goal: {HUMANOID_GOALS['deformation']})"
    )


def rigged(evaluate_rig, truth, template: Figure, is_quadruped: bool):
    """Return a rig as ``evaluate_rig.compare`` expects it, and its confidence."""
    triangles = truth["F"].astype(np.int32)
    mesh = Mesh(truth["V"], vertex_normals(truth["V"], triangles), triangles)
    result = transfer(template, rest_pose(template.skeleton), mesh)
    skin, skeleton = result.figure.skin, result.figure.skeleton
    return {
        "W": _weights_of(skin),
        "J": joint_matrices(result.figure, result.pose)[:, :3, 3],
        "parents": np.array(skeleton.parents),
        "sem": evaluate_rig.mapping("rfox" if is_quadruped else "body", list(skeleton.names)),
        "confidence": confidence(result.findings),
    }


def _posed(evaluate_rig, truth, rig) -> dict[str, list[np.ndarray]]:
    """Return the vertices in each of the five poses, by the artist's rig and ours.

    Like ``evaluate_rig.compare``, it rotates only joints that both have: many artists' rigs have no
    wrists.
    """
    is_quadruped = "fup_l" in truth["sem"]
    frame = evaluate_rig.frame(truth["J"], truth["sem"], is_quadruped)
    common, found = truth["sem"].keys() & rig["sem"].keys(), {}
    for name, pose in evaluate_rig.poses(frame, is_quadruped).items():
        found[name] = []
        for body in (truth, rig):
            turned = {body["sem"][key]: turn for key, turn in pose.items() if key in common}
            moves = evaluate_rig.globals_(body["J"], body["parents"], turned)
            found[name].append(evaluate_rig.lbs(truth["V"], body["W"], moves))
    return found


def _save_sheet(path: Path, truth, rig, posed: dict[str, list[np.ndarray]]) -> None:
    """Draw the skeletons at rest and poses, the artist's on the left and ours on the right."""
    triangles = truth["F"].astype(np.int32)
    turn, inclination = _VIEW
    right = np.array([np.cos(np.radians(turn)), 0.0, -np.sin(np.radians(turn))])

    def picture(name: str, both: list[np.ndarray], skeletons: Sequence[Skeleton | None]):
        actors, step = [], _GAP * max(float(np.ptp(each @ right)) for each in both)
        for column, (positions, skeleton) in enumerate(zip(both, skeletons, strict=True)):
            mesh = Mesh(positions, vertex_normals(positions, triangles), triangles)
            place = translation_matrix(column * step * right)
            figure = Figure(f"{name} {column}", mesh, skeleton)
            actors.append(Actor(figure, placement=place))
        shown = "both" if skeletons[0] is not None else "skin"
        pixels = viewer.render(
            Scene(actors), _PICTURE, azimuth=turn, inclination=inclination, orthographic=True,
            grid=False, background="white", quality="draft", show=shown,
        ).copy()  # fmt: skip
        write_label(pixels[-_LABEL:], name)
        return pixels

    skeletons = [
        parts_of({"names": range(len(body["J"])), **body, "V": truth["V"], "F": truth["F"]},
                 body["parents"])[0]
        for body in (truth, rig)
    ]  # fmt: skip
    pictures = [picture(f"{path.stem}: artist, ours", [truth["V"]] * 2, skeletons)]
    pictures += [picture(name, both, (None, None)) for name, both in posed.items()]
    blank = np.full_like(pictures[0], 255)
    pictures += [blank] * (-len(pictures) % _ACROSS)
    rows = [np.hstack(pictures[i : i + _ACROSS]) for i in range(0, len(pictures), _ACROSS)]
    path.parent.mkdir(parents=True, exist_ok=True)
    save_image(path, np.vstack(rows))


if __name__ == "__main__":
    main()
