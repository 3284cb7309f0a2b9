"""Values in findings, and valid borderline figures."""

import re
from dataclasses import replace

import numpy as np
import pytest
from faults import told
from lint.planted import FAULTS, captured, findings_of, five_joints, moving
from lint.sound import (
    FRAMES,
    RATE,
    column,
    make_mesh,
    scene_of,
)

from viewer.lint import lint_scene
from viewer.rig.figure import Figure
from viewer.rig.mesh import Mesh
from viewer.rig.motion.timing import Timing


def test_messages_have_the_expected_values() -> None:
    messages = {name: findings_of(FAULTS[name][0]) for name in ("sum too large", "jump", "sliding")}
    values = {f.diagnostic.key: f.diagnostic.values for found in messages.values() for f in found}
    assert values["W001.sums"] == {
        "n": 2,
        "sum": pytest.approx(1.1),
        "vertex": 9,
        "error": pytest.approx(0.1),
    }
    # The jump is 3 m in 1/30 s; the legs are 0.2 m wide and 0.9 m high, and may move at 15 times
    # 0.922 m per second.
    speeds = {"speed": "90 m/s", "limit": "13.8 m/s"}
    place = {"joint": "pelvis", "frame": 120, "time": pytest.approx(20 / 30)}
    assert values["C003.joint"] == {"n": 2, "all": 60, **speeds, **place}
    # There are 59 steps of 0.5 / 30 m.
    slid = values["C007.foot"]
    assert (slid["joint"], slid["distance"], slid["speed"]) == ("left_ankle", "983 mm", "0.5 m/s")


def test_mesh_and_gap_findings_have_the_expected_values() -> None:
    """The values are both ends of an edge, the first vertex of a normal, and the missing frames."""
    names = ("three on an edge", "hole", "one normal inwards", "gaps", "pose outside limits")
    found = [f.diagnostic for name in names for f in findings_of(FAULTS[name][0])]
    values = {one.key: one.values for one in found}
    assert values["M006.edges"] == {"n": 1, "most": 3, "vertex": 0, "other": 1}
    assert (values["M005.edges"]["n"], values["M005.edges"]["vertex"]) == (3, 0)
    assert values["M009.normals"] == {"n": 1, "all": 20, "vertex": 3}
    gaps = ["frames 110 to 112", "frame 130"]
    assert values["C005.gaps"] == {"n": 4, "all": 60, "n_gaps": 2, "gaps": gaps}
    # The values are 4 and 3 radians.
    dof = "knee.y is 229.2°; its limits are -171.9° and 171.9°"
    assert values["S004.pose"] == {"n": 1, "dof": dof}


@pytest.mark.parametrize("name", FAULTS)
def test_message_about_one_item_uses_the_singular(name: str) -> None:
    """A count of 1 is not followed by a plural, "are" or "have"."""
    for finding in findings_of(FAULTS[name][0]):
        text = re.sub(r"[\d.]+ of ", "", finding.message)  # the total may be larger, as in 1 of 60
        of_one = re.findall(r"(?<![\d.:])1 ((?!units\b)[a-zA-Z]+s)\b(?! to | at )", text)
        assert set(of_one) <= {"has", "is"}, finding.message
        one = re.match(r"1 (?:of \d+ )?[\w ]*?\b(are|have|lie|move|list|point|belong)\b", text)
        assert one is None, finding.message


def test_gap_has_the_location_of_the_frame_before_it() -> None:
    (gap,) = findings_of(FAULTS["gaps"][0])
    # Frame 109 is the tenth, 9 / 30 s after the first.
    assert gap.seek == pytest.approx(0.3)


def test_long_absences_are_counted_as_absences() -> None:
    """Person 1 is present in frames 100 to 119, except 2 of them."""
    rows = np.arange(FRAMES)
    rows[20:] = rows[5] = rows[6] = -1
    timing = Timing(RATE, rows, first_frame=100, holds=False)
    (gap,) = lint_scene(moving(lambda root, turns: None, timing))
    gaps = ["frames 105 to 106"]
    values = {"n": 2, "all": 20, "n_gaps": 1, "gaps": gaps}
    assert told([gap.diagnostic]) == [("C005.gaps", values)]


