"""Detection of the up axis: from bodies, from keypoints, and without evidence."""

import numpy as np
import pytest
from family_models import family_figure

from viewer.rig.captures.keypoint_layouts import keypoint_layout
from viewer.rig.captures.points import PointClip
from viewer.rig.figure import Figure
from viewer.rig.motion.body_motion import BodyMotion, body_clip
from viewer.rig.motion.clip import Clip
from viewer.rig.motion.timing import Timing
from viewer.rig.motion.upright import guess_up
from viewer.rig.scene import Actor


@pytest.fixture(scope="module")
def figure(tmp_path_factory):
    return family_figure("smpl", tmp_path_factory.mktemp("figure"))


def standing(figure, turns, rows=None):
    """Return an actor with a pelvis rotation in every frame; the up axis of the model is y."""
    vectors = np.zeros((len(turns), 1, 3))
    vectors[:, 0] = turns
    timing = Timing(30.0, np.arange(len(turns)) if rows is None else rows)
    motion = BodyMotion("a", timing, ("pelvis",), vectors, np.zeros((len(turns), 3)))
    return Actor(figure, clip=body_clip(motion, figure)[0])


def pointed(direction, count=25, confidence=1.0, title=""):
    layout = keypoint_layout(count, title)
    points = np.zeros((2, count, 4))
    points[..., 3] = confidence
    for name in ("nose", "head", "left_ear", "right_ear"):
        if name in layout.names:
            points[:, layout.names.index(name), :3] = direction
    clip = PointClip("a", Timing(30.0, np.arange(2)), points)
    return Actor(Figure("points", points=layout), clip=clip)


@pytest.mark.parametrize(
    ("turn", "up"),
    [
        ((0, 0, 0), "y"),
        ((np.pi / 2, 0, 0), "z"),
        ((np.pi, 0, 0), "-y"),
        ((-np.pi / 2, 0, 0), "-z"),
        ((0, 2.0, 0), "y"),
        ((0.4, 0, 0.4), "y"),
    ],
)
def test_bodies_determine_the_up_axis(figure, turn, up):
    assert guess_up([standing(figure, [turn, turn])]) == up


def test_majority_of_present_frames_decides(figure):
    upright, fallen = (np.pi / 2, 0, 0), (np.pi, 0, 0)
    assert guess_up([standing(figure, [upright, upright, fallen])]) == "z"
    actor = standing(figure, [fallen, upright], rows=np.array([-1, 1, -1]))
    assert guess_up([actor]) == "z"


@pytest.mark.parametrize(("count", "title"), [(25, ""), (17, "coco"), (17, "h36m"), (33, "")])
@pytest.mark.parametrize(("direction", "up"), [((0, 0.1, -2), "-z"), ((0.3, 1, 0), "y")])
def test_keypoints_determine_the_up_axis(count, title, direction, up):
    assert guess_up([pointed(direction, count, title=title)]) == up


def test_undetected_keypoints_are_ignored():
    assert guess_up([pointed((0, 1, 0), confidence=0.0)]) == "z"


def test_up_axis_defaults_to_z(figure):
    lying = standing(figure, [(0, 0, np.pi / 2)])
    clip = Clip("a", (), 0.0, 1.0)
    assert guess_up([]) == "z"
    assert guess_up([lying]) == "z"
    assert guess_up([pointed((0, 1, 0), 21)]) == "z"
    assert guess_up([Actor(figure, clip=clip)]) == "z"
