"""``viewer.lint``, ``diff``, ``clean``, ``retarget`` and ``rig`` do what the commands do."""

import json

import numpy as np
import pytest
from formats.video_mocap.tool_files import body_model, gvhmr_file
from numpy.testing import assert_allclose

import viewer
from viewer.cli import run
from viewer.errors import RigError, ViewerError

SQUARE = [[0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 2, 0]]
LEG = ["pelvis", "left_hip", "left_knee", "left_ankle", "right_hip", "right_knee", "right_ankle"]
# Legs of 1 m; a foot without a ball.
PLACES = [[0, 1, 0], *([[x, y, 0] for x in (0.1, -0.1) for y in (1.0, 0.5, 0.0)])]


def leg(weights=((1, 0), (1, 0), (0, 1), (0, 1)), **more):
    joints = [[0, 0, 0], [0, 1, 0]]
    return viewer.figure(SQUARE, [[0, 1, 2, 3]], weights=weights, joints=joints, unit="m", **more)


def legs(**more):
    return viewer.figure(
        np.array(PLACES), [[0, 1, 2]], weights=np.eye(7), joints=PLACES, names=LEG,
        parents=[-1, 0, 1, 2, 0, 4, 5], unit="m", **more,
    )  # fmt: skip


ACT = viewer.animate(leg(), np.zeros((4, 2, 3)), fps=10)


# Findings.


def test_lint_of_a_scene_finds_what_the_command_finds(tmp_path, capsys):
    viewer.export(viewer.Actor(leg([[1, 0], [1, 0], [0, 0.7], [0, 1]])), tmp_path / "a.skel")
    files = [str(path) for path in sorted(tmp_path.glob("a.sk*"))]
    assert run(["lint", *files, "--json", "--fail-on", "never"]) == 0
    printed = json.loads(capsys.readouterr().out)
    from_files, from_scene = viewer.lint(files), viewer.lint(viewer.load(*files))
    assert from_files.to_dict() == printed
    assert from_scene.to_dicts() == printed["findings"]
    (wrong,) = [found for found in from_scene if found.code == "W001"]
    assert wrong.vertices.tolist() == [2] and wrong.line is not None
    assert "W001" in str(from_scene) and repr(from_scene).startswith("<Findings: ")
    assert "W001" not in viewer.lint(files, ignore="w001").codes


def test_lint_checks_own_arrays_as_they_are_now():
    actor = viewer.Actor(leg([[1, 0], [1, 0], [0, 0.7], [0, 1]]))
    found = viewer.lint(actor)
    assert "W001" in found.codes and found[found.codes.index("W001")].file is None
    actor.figure = leg()
    assert "W001" not in viewer.lint(actor).codes


def test_limits_have_the_unit_of_the_option():
    turns = np.zeros((9, 2, 3))
    turns[4:, 1, 2] = np.radians(30.0)  # 30 degrees in a frame of a tenth of a second
    actor = viewer.animate(leg(), turns, fps=10)
    fast = {code for code in viewer.lint(actor, max_rotation=299.0).codes if code[0] == "C"}
    slow = {code for code in viewer.lint(actor, max_rotation=301.0).codes if code[0] == "C"}
    assert fast - slow == {"C004"}


# Errors of motions.


def test_diff_has_the_errors_of_papers():
    turns = np.zeros((4, 2, 3))
    turned = turns.copy()
    turned[:, 0, 2] = np.pi / 2
    still, moved = viewer.animate(leg(), turns), viewer.animate(leg(), turned)
    found = viewer.diff(still, moved)
    # One of two joints, 1 m from the root, moves by a quarter of a circle.
    assert found.mpjpe == pytest.approx(1000.0 * np.sqrt(2.0) / 2.0)
    assert found.pa_mpjpe < 1e-6 and found.acceleration < 1e-6
    # Distances of the vertices from the root: 0, 1, sqrt(5), 2.
    assert found.pve == pytest.approx(1000.0 * np.sqrt(2.0) * (3.0 + np.sqrt(5.0)) / 4.0)
    assert np.isnan(found.foot_skate)  # no legs
    errors = found.to_dict()["actors"][0]["pose_errors"]
    assert errors["mpjpe"] == found.mpjpe and errors["foot_skate"] is None
    assert "MPJPE 707.1 mm, PA-MPJPE 0 mm" in str(found)
    assert found.exceeds(0.1) and not viewer.diff(still, still).exceeds(0.0)


