"""Lights panel: direction, colour and strength of two lights; ambient light and highlight."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.fields import begin_field, slider_float
from viewer.app.core.state import AppState
from viewer.app.core.widgets import (
    button,
    checkbox,
    explain,
    note_item,
    plain_zero,
    same_line_if_room,
    slider,
)
from viewer.app.view.display_panel import reset_lights
from viewer.rendering.options import Color, Light
from viewer.rig.srgb import decode_color, encode_color

_CLAMP = imgui.SliderFlags_.always_clamp
_LOG = imgui.SliderFlags_.always_clamp | imgui.SliderFlags_.logarithmic


def draw(state: AppState) -> None:
    """Draw the panel."""
    lights = state.options.lights
    _draw_light(state, "Key", lights.key)
    _draw_light(state, "Rim", lights.rim)
    imgui.separator()
    lights.ambient = slider(state, "Ambient", lights.ambient, 0.0, 1.0, flags=_CLAMP)
    lights.specular = slider(state, "Specular", lights.specular, 0.0, 2.0, flags=_CLAMP)
    lights.shininess = slider(state, "Shininess", lights.shininess, 1.0, 512.0, "%.0f", _LOG)
    lights.follow_camera = checkbox(state, "Follow the camera", lights.follow_camera)
    imgui.same_line()
    if button(state, "Reset lights"):
        reset_lights(state)
    lights.sky = _color(state, "Light from above", lights.sky)
    same_line_if_room("Light from below")
    lights.ground = _color(state, "Light from below", lights.ground)
    lights.studio = slider(state, "Studio", lights.studio, 0.0, 2.0, flags=_CLAMP)
    explain("Light of metallic-roughness surfaces")


def _draw_light(state: AppState, name: str, light: Light) -> None:
    light.color = _color(state, f"{name} light", light.color)
    imgui.push_id(name)
    for attribute, text, low, high, unit in (
        ("strength", "Strength", 0.0, 4.0, "%.2f"),
        ("azimuth", "Azimuth", -180.0, 180.0, "%.0f\N{DEGREE SIGN}"),
        ("inclination", "Elevation", -90.0, 90.0, "%.0f\N{DEGREE SIGN}"),
    ):
        shown = plain_zero(getattr(light, attribute), unit)
        changed, value = slider_float(state, begin_field(text), shown, low, high, unit, _CLAMP)
        note_item(state, f"{name} {text}")
        if changed:
            setattr(light, attribute, value)
    imgui.pop_id()


def _color(state: AppState, label: str, color: Color) -> Color:
    """Draw a colour picker and return the chosen colour, linear."""
    flags = imgui.ColorEditFlags_.no_inputs
    changed, picked = imgui.color_edit3(label, list(encode_color(color)), flags)
    note_item(state, label)
    return decode_color((picked[0], picked[1], picked[2])) if changed else color
