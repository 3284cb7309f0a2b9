"""Skinning: the method, how many influences count, and what either does, as a heat map."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.state import AppState
from viewer.app.widgets import checkbox, choice, note_item, number_text, slider
from viewer.rig.figure import Figure
from viewer.rig.scalars import SCALARS, length_unit, split_name, strongest
from viewer.rig.skinning import METHODS, Skinning

__all__ = ["draw"]

_SHORT = {"lbs": "LBS", "dqs": "DQS", "mix": "Mixed"}
_CLAMP = imgui.SliderFlags_.always_clamp
_ENGINE = 4  # influences of most engines


def draw(state: AppState) -> None:
    """Draw the panel for the chosen actor; the settings hold for all."""
    figure, skinning = state.actor.figure, state.options.skinning
    if not figure.is_attached:
        imgui.text_wrapped("This figure has no skin that follows a skeleton.")
        return
    _draw_method(state, skinning)
    imgui.separator()
    _draw_influences(state, figure, skinning)
    if figure.correctives is not None:
        skinning.correctives = checkbox(state, "Pose correctives", skinning.correctives)
    imgui.separator()
    _draw_heat_map(state, figure)


def _draw_method(state: AppState, skinning: Skinning) -> None:
    for number, (key, text) in enumerate(_SHORT.items()):
        if number:
            imgui.same_line()
        if imgui.radio_button(text, skinning.method == key):
            skinning.method = key
        note_item(state, text)
        if imgui.is_item_hovered():
            imgui.set_tooltip(METHODS[key])
    shown = {"lbs": 0.0, "dqs": 1.0}.get(skinning.method, skinning.share)
    share = slider(state, "DQS share", shown, 0.0, 1.0, flags=_CLAMP)
    if share != shown:
        skinning.method, skinning.share = "mix", share


def _draw_influences(state: AppState, figure: Figure, skinning: Skinning) -> None:
    most = strongest(figure)
    is_cut = skinning.max_influences > 0
    count = skinning.max_influences or _ENGINE
    text = f"As a {count}-influence engine shows it"
    if checkbox(state, f"{text}###engine", is_cut) != is_cut:
        skinning.max_influences = 0 if is_cut else _ENGINE
    note_item(state, "engine")
    imgui.begin_disabled(skinning.max_influences == 0)
    changed, chosen = imgui.slider_int("Influences", count, 1, max(most, _ENGINE), "%d", _CLAMP)
    note_item(state, "Influences")
    if imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled):
        imgui.set_tooltip(f"the file lists up to {most} a vertex")
    if changed and skinning.max_influences:
        skinning.max_influences = chosen
    imgui.end_disabled()
    imgui.begin_disabled(skinning.max_influences > 0)
    skinning.normalize = checkbox(state, "Normalise weights", skinning.normalize)
    imgui.end_disabled()


def _draw_heat_map(state: AppState, figure: Figure) -> None:
    options = state.options
    shows = options.shading == "scalar"
    if checkbox(state, "Heat map", shows) != shows:
        options.shading = "phong" if shows else "scalar"
    titles = {name: view.title for name, view in SCALARS.items()}
    imgui.set_next_item_width(-1.0)
    key = split_name(options.scalar)[0]
    chosen = choice(state, "##Heat map of", key, titles)
    if chosen != key:
        options.scalar = chosen
    if shows and SCALARS[chosen].unit == "length":
        factor, unit = length_unit(figure)
        most = number_text(factor * state.stats.scalar_range[1])
        imgui.text_wrapped(f"up to {most} {unit} in this pose")
