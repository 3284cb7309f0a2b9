"""Panels: their table, which are open, and the dock's proportions in a window of any size.

A panel is a module ``<name>_panel.py`` of its feature's folder with ``draw(state)``, imported on
first use.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from importlib import import_module
from types import ModuleType
from typing import Literal, NamedTuple, TypeAlias

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.data_classes import dataclass
from viewer.errors import ViewerError
from viewer.plugins import added_to, plugin_of

_DOCK = "viewer dock"
# Minimum and maximum width of each side, in font sizes.
_LEFT, _RIGHT, _COLUMN = (15.0, 22.0), (17.0, 24.0), (17.0, 22.0)
# Widths of the sides relative to the window's width.
_LEFT_PART, _RIGHT_PART, _COLUMN_PART = 0.22, 0.25, 0.3
_MOST = 0.5
"""Maximum fraction of the window's width that panels may occupy."""
_THREE_ROWS = 60.0  # font sizes: lower windows have two rows of panels on the right
_TIMELINE, _CURVES = (8.0, 0.34), (22.0, 0.46)
"""Minimum height of bottom panels in font sizes, and maximum as a fraction of the window."""

Dock: TypeAlias = Literal["left", "bottom", "right 1", "right 2", "right 3"]


@dataclass(frozen=True, slots=True)
class Panel:
    """Entry of a panel, with the properties that the layout needs."""

    feature: str
    """Folder of the panel's module, ``<name>_panel.py``."""
    title: str
    """Title of its tab."""
    place: Dock
    """Initial dock; those on the right are numbered downwards."""
    needs: str = ""
    """Part of ``Figure`` without which the panel is hidden. ``"motion"`` requires a motion,
    ``"actors"`` a motion or several actors, ``"parts"`` a mesh of several parts, ``"drive"`` a
    motion of another skeleton; empty if the panel is always available."""
    leads: bool = False
    """Whether it is brought to the front of its tabs when a scene makes it available."""
    on_demand: bool = False
    """Whether it is closed until the user opens it."""


PANELS = {
    "joints": Panel("posing", "Joints", "left"),
    "shape": Panel("posing", "Shape", "left", needs="blend_shapes"),
    "hands": Panel("posing", "Hands", "left", needs="hands"),
    "vertex": Panel("weights", "Vertex", "left", on_demand=True),
    "lint": Panel("linting", "Lint", "left", on_demand=True),
    "rig": Panel("rigging", "Rig", "left", on_demand=True),
    "display": Panel("view", "Display", "right 1"),
    "skinning": Panel("view", "Skinning", "right 1"),
    "weights": Panel("weights", "Weights", "right 1"),
    "camera": Panel("view", "Camera", "right 2"),
    "lights": Panel("view", "Lights", "right 2"),
    "stats": Panel("view", "Stats", "right 3"),
    "actors": Panel("actors", "Actors", "right 3", needs="actors"),
    "parts": Panel("actors", "Parts", "right 3", needs="parts"),
    "timeline": Panel("playback", "Timeline", "bottom", needs="motion", leads=True),
    "curves": Panel("curves", "Curves", "bottom", needs="motion"),
    "joint_match": Panel("retargeting", "Joint match", "bottom", needs="drive"),
}
"""Panels in the order in which they are docked and listed in the menu."""


def all_panels() -> Mapping[str, Panel]:
    """Return ``PANELS`` with those of plug-ins, which are closed until the user opens them."""
    added = added_to("panels", PANELS)
    if not added:
        return PANELS
    found = dict(PANELS)
    for plugin in added:
        title = f"{plugin.name} ({plugin.distribution})"
        found[plugin.name] = Panel("", title, "right 3", on_demand=True)
    return found


def panel_module(name: str) -> ModuleType:
    """Return a panel's module, imported on first use."""
    return import_module(f"viewer.app.{PANELS[name].feature}.{name}_panel")


