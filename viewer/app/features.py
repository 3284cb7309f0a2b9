"""Tables of the panels and keys that features add to the window.

A panel is a module ``<name>_panel.py`` of its feature's folder with ``draw(state)``; a key runs a
function of the state. Both are imported on first use.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from types import ModuleType

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.data_classes import dataclass

_CTRL, _SHIFT = imgui.Key.mod_ctrl, imgui.Key.mod_shift
_K = imgui.Key
_OPTION = "view.display_actions.toggle_option"
_LOOK = "view.camera_actions.look"
_TOOL = "posing.tool_actions.choose_tool"
_UNDO = "core.undo_actions"
_STEP = "playback.actions.step"
_ANIMATION = "playback.animations.step_animation"

_MOVED = {
    "cancel": "keys",
    "palette.palette_window": "palette",
    "playback.actions": "playback.timeline_panel",
    "posing.pose_actions": "posing.posing",
    "posing.tool_actions": "posing.toolbar",
    "view.camera_actions": "view.camera_panel",
    "view.display_actions": "view.display_panel",
    "weights.actions": "weights.weights_panel",
    "window_actions": "keys",
}
"""Present modules of actions that ``KEYS`` calls by older names.

Preferences store an action of ``KEYS`` by its name, so the name stays when the function moves.
"""


@dataclass(frozen=True, slots=True)
class Panel:
    """Entry of a panel, with the properties that the layout needs."""

    feature: str
    """Folder of the panel's module, ``<name>_panel.py``."""
    title: str
    """Title of its tab."""
    place: str
    """Initial dock: ``"left"``, ``"bottom"``, or ``"right 1"`` to ``"right 3"`` downwards."""
    needs: str = ""
    """Part of ``Figure`` without which the panel is hidden. ``"motion"`` requires a motion,
    ``"actors"`` a motion or several actors, ``"parts"`` a mesh of several parts, ``"drive"`` a
    motion of another skeleton; empty if the panel is always available."""
    leads: bool = False
    """Whether it is brought to the front of its tabs when a scene makes it available."""
    on_demand: bool = False
    """Whether it is closed until the user opens it."""


@dataclass(frozen=True, slots=True)
class Shortcut:
    """A key and its action."""

    chords: tuple[int, ...]
    """ImGui's key codes with modifiers."""
    label: str
    """Name of the key."""
    text: str
    """Effect of the key, as shown in lists of keys."""
    action: str
    """Module and function within ``viewer.app``, called with the state."""
    arguments: tuple[object, ...] = ()
    """Additional arguments of the action."""

    @property
    def name(self) -> str:
        """Name of the action in the preferences: it stays the same when keys and labels change."""
        return " ".join([self.action, *map(str, self.arguments)])

    def run(self, state: AppState) -> None:
        """Run the action."""
        function_of(self.action)(state, *self.arguments)


@dataclass(frozen=True, slots=True)
class Action:
    """An action without a key, for the command palette."""

    text: str
    """Name of the action."""
    action: str
    """Module and function within ``viewer.app``; called with the state."""
    arguments: tuple[object, ...] = ()
    """Additional arguments of the action."""
    why: str = ""
    """Function of the state that returns the reason why the action is disabled; empty if it is
    always enabled."""

    def run(self, state: AppState) -> None:
        """Run the action."""
        function_of(self.action)(state, *self.arguments)

    def reason(self, state: AppState) -> str:
        """Return the reason why it is disabled; empty if it can be run."""
        return str(function_of(self.why)(state)) if self.why else ""


def function_of(path: str) -> Callable[..., object]:
    """Return a function of ``viewer.app``, imported on first use."""
    module, _, name = path.rpartition(".")
    place = _MOVED.get(module, module)
    found: Callable[..., object] = getattr(import_module(f"viewer.app.{place}"), name)
    return found


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

