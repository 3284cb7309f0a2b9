"""A synthetic capture in EasyMocap's layout: bodies, keypoints, cameras and their images."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gallery_generator.walk import Walk
from viewer.rigs.arrays import Floats
from viewer.rigs.captures.cameras import CameraView
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.motion.body_motion import BodyMotion, body_clip, root_positions
from viewer.rigs.motion.timing import Timing
from viewer.rigs.pose import placement_matrix
from viewer.rigs.scene import Actor, pose_actors

__all__ = ["Person", "camera_at", "write_cameras", "write_frames"]

_NOISE = 0.008  # standard deviation of the noise of keypoints, metres


@dataclass(frozen=True, slots=True)
class Person:
    """A walking person: shape coefficients (S,) and motion."""

    shape: Floats
    walk: Walk


def write_frames(folder: Path, body: Figure, people: Sequence[Person], with_points: bool) -> None:
    """Write ``smpl/`` and, if requested, ``keypoints3d/``, with small detection errors."""
    rng = np.random.default_rng(7)
    points = [_joints(body, person) for person in people] if with_points else []
    for frame in range(len(people[0].walk.poses)):
        bodies = [_row(number, body, person, frame) for number, person in enumerate(people)]
        _write(folder / "smpl" / f"{frame:06}.json", bodies)
        if with_points:
            rows = []
            for number, joints in enumerate(points):
                found = joints[frame] + rng.normal(0.0, _NOISE, joints[frame].shape)
                sure = np.full((len(found), 1), 0.95)
                places = np.hstack([found, sure]).round(4).tolist()
                rows.append({"id": number, "keypoints3d": places})
            _write(folder / "keypoints3d" / f"{frame:06}.json", rows)


def _row(number: int, body: Figure, person: Person, frame: int) -> dict[str, object]:
    """Return a body in EasyMocap's convention, V = R(Rh) X + Th about the model's origin."""
    walk = person.walk
    root = walk.poses[frame, 0]
    pelvis = root_positions(body, person.shape[None])[0]
    moved = walk.translations[frame] + pelvis - rotation_vector_to_matrix(root) @ pelvis
    poses = np.concatenate([np.zeros(3), walk.poses[frame, 1:].ravel()])
    return {
        "id": number,
        "Rh": [root.round(5).tolist()],
        "Th": [moved.round(5).tolist()],
        "poses": [poses.round(4).tolist()],
        "shapes": [person.shape.round(3).tolist()],
    }


def _joints(body: Figure, person: Person) -> Floats:
    """Return the positions of the joints in all frames: (F, 24, 3)."""
    walk, names = person.walk, body.require_skeleton().names
    timing = Timing(30.0, np.arange(len(walk.poses), dtype=np.int32))
    motion = BodyMotion(
        "walk", timing, names, walk.poses, walk.translations, shape=person.shape[None]
    )
    actor = Actor(body, clip=body_clip(motion, body)[0])
    found = []
    for frame in range(len(walk.poses)):
        pose_actors([actor], frame / 30.0)
        pose = actor.pose
        world = placement_matrix(pose) @ world_matrices(body.require_skeleton(), pose)
        found.append(world[:, :3, 3])
    return np.array(found)


def camera_at(
    name: str,
    eye: Sequence[float],
    target: Sequence[float],
    size: tuple[int, int],
    focal: float,
    distortion: Sequence[float] = (),
) -> CameraView:
    """Return an upright camera that looks at a point; ``focal`` is in pixels."""
    place = np.array(eye, dtype=float)
    forward = np.array(target, dtype=float) - place
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    center = 0.5 * (np.array(size) - 1.0)
    intrinsic = np.array([[focal, 0.0, center[0]], [0.0, focal, center[1]], [0.0, 0.0, 1.0]])
    return CameraView(name, intrinsic, rotation, -rotation @ place, size, np.array(distortion))


def write_cameras(folder: Path, views: Sequence[CameraView]) -> None:
    """Write ``intri.yml`` and ``extri.yml``."""
    names = "names:\n" + "".join(f'  - "{view.name}"\n' for view in views)
    inner, outer = [f"%YAML:1.0\n---\n{names}"], [f"%YAML:1.0\n---\n{names}"]
    for view in views:
        assert view.size is not None  # set by camera_at
        lens = np.zeros(5)
        lens[: len(view.distortion)] = view.distortion
        inner += [_matrix(f"K_{view.name}", view.intrinsic), _matrix(f"dist_{view.name}", lens)]
        inner.append(f"H_{view.name}: {view.size[1]}\nW_{view.name}: {view.size[0]}\n")
        outer += [_matrix(f"Rot_{view.name}", view.rotation)]
        outer += [_matrix(f"T_{view.name}", view.translation)]
    (folder / "intri.yml").write_text("".join(inner))
    (folder / "extri.yml").write_text("".join(outer))


def _matrix(key: str, values: Floats) -> str:
    rows = values if values.ndim == 2 else values[:, None]
    data = ", ".join(f"{value:.9g}" for value in rows.ravel())
    head = f"{key}: !!opencv-matrix\n  rows: {len(rows)}\n  cols: {rows.shape[1]}\n  dt: d\n"
    return f"{head}  data: [{data}]\n"


def _write(path: Path, rows: list[dict[str, object]]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(rows))
