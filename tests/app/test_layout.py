"""Panels, sizes and scales: closed panels reopen, and clicks hit at every scale."""

import numpy as np
import pytest
from app.captured import people
from app.tiny import FILE_POSE
from imgui_bundle import imgui

from viewer.app.core import theme
from viewer.app.curves import plot
from viewer.app.layout import PANELS, Layout, ShownPanels, is_open, set_open
from viewer.app.manual import Manual
from viewer.rendering.overlay.typeface import interface_font


def resize(hand, *size):
    hand.io.display_size = imgui.ImVec2(*size)
    hand.step(4)


@pytest.mark.parametrize("size", [(320, 240), (640, 480), (900, 600), (1280, 800), (2560, 1600)])
@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_view_keeps_half_of_the_width(drive, rig, size, scale):
    hand = drive(*rig, size=size, scale=scale)
    assert hand.state.view_rect[2] >= 0.5 * size[0] - 4.0
    resize(hand, size[0] // 2, size[1])
    assert hand.state.view_rect[2] >= 0.25 * size[0] - 4.0


def test_panels_share_one_column_in_narrow_windows_and_separate_again(hand):
    left = hand.state.view_rect[0]
    resize(hand, 700, 640)
    assert left > 0.0 == hand.state.view_rect[0]
    resize(hand, 1000, 640)
    assert hand.state.view_rect[0] == left
    assert {"Reset (R)", "Skeleton", "Distance"} <= set(hand.state.item_rects)


def test_dragged_edge_keeps_its_position(hand):
    edge = hand.state.view_rect[0] - 1.0
    hand.pull((edge, 300.0), (edge + 60.0, 300.0))
    resize(hand, 700, 640)
    resize(hand, 1000, 640)
    assert hand.state.of(Layout).is_arranged
    assert hand.state.view_rect[0] == pytest.approx(edge + 61.0, abs=2.0)


def test_curves_panel_is_tall_enough_for_a_plot_while_in_front(drive, rig):
    hand = drive(scene=people(rig, [True] * 9), size=(1280, 800), samples=1)
    before = hand.state.view_rect[3]
    hand.show_panel("Curves")
    hand.step(2)
    plot = next(one for one in imgui.get_current_context().windows if "##plot" in one.name)
    assert plot.size.y > 800 / 3
    hand.show_panel("Timeline")
    hand.step(2)
    assert hand.state.view_rect[3] == pytest.approx(before, abs=1.0)


def test_closed_panel_disappears_and_the_menu_reopens_it(hand):
    hand.menu("menu Window", "Joints")
    hand.step(3)
    assert hand.state.of(ShownPanels).closed == {"joints"} and "Filter" not in hand.state.item_rects
    assert hand.state.view_rect[0] == 0
    hand.menu("menu Window", "Joints")
    hand.step(3)
    assert "Filter" in hand.state.item_rects


def test_menu_brings_a_hidden_tab_to_the_front_and_into_view(drive, rig):
    hand = drive(*rig, size=(900, 600))
    for title in ("Stats", "Display"):
        hand.menu("menu Window", title)
        hand.step(4)
        window = imgui.internal.find_window_by_name(title)
        tab, bar = window.dc.dock_tab_item_rect, window.dock_node.tab_bar.bar_rect
        assert window.dock_node.selected_tab_id == window.tab_id
        assert bar.min.x <= tab.min.x + 1 and tab.max.x <= bar.max.x + 1
        assert not hand.state.of(ShownPanels).closed
    # Only the panel in front is closed.
    hand.menu("menu Window", "Display")
    assert hand.state.of(ShownPanels).closed == {"display"}


def test_panel_closes_with_its_close_button(hand):
    tab = imgui.internal.find_window_by_name("Joints").dc.dock_tab_item_rect
    hand.click((tab.max.x - 8, (tab.min.y + tab.max.y) / 2))
    hand.step(3)
    assert hand.state.of(ShownPanels).closed == {"joints"}


def test_view_remains_when_all_panels_are_closed(hand):
    for name, panel in PANELS.items():
        if not panel.needs and not panel.on_demand:  # the other panels are closed
            set_open(hand.state, name, False)
    hand.step(3)
    x, _y, width, height = hand.state.view_rect
    assert (x, width) == (0, 1000) and height > 600
    hand.pull(hand.middle, (hand.middle[0] + 50, hand.middle[1]))


def test_reset_layout_reopens_every_panel_at_its_position(hand):
    rect, labels = hand.state.view_rect, set(hand.state.item_rects)
    hand.menu("menu Window", "Joints")
    set_open(hand.state, "stats", False)
    hand.menu("menu Window", "Reset layout")
    hand.step(4)
    assert not hand.state.of(ShownPanels).closed
    assert hand.state.view_rect == rect and set(hand.state.item_rects) == labels


def test_reset_layout_keeps_pose_and_camera(hand):
    hand.drag("arm.x", 0.9)
    before = hand.dofs(), hand.state.camera.azimuth
    hand.menu("menu Window", "Reset layout")
    hand.step(4)
    assert (hand.dofs() == before[0]).all() and hand.state.camera.azimuth == before[1]


@pytest.mark.parametrize("size", [(900, 640), (640, 480), (320, 240), (50, 40), (8, 8), (1, 1)])
def test_small_windows_draw_without_errors(drive, rig, size):
    hand = drive(*rig, size=size, pixels_per_point=1.0)
    hand.key("s")
    hand.key("f")
    hand.wheel(2, (size[0] / 2, size[1] / 2))
    hand.key("h")
    hand.state.error = "message"
    hand.step(2)
    hand.key("escape")
    hand.key("tab")
    hand.key("f")
    hand.step(3)
    hand.assert_sane()


def test_window_can_shrink_to_zero_size_and_grow_again(hand):
    for size in ((300, 200), (40, 300), (300, 1), (1, 1), (900, 640)):
        hand.io.display_size = imgui.ImVec2(*size)
        hand.step(4)
        hand.key("f")
        hand.wheel(1, (size[0] / 2, size[1] / 2))
        hand.assert_sane()
    hand.key("f")
    hand.drag("arm.x", 0.9)
    assert hand.dof("arm.x") != FILE_POSE["arm.x"]


def test_view_of_zero_size_is_skipped(hand):
    for rect in ((0, 0, 0, 0), (0, 0, 0, 50), (0, 0, 50, 0), (0, 0, 0.2, 0.2), (0, 0, -5, 9)):
        hand.state.view_rect = tuple(map(float, rect))
        hand.app.frame._draw_scene(1.0)
        assert hand.state.aspect > 0


@pytest.mark.parametrize(
    ("pixels", "scale"),
    [(1.0, 1.0), (1.25, 1.0), (2.0, 1.0), (1.0, 1.5), (1.0, 2.0), (2.0, 2.0)],
)
def test_clicks_hit_their_target_at_every_scale(drive, rig, pixels, scale):
    size = round(1000 * scale), round(640 * scale)
    hand = drive(*rig, size=size, pixels_per_point=pixels, scale=scale)
    assert hand.app.screen.size == tuple(round(side * pixels) for side in size)
    width, height = (round(side * pixels) for side in hand.state.view_rect[2:])
    assert hand.scene_picture().shape == (height, width, 4)
    hand.drag("root.x", 0.8)
    assert hand.dof("root.x") == pytest.approx(0.6, abs=0.06)
    hand.click("Skeleton")
    assert hand.state.options.show == "skeleton"
    hand.key("r")
    before = hand.state.camera.azimuth
    hand.pull(hand.middle, (hand.middle[0] + 50, hand.middle[1]))
    assert hand.state.camera.azimuth == pytest.approx(before - 20)


@pytest.mark.parametrize("scale", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("size", [(640, 480), (1280, 800)])
def test_unit_buttons_stay_within_the_panel(drive, rig, size, scale):
    hand = drive(*rig, size=size, scale=scale)
    for label in ("Reset (R)", "degrees", "radians"):
        # A narrow window has its panels on the right.
        edge = hand.state.view_rect[0] or size[0]
        assert hand.state.item_rects[label][2] <= edge, label


def test_scene_fills_exactly_its_area_of_the_window(drive, rig):
    hand = drive(*rig, pixels_per_point=2.0)
    hand.state.panels_visible = False
    screen, scene = hand.screen(), hand.scene_picture()
    assert scene.shape[:2] == screen.shape[:2]
    notes = len(hand.state.messages.notes)
    assert notes or np.abs(screen.astype(int) - scene[..., :3]).max() <= 1


def test_transparent_background_shows_no_previous_frame(hand):
    hand.state.options.background = "transparent"
    hand.state.options.grid = False
    hand.key("tab")
    first = hand.screen()
    hand.state.camera.azimuth += 90
    hand.screen()
    hand.state.camera.azimuth -= 90
    hand.state.messages.notes.clear()
    assert (hand.screen() == first).mean() > 0.99


def test_closed_panels_are_remembered(tmp_path, monkeypatch):
    from viewer.app.files.recent import load_closed_panels, save_closed_panels

    assert load_closed_panels() == set()
    save_closed_panels({"stats", "joints"})
    assert load_closed_panels() == {"stats", "joints"}
    (tmp_path / "state" / "viewer" / "closed.json").write_text("null")
    assert load_closed_panels() == set()


def test_scaled_widgets_still_work(hand):
    from viewer.app.core.theme import change_scale

    x0, y0, x1, y1 = hand.state.item_rects["Reset (R)"]
    change_scale(1.0, 2.0)
    hand.step(4)
    a0, b0, a1, b1 = hand.state.item_rects["Reset (R)"]
    assert (b1 - b0) > 1.6 * (y1 - y0) and (a1 - a0) > 1.6 * (x1 - x0)
    hand.state.actor.pose.dofs[0] = 0.25
    hand.step(1)
    hand.click("Reset (R)")
    assert hand.state.actor.pose.dofs[0] == 0.0


def test_closing_menu_keeps_the_timeline_tab_in_front_of_the_curves(drive, rig):
    hand = drive(scene=people(rig, [True] * 9), size=(1280, 800), samples=1)
    assert "Scrubber" in hand.state.item_rects
    hand.click("menu Edit")
    hand.key("escape")
    hand.step(4)
    assert "Scrubber" in hand.state.item_rects and "plot" not in hand.state.item_rects


def test_panel_missing_from_a_saved_layout_docks_with_its_neighbours(drive, rig):
    hand = drive(*rig)
    sections = imgui.save_ini_settings_to_memory().split("\n\n")
    old = "\n\n".join(part for part in sections if not part.startswith("[Window][Weights]"))
    assert len(old) < len("\n\n".join(sections))
    hand.close()
    drive(*rig, layout=old)
    docks = {
        title: imgui.internal.find_window_by_name(title).dock_id
        for title in ("Weights", "Display", "Camera")
    }
    assert docks["Weights"] == docks["Display"] != docks["Camera"]


def test_panels_on_demand_are_closed_at_first(hand):
    state = hand.state
    assert "lint" in PANELS and PANELS["lint"].on_demand
    for name, panel in PANELS.items():
        assert is_open(state, name) == (not panel.on_demand)


def test_panels_open_and_close(hand):
    state = hand.state
    for name in ("lint", "stats"):
        for opened in (True, True, False, False, True):
            set_open(state, name, opened)
            assert is_open(state, name) == opened
    assert state.of(ShownPanels).opened == {"lint"} and not state.of(ShownPanels).closed


def test_tab_close_button_closes_a_panel_on_demand(hand):
    set_open(hand.state, "lint", True)
    hand.step(4)
    assert "Check" in hand.state.item_rects or "Recheck" in hand.state.item_rects
    tab = imgui.internal.find_window_by_name("Lint").dc.dock_tab_item_rect
    hand.click((tab.max.x - 12, 0.5 * (tab.min.y + tab.max.y)))
    hand.step(3)
    assert not hand.state.of(ShownPanels).opened and not hand.state.of(ShownPanels).closed


def test_system_fonts_supplement_the_font_of_the_panels(hand, monkeypatch):
    assert not theme.lacks_letters(["hand_l", "\u0440\u0443\u043a\u0430", "\u03b1"])
    assert theme.lacks_letters(["hand_l", "\u95a2\u7bc0"])
    monkeypatch.setattr(theme, "system_fonts", lambda: (interface_font(),))
    fonts = hand.io.fonts.fonts
    n_fonts, n_sources = len(fonts), len(fonts[0].sources)
    theme.add_system_fonts()
    hand.step(2)
    # Merged into the same font, so that all text can use it.
    assert (len(fonts), len(fonts[0].sources)) == (n_fonts, n_sources + 1)


def _luminance(color):
    """Relative luminance as WCAG 2 defines it."""
    channels = np.array(tuple(color)[:3])
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    return linear @ [0.2126, 0.7152, 0.0722]


@pytest.mark.parametrize("name", ["dark", "light"])
def test_coloured_text_is_legible_on_panels(hand, monkeypatch, name):
    theme.set_theme(name)
    drawn = []
    write, push = imgui.text_colored, imgui.push_style_color

    def push_color(target, color):
        if target == imgui.Col_.text:
            drawn.append(imgui.ImVec4(color))
        push(target, color)

    monkeypatch.setattr(
        imgui, "text_colored", lambda color, text: (drawn.append(color), write(color, text))
    )
    monkeypatch.setattr(imgui, "push_style_color", push_color)
    hand.menu("menu Edit", "Check the rig")
    hand.finish_job()
    hand.key("p", "ctrl")
    hand.type("weights")
    hand.step(2)
    hand.key("escape")
    hand.state.of(Manual).topic = "window"
    hand.step(2)
    assert len({tuple(color) for color in drawn}) > 3
    background = _luminance(imgui.get_style().color_(imgui.Col_.window_bg))
    for color in drawn:
        low, high = sorted((_luminance(color), background))
        assert (high + 0.05) / (low + 0.05) > 3.0


@pytest.mark.parametrize("panels", ["dark", "light"])
def test_selected_keys_and_their_handles_contrast_with_the_plot(curves, monkeypatch, panels):
    theme.set_theme(panels)
    shown = []

    def record(name, drawn):
        """Record a colour of the plot where it is made of this value."""
        color_of = getattr(plot, name)

        def recorded(value):
            color = color_of(value)
            if value == drawn:
                shown.append(color)
            return color

        monkeypatch.setattr(plot, name, recorded)

    record("ink", plot._HANDLE)
    record("faint", 1.0)
    curves.click("key arm.x 1")
    curves.step(2)
    background = _luminance(imgui.get_style().color_(imgui.Col_.window_bg))
    assert len(set(shown)) == 2
    for color in shown:
        low, high = sorted((_luminance(color), background))
        assert (high + 0.05) / (low + 0.05) > 3.0
