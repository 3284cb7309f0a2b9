"""Poses from model parameters, as SAM 3D Body stores them."""

import numpy as np
import pytest
from formats.mhr.mhr_files import N_EXPRESSIONS, N_IDENTITY, NAMES, forward, write
from numpy.testing import assert_allclose
from rig.hand_made import skeleton

from viewer.errors import RigError
from viewer.formats import Source, read
from viewer.rig.figure import Figure
from viewer.rig.motion.body_motion import parameter_pose
from viewer.rig.skinning import deform


@pytest.fixture(scope="module")
def figure(tmp_path_factory):
    return read(Source.open(write(tmp_path_factory.mktemp("mhr"))))


def test_pose_has_the_vertices_of_the_published_equations(figure):
    generator = np.random.default_rng(11)
    identity, expression = generator.normal(size=N_IDENTITY), generator.normal(size=N_EXPRESSIONS)
    parameters = generator.normal(size=len(NAMES))
    pose = parameter_pose(figure, parameters, identity, expression)
    wanted = forward(identity, parameters, expression)[0]
    assert_allclose(deform(figure, pose)[0], wanted, atol=1e-10)


def test_wrong_counts_and_figures_without_parameters_are_refused(figure):
    parameters = np.zeros(len(NAMES))
    with pytest.raises(RigError, match="46"):
        parameter_pose(figure, parameters, np.ones(46), np.zeros(1))
    with pytest.raises(RigError, match="8"):
        parameter_pose(figure, parameters[1:], np.zeros(45), np.zeros(1))
    with pytest.raises(RigError, match="no model parameters"):
        parameter_pose(Figure("arm", skeleton=skeleton([-1], [])), parameters, [], [])
