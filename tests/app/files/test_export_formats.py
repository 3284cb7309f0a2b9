"""Export formats: the properties that each keeps or omits, and the suffix of the file name."""

from viewer.app.files.files import Files
from viewer.app.files.motion_export import FOLDER, motion_formats, pose_formats, unsuited_formats


def test_chosen_format_changes_the_suffix_of_the_name(hand):
    hand.menu("menu File", "Export…")
    hand.key("a", "ctrl")
    hand.type("my.figure.obj")
    hand.click("format .ply")
    assert hand.state.of(Files).dialog.name == "my.figure.ply"
    assert "format .bvh" not in hand.state.item_rects


def test_export_of_a_pose_omits_the_motion_and_that_of_a_motion_keeps_it(curves):
    posed, moving = pose_formats()[".glb"], motion_formats(curves.state.actor)[".glb"]
    assert "motion" not in posed.title + posed.keeps and posed.omits.startswith("motion, ")
    assert moving.keeps == f"{posed.keeps}, motion" and "motion" not in moving.omits


def test_format_that_cannot_store_the_motion_states_the_reason(curves):
    state = curves.state
    assert "SMPL" in unsuited_formats(state.actor)[FOLDER]
    assert set(motion_formats(state.actor)) > {FOLDER, ".bvh", ".glb", ".anim"}
