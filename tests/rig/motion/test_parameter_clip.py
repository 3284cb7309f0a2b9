"""Motions from model parameters, compared with the published equations of MHR."""

import numpy as np
import pytest
from formats.mhr.mhr_files import N_EXPRESSIONS, N_IDENTITY, NAMES, forward, write
from numpy.testing import assert_allclose

from viewer.errors import RigError
from viewer.formats import Source, read
from viewer.rig.motion.body_motion import ParameterMotion, parameter_clip
from viewer.rig.motion.evaluation import pose_actors
from viewer.rig.motion.timing import Timing
from viewer.rig.scene import Actor
from viewer.rig.skinning import deform


@pytest.fixture(scope="module")
def figure(tmp_path_factory):
    return read(Source.open(write(tmp_path_factory.mktemp("mhr"))))


def test_frames_have_the_vertices_of_the_published_equations_in_metres(figure):
    generator = np.random.default_rng(9)
    parameters = 0.7 * generator.normal(size=(3, len(NAMES)))
    identity = generator.normal(size=(3, N_IDENTITY))
    expression = generator.normal(size=(3, N_EXPRESSIONS))
    places = generator.normal(size=(3, 3))
    timing = Timing(10.0, np.arange(3, dtype=np.int32))
    motion = ParameterMotion("sam", timing, parameters, identity, expression, places)
    clip = parameter_clip(motion, figure)
    actor = Actor(figure, clip=clip)
    for row in range(3):
        pose_actors([actor], 0.1 * row)
        wanted = forward(identity[row], parameters[row], expression[row])[0]
        # The vertices include correctives, so the pose must have exactly the rotations of the
        # joints.
        assert_allclose(deform(figure, actor.pose)[0], 0.01 * wanted + places[row], atol=1e-9)


def test_motion_without_frames_is_refused(figure):
    timing = Timing(10.0, np.zeros(0, dtype=np.int32))
    empty = np.zeros((0, 3))
    with pytest.raises(RigError, match="at least one frame"):
        parameter_clip(ParameterMotion("sam", timing, empty, empty, empty, empty), figure)