KEYS = (
    Shortcut((_K.r,), "R", "reset the pose to the file's pose", "posing.pose_actions.reset_pose"),
    Shortcut((_K.s,), "S", "show or hide the skeleton", "view.display_actions.toggle_skeleton"),
    Shortcut(
        (_K.k,),
        "K",
        "posed skin, or skin in bind pose",
        "view.display_actions.toggle_binding",
    ),
    Shortcut((_K.w,), "W", "wireframe", _OPTION, ("wireframe", "Wireframe")),
    Shortcut((_K.n,), "N", "vertex normals", _OPTION, ("normals", "Vertex normals")),
    Shortcut((_K.t,), "T", "texture", _OPTION, ("texture", "Texture")),
    Shortcut((_K.g,), "G", "ground grid", _OPTION, ("grid", "Grid")),
    Shortcut((_K.a,), "A", "rigged or original mesh (A/B)", "rigging.results.switch_version"),
    Shortcut((_K.b,), "B", "x-ray: skeleton through the skin", _OPTION, ("xray", "X-ray")),
    Shortcut((_K.j,), "J", "joint names", _OPTION, ("joint_names", "Joint names")),
    Shortcut((_SHIFT | _K.j,), "Shift+J", "joint axes", _OPTION, ("joint_axes", "Joint axes")),
    Shortcut((_K.v,), "V", "weights of the selected joint", "weights.actions.toggle_weights"),
    Shortcut((_K.f,), "F", "fit the view", "view.camera_actions.fit_view"),
    Shortcut(
        (_K.period, _K.keypad_decimal),
        ".",
        "fit the selected joint or actor",
        "view.camera_actions.fit_selection",
    ),
    Shortcut((_K._1, _K.keypad1), "1", "front view", _LOOK, ("front",)),
    Shortcut((_K._3, _K.keypad3), "3", "side view", _LOOK, ("left",)),
    Shortcut((_K._7, _K.keypad7), "7", "top view", _LOOK, ("top",)),
    Shortcut((_CTRL | _K._1, _CTRL | _K.keypad1), "Ctrl+1", "back view", _LOOK, ("back",)),
    Shortcut((_CTRL | _K._3, _CTRL | _K.keypad3), "Ctrl+3", "other side", _LOOK, ("right",)),
    Shortcut((_CTRL | _K._7, _CTRL | _K.keypad7), "Ctrl+7", "view from below", _LOOK, ("bottom",)),
    Shortcut(
        (_K._5, _K.keypad5),
        "5",
        "orthographic or perspective",
        "view.camera_actions.toggle_projection",
    ),
    Shortcut((_K.tab,), "Tab", "hide or show the panels", "window_actions.toggle_panels"),
    Shortcut((_K.h, _SHIFT | _K.slash, _K.f1), "H or ?", "this list", "window_actions.toggle_keys"),
    Shortcut((_CTRL | _K.p,), "Ctrl+P", "find an action", "palette.palette_window.toggle_palette"),
    Shortcut((_CTRL | _K.m,), "Ctrl+M", "message log", "window_actions.toggle_messages"),
    Shortcut((_K.f12,), "F12", "save a screenshot", "window_actions.want", ("screenshot",)),
    Shortcut((_CTRL | _K.o,), "Ctrl+O", "open files", "window_actions.want", ("open dialog",)),
    Shortcut(
        (_CTRL | _K.comma,),
        "Ctrl+,",
        "preferences",
        "preferences.preferences_window.open_preferences",
    ),
    Shortcut((_CTRL | _K.z,), "Ctrl+Z", "undo", f"{_UNDO}.undo"),
    Shortcut(
        (_CTRL | _SHIFT | _K.z, _CTRL | _K.y), "Ctrl+Shift+Z", "redo", "core.undo_actions.redo"
    ),
    Shortcut((_K.q,), "Q", "Select tool: click selects", _TOOL, ("select",)),
    Shortcut((_K.e,), "E", "Rotate tool: rotate the selected joint", _TOOL, ("rotate",)),
    Shortcut((_K.d,), "D", "Move tool: drag a joint (IK)", _TOOL, ("move",)),
    Shortcut((_K.x,), "X", "local, parent or world axes", "posing.tool_actions.next_orientation"),
    Shortcut((_K.m,), "M", "mirror the pose left to right", "posing.pose_actions.mirror"),
    Shortcut((_CTRL | _K.c,), "Ctrl+C", "copy the pose", "posing.pose_actions.copy_pose"),
    Shortcut(
        (_CTRL | _SHIFT | _K.c,),
        "Ctrl+Shift+C",
        "copy the pose as raw pose values",
        "posing.pose_actions.copy_numbers",
    ),
    Shortcut((_CTRL | _K.v,), "Ctrl+V", "paste a pose", "posing.pose_actions.paste_pose"),
    Shortcut((_K.space,), "Space", "play or pause", "playback.actions.play"),
    Shortcut((_K.left_arrow,), "Left", "one frame back", _STEP, (-1,)),
    Shortcut((_K.right_arrow,), "Right", "one frame forward", _STEP, (1,)),
    Shortcut((_SHIFT | _K.left_arrow,), "Shift+Left", "ten frames back", _STEP, (-10,)),
    Shortcut((_SHIFT | _K.right_arrow,), "Shift+Right", "ten frames forward", _STEP, (10,)),
    Shortcut(
        (_K.home,), "Home", "first frame of the range", "playback.actions.go_to_end", (False,)
    ),
    Shortcut((_K.end,), "End", "last frame of the range", "playback.actions.go_to_end", (True,)),
    Shortcut((_K.left_bracket,), "[", "previous animation", _ANIMATION, (-1,)),
    Shortcut((_K.right_bracket,), "]", "next animation", _ANIMATION, (1,)),
    Shortcut((_K.i,), "I", "start the range here", "playback.actions.range_in"),
    Shortcut((_K.o,), "O", "end the range here", "playback.actions.range_out"),
    Shortcut((_K.escape,), "Esc", "close the topmost dialog", "cancel.cancel"),
    Shortcut((_CTRL | _K.q,), "Ctrl+Q", "quit", "window_actions.want", ("quit",)),
)
"""Keys in the order in which they are listed."""

