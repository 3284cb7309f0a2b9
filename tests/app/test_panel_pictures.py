"""Golden images of the interface, compared coarsely because text differs between machines.

``make golden NAME…`` re-renders them; review them before committing.
"""

from pathlib import Path

import numpy as np
import pytest
from app.retargeting.driven import driven_scene
from formats.vrm.swinging import swinging
from PIL import Image, ImageFilter
from stored_pictures import GOLDEN, is_redrawn

from viewer.app.core.jobs import FrameJob
from viewer.app.curves.editing import new_clip
from viewer.app.files.file_choice import FileDialog
from viewer.app.files.files import Files
from viewer.app.layout import Layout, ShownPanels
from viewer.app.linting.lint_panel import Linting, check_rig
from viewer.app.posing.posing import Posing
from viewer.app.retargeting.drive_changes import toggle_hands
from viewer.app.weights.weights_panel import pin_vertex
from viewer.progress import report

SIZE = (560, 420)
BODY_SIZE = (760, 680)
MOST_MEAN, MOST_LOCAL = 3.0, 40.0  # of 255, after a blur that removes text and hinting


def _nothing(hand):
    pass


def _skeleton(hand):
    hand.state.options.show = "both"
    hand.state.selected_joint = 1


def _lights(hand):
    # The tab is not visible in such a narrow window.
    hand.state.of(Layout).fronts.append("Lights")
    hand.step(3)


def _keys(hand):
    hand.key("tab")
    hand.key("h")


def _message(hand):
    hand.state.error = "tube.skin:41: expected 3 numbers, found 2"


def _dialog(hand):
    dialog = FileDialog(hand.state.paths[0].parent)
    # The text is replaced before the path field is focused, because a focused field keeps its text.
    dialog.folder = Path("/figures")
    hand.state.of(Files).dialog = dialog


def _lint(hand):
    check_rig(hand.state)
    hand.state.of(Linting).running.job.wait()
    hand.step(3)
    hand.click("finding 0")


def _unsaved(hand):
    new_clip(hand.state)
    hand.step(2)
    hand.key("q", "ctrl")


def _unfinished(hand):
    def steps():
        while True:
            report(3, 12)
            yield

    hand.state.job = FrameJob("Recording walk.mp4", steps(), "recording")
    hand.key("q", "ctrl")


STATES = {
    "start": _nothing,
    "skeleton": _skeleton,
    "lights": _lights,
    "keys": _keys,
    "message": _message,
    "dialog": _dialog,
    "lint": _lint,
    "unsaved": _unsaved,
    "unfinished": _unfinished,
}


def _shape(hand):
    hand.show_panel("Shape")
    pose = hand.state.actor.pose
    pose.shape_weights[[0, 1, 2, 10]] = 1.0, -2.0, 2.5, -5.0
    pose.dofs[hand.dof_index("neck.y")] = 0.5
    hand.state.of(Posing).shape_seed = 7


def _skinning(hand):
    hand.show_panel("Skinning")
    pose, options = hand.state.actor.pose, hand.state.options
    for number, joint in enumerate(("left_hip", "spine1", "left_shoulder")):
        pose.dofs[hand.dof_index(f"{joint}.z")] = 0.4 - 0.3 * number
    options.skinning.max_influences = 2
    options.shading, options.scalar = "scalar", "pruning"


def _weights(hand):
    hand.show_panel("Weights")
    pose, options = hand.state.actor.pose, hand.state.options
    pose.dofs[hand.dof_index("left_hip.z")] = 0.4
    options.shading, options.scalar, options.scalar_range = "scalar", "stretch", (-50.0, 50.0)


def _vertex(hand):
    for number, joint in enumerate(("left_hip", "spine1", "left_shoulder")):
        hand.state.actor.pose.dofs[hand.dof_index(f"{joint}.z")] = 0.4 - 0.3 * number
    hand.state.options.xray = True
    pin_vertex(hand.state, 0, int(np.diff(hand.state.actor.figure.skin.starts).argmax()))


def _vectors(hand):
    hand.click("Rotation vectors")
    pose = hand.state.actor.pose
    pose.dofs[hand.dof_index("joint_1.x")], pose.dofs[hand.dof_index("joint_1.z")] = 0.0, -0.3
    pose.figure_translation[1] = 0.5


