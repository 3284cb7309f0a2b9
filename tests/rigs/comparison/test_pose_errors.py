"""Errors of estimated motions, in cases with known results."""

import math

import numpy as np
import pytest

import viewer
from viewer.errors import RigError
from viewer.rigs.comparison.pose_errors import pose_errors

FIGURE = viewer.figure(
    [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
    [[0, 1, 2]],
    weights=[[1, 0], [1, 0], [1, 0]],
    joints=[[0, 0, 0], [0, 1, 0]],
    unit="m",
)


def moving(translations=None, turn=0.0, count=5, figure=FIGURE, fps=10.0, **more):
    rotations = np.zeros((count, 2, 3))
    rotations[:, 0, 2] = turn
    return viewer.animate(figure, rotations, translations, fps=fps, **more)


def test_equal_motions_have_no_error():
    errors = pose_errors(moving(turn=0.3), moving(turn=0.3))
    assert errors.n_frames == 5
    assert max(errors.mpjpe, errors.pa_mpjpe, errors.pve, errors.acceleration) < 1e-9


def test_shift_of_the_whole_body_is_no_error_of_the_pose():
    errors = pose_errors(moving(np.full((5, 3), 7.0)), moving())
    assert max(errors.mpjpe, errors.pa_mpjpe, errors.pve, errors.acceleration) < 1e-9


def test_quarter_turn_moves_the_second_joint_by_the_root_of_two():
    errors = pose_errors(moving(turn=np.pi / 2), moving())
    # The root is at 0; the other joint, 1 m away, moves by sqrt(2) m: half of that is the mean.
    assert errors.mpjpe == pytest.approx(1000.0 * math.sqrt(2.0) / 2.0)
    assert errors.pa_mpjpe < 1e-9
    # Of three vertices, one is at the root, the others are 1 m away.
    assert errors.pve == pytest.approx(1000.0 * math.sqrt(2.0) * 2.0 / 3.0)


def test_joints_of_another_order_correspond_by_name():
    places = np.array([[0, 0, 0], [0, 1, 0], [0, -1, 0]], float)
    figures = [
        viewer.figure(
            [[0, 0, 0]],
            np.zeros((0, 3), int),
            joints=places[order],
            parents=[-1, 0, 0],
            names=[("hip", "up", "down")[joint] for joint in order],
            unit="m",
        )
        for order in ([0, 1, 2], [0, 2, 1])
    ]
    first, second = (viewer.animate(each, np.zeros((3, 3, 3)), fps=10.0) for each in figures)
    assert pose_errors(second, first).mpjpe < 1e-9


def test_acceleration_is_that_of_a_thrown_body():
    times = np.arange(5) / 10.0
    fallen = np.stack([0.0 * times, -0.5 * 9.81 * times**2, 0.0 * times], axis=1)
    assert pose_errors(moving(fallen), moving()).acceleration == pytest.approx(9810.0)


def test_similarity_removes_scale_but_no_reflection():
    joints = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    figures = [
        viewer.figure(
            [[0, 0, 0]], np.zeros((0, 3), int), joints=place, parents=[-1, 0, 0, 0], unit="m"
        )
        for place in (joints, 3.0 * joints + 2.0, joints * [1, 1, -1])
    ]
    still = np.zeros((1, 4, 3))
    wanted, larger, mirrored = (viewer.animate(figure, still) for figure in figures)
    assert pose_errors(larger, wanted).pa_mpjpe < 1e-9
    # Sizes of (x - 1/4) etc. are the same; no rotation maps the mirror image onto the joints.
    assert pose_errors(mirrored, wanted).pa_mpjpe > 100.0


def test_units_are_converted():
    centimetres = viewer.figure(
        np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]]) / 0.01,
        [[0, 1, 2]],
        joints=np.array([[0, 0, 0], [0, 1, 0]]) / 0.01,
        unit="cm",
    )
    assert pose_errors(moving(figure=centimetres), moving()).mpjpe < 1e-9


def test_only_frames_of_both_count():
    seen = [True, True, False, True, True]
    errors = pose_errors(moving(present=seen), moving())
    assert errors.n_frames == 4 and math.isnan(errors.acceleration)


@pytest.mark.parametrize(
    ("found", "message"),
    [
        (lambda: moving(count=4), "expected 5 frames as in motion, found 4"),
        (lambda: moving(fps=20.0), "expected 10 frames per second, found 20"),
        (lambda: moving(present=[False] * 5), "no frame has both"),
        (
            lambda: moving(figure=viewer.figure([[0, 0, 0]], [[0, 0, 0]], joints=[[0] * 3] * 2)),
            "expected a figure with a known length unit, found none",
        ),
    ],
)
def test_motions_that_cannot_be_compared_are_refused(found, message):
    with pytest.raises(RigError, match=message):
        pose_errors(found(), moving())
