"""Section "Edit skeleton": joints placed, dragged, removed and mirrored in the view."""

import threading
from dataclasses import replace

import numpy as np
import pytest
from autorig.rigged_shapes import arm
from autorig.test_binding import box, joined
from numpy.testing import assert_allclose

import viewer
from viewer.app.closing import unsaved_edits
from viewer.app.core.view_frame import view_frame
from viewer.app.posing.posing import save_export
from viewer.app.rigging.joint_editing.state import JointEditing
from viewer.app.rigging.rigging import Rigging
from viewer.autorig.alignment.surface_alignment import AlignmentSettings
from viewer.autorig.pipeline import transfer
from viewer.autorig.settings import TransferSettings
from viewer.progress import report
from viewer.rigs.figure import Figure
from viewer.rigs.joint_edits import moved, rest_worlds
from viewer.rigs.pose import rest_pose
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skinning import deform

FAR = np.array([300.0, -200.0, 50.0])
HALF = np.array([4.0, 0.5, 1.0])
VOXEL = 8.0 / 96  # of the bar
# Clicks are at whole positions of the pointer, and the middle is found in steps of the ray.
ATOL = 0.6 * VOXEL

BY_HEAT = TransferSettings("heat", AlignmentSettings(matrix=np.eye(4)))


NOD = """HIERARCHY
ROOT base
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT tip
  {
    OFFSET 0 1 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 1 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.04
0 0 0 0 0 0 0 0 0
0 0 0 0 0 0 30 0 0
"""


def bar():
    """Return a bar of 8 x 1 x 2 along x, far from the origin; its middle is at ``FAR``."""
    return Figure("bar", joined(box(FAR - HALF, FAR + HALF, (16, 2, 2))))


def opened(drive, *figures, start="root", **choices):
    """Return a test driver that edits the first figure, seen along -z without perspective."""
    hand = drive(scene=Scene([Actor(figure) for figure in figures]), size=(1000, 900))
    hand.menu("menu Window", "Rig")
    hand.step(2)
    hand.state.of(JointEditing).start = start
    rigging = hand.state.of(Rigging)
    rigging.choices = replace(rigging.choices, **choices)
    hand.click("Edit skeleton")
    hand.finish_job()
    for key in ("_1", "_5", "f"):
        hand.key(key)
    return hand


def figure(hand):
    return hand.state.scene.actors[0].figure


def names(hand):
    return figure(hand).skeleton.names


def joints(hand):
    return rest_worlds(figure(hand))[:, :3, 3] - FAR


def seen(hand, *point):
    """Return where a point, relative to the middle of the bar, is in the window."""
    return view_frame(hand.state).place(np.array(point) + FAR)


def click(hand, *point):
    hand.click(seen(hand, *point))
    hand.finish_job()


def pull(hand, start, end, held=""):
    hand.pull(seen(hand, *start), seen(hand, *end), held=held)
    hand.step(2)
    hand.finish_job()


def strongest(hand):
    """Return the joint with the largest weight at each vertex."""
    skin = figure(hand).skin
    rows = [slice(*pair) for pair in zip(skin.starts[:-1], skin.starts[1:], strict=True)]
    return np.array([skin.joints[row][skin.weights[row].argmax()] for row in rows])


def undo(hand, held="ctrl"):
    hand.key("z", held)
    hand.step(2)


