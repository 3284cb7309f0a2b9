"""The Rig panel, operated by mouse and keys: choose, align, match, run, compare, save."""

import threading
from dataclasses import replace

import numpy as np
import pytest
from app import rig_scene
from app.rig_scene import TO_Z, TRUE
from app.rigging.rig_panel import SIZE, names, seen, stop
from app.test_panel_pictures import _compare, _shown
from app.tiny import write_rig
from autorig.rigged_shapes import arm, beast, mesh_of
from imgui_bundle import imgui
from numpy.testing import assert_allclose

import viewer
from viewer.app.core import framing
from viewer.app.core.saved_work import SavedWork
from viewer.app.core.view_frame import view_frame
from viewer.app.files.files import Files
from viewer.app.layout import ShownPanels
from viewer.app.rigging import work
from viewer.app.rigging.joint_editing.section import starts
from viewer.app.rigging.joint_editing.state import JointEditing
from viewer.app.rigging.placing import as_similarity, move_by_hand, placing_now
from viewer.app.rigging.results import discard, trial_clip
from viewer.app.rigging.rigging import SHAPE, Rigging, choose_template, current_template
from viewer.autorig.alignment.pose_fit import FittedJoints
from viewer.autorig.alignment.surface_alignment import Alignment
from viewer.autorig.confidence import Finding
from viewer.progress import offer, report
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.motion.clip import sample
from viewer.rigs.pose import rest_pose
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skinning import deform

pytestmark = pytest.mark.usefixtures("quick_fits")


def visible(hand):
    return [actor.name for actor in hand.state.scene.actors if actor.visible]


def test_without_a_target_mesh_only_adding_one_is_enabled(drive, texts):
    hand = drive(size=SIZE, samples=1)
    hand.menu("menu Window", "Rig")
    texts.clear()
    hand.step(2)
    assert (
        "Every mesh in the scene has a rig: change it with Edit skeleton, or add a mesh without "
        "one, " in " ".join(texts)
    )
    for label in ("Align", "Run", "Compare methods", "rig tool move"):
        hand.click(label)
    assert hand.state.job is None and hand.state.of(Rigging).tool == "" and not hand.state.error
    assert hand.state.of(Rigging).target is None


def test_alignment_is_found_and_shown_with_its_error(rigging, texts):
    hand = rigging(placed=False)
    steps = hand.undo_steps
    hand.click("Align")
    hand.finish_job()
    assert_allclose(hand.state.of(Rigging).placing.similarity.matrix, TRUE, atol=1e-6)
    texts.clear()
    hand.step()
    assert "error 0.00 % (by closest points)" in texts
    ghost = hand.app.frame.renderer.ghost
    assert ghost.style == "translucent"
    assert_allclose(ghost.placement, TRUE, atol=1e-6)
    assert hand.undo_steps == steps + 1
    hand.key("z", "ctrl")
    hand.step(2)
    assert hand.state.of(Rigging).placing is None and hand.app.frame.renderer.ghost is None


@pytest.mark.parametrize(
    ("factors", "own", "words"),
    [
        ((1.0, 1.0, 1.0), (1.0, 1.0, 1.0), "pose and limbs fitted"),
        ((1.3, 1.0, 1.0), (1.0, 1.0, 1.0), "stretched, pose kept"),
        ((1.0, 1.0, 1.0), (1.0, 0.8, 1.0), "stretched, pose kept"),
    ],
)
def test_text_next_to_the_error_describes_the_alignment(rigging, texts, factors, own, words):
    hand = rigging()
    hand.finish_job()  # the error of the alignment is still being measured
    placing = placing_now(hand.state)
    where = replace(placing.similarity, factors=np.array(factors), own_factors=np.array(own))
    found = Alignment(where, 0.0015, 0.002, (0.001, 0.001), "fit")
    hand.state.of(Rigging).placing = replace(placing, similarity=where, alignment=found)
    texts.clear()
    hand.step()
    assert f"error 0.15 % ({words})" in texts


@pytest.mark.parametrize("fits", [True, False])
def test_align_button_describes_what_it_does(rigging, monkeypatch, fits):
    said, show = [], imgui.set_tooltip
    monkeypatch.setattr(imgui, "set_tooltip", lambda text: said.append(text) or show(text))
    hand = rigging()
    hand.finish_job()
    hand.state.of(Rigging).choices.fits = fits
    also = "; joints are rotated and limbs resized{} if that fits much better" if fits else ""
    for label, words in (
        (
            "Align",
            "find the best placement by closest points"
            + also.format(", or the whole template is stretched,"),
        ),
        ("Refine", "from its current placement, by closest points" + also.format("")),
    ):
        hand.move(label)
        hand.step(60)
        assert said[-1] == words


