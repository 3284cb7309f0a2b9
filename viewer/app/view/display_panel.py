"""Display panel and View menu: visible parts, shading, background, overlays, and their actions."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.fields import begin_field
from viewer.app.core.reasons import no_mesh, no_skeleton, no_skin, no_texture
from viewer.app.core.state import AppState
from viewer.app.core.widgets import (
    begin_menu,
    checkbox,
    choice,
    draw_setting,
    menu_item,
    note_item,
    radio,
    same_line_if_room,
    slider,
    with_key,
)
from viewer.app.view.axis_gizmo import AxisGizmo
from viewer.app.view.camera_panel import (
    fit_selection,
    fit_view,
    fly_to,
    look_through,
    toggle_projection,
)
from viewer.app.view.outlines import Outlines, toggle_outlines
from viewer.app.weights.weights_panel import (
    Weights,
    no_view,
    start_heat_map,
    toggle_picking,
    toggle_vertex_info,
    toggle_weights,
    unpin,
)
from viewer.phrases import printable
from viewer.rendering.camera import VIEWS
from viewer.rendering.colors import part_colors
from viewer.rendering.gpu.program import SHADING_CHOICES
from viewer.rendering.options import (
    BONES,
    OPACITIES,
    SHOWN,
    Bones,
    Lights,
    Shading,
    parse_color,
    skeleton_opacity,
)
from viewer.rendering.passes.ground_pass import grid_step
from viewer.rigs.annotations import BodyParts
from viewer.rigs.scene import Shown, scene_unit

_BACKGROUNDS = {
    "gradient": "Gradient",
    "white": "White",
    "environment": "Studio",
    "transparent": "Transparent",
    "#": "Colour",
}
_CLAMP = int(imgui.SliderFlags_.always_clamp)
JOINT_TOGGLES = {
    "xray": ("X-ray", "B"),
    "joint_names": ("Joint names", "J"),
    "joint_axes": ("Joint axes", "Shift+J"),
}
"""Display options for joints, with their label and key."""
_SURFACE_TOGGLES = {
    "wireframe": ("Wireframe", "W"),
    "normals": ("Vertex normals", "N"),
    "texture": ("Texture", "T"),
}
_VIEW_KEYS = {
    "front": "1",
    "back": "Ctrl+1",
    "left": "3",
    "right": "Ctrl+3",
    "top": "7",
    "bottom": "Ctrl+7",
}


def draw(state: AppState) -> None:
    """Draw the panel."""
    options = state.options
    missing = {
        "skin": no_mesh(state),
        "skeleton": no_skeleton(state),
        "both": no_mesh(state) or no_skeleton(state),
        "binding": no_skin(state),
    }
    for key, text in SHOWN.items():
        if radio(state, text, options.show == key, why=missing[key]):
            show(state, key)
        if key == "skeleton":
            _draw_bones(state, missing[key])
    draw_setting(state, "Opacity", options, "opacity", "opacity of all figures")
    if options.show == "both":
        _draw_opacity(state)
    imgui.separator()
    chosen = choice(state, "Shading", options.shading, SHADING_CHOICES)
    if chosen != options.shading:
        set_shading(state, chosen)
    if options.shading == "matcap":
        draw_setting(state, "Matcap", options, "matcap")
    if options.shading == "pbr":
        for name in ("metallic", "roughness"):
            text = "value for materials that do not specify one"
            draw_setting(state, name.capitalize(), options, name, text)
    _draw_extras(state)
    for name, text, reason in (
        ("flat", "Flat", no_mesh),
        ("wireframe", "Wireframe", no_mesh),
        ("normals", "Vertex normals", no_mesh),
        ("texture", "Texture", no_texture),
        ("cull", "Cull back faces", no_mesh),
    ):
        if name in ("wireframe", "texture"):
            _beside(text)
        draw_setting(state, text, options, name, why=reason(state))
    grid = f"Grid ({grid_step(state.box):g} {scene_unit(state.scene)}".rstrip() + ")"
    _beside(grid)
    draw_setting(state, f"{grid}###Grid", options, "grid")
    _draw_background(state)
    imgui.separator()
    _draw_joint_toggles(state)
    imgui.separator()
    draw_setting(state, "Quality", options, "quality")
    if options.quality != "draft":
        draw_setting(state, "Shadows", options, "shadows")


def _draw_bones(state: AppState, why: str) -> None:
    """Draw the style of skeletons next to the button that shows them."""
    imgui.same_line(imgui.get_cursor_pos_x() + imgui.get_content_region_avail().x * 0.5)
    imgui.set_next_item_width(-1.0)
    text = "style of the skeleton; automatic: the boxes of its file, otherwise octahedra"
    draw_setting(state, "##bones", state.options, "bones", text, why)
    note_item(state, "Bones")


def _draw_opacity(state: AppState) -> None:
    """Draw the opacity of the skeleton, which is the style's default until the slider is moved."""
    options, skeleton = state.options, state.actor.figure.skeleton
    usual = OPACITIES["boxes"] if skeleton is None else skeleton_opacity(skeleton, options)
    shown = usual if options.skeleton_opacity is None else options.skeleton_opacity
    moved = slider(state, "Skeleton opacity", shown, 0.0, 1.0, flags=_CLAMP)
    if moved != shown:
        options.skeleton_opacity = moved