def test_joints_are_placed_in_the_middle_and_weights_follow_a_drag(drive, tmp_path):
    hand = opened(drive, bar())
    assert names(hand) == ("root",)
    assert_allclose(joints(hand)[0][1:], 0.0, atol=ATOL)  # the solid is as wide everywhere along x
    pull(hand, joints(hand)[0], (-3.0, 0.0, 0.0))
    click(hand, -1.0, 0.2, 1.0)
    click(hand, 3.0, -0.3, 1.0)
    assert names(hand) == ("root", "joint", "joint_2")
    assert figure(hand).skeleton.parents.tolist() == [-1, 0, 1]
    # The ray along -z enters the bar at z = 1 and leaves it at z = -1.
    assert_allclose(joints(hand)[1:], [[-1, 0.2, 0], [3, -0.3, 0]], atol=ATOL)
    # Bones meet at joint, so it bends the bar there: bones from -3 to -1, and from -1 to 3.
    x = figure(hand).mesh.positions[:, 0] - FAR[0]
    assert (strongest(hand)[x < -1.4] == 0).all() and (strongest(hand)[x > -0.6] != 0).all()
    steps = hand.undo_steps
    pull(hand, joints(hand)[1], (1.5, 0.0, 0.0), held="ctrl")
    assert hand.undo_steps == steps + 1
    assert_allclose(joints(hand)[1], [1.5, 0, 0], atol=ATOL)
    assert_allclose(joints(hand)[2], [3, -0.3, 0], atol=ATOL)  # Ctrl: alone
    assert (strongest(hand)[x < 1.1] == 0).all() and (strongest(hand)[x > 1.9] != 0).all()
    assert_allclose(deform(figure(hand), hand.state.actor.pose)[0][:, 0] - FAR[0], x, atol=1e-9)
    undo(hand)
    hand.finish_job()
    assert (strongest(hand)[x > -0.6] != 0).all()
    undo(hand, "ctrl shift")
    assert (strongest(hand)[x < 1.1] == 0).all()
    assert [edit.text for edit in unsaved_edits(hand.state)] == ["bar: rig"]
    path = tmp_path / "bar.glb"
    save_export(hand.state, path)
    hand.finish_job()
    assert not unsaved_edits(hand.state)
    again = viewer.load(path).actors[0].figure
    assert again.skeleton.names == ("root", "joint", "joint_2")
    assert_allclose(rest_worlds(again)[:, :3, 3] - FAR, joints(hand), atol=1e-4)


def test_weights_follow_while_a_joint_is_dragged(drive):
    hand = opened(drive, bar())
    pull(hand, joints(hand)[0], (-3.0, 0.0, 0.0))
    click(hand, 0.0, 0.0, 1.0)
    before, steps = figure(hand), hand.undo_steps
    x = before.mesh.positions[:, 0] - FAR[0]

    def hold(*places):
        hand.move(seen(hand, *joints(hand)[1]))
        hand.press()
        for place in places:
            hand.move(seen(hand, place, 0.0, 0.0))
            hand.step(2)
            hand.finish_job()
            # The bone from -3 to the joint moves what is beside it.
            assert (strongest(hand)[x < place - 0.4] == 0).all()
            assert (strongest(hand)[x > place + 0.4] == 1).all()
            assert_allclose(joints(hand)[1], [place, 0, 0], atol=ATOL)
        assert hand.undo_steps == steps

    hold(2.0, -1.0)
    hand.key("escape")
    hand.let_go()
    hand.step(2)
    assert figure(hand) is before and hand.undo_steps == steps and not hand.state.job
    hold(1.5)
    hand.let_go()
    hand.step(2)
    assert hand.undo_steps == steps + 1 and not hand.state.job  # bound before the release
    hand.menu("menu Edit", "Undo")
    assert figure(hand).skeleton is before.skeleton and hand.says("Undone: move joint joint")
    undo(hand, "ctrl shift")
    assert_allclose(joints(hand)[1], [1.5, 0, 0], atol=ATOL)
    assert hand.says("Redone: move joint joint")


def test_newest_place_is_bound_where_binding_takes_long(drive, monkeypatch):
    hand = opened(drive, bar())
    gate, bound = threading.Event(), []

    def waiting(template, *arguments):
        bound.append(rest_worlds(template)[0, 0, 3] - FAR[0])
        while not gate.wait(0.005):
            report(1, 2)  # raises once the job is cancelled
        return transfer(template, *arguments)

    monkeypatch.setattr("viewer.app.rigging.joint_editing.binding.transfer", waiting)
    hand.move(seen(hand, *joints(hand)[0]))
    hand.press()
    for place in (1.0, 2.0, 3.0):
        hand.move(seen(hand, place, 0.0, 0.0))
        hand.step(2)
    hand.let_go()
    while len(bound) < 2:
        hand.step()
    gate.set()
    hand.finish_job()
    assert_allclose(bound, [1.0, 3.0], atol=ATOL)  # the second one was never begun
    assert figure(hand) not in hand.state.of(JointEditing).stale


