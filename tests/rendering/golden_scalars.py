"""Golden images of scalar quantities, one of each on a figure that shows it. They have no legends,
because text looks different with every version of Pillow; see test_legend_picture.py.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
from rendering.drawn_figures import arm, bent
from rendering.golden_scenes import BEND, Shot, options, posed_fox

import viewer
from viewer.resources import resource
from viewer.rigs.annotations import BodyParts, VertexField
from viewer.rigs.figure import Figure
from viewer.rigs.scalars import SCALARS
from viewer.rigs.scene import Actor, Scene


@cache
def _body() -> Figure:
    return viewer.load(resource("assets", "samples", "body.npz")).actors[0].figure


def _posed_body() -> Scene:
    """Return the body on one leg, with a bent elbow and a twisted trunk."""
    actor = Actor(_body())
    skeleton, pose = actor.figure.skeleton, actor.pose
    assert skeleton is not None and pose is not None
    for joint, axis, angle in (
        ("left_knee", 0, 1.9),
        ("left_hip", 0, -1.2),
        ("right_elbow", 1, 1.4),
        ("left_shoulder", 2, -1.0),
        ("spine2", 1, 0.4),
    ):
        pose.dofs[3 * skeleton.names.index(joint) + axis] = angle
    return Scene([actor])


def _uneven_arm() -> Scene:
    """Return an arm with three parts and weight sums that decrease from 1 along the arm."""
    figure = arm(4)
    mesh, skin = figure.mesh, figure.skin
    assert mesh is not None and skin is not None
    along = mesh.positions[:, 0] / 4.0
    factors = np.repeat(1.0 - 0.2 * along, np.diff(skin.starts))
    parts = BodyParts(("upper", "middle", "lower"), np.minimum(3.0 * along, 2.0).astype(np.int32))
    uneven = replace(skin, weights=skin.weights * factors)
    fields = (
        VertexField("along", "Along the arm", along),
        VertexField("half", "Half", np.minimum(2.0 * along, 1.0) // 1, names=("upper", "lower")),
    )
    odd = replace(figure, skin=uneven, body_parts=parts, fields=fields)
    return Scene([bent(odd, *BEND)])


_SCENES: dict[str, tuple[Callable[[], Scene], str, tuple[float, float]]] = {
    "weight": (_posed_body, "weight:left_knee", (20.0, 12.0)),
    "dominant": (lambda: posed_fox(2), "dominant", (60.0, 15.0)),
    "influences": (_posed_body, "influences", (20.0, 12.0)),
    "sums": (_uneven_arm, "sums", (35.0, 15.0)),
    "entropy": (lambda: posed_fox(2), "entropy", (60.0, 15.0)),
    "stretch": (_posed_body, "stretch", (20.0, 12.0)),
    "stretch-mean": (lambda: posed_fox(2), "stretch-mean", (60.0, 15.0)),
    "area": (_posed_body, "area", (20.0, 12.0)),
    "methods": (_posed_body, "methods", (20.0, 12.0)),
    "pruning": (lambda: posed_fox(2), "pruning", (60.0, 15.0)),
    "normalized": (_uneven_arm, "normalized", (35.0, 15.0)),
    "correctives": (_posed_body, "correctives", (20.0, 12.0)),
    "asymmetry": (_posed_body, "asymmetry", (20.0, 12.0)),
    "parts": (_uneven_arm, "parts", (35.0, 15.0)),
    "field": (_uneven_arm, "field:along", (35.0, 15.0)),
    "class": (_uneven_arm, "class:half", (35.0, 15.0)),
}
assert set(_SCENES) == set(SCALARS), "every scalar quantity has a picture"


def _shot(name: str) -> Shot:
    scene, scalar, view = _SCENES[name]
    return Shot(scene(), options(shading="scalar", scalar=scalar), view)


SHOTS: dict[str, Callable[[], Shot]] = {
    f"scalar-{name}": lambda name=name: _shot(name) for name in _SCENES
}