def test_template_posed_after_aligning_is_reported(rigging, texts):
    hand = rigging()
    hand.state.scene.actors[1].pose.dofs[8] = 0.0
    texts.clear()
    hand.step(2)
    assert "the template was posed after the alignment: align it again" in texts


def test_joints_are_shown_while_the_template_is_fitted(rigging, monkeypatch):
    """The first of three joints is at a vertex of the mesh, the others on a line through it."""
    hand = rigging(placed=False)
    corner = hand.state.scene.actors[0].figure.mesh.positions[0]
    places = corner + np.outer([0.0, 4.0, 8.0], [0.0, 1.0, 0.0])
    gate, chosen = threading.Event(), threading.Event()
    parents = np.array([-1, 0, 1], np.int32)

    def fitting(*_):
        offer(FittedJoints(places, parents))
        chosen.wait(60)
        offer(FittedJoints(places, parents, is_chosen=True))
        while not gate.wait(0.005):
            report(3, 10, "", "fitting limbs")
        raise AssertionError("the job is cancelled before")

    monkeypatch.setattr(work, "align_template", fitting)
    hand.step(2)
    before = hand.app.pixels()
    hand.click("Align")
    while hand.state.job.found is None:
        hand.step()
    hand.step(2)
    tried = hand.app.pixels()
    chosen.set()
    while not hand.state.job.found.is_chosen or hand.state.job.title == "Aligning":
        hand.step()
    hand.step(2)
    assert hand.state.job.title == "Aligning: fitting limbs"
    changed = (hand.app.pixels() != before).any(axis=2)
    scale = changed.shape[1] / SIZE[0]
    for place in places:
        x, y = np.array(view_frame(hand.state).place(place)) * scale
        assert changed[round(y) - 1 : round(y) + 2, round(x) - 1 : round(x) + 2].any()
    shown = hand.app.pixels()
    # A fit that is only tried is fainter.
    x, y = np.rint(np.array(view_frame(hand.state).place(places[1])) * scale).astype(int)
    faint, full = (np.abs(each[y, x].astype(int) - before[y, x]).sum() for each in (tried, shown))
    assert 0 < faint < 0.6 * full
    target = hand.state.scene.actors.pop(0)
    hand.step(2)
    gone = hand.app.pixels()
    hand.state.job.found = None
    hand.step(2)
    assert hand.state.job is not None and (hand.app.pixels() == gone).all()  # none without a target
    hand.state.scene.actors.insert(0, target)
    assert (shown != gone).any()
    hand.key("escape")
    hand.finish_job()
    x, y = np.array(view_frame(hand.state).place(places[1])) * scale
    part = np.s_[round(y) - 1 : round(y) + 2, round(x) - 1 : round(x) + 2]
    assert (hand.app.pixels()[part] == before[part]).all()


def test_match_is_coloured_before_the_target_is_rigged(rigging, texts):
    hand = rigging(placed=False)
    assert "Colours" not in hand.state.item_rects
    hand.click("Show match")  # greyed, because the template is not aligned yet
    assert hand.state.job is None
    move_by_hand(hand.state, current_template(hand.state), as_similarity(TRUE))
    hand.step(2)
    hand.click("Show match")
    hand.finish_job()
    state = hand.state
    assert (state.options.shading, state.options.scalar) == ("scalar", "class:match")
    assert state.of(Rigging).match_fraction == 1.0 and state.error == ""
    fields = {field.name: field for field in state.scene.actors[0].figure.fields}
    assert fields["match"].names == ("matched", "unmatched")
    assert fields["match"].values.tolist() == [0.0] * state.scene.actors[0].figure.mesh.n_vertices
    assert fields["match distance"].values.max() < 1e-9
    texts.clear()
    hand.step()
    assert "100.0 % of the vertices match" in texts
    hand.pick("Colours", 2)
    assert state.options.scalar == "field:match distance"
    hand.pick("Colours", 0)
    assert state.options.shading == "auto"