def half_bar(*names):
    """Return a bound bar of half the size, above the other, with a chain of joints from -2 to 2."""
    above = FAR + np.array([0.0, 3.0, 0.0])
    places = np.tile(above, (len(names), 1))
    places[:, 0] += np.linspace(-2.0, 2.0, len(names))
    skeleton = ball_skeleton(names, np.arange(-1, len(names) - 1, dtype=np.int32), places)
    mesh = joined(box(above - 0.5 * HALF, above + 0.5 * HALF, (16, 2, 2)))
    return transfer(Figure("t", None, skeleton), rest_pose(skeleton), mesh, BY_HEAT).figure


@pytest.mark.usefixtures("quick_fits")
def test_other_joints_are_fitted_to_those_placed_by_hand(drive, monkeypatch):
    """The template's joints are at -2, 0 and 2: all scale with two."""
    template = half_bar("root", "middle", "end")
    hand = opened(drive, bar(), template, start="template", fits=False, facing="z")
    assert names(hand) == ("root", "middle", "end")
    assert hand.state.of(JointEditing).fit is not None
    hand.click("Fit the other joints")
    assert not hand.state.job  # no joint was moved yet
    hand.state.of(JointEditing).choices.weights = "keep"
    assert_allclose(joints(hand), [[-4, 0, 0], [0, 0, 0], [4, 0, 0]], atol=1e-3)
    pull(hand, joints(hand)[0], (-3.0, 0.0, 0.0), held="ctrl")
    pull(hand, joints(hand)[2], (3.4, 0.1, 0.0), held="ctrl")
    pull(hand, joints(hand)[1], (0.2, 0.3, 0.0), held="ctrl")
    undo(hand)  # no longer placed by hand
    steps, kept = hand.undo_steps, {}

    def fitted(_template, mesh, places, held):
        kept.update({name: places[name] for name in held})
        return {"root": FAR, "middle": FAR + np.array([0.5, 0.25, 0.0]), "end": FAR}

    monkeypatch.setattr("viewer.app.rigging.joint_editing.section.fit_again", fitted)
    hand.click("Fit the other joints")
    hand.finish_job()
    assert set(kept) == {"root", "end"}
    assert_allclose(joints(hand), [[-3, 0, 0], [0.5, 0.25, 0], [3.4, 0.1, 0]], atol=2 * ATOL)
    assert_allclose([kept["root"], kept["end"]], joints(hand)[[0, 2]] + FAR, atol=1e-9)
    assert hand.undo_steps == steps + 1
    undo(hand)
    assert hand.says("Undone: fit the other joints")


@pytest.mark.usefixtures("quick_fits")
def test_fit_bends_an_arm_where_it_bent_and_moves_the_hand_along(drive, monkeypatch):
    """An arm from -4 over -4/3 to 4/3: its upper part is half of it, and stays so."""
    arm = ("left_shoulder", "left_elbow", "left_wrist", "left_index1")
    hand = opened(drive, bar(), half_bar(*arm), start="template", fits=False, facing="z")
    hand.state.of(JointEditing).choices.weights = "keep"
    pull(hand, joints(hand)[2], (2.0, 0.2, 0.0), held="ctrl")

    def fitted(*_):
        places = [[-3.6, 0, 0], [1, 0.4, 0], [1.5, 0.1, 0], [3.5, -0.1, 0.1]]  # misses the wrist
        return dict(zip(arm, np.array(places) + FAR, strict=True))

    monkeypatch.setattr("viewer.app.rigging.joint_editing.section.fit_again", fitted)
    hand.click("Fit the other joints")
    hand.finish_job()
    shoulder, elbow, wrist, finger = joints(hand)
    assert_allclose([shoulder, wrist], [[-3.6, 0, 0], [2, 0.2, 0]], atol=2 * ATOL)
    assert_allclose(elbow, 0.5 * (shoulder + wrist), atol=2e-3)
    assert_allclose(finger - wrist, [8 / 3, 0, 0], atol=2e-3)


