"""Distances of keypoints to fitted bodies, computed by hand, and assignment of the bodies."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rig.hand_made import mesh, skeleton

from viewer.rig.captures.keypoint_layouts import fitted_body, keypoint_distances, keypoint_layout
from viewer.rig.figure import Figure
from viewer.rig.scene import Actor
from viewer.rig.skeleton import ball_skeleton


def pointed(person):
    """Return keypoints of body25 at (1, 2, 3), of which only right elbow and nose are detected."""
    layout = keypoint_layout(25)
    points = np.zeros((25, 4))
    points[:, :3] = 1.0, 2.0, 3.0
    for name in ("right_elbow", "nose"):
        points[layout.names.index(name), 3] = 0.5
    return Actor(Figure("points", points=layout), person=person, points=points)


def body(person):
    bones = ball_skeleton(
        ("pelvis", "right_elbow"), np.array([-1, 0]), np.array([[0.0] * 3, [1, 2, 0]])
    )
    return Actor(Figure("body", mesh(np.eye(3)), bones), person=person)


def test_body_of_the_same_person_is_matched():
    bodies = [body(2), body(3)]
    assert fitted_body(pointed(3), bodies) is bodies[1]
    assert fitted_body(pointed(4), bodies) is None


@pytest.mark.parametrize("person", [None, -1, -2])
def test_untracked_keypoints_match_no_body(person):
    assert fitted_body(pointed(person), [body(person)]) is None


def test_skeleton_without_a_mesh_is_not_a_body():
    assert (
        fitted_body(pointed(1), [Actor(Figure("bones", skeleton=skeleton((-1,))), person=1)])
        is None
    )


def test_distances_cover_only_detected_keypoints():
    seen, fitted = pointed(1), body(1)
    # The elbow is at (1, 2, -1), at distance 4 from the point.
    fitted.placement[:3, 3] = 0.0, 0.0, -1.0
    found = keypoint_distances(seen, fitted)
    assert list(found) == ["right_elbow"]
    assert_allclose(found["right_elbow"], 4.0, atol=1e-12)
    fitted.is_present = False
    assert keypoint_distances(seen, fitted) == {}
