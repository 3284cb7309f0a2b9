"""Colours and fonts of the interface: dark and light theme, and text legible on both."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator
from typing import Literal, TypeAlias

from imgui_bundle import imgui

from viewer.rendering.overlay.typeface import interface_font, system_fonts

_FONT_POINTS = 15.0
_ACCENT = (0.93, 0.55, 0.20, 1.0)
# Colours by use: dark theme, light theme.
_COLORS = {
    "panel": ((0.125, 0.135, 0.15, 1.0), (0.945, 0.95, 0.955, 1.0)),
    "popup": ((0.11, 0.12, 0.135, 1.0), (0.985, 0.985, 0.99, 1.0)),
    "title": ((0.09, 0.10, 0.11, 1.0), (0.87, 0.88, 0.895, 1.0)),
    "tab": ((0.11, 0.12, 0.135, 1.0), (0.88, 0.89, 0.905, 1.0)),
    "frame": ((0.20, 0.22, 0.25, 1.0), (0.855, 0.865, 0.88, 1.0)),
    "button": ((0.24, 0.27, 0.31, 1.0), (0.80, 0.815, 0.84, 1.0)),
    "button hovered": ((0.32, 0.36, 0.41, 1.0), (0.73, 0.755, 0.79, 1.0)),
    "hovered": ((0.27, 0.30, 0.34, 1.0), (0.80, 0.82, 0.85, 1.0)),
    "active": ((0.33, 0.36, 0.41, 1.0), (0.70, 0.73, 0.775, 1.0)),
    "line": ((0.24, 0.26, 0.29, 1.0), (0.76, 0.775, 0.80, 1.0)),
    "text": ((0.96, 0.965, 0.97, 1.0), (0.09, 0.10, 0.115, 1.0)),
    "quiet text": ((0.56, 0.57, 0.59, 1.0), (0.37, 0.385, 0.41, 1.0)),
    "track": ((0.80, 0.47, 0.17, 1.0), (0.84, 0.47, 0.12, 1.0)),
    "track active": ((1.0, 0.66, 0.30, 1.0), (0.72, 0.37, 0.04, 1.0)),
    "docking": ((0.93, 0.55, 0.20, 0.5), (0.84, 0.47, 0.12, 0.4)),
    "dim": ((0.0, 0.0, 0.0, 0.5), (0.0, 0.0, 0.0, 0.3)),
    "grip": ((0.30, 0.33, 0.37, 1.0), (0.70, 0.72, 0.75, 1.0)),
    "chosen text": ((0.62, 0.36, 0.12, 0.9), (0.97, 0.78, 0.55, 1.0)),
    "mark": (_ACCENT, (0.80, 0.42, 0.06, 1.0)),
}
_USES = {
    "panel": ("window_bg", "tab_selected", "tab_dimmed_selected"),
    "popup": ("popup_bg",),
    "title": ("title_bg", "title_bg_active", "menu_bar_bg", "table_header_bg"),
    "tab": ("tab", "tab_dimmed"),
    "frame": ("frame_bg", "checkbox_selected_bg"),
    "button": ("button", "header"),
    "button hovered": ("button_hovered",),
    "hovered": ("frame_bg_hovered", "header_hovered", "tab_hovered"),
    "active": ("frame_bg_active", "button_active", "header_active"),
    "line": ("separator",),
    "text": ("text",),
    "quiet text": ("text_disabled",),
    "track": ("slider_grab", "separator_hovered"),
    "track active": (
        "slider_grab_active",
        "resize_grip_hovered",
        "resize_grip_active",
        "separator_active",
    ),
    "docking": ("docking_preview",),
    "dim": ("modal_window_dim_bg",),
    "grip": ("resize_grip",),
    "chosen text": ("text_selected_bg", "plot_histogram"),
    "mark": ("check_mark", "tab_selected_overline"),
}
Color = tuple[float, float, float, float]
Theme: TypeAlias = Literal["dark", "light"]
WARNING: Color = (1.0, 0.77, 0.30, 1.0)
ERROR: Color = (1.0, 0.50, 0.42, 1.0)
_DARKER = 0.58  # factor on the channels: gives a contrast of 4 or more on a light panel


def apply_theme(scale: float, theme: Theme = "dark") -> None:
    """Set up font, style and behaviour of the current ImGui context."""
    font = interface_font()
    if font is not None:
        imgui.get_io().fonts.add_font_from_file_ttf(str(font), _FONT_POINTS)
    # A click on a draggable number begins text input.
    imgui.get_io().config_drag_click_to_input_text = True
    set_theme(theme)
    style = imgui.get_style()
    style.window_rounding = style.child_rounding = 3.0
    style.frame_rounding = style.grab_rounding = style.popup_rounding = 3.0
    style.window_border_size = 0.0
    style.item_spacing = imgui.ImVec2(7.0, 4.0)
    style.scrollbar_size = 12.0
    # Panels are closed by the cross in their tab, and listed in the menu.
    style.docking_node_has_close_button = False
    style.window_menu_button_position = imgui.Dir.none
    style.grab_min_size = 8.0
    style.scale_all_sizes(scale)
    style.font_scale_dpi = scale


def lacks_letters(texts: Iterable[str]) -> bool:
    """Return whether the current font lacks a glyph for any letter of some strings."""
    font = imgui.get_io().fonts.fonts[0]
    letters = {letter for text in texts if not text.isascii() for letter in text}
    return not all(font.is_glyph_in_font(ord(letter)) for letter in letters)


def add_system_fonts() -> None:
    """Merge large system fonts for Chinese, Arabic and other scripts, after the first pictures."""
    for path in system_fonts():
        config = imgui.ImFontConfig()
        config.merge_mode = True
        imgui.get_io().fonts.add_font_from_file_ttf(str(path), _FONT_POINTS, config)


def change_scale(old: float, new: float) -> None:
    """Change the scale of fonts and sizes, as when a window moves to another screen."""
    style = imgui.get_style()
    style.scale_all_sizes(new / old)
    style.font_scale_dpi = new


def set_theme(theme: Theme) -> None:
    """Set the colours of a theme."""
    style, row = imgui.get_style(), int(theme == "light")
    imgui.style_colors_light() if row else imgui.style_colors_dark()
    for use, names in _USES.items():
        for name in names:
            style.set_color_(getattr(imgui.Col_, name), _COLORS[use][row])


def ink(color: Color) -> Color:
    """Return a colour chosen for dark panels, darker if the panels are light."""
    if not _is_light():
        return color
    red, green, blue, alpha = color
    return _DARKER * red, _DARKER * green, _DARKER * blue, alpha


@contextlib.contextmanager
def text_color(color: Color | None) -> Iterator[None]:
    """Draw the texts of a block in a colour chosen for dark panels; None keeps the usual one."""
    if color is not None:
        imgui.push_style_color(imgui.Col_.text, ink(color))
    yield
    if color is not None:
        imgui.pop_style_color()


def accent() -> Color:
    """Return the background of a button that is switched on."""
    return (0.95, 0.70, 0.42, 1.0) if _is_light() else (0.62, 0.36, 0.12, 1.0)


def faint(opacity: float) -> Color:
    """Return the colour of text with some opacity, for lines and areas."""
    text = imgui.get_style().color_(imgui.Col_.text)
    return text.x, text.y, text.z, opacity


def _is_light() -> bool:
    text = imgui.get_style().color_(imgui.Col_.text)
    return text.x + text.y + text.z < 1.5