def test_match_counts_close_vertices_with_similar_normals(rigging):
    hand = rigging()
    # The template is offset by a tenth of the target's size, so no vertex is within 1 %.
    placing = hand.state.of(Rigging).placing.similarity
    away = placing.matrix.copy()
    away[:3, 3] += 10.0
    move_by_hand(hand.state, current_template(hand.state), as_similarity(away))
    hand.enter_value("Max. distance", "1")
    assert hand.state.of(Rigging).choices.max_distance == pytest.approx(0.01)
    hand.click("Show match")
    hand.finish_job()
    assert hand.state.of(Rigging).match_fraction < 0.35


def test_stretch_is_kept_when_the_template_is_moved_before_run(rigging):
    hand = rigging()
    stretch = np.array([1.25, 1.0, 0.8])
    stretched = replace(placing_now(hand.state).similarity, own_factors=stretch)
    move_by_hand(hand.state, current_template(hand.state), stretched)
    hand.click("rig tool scale")
    hand.step(2)
    hand.enter_value("Scale factor", f"{stretched.scale * 1.01}")
    now = placing_now(hand.state).similarity
    assert now.scale == pytest.approx(1.01 * stretched.scale)
    assert_allclose(now.own_factors, stretch)
    moved = now.matrix.copy()
    moved[:3, :3] = rig_scene.ROTATION @ moved[:3, :3]
    again = as_similarity(moved, now)
    assert_allclose(again.matrix, moved, atol=1e-9 * np.abs(moved).max())
    hand.finish_job()
    hand.click("Run")
    hand.finish_job()
    placed = hand.state.of(Rigging).results["robust"].rigged.alignment.similarity
    assert_allclose(placed.own_factors, stretch, atol=1e-9)


def test_run_replaces_the_target_with_the_rigged_mesh_in_one_step(rigging):
    hand = rigging()
    target = hand.state.scene.actors[0]
    wanted = target.figure.mesh.positions
    steps = hand.undo_steps
    hand.click("Run")
    assert hand.state.job is not None
    hand.finish_job()
    assert hand.state.error == ""
    assert names(hand) == ["scan rigged", "arm", "scan"]
    assert visible(hand) == ["scan rigged", "arm"]
    assert hand.state.actor.figure.is_attached and hand.state.chosen_actor == 0
    assert hand.undo_steps == steps + 1
    assert hand.state.of(SavedWork).lacks_rig(hand.state.actor.figure)  # motions drive it
    assert hand.state.clock.playing and hand.state.options.xray
    hand.state.clock.playing = False
    first = hand.state.actor.clip.start
    hand.state.clock.seek(first)
    hand.step(2)
    # The trial motion starts in the target's pose.
    assert_allclose(seen(hand, 0), wanted, atol=1e-8)
    hand.key("z", "ctrl")
    hand.step(2)
    assert names(hand) == visible(hand) == ["scan", "arm"]
    assert hand.state.scene.actors[0] is target
    hand.key("y", "ctrl")
    hand.step(2)
    assert visible(hand) == ["scan rigged", "arm"]
    hand.assert_sane()


def test_rig_of_a_mesh_with_z_up_stands_in_files(rigging, tmp_path):
    hand = rigging(placed=False, up="z")
    template, target = current_template(hand.state), hand.state.scene.actors[0].figure.mesh
    move_by_hand(hand.state, template, as_similarity(TO_Z @ TRUE))
    hand.step(2)
    hand.click("Run")
    hand.finish_job()
    stop(hand)
    assert_allclose(seen(hand, 0), target.positions, atol=1e-8)
    # The template has y up, and so has the figure, also once it is written.
    viewer.export(replace(hand.state.actor, clip=None, placement=np.eye(4)), tmp_path / "rig.glb")
    written = viewer.load(tmp_path / "rig.glb")[0].vertices()[0]
    upright = target.positions @ TO_Z[:3, :3]
    assert_allclose(np.ptp(written, axis=0), np.ptp(upright, axis=0), atol=1e-4)


def test_view_holds_the_whole_trial_motion_without_a_press_of_fit(rigging, monkeypatch):
    monkeypatch.setattr(framing, "_POINTS_A_TIME", 0)  # one frame of the motion at a time
    hand = rigging()
    hand.state.framing.restart()
    hand.step(4)
    before = view_frame(hand.state)
    hand.click("Run")
    hand.finish_job()
    hand.state.clock.playing = False
    hand.step(40)
    known = hand.state.framing
    assert known.is_settled and known.has_placed(hand.state.camera)
    x, y, width, height = hand.state.view_rect
    places = view_frame(hand.state).project(known.extent.points)
    assert (places >= [x, y]).all() and (places <= [x + width, y + height]).all()
    x, y, width, height = before.rect
    places = before.project(known.extent.points)
    assert (places < [x, y]).any() or (places > [x + width, y + height]).any()


