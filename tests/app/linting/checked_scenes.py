"""Scenes with findings, and queries of the Lint panel."""

from dataclasses import replace

import numpy as np
from lint.planted import weighted
from lint.sound import FRAMES, column, scene_of, standing

from viewer.app.linting.lint_panel import Linting
from viewer.rendering.overlay.annotation import MARK_COLOR
from viewer.rig.scene import Scene

PINK = np.array([round(255 * channel) for channel in MARK_COLOR])
SIZE = (1000, 700)


# Vertex 5 at (-1, 1, 1) is bound to the foot at the origin; joint 1 is the knee at y = 2. A weight
# of 0.9 moves the vertex to (-0.9, 0.9, 0.9).
LIGHT = weighted({5: [(0, 0.9)]})


def finish(hand):
    """Run frames until the check has ended and is shown."""
    running = hand.state.of(Linting).running
    if running is not None:
        running.job.wait()
    hand.step(3)


def codes(hand):
    return [finding.code for finding in hand.state.of(Linting).checked.findings]


def row_of(hand, code):
    return f"finding {codes(hand).index(code)}"


def marked(hand):
    """Return the number of pixels in the view that have the colour of marks."""
    pixels = hand.scene_picture()[..., :3].astype(int)
    return int((np.abs(pixels - PINK).max(axis=-1) <= 6).sum())


def jump() -> Scene:
    """Return a column that is 40 m away in a single frame, frame 130 of the file."""
    figure = column()
    clip = standing(figure)
    places = np.zeros((FRAMES, figure.skeleton.n_joints, 3))
    places[30, 0, 0] = 40.0
    return scene_of(figure, replace(clip, translations=places))
