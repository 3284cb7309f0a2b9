"""Format of an export: each with what it keeps; the name follows the choice."""

from __future__ import annotations

from viewer.app.files import export_formats
from viewer.app.files.state import Files


def test_chosen_format_changes_the_suffix_of_the_name(hand, monkeypatch):
    hand.menu("menu File", "Export…")
    dialog = hand.state.of(Files).dialog
    hand.key("a", "ctrl")
    hand.type("my.figure.obj")
    hand.click("Folder")
    offered = {}

    def choose(state, label, value, texts):
        offered.update(texts)
        return ".ply"

    # The list of a dialog opens upwards, where tests cannot aim.
    monkeypatch.setattr(export_formats, "choice", choose)
    hand.step(2)
    assert dialog.name == "my.figure.ply"
    assert "posed mesh" in offered[".ply"] and ".bvh" not in offered