def test_thin_sheets_and_creases_have_no_opposed_normals() -> None:
    """Each side of a sheet has separate normals; shared normals agree with one side."""
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    front = np.array([[0, 1, 2], [0, 2, 3]])
    sides = Mesh(
        np.vstack([square, square]),
        np.repeat([[0.0, 0, 1], [0, 0, -1]], 4, axis=0),
        np.vstack([front, front[:, ::-1] + 4]).astype(np.int32),
    )
    shared = Mesh(
        square, np.tile([0.0, 0, 1], (4, 1)), np.vstack([front, front[:, ::-1]]).astype(np.int32)
    )
    for mesh in (sides, shared):
        assert "M009" not in {f.code for f in lint_scene(scene_of(Figure("sheet", mesh)))}
    turned = replace(sides, normals=-sides.normals)
    found = [f for f in lint_scene(scene_of(Figure("sheet", turned))) if f.code == "M009"]
    assert found[0].vertices.tolist() == list(range(8))


def test_influence_limit_error_is_the_vertex_displacement() -> None:
    """Only the root and e move; 0.05 of the translation of e is lost."""
    figure = five_joints()
    scene = scene_of(figure)
    scene.actors[0].pose.translations[1:, 0] = 0.0
    scene.actors[0].pose.translations[4, 0] = 2.0
    locked = replace(figure.skeleton, dof_limits=np.zeros_like(figure.skeleton.dof_limits))
    scene.actors[0].figure = replace(figure, skeleton=locked)
    (found,) = [finding for finding in lint_scene(scene) if finding.code == "W007"]
    # With all influences the displacement is 0.05 of 2 m. The limit drops e, an error of 100 mm in
    # the current pose and 0 at rest.
    cost = (
        "pruning to 4 moves the mesh by up to 100 mm (vertex 8), 100 mm on average over these "
        "vertices, in 6 poses"
    )
    values = {"n": 1, "most": 5, "cost": cost}
    assert told([found.diagnostic]) == [("W007.influences", values)]


def test_swinging_foot_is_not_reported_as_sliding() -> None:
    def step(root: np.ndarray, _: np.ndarray) -> None:
        root[:, 2] = 2.5 * np.arange(FRAMES) / RATE  # 2.5 m/s, as a foot passes the ground

    assert [finding.code for finding in lint_scene(moving(step))] == []


def test_person_who_appears_later_has_no_gap() -> None:
    rows = np.arange(FRAMES)
    rows[:20] = rows[50:] = -1
    timing = Timing(RATE, rows, first_frame=100, holds=False)
    assert lint_scene(moving(lambda root, turns: None, timing)) == []


def test_seams_are_not_borders() -> None:
    """Vertices at one position count as one, so a closed mesh with a seam is closed."""
    figure = column()
    positions = np.vstack([figure.mesh.positions, figure.mesh.positions[0::4]])
    triangles = figure.mesh.triangles.copy()
    side = np.isin(triangles, np.arange(0, 20, 4)) & (np.arange(36) % 8 < 2)[:, None]
    triangles[side] = 20 + triangles[side] // 4
    mesh = make_mesh(positions, triangles)
    codes = {finding.code for finding in lint_scene(scene_of(Figure("seam", mesh)))}
    assert codes == set()


def test_low_confidence_is_counted_over_frames_with_the_keypoint() -> None:
    """Confidence is low in 3 of 10 frames with the keypoint, in 3 of 60 or 5 %, and in 1 of 2."""

    def change(points: np.ndarray) -> None:
        points[10:, 0, 3] = 0.0
        points[4:7, 0, 3] = 0.2
        points[20:23, 1, 3] = 0.1
        points[2:, 2, 3] = 0.0
        points[1, 2, 3] = 0.1

    (low,) = lint_scene(captured(change))
    values = {"limit": 0.3, "percent": pytest.approx(30.0), "n": 10, "frame": 104}
    assert told([low.diagnostic]) == [("C011.point", {"name": "hip", **values})]
    assert low.frames.tolist() == [104, 105, 106] and low.joints.tolist() == [0]