@pytest.mark.usefixtures("quick_fits")
@pytest.mark.parametrize(
    ("leave", "why"),
    [
        (lambda hand: hand.click("Done###edit done"), "Edit skeleton was turned off"),
        (lambda hand: hand.menu("menu Edit", "Undo"), "the joints were edited"),
    ],
)
def test_fit_that_comes_too_late_changes_nothing_and_says_why(drive, monkeypatch, leave, why):
    hand = opened(drive, bar(), half_bar("root", "end"), start="template", fits=False, facing="z")
    hand.state.of(JointEditing).choices.weights = "keep"
    pull(hand, joints(hand)[1], (2.0, 0.2, 0.0), held="ctrl")
    gate = threading.Event()

    def fitted(*_):
        assert gate.wait(60)
        return {"root": FAR, "end": FAR}

    monkeypatch.setattr("viewer.app.rigging.joint_editing.section.fit_again", fitted)
    hand.click("Fit the other joints")
    leave(hand)
    left = figure(hand)
    gate.set()
    hand.finish_job()
    assert figure(hand) is left and hand.says(f"Not fitted: {why} meanwhile")


def test_drag_says_so_when_other_joints_end_it(drive):
    hand = opened(drive, bar())
    before = joints(hand)
    start = seen(hand, *before[0])
    hand.move(start)
    hand.press()
    hand.move((start[0] + 40, start[1]))
    actor = hand.state.scene.actors[0]
    actor.figure = moved(actor.figure, {0: FAR + np.array([2.0, 0.0, 0.0])})
    hand.move((start[0] + 80, start[1]))
    assert hand.says("Drag cancelled: the joints were changed meanwhile")
    hand.let_go()
    hand.step(2)
    assert_allclose(joints(hand), [[2, 0, 0]], atol=1e-9)


def test_symmetric_edits_mirroring_and_removal(drive):
    hand = opened(drive, bar())
    editing = hand.state.of(JointEditing)
    editing.choices.symmetric = True
    middle = joints(hand)[0]
    pull(hand, middle, (1.0, 0.0, 0.0))
    assert_allclose(joints(hand)[0], [0, 0, 0], atol=ATOL)  # stays in the plane x = 0
    click(hand, 2.0, 0.0, 1.0)
    assert names(hand) == ("root", "joint_right", "joint_left")  # left is +x of one that faces +z
    assert_allclose(joints(hand)[1:], [[-2, 0, 0], [2, 0, 0]], atol=2 * ATOL)
    pull(hand, joints(hand)[1], (-3.0, 0.25, 0.0))
    assert_allclose(joints(hand)[1:], [[-3, 0.25, 0], [3, 0.25, 0]], atol=2 * ATOL)
    editing.choices.symmetric = False
    hand.state.selected_joint = 2
    click(hand, 3.7, 0.0, 1.0)
    hand.state.selected_joint = 2
    hand.key("m")
    hand.finish_job()
    assert names(hand)[1:] == ("joint_right", "joint_left", "joint_2_left", "joint_2_right")
    assert figure(hand).skeleton.parents.tolist() == [-1, 0, 0, 2, 1]
    assert_allclose(joints(hand)[4], joints(hand)[3] * [-1, 1, 1], atol=2 * ATOL)
    before = figure(hand)
    hand.state.selected_joint = 2
    hand.key("delete")
    hand.finish_job()
    assert figure(hand).skeleton.parents.tolist() == [-1, 0, 0, 1]
    undo(hand)
    assert figure(hand) is before
    hand.state.selected_joint = 0
    hand.key("delete")
    assert hand.says("root is a root with 2 joints below it")
    steps = hand.undo_steps
    hand.click(seen(hand, 0.0, 1.5, 0.0))
    assert hand.says("click on the mesh") and hand.undo_steps == steps