def draw_panel(state: AppState, name: str) -> None:
    """Draw the contents of a panel; one of a plug-in that fails is closed, with its error."""
    if name in PANELS:
        panel_module(name).draw(state)
        return
    plugin = plugin_of("panels", name)
    assert plugin is not None  # as ``all_panels`` has found it
    before = imgui.internal.ErrorRecoveryState()
    imgui.internal.error_recovery_store_state(before)
    try:
        module = plugin.load()
        with plugin.guarded("cannot be drawn"):
            module.draw(state)
    except ViewerError as problem:
        # ImGui ends what the panel has begun; it would report each as an error.
        settings = imgui.get_io()
        settings.config_error_recovery_enable_assert = False
        imgui.internal.error_recovery_try_to_recover_state(before)
        settings.config_error_recovery_enable_assert = True
        set_open(state, name, False)
        state.error = str(problem)


@dataclass(slots=True)
class ShownPanels:
    """Panels whose state differs from the default."""

    closed: set[str] = field(default_factory=set)
    """Panels open by default that were closed."""
    opened: set[str] = field(default_factory=set)
    """On-demand panels that were opened."""
    wants_reset: bool = False
    """Whether the default layout is to be restored."""
    fronts: list[str] = field(default_factory=list)
    """Titles of panels to bring to the front of their tabs once they are drawn."""


class _Sizes(NamedTuple):
    """Sizes of the default arrangement in window coordinates."""

    left: float
    right: float
    """Widths of the sides; a narrow window has all panels on the right, and ``left`` is 0."""
    bottom: float
    """Height of the bottom panels."""
    rows: int
    """Number of rows of panels on the right."""


@dataclass(slots=True)
class Layout:
    """State of the arrangement."""

    is_arranged: bool = False
    """Whether the user has moved or resized panels; the arrangement is then kept."""
    sizes: _Sizes | None = None
    """Sizes for which the panels were last arranged."""
    nodes: dict[str, int] = field(default_factory=dict)
    """Dock nodes of the left side, the right side and the bottom."""
    fronts: list[str] = field(default_factory=list)
    """Titles of panels to bring to the front once they are drawn."""
    found: tuple[object, ...] = ()
    """Docks of panels and sizes of nodes in the previous frame."""


def is_open(state: AppState, name: str) -> bool:
    """Return whether a panel is open; it is drawn only if it has something to show."""
    shown = state.of(ShownPanels)
    if (PANELS.get(name) or all_panels()[name]).on_demand:
        return name in shown.opened
    return name not in shown.closed


def set_open(state: AppState, name: str, opened: bool) -> None:
    """Open or close a panel."""
    shown = state.of(ShownPanels)
    on_demand = all_panels()[name].on_demand
    names = shown.opened if on_demand else shown.closed
    if opened == on_demand:
        names.add(name)
    else:
        names.discard(name)


def show_panel(state: AppState, name: str) -> None:
    """Open a panel, and bring it to the front of its tabs once it is drawn."""
    set_open(state, name, True)
    state.of(ShownPanels).fronts.append(all_panels()[name].title)


def reset_layout(state: AppState) -> None:
    """Restore the initial arrangement of the panels."""
    state.of(ShownPanels).wants_reset = True


def _default_sizes(window: tuple[float, float], letter: float, lines: float, plots: bool) -> _Sizes:
    """Return the sizes of panels for a window; the view keeps at least half of its width.

    ``letter``: font size in the same unit.

    >>> _default_sizes((1280, 800), 15.0, 8.0, False)
    _Sizes(left=281.6, right=320.0, bottom=120.0, rows=2)
    >>> _default_sizes((900, 600), 15.0, 8.0, False)
    _Sizes(left=0.0, right=270.0, bottom=120.0, rows=2)
    >>> _default_sizes((1280, 800), 30.0, 8.0, True)
    _Sizes(left=0.0, right=510.0, bottom=368.0, rows=2)
    """
    width, height = window
    least, most = _CURVES if plots else (max(lines, _TIMELINE[0]), _TIMELINE[1])
    bottom = most * height if plots else min(least * letter, most * height)
    rows = 3 if height >= _THREE_ROWS * letter else 2
    if (_LEFT[0] + _RIGHT[0]) * letter > _MOST * width:
        column = _between(_COLUMN_PART * width, _COLUMN, letter)
        return _Sizes(0.0, min(column, _MOST * width), bottom, 2)
    left = _between(_LEFT_PART * width, _LEFT, letter)
    right = _between(_RIGHT_PART * width, _RIGHT, letter)
    return _Sizes(left, min(right, _MOST * width - left), bottom, rows)