def test_errors_of_poses_are_those_in_which_the_figures_were():
    """Test poses compare the surfaces, and leave no trace in the errors or in the figures."""
    still, bent = viewer.Actor(legs()), viewer.Actor(legs())
    bent["left_hip"] = [np.pi / 2, 0.0, 0.0]
    dofs = bent.pose.dofs.copy()
    # A knee 0.5 m and an ankle 1 m below the hip move by a quarter of a circle, of seven joints.
    expected = 1000.0 * np.sqrt(2.0) * 1.5 / 7.0
    assert viewer.diff(still, bent).mpjpe == pytest.approx(expected)
    np.testing.assert_array_equal(bent.pose.dofs, dofs)


def test_command_prints_and_stores_the_same_errors(tmp_path, capsys):
    for name, step in (("a", 0.0), ("b", 0.003)):
        places = np.full((8, 3), 0.5)
        places[:, 0] = step * np.arange(8)
        viewer.export(viewer.animate(legs(), np.zeros((8, 7, 3)), places), tmp_path / f"{name}.glb")
    files = [str(tmp_path / f"{name}.glb") for name in "ab"]
    assert run(["diff", *files, "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["comparisons"]
    assert row["actors"][0]["pose_errors"]["foot_skate"] == pytest.approx(3.0, abs=1e-4)
    assert viewer.diff(*files).to_dict() == row
    assert run(["diff", *files]) == 0
    assert "foot skate 3 mm/frame" in capsys.readouterr().out


def test_foot_skate_counts_feet_that_stand_in_the_reference():
    """The left leg swings: its foot does not count, wherever it goes."""
    count, turns = 40, np.zeros((40, 7, 3))
    turns[:, 1, 0] = -np.linspace(0.3, 1.2, count)
    slide = np.zeros((count, 3))
    slide[:, 2] = 0.002 * np.arange(count)
    reference, skating = viewer.animate(legs(), turns), viewer.animate(legs(), turns, slide)
    assert viewer.diff(reference, skating).foot_skate == pytest.approx(2.0)
    # Frames 0 to 9 of another motion, which then runs away.
    slide[10:] *= 50.0
    running = viewer.animate(legs(), turns, slide)
    found = viewer.diff(reference, running, frames=range(10))
    assert found.foot_skate == pytest.approx(2.0) and found.pose_errors[0].n_frames == 10


def test_errors_that_do_not_exist_say_why():
    still = viewer.animate(leg(), np.zeros((4, 2, 3)))
    longer = viewer.animate(leg(), np.zeros((5, 2, 3)))
    found = viewer.diff(still, longer)
    with pytest.raises(RigError, match="expected 4 frames as in motion, found 5"):
        _ = found.mpjpe
    assert found.to_dict()["actors"][0]["pose_errors"] is None


# Cleaned, driven and rigged figures.


def test_clean_fills_gaps_and_smooths_a_copy():
    turns = np.zeros((21, 2, 3))
    turns[:, 1, 2] = np.linspace(0.0, 2.0, 21)
    turns[10, 1, 2] += 0.5
    seen = np.ones(21, np.bool_)
    seen[4:6] = False
    actor = viewer.animate(leg(), turns, present=seen, fps=20)
    before = actor.joints().copy()
    scene = viewer.clean(actor, gaps="interpolate", trim=range(2, 9))
    # The knee rotates evenly, so interpolated frames are on its line.
    cleaned = scene[0]
    for time, angle in ((0.2, 0.4), (0.25, 0.5)):
        assert_allclose(cleaned.at(time)["joint_1"], [0, 0, angle], atol=1e-9)
    assert cleaned.joints().shape == (7, 2, 3)
    assert [found.key for found in scene.diagnostics] == ["X006.gaps", "X006.trimmed"]
    assert_allclose(actor.joints(), before)
    smooth = viewer.clean(actor, smooth="savgol:window=5,order=1")[0]
    # A moving average of five frames spreads the peak over them.
    assert_allclose(smooth.at(0.5)["joint_1"], [0, 0, 1.0 + 0.5 / 5], atol=1e-3)


def test_retarget_takes_files_and_own_arrays(tmp_path):
    turns = np.zeros((5, 7, 3))
    turns[:, 2, 0] = np.linspace(0.0, 1.0, 5)
    act = viewer.animate(legs(), turns, fps=10)
    wide = viewer.figure(
        np.array(PLACES) * 2, [[0, 1, 2]], weights=np.eye(7), joints=np.array(PLACES) * 2,
        names=LEG, parents=[-1, 0, 1, 2, 0, 4, 5], unit="m",
    )  # fmt: skip
    scene = viewer.retarget(act, viewer.Actor(wide), feet=False)
    # Twice as large, with the same rotations.
    for time in (0.0, 0.2, 0.4):
        assert_allclose(scene[0].at(time)["left_knee"], act.at(time)["left_knee"], atol=1e-9)
    assert_allclose(scene[0].joints(), 2.0 * act.joints(), atol=1e-6)
    viewer.export(act, tmp_path / "walk.bvh")
    viewer.export(viewer.Actor(wide), tmp_path / "wide.glb")
    written = viewer.retarget(tmp_path / "walk.bvh", onto=tmp_path / "wide.glb", feet=False)
    assert_allclose(written[0].joints(), scene[0].joints(), atol=1e-4)
    viewer.export(act, tmp_path / "walk.glb")
    animated = viewer.retarget(tmp_path / "walk.glb", onto=tmp_path / "wide.glb", feet=False)
    for time in (0.0, 0.2, 0.4):
        assert_allclose(animated[0].joints(time), scene[0].joints(time), atol=1e-4)


def test_rig_binds_a_mesh_to_a_skeleton(tmp_path):
    heights, angle = np.repeat(np.linspace(0, 2, 9), 4), np.radians(np.tile([45, 135, 225, 315], 9))
    tube = np.stack([0.2 * np.cos(angle), heights, 0.2 * np.sin(angle)], axis=1)
    low = np.arange(32)
    after = low + 1 - 4 * (low % 4 == 3)
    caps = [[0, 1, 2, 3], [35, 34, 33, 32]]
    faces = np.concatenate([np.stack([low, low + 4, after + 4, after], axis=1), caps])
    bones = viewer.figure(
        [[0, 0, 0]], np.zeros((0, 3), int), joints=[[0, 0, 0], [0, 1, 0], [0, 2, 0]], unit="m"
    )
    viewer.export(viewer.animate(bones, np.zeros((1, 3, 3))), tmp_path / "bones.bvh")
    scene = viewer.rig(
        viewer.Actor(viewer.figure(tube, faces)), skeleton=tmp_path / "bones.bvh", method="heat"
    )
    skin = scene[0].figure.require_skin()
    weights = np.zeros((36, 3))
    np.add.at(weights, (np.repeat(np.arange(36), np.diff(skin.starts)), skin.joints), skin.weights)
    # By symmetry, both bones pull equally at the middle; each half follows its own bone.
    assert_allclose(weights[16:20, :2], 0.5, atol=0.02)
    upper = weights[:, 1:].sum(axis=1)
    assert (weights[:16, 0] > 0.7).all() and (upper[20:] > 0.7).all()
    assert_allclose(scene[0].vertices()[0], tube, atol=1e-9)
    assert any("heat" in str(found) or "bone" in str(found) for found in scene.diagnostics)
    lying = viewer.Actor(viewer.figure(tube[:, [0, 2, 1]] * (1, -1, 1), faces))
    upright = viewer.rig(lying, skeleton=tmp_path / "bones.bvh", up="z")
    # The file of the skeleton has y up, and so has the figure, also once it is written.
    assert_allclose(upright[0].vertices()[0][:, 1], heights, atol=1e-9)
    viewer.export(upright[0], tmp_path / "upright.glb")
    written = viewer.load(tmp_path / "upright.glb")
    assert_allclose(written[0].vertices()[0][:, 1].max(), 2.0, atol=1e-6)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: viewer.lint("fox", max_sped=3), r"^lint: no option is called max_sped; did you "
         r"mean max_speed\? allowed: .*confidence.*ignore"),
        (lambda: viewer.lint("fox", max_speed="x"), '^max_speed: expected a number, found "x"'),
        (lambda: viewer.lint("fox", ignore="X"), '^ignore: no code is called "X"'),
        (lambda: viewer.lint(3), "^lint: expected a scene, an actor or paths, found int"),
        (lambda: viewer.diff("fox", "fox", poses=-1), "^poses: expected 0 to 10000, found -1"),
        (lambda: viewer.diff("fox", "fox", method="x"), "^method: expected one of lbs, dqs"),
        (lambda: viewer.clean(viewer.Actor(leg())), "^clean: expected an option such as smooth"),
        (lambda: viewer.clean(viewer.Actor(leg()), smooth="x"), "^smooth: expected one-euro or"),
        (lambda: viewer.clean(viewer.Actor(leg()), ground=3), "^ground: expected True or False"),
        (lambda: viewer.retarget("fox", "body", feet=2), "^feet: expected one of on, off"),
        (lambda: viewer.retarget(viewer.Actor(leg()), "body"), "figure has no motion of joints"),
        (lambda: viewer.rig("fox", methd=3), r"^rig: no option .*did you mean method\?"),
        (lambda: viewer.rig("fox", fit=3), "^fit: expected True or False, found 3"),
        (lambda: viewer.rig("fox", ACT), "^template: expected paths or names, found Actor"),
        (lambda: viewer.rig("fox", skeleton=[]), "^skeleton: expected paths or names, found an em"),
        (lambda: viewer.rig("fox", "body", auto=True), "^template and auto: expected one of them"),
        (lambda: viewer.rig([]), "^rig: expected a scene, an actor or paths, found an empty list"),
        (lambda: viewer.lint(()), "^lint: expected a scene, an actor or paths, found an empty tup"),
        (lambda: viewer.diff("fox", []), "^diff: expected a scene, .* found an empty list"),
        (lambda: viewer.lint(ACT, ignore="Q99"), "; (did you|viewer lint --codes lists them$)"),
        (lambda: viewer.clean(ACT, smooth="x"), "^smooth: expected one-euro or savgol, found x$"),
        (lambda: viewer.retarget(["a", "b"], "body"), "^retarget: expected one path, found 2; "),
        (lambda: viewer.retarget("fox", "body"), "^retarget: expected a motion of joints, found"),
        (lambda: viewer.retarget(ACT, "body"), "matching joint.* with joint_map$"),
        (lambda: viewer.load(["fox"]), "^load: expected paths or names, found list"),
        (lambda: viewer.load("fox", gender="x"), '^gender: expected female or male or neutral'),
    ],
)  # fmt: skip
def test_wrong_names_and_values_are_refused(call, message):
    with pytest.raises(ViewerError, match=message):
        call()


