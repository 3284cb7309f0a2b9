"""Lights panel: direction, colour and strength of two lights; ambient light and highlight."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.widgets import button, draw_setting, note_item, same_line_if_room
from viewer.app.view.display_panel import reset_lights
from viewer.rendering.options import Color, Light
from viewer.rigs.srgb import decode_color, encode_color

_OF_LIGHT = {"strength": "Strength", "azimuth": "Azimuth", "inclination": "Elevation"}
"""Settings of each light, with their labels."""


def draw(state: AppState) -> None:
    """Draw the panel."""
    lights = state.options.lights
    _draw_light(state, "Key", lights.key)
    _draw_light(state, "Rim", lights.rim)
    imgui.separator()
    for name in ("ambient", "specular", "shininess"):
        draw_setting(state, name.capitalize(), lights, name)
    draw_setting(state, "Follow the camera", lights, "follow_camera")
    imgui.same_line()
    if button(state, "Reset lights"):
        reset_lights(state)
    lights.sky = _color(state, "Light from above", lights.sky)
    same_line_if_room("Light from below")
    lights.ground = _color(state, "Light from below", lights.ground)
    draw_setting(state, "Studio", lights, "studio", "Light of metallic-roughness surfaces")


def _draw_light(state: AppState, name: str, light: Light) -> None:
    light.color = _color(state, f"{name} light", light.color)
    for attribute, text in _OF_LIGHT.items():
        draw_setting(state, f"{text}##{name}", light, attribute)
        note_item(state, f"{name} {text}")


def _color(state: AppState, label: str, color: Color) -> Color:
    """Draw a colour picker and return the chosen colour, linear."""
    flags = imgui.ColorEditFlags_.no_inputs
    changed, picked = imgui.color_edit3(label, list(encode_color(color)), flags)
    note_item(state, label)
    return decode_color((picked[0], picked[1], picked[2])) if changed else color