def _between(width: float, limits: tuple[float, float], letter: float) -> float:
    return min(max(width, limits[0] * letter), limits[1] * letter)


def draw_dock(state: AppState) -> int:
    """Draw the dock space and return it; arrange the panels unless the user has done so."""
    shown, layout = state.of(ShownPanels), state.of(Layout)
    dock = imgui.get_id(_DOCK)
    size, style = imgui.get_main_viewport().size, imgui.get_style()
    letter = imgui.get_font_size()
    tracks = sum(actor.clip is not None for actor in state.scene.actors)
    # Tab bar, two rows of controls, ruler and tracks.
    rows = 3.0 * imgui.get_frame_height_with_spacing() + 2.0 * style.window_padding.y
    rows += (tracks + 1.5) * imgui.get_text_line_height_with_spacing()
    plots = any(_is_in_front(PANELS[name].title) for name in ("curves", "joint_match"))
    sizes = _default_sizes((size.x, size.y), letter, rows / letter, plots)
    if imgui.internal.dock_builder_get_node(dock) is None or shown.wants_reset:
        if shown.wants_reset:
            shown.closed.clear()
            shown.opened.clear()
        shown.wants_reset = layout.is_arranged = False
        _build(layout, dock, sizes)
    elif not layout.is_arranged and layout.sizes != sizes:
        old = layout.sizes
        # Other rows or sides have other dock nodes.
        if old is not None and (old.left > 0.0, old.rows) == (sizes.left > 0.0, sizes.rows):
            _resize(layout, sizes)
        else:
            front = _in_front()
            _build(layout, dock, sizes)
            layout.fronts += front
    else:
        # The user has arranged the panels once a panel or an edge is dragged.
        nodes = map(imgui.internal.dock_builder_get_node, layout.nodes.values())
        ends = [node.size_ref for node in nodes if node is not None]
        found = (
            *((title, imgui.internal.find_window_by_name(title).dock_id) for title in _docked()),
            *((round(end.x), round(end.y)) for end in ends),
        )
        left = imgui.MouseButton_.left
        drags = imgui.is_mouse_dragging(left) or imgui.is_mouse_released(left)
        if layout.found and drags and found != layout.found:
            layout.is_arranged = True
        layout.found = found
    # Tab bars scroll to their targets at once: an idle window draws no animation frames.
    for title in _docked():
        node = imgui.internal.find_window_by_name(title).dock_node
        if node is not None and node.tab_bar is not None:
            node.tab_bar.scrolling_anim = node.tab_bar.scrolling_target
    flags = imgui.DockNodeFlags_.passthru_central_node
    flags |= imgui.DockNodeFlags_.no_docking_over_central_node
    imgui.dock_space_over_viewport(dock, imgui.get_main_viewport(), flags)
    return dock


