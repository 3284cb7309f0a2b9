"""Findings: how they are counted, gathered, placed and shown."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from faults import told
from formats import bvh_text, skel_text, skin_text, synthetic_smpl
from linting.planted import FAULTS, captured, findings_of, five_joints, moving
from linting.sound import (
    FRAMES,
    RATE,
    column,
    keypoints,
    legs,
    make_mesh,
    scene_of,
    standing,
)
from rigs.animated import channel, clip_of, leg

from viewer.app.core.clock import Clock
from viewer.diagnostics import Diagnostic
from viewer.formats import write
from viewer.linting import (
    MAX_ROTATION,
    Finding,
    LintOptions,
    Subject,
    finding_text,
    lint_files,
    lint_scene,
    places_of,
    points_of,
)
from viewer.rigs.captures.points import PointLayout
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix
from viewer.rigs.mesh import Mesh
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor, Scene


def cube(*strays: list[float]) -> Figure:
    """Return 5 x 5 x 5 points from 0 to 4 with a diagonal of 4 sqrt(3), and stray points."""
    axis = np.arange(5.0)
    points = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    return Figure("cube", make_mesh(np.array([*points, *strays]), [[0, 1, 5]]))


def test_size_is_the_diagonal_of_the_mesh_or_of_the_joints():
    assert Subject(Actor(column())).size() == pytest.approx(np.sqrt(4 + 16 + 4))
    # The hips are 0.2 apart, the ankles 0.9 below the pelvis, all at one depth.
    assert Subject(Actor(legs())).size() == pytest.approx(np.hypot(0.2, 0.9))
    marks = Figure("marks", points=PointLayout("dots", ("a",), np.zeros((0, 2)), np.zeros(1)))
    assert Subject(Actor(marks)).size() == 0.0


def test_stray_vertices_do_not_affect_the_size():
    assert Subject(Actor(cube([500.0, 500.0, 500.0]))).size() == pytest.approx(4 * np.sqrt(3))
    # A vertex at a small distance is included, because it may be intended.
    assert Subject(Actor(cube([20.0, 0.0, 0.0]))).size() == pytest.approx(np.sqrt(400 + 16 + 16))


def test_relative_lengths_ignore_stray_vertices():
    subject = Subject(Actor(cube([500.0, 500.0, 500.0])))
    assert subject.length(0.4 * np.sqrt(3)) == "0.693 units (10 % of the figure's size)"


def test_largest_rotation_is_reported_in_degrees():
    assert MAX_ROTATION == 3400.0
    assert np.degrees(LintOptions().max_rotation) == pytest.approx(MAX_ROTATION)


def saved(folder: Path, figure: Figure) -> list[str]:
    """Write the valid column as ``.skel`` and ``.skin`` and return the lines of the ``.skin``."""
    write(figure, folder / "a.skel")
    write(figure, folder / "a.skin")
    return (folder / "a.skin").read_text().splitlines()


def section(lines: list[str], name: str) -> int:
    """Return the index of the line after the header of a section."""
    return next(k for k, line in enumerate(lines) if line.startswith(f"{name} ")) + 1


def linted(folder: Path, lines: list[str]) -> list[Finding]:
    (folder / "a.skin").write_text("\n".join(lines) + "\n")
    return lint_files([folder / "a.skel", folder / "a.skin"])[1]


def heavy(findings: list[Finding]) -> list[tuple[str, int | None]]:
    """Return code and line of errors and warnings."""
    return [(f.code, f.line) for f in findings if f.severity != "note"]


def test_valid_column_has_no_findings(tmp_path):
    assert heavy(linted(tmp_path, saved(tmp_path, column()))) == []


def test_ten_errors_in_one_skin_are_ten_findings(tmp_path):
    lines = saved(tmp_path, column())
    positions, weights = section(lines, "positions"), section(lines, "skinweights")
    triangles, bindings = section(lines, "triangles"), section(lines, "bindings")
    lines[positions + 2] = "nan 0 -1"
    lines[positions + 18] = "1 4 nan"
    lines[weights + 1] = "1 0 0.5"
    lines[weights + 4] = "2 0 -0.25 1 1.25"
    lines[weights + 5] = "0"
    lines[weights + 6] = "1 0 nan"
    lines[weights + 7] = "1 9 1.0"
    lines[triangles + 5] = "1 2 77"
    lines[triangles + 8] = " ".join(reversed(lines[triangles + 8].split()))
    lines[triangles + 9] = "0 1 1.5"
    assert lines[bindings].strip() == "matrix {"
    lines[bindings + 2] = "0 0 0"
    assert heavy(linted(tmp_path, lines)) == [
        ("F003", positions + 3),
        ("W003", weights + 7),
        ("F002", triangles + 10),
        ("F002", triangles + 6),
        ("B002", bindings + 1),
        ("W010", weights + 8),
        ("W001", weights + 2),
        ("W002", weights + 5),
        ("W004", weights + 6),
        ("M002", triangles + 9),
    ]


def test_findings_of_one_code_have_a_count_and_locations(tmp_path):
    lines = saved(tmp_path, column())
    positions = section(lines, "positions")
    for vertex in (3, 8, 9):
        lines[positions + vertex] = "inf 1 nan"
    found = next(f for f in linted(tmp_path, lines) if f.code == "F003")
    item = "positions of vertex 3"
    assert told([found.diagnostic]) == [("F003.number", {"item": item, "found": b"inf"})]
    assert found.diagnostic.count == 6
    assert found.vertices.tolist() == [3, 8, 9] and found.line == positions + 4


@pytest.mark.parametrize("vertex", range(20))
def test_invalid_position_causes_no_other_finding(tmp_path, vertex):
    lines = saved(tmp_path, column())
    lines[section(lines, "positions") + vertex] = "nan nan nan"
    assert [f.code for f in linted(tmp_path, lines) if f.severity != "note"] == ["F003"]
    assert "M005" not in {f.code for f in linted(tmp_path, lines)}


@pytest.mark.parametrize("triangle", [0, 7, 33, 35])
def test_invalid_triangle_causes_no_border_finding(tmp_path, triangle):
    lines = saved(tmp_path, column())
    place = section(lines, "triangles") + triangle
    lines[place] = " ".join([*lines[place].split()[:2], "1000"])
    assert [f.code for f in linted(tmp_path, lines)] == ["F002"]


def test_invalid_weight_causes_no_other_finding(tmp_path):
    lines = saved(tmp_path, column())
    lines[section(lines, "skinweights") + 9] = "2 0 nan 1 0.5"
    assert [f.code for f in linted(tmp_path, lines)] == ["W003"]


def test_singular_matrix_does_not_hide_other_findings(tmp_path):
    lines = saved(tmp_path, column())
    bindings = section(lines, "bindings")
    lines[bindings + 1 : bindings + 4] = ["0 0 0"] * 3
    lines[bindings + 7] = "-1 0 0"  # the second matrix mirrors
    assert heavy(linted(tmp_path, lines)) == [("B002", bindings + 1), ("B005", bindings + 7)]


def test_skin_without_bind_matrices_is_checked_without_its_skeleton(tmp_path):
    lines = saved(tmp_path, column())
    weights = section(lines, "skinweights")
    lines[weights] = "1 0 0.5"
    del lines[section(lines, "bindings") - 1 :]
    assert heavy(linted(tmp_path, lines)) == [("B001", weights), ("W001", weights + 1)]


def test_unparsable_file_is_reported_as_unchecked(tmp_path):
    lines = saved(tmp_path, column())
    lines[section(lines, "positions") + 3] = "normals 4 {"
    (found,) = [f for f in linted(tmp_path, lines) if f.severity == "error"]
    assert (found.code, found.line) == ("F002", 5)
    values = {"section": "positions", "line": 1, "found": b"normals"}
    assert told([found.diagnostic]) == [("F002.unclosed", values)] and found.diagnostic.is_final


def test_invalid_joint_offset_is_not_a_bind_pose_mismatch(tmp_path):
    texts = {"a.skel": skel_text.GOOD.replace("offset 0 1 0", "offset 0 nan 0"),
             "a.skin": skin_text.GOOD}  # fmt: skip
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    found = lint_files([tmp_path / name for name in texts])[1]
    assert [(f.code, f.line, f.joints.tolist()) for f in found if f.severity == "error"] == [
        ("F003", 10, [1])
    ]
    # The root is bound at a different position, 5 6 7.
    (bound,) = [f for f in found if f.code == "B004"]
    assert bound.joints.tolist() == [0] and bound.line == 20


def test_all_errors_in_a_rig_file_are_found(tmp_path):
    """The files of a .rig are checked one by one, so that errors in one do not hide others."""
    (tmp_path / "a.rig").write_text("rig a { skeleton a.skel skin a.skin }")
    (tmp_path / "a.skel").write_text(skel_text.GOOD.replace("{", "[", 1))
    (tmp_path / "a.skin").write_text(skin_text.GOOD.replace("2 0 0.25", "2 0 0.5", 1))
    found = lint_files([tmp_path / "a.rig"])[1]
    files = [(f.code, f.file.name if f.file else "", f.line) for f in found]
    assert ("F002", "a.skel", 2) in files and ("W001", "a.skin", 13) in files


def test_body_errors_are_found_including_lazily_read_ones(tmp_path):
    arrays = {key: np.array(values) for key, values in synthetic_smpl.model("smpl").items()}
    arrays["v_template"][3] = np.nan
    arrays["weights"][4, 0] = np.nan
    arrays["weights"][5] *= 0.5
    arrays["shapedirs"][0, 0, 0] = np.inf
    arrays["posedirs"][0, 0, 0] = np.nan
    np.savez(tmp_path / "m.npz", **arrays)
    found = lint_files([tmp_path / "m.npz"])[1]
    assert [(f.code, f.severity) for f in found if f.severity != "note"] == [
        ("F003", "error"), ("W003", "error"), ("F003", "error"), ("F003", "error"),
        ("W001", "warning"),
    ]  # fmt: skip
    assert found[0].vertices.tolist() == [3] and found[1].vertices.tolist() == [4]
    assert [f.diagnostic.values["item"] for f in found[2:4]] == ["shapedirs", "posedirs"]


def test_invalid_frames_are_not_jumps(tmp_path):
    head = bvh_text.GOOD[: bvh_text.GOOD.index("MOTION")]
    rows = [f"{k} 100 0" + " 0" * 12 for k in range(30)]
    rows[10] = rows[10].replace("100", "nan")
    rows[20] = "90000" + rows[20][2:]
    text = "\n".join([f"{head}MOTION", "Frames: 30", "Frame Time: 0.1", *rows])
    (tmp_path / "a.bvh").write_text(text + "\n")
    found = lint_files([tmp_path / "a.bvh"])[1]
    first = text[: text.index(rows[0])].count("\n") + 1
    gap, jump = (next(f for f in found if f.code == code) for code in ("C005", "C003"))
    assert gap.frames.tolist() == [10]
    assert jump.line in (first + 20, first + 21) and sorted(jump.frames.tolist()) == [20, 21]


def test_lengths_without_a_unit_are_in_figure_units(tmp_path):
    lines = saved(tmp_path, column())
    skel = (tmp_path / "a.skel").read_text()
    assert "offset 0.0 2.0 0.0" in skel
    (tmp_path / "a.skel").write_text(skel.replace("offset 0.0 2.0 0.0", "offset 0.0 3.0 0.0"))
    (bound,) = [f for f in linted(tmp_path, lines) if f.code == "B004"]
    # One unit of a column of 2 x 4 x 2 with a diagonal of sqrt(24).
    values = {"n": 1, "joint": "knee", "distance": "1 units (20.4 % of the figure's size)"}
    assert told([bound.diagnostic]) == [("B004.joints", values)]
    assert bound.line == section(lines, "bindings") + 7


def test_messages_have_the_expected_values():
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


def test_mesh_and_gap_findings_have_the_expected_values():
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
def test_message_about_one_item_uses_the_singular(name):
    """A count of 1 is not followed by a plural, "are" or "have"."""
    for finding in findings_of(FAULTS[name][0]):
        text = re.sub(r"[\d.]+ of ", "", finding.message)  # the total may be larger, as in 1 of 60
        of_one = re.findall(r"(?<![\d.:])1 ((?!units\b)[a-zA-Z]+s)\b(?! to | at )", text)
        assert set(of_one) <= {"has", "is"}, finding.message
        one = re.match(r"1 (?:of \d+ )?[\w ]*?\b(are|have|lie|move|list|point|belong)\b", text)
        assert one is None, finding.message


def test_gap_has_the_location_of_the_frame_before_it():
    (gap,) = findings_of(FAULTS["gaps"][0])
    # Frame 109 is the tenth, 9 / 30 s after the first.
    assert gap.seek == pytest.approx(0.3)


def test_long_absences_are_counted_as_absences():
    """Person 1 is present in frames 100 to 119, except 2 of them."""
    rows = np.arange(FRAMES)
    rows[20:] = rows[5] = rows[6] = -1
    timing = Timing(RATE, rows, first_frame=100, holds=False)
    (gap,) = lint_scene(moving(lambda root, turns: None, timing))
    gaps = ["frames 105 to 106"]
    values = {"n": 2, "all": 20, "n_gaps": 1, "gaps": gaps}
    assert told([gap.diagnostic]) == [("C005.gaps", values)]


def test_thin_sheets_and_creases_have_no_opposed_normals():
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


def test_influence_limit_error_is_the_vertex_displacement():
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


def test_limits_of_two_turns_that_are_rounded_up_are_in_radians():
    skeleton = column().skeleton
    limits = np.full_like(skeleton.dof_limits, [-12.57, 12.57])
    figure = replace(column(), skeleton=replace(skeleton, dof_limits=limits))
    assert [finding.code for finding in lint_scene(scene_of(figure))] == []


def test_person_who_appears_later_has_no_gap():
    rows = np.arange(FRAMES)
    rows[:20] = rows[50:] = -1
    timing = Timing(RATE, rows, first_frame=100, holds=False)
    assert lint_scene(moving(lambda root, turns: None, timing)) == []


def test_seams_are_not_borders():
    """Vertices at one position count as one, so a closed mesh with a seam is closed."""
    figure = column()
    positions = np.vstack([figure.mesh.positions, figure.mesh.positions[0::4]])
    triangles = figure.mesh.triangles.copy()
    side = np.isin(triangles, np.arange(0, 20, 4)) & (np.arange(36) % 8 < 2)[:, None]
    triangles[side] = 20 + triangles[side] // 4
    mesh = make_mesh(positions, triangles)
    codes = {finding.code for finding in lint_scene(scene_of(Figure("seam", mesh)))}
    assert codes == set()


def test_low_confidence_is_counted_over_frames_with_the_keypoint():
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


def jumping(start: float, at: float, length: float = 4.0, offset: float = 0.0) -> Actor:
    """Return the column with a clip that jumps by 90 m in a hundredth of a second."""
    figure = column()
    channels = [
        Channel(target, [start], [0.0], (("linear", "linear"),))
        for target in range(figure.skeleton.n_dofs)
    ]
    times = [start, start + at, start + at + 0.01, start + length]
    channels[0] = Channel(0, times, [0.0, 0.0, 90.0, 90.0], (("linear", "linear"),) * 4)
    return Actor(figure, clip=Clip("keys", tuple(channels), start, start + length), offset=offset)


def jump_of(scene: Scene, options: LintOptions | None = None) -> Finding:
    (found,) = [f for f in lint_scene(scene, options) if f.code == "C003"]
    return found


def shown_frame(scene: Scene, time: float) -> int:
    """Return the frame shown by the timeline of the window at a time."""
    playback = Clock()
    playback.show(scene)
    playback.seek(time)
    return playback.frame + playback.first_frame


@pytest.mark.parametrize(("start", "offset"), [(0.0, 0.0), (2.5, 0.0), (1.0, 3.2)])
def test_jump_is_reported_at_the_timeline_frame(start, offset):
    scene = Scene([jumping(start, 2.0, offset=offset)])
    found = jump_of(scene)
    # The clip is sampled at 60 fps from 0 to 4 s, so the jump is between frame 60, at 2 s, and half
    # a frame later.
    assert found.frames.tolist() == [60]
    assert found.times == pytest.approx([start + offset + 2.0 + 1 / 60])
    values = found.diagnostic.values
    assert (found.diagnostic.key, values["joint"]) == ("C003.joint", "foot")
    assert (values["n"], values["all"], values["frame"]) == (1, 121, 60)
    assert values["time"] == pytest.approx(start + offset + 2.0 + 1 / 60)
    assert shown_frame(scene, float(found.times[0])) == 60


def test_frames_use_the_requested_rate():
    found = jump_of(Scene([jumping(0.0, 2.0)]), LintOptions(frame_rate=24.0))
    # The clip is sampled at 72 fps.
    assert found.frames.tolist() == [48] and found.times == pytest.approx([2.0 + 1 / 72])
    assert (found.diagnostic.values["n"], found.diagnostic.values["all"]) == (1, 97)


def test_frames_of_several_clips_count_from_the_earliest_start():
    scene = Scene([jumping(0.0, 1.0), jumping(2.0, 1.0)])
    first, second = (f for f in lint_scene(scene) if f.code == "C003")
    assert (first.frames.tolist(), second.frames.tolist()) == ([30], [90])
    assert shown_frame(scene, float(second.times[0])) == 90


def test_capture_frames_take_precedence_for_numbering():
    figure = legs()
    scene = Scene([jumping(0.0, 1.0, length=1.5), Actor(figure, clip=standing(figure))])
    found = jump_of(scene)
    # The first frame of the capture has the number 100.
    assert found.frames.tolist() == [130] == [shown_frame(scene, float(found.times[0]))]


def test_curves_beyond_limits_report_frame_and_degrees():
    figure = column()
    channel = Channel(7, [0.0, 1.0], [0.0, 4.0], (("linear", "linear"),) * 2)
    scene = scene_of(figure, Clip("keys", (channel,), 0.0, 1.0))
    (found,) = [f for f in lint_scene(scene) if f.code == "C006"]
    # The value is 4 radians at the end, with a limit of 3.
    dof = "knee.y is 229.2° in frame 30 at 1.000 s; its limits are -171.9° and 171.9°"
    assert told([found.diagnostic]) == [("C006.curves", {"n": 1, "dof": dof})]
    assert found.seek == pytest.approx(1.0)


def test_file_frame_numbers_are_kept():
    figure = legs()
    clip = standing(figure)
    places = np.array(clip.translations)
    places[20, 0, 0] = 3.0
    scene = scene_of(figure, replace(clip, translations=places))
    assert sorted(jump_of(scene).frames.tolist()) == [120, 121]


def test_frames_of_keyed_transforms_have_the_rate_of_the_keys():
    keys = [[0.0, 0, 0], [0, 0, 0], [90, 0, 0]]
    jump = clip_of(channel(0, "translation", np.array([0, 12, 13]) / 24.0, keys))
    scene = Scene([Actor(leg(), clip=jump)])
    found = jump_of(scene)
    assert sorted(found.frames.tolist()) == [12, 13]
    assert shown_frame(scene, float(found.times[0])) == found.frames[0]


def about(**places: list[int]) -> Finding:
    return Finding(
        Diagnostic("W001.some: text"),
        actor=0,
        **{name: np.array(at) for name, at in places.items()},
    )


def test_locations_of_all_kinds_are_combined():
    places = places_of(about(vertices=[5, 0], triangles=[0], joints=[1]), scene_of(column()))
    assert places.vertices.tolist() == [[-1, 1, 1], [1, 0, 1]]
    assert places.triangles.tolist() == [[[1, 0, 1], [1, 1, 1], [-1, 0, 1]]]
    assert places.joints.tolist() == [[0, 2, 0]]


def test_locations_follow_pose_and_placement():
    scene = scene_of(column())
    actor = scene.actors[0]
    actor.pose.dofs[0] = 3.0  # the root, along x
    actor.placement[:3, 3] = 0.0, 10.0, 0.0
    places = places_of(about(vertices=[5], joints=[1]), scene)
    assert places.vertices.tolist() == [[2, 11, 1]] and places.joints.tolist() == [[3, 12, 0]]
    # The mesh in bind pose ignores the pose.
    bound = places_of(about(vertices=[5]), scene, binding=True)
    assert bound.vertices.tolist() == [[-1, 11, 1]]


@pytest.mark.parametrize("scale", [1.0, 0.01, 250.0])
def test_facing_direction_is_the_mean_normal_in_the_scene(scale):
    scene = scene_of(column())
    turn = rotation_vector_to_matrix(np.array([0.0, np.pi / 2, 0.0]))  # z becomes x
    scene.actors[0].placement[:3, :3] = scale * turn
    # Vertices 4 and 5 of the second ring are at the edges of the side z = 1, with normals of about
    # (1, 0, 1) / sqrt(2) and (-1, 0, 1) / sqrt(2); the x of their mean is 0.
    normals = scene.actors[0].figure.mesh.normals[[4, 5]]
    expected = turn @ normals.mean(axis=0)
    facing = places_of(about(vertices=[4, 5]), scene).facing
    np.testing.assert_allclose(facing, expected, atol=1e-12)
    assert facing[0] > 0.5


def test_surrounding_locations_have_no_facing_direction():
    facing = places_of(about(vertices=[4, 5, 6, 7]), scene_of(column())).facing
    assert np.linalg.norm(facing) < 0.35
    assert not places_of(about(joints=[1]), scene_of(column())).facing.any()


def test_undetected_captured_points_have_no_location():
    figure, clip = keypoints()
    scene = scene_of(figure, clip)
    scene.actors[0].points = clip.points[0].copy()
    scene.actors[0].points[2, 3] = 0.0
    assert places_of(about(joints=[1, 2]), scene).joints.tolist() == [[0, 0.5, 0]]
    # There is still a position for the camera target.
    assert points_of(about(joints=[2]), scene).tolist() == [[0, 1, 0], [0, 0.5, 0]]


def test_missing_actors_have_no_location():
    nowhere = Finding(Diagnostic("W001.some: text"), actor=3, vertices=np.array([0]))
    assert points_of(nowhere, scene_of(column())).shape == (0, 3)
    assert len(places_of(nowhere, scene_of(column())).vertices) == 0


def test_finding_as_text_is_the_first_line_of_the_report():
    found = Finding(Diagnostic("W001.some: text", Path("a.glb")), name="knight", motion="Walk")
    assert str(found.located(Path("a.glb"), 7)) == "a.glb:7: warning W001: knight: Walk: text"
    assert finding_text(found).splitlines()[0] == "a.glb: warning W001: knight: Walk: text"
