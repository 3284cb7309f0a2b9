"""Files kept between runs: whatever a crash or a bad disk leaves in them, the program starts."""

import json

import numpy as np
import pytest

from viewer.app.files.recent import (
    load_arranged,
    load_closed_panels,
    load_layout,
    load_recent,
    remember,
    save_arranged,
    save_closed_panels,
    save_layout,
    state_folder,
)
from viewer.app.preferences.preferences import (
    Preferences,
    load_preferences,
    preferences_file,
    save_preferences,
)
from viewer.media.state_files import checked

# As ImGui writes it; the ids of docks must fit together.
LAYOUT = """\
[Window][Joints]
Pos=0,19
Size=281,661
Collapsed=0
DockId=0x00000003,0

[Docking][Data]
DockSpace     ID=0x07D2A9F3 Window=0x079D3A04 Pos=0,19 Size=1280,781 Split=Y
  DockNode    ID=0x00000001 Parent=0x07D2A9F3 SizeRef=1280,661 Split=X
    DockNode  ID=0x00000003 Parent=0x00000001 SizeRef=281,661 Selected=0xEDA48C43
    DockNode  ID=0x00000004 Parent=0x00000001 SizeRef=997,661 CentralNode=1
  DockNode    ID=0x00000002 Parent=0x07D2A9F3 SizeRef=1280,120 Selected=0x0F18B61B

"""


def set_aside(path, load, usual):
    """Load a damaged file; check that it is said and set aside, and that the default is used."""
    damaged, said = path.read_bytes(), []
    assert load(said.append) == usual
    aside = path.with_name(f"{path.name}.bad")
    assert said == [f"{path} was damaged: it is now called {aside.name}, and the defaults are used"]
    assert not path.exists() and aside.read_bytes() == damaged
    said.clear()
    assert load(said.append) == usual and said == []


def test_layout_is_restored_exactly():
    said = []
    assert load_layout(said.append) == "" and save_layout(LAYOUT) == ""
    assert load_layout(said.append) == LAYOUT and said == []


def test_layout_is_read_by_imgui_with_its_checksum(hand):
    from imgui_bundle import imgui

    save_layout("[Window][Elsewhere]\nPos=3,4\nSize=50,60\nCollapsed=0\n\n")
    imgui.load_ini_settings_from_memory((state_folder() / "layout.ini").read_text())
    assert "[Window][Elsewhere]" in imgui.save_ini_settings_to_memory()


def test_layout_cut_or_changed_anywhere_is_not_given_to_imgui():
    save_layout(LAYOUT)
    path = state_folder() / "layout.ini"
    whole, rng = path.read_bytes(), np.random.default_rng(28)
    cut = [whole[:end] for end in range(len(whole))]
    places = rng.integers(0, len(whole), 500)
    bits = 1 << rng.integers(0, 8, 500)
    flipped = [
        whole[:at] + bytes([whole[at] ^ bit]) + whole[at + 1 :]
        for at, bit in zip(places.tolist(), bits.tolist(), strict=True)
    ]
    longer = [whole + b"\n", whole + whole, LAYOUT.encode(), b"\xff" * 99]
    for data in (*cut, *flipped, *longer):
        with pytest.raises(ValueError, match=r"written|decode"):
            checked(data)
    path.write_bytes(cut[-1])
    set_aside(path, load_layout, "")


def test_layout_of_an_earlier_version_has_no_checksum_and_is_used():
    state_folder().mkdir(parents=True)
    path, said = state_folder() / "layout.ini", []
    path.write_text(LAYOUT)
    assert load_layout(said.append) == LAYOUT and said == []
    for end in range(1, len(LAYOUT) - 1):  # the last line may be empty or not
        path.write_text(LAYOUT[:end])
        set_aside(path, load_layout, "")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("ID=0x00000004", "ID=0x00000003"),  # a dock twice
        ("Parent=0x00000001", "Parent=0x00000002"),  # a child of a dock that comes later
        (" Split=X", ""),  # children of a dock that is not split
        ("Selected=0x0F18B61B", "Split=X"),  # a split dock without children
        (" CentralNode=1", ""),  # no dock for the view
        ("Split=X", "Split=X CentralNode=1"),  # the view in a dock with children
        ("SizeRef=281,661", "SizeRef=2e9,661"),
        ("Collapsed=0", "Collapsed"),
        ("[Docking][Data]", "[Docking]"),
    ],
)
def test_layout_whose_docks_do_not_fit_together_is_set_aside(old, new):
    state_folder().mkdir(parents=True)
    path = state_folder() / "layout.ini"
    assert LAYOUT.replace(old, new) != LAYOUT
    path.write_text(LAYOUT.replace(old, new))
    set_aside(path, load_layout, "")


@pytest.mark.parametrize(
    ("name", "load", "usual", "valid"),
    [
        ("recent.json", load_recent, [], '[["/a.skel", "/a.skin"]]'),
        ("closed.json", load_closed_panels, set(), '["stats"]'),
        ("arranged.json", load_arranged, False, "true"),
    ],
)
def test_damaged_state_is_set_aside(name, load, usual, valid):
    state_folder().mkdir(parents=True)
    path = state_folder() / name
    path.write_text(valid)
    assert load() != usual
    for text in (*(valid[:end] for end in range(len(valid))), "5", "{}", "[7]", '[["\\u0000"]]'):
        path.write_text(text)
        set_aside(path, load, usual)


def test_state_flipped_in_any_byte_is_read_or_set_aside():
    remember([], [state_folder() / "a.skel"])
    save_closed_panels({"stats", "joints"})
    save_arranged(True)
    save_preferences(Preferences(theme="light", keys={"Wireframe": "P"}))
    rng = np.random.default_rng(28)
    files = [(state_folder() / f"{name}.json") for name in ("recent", "closed", "arranged")]
    loads = (load_recent, load_closed_panels, load_arranged, load_preferences)
    for path, load in zip([*files, preferences_file()], loads, strict=True):
        whole = path.read_bytes()
        for at, value in rng.integers(0, (len(whole), 256), (60, 2)).tolist():
            path.write_bytes(whole[:at] + bytes([value]) + whole[at + 1 :])
            said = []
            load(said.append)
            assert path.exists() or len(said) == 1


def test_invalid_preferences_are_named_and_the_file_is_kept():
    save_preferences(Preferences(theme="light"))
    stored = json.loads(preferences_file().read_text())
    preferences_file().write_text(json.dumps(stored | {"samples": 3, "up": "w", "new": 1}))
    said = []
    assert load_preferences(said.append) == Preferences(theme="light")
    assert said == [f"{preferences_file()}: invalid values are replaced: samples, up"]
    preferences_file().write_text("{")
    set_aside(preferences_file(), load_preferences, Preferences())


def test_file_that_cannot_be_read_or_renamed_is_said(tmp_path):
    (state_folder() / "arranged.json").mkdir(parents=True)
    said = []
    assert load_arranged(said.append) is False
    path = state_folder() / "arranged.json"
    assert said == [f"{path}: is not a regular file; the defaults are used"]
    path.rmdir()
    path.write_text("?")
    (state_folder() / "arranged.json.bad" / "full").mkdir(parents=True)
    said.clear()
    assert load_arranged(said.append) is False and path.read_text() == "?"
    assert said[0].startswith(f"{path} is damaged and cannot be renamed (")
