"""Font, colours and sizes of the interface."""

from __future__ import annotations

from pathlib import Path

import imgui_bundle
from imgui_bundle import imgui

__all__ = ["apply_theme", "change_scale"]

_FONT_POINTS = 15.0
_ACCENT = (0.93, 0.55, 0.20, 1.0)
_GRAB = (0.93, 0.55, 0.20, 0.55)  # translucent: the number stays readable


def apply_theme(scale: float) -> None:
    """Set up font and style of the current ImGui context.

    Parameters
    ----------
    scale : float
        Scale of fonts and sizes; 1 for a standard screen.
    """
    font = Path(imgui_bundle.__file__).parent / "assets" / "fonts" / "DroidSans.ttf"
    if font.is_file():
        imgui.get_io().fonts.add_font_from_file_ttf(str(font), _FONT_POINTS)
    imgui.style_colors_dark()
    style = imgui.get_style()
    style.window_rounding = style.child_rounding = 3.0
    style.frame_rounding = style.grab_rounding = style.popup_rounding = 3.0
    style.window_border_size = 0.0
    style.item_spacing = imgui.ImVec2(7.0, 4.0)
    style.scrollbar_size = 12.0
    style.grab_min_size = 8.0
    _set_colors(style)
    style.scale_all_sizes(scale)
    style.font_scale_dpi = scale


def change_scale(old: float, new: float) -> None:
    """Change the scale of fonts and sizes, as when a window moves to another screen."""
    style = imgui.get_style()
    style.scale_all_sizes(new / old)
    style.font_scale_dpi = new


def _set_colors(style: imgui.Style) -> None:
    names = imgui.Col_
    quiet, hovered, active = (
        (0.20, 0.22, 0.25, 1.0),
        (0.27, 0.30, 0.34, 1.0),
        (0.33, 0.36, 0.41, 1.0),
    )
    for name, color in (
        (names.window_bg, (0.125, 0.135, 0.15, 1.0)),
        (names.popup_bg, (0.11, 0.12, 0.135, 0.98)),
        (names.title_bg, (0.09, 0.10, 0.11, 1.0)),
        (names.title_bg_active, (0.09, 0.10, 0.11, 1.0)),
        (names.menu_bar_bg, (0.09, 0.10, 0.11, 1.0)),
        (names.frame_bg, quiet),
        (names.frame_bg_hovered, hovered),
        (names.frame_bg_active, active),
        (names.button, (0.24, 0.27, 0.31, 1.0)),
        (names.button_hovered, (0.32, 0.36, 0.41, 1.0)),
        (names.button_active, active),
        (names.header, (0.24, 0.27, 0.31, 1.0)),
        (names.header_hovered, hovered),
        (names.header_active, active),
        (names.slider_grab, _GRAB),
        (names.slider_grab_active, (1.0, 0.70, 0.35, 0.75)),
        (names.check_mark, _ACCENT),
        (names.tab, (0.11, 0.12, 0.135, 1.0)),
        (names.tab_hovered, hovered),
        (names.tab_selected, (0.125, 0.135, 0.15, 1.0)),
        (names.tab_dimmed, (0.11, 0.12, 0.135, 1.0)),
        (names.tab_dimmed_selected, (0.125, 0.135, 0.15, 1.0)),
        (names.tab_selected_overline, _ACCENT),
        (names.separator, (0.24, 0.26, 0.29, 1.0)),
    ):
        style.set_color_(name, color)
