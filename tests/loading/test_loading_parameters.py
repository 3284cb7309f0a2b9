"""Captures of model parameters, shown with MHR, or as points with other bodies."""

import numpy as np
import pytest
from formats.mhr.mhr_files import N_EXPRESSIONS, N_IDENTITY, NAMES, forward, write
from numpy.testing import assert_allclose

from viewer.formats import Source, read
from viewer.loading import bundled_body
from viewer.loading.capturing import Builder
from viewer.rig.captures.capture import Capture, CapturePart
from viewer.rig.captures.points import PointClip, PointLayout
from viewer.rig.motion.body_motion import ParameterMotion
from viewer.rig.motion.evaluation import pose_actors
from viewer.rig.motion.timing import Timing
from viewer.rig.skinning import deform

IDENTITY = np.linspace(-1.0, 1.0, 4 * N_IDENTITY).reshape(4, -1)
PARAMETERS = np.sin(np.arange(4 * len(NAMES))).reshape(4, -1)
EXPRESSION = np.zeros((4, N_EXPRESSIONS))
PLACES = np.arange(12.0).reshape(4, 3)


def parts():
    """Yield two parts of two frames; person 0 has parameters and points, person 1 only points."""
    for start in (0, 2):
        rows = np.full(4, -1, dtype=np.int32)
        rows[start : start + 2] = 0, 1
        timing, chosen = Timing(30.0, rows), slice(start, start + 2)
        layout = PointLayout("spots", ("a", "b"), np.zeros((0, 2)), np.zeros(2))
        clip = PointClip("spots", timing, np.ones((2, 2, 4)))
        motion = ParameterMotion(
            "sam",
            timing,
            PARAMETERS[chosen],
            IDENTITY[chosen],
            EXPRESSION[chosen],
            PLACES[chosen],
        )
        both = {0: (layout, clip), 1: (layout, clip)}
        yield CapturePart(start + 2, points=both, parameters={0: motion})


@pytest.fixture
def build():
    def built(model):
        builder = Builder(Capture("people", 4, 0, parts, up="y"), model)
        while not builder.is_done:
            builder.read_some()
        return builder.actors

    return built


def test_people_with_parameters_are_shown_with_the_model(tmp_path, build):
    model = read(Source.open(write(tmp_path)))
    body, points = build(model)
    assert (body.figure is model, points.figure.points is not None) == (True, True)
    for frame in range(4):
        pose_actors([body], frame / 30.0)
        wanted = 0.01 * forward(IDENTITY[frame], PARAMETERS[frame], EXPRESSION[frame])[0]
        assert_allclose(deform(model, body.pose)[0], wanted + PLACES[frame], atol=1e-9)


def test_other_bodies_show_only_the_points(build):
    actors = build(read(Source.open(bundled_body())))
    assert len(actors) == 2 and all(actor.figure.points is not None for actor in actors)
