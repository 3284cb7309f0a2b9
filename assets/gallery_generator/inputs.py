"""Input files of the gallery, made from the bundled body."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

import viewer
from gallery_generator.capture import Person, camera_at, write_cameras, write_frames
from gallery_generator.images import write_images
from gallery_generator.walk import Gait, walk
from viewer.loading import MotionSettings, bundled_body, load
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.skin import Skin, owners

__all__ = ["body_figure", "make_inputs", "spread", "without_weights"]

RATE = 30.0
N_FRAMES = 61
IMAGE = 20  # frame of the capture with images
_SIZE, _FOCAL = (480, 270), 330.0
_RADIUS = 2.5  # distance of the cameras from the centre of the scene, metres
_LENS = (-0.22, 0.03)
_ANGLES = (-62.0, 8.0, 75.0, 165.0)  # azimuths of the cameras around the people, degrees


def body_figure() -> Figure:
    """Return the bundled body."""
    return viewer.load(bundled_body()).actors[0].figure


def make_inputs(folder: Path) -> None:
    """Write a walk, a capture of two people, and a mesh without a rig."""
    body, still = body_figure(), np.zeros(10)
    alone = walk(body, N_FRAMES, RATE, Gait(phase=0.1))
    write_frames(folder / "walk", body, [Person(still, alone)], with_points=False)
    _make_capture(folder / "capture", body)
    _make_scan(folder, body)


def _make_capture(folder: Path, body: Figure) -> None:
    first = Gait(start=(-0.42, -0.85), heading=6.0, phase=0.1)
    second = Gait(start=(0.42, 0.85), heading=184.0, phase=0.45, period=1.2)
    shapes = np.zeros((2, 10))
    shapes[0, [1, 2, 4]] = -0.5, 0.8, 0.5
    shapes[1, [0, 1, 3, 8]] = -0.8, 0.3, 0.5, 1.0
    people = [
        Person(shape, walk(body, N_FRAMES, RATE, gait))
        for shape, gait in zip(shapes, (first, second), strict=True)
    ]
    write_frames(folder, body, people, with_points=True)
    views = []
    for number, angle in enumerate(np.radians(_ANGLES), start=1):
        eye = _RADIUS * np.sin(angle), 1.5, _RADIUS * np.cos(angle)
        views.append(camera_at(f"{number:02}", eye, (0.0, 0.82, 0.0), _SIZE, _FOCAL, _LENS))
    write_cameras(folder, views)
    scene = load(folder, motion=MotionSettings(model=bundled_body(), up="y"))
    for actor in scene.actors:
        actor.visible = actor.points is None
    write_images(folder, scene, range(N_FRAMES), RATE, range(IMAGE, IMAGE + 1))


def _make_scan(folder: Path, body: Figure) -> None:
    """Write a person of another shape with lowered arms, as a mesh without a rig."""
    actor = viewer.load(bundled_body()).actors[0]
    skeleton, pose = body.require_skeleton(), actor.pose
    pose.shape_weights[:9] = -1.0, 1.6, 0.0, 0.6, -0.4, 0.0, 0.0, 1.2, 0.4
    for side, sign in (("left", -1.0), ("right", 1.0)):
        rows = skeleton.dof_joints == skeleton.names.index(f"{side}_shoulder")
        pose.dofs[np.flatnonzero(rows)[2]] = sign * 0.75
    viewer.export(actor, folder / "scan.obj")


def without_weights(body: Figure, joint: str, count: int) -> Figure:
    """Return a figure in which vertices around the middle of a joint's skin have no weights."""
    weights, skin = _table(body), body.require_skin()
    positions = body.require_mesh().positions
    owned = weights[:, body.require_skeleton().names.index(joint)]
    center = owned @ positions / owned.sum()
    weights[np.argsort(np.linalg.norm(positions - center, axis=1))[:count]] = 0.0
    return replace(body, skin=_skin_of(weights, skin.inverse_bind))


def spread(body: Figure, most: int, rounds: int) -> Figure:
    """Return a figure with smoothed weights: about ``most`` influences per vertex, as in PIG."""
    mesh, weights = body.require_mesh(), _table(body)
    pairs = mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    degree = np.bincount(pairs[:, 0], minlength=len(weights))[:, None]
    for _ in range(rounds):
        summed = np.zeros_like(weights)
        np.add.at(summed, pairs[:, 0], weights[pairs[:, 1]])
        weights = 0.5 * weights + 0.5 * summed / degree
    weights[weights < np.sort(weights, axis=1)[:, [-most]]] = 0.0
    weights /= weights.sum(axis=1, keepdims=True)
    return replace(body, skin=_skin_of(weights, body.require_skin().inverse_bind))


def _table(body: Figure) -> Floats:
    """Return the weights of all vertices and joints: (V, J)."""
    skin = body.require_skin()
    weights = np.zeros((skin.n_vertices, body.require_skeleton().n_joints))
    np.add.at(weights, (owners(skin), skin.joints), skin.weights)
    return weights


def _skin_of(weights: Floats, inverse_bind: Floats) -> Skin:
    vertices, joints = np.nonzero(weights)
    counts = np.bincount(vertices, minlength=len(weights))
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    return Skin(starts, joints.astype(np.int32), weights[vertices, joints], inverse_bind)