def test_rig_that_is_probably_wrong_is_kept_or_discarded(rigging, texts, monkeypatch):
    doubt = Finding("R017.inside: only {value} of the bones are inside the mesh", 0.2, 0.3, 0.7)
    monkeypatch.setattr(work, "judge", lambda *_, **__: (doubt,))
    hand = rigging(placed=False)
    hand.click("Align")
    hand.finish_job()
    for answer in ("Keep it", "Discard it"):
        hand.click("Run")
        hand.finish_job()
        texts.clear()
        hand.step(2)
        assert "only 20% of the bones are inside the mesh" in texts
        hand.click("Save rigged…")
        assert hand.state.of(Files).dialog is None  # disabled until the question is answered
        hand.click(answer)
        texts.clear()
        hand.step(2)
        assert "only 20% of the bones are inside the mesh" not in texts
        is_kept = answer == "Keep it"
        assert names(hand) == (["scan rigged", "arm", "scan"] if is_kept else ["scan", "arm"])
        assert visible(hand) == (["scan rigged", "arm"] if is_kept else ["scan", "arm"])
    hand.assert_sane()


def test_second_of_two_compared_rigs_is_discarded(rigging):
    hand = rigging()
    hand.click("Compare methods")
    hand.finish_job()
    results = hand.state.of(Rigging).results
    before = hand.state.scene.actors.copy()
    first, second = (results[name] for name in ("robust", "nearest"))
    target = second.target
    discard(hand.state, second)
    hand.step(2)
    # The target stays behind the first result and the template; the second result was last.
    assert hand.state.scene.actors == [before[0], before[1], target]
    assert [*results] == ["robust"] and hand.state.actor is target
    discard(hand.state, first)
    hand.step(2)
    assert hand.state.scene.actors == [target, before[1]] and not results
    hand.assert_sane()


def test_stats_include_the_rigged_mesh(rigging, texts):
    hand = rigging()
    hand.click("Run")
    hand.finish_job()
    texts.clear()
    hand.step()
    assert "scan rigged, arm, scan" in texts and "4" in texts  # joints: two of each rig


def test_a_key_toggles_between_mesh_and_rig_without_undo_steps(rigging):
    hand = rigging()
    hand.key("a")
    assert hand.says("A/B: nothing is rigged yet, see Window > Rig")
    hand.click("Run")
    hand.finish_job()
    steps = hand.undo_steps
    for expected in ("scan", "scan rigged", "scan"):
        hand.key("a")
        hand.step(2)
        assert sorted(visible(hand)) == ["arm", expected]
        assert hand.state.actor.name == expected
    assert hand.undo_steps == steps
    hand.key("z", "ctrl")
    hand.step(2)
    assert visible(hand) == ["scan", "arm"] and names(hand) == ["scan", "arm"]


def test_a_key_says_that_an_edited_rig_is_no_version(rigging, texts):
    hand = rigging()
    hand.click("Run")
    hand.finish_job()
    hand.state.of(JointEditing).start = "own"
    hand.click("Edit skeleton")
    hand.finish_job()
    hand.key("delete")
    hand.step(2)
    hand.finish_job()
    assert hand.state.actor.figure.skeleton.n_joints == 1
    hand.key("a")
    texts.clear()
    hand.step()
    assert "A/B: the rig was edited: File > Export saves it" in texts
    assert "The rig was edited: File > Export saves it." in texts


def test_second_run_replaces_the_first_result(rigging):
    hand = rigging()
    for _ in range(2):
        hand.click("Run")
        hand.finish_job()
    assert names(hand) == ["scan rigged", "arm", "scan"]


