"""Single poses of bodies without a figure: they open like motions of one frame."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

import viewer
from viewer.errors import RigError
from viewer.loading import bundled_body
from viewer.rig.geometry.rotation import quaternion_to_matrix, rotation_vector_to_matrix
from viewer.rig.pose import joint_rotations

BENT = 0.3 * np.sin(np.arange(69.0)).reshape(23, 3)
ROOT = np.array([0.0, 0.4, 0.0])


def opened(folder: Path, **values: Any) -> Any:
    path = folder / "result.npz"
    np.savez(path, **values)
    return viewer.load(path)


@pytest.mark.parametrize("is_whole", [True, False])
def test_pose_of_smpl_is_shown_on_the_bundled_body(tmp_path: Path, is_whole: bool) -> None:
    whole = np.concatenate([ROOT, BENT.ravel()])
    parts = {"global_orient": ROOT[None], "body_pose": BENT.reshape(1, 69)}
    scene = opened(tmp_path, betas=np.zeros((1, 10)), **({"pose": whole} if is_whole else parts))
    (actor,) = scene.actors
    assert actor.figure.name == bundled_body().stem
    turned = joint_rotations(actor.figure.skeleton, actor.pose)
    wanted = rotation_vector_to_matrix(np.concatenate([ROOT[None], BENT]))
    assert_allclose(turned, wanted, rtol=0, atol=1e-9)  # rounding of rotations


def test_fingers_and_face_keep_their_joints(tmp_path: Path) -> None:
    hand = np.linspace(-0.2, 0.2, 45)
    scene = opened(
        tmp_path,
        body_pose=BENT[:21].ravel(),
        jaw_pose=ROOT,
        left_hand_pose=hand,
        flat_hand_mean=True,
    )
    # The bundled body has neither a jaw nor fingers: both are named as omitted.
    (note,) = [note for note in scene.diagnostics if note.key == "F007.joints-left-out"]
    assert note.values["n"] == 16
    assert note.values["names"][:2] == ["jaw", "left_index1"]


@pytest.mark.parametrize(
    "values",
    [
        {"body_pose": np.zeros(69), "global_orient": np.zeros(4)},
        {"pose": np.zeros(71)},
        {"betas": np.zeros(10)},
        {"body_pose": np.zeros(63), "scale": 2.0},
        {"body_pose": np.zeros(63), "left_hand_pose": np.zeros(45), "flat_hand_mean": False},
    ],
)
def test_other_poses_need_a_figure(tmp_path: Path, values: dict[str, Any]) -> None:
    with pytest.raises(RigError) as refused:
        opened(tmp_path, **values)
    expected = "F004.shape-alone" if set(values) == {"betas"} else "F004.pose-alone"
    assert refused.value.diagnostic.key == expected


def test_poses_with_a_figure_are_applied_to_it(tmp_path: Path) -> None:
    path = tmp_path / "result.npz"
    np.savez(path, pose=np.concatenate([ROOT, BENT.ravel()]))
    (actor,) = viewer.load(bundled_body(), path).actors
    assert actor.clip is None
    turned = quaternion_to_matrix(actor.pose.rotations)
    assert_allclose(turned, np.tile(np.eye(3), (24, 1, 1)), atol=1e-12)  # the DOFs rotate
