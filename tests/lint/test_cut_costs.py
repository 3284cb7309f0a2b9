"""Influence limit error if some joints or vertices are unusable."""

from dataclasses import replace

import numpy as np
import pytest
from faults import told
from lint.sound import column, make_skeleton, scene_of

from viewer.lint import Finding, lint_scene
from viewer.rig.arrays import Ints
from viewer.rig.figure import Figure
from viewer.rig.scene import Scene
from viewer.rig.skin import skin_from_lists

CROWDED = [(0, 0.3), (1, 0.3), (2, 0.2), (3, 0.15), (4, 0.05)]
LAST = [(0, 0.3), (1, 0.3), (2, 0.2), (3, 0.15), (5, 0.05)]


def scene(rows: dict[int, list[tuple[int, float]]], singular: bool = True) -> Scene:
    """Return the column on a chain of six joints; joint 4 is 2 m aside, the last is singular."""
    figure = column()
    offsets = [[0, 0, 0]] + [[0, 1, 0]] * 5
    skeleton = make_skeleton(tuple("abcdef"), [-1, 0, 1, 2, 3, 4], offsets, (0.0, 0.0))
    matrices = np.tile(np.eye(4), (6, 1, 1))
    matrices[:, 1, 3] = -np.arange(6.0)
    if singular:
        matrices[5, 1, 1] = 0.0
    influences = [rows.get(v, [(v // 4, 1.0)]) for v in range(20)]
    skin = skin_from_lists(influences, matrices)
    result = scene_of(Figure("column", figure.mesh, skeleton, skin, unit="m"))
    result.actors[0].pose.translations[4, 0] = 2.0
    return result


def cost(scene: Scene, **invalid: Ints) -> Finding:
    (found,) = [f for f in lint_scene(scene, invalid=[invalid]) if f.code == "W007"]
    return found


# Joint 4 is 2 m from its rest position, so a weight of 0.05 is 100 mm; no other joint moves.
COST = (
    "pruning to 4 moves the mesh by up to 100 mm (vertex 8), 100 mm on average over these "
    "vertices, in 6 poses"
)


def without(n: int) -> str:
    """Return the part of a message with the number of vertices of unknown error."""
    verb = "vertex is" if n == 1 else "vertices are"
    return f"{n} {verb} omitted because a required position or bind matrix is invalid"


def values_of(n: int, cost: str) -> tuple[str, dict[str, object]]:
    return "W007.influences", {"n": n, "most": 5, "cost": cost}


def test_vertices_of_a_singular_joint_are_left_out_and_counted() -> None:
    found = cost(scene({8: CROWDED, 5: LAST}))
    known = f"{COST}; {without(1)}"
    assert told([found.diagnostic]) == [values_of(2, known)]
    assert found.vertices.tolist() == [8, 5]  # unknown values are last
    found = cost(scene({8: CROWDED, 5: LAST, 6: LAST}))
    known = f"{COST}; {without(2)}"
    assert told([found.diagnostic]) == [values_of(3, known)]


def test_joint_of_weight_0_leaves_out_no_vertex() -> None:
    found = cost(scene({8: [*CROWDED, (5, 0.0)]}))
    assert told([found.diagnostic]) == [values_of(1, COST)]


def test_unknown_error_is_not_reported_as_0() -> None:
    unknown = f"the effect of pruning to 4 is unknown: {without(1)}"
    assert told([cost(scene({5: LAST})).diagnostic]) == [values_of(1, unknown)]


@pytest.mark.parametrize(("part", "places"), [("bindings", [5]), ("positions", [5])])
def test_vertices_not_from_the_file_are_left_out(part: str, places: list[int]) -> None:
    lost = np.array(places, dtype=np.int32)
    found = cost(scene({8: CROWDED, 5: LAST}, singular=False), **{part: lost})
    known = f"{COST}; {without(1)}"
    assert told([found.diagnostic]) == [values_of(2, known)]


def test_overflowing_errors_are_left_out() -> None:
    whole = scene({8: CROWDED, 5: LAST}, singular=False)
    figure = whole.actors[0].figure
    matrices = figure.skin.inverse_bind.copy()
    matrices[5, :3, :3] *= 1e308  # squares of the displacements are infinite
    whole.actors[0].figure = replace(figure, skin=replace(figure.skin, inverse_bind=matrices))
    known = f"{COST}; {without(1)}"
    assert told([cost(whole).diagnostic]) == [values_of(2, known)]
