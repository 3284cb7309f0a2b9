"""Small results of each tool, in the layouts of their own programs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from formats.capture_files import waves
from formats.joblib.joblib_bytes import joblib_file
from formats.synthetic_smpl import model
from formats.torch.torch_bytes import torch_zip
from formats.video_mocap.plain_smpl import rotation
from numpy.testing import assert_allclose

import viewer
from viewer.loading import MotionSettings, load
from viewer.rig.motion.evaluation import pose_actor
from viewer.rig.scene import Scene

UPRIGHT = np.array([np.pi, 0.0, 0.0])
"""Rotation vector of a person who stands upright in a camera's space, where y points down."""

AHEAD = np.array([0.0, 0.0, 4.0])
"""A place four metres in front of a camera."""


def single(values: Any) -> Any:
    """Numbers in single precision, as all tools store them."""
    return np.asarray(values, dtype=np.float32)


def matrices(vectors: Any) -> Any:
    """Rotation matrices of rotation vectors (..., 3)."""
    flat = np.asarray(vectors, dtype=np.float64).reshape(-1, 3)
    return np.array([rotation(vector) for vector in flat]).reshape(*np.shape(vectors), 3)


def gvhmr(length: int = 4) -> dict[str, Any]:
    """One person in both spaces, turned by the same camera."""
    body = {
        "body_pose": single(waves(length, 63) / 2),
        "betas": single(np.tile(waves(10), (length, 1))),
    }
    world = {
        "global_orient": single(waves(length, 3, seed=1.0)),
        "transl": single(waves(length, 3)),
    }
    camera = {
        "global_orient": single(waves(length, 3, seed=2.0) / 4 + UPRIGHT),
        "transl": single(waves(length, 3, seed=3.0) + AHEAD),
    }
    k = np.array([[1000.0, 0, 640], [0, 1000, 360], [0, 0, 1]])
    return {
        "smpl_params_global": body | world,
        "smpl_params_incam": body | camera,
        "K_fullimg": single(np.tile(k, (length, 1, 1))),
        "net_outputs": {"model_output": {"pred_cam": single(waves(length, 3))}},
    }


def wham(length: int = 4) -> dict[int, dict[str, Any]]:
    """Two people, the second from frame 3 on and not in frame 5."""
    people = {}
    for person, frames in ((0, range(length)), (4, [3, 4, 6, 7, 8][:length])):
        pose = waves(length, 72, seed=person)
        people[person] = {
            "pose": single(pose + np.concatenate([UPRIGHT, np.zeros(69)])),
            "trans": single(waves(length, 3, seed=person + 1) + AHEAD),
            "pose_world": single(pose),
            "trans_world": single(waves(length, 3, seed=person + 2)),
            "betas": single(waves(length, 10, seed=person + 3)),
            "verts": single(np.zeros((length, 6890, 3))),
            "frame_ids": np.array([*frames]),
        }
    return people


def gvhmr_file(folder: Path, **changes: Any) -> Path:
    path = folder / "hmr4d_results.pt"
    path.write_bytes(torch_zip(gvhmr() | changes))
    return path


def wham_file(folder: Path) -> Path:
    path = folder / "wham_output.pkl"
    path.write_bytes(joblib_file(wham()))
    return path


def body_model(kind: str, folder: Path) -> Path:
    """A made-up body model, written as the published ones are."""
    path = folder / f"{kind.upper()}_NEUTRAL.npz"
    if not path.exists():  # two scenes of one file share it, and it must not change meanwhile
        np.savez(path, **model(kind))
    return path


def scene_of(path: Path, kind: str, space: str = "", **settings: Any) -> Scene:
    """Results on a made-up body model."""
    body = body_model(kind, path.parent)
    return load(path, body, motion=MotionSettings(space=space, **settings))


def drawn(scene: Scene, person: int, frame: int) -> Any:
    """A person's vertices in a frame of the video, in the space of the file; None if absent."""
    actor = next(actor for actor in scene.actors if actor.person == person)
    timing = actor.clip.timing
    pose_actor(actor, timing.time(frame - timing.first_frame))
    if not actor.is_present:
        return None
    return viewer.deform(actor.figure, actor.pose)[0]


def assert_drawn(scene: Scene, person: int, frame: int, wanted: Any) -> None:
    """Vertices agree with a tool's own formula; the files have single precision."""
    assert_allclose(drawn(scene, person, frame), wanted, rtol=0, atol=1e-6)