def _build(layout: Layout, dock: int, sizes: _Sizes) -> None:
    """Rebuild the arrangement of all panels."""
    builder, viewport = imgui.internal, imgui.get_main_viewport()
    width, height = max(viewport.size.x, 1.0), max(viewport.size.y, 1.0)
    builder.dock_builder_remove_node(dock)
    builder.dock_builder_add_node(dock, imgui.internal.DockNodeFlagsPrivate_.dock_space)
    builder.dock_builder_set_node_size(dock, viewport.size)
    whole = builder.dock_builder_split_node(dock, imgui.Dir.down, sizes.bottom / height)
    rest = whole.id_at_opposite_dir
    nodes = {"bottom": whole.id_at_dir}
    if sizes.left:
        split = builder.dock_builder_split_node(rest, imgui.Dir.left, sizes.left / width)
        nodes["left"], rest = split.id_at_dir, split.id_at_opposite_dir
    fraction = sizes.right / (width - sizes.left)
    nodes["right"] = builder.dock_builder_split_node(rest, imgui.Dir.right, fraction).id_at_dir
    places = nodes | _rows(nodes["right"], sizes)
    for panel in all_panels().values():
        builder.dock_builder_dock_window(panel.title, places[panel.place])
    builder.dock_builder_finish(dock)
    layout.nodes, layout.sizes, layout.found = nodes, sizes, ()
    # Otherwise, the last panel drawn would be in front of its neighbours.
    firsts = {places[panel.place]: panel.title for panel in reversed(PANELS.values())}
    layout.fronts = list(firsts.values())


def _rows(right: int, sizes: _Sizes) -> dict[str, int]:
    """Split the right side into rows; return the node of each dock."""
    builder = imgui.internal
    fraction = 0.5 if not sizes.left else 0.42 if sizes.rows == 2 else 0.6
    split = builder.dock_builder_split_node(right, imgui.Dir.down, fraction)
    upper, lower = split.id_at_opposite_dir, split.id_at_dir
    if not sizes.left:
        return {"left": upper, "right 1": lower, "right 2": lower, "right 3": lower}
    if sizes.rows == 2:
        return {"right 1": upper, "right 2": lower, "right 3": lower}
    split = builder.dock_builder_split_node(lower, imgui.Dir.down, 0.4)
    return {"right 1": upper, "right 2": split.id_at_opposite_dir, "right 3": split.id_at_dir}


def toggle_panel(state: AppState, name: str) -> None:
    """Close a panel in front; open another one, or bring it to the front if it is open."""
    if is_open(state, name) and _is_in_front(PANELS[name].title):
        set_open(state, name, False)
    else:
        show_panel(state, name)


def bring_to_front(title: str) -> None:
    """Bring a panel in front of its neighbours, and scroll to its tab if there are many."""
    imgui.set_window_focus(title)
    window = imgui.internal.find_window_by_name(title)
    node = None if window is None else window.dock_node
    if window is not None and node is not None and node.tab_bar is not None:
        node.tab_bar.next_selected_tab_id = window.tab_id


def keep_fronts(layout: Layout) -> None:
    """Remember the tabs in front while the panels are hidden."""
    layout.fronts = layout.fronts or _in_front()


def _in_front() -> list[str]:
    return [title for title in _docked() if _is_in_front(title)]


def _is_in_front(title: str) -> bool:
    """Return whether a panel's tab was selected in the previous frame."""
    window = imgui.internal.find_window_by_name(title)
    if window is None or not window.was_active or window.dock_node is None:
        return False
    return bool(window.dock_node.selected_tab_id == window.tab_id)


def _resize(layout: Layout, sizes: _Sizes) -> None:
    """Resize the sides and the bottom."""
    for name, node in layout.nodes.items():
        found = imgui.internal.dock_builder_get_node(node)
        if found is None:
            continue
        wide = {"left": sizes.left, "right": sizes.right}.get(name, found.size.x)
        high = sizes.bottom if name == "bottom" else found.size.y
        imgui.internal.dock_builder_set_node_size(node, (wide, high))
    layout.sizes, layout.found = sizes, ()


def _docked() -> list[str]:
    """Return the titles of panels that have been drawn."""
    titles = [panel.title for panel in all_panels().values()]
    return [title for title in titles if imgui.internal.find_window_by_name(title) is not None]
