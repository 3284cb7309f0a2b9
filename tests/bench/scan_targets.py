"""Scan-like meshes without a rig but with known weights, derived from the bundled figures. They are
people of different shapes, in A- and T-pose, with noise, different tessellation, holes, clothes and
hair as open shells, a missing foot, or in centimetres with z up; and an animal of different
proportions than the fox. Run as a program, the module writes them as .obj, and a walk for each
template as .bvh: python tests/bench/scan_targets.py FOLDER
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import scipy.sparse as sp
import transfer_targets as made
from exporting import export_frames

import viewer
from viewer.exporters import ExportOptions, export
from viewer.rigs.geometry.quaternion import multiply
from viewer.rigs.mesh import vertex_normals
from viewer.rigs.motion.sampled_animation import sample_animation
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor

FRAMES, RATE = 32, 30.0  # one stride
# From metres with y up to centimetres.
Z_UP = 100.0 * np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


@dataclass(frozen=True)
class Scan:
    """A mesh without a rig, and its expected weights.

    Attributes
    ----------
    name : str
        Name of the mesh and its file.
    template : str
        ``"body"`` or ``"fox"``.
    positions : (W, 3)
        Positions in the unit and axes of the scan.
    triangles : (T, 3)
        Vertex indices.
    weights : (W, J) sparse
        Weights of the template's joints.
    pose : Pose
        Pose of the template that matches the scan.
    up : str
        Up axis of the positions.
    """

    name: str
    template: str
    positions: np.ndarray
    triangles: np.ndarray
    weights: sp.csr_array
    pose: viewer.Pose
    up: str = "y"


def scans() -> list[Scan]:
    body, fox = made.body(), made.fox()
    rng = np.random.default_rng(7)
    heavy = {"mass": 2.0, "belly": 1.5, "stature": -1.0}
    tall = {"stature": 2.0, "leg length": 1.5, "shoulder width": 1.0}
    t_pose = person(body, heavy, arms=0.0)
    a_pose = person(body, tall, arms=0.8)
    down = person(body, {"hip width": 1.0, "bust": 1.0}, arms=1.2)
    return [
        z_up(noisy(meshed(t_pose, 0.5), rng, "t_pose")),
        holed(noisy(meshed(a_pose, 0.7), rng, "a_pose")),
        z_up(clothed(noisy(meshed(down, 0.75), rng, "clothed"))),
        without(noisy(meshed(t_pose, 0.75), rng, "one_foot"), ["left_ankle", "left_foot"]),
        z_up(noisy(meshed(other_animal(fox), 0.6), rng, "animal")),
    ]


def person(body: viewer.Figure, shape: dict[str, float], arms: float) -> made.Target:
    """Return a person of a different shape, with the arms lowered by an angle in radians."""
    pose = viewer.rest_pose(body.skeleton)
    pose.shape_weights = np.array([shape.get(name, 0.0) for name in body.blend_shapes.names])
    names = list(body.skeleton.names)
    turns = np.zeros((len(names), 3))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        turns[names.index(f"{side}_shoulder"), 2] = -sign * arms
        turns[names.index(f"{side}_elbow"), 1] = -sign * 0.3 * (arms > 0.0)
        turns[names.index(f"{side}_hip"), 2] = sign * 0.15 * (arms > 0.0)
    made.turn_joints(pose, turns)
    return made.posed("body", body, pose)


def other_animal(fox: viewer.Figure) -> made.Target:
    """Return a heavier animal in a different stance, with longer legs and a larger head."""
    pose = made.bent_pose(fox, np.random.default_rng(11), np.radians(6.0))
    whole = made.posed("fox", fox, pose)
    names = fox.skeleton.names
    head = [i for i, name in enumerate(names) if name in ("head", "jaw") or name.startswith("ear")]
    share = np.asarray(whole.weights[:, head].sum(axis=1)).ravel()
    x, y, z = whole.positions.T
    center = whole.positions[share > 0.9].mean(axis=0)
    legs = 1.0 - np.clip(y / 0.3, 0.0, 1.0)
    stretched = np.stack([1.25 * x, 1.1 * y + 0.05 * (1.0 - legs), 0.88 * z], axis=1)
    bigger = stretched + 0.2 * share[:, None] * (whole.positions - center)
    return replace(whole, positions=bigger)


def meshed(target: made.Target, share: float) -> made.Target:
    """Return the scan with a different tessellation and with edges scaled by a factor."""
    fine = made.subdivided(made.subdivided(target))
    length = made.edge_length(target.positions, target.triangles)
    return made.clustered(fine, share * length)


def noisy(target: made.Target, rng, name: str) -> Scan:
    """Return the scan with noise of a tenth of an edge along x, y and z."""
    template = "body" if "left_hip" in target.figure.skeleton.names else "fox"
    step = 0.1 * made.edge_length(target.positions, target.triangles)
    moved = target.positions + rng.normal(scale=step, size=target.positions.shape)
    return Scan(name, template, moved, target.triangles, target.weights, target.pose)


def z_up(scan: Scan) -> Scan:
    """Return the scan in centimetres with z up and away from the origin."""
    return replace(scan, positions=scan.positions @ Z_UP.T + [20.0, -35.0, 90.0], up="z")


def holed(scan: Scan) -> Scan:
    """Return the scan without the areas that scanners miss: armpits, crotch, soles and crown."""
    names = made.body().skeleton.names
    joints = viewer.joint_matrices(made.body(), scan.pose)[:, :3, 3]
    at = dict(zip(names, joints, strict=True))
    low, high = scan.positions.min(axis=0), scan.positions.max(axis=0)
    places = [
        (at["left_shoulder"] - [0.03, 0.1, 0.0], 0.07),
        (at["right_shoulder"] - [-0.03, 0.1, 0.0], 0.07),
        (at["pelvis"] - [0.0, 0.14, 0.0], 0.07),
        (np.array([at["head"][0], high[1], at["head"][2]]), 0.06),
    ]
    gone = scan.positions[:, 1] < low[1] + 0.012
    for place, radius in places:
        gone |= np.linalg.norm(scan.positions - place, axis=1) < radius
    return kept(scan, ~gone[scan.triangles].any(axis=1))


def without(scan: Scan, joints: list[str]) -> Scan:
    """Return the scan without the parts dominated by some joints."""
    gone = np.isin(scan.weights.toarray().argmax(axis=1), joint_numbers(scan, joints))
    return kept(scan, ~gone[scan.triangles].any(axis=1))


def clothed(scan: Scan) -> Scan:
    """Put a jacket, a skirt and hair on a person, and remove the skin beneath."""
    jacket = ["spine1", "spine2", "spine3", "left_shoulder", "right_shoulder", "left_collar",
              "right_collar"]  # fmt: skip
    skirt = ["pelvis", "left_hip", "right_hip"]
    hair = part(scan, ["head"], 0.02)
    height = hair.positions[:, 1]
    behind = hair.positions[:, 2] < np.median(hair.positions[:, 2]) + 0.02
    crown = height > np.percentile(height, 70.0)
    hair = kept(hair, (behind | crown)[hair.triangles].all(axis=1))
    bare = without(scan, [*jacket, *skirt])
    return joined([bare, part(scan, jacket, 0.015), part(scan, skirt, 0.03), hair])


def part(scan: Scan, joints: list[str], offset: float) -> Scan:
    """Return the part dominated by some joints as a smooth shell offset from the skin."""
    normals = smooth_normals(scan)
    strongest = scan.weights.toarray().argmax(axis=1)
    inside = np.isin(strongest, joint_numbers(scan, joints))
    moved = replace(scan, positions=scan.positions + offset * normals)
    return kept(moved, inside[scan.triangles].all(axis=1))


def smooth_normals(scan: Scan) -> np.ndarray:
    links = made.edges(scan.triangles)
    both = np.concatenate([links, links[:, ::-1]])
    count = len(scan.positions)
    matrix = sp.csr_array((np.ones(len(both)), (both[:, 0], both[:, 1])), shape=(count, count))
    normals = vertex_normals(scan.positions, scan.triangles)
    for _ in range(15):
        normals = normals + matrix @ normals
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return normals


def joint_numbers(scan: Scan, joints: list[str]) -> list[int]:
    names = list((made.body() if scan.template == "body" else made.fox()).skeleton.names)
    return [names.index(joint) for joint in joints]


def kept(scan: Scan, chosen: np.ndarray) -> Scan:
    """Return the scan with some of its triangles, and the vertices that they use."""
    used, flat = np.unique(scan.triangles[chosen], return_inverse=True)
    triangles = flat.reshape(-1, 3).astype(np.int32)
    return replace(
        scan, positions=scan.positions[used], triangles=triangles, weights=scan.weights[used]
    )


def joined(parts: list[Scan]) -> Scan:
    starts = np.cumsum([0, *(len(part.positions) for part in parts[:-1])])
    return replace(
        parts[0],
        positions=np.concatenate([part.positions for part in parts]),
        triangles=np.concatenate(
            [part.triangles + start for part, start in zip(parts, starts, strict=True)]
        ).astype(np.int32),
        weights=sp.csr_array(sp.vstack([part.weights for part in parts])),
    )


def mesh_of(scan: Scan) -> viewer.Mesh:
    normals = vertex_normals(scan.positions, scan.triangles)
    return viewer.Mesh(scan.positions, normals, scan.triangles)


def walk(figure: viewer.Figure, what: str) -> SampledClip:
    """Return one stride as sine curves of the joints in the axes of the template."""
    turns = body_turns(figure) if what == "body" else fox_turns(figure)
    quaternions = turns_to_quaternions(turns)
    rest = viewer.rest_pose(figure.skeleton)
    if what == "body":
        # The arms are first lowered about z, then they swing.
        down = np.zeros((figure.skeleton.n_joints, 3))
        names = list(figure.skeleton.names)
        down[names.index("left_shoulder"), 2] = -1.2
        down[names.index("right_shoulder"), 2] = 1.2
        quaternions = multiply(quaternions, turns_to_quaternions(down))
    else:
        from viewer.rigs.geometry.rotation import matrix_to_quaternion
        from viewer.rigs.pose import joint_rotations

        at_rest = matrix_to_quaternion(joint_rotations(figure.skeleton, rest))
        quaternions = multiply(at_rest, quaternions)
    timing = Timing(RATE, np.arange(FRAMES, dtype=np.int32))
    return SampledClip("walk", timing, quaternions)


def body_turns(figure: viewer.Figure) -> np.ndarray:
    """Return rotation vectors (N, J, 3): legs and arms swing about x, opposite to each other."""
    names = list(figure.skeleton.names)
    phase = 2.0 * np.pi * np.arange(FRAMES) / FRAMES
    turns = np.zeros((FRAMES, len(names), 3))
    for side, start, sign in (("left", 0.0, 1.0), ("right", np.pi, -1.0)):
        swing = np.sin(phase + start)
        lift = np.maximum(0.0, np.cos(phase + start))
        turns[:, names.index(f"{side}_hip"), 0] = -0.05 - 0.45 * swing
        turns[:, names.index(f"{side}_knee"), 0] = 0.12 + 0.8 * lift
        turns[:, names.index(f"{side}_ankle"), 0] = 0.15 * swing - 0.1 * lift
        turns[:, names.index(f"{side}_shoulder"), 0] = 0.4 * swing
        turns[:, names.index(f"{side}_elbow"), 1] = -sign * (0.4 - 0.25 * swing)
    turns[:, names.index("spine2"), 1] = 0.1 * np.sin(phase)
    turns[:, names.index("pelvis"), 1] = -0.08 * np.sin(phase)
    return turns


def fox_turns(figure: viewer.Figure) -> np.ndarray:
    """Return rotation vectors (N, J, 3): a trot, in which diagonal legs move together."""
    names = list(figure.skeleton.names)
    phase = 2.0 * np.pi * np.arange(FRAMES) / FRAMES
    turns = np.zeros((FRAMES, len(names), 3))
    for leg, start in (("fore_{}_l", 0.0), ("fore_{}_r", np.pi), ("hind_{}_l", np.pi),
                       ("hind_{}_r", 0.0)):  # fmt: skip
        swing, lift = np.sin(phase + start), np.maximum(0.0, np.cos(phase + start))
        turns[:, names.index(leg.format("upper")), 0] = -0.35 * swing
        bend = 1.0 if leg.startswith("hind") else -1.0
        turns[:, names.index(leg.format("lower")), 0] = bend * 0.5 * lift
        turns[:, names.index(leg.format("paw")), 0] = -bend * 0.3 * lift
    for number in range(1, 8):
        turns[:, names.index(f"tail_{number}"), 1] = 0.08 * np.sin(phase - 0.4 * number)
    turns[:, names.index("neck_1"), 0] = 0.08 * np.sin(2.0 * phase)
    return turns


def turns_to_quaternions(vectors: np.ndarray) -> np.ndarray:
    angles = np.linalg.norm(vectors, axis=-1, keepdims=True)
    axes = vectors / np.where(angles > 0.0, angles, 1.0)
    return np.concatenate([np.sin(angles / 2.0) * axes, np.cos(angles / 2.0)], axis=-1)


def main() -> None:
    folder = Path(sys.argv[1])
    for scan in scans():
        export(Actor(viewer.Figure(scan.name, mesh_of(scan))), folder / f"{scan.name}.obj")
        print(f"{scan.name}.obj: {len(scan.positions)} vertices, from {scan.template}")
    for what, figure in (("body", made.body()), ("fox", made.fox())):
        actor = Actor(figure, viewer.rest_pose(figure.skeleton), clip=walk(figure, what))
        path = folder / f"walk_{what}.bvh"
        lines = export_frames(sample_animation(actor), path, "bvh", ExportOptions())
        print("\n".join(map(str, lines)))


if __name__ == "__main__":
    main()