def _draw_joint_toggles(state: AppState) -> None:
    """Draw check boxes for joint overlays, in one line if there is room."""
    options, why = state.options, no_skeleton(state)
    for name, (text, key) in JOINT_TOGGLES.items():
        short = text.removeprefix("Joint ").capitalize()
        if name != "xray":
            same_line_if_room(short)
        draw_setting(state, f"{short}###{name}", options, name, with_key(state, text, key), why)


def _draw_extras(state: AppState) -> None:
    """Draw settings that apply only to some figures: colours, keypoints, meshes, body parts."""
    options, figure = state.options, state.actor.figure
    if any(one.figure.mesh and one.figure.mesh.colors is not None for one in state.scene.actors):
        text = "vertex colours of the file, which are multiplied by the colours of materials"
        draw_setting(state, "Vertex colours", options, "vertex_colors", text)
    if any(one.figure.points is not None for one in state.scene.actors):
        text = "keypoints of captures, drawn over the bodies"
        draw_setting(state, "Captured keypoints", options, "captured_keypoints", text)
    if figure.keypoints is not None:
        draw_setting(state, "Keypoints", options, "keypoints")
        if figure.reduced is not None:
            _beside("Reduced mesh")
    if figure.reduced is not None:
        draw_setting(state, "Reduced mesh", options, "reduced")
    if figure.body_parts is not None:
        _draw_parts(state, figure.body_parts)


def _draw_parts(state: AppState, parts: BodyParts) -> None:
    """Draw a check box for every body part that has vertices, with its colour."""
    is_open = imgui.tree_node("Body parts")
    note_item(state, "Body parts")
    if not is_open:
        return
    hidden, present = set(state.options.hidden_parts), set(parts.of_vertex.tolist())
    colors = part_colors(len(parts.names)) ** (1 / 2.2)
    for index in sorted(present):
        r, g, b = (float(channel) for channel in colors[index])
        flags = imgui.ColorEditFlags_.no_tooltip | imgui.ColorEditFlags_.no_drag_drop
        imgui.color_button(f"##part{index}", (r, g, b, 1.0), flags)
        imgui.same_line()
        shown = checkbox(state, printable(parts.names[index], 40), index not in hidden)
        hidden = hidden - {index} if shown else hidden | {index}
    state.options.hidden_parts = tuple(sorted(hidden))
    imgui.tree_pop()


def _beside(text: str) -> None:
    """Place a check box with this text in the right half of the last line if it fits."""
    start, room = imgui.get_cursor_screen_pos().x, imgui.get_content_region_avail().x
    gap = imgui.get_style().item_spacing.x
    begins_free = imgui.get_item_rect_max().x + gap <= start + room * 0.5
    if begins_free and imgui.get_frame_height() + gap + imgui.calc_text_size(text).x <= room * 0.5:
        imgui.same_line(imgui.get_cursor_pos_x() + room * 0.5)


def _draw_background(state: AppState) -> None:
    """Draw the choice of a background, and its colour if it is plain."""
    options = state.options
    is_color = options.background.startswith("#")
    chosen = choice(state, "Background", "#" if is_color else options.background, _BACKGROUNDS)
    if chosen != "#":
        options.background = chosen
        return
    color = parse_color(options.background) if is_color else (1.0, 1.0, 1.0)
    changed, picked = imgui.color_edit3(begin_field("Colour"), list(color))
    note_item(state, "Colour")
    if changed or not is_color:
        digits = "".join(f"{round(255 * min(max(c, 0.0), 1.0)):02x}" for c in picked[:3])
        options.background = f"#{digits}"


def toggle_skeleton(state: AppState) -> None:
    """Show or hide the skeleton together with the skin."""
    shown: dict[Shown, Shown] = {
        "skin": "both",
        "both": "skin",
        "skeleton": "skin",
        "binding": "skeleton",
    }
    show(state, shown[state.options.show])


def toggle_binding(state: AppState) -> None:
    """Switch between the posed skin and the skin in its bind pose."""
    show(state, "skin" if state.options.show == "binding" else "binding")