BODIES = {
    "shape": ("flame", _shape),
    "skinning": ("smpl", _skinning),
    "vectors": ("box", _vectors),
    "weights": ("smpl", _weights),
    "vertex": ("smpl", _vertex),
}


def _coarse(pixels):
    picture = Image.fromarray(pixels).filter(ImageFilter.GaussianBlur(4))
    return np.asarray(picture.reduce(4), dtype=float)


def _difference(first, second):
    gap = np.abs(_coarse(first) - _coarse(second))
    return gap.mean(), gap.max()


def _is_like(first, second):
    mean, local = _difference(first, second)
    return mean <= MOST_MEAN and local <= MOST_LOCAL


def _shown(hand, prepare):
    prepare(hand)
    hand.step(3)
    hand.state.messages.notes.clear()
    hand.state.stats.renderer = hand.state.stats.version = "driver"
    hand.key("f")
    hand.state.messages.notes.clear()
    return hand.screen()


@pytest.mark.golden("app_{name}")
@pytest.mark.parametrize("name", STATES)
def test_interface_matches_golden_images(drive, rig, name):
    _compare(_shown(drive(*rig, size=SIZE, samples=4, pixels_per_point=1.0), STATES[name]), name)


@pytest.mark.golden("app_{name}")
@pytest.mark.parametrize("name", BODIES)
def test_body_panels_match_golden_images(drive_body, name):
    kind, prepare = BODIES[name]
    hand = drive_body(kind, size=BODY_SIZE, pixels_per_point=1.0)
    hand.state.of(ShownPanels).closed.add("stats")  # the displayed times differ between runs
    hand.step(2)
    _compare(_shown(hand, prepare), name)


@pytest.mark.golden("app_facts")
def test_facts_of_a_file_match_their_golden_image(drive, tmp_path):
    (tmp_path / "ada.vrm").write_bytes(swinging().glb())
    hand = drive(tmp_path / "ada.vrm", size=BODY_SIZE, samples=4, pixels_per_point=1.0)
    hand.state.of(ShownPanels).closed |= {"display", "skinning", "weights", "camera", "lights"}
    hand.state.of(ShownPanels).closed |= {"joints", "shape", "parts", "timeline", "curves"}

    def prepare(hand):
        hand.state.stats.frame_ms = 0.0

    _compare(_shown(hand, prepare), "facts")


@pytest.mark.golden("app_joint_match")
def test_joint_match_panel_matches_its_golden_image(drive):
    hand = drive(scene=driven_scene(), size=BODY_SIZE, samples=4, pixels_per_point=1.0)
    hand.state.of(ShownPanels).closed.add("stats")

    def prepare(hand):
        hand.show_panel("Joint match")
        hand.step(3)
        hand.move("joint left_hip")

    _compare(_shown(hand, prepare), "joint_match")


@pytest.mark.golden("app_actors")
def test_actors_panel_of_a_driven_figure_matches_its_golden_image(drive):
    hand = drive(scene=driven_scene(), size=BODY_SIZE, samples=4, pixels_per_point=1.0)
    hand.state.of(ShownPanels).closed |= {"stats", "display", "skinning", "weights", "camera"}

    def prepare(hand):
        hand.state.of(Layout).fronts.append("Actors")
        toggle_hands(hand.state)

    _compare(_shown(hand, prepare), "actors")


def _compare(pixels, name):
    path = GOLDEN / f"app_{name}.png"
    if is_redrawn(path.stem):
        Image.fromarray(pixels).save(path)
    assert path.is_file(), f"{path} is missing: draw it with make golden {path.stem}"
    with Image.open(path) as golden:
        wanted = np.array(golden.convert("RGB"))
    assert _is_like(pixels, wanted), _difference(pixels, wanted)


def test_comparison_detects_a_different_state(drive, rig):
    hand = drive(*rig, size=SIZE, samples=4, pixels_per_point=1.0)
    start = _shown(hand, _nothing)
    hand.state.panels_visible = False
    without_panel = hand.screen()
    hand.state.panels_visible = True
    hand.state.options.show = "skeleton"
    without_skin = hand.screen()
    assert _is_like(start, start)
    assert not _is_like(start, without_panel)
    assert not _is_like(start, without_skin)
    assert not _is_like(start, _shown(hand, _message))
