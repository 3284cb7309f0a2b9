"""Fonts of the interface: letters of further scripts."""

from __future__ import annotations

from viewer.app import theme
from viewer.rendering.overlay.typeface import interface_font


def test_fonts_of_the_system_complete_the_font_of_the_panels(hand, monkeypatch):
    assert not theme.lacks_letters(["hand_l", "\u0440\u0443\u043a\u0430", "\u03b1"])
    assert theme.lacks_letters(["hand_l", "\u95a2\u7bc0"])
    monkeypatch.setattr(theme, "system_fonts", lambda: (interface_font(),))
    fonts = hand.io.fonts.fonts
    n_fonts, n_sources = len(fonts), len(fonts[0].sources)
    theme.add_system_fonts()
    hand.step(2)
    # Merged into the same font, so that all text uses it.
    assert (len(fonts), len(fonts[0].sources)) == (n_fonts, n_sources + 1)
