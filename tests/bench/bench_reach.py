"""Drags by inverse kinematics: degrees by which a joint rotates for a centimetre of the target, and
processor time of one frame, on the bundled body with and without limits of its arm.

Reachable targets are those of chains whose DOFs move by known angles (the column "path"); walks
lead beyond reach and to places that limits forbid. Targets are one centimetre apart.
"""

import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from viewer.loading import bundled_body, load
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.pose import Pose, dof_rotations, rest_pose
from viewer.rigs.posing.inverse_kinematics import Reaching, chain_above
from viewer.rigs.skeleton import FIRST_ROTATION, Skeleton

STEP, COUNT, SEEDS = 0.01, 250, 4
GOAL = 4.0  # milliseconds of processor time, mean
# Degrees about x, y, z that a person's left arm and trunk rotate.
LIMITS = {
    "elbow": ((-5, 5), (-150, 0), (-5, 5)), "shoulder": ((-60, 60), (-90, 45), (-80, 80)),
    "collar": ((-10, 10), (-20, 20), (-20, 20)), "spine": ((-10, 10),) * 3,
}  # fmt: skip


def main() -> None:
    """Print a line for each chain and kind of path."""
    print("degrees a centimetre: max / 99 % (path); missed: cm; ms: mean / max")
    for is_walk in (False, True):
        for name, skeleton, joint, length in _chains():
            starts = [_start(skeleton, joint, length, seed) for seed in range(SEEDS)]
            paths = [_path(skeleton, joint, *start, is_walk) for start in starts]
            known = np.concatenate([_rates(skeleton, path[1], path[0]) for path in paths])
            title = f"{'walk' if is_walk else 'reachable':<10}{name:<14}"
            print(f"{title} path {_text(known) if not is_walk else '-':<12}", end="")
            _report(skeleton, joint, length, starts, paths)


def _report(skeleton, joint, length, starts, paths) -> None:
    rates, left, times = [], [], []
    for (pose, _, _), (targets, _) in zip(starts, paths, strict=True):
        reaching = Reaching(skeleton, pose, joint, length)
        dofs = []
        for target in targets:
            started = time.process_time()
            found = reaching.follow(target)
            times.append(1e3 * (time.process_time() - started))
            dofs.append(found.dofs)
            left.append(100.0 * found.distance)
        rates.append(_rates(skeleton, np.array(dofs), targets))
    mean = np.mean(times)
    print(f" | drag {_text(np.concatenate(rates)):<12} missed {max(left):5.2f} "
          f"ms {mean:4.1f} / {max(times):4.1f}{' MISSED' if mean > GOAL else ''}",
          flush=True)  # fmt: skip


def _text(rates: Floats) -> str:
    return f"{rates.max():.1f} / {np.percentile(rates, 99):.1f}"


def _chains() -> Iterator[tuple[str, Skeleton, int, int]]:
    body = load(bundled_body()).actors[0].figure.require_skeleton()
    limits = body.dof_limits.copy()
    for row, (joint, kind) in enumerate(zip(body.dof_joints, body.dof_kinds, strict=True)):
        name = body.names[joint].removeprefix("left_").rstrip("123")
        if name in LIMITS and kind >= FIRST_ROTATION:
            limits[row] = np.radians(LIMITS[name][kind - FIRST_ROTATION])
    limited = replace(body, dof_limits=limits)
    for name, skeleton, joint, lengths in (
        ("arm", body, "left_wrist", (2, 3, 5)), ("leg", body, "left_ankle", (2,)),
        ("arm, limits", limited, "left_wrist", (2, 3, 5)),
    ):  # fmt: skip
        for length in lengths:
            yield f"{name} {length}", skeleton, skeleton.names.index(joint), length


