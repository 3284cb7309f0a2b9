"""Display panel: visible parts of figures, shading, background and joint overlays."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.fields import begin_field
from viewer.app.core.key_names import with_key
from viewer.app.core.reasons import no_mesh, no_skeleton, no_skin, no_texture
from viewer.app.core.state import AppState
from viewer.app.core.widgets import (
    checkbox,
    choice,
    disabled,
    explain,
    note_item,
    same_line_if_room,
    slider,
)
from viewer.app.view.display_actions import set_shading, show
from viewer.app.view.view_menu import JOINT_TOGGLES
from viewer.phrases import printable
from viewer.rendering.colors import part_colors
from viewer.rendering.gpu.program import SHADING_CHOICES
from viewer.rendering.options import (
    BONES,
    MATCAPS,
    OPACITIES,
    QUALITIES,
    SHOWN,
    parse_color,
    skeleton_opacity,
)
from viewer.rendering.passes.ground_pass import grid_step
from viewer.rig.annotations import BodyParts
from viewer.rig.scene import scene_unit

__all__ = ["draw"]

_BACKGROUNDS = {
    "gradient": "Gradient",
    "white": "White",
    "environment": "Studio",
    "transparent": "Transparent",
    "#": "Colour",
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
        with disabled(state, missing[key]):
            if imgui.radio_button(text, options.show == key):
                show(state, key)
            note_item(state, text)
            explain("", missing[key])
        if key == "skeleton":
            _draw_bones(state, missing[key])
    options.opacity = slider(state, "Opacity", options.opacity, 0.0, 1.0, flags=_CLAMP)
    explain("opacity of all figures")
    if options.show == "both":
        _draw_opacity(state)
    imgui.separator()
    chosen = choice(state, "Shading", options.shading, SHADING_CHOICES)
    if chosen != options.shading:
        set_shading(state, chosen)
    _draw_surface(state)
    _draw_extras(state)
    why = no_mesh(state)
    options.flat = checkbox(state, "Flat", options.flat, why)
    _beside("Wireframe")
    options.wireframe = checkbox(state, "Wireframe", options.wireframe, why)
    options.normals = checkbox(state, "Vertex normals", options.normals, why)
    _beside("Texture")
    options.texture = checkbox(state, "Texture", options.texture, no_texture(state))
    options.cull = checkbox(state, "Cull back faces", options.cull, why)
    grid = f"Grid ({grid_step(state.box):g} {scene_unit(state.scene)}".rstrip() + ")"
    _beside(grid)
    options.grid = checkbox(state, f"{grid}###Grid", options.grid)
    _draw_background(state)
    imgui.separator()
    _draw_joint_toggles(state)
    imgui.separator()
    options.quality = choice(state, "Quality", options.quality, QUALITIES)
    if options.quality != "draft":
        options.shadows = checkbox(state, "Shadows", options.shadows)


_CLAMP = imgui.SliderFlags_.always_clamp


def _draw_surface(state: AppState) -> None:
    """Draw the settings of the chosen shading: a matcap, or the surface of plain materials."""
    options = state.options
    if options.shading == "matcap":
        options.matcap = choice(state, "Matcap", options.matcap, MATCAPS)
    if options.shading == "pbr":
        for name in ("metallic", "roughness"):
            value = slider(state, name.capitalize(), getattr(options, name), 0.0, 1.0, flags=_CLAMP)
            setattr(options, name, value)
            explain("value for materials that do not specify one")


def _draw_bones(state: AppState, why: str) -> None:
    """Draw the style of skeletons next to the button that shows them."""
    imgui.same_line(imgui.get_cursor_pos_x() + imgui.get_content_region_avail().x * 0.5)
    with disabled(state, why):
        imgui.set_next_item_width(-1.0)
        state.options.bones = choice(state, "##bones", state.options.bones, BONES)
        note_item(state, "Bones")
        text = "style of the skeleton; automatic: the boxes of its file, otherwise octahedra"
        explain(text, why)


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
        label = f"{short}###{name}"
        setattr(options, name, checkbox(state, label, getattr(options, name), why))
        explain(with_key(state, text, key))


def _draw_extras(state: AppState) -> None:
    """Draw settings that apply only to some figures: colours, keypoints, meshes, body parts."""
    options, figure = state.options, state.actor.figure
    if any(one.figure.mesh and one.figure.mesh.colors is not None for one in state.scene.actors):
        options.vertex_colors = checkbox(state, "Vertex colours", options.vertex_colors)
        explain("vertex colours of the file, which are multiplied by the colours of materials")
    if any(one.figure.points is not None for one in state.scene.actors):
        name = "Captured keypoints"
        options.captured_keypoints = checkbox(state, name, options.captured_keypoints)
        explain("keypoints of captures, drawn over the bodies")
    if figure.keypoints is not None:
        options.keypoints = checkbox(state, "Keypoints", options.keypoints)
        if figure.reduced is not None:
            _beside("Reduced mesh")
    if figure.reduced is not None:
        options.reduced = checkbox(state, "Reduced mesh", options.reduced)
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
