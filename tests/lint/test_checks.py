"""The check registry, lint codes, progress, and scene locations of findings."""

from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from lint.planted import FAULTS, made, weighted
from lint.sound import column, keypoints, scene_of, standing

import viewer.lint
from viewer.diagnostics import Diagnostic
from viewer.lint import CHECKS, CODES, SEVERITIES, Finding, lint_scene, points_of
from viewer.progress import Cancelled, receiving
from viewer.rig.scene import Actor, Scene


def test_registry_matches_its_folder() -> None:
    folder = Path(viewer.lint.__file__).parent
    assert {p.stem for p in folder.glob("*.py") if not p.name.startswith("_")} == set(CHECKS)
    for name in CHECKS:
        assert callable(import_module(f"viewer.lint.{name}").check)


def test_codes_have_a_severity_a_title_and_a_hint() -> None:
    for name, code in CODES.items():
        assert name[0] in "FGWBSMYC" and name[1:].isdecimal() and len(name) == 4
        assert code.severity in SEVERITIES and code.title and code.hint


def test_titles_are_unique() -> None:
    assert len({code.title for code in CODES.values()}) == len(CODES)


def test_progress_counts_every_check() -> None:
    steps: list[tuple[int, int, str]] = []
    with receiving(lambda done, total, unit, what: steps.append((done, total, what))):
        lint_scene(scene_of(column()))
    assert [step[:2] for step in steps] == [(k, len(CHECKS)) for k in range(len(CHECKS))]
    assert steps[0][2] == "column: weights"


def test_progress_may_cancel() -> None:
    def stop(done: int, total: int, unit: str, what: str) -> None:
        if done == 2:
            raise Cancelled

    with pytest.raises(Cancelled), receiving(stop):
        lint_scene(scene_of(column()))


def test_figure_shared_by_actors_is_checked_once() -> None:
    figure = weighted({5: [(0, 0.9)]})
    scene = Scene([Actor(figure), Actor(figure), Actor(column())])
    scene.actors[1].pose.dofs[7] = 4.0
    assert [(f.code, f.actor) for f in lint_scene(scene)] == [("W001", 0), ("S004", 1)]


def test_checks_do_not_change_the_scene() -> None:
    figure = column()
    scene = scene_of(figure, standing(figure))
    pose = scene.actors[0].pose.copy()
    lint_scene(scene)
    assert np.array_equal(scene.actors[0].pose.dofs, pose.dofs)
    assert np.array_equal(scene.actors[0].pose.translations, pose.translations)


def test_locations_of_vertices_triangles_and_joints_are_their_points() -> None:
    scene = scene_of(column())
    scene.actors[0].placement[:3, 3] = 10.0, 0.0, 0.0
    vertex = Finding(Diagnostic("W001.some: text"), actor=0, vertices=np.array([5]))
    assert points_of(vertex, scene).tolist() == [[9, 1, 1]]
    triangle = Finding(Diagnostic("M001.some: text"), actor=0, triangles=np.array([0]))
    assert points_of(triangle, scene).tolist() == [[11, 0, 1], [11, 1, 1], [9, 0, 1]]
    joint = Finding(Diagnostic("S006.some: text"), actor=0, joints=np.array([1]))
    assert points_of(joint, scene).tolist() == [[10, 2, 0]]


def test_locations_in_captures_are_points_and_may_be_empty() -> None:
    figure, clip = keypoints()
    scene = scene_of(figure, clip)
    scene.actors[0].points = clip.points[0]
    ankle = Finding(Diagnostic("C011.some: text"), actor=0, joints=np.array([2]))
    assert points_of(ankle, scene).tolist() == [[0, 0, 0]]
    assert points_of(Finding(Diagnostic("F001.some: text")), scene).shape == (0, 3)
    assert len(points_of(Finding(Diagnostic("C010.some: text"), actor=0), scene)) == 3


@pytest.mark.parametrize("name", FAULTS)
def test_every_finding_can_be_framed(name: str) -> None:
    scene = made(FAULTS[name][0])
    for finding in lint_scene(scene):
        points = points_of(finding, scene)
        if "singular" not in name and "not affine" not in name:
            assert np.isfinite(points).all()


def test_placement_scale_is_applied() -> None:
    """The speed of a figure in centimetres that is placed in metres is that of the drawn figure."""
    scene = made(FAULTS["jump"][0])
    before = [f.message for f in lint_scene(scene)]
    actor = scene.actors[0]
    scene.actors[0] = replace(actor, placement=np.diag([0.01, 0.01, 0.01, 1.0]))
    assert [f.message for f in lint_scene(scene)] == before