def test_both_methods_are_compared(rigging, texts):
    hand = rigging()
    hand.click("Compare methods")
    hand.finish_job()
    assert names(hand) == ["scan rigged", "arm", "scan", "scan rigged (nearest)"]
    assert visible(hand) == ["scan rigged", "arm"]
    results = hand.state.of(Rigging).results
    assert list(results) == ["robust", "nearest"]
    # The expected values are an independent sum over dense rows.
    dense = []
    for result in results.values():
        skin = result.rigged.figure.skin
        rows = np.zeros((skin.n_vertices, 2))
        np.add.at(rows, (np.repeat(np.arange(len(rows)), np.diff(skin.starts)), skin.joints),
                  skin.weights)  # fmt: skip
        dense.append(rows)
    comparison = hand.state.of(Rigging).comparison
    assert comparison.weights == pytest.approx(np.abs(dense[0] - dense[1]).sum(axis=1).mean())
    clear = np.abs(np.diff(dense[0])[:, 0]) > 1e-9
    same = dense[0].argmax(axis=1) == dense[1].argmax(axis=1)
    assert abs(comparison.dominant - same.mean()) <= (~clear).mean() + 1e-12
    texts.clear()
    hand.step()
    assert "matched" in texts and "100.0 %" in texts and "nearest" in texts
    for expected in ("scan", "scan rigged", "scan rigged (nearest)"):
        hand.click(f"version {['target', 'robust', 'nearest'][names_of(expected)]}")
        assert sorted(visible(hand)) == ["arm", expected]


def test_mesh_is_bound_to_a_skeleton_of_the_scene(drive, texts):
    figure = arm()
    mesh, bare = Figure("scan", figure.mesh), Figure("joints", skeleton=figure.skeleton)
    hand = drive(scene=Scene([Actor(mesh), Actor(bare, rest_pose(bare.skeleton))]), size=SIZE,
                 samples=1)  # fmt: skip
    hand.menu("menu Window", "Rig")
    texts.clear()
    hand.step(2)
    assert "2 joints, no mesh, in its current pose" in texts
    for label in ("Align", "Show match", "rig tool move"):
        hand.click(label)
    assert hand.state.job is None and hand.state.of(Rigging).tool == "" and not hand.state.error
    hand.click("Compare methods")
    hand.finish_job()
    assert names(hand) == ["scan bound", "joints", "scan", "scan bound (voxel)"]
    results = hand.state.of(Rigging).results
    assert list(results) == ["heat", "voxel"] and hand.state.of(Rigging).comparison is not None
    line = str(results["heat"].rigged.lines[0])
    assert line == "skeleton: not moved, 1 of 1 joint inside the mesh"
    for actor in (result.actor for result in results.values()):
        assert actor.figure.skeleton is bare.skeleton
        assert_allclose(deform(actor.figure, rest_pose(bare.skeleton))[0], mesh.mesh.positions,
                        atol=1e-12)  # fmt: skip


def names_of(expected):
    return ["scan", "scan rigged", "scan rigged (nearest)"].index(expected)


def test_confidence_maps_are_shown_by_buttons(rigging):
    hand = rigging()
    hand.click("Run")
    hand.finish_job()
    for view in ("class:confidence", "field:distance", "class:guarded"):
        hand.click(f"color {view}")
        assert (hand.state.options.shading, hand.state.options.scalar) == ("scalar", view)
        hand.step(2)
        assert hand.state.error == "" and hand.state.stats.legend is not None
    hand.click("color ")
    assert hand.state.options.shading == "auto"


def test_result_plays_the_template_motion_at_the_target_position(rigging):
    hand = rigging(with_clip=True)
    # The clip's first frame is the rest pose; the target was posed differently.
    template = hand.state.scene.actors[1]
    template.pose.dofs[6:] = 0.2, -0.1, 0.7
    hand.step(2)
    hand.click("Run")
    hand.finish_job()
    assert hand.state.error == "" and hand.state.clock.playing
    stop(hand)
    still = seen(hand, 0)
    hand.click("Move like the template")
    hand.step(2)
    hand.state.clock.seek(1.0)
    hand.step(3)
    figure, pose = rig_scene.bent()
    pose.dofs[:] = 0.0
    pose.dofs[0], pose.dofs[8] = 1.0, 1.0  # as the template moves, transformed by the alignment
    wanted = apply_transform(TRUE, deform(figure, pose)[0])
    assert_allclose(seen(hand, 0), wanted, atol=1e-5)
    hand.click("Move like the template")
    hand.step(2)
    assert hand.state.actor.clip is None
    assert_allclose(seen(hand, 0), still, atol=1e-9)
    assert hand.undo_steps >= 2


def test_template_without_motion_states_why_the_result_does_not_move(rigging):
    hand = rigging()
    hand.click("Run")
    hand.finish_job()
    stop(hand)
    hand.click("Move like the template")
    assert hand.state.actor.clip is None


def test_cancelled_work_does_not_change_the_scene(rigging):
    hand = rigging()
    before = names(hand)
    hand.click("Run")
    hand.key("escape")
    hand.finish_job()
    assert hand.says("Cancelled")
    hand.step(5)
    running = hand.state.of(Rigging).running
    assert running is None and names(hand) == before and hand.state.error == ""


