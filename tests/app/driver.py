"""Test driver: mouse and keyboard input for a HeadlessApp, aimed by widget labels."""

from pathlib import Path

import numpy as np
from imgui_bundle import imgui

import viewer
from viewer.app.core.jobs import ThreadJob
from viewer.app.core.state import AppState
from viewer.app.files.files import Files, open_files
from viewer.app.headless import HeadlessApp
from viewer.phrases import in_window
from viewer.rendering.camera import facing_camera, fit
from viewer.rendering.gpu.context import thread_graphics
from viewer.rendering.options import DisplayOptions
from viewer.rigs.inspection.front import guess_front
from viewer.rigs.scene import Scene, scene_box, scene_points
from viewer.rigs.skeleton import find_dof

MODIFIERS = {
    "ctrl": imgui.Key.mod_ctrl,
    "shift": imgui.Key.mod_shift,
    "alt": imgui.Key.mod_alt,
}


def make_state(scene: Scene, paths=(), samples=1) -> AppState:
    """Return the state that the window starts with."""
    camera = facing_camera(guess_front(scene), scene.up)
    fit(camera, scene_points(scene), 1.0)
    files = tuple(map(Path, paths))
    options = DisplayOptions(samples=samples)
    with in_window():
        return AppState(scene, camera, options, scene_box(scene), files)


