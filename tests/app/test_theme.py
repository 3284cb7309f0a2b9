"""Fonts and colours of the interface: additional scripts, and contrast of text."""

import numpy as np
import pytest
from imgui_bundle import imgui

from viewer.app.core import theme
from viewer.app.curves import plot
from viewer.app.manual import Manual
from viewer.rendering.overlay.typeface import interface_font


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