def show(state: AppState, what: Shown) -> None:
    """Choose the visible parts, and show a status message."""
    state.options.show = what
    state.say_status(SHOWN[what])


def set_shading(state: AppState, name: Shading) -> None:
    """Choose the shading, and a scalar quantity if needed."""
    state.options.shading = name
    if name == "scalar":
        start_heat_map(state)


def toggle_option(state: AppState, name: str, text: str) -> None:
    """Toggle a display option, and show its new state."""
    value = not getattr(state.options, name)
    setattr(state.options, name, value)
    state.say_status(f"{text} {'on' if value else 'off'}")


def show_bones(state: AppState, style: Bones) -> None:
    """Choose the style of skeletons, and show a status message."""
    state.options.bones = style
    state.say_status(f"Bones: {BONES[style].lower()}")


def toggle_gizmo(state: AppState) -> None:
    """Show or hide the axis gizmo of the view."""
    gizmo = state.of(AxisGizmo)
    gizmo.is_shown = not gizmo.is_shown
    state.say_status(f"Axis gizmo {'on' if gizmo.is_shown else 'off'}")


def reset_lights(state: AppState) -> None:
    """Reset both lights, the ambient light and the highlight to their defaults."""
    state.options.lights = Lights()


def draw_view_menu(state: AppState) -> None:
    """Draw the menu in the menu bar."""
    if not begin_menu(state, "View"):
        return
    draw_views(state)
    _draw_cameras(state)
    imgui.separator()
    # Draw the items of surfaces and skeletons.
    options, no_bones = state.options, no_skeleton(state)
    for name, (text, key) in _SURFACE_TOGGLES.items():
        why = no_texture(state) if name == "texture" else no_mesh(state)
        if menu_item(state, text, key, getattr(options, name), why):
            toggle_option(state, name, text)
    shows = options.show in ("skeleton", "both")
    if menu_item(state, "Skeleton##shown", "S", shows, no_bones):
        toggle_skeleton(state)
    if begin_menu(state, "Bones", not no_bones):
        draw_bone_styles(state)
        imgui.end_menu()
    for name, (text, key) in JOINT_TOGGLES.items():
        if menu_item(state, text, key, getattr(options, name), no_bones):
            toggle_option(state, name, text)
    imgui.separator()
    _draw_vertices(state)
    imgui.separator()
    if menu_item(state, "Grid", "G", state.options.grid):
        toggle_option(state, "grid", "Grid")
    if menu_item(state, "Axis gizmo", "", state.of(AxisGizmo).is_shown):
        toggle_gizmo(state)
    if menu_item(state, "Selection outlines", "", state.of(Outlines).is_shown):
        toggle_outlines(state)
    if menu_item(state, "Hide menus and panels", "Tab"):
        state.panels_visible = False
    imgui.end_menu()


def draw_views(state: AppState) -> None:
    """Draw the items of named views, fitting and projection."""
    for name in VIEWS:
        if menu_item(state, f"{name.capitalize()} view", _VIEW_KEYS[name]):
            fly_to(state, name)
    imgui.separator()
    if menu_item(state, "Fit all", "F"):
        fit_view(state)
    if menu_item(state, "Fit selection", "."):
        fit_selection(state)
    if menu_item(state, "Orthographic view", "5", state.camera.orthographic):
        toggle_projection(state)


def _draw_cameras(state: AppState) -> None:
    """Draw the submenu of calibrated cameras if there are any."""
    views = state.scene.views
    if not views or not begin_menu(state, "Calibrated camera"):
        return
    for number, view in enumerate(views):
        text = f"{printable(view.name, 60)}##camera{number}"
        if menu_item(state, text, "", state.camera.fixed is view):
            look_through(state, number)
    imgui.end_menu()


def draw_bone_styles(state: AppState) -> None:
    """Draw an item for each style of skeletons."""
    for style, text in BONES.items():
        if menu_item(state, f"{text}##bones", "", state.options.bones == style):
            show_bones(state, style)


def _draw_vertices(state: AppState) -> None:
    """Draw the items of weights and vertices."""
    options, view = state.options, state.of(Weights)
    shows = options.shading == "scalar" and options.scalar == "weight"
    text = "Weights of the selected joint"
    if menu_item(state, text, "V", shows, "" if shows else no_view(state, "weight")):
        toggle_weights(state)
    why = no_mesh(state)
    if menu_item(state, "Inspect vertex under cursor", "", view.always_shows_info, why):
        toggle_vertex_info(state)
    if menu_item(state, "Pick vertices", "", view.picks_vertices, why):
        toggle_picking(state)
    why = "" if view.pinned is not None else "no vertex is pinned: Alt+click one"
    if menu_item(state, "Unpin vertex", "Esc", why=why):
        unpin(state)
