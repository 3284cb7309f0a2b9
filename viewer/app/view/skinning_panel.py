"""Skinning panel: the method, and the number of influences used."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.state import AppState, shows_errors
from viewer.app.core.widgets import (
    checkbox,
    count_slider,
    disabled,
    draw_setting,
    explain,
    note_item,
    slider,
)
from viewer.app.files.files import offer_files
from viewer.rigs.scalars import strongest
from viewer.rigs.skinning import METHODS, unused_methods

_CLAMP = int(imgui.SliderFlags_.always_clamp)
_ENGINE = 4  # influences per vertex in most game engines


def draw(state: AppState) -> None:
    """Draw the panel for the chosen actor; the settings apply to all actors."""
    figure, skinning = state.actor.figure, state.options.skinning
    if not figure.is_attached:
        offer_files(
            state,
            "This figure has no skin attached to a skeleton: open its .skel and .skin together.",
        )
        return
    for number, (key, method) in enumerate(METHODS.items()):
        if number:
            imgui.same_line()
        if imgui.radio_button(method.short, skinning.method == key):
            skinning.method = key
        note_item(state, method.short)
        if imgui.is_item_hovered():
            imgui.set_tooltip(method.title)
    for plugin in unused_methods():
        if imgui.radio_button(f"{plugin.name} ({plugin.distribution})", False):
            _use_plugin(state, plugin.name)
        note_item(state, plugin.name)
    for key, method in METHODS.items():
        if not method.ends:
            continue
        # The fraction of a mixture of two methods; moving it selects the mixture.
        blend = 0.5 if skinning.blend_factor is None else skinning.blend_factor
        shown = dict(zip(method.ends, (0.0, 1.0), strict=True)).get(skinning.method, blend)
        title = f"{METHODS[method.ends[1]].short} fraction"
        factor = slider(state, title, shown, 0.0, 1.0, flags=_CLAMP)
        if factor != shown:
            skinning.method, skinning.blend_factor = key, factor
    if figure.require_skin().dqs_fractions is not None:
        is_stated = skinning.method == "mix" and skinning.blend_factor is None
        if checkbox(state, "Fractions of the file", is_stated) != is_stated:
            skinning.method, skinning.blend_factor = "mix", 0.5 if is_stated else None
    imgui.separator()
    most = strongest(figure)
    is_limited = skinning.max_influences > 0
    count = skinning.max_influences or _ENGINE
    text = f"Limit to {count} influences"
    if checkbox(state, f"{text}###engine", is_limited) != is_limited:
        skinning.max_influences = 0 if is_limited else _ENGINE
    note_item(state, "engine")
    explain("preview of an engine that supports this many influences per vertex")
    why = "" if skinning.max_influences else "the number of influences is not limited"
    with disabled(state, why):
        limits = (1, max(most, _ENGINE))
        chosen = count_slider(state, "Influences", count, limits, flags=_CLAMP)
        explain(f"the file has up to {most} per vertex", why)
    if skinning.max_influences:
        skinning.max_influences = chosen
    why = "the weights of limited influences are always normalised"
    why = why if skinning.max_influences else ""
    draw_setting(state, "Normalise weights", skinning, "normalize", why=why)
    if figure.correctives is not None:
        draw_setting(state, "Pose correctives", skinning, "correctives")


@shows_errors
def _use_plugin(state: AppState, name: str) -> None:
    """Use a plug-in's method, whose module is now imported."""
    state.options.skinning.method = name
