"""Random mouse and keyboard input, which must not raise errors and must keep all values finite.
VIEWER_MONKEY_EVENTS=20000 runs more events.
"""

import json
import os
import random

import numpy as np
import pytest
from app.tiny import SKEL, write_rig
from formats.pig_text import write as write_pig
from formats.synthetic_smpl import model
from imgui_bundle import imgui
from PIL import Image

from viewer.app.files.files import open_files
from viewer.app.posing import posing

KEYS = [
    *"rskwntgfhzyoamcvedqx",
    *("_1", "_3", "_5", "_7", "tab", "escape", "f1", "f12", "enter", "backspace", "delete"),
    *("left_arrow", "right_arrow", "up_arrow", "down_arrow", "space", "keypad5", "page_down"),
]
EVENTS = int(os.environ.get("VIEWER_MONKEY_EVENTS", "2000"))


class Monkey:
    def __init__(self, hand, files, seed):
        self.hand, self.files, self.random = hand, files, random.Random(seed)

    def act(self):
        choose = self.random
        action = choose.choices(
            [self.move, self.button, self.wheel, self.key, self.letter, self.aim, self.drop,
             self.resize, self.frame],
            [30, 25, 8, 14, 6, 12, 1, 1, 20],
        )[0]  # fmt: skip
        action()

    def point(self):
        width, height = self.hand.io.display_size
        return self.random.uniform(-20, width + 20), self.random.uniform(-20, height + 20)

    def move(self):
        self.hand.io.add_mouse_pos_event(*self.point())

    def aim(self):
        rects = self.hand.state.item_rects
        if rects:
            x0, y0, x1, y1 = rects[self.random.choice(sorted(rects))]
            x, y = self.random.uniform(x0, x1), self.random.uniform(y0, y1)
            self.hand.io.add_mouse_pos_event(x, y)
            self.hand.io.add_mouse_button_event(0, True)

    def button(self):
        self.hand.io.add_mouse_button_event(self.random.randrange(3), self.random.random() < 0.4)

    def wheel(self):
        self.hand.io.add_mouse_wheel_event(0.0, self.random.uniform(-6, 6))

    def key(self):
        for name in ("mod_ctrl", "mod_shift"):
            self.hand.io.add_key_event(getattr(imgui.Key, name), self.random.random() < 0.2)
        code = getattr(imgui.Key, self.random.choice(KEYS))
        self.hand.io.add_key_event(code, True)
        self.hand.io.add_key_event(code, False)

    def letter(self):
        self.hand.io.add_input_character(ord(self.random.choice("0123456789.-eEnaif#%{")))

    def drop(self):
        open_files(self.hand.state, self.random.choice(self.files))
        self.hand.wait_for_loader()

    def resize(self):
        sizes = [(900, 640), (420, 300), (60, 500), (1, 1), (900, 640), (640, 480)]
        self.hand.io.display_size = imgui.ImVec2(*self.random.choice(sizes))

    def frame(self):
        self.hand.step()


def _rig_files(folder):
    """Return files to open and to drop: the tiny rig, parts of it, and invalid files."""
    rig = write_rig(folder)
    bad = folder / "bad.skel"
    bad.write_text(SKEL[:100])
    return list(rig), [list(rig), [rig[0]], [rig[1]], [bad], [folder / "missing.skel"], []]


def _body_files(folder):
    """Return files to open and to drop: a body, its poses and textures, and invalid files."""
    body, broken, empty = folder / "smplx.npz", folder / "broken.npz", folder / "empty"
    np.savez(body, **model("smplx"))
    broken.write_bytes(body.read_bytes()[:4000])
    empty.mkdir()
    Image.new("RGB", (8, 8), (200, 90, 10)).save(folder / "skin.jpg")
    texts = {
        "bend.json": '{"dofs": {"left_knee.x": 1.5}, "betas": [1, -2], "scale": 1.2}',
        "hands.json": json.dumps({"left_hand_pose": [0.4] * 6, "use_pca": True}),
        "tail.json": '{"dofs": {"tail.x": 1}}',
        "halved.json": '{"dofs": {"left_knee',
        "numbers.txt": "0.1 " * 165,
        "few.txt": "1 2 3",
        "picture.png": "no picture",
    }
    for name, text in texts.items():
        (folder / name).write_text(text)
    dropped = [body, broken, empty, folder / "skin.jpg", *(folder / name for name in texts)]
    pair = [folder / "skin.jpg", folder / "bend.json"]
    return [body], [*([path] for path in dropped), pair, [write_pig(folder / "pig")], []]


def _keep_inside(folder, monkeypatch):
    """Let dialogs browse any folder, but write only into the given folder."""
    monkeypatch.setenv("HOME", str(folder))
    for module, name in ((posing, "save_pose"), (posing, "save_export")):
        save = getattr(module, name)

        def save_inside(state, path, *how, save=save):
            if path.resolve().is_relative_to(folder.resolve()):
                save(state, path, *how)

        monkeypatch.setattr(module, name, save_inside)


@pytest.mark.parametrize("files", [_rig_files, _body_files], ids=["rig", "body"])
def test_random_input_raises_no_error_and_keeps_values_finite(drive, tmp_path, monkeypatch, files):
    monkeypatch.chdir(tmp_path)
    _keep_inside(tmp_path, monkeypatch)
    opened, dropped = files(tmp_path)
    hand = drive(*opened, size=(640, 480), samples=1)
    monkey = Monkey(hand, dropped, seed=len("skinned"))
    for number in range(EVENTS):
        monkey.act()
        if number % 4 == 0:
            hand.step()
            hand.assert_sane()
        if number % 300 == 299:
            hand.state.panels_visible = True
            hand.io.display_size = imgui.ImVec2(640, 480)
            for picture in tmp_path.glob("*.png"):
                picture.unlink()
    hand.step(5)
    hand.assert_sane()
