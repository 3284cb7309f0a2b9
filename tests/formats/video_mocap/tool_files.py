"""Small results of each tool in the layout of its program."""

from pathlib import Path
from typing import Any

import numpy as np
from builders import rotation
from exporters.plain_smpl import smpl_forward
from formats.archive.joblib_bytes import joblib_file
from formats.capture_files import waves
from formats.synthetic_smpl import joint_parents, model
from formats.torch.torch_bytes import torch_zip
from numpy.testing import assert_allclose

import viewer
from viewer.loading import MotionSettings, load
from viewer.rigs.scene import Scene, pose_actors

UPRIGHT = np.array([np.pi, 0.0, 0.0])
"""The rotation vector of a person who is upright in camera space, where y points down."""

AHEAD = np.array([0.0, 0.0, 4.0])
"""A position four metres in front of a camera."""


def single(values: Any) -> Any:
    """Return numbers in single precision, as all tools store them."""
    return np.asarray(values, dtype=np.float32)


def matrices(vectors: Any) -> Any:
    """Return the rotation matrices of rotation vectors (..., 3)."""
    flat = np.asarray(vectors, dtype=np.float64).reshape(-1, 3)
    return np.array([rotation(vector) for vector in flat]).reshape(*np.shape(vectors), 3)


def vertices(
    kind: str, arrays: dict[str, Any], betas: Any, rotations: np.ndarray, transl: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and joints of a pose by the published equations. ``rotations`` are (J, 3, 3).
    Further joints have the identity, and further fingers of SMPL-X and SMPL+H the mean hand.
    """
    given = len(rotations)
    turned = np.tile(np.eye(3), (len(joint_parents(kind)), 1, 1))
    turned[:given] = rotations
    for first, side in zip(
        {"smplx": (25, 40), "smplh": (22, 37)}.get(kind, ()), "lr", strict=False
    ):
        for finger, vector in enumerate(arrays[f"hands_mean{side}"].reshape(15, 3)):
            if first + finger >= given:
                turned[first + finger] = rotation(vector)
    moved, places = smpl_forward(arrays, betas, turns=turned)
    return moved + np.asarray(transl), places + np.asarray(transl)


def gvhmr(length: int = 4) -> dict[str, Any]:
    """Return one person in both spaces, rotated by the same camera."""
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
    """Return two people; the second appears in frame 3 and is missing in frame 5."""
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
    """Return a synthetic body model in the format of the published models."""
    path = folder / f"{kind.upper()}_NEUTRAL.npz"
    if not path.exists():  # two scenes of one file share the model, so it must not change
        np.savez(path, **model(kind))
    return path


def scene_of(path: Path, kind: str, space: str = "", **settings: Any) -> Scene:
    """Return the results for a synthetic body model."""
    body = body_model(kind, path.parent)
    return load(path, body, motion=MotionSettings(space=space, **settings))


def drawn(scene: Scene, person: int, frame: int) -> Any:
    """Return a person's vertices in a video frame, in the space of the file; None if absent."""
    actor = next(actor for actor in scene.actors if actor.person == person)
    timing = actor.clip.timing
    pose_actors([actor], timing.time(frame - timing.first_frame))
    if not actor.is_present:
        return None
    return viewer.deform(actor.figure, actor.pose)[0]


def assert_drawn(scene: Scene, person: int, frame: int, wanted: Any) -> None:
    """Assert that vertices match a tool's formula; the files have single precision."""
    assert_allclose(drawn(scene, person, frame), wanted, rtol=0, atol=1e-6)


def phalp(length: int = 3) -> dict[str, Any]:
    """Return person 2 in all frames, and person 5, who is visible only in the first."""
    frames: dict[str, Any] = {}
    for frame in range(length):
        detections = [phalp_body(person, frame) for person in (2, 5)]
        frames[f"out/img/{frame + 1:06}.jpg"] = {
            "time": frame,
            "shot": 0,
            "tid": [2, 5],
            "tracked_ids": [2] if frame else [2, 5],
            "tracked_time": [0, frame],
            "bbox": [single([1, 2, 3, 4])] * 2,
            "size": [[720, 1280]] * 2,
            "mask": [[{"size": [720, 1280], "counts": b"abc"}]] * 2,
            "smpl": [smpl for smpl, _ in detections],
            "camera": [place for _, place in detections],
        }
    return frames


def phalp_body(person: int, frame: int) -> tuple[dict[str, Any], Any]:
    vectors = waves(24, 3, seed=person + 10 * frame) / 2
    turned = single(matrices(np.vstack([UPRIGHT + vectors[0], vectors[1:]])))
    body = {
        "global_orient": turned[:1],
        "body_pose": turned[1:],
        "betas": single(waves(10, seed=person)),
    }
    return body, single(waves(3, seed=frame) + AHEAD)


def turns(length: int, seed: float) -> tuple[Any, Any]:
    """Return the rotations and translations of a moving camera."""
    return single(matrices(waves(length, 3, seed=seed))), single(waves(length, 3, seed=seed + 1))


def tram_track(frames: list[int], seed: float) -> dict[str, Any]:
    vectors = waves(len(frames), 24, 3, seed=seed) / 2
    vectors[:, 0] += UPRIGHT
    return {
        "pred_cam": single(waves(len(frames), 3)),
        "pred_pose": single(six_of(matrices(vectors))),
        "pred_shape": single(waves(len(frames), 10, seed=seed)),
        "pred_rotmat": single(matrices(vectors)),
        "pred_trans": single(waves(len(frames), 3, seed=seed) + AHEAD)[:, None],
        "frame": np.array(frames),
        "img_focal": np.array(900.0),
    }


def six_of(turned: Any) -> Any:
    """Return 6D rotations, the first two columns one after the other."""
    return np.swapaxes(np.asarray(turned)[..., :2], -1, -2).reshape(len(turned), -1)


def tram_camera(length: int = 6) -> dict[str, Any]:
    pred_r, pred_t = turns(length, 1.0)
    world_r, world_t = turns(length, 2.0)
    return {
        "pred_cam_R": pred_r,
        "pred_cam_T": pred_t,
        "world_cam_R": world_r,
        "world_cam_T": world_t,
        "img_focal": np.array(900.0),
        "img_center": np.array([640.0, 360.0]),
        "spec_focal": np.array(800.0),
    }


def prompthmr(length: int = 4) -> dict[str, Any]:
    """Return one person with finger matrices of zeros."""
    vectors = waves(length, 55, 3, seed=1.0) / 2
    vectors[:, 0] += UPRIGHT
    turned = single(matrices(vectors))
    turned[:, 25:] = 0.0
    rcw, tcw = turns(length + 2, 3.0)
    person = {
        "frames": np.arange(1, length + 1),
        "track_id": 1,
        "masks": np.zeros((length, 2, 2), np.bool_),
        "smplx_cam": {
            "rotmat": turned,
            "pose": single(waves(length, 75)),
            "shape": single(waves(length, 10)),
            "trans": single(waves(length, 3) + AHEAD),
            "contact": single(waves(length, 6)),
        },
        "smplx_world": {
            "pose": single(waves(length, 165, seed=5.0) / 2),
            "shape": single(np.tile(waves(10), (length, 1))),
            "trans": single(waves(length, 3, seed=6.0)),
        },
    }
    camera = {"img_focal": 900.0, "img_center": np.array([640.0, 360.0])}
    return {
        "camera": camera | {"pred_cam_R": rcw, "pred_cam_T": tcw},
        "people": {1: person},
        "timings": {},
        "masks": None,
        "camera_world": camera | {"Rcw": rcw, "Tcw": tcw},
    }


def slahmr(length: int = 4) -> dict[str, Any]:
    """Return two people who share a camera."""
    turned, placed = turns(length, 4.0)
    roots = waves(2, length, 3, seed=1.0) / 4 + UPRIGHT
    return {
        "trans": single(waves(2, length, 3) + AHEAD),
        "root_orient": single(roots),
        "pose_body": single(waves(2, length, 63, seed=2.0) / 2),
        "betas": single(waves(2, 16, seed=3.0)),
        "latent_pose": single(waves(2, length, 32)),
        "cam_R": np.stack([turned] * 2),
        "cam_t": np.stack([placed] * 2),
        "intrins": single([900, 910, 640, 360]),
        "floor_plane": single([[0, -1, 0.5]]),
        "world_scale": single([[1.0]]),
    }