def _start(skeleton: Skeleton, joint: int, length: int, seed: int) -> tuple[Pose, Ints, int]:
    rng, pose = np.random.default_rng(seed), rest_pose(skeleton)
    chain = chain_above(skeleton, joint, length)
    free = (skeleton.dof_kinds >= FIRST_ROTATION) & ~skeleton.locked
    rows = np.flatnonzero(free & np.isin(skeleton.dof_joints, chain))
    moved = pose.dofs[rows] + rng.uniform(-0.3, 0.3, len(rows))
    pose.dofs[rows] = np.clip(moved, *skeleton.dof_limits[rows].T)
    return pose, rows, seed


def _path(
    skeleton: Skeleton, joint: int, pose: Pose, rows: Ints, seed: int, is_walk: bool
) -> tuple[Floats, Floats]:
    """Return targets (F, 3), and the DOFs (F, D) of a chain that reaches them."""
    rng, times = np.random.default_rng(seed), np.linspace(0.0, 2.0 * np.pi, 400)[:, None]
    if is_walk:
        targets = _walk(skeleton, joint, pose, rows, rng)
        return targets, np.repeat(pose.dofs[None], len(targets), axis=0)
    moves = np.zeros((len(times), len(rows)))
    for rank in range(1, 5):
        phase = rng.uniform(0.0, 2.0 * np.pi, len(rows))
        moves += 0.7 * rng.normal(size=len(rows)) / rank * np.sin(rank * times + phase)
    low, high = skeleton.dof_limits[rows].T
    low, high = np.maximum(low, -1.2), np.minimum(high, 1.2)
    dofs = np.repeat(pose.dofs[None], len(times), axis=0)
    dofs[:, rows] = np.clip(pose.dofs[rows] + moves - moves[0], low, high)
    points = np.array([_place(skeleton, pose, joint, row) for row in dofs])
    along = np.append(0.0, np.linalg.norm(np.diff(points, axis=0), axis=1).cumsum())
    marks = np.interp(np.arange(0.0, along[-1], STEP), along, np.arange(len(along)))[:COUNT]
    dofs = np.array([np.interp(marks, np.arange(len(along)), column) for column in dofs.T]).T
    return np.array([_place(skeleton, pose, joint, row) for row in dofs]), dofs


def _place(skeleton: Skeleton, pose: Pose, joint: int, dofs: Floats) -> Floats:
    moved = pose.copy()
    moved.dofs[:] = dofs
    return world_matrices(skeleton, moved)[joint, :3, 3]


def _walk(
    skeleton: Skeleton, joint: int, pose: Pose, rows: Ints, rng: np.random.Generator
) -> Floats:
    world = world_matrices(skeleton, pose)[:, :3, 3]
    chain = [joint, *chain_above(skeleton, joint, len(set(skeleton.dof_joints[rows].tolist())))]
    reached = 1.15 * np.linalg.norm(np.diff(world[chain], axis=0), axis=1).sum()
    base, points, way = world[chain[-1]], [world[joint]], rng.normal(size=3)
    for _ in range(COUNT):
        way = 0.9 * way + 0.44 * rng.normal(size=3)
        if np.linalg.norm(points[-1] + STEP * way / np.linalg.norm(way) - base) > reached:
            way = -way
        points.append(points[-1] + STEP * way / np.linalg.norm(way))
    return np.array(points)


def _rates(skeleton: Skeleton, dofs: Floats, targets: Floats) -> Floats:
    """Return the largest rotation of a joint between rows, degrees for a centimetre."""
    turns = dof_rotations(skeleton, dofs)
    between = np.swapaxes(turns[:-1], -1, -2) @ turns[1:]
    sines = np.linalg.norm(between - np.swapaxes(between, -1, -2), axis=(-2, -1)) / np.sqrt(2.0)
    angles = np.degrees(np.arctan2(sines, np.trace(between, axis1=-2, axis2=-1) - 1.0)).max(axis=1)
    moved = 100.0 * np.linalg.norm(np.diff(targets, axis=0), axis=1)
    return angles[moved > 1e-3] / moved[moved > 1e-3]


if __name__ == "__main__":
    main()
