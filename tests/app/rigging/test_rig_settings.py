"""Rig panel: settings, templates from files, messages, and saved results."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from app import rig_scene
from app.curves.plotted import clip_text
from app.rig_scene import TRUE
from app.rigging.rig_panel import SIZE, names, seen, stop
from app.tiny import write_rig
from autorig.moving_shapes import two_boxes, write_frames
from autorig.rigged_shapes import turn
from autorig.test_binding import box, joined
from imgui_bundle import imgui
from numpy.testing import assert_allclose

import viewer
from viewer.app.closing import Closing, request_quit, unsaved_edits
from viewer.app.files.files import Files
from viewer.app.rigging.placing import placing_now
from viewer.app.rigging.rigging import Rigging, target_mesh, targets, template_texts, templates
from viewer.app.rigging.work import align_template, start_adding, start_reading
from viewer.autorig.alignment.surface_alignment import AlignmentSettings
from viewer.exporters import export
from viewer.formats.rigged import save
from viewer.progress import report_fraction
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.scene import Actor, Scene, actor_points
from viewer.rigs.skinning import deform

pytestmark = pytest.mark.usefixtures("quick_fits")


def test_settings_are_used_by_alignment_and_transfer(rigging, monkeypatch):
    asked = {}

    def placed(template, own, target, settings, fits):
        asked.update(alignment=settings, fits=fits)
        return align_template(template, own, target, AlignmentSettings(matrix=TRUE), False)

    def instead(figure, pose, target, settings, name):
        asked.update(settings=settings, name=name)
        raise viewer.ViewerError("stopped here")

    monkeypatch.setattr("viewer.app.rigging.work.align_template", placed)
    monkeypatch.setattr("viewer.app.rigging.work.transfer", instead)
    hand = rigging(placed=False)
    hand.pick("Up", 3)
    hand.pick("Scale", 2)
    hand.click("rig advanced")
    hand.step(2)
    hand.pick("Joints##rig", 1)
    hand.enter_value("Max. angle", "75")
    hand.enter_value("Smoothing", "7")
    hand.enter_value("Max. influences", "3")
    hand.click("Pose correctives")
    hand.click("Refine alignment")
    hand.click("Fit pose and proportions")
    hand.click("Run")
    hand.finish_job()
    settings = asked["settings"]
    assert hand.state.error == "stopped here" and asked["name"] == "scan rigged"
    assert (asked["alignment"].up, asked["alignment"].scale) == ("z", "none")
    assert asked["alignment"].facing is None and not asked["fits"]
    assert not asked["alignment"].refines
    assert_allclose(settings.alignment.matrix, TRUE, atol=1e-9)
    assert settings.joints == "alignment" and not settings.correctives and not settings.fits
    assert settings.weights.match.max_angle == pytest.approx(np.radians(75.0))
    assert settings.weights.match.near_angle == pytest.approx(np.radians(75.0))
    assert (settings.weights.smoothing_rounds, settings.weights.max_influences) == (7, 3)


def test_advanced_settings_are_collapsed_and_changed_ones_counted(rigging, texts, monkeypatch):
    titles, draw = [], imgui.tree_node
    monkeypatch.setattr(imgui, "tree_node", lambda text: titles.append(text) or draw(text))
    hand = rigging(placed=False)
    assert titles[-1] == "Advanced###rig advanced" and "Smoothing" not in hand.state.item_rects
    hand.state.of(Rigging).choices.smoothing, hand.state.of(Rigging).choices.joints = 3, "alignment"
    hand.step(2)
    assert titles[-1] == "Advanced (2 changed)###rig advanced"
    hand.click("rig advanced")
    hand.step(2)
    assert "Smoothing" in hand.state.item_rects


def test_progress_shows_step_and_fraction(rigging, texts, monkeypatch):
    gate = threading.Event()

    def placed(template, own, target, settings, fits):
        report_fraction(0.4, "fitting pose and proportions")
        gate.wait(60)
        return align_template(template, own, target, AlignmentSettings(matrix=TRUE), False)

    monkeypatch.setattr("viewer.app.rigging.work.align_template", placed)
    said, draw = [], imgui.progress_bar
    monkeypatch.setattr(imgui, "progress_bar", lambda *given: said.append(given[2]) or draw(*given))
    hand = rigging(placed=False)
    hand.click("Align")
    while hand.state.job.progress != (40, 100, ""):
        time.sleep(0.01)
    texts.clear()
    hand.step(2)
    gate.set()
    assert "Aligning: fitting pose and proportions" in texts and said[-1] == "40 %"
    hand.finish_job()


def test_template_is_posed_to_fit_shown_in_the_fitted_pose_and_reported(rigging, texts):
    hand = rigging(placed=False)
    actor = hand.state.scene.actors[1]
    # The tip of the target is rotated by a further half radian.
    actor.pose.dofs[6:] = 0.2, -0.1, 0.2
    hand.step(2)
    hand.click("Align")
    hand.finish_job()
    state = hand.state
    assert state.of(Rigging).placing.fitted is not None
    texts.clear()
    hand.step()
    assert any(text.startswith("pose: template joints rotated") for text in texts)
    ghost = hand.app.frame.renderer.ghost
    shown = apply_transform(ghost.placement, ghost.figure.mesh.positions)
    own = apply_transform(ghost.placement, deform(actor.figure, actor.pose)[0])
    wanted = target_mesh(state).positions
    gaps = [np.linalg.norm(points - wanted, axis=1).max() for points in (shown, own)]
    assert gaps[0] < 0.2 * gaps[1]
    assert actor.pose.dofs[8] == 0.2  # the pose of the actor is unchanged
    hand.click("Run")
    hand.finish_job()
    # The report states how the alignment was found.
    rigged = state.of(Rigging).results["robust"].rigged
    keys = ["R001.alignment", "R001.error", "R003.pose", "R003.gap", "R005.matched"]
    assert [line.key for line in rigged.lines[:5]] == keys
    assert str(rigged.lines[0].values["how"]) == "found by fitting pose and proportions"
    assert rigged.lines[2:4] == state.of(Rigging).placing.lines
    stop(hand)
    assert_allclose(seen(hand, 0), wanted, atol=1e-6)
    assert state.error == ""


def test_mesh_is_added_by_dialog_and_the_body_is_loaded_on_demand(drive, tmp_path):
    figure, pose = rig_scene.bent()
    export(Actor(rig_scene.scan(figure, pose)), tmp_path / "scan.obj")
    hand = drive(size=SIZE, samples=1)
    hand.menu("menu Window", "Rig")
    hand.click("Add mesh…")
    hand.state.of(Files).dialog.enter(tmp_path)
    hand.step()
    hand.click("file scan.obj")
    hand.click("Open###Open")
    hand.finish_job()
    assert hand.state.actor.name == "scan" and hand.state.of(Rigging).target is hand.state.actor
    assert hand.state.paths[-1] == tmp_path / "scan.obj"
    assert hand.undo_steps == 1
    assert [*template_names(hand)][1:] == ["Bundled body", "Bundled fox", "From shape"]
    hand.pick("Template", 2)
    assert hand.state.of(Rigging).template_key == "fox"
    hand.click("rig tool move")  # the template must be loaded to be moved
    hand.finish_job()
    assert hand.state.of(Rigging).template.figure.name == "fox"
    hand.click("Pose it…")
    hand.step(2)
    assert names(hand) == ["fox", "scan", "fox-2"]
    chosen = hand.state.scene.actors[2]
    assert hand.state.of(Rigging).template_key == f"actor {id(chosen)}"
    # The new mesh is placed next to the existing actors.
    assert seen(hand, 2)[:, 0].min() > seen(hand, 1)[:, 0].max()
    hand.key("z", "ctrl")
    hand.step(2)
    assert names(hand) == ["fox", "scan"]


def template_names(hand):
    return template_texts(hand.state).values()


def test_template_from_a_file_is_unchanged_by_fitting(drive, tmp_path):
    hand = drive(scene=rig_scene.scene(with_template=False), size=SIZE, samples=1)
    hand.menu("menu Window", "Rig")
    hand.step(2)
    assert hand.state.of(Rigging).template_key == "body"  # there is no other template
    save(rig_scene.bent()[0], tmp_path / "arm.npz")
    start_reading(hand.state, (tmp_path / "arm.npz",))
    hand.finish_job()
    template = hand.state.of(Rigging).template
    hand.click("Run")  # aligns the template in its rest pose and rotates its joints
    hand.finish_job()
    assert hand.state.of(Rigging).template is template
    assert placing_now(hand.state).fitted is not None
    hand.click("Run")
    hand.finish_job()
    assert hand.state.of(Rigging).template is template and placing_now(hand.state) is not None
    assert names(hand) == ["scan rigged", "scan"] and hand.state.error == ""


def test_unsuitable_files_show_a_message(rigging, tmp_path):
    hand = rigging()
    skel, skin = write_rig(tmp_path)
    (tmp_path / "bare.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    hand.click("Template file…")
    hand.state.of(Files).dialog.enter(tmp_path)
    hand.step()
    hand.click("file bare.obj")
    hand.click("Open###Open")
    hand.finish_job()
    wanted = "bare.obj: expected a rigged figure or a skeleton, found none"
    assert hand.state.error == wanted
    hand.key("escape")
    hand.click("Template file…")
    hand.state.of(Files).dialog.enter(tmp_path)
    hand.state.of(Files).dialog.chosen = {skel, skin}
    hand.step()
    hand.click("Open 2 files###Open")
    hand.finish_job()
    assert hand.state.of(Rigging).template.figure.name == "tiny" and hand.state.error == ""
    assert hand.state.of(Rigging).template_key == "file"


def test_target_that_is_already_rigged_is_refused(drive, tmp_path):
    hand = drive(size=SIZE, samples=1)
    body = viewer.load(*write_rig(tmp_path)).actors[0]
    save(body.figure, tmp_path / "whole.npz")
    start_adding(hand.state, [tmp_path / "whole.npz"])
    hand.finish_job()
    assert hand.state.error == (
        f"{tmp_path / 'whole.npz'}: expected a mesh without a rig, found a rigged mesh"
    )


def test_mesh_of_a_gltf_file_without_a_skin_is_rigged_in_its_current_pose(drive, tmp_path):
    figure, pose = rig_scene.bent()
    export(Actor(rig_scene.scan(figure, pose)), tmp_path / "scan.glb")
    hand = drive(scene=Scene([Actor(figure, pose)]), size=SIZE, samples=1)
    start_adding(hand.state, [tmp_path / "scan.glb"])
    hand.finish_job()
    assert hand.state.error == ""
    hand.menu("menu Window", "Rig")
    hand.step(2)
    added, arm = hand.state.scene.actors[1], hand.state.scene.actors[0]
    assert targets(hand.state) == [added] and templates(hand.state) == [arm]
    rest = target_mesh(hand.state)
    assert target_mesh(hand.state) is rest
    # A quarter turn of its node about z, which is at the origin: (x, y) becomes (-y, x).
    added.pose.dofs[2] = np.pi / 2
    turned = np.column_stack((-rest.positions[:, 1], rest.positions[:, 0]))
    assert_allclose(target_mesh(hand.state).positions[:, :2], turned, atol=1e-12)


def test_mesh_and_template_are_added_in_the_unit_and_up_axis_of_the_scene(drive, tmp_path):
    figure, pose = rig_scene.bent()
    scan = rig_scene.scan(figure, pose)
    held = Actor(replace(scan, unit="cm", up="z"))
    hand = drive(scene=Scene([held], (), "z"), size=SIZE, samples=1)
    hand.menu("menu Window", "Rig")
    hand.step(2)
    mesh = replace(scan, name="other", unit="m", up="y")
    export(Actor(mesh), tmp_path / "other.obj")
    save(replace(figure, unit="mm", up="y"), tmp_path / "arm.npz")
    start_adding(hand.state, [tmp_path / "other.obj"])
    hand.finish_job()
    assert hand.state.error == ""
    added = hand.state.scene.actors[1]
    # The y axis of the file becomes the z axis of the scene, and a metre 100 units.
    assert_allclose(added.placement[:3, :3] @ [0.0, 1.0, 0.0], [0.0, 0.0, 100.0], atol=1e-9)
    assert hand.says("other is in metres")
    start_reading(hand.state, (tmp_path / "arm.npz",))
    hand.finish_job()
    hand.click("Pose it…")
    hand.step(2)
    posed = hand.state.scene.actors[2]
    assert_allclose(posed.placement[:3, :3] @ [0.0, 1.0, 0.0], [0.0, 0.0, 0.1], atol=1e-12)
    points = [actor_points(actor)[:, 0] for actor in hand.state.scene.actors]
    assert points[2].min() > max(points[0].max(), points[1].max())


def test_motion_of_an_added_template_is_not_an_edit(rigging, rig, tmp_path):
    hand = rigging()
    (tmp_path / "wave.anim").write_text(clip_text())
    start_reading(hand.state, (*rig, tmp_path / "wave.anim"))
    hand.finish_job()
    hand.click("Pose it…")
    hand.step(2)
    assert hand.state.actor.clip.name == "wave" and unsaved_edits(hand.state) == []


def test_window_that_waits_for_a_rig_asks_to_save_it(rigging):
    hand = rigging()
    hand.click("Run")
    request_quit(hand.state)
    hand.state.of(Closing).waits = True  # "Finish first"
    hand.finish_job()
    assert not hand.state.of(Closing).is_over and "Save…" in hand.state.item_rects
    hand.click("Discard")
    hand.step(2)
    assert hand.state.of(Closing).is_over


def test_result_is_saved_and_opens_again(rigging, tmp_path):
    hand = rigging()
    hand.click("Run")
    hand.finish_job()
    assert [edit.text for edit in unsaved_edits(hand.state)] == ["scan: rig"]
    hand.click("Save rigged…")
    hand.state.of(Files).dialog.enter(tmp_path)
    hand.step()
    assert hand.state.of(Files).dialog.name == "scan_rigged.npz"
    hand.click("Save###Save")
    hand.finish_job()
    assert hand.says("Saved") and hand.state.error == "" and unsaved_edits(hand.state) == []
    again = viewer.load(tmp_path / "scan_rigged.npz").actors[0].figure
    assert again.is_attached and again.fields[0].name == "confidence"
    hand.click("Save rigged…")
    hand.state.of(Files).dialog.enter(tmp_path)
    hand.step(2)
    hand.key("a", "ctrl")
    hand.type("arm2.skel")
    hand.step()
    hand.click("Save###Save")
    hand.finish_job()
    found = sorted(path.name for path in tmp_path.glob("arm2.*"))
    assert found == ["arm2.json", "arm2.obj", "arm2.skel", "arm2.skin"]
    hand.click("Save rigged…")
    hand.state.of(Files).dialog.enter(tmp_path)
    hand.step(2)
    hand.key("a", "ctrl")
    hand.type("arm3.fbx")
    hand.step()
    hand.click("Save###Save")
    hand.finish_job()
    assert hand.state.error.startswith('a rigged mesh cannot be written as ".fbx"; supported: ')


def test_report_is_copied(rigging, texts):
    hand = rigging()
    hand.click("Run")
    hand.finish_job()
    lines = [line.labelled for line in hand.state.of(Rigging).results["robust"].rigged.lines]
    hand.click("Copy report")
    assert imgui.get_clipboard_text() == "\n".join(lines)
    texts.clear()
    hand.step()
    assert set(lines) <= set(texts)


def test_target_that_does_not_overlap_the_template_shows_a_message(drive):
    figure, pose = rig_scene.bent()
    mesh = rig_scene.scan(figure, pose).mesh
    flat = viewer.Mesh(np.zeros((3, 3)), np.tile([0.0, 1, 0], (3, 1)), np.array([[0, 1, 2]]))
    assert mesh.n_triangles
    hand = drive(
        scene=Scene([Actor(viewer.Figure("point", flat)), Actor(figure, pose)]),
        size=SIZE, samples=1,
    )  # fmt: skip
    hand.menu("menu Window", "Rig")
    hand.click("Run")
    hand.finish_job()
    assert hand.state.error != "" and names(hand) == ["point", "arm"]


def test_frames_of_a_moving_mesh_become_bones(rigging, tmp_path):
    """Two boxes, of which the second one turns by 10 degrees a frame about the edge between."""
    mesh = joined(box([0, 0, 0], [2, 1, 1], (2, 2, 2)), box([2, 0, 0], [4, 1, 1], (2, 2, 2)))
    is_second = np.arange(mesh.n_vertices) >= mesh.n_vertices // 2
    faces = "".join(f"f {a} {b} {c}\n" for a, b, c in (mesh.triangles + 1).tolist())
    frames, paths = [], []
    for number in range(5):
        points = mesh.positions.copy()
        edge = np.array([2.0, 0.0, 0.0])
        points[is_second] = (points[is_second] - edge) @ turn([0, 0, 1], 0.17 * number).T + edge
        frames.append(points)
        paths.append(tmp_path / f"frame_{number}.obj")
        paths[-1].write_text("".join("v {} {} {}\n".format(*each) for each in points) + faces)
    hand = rigging()
    hand.click("Add mesh…")
    hand.step(2)
    dialog = hand.state.of(Files).dialog
    assert not dialog.is_single
    hand.state.of(Rigging).choices.bones = 2
    dialog.done(hand.state, paths)
    hand.state.of(Files).dialog = None
    hand.finish_job()
    actor = hand.state.scene.actors[-1]
    assert hand.state.actor is actor and actor.name == "frame"
    assert actor.figure.skeleton.n_joints in (2, 3)  # the boxes share no vertices
    assert hand.says("error of the skinned mesh: RMS")
    hand.state.clock.playing = False
    for number in (0, 3, 4):
        hand.state.clock.seek(number / actor.clip.frame_rate)
        hand.step(2)
        assert_allclose(deform(actor.figure, actor.pose)[0], frames[number], atol=1e-4)
    assert [edit.text for edit in unsaved_edits(hand.state)] == ["frame: motion"]
    dialog.done(hand.state, [paths[0], tmp_path / "skin.png"])
    hand.finish_job()
    assert "skin.png: expected frames of one mesh, .obj or .ply" in hand.state.error


def test_archives_of_a_moving_mesh_become_bones(rigging, tmp_path):
    positions, faces = two_boxes()
    whole, apart = tmp_path / "whole.npz", tmp_path / "apart.npy"
    np.savez(whole, vertices=positions, faces=faces)
    np.save(apart, positions)
    (mesh,) = write_frames(tmp_path, "box", positions[:1], faces)
    hand = rigging()
    hand.click("Add mesh…")
    hand.step(2)
    dialog = hand.state.of(Files).dialog
    assert {".npz", ".npy", ".obj"} <= {*dialog.suffixes}
    hand.state.of(Files).dialog = None
    hand.state.of(Rigging).choices.bones = 2
    for paths, name in (([whole], "whole"), ([mesh, apart], "box_1")):
        dialog.done(hand.state, paths)
        hand.finish_job()
        actor = hand.state.scene.actors[-1]
        assert actor.name == name and actor.figure.skeleton.n_joints in (2, 3)
        hand.state.clock.playing = False
        hand.state.clock.seek(2 / actor.clip.frame_rate)
        hand.step(2)
        assert_allclose(deform(actor.figure, actor.pose)[0], positions[2], atol=1e-4)
    still = tmp_path / "still.npz"
    np.savez(still, vertices=positions[0])
    dialog.done(hand.state, [still])
    hand.finish_job()
    assert "still.npz" in hand.state.error and hand.state.scene.actors[-1] is actor
