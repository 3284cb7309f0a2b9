"""Stats panel: size of the scene, frames, renderer, and the facts in the file of the figure."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.phrases import printable
from viewer.rigs.figure import Figure
from viewer.rigs.memo import Memo
from viewer.rigs.scene import Scene
from viewer.rigs.skeleton import shown_joints
from viewer.rigs.skin import influence_counts

_LONGEST = 400  # maximum length of a text in characters
_known: Memo[Scene, tuple[tuple[str, str], ...]] = Memo()


def draw(state: AppState) -> None:
    """Draw the panel."""
    figures = tuple(actor.figure for actor in state.scene.actors)
    for name, value in (
        *_known.get(state.scene, figures, lambda: _counts(figures)),
        ("Frame", f"{state.stats.frame_ms:.1f} ms" if state.stats.frame_ms else "not measured"),
        ("Renderer", state.stats.renderer),
        ("OpenGL", state.stats.version),
        ("Samples", f"{state.stats.samples or 1} per pixel"),
        *state.stats.live,
    ):
        imgui.text_disabled(name)
        imgui.same_line(imgui.get_font_size() * 6)
        imgui.text_wrapped(value)
    _draw_facts(state.actor.figure)


def _draw_facts(figure: Figure) -> None:
    """Draw what the chosen figure's file says about it, such as author, licence and permissions."""
    if not figure.facts:
        return
    imgui.separator_text("File")
    if not imgui.begin_table("facts", 2):
        return
    imgui.table_setup_column("heading", imgui.TableColumnFlags_.width_stretch, 0.4)
    imgui.table_setup_column("text", imgui.TableColumnFlags_.width_stretch, 0.6)
    faint = imgui.get_style_color_vec4(imgui.Col_.text_disabled)
    for heading, text in figure.facts:
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.push_style_color(imgui.Col_.text, faint)
        imgui.text_wrapped(f"{heading[:1].upper()}{heading[1:]}")
        imgui.pop_style_color()
        imgui.table_next_column()
        imgui.text_wrapped(printable(text, _LONGEST))
    imgui.end_table()


def _counts(figures: tuple[Figure, ...]) -> tuple[tuple[str, str], ...]:
    skeletons = [figure.skeleton for figure in figures if figure.skeleton is not None]
    meshes = [figure.mesh for figure in figures if figure.mesh is not None]
    skins = [figure.skin for figure in figures if figure.skin is not None]
    most = max((int(influence_counts(skin).max()) for skin in skins), default=0)
    return (
        ("Figure", printable(", ".join(figure.name for figure in figures), 60)),
        ("Joints", f"{sum(len(shown_joints(skeleton)) for skeleton in skeletons):,}"),
        ("DOFs", f"{sum(skeleton.n_dofs for skeleton in skeletons):,}"),
        ("Vertices", f"{sum(mesh.n_vertices for mesh in meshes):,}"),
        ("Triangles", f"{sum(mesh.n_triangles for mesh in meshes):,}"),
        ("Influences", f"{sum(len(skin.joints) for skin in skins):,}, at most {most} per vertex"),
    )