def test_cancelled_binding_and_drags_leave_the_figure(drive, monkeypatch):
    hand = opened(drive, bar())
    editing, before = hand.state.of(JointEditing), figure(hand)
    start = seen(hand, *joints(hand)[0])
    hand.move(start)
    hand.press()
    hand.move((start[0] + 40, start[1]))
    hand.key("escape")
    hand.let_go()
    hand.step(2)
    assert figure(hand) is before and hand.says("Drag cancelled")
    hand.finish_job()  # the cancelled binding of the drag
    gate = threading.Event()

    def waiting(*arguments):
        while not gate.wait(0.005):
            report(1, 2)  # raises once the job is cancelled
        return transfer(*arguments)

    monkeypatch.setattr("viewer.app.rigging.joint_editing.binding.transfer", waiting)
    hand.click(seen(hand, 2.0, 0.0, 1.0))
    hand.step(2)
    assert hand.state.job is not None
    hand.key("escape")
    hand.finish_job()
    gate.set()
    assert figure(hand) in editing.stale and editing.refused is figure(hand)
    assert not hand.state.job and (figure(hand).skin.joints == 0).all()
    hand.step()
    hand.click("Bind now")
    hand.step()
    hand.finish_job()
    assert (figure(hand).skin.joints == 1).any()
    hand.key("escape")
    assert not editing.is_on
    undo(hand)
    undo(hand)
    assert figure(hand).skeleton is None and hand.state.actor.own_pose is None


def test_own_joints_of_a_bound_figure_keep_their_weights(drive):
    template = arm()
    shown = deform(template, rest_pose(template.skeleton))[0]
    other = Figure("other", joined(box([2.0, 0.0, -1.0], [3.0, 2.0, 1.0], (2, 2, 2))))
    hand = opened(drive, template, other, start="own")
    editing = hand.state.of(JointEditing)
    editing.choices.weights = "keep"
    frame, center = view_frame(hand.state), rest_worlds(template)[1, :3, 3]
    goal = center + np.array([0.0, 0.4, 0.0])
    hand.pull(frame.place(center), frame.place(goal))
    hand.step(2)
    moved = figure(hand)
    assert not hand.state.job
    assert_allclose(rest_worlds(moved)[1, :3, 3], goal, atol=2e-3)
    assert (moved.skin.weights == template.skin.weights).all()
    assert_allclose(deform(moved, hand.state.actor.pose)[0], shown, atol=1e-9)
    hand.state.actor.pose.dofs[-1] = 0.5
    hand.step(2)
    assert not editing.is_on and hand.says("Edit skeleton is off")
    assert hand.state.scene.actors[1].figure is other


def test_motions_that_are_opened_drive_the_edited_rig(drive, tmp_path):
    hand = opened(drive, arm(), start="own")
    hand.state.of(JointEditing).choices.weights = "keep"
    frame, center = view_frame(hand.state), rest_worlds(arm())[1, :3, 3]
    hand.pull(frame.place(center), frame.place(center + np.array([0.0, 0.4, 0.0])))
    hand.step(2)
    edited, motion = figure(hand), tmp_path / "nod.bvh"
    motion.write_text(NOD)
    # No file contains the rig: it is not lost, so no question is asked, until the window is closed.
    for _ in range(2):
        before = hand.state.scene
        hand.open(motion)
        (actor,) = hand.state.scene.actors
        assert hand.state.scene is not before
        assert actor.drive is not None and actor.figure is edited
        assert hand.state.paths == (motion,)  # of the motion before, no file is left
        assert [one.text for one in unsaved_edits(hand.state)] == ["arm: rig"]
    save_export(hand.state, tmp_path / "arm.glb")
    hand.finish_job()
    assert unsaved_edits(hand.state) == []
    hand.open(motion)
    (actor,) = hand.state.scene.actors
    assert hand.state.paths == (tmp_path / "arm.glb", motion) and actor.drive is not None
    assert_allclose(rest_worlds(actor.figure), rest_worlds(edited), atol=1e-6)


def test_figure_without_a_mesh_has_nothing_to_edit(drive):
    hand = opened(drive, Figure("joints", skeleton=arm().skeleton), start="own")
    assert not hand.state.of(JointEditing).is_on and hand.state.job is None