@pytest.mark.parametrize("has_model", [False, True])
def test_file_of_tensors_is_the_same_body_as_on_the_command_line(has_model, tmp_path, capsys):
    """With a model, the 55 joints of SMPL-X; without one, the 24 of the bundled body."""
    path, model = gvhmr_file(tmp_path), body_model("smplx", tmp_path) if has_model else None
    words = ["--model", str(model)] if model is not None else []
    assert run(["info", str(path), "--json", *words]) == 0
    (told,) = json.loads(capsys.readouterr().out)["actors"]
    (actor,) = viewer.load(path, model=model)
    assert actor.figure.skeleton.n_joints == told["skeleton"]["joints"] == (55 if has_model else 24)
    assert actor.figure.mesh.n_vertices == told["mesh"]["vertices"]


TINY = (32, 24)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: viewer.export([ACT], "x.glb"), "^export: expected a scene or an actor, found"),
        (lambda: viewer.export(leg(), "x.glb"), r"found Figure; viewer\.Actor\(figure\) is one$"),
        (lambda: viewer.export(ACT, "x.mp4"), r'for ".mp4"; .*, as do .* and viewer\.video$'),
        (lambda: viewer.export(ACT, 3), "^path: expected a text or Path, found int"),
        (lambda: viewer.export(ACT, "x.glb", frames="1:2"), r"^frames: expected a range such as"),
        (lambda: viewer.export(ACT, "x.bvh", fps=0), "^fps: expected 0.001 to 100,000 frames per"),
        (lambda: viewer.video(ACT, "x.gif", fps=-1.0), "^fps: expected 0.001 to 100,000 frames pe"),
        (lambda: setattr(viewer.load("fox")[0], "pose", ACT.pose),
         "^pose of fox: expected 114 DOFs of 37 joints, found 6 of 2"),
        (lambda: viewer.export(ACT, "x.qqq"), 'no exporter'),
        (lambda: viewer.video(ACT, "x.gif", frames=[1]), "^frames: expected a range such as"),
        (lambda: viewer.render(ACT, 32), r"^size: expected two integers, such as \(640, 360\)"),
        (lambda: viewer.render(ACT, (32.0, 24)), r"^size: expected two integers"),
        (lambda: viewer.render(ACT, TINY, time="1"), "^time: expected a number, found str"),
        (lambda: viewer.render(ACT, TINY, distance="3"), "^distance: expected a number or None"),
        (lambda: viewer.render(ACT, TINY, camera="front"), "^camera: expected Camera or None"),
        (lambda: viewer.render(ACT, TINY, options={}), "^options: expected DisplayOptions or None"),
        (lambda: viewer.render(ACT, TINY, background=3), "^background: expected a text, found int"),
        (lambda: viewer.animate(ACT, np.zeros((1, 2, 3))), "^figure: expected Figure, found Actor"),
        (lambda: viewer.animate(leg(), np.zeros((1, 2, 3)), fps="x"), "^fps: expected a number"),
        (lambda: viewer.figure(SQUARE, [[0, 1, 2]], up="x"), "^up: expected one of .*, found 'x'"),
        (lambda: leg(name="a", up="-y"), "^up: expected one of "),
        (lambda: viewer.load("fox", motion="x"), "^motion: expected MotionSettings or None"),
        (lambda: viewer.deform(ACT), "^figure: expected Figure, found Actor"),
        (lambda: viewer.deform(leg(), "x"), "^pose: expected Pose or None, found str"),
        (lambda: viewer.joint_matrices(ACT, None), "^figure: expected Figure, found Actor"),
        (lambda: viewer.joint_matrices(leg(), ACT), "^pose: expected Pose, found Actor"),
        (lambda: viewer.deform_frames(ACT, []), "^figure: expected Figure, found Actor"),
        (lambda: viewer.deform_frames(leg(), ACT.pose), "^poses: expected Sequence, found Pose"),
        (lambda: viewer.mirror_pose(leg(), ACT), "^pose: expected Pose, found Actor"),
        (lambda: viewer.rest_pose(leg()), "^skeleton: expected Skeleton, found Figure"),
        (lambda: viewer.shaped(ACT, [1.0]), "^figure: expected Figure, found Actor"),
        (lambda: viewer.with_rest_mesh(3, SQUARE), "^figure: expected Figure, found int"),
        (lambda: viewer.Scene([leg()]), r"^actors\[0\]: expected Actor, found Figure"),
        (lambda: viewer.motion(viewer.Scene([ACT])), "^motion: expected Actor, found Scene"),
        (lambda: viewer.pose_errors(1, ACT), "^found: expected Actor, found int"),
        (lambda: viewer.Actor("fox"), "^figure: expected Figure, found str"),
        (lambda: ACT[0], "^joint: expected a text, found int"),
        (lambda: ACT.at(None), "^time: expected a number, found NoneType"),
        (lambda: ACT.__setitem__("joint_1", "x"), "^joint_1: expected a rotation vector"),
    ],
)  # fmt: skip
def test_other_types_are_refused(call, message):
    with pytest.raises(ViewerError, match=message):
        call()