_WANT = "keys.want"
_ROOM = "core.reasons.no_job_room"
_MATCH = "retargeting.joint_match_panel"
_NO_EDIT = "retargeting.drive_changes.no_edit"

ACTIONS = (
    Action("Open the bundled figure", _WANT, ("open bundled",)),
    Action("Open the bundled body", _WANT, ("open body",)),
    Action("Save pose…", "posing.posing.ask_for_pose", why="core.reasons.no_pose"),
    Action("Export…", "menus.ask_for_export", why=_ROOM),
    Action(
        "Export motion…",
        "files.motion_export.ask_for_motion",
        why="core.reasons.nothing_to_export",
    ),
    Action("Record pictures or video…", "recording.record_dialog.open_record_dialog", why=_ROOM),
    Action("Check the rig", "linting.lint_panel.check_rig", why=_ROOM),
    Action("New clip", "curves.editing.new_clip", why="core.reasons.no_new_clip"),
    Action(
        "Key the pose at the current time",
        "posing.toolbar.key_pose_now",
        why="posing.toolbar.no_keys",
    ),
    Action("Reset the pose of this actor", "posing.posing.reset_actor"),
    Action("Reset shape", "posing.posing.reset_shape"),
    Action("Random shape", "posing.posing.random_shape"),
    Action("Match joints automatically", f"{_MATCH}.match_automatically", why=_NO_EDIT),
    Action("Load joint map…", f"{_MATCH}.ask_for_map", why=_NO_EDIT),
    Action("Save joint map…", f"{_MATCH}.ask_where_to_save", why="core.reasons.no_drive"),
    Action("Show all parts", "actors.parts_panel.show_all_parts", why="core.reasons.no_parts"),
    Action("Feet on the ground", "retargeting.drive_changes.toggle_feet", why=_NO_EDIT),
    Action("Springs", "actors.actors_panel.toggle_springs", why="actors.actors_panel.no_springs"),
    Action("Reset lights", "view.display_panel.reset_lights"),
    Action("Axis gizmo", "view.display_panel.toggle_gizmo"),
    Action("Selection outlines", "view.outlines.toggle_outlines"),
    Action("Pick vertices", "weights.weights_panel.toggle_picking", why="core.reasons.no_mesh"),
    Action(
        "Inspect vertex under cursor",
        "weights.weights_panel.toggle_vertex_info",
        why="core.reasons.no_mesh",
    ),
    Action("Reset layout", "layout.reset_layout"),
)
"""Actions of menus and panels that have no key."""

MOUSE = (
    ("Click", "select an actor or joint"),
    ("Double click", "aim the camera there"),
    ("Alt click", "explain this vertex"),
    ("Left drag", "orbit"),
    ("Right drag, Shift drag", "pan"),
    ("Right click", "menu of actions"),
    ("Wheel", "zoom to the pointer"),
    ("Alt drag in the timeline", "seek between whole frames"),
    ("Axis gizmo", "click for a view, drag to orbit"),
    ("Drop files", "open them"),
)
"""Actions of the mouse, listed with the keys."""


def key_of(action: str, *arguments: object) -> str:
    """Return the name of the key that runs an action; empty if none does."""
    found = (key.label for key in KEYS if (key.action, key.arguments) == (action, arguments))
    return next(found, "")


def panel_module(name: str) -> ModuleType:
    """Return a panel's module, imported on first use."""
    return import_module(f"viewer.app.{PANELS[name].feature}.{name}_panel")