def test_result_for_a_removed_mesh_is_discarded(rigging):
    hand = rigging()
    hand.click("Run")
    job = hand.state.job
    job.wait()
    del hand.state.scene.actors[0]
    hand.state.chosen_actor = 0
    hand.step(3)
    assert hand.says("The mesh that was rigged no longer exists")
    assert names(hand) == ["arm"]


def test_new_scene_keeps_only_the_rig_settings(rigging, rig):
    hand = rigging()
    hand.pick("Method", 1)
    hand.click("Run")
    hand.finish_job()
    assert names(hand)[0] == "scan rigged (nearest)"
    hand.open(*rig)
    hand.click("Discard")  # the rig has not been saved
    hand.step(2)
    assert hand.state.of(Rigging).results == {} and hand.state.of(Rigging).target is None
    assert hand.state.of(Rigging).choices.method == "nearest"


TALL = (1000, 1100)


def _aligned(hand):
    hand.click("Align")
    hand.finish_job()
    hand.click("rig tool rotate")
    hand.move((5, 5))


def _result(hand):
    hand.click("Run")
    hand.finish_job()
    hand.state.clock.playing = False
    hand.state.clock.seek(0.0)
    hand.click("color class:confidence")
    hand.move((5, 5))


@pytest.mark.golden("app_{name}")
@pytest.mark.parametrize(("name", "prepare"), [("rig", _aligned), ("rigged", _result)])
def test_rig_panel_matches_golden_image(drive, name, prepare):
    hand = drive(scene=rig_scene.scene(), size=TALL, samples=1, pixels_per_point=1.0)
    hand.state.of(ShownPanels).closed.add("stats")  # the displayed times differ between runs
    hand.menu("menu Window", "Rig")
    hand.step(2)
    _compare(_shown(hand, prepare), name)


def test_joints_bend_one_after_another_and_return(tmp_path):
    actor = viewer.load(*write_rig(tmp_path)).actors[0]
    skeleton, pose = actor.figure.skeleton, actor.pose
    clip = trial_clip(skeleton, pose)
    assert len(clip.channels) == sum(skeleton.parents >= 0)
    for channel in clip.channels:
        assert skeleton.parents[skeleton.dof_joints[channel.target]] >= 0
        low, high = skeleton.dof_limits[channel.target]
        assert (low <= channel.values).all() and (channel.values <= high).all()
        assert np.ptp(channel.values) > 0.0
    for time in (clip.start, clip.end):
        posed = pose.copy()
        sample(clip, skeleton, time, posed)
        np.testing.assert_allclose(posed.dofs, pose.dofs, atol=1e-12)


def test_skeleton_is_found_in_the_shape_with_the_chosen_settings(drive, texts, monkeypatch):
    monkeypatch.setattr("viewer.autorig.curve_skeleton._FINEST", 96)
    target = Actor(Figure("beast", mesh_of(*beast())))
    hand = drive(scene=Scene([target]), size=SIZE, samples=1)
    hand.menu("menu Window", "Rig")
    hand.step(2)
    hand.pick("Template", 2)  # below the bundled figures
    hand.step(2)
    assert "for what is no person and no quadruped" in " ".join(texts)
    assert "Align" not in hand.state.item_rects and "Show match" not in hand.state.item_rects
    hand.click("Pose it…")  # there is nothing to pose yet
    assert hand.state.job is None
    hand.pick("Facing##shape", 6)
    hand.click("Run")
    hand.finish_job()
    state = hand.state
    assert state.error == ""
    (result,) = state.of(Rigging).results.values()
    skeleton = result.rigged.figure.skeleton
    knee = skeleton.names.index("leg_1_left_2")
    # The front is -z, so that left is -x.
    place = viewer.rigs.kinematics.world_matrices(skeleton, rest_pose(skeleton))[knee, :3, 3]
    assert place[0] < -0.5 and place[2] < -0.5
    assert "2 pairs mirrored" in str(result.rigged.lines[0])
    assert result.method == "heat" and visible(hand) == ["beast bound"]
    assert_allclose(seen(hand, 1), target.figure.mesh.positions, atol=1e-9)


def test_editing_is_not_offered_with_a_template_where_joints_come_from_the_shape(rigging):
    hand = rigging(placed=False)
    assert starts(hand.state)["template"] == "template, fitted"
    choose_template(hand.state, SHAPE)
    assert starts(hand.state)["template"] == "joints from shape"
