"""Scenes of captures for tests: the tiny figure as several people, and captured points."""

import numpy as np

import viewer
from viewer.rigs.captures.points import PointClip, PointLayout
from viewer.rigs.figure import Figure
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor, Scene

NAMES = ("nose", "left_eye", "right_eye", "neck")


def timing(present, rate=10.0, first=0):
    """Return the timing of a person who is present in the frames marked true."""
    present = np.asarray(present, dtype=bool)
    rows = np.where(present, np.cumsum(present) - 1, -1)
    return Timing(rate, rows, first_frame=first, holds=False)


def walk(present, n_joints, name="take", rate=10.0, first=0):
    """A motion that places the figure in frame f at x = f, rotated about y by f / 10."""
    when = timing(present, rate, first)
    rows = np.arange(int(when.present.sum()), dtype=float)
    rotations = np.zeros((len(rows), n_joints, 4))
    rotations[..., 3] = 1.0
    rotations[:, 0, 1] = np.sin(0.05 * rows)
    rotations[:, 0, 3] = np.cos(0.05 * rows)
    place = np.zeros((len(rows), 3))
    place[:, 0] = rows
    return SampledClip(name, when, rotations, figure_translations=place)


def people(rig, *presences, rate=10.0):
    """A capture of several people, each the tiny figure, present in the given frames."""
    figure = viewer.load(*rig).actors[0].figure
    count = figure.skeleton.n_joints
    return Scene(
        [
            Actor(figure, clip=walk(present, count, rate=rate), person=person)
            for person, present in enumerate(presences)
        ]
    )


def dots(confidences, n_frames=3, rate=10.0):
    """An actor of four captured points; frame 1 has these confidences, all others are 1."""
    layout = PointLayout(
        "face4", NAMES, np.array([[0, 1], [0, 2], [0, 3]]), np.array([0, 1, -1, 0])
    )
    points = np.ones((n_frames, 4, 4))
    points[..., :3] = [[0, 2, 0], [0.1, 2.1, 0], [-0.1, 2.1, 0], [0, 1.5, 0]]
    points[1, :, 3] = confidences
    clip = PointClip("take", timing([True] * n_frames, rate), points)
    return Actor(Figure("face4", points=layout), clip=clip, person=0)