class Driver:
    """A driver that moves the mouse and presses keys, with one frame for each event.

    Parameters
    ----------
    paths : str or Path
        Files to open; the bundled figure if none.
    size, scale
        As for ``HeadlessApp``.
    pixels_per_point : float
        As for ``HeadlessApp``; by default pictures have a sixteenth of the pixels.
    samples : int
        Samples per pixel; 4, as in the window, takes ten times as long without a graphics card.
    scene : Scene, optional
        Shown in place of files.
    layout : str
        Panel layout as saved by ImGui.
    """

    def __init__(
        self,
        *paths,
        size=(1000, 640),
        scale=1.0,
        pixels_per_point=0.25,
        samples=1,
        scene=None,
        layout="",
    ):
        scene = scene or viewer.load(*paths)
        self.state = make_state(scene, paths, samples)
        # All apps that need OpenGL share one context and one set of programs.
        graphics = thread_graphics()
        self.app = HeadlessApp(
            self.state, size, scale=scale, pixels_per_point=pixels_per_point, graphics=graphics
        )
        # Slow frames of a moving scene have no shadows: a busy machine would draw other pictures.
        self.app.frame.pace.measured = lambda step, seconds: None
        self.io = imgui.get_io()
        # Clicks of a test follow each other quickly; only ``double_click`` is meant as a double
        # click.
        self.io.mouse_double_click_time = 1e-4
        self._is_open = True
        imgui.load_ini_settings_from_memory(layout)
        try:
            self.step(3)
        except BaseException:
            # An app that stays open makes all later tests fail.
            self.close()
            raise

    def step(self, frames=1):
        self.app.step(frames)

    def close(self):
        if self._is_open:
            self._is_open = False
            self.app.release()

    # Mouse

    def place(self, target, across=0.5, down=0.5):
        """Return a given point, or a point in the widget with the given label."""
        if not isinstance(target, str):
            return target
        x0, y0, x1, y1 = self.state.item_rects[target]
        return x0 + across * (x1 - x0), y0 + down * (y1 - y0)

    def move(self, target):
        self.io.add_mouse_pos_event(*self.place(target))
        self.step()

    def press(self, button=0):
        self.io.add_mouse_button_event(button, True)
        self.step()

    def let_go(self, button=0):
        self.io.add_mouse_button_event(button, False)
        self.step()

    def click(self, target, button=0, held=""):
        # Check boxes, radio buttons and menus of any width react at their left end.
        self.move(self.place(target, 0.1) if isinstance(target, str) else target)
        with self.holding(held):
            self.press(button)
            self.let_go(button)
        self.step()

    def double_click(self, target):
        self.move(target)
        self.io.mouse_double_click_time = 0.3
        for _ in range(2):
            self.press()
            self.let_go()
        self.io.mouse_double_click_time = 1e-4
        self.step(2)

    def pull(self, start, end, button=0, held="", steps=4):
        """Drag from one point to another."""
        (x0, y0), (x1, y1) = self.place(start), self.place(end)
        self.move((x0, y0))
        with self.holding(held):
            self.press(button)
            for k in range(1, steps + 1):
                self.move((x0 + (x1 - x0) * k / steps, y0 + (y1 - y0) * k / steps))
            self.let_go(button)

    def drag(self, label, fraction):
        """Drag a slider to a fraction of its length."""
        x0, y0, x1, y1 = self.state.item_rects[label]
        margin = 2 + imgui.get_style().grab_min_size / 2
        y = (y0 + y1) / 2
        end = x0 + margin + fraction * (x1 - x0 - 2 * margin)
        self.pull(((x0 + x1) / 2, y), (end, y))
        self.step()

    def wheel(self, notches, target):
        self.move(target)
        self.io.add_mouse_wheel_event(0.0, notches)
        self.step()

    @property
    def middle(self):
        x, y, width, height = self.state.view_rect
        return x + width / 2, y + height / 2

    # Keys

    def holding(self, modifiers):
        return _Held(self, modifiers)

    def key(self, name, held=""):
        """Press and release a key, named as in ``imgui.Key``, with modifiers ("ctrl shift")."""
        code = getattr(imgui.Key, name)
        with self.holding(held):
            for is_down in (True, False):
                self.io.add_key_event(code, is_down)
                self.step()

    def type(self, text, pressed=8):
        """Type letters like a keyboard, the key and the character; further ones in one frame.

        Each key is released in the frame in which the next one is pressed.
        """
        held = None
        for letter in text[:pressed]:
            code = getattr(imgui.Key, letter.lower() if letter.isalpha() else "", None)
            if held is not None:
                self.io.add_key_event(held, False)
                if held is code:
                    self.step()
            if code is not None:
                self.io.add_key_event(code, True)
            self.io.add_input_character(ord(letter))
            self.step()
            held = code
        if held is not None:
            self.io.add_key_event(held, False)
            self.step()
        if text[pressed:]:
            self.io.add_input_characters_utf8(text[pressed:])
            self.step()

    def enter_value(self, label, text):
        """Type a number into a slider: Ctrl+click, the text, Enter."""
        self.click(self.place(label, 0.3), held="ctrl")
        self.type(text)
        self.key("enter")
        self.step()

    def menu(self, *titles):
        """Choose an entry of the menu bar."""
        for title in titles:
            self.click(title)
            self.step()

    def show_panel(self, title):
        """Click the tab of a panel that may be hidden behind others."""
        rect = imgui.internal.find_window_by_name(title).dc.dock_tab_item_rect
        # Left of the cross that closes it.
        self.click((rect.min.x + 0.3 * (rect.max.x - rect.min.x), (rect.min.y + rect.max.y) / 2))
        self.step()

    def pick(self, label, number):
        """Choose an entry of a drop-down list."""
        self.click(label)
        x, _y = self.place(label, 0.1)
        self.step()
        line = imgui.get_style().item_spacing.y + imgui.get_font_size()
        self.click((x, self.state.item_rects[label][3] + 8 + (number + 0.4) * line))
        self.step()

    def open(self, *paths):
        """Drop files on the window and wait for them."""
        open_files(self.state, list(paths))
        self.wait_for_loader()

    def says(self, text):
        """Return whether a transient message contains a text."""
        return any(text in note.text for note in self.state.messages.notes)

    # Queries of the interface

    def dof(self, label):
        """Return the value of a DOF of the first actor."""
        return float(self.state.actor.pose.dofs[self.dof_index(label)])

    def dof_index(self, label):
        return find_dof(self.state.actor.figure.skeleton, label)

    def dofs(self):
        return self.state.actor.pose.dofs.copy()

    @property
    def undo_steps(self):
        return len(self.state.history._undo)

    def wait_for_loader(self):
        """Run frames until the file being loaded is shown or refused."""
        loader = self.state.of(Files).loader
        if loader is not None:
            loader.wait()
        self.step(3)

    def finish_job(self):
        """Run frames until the job is done and its result is shown; wait for threads in between."""
        while (job := self.state.job) is not None:
            if isinstance(job, ThreadJob):
                job.wait()
            self.step()
        self.step(3)

    def screen(self):
        """Return the picture of the window, (H, W, 3) uint8."""
        self.step(3)
        return self.app.pixels()[..., :3]

    def scene_picture(self):
        return self.app.frame.scene_picture()

    def assert_sane(self):
        """Check the invariants that hold after any input."""
        camera = self.state.camera
        numbers = [*camera.target, camera.distance, camera.azimuth, camera.inclination, camera.fov]
        assert np.isfinite(numbers).all() and camera.distance > 0
        assert -90 <= camera.inclination <= 90
        for actor in self.state.scene.actors:
            if actor.own_pose is not None:
                limits = actor.figure.skeleton.dof_limits
                assert np.isfinite(actor.pose.dofs).all()
                assert (limits[:, 0] <= actor.pose.dofs).all()
                assert (actor.pose.dofs <= limits[:, 1]).all()
                assert np.isfinite(actor.pose.shape_weights).all()
                assert np.isfinite(actor.pose.figure_translation).all()
                assert 0 < actor.pose.figure_scale < np.inf


class _Held:
    """Modifier keys held down while a block runs."""

    def __init__(self, driver, modifiers):
        self.driver, self.codes = driver, [MODIFIERS[name] for name in modifiers.split()]

    def __enter__(self):
        self._send(True)

    def __exit__(self, *_):
        self._send(False)

    def _send(self, is_down):
        for code in self.codes:
            self.driver.io.add_key_event(code, is_down)
            self.driver.step()
