"""Pass that draws posed meshes: surface, outlines, edges and vertex normals, without skinning."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import moderngl

from viewer.rendering.gpu.back_faces import Region
from viewer.rendering.gpu.draw_state import draw_nearest
from viewer.rendering.gpu.index_sets import IndexSet
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.ownership import Kept
from viewer.rendering.gpu.posed_mesh import PosedMesh
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.studio import STUDIO_SAMPLERS
from viewer.rendering.gpu.surfaces import SAMPLERS, Surface, outline_uniforms
from viewer.rendering.gpu.vertex_arrays import Source, VertexArrays
from viewer.rendering.options import Color, DisplayOptions, Shading
from viewer.rendering.passes.material_runs import Prepare, SortedTriangles, draw_runs, draw_shapes
from viewer.rendering.view import View, set_lights, set_model
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.transform import mean_scale
from viewer.rigs.material import Outline
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.units import METRES

SKIN_COLOR = (0.62, 0.60, 0.57)
"""Default colour of a surface without texture, linear."""

_XRAY_OPACITY = 0.4
_EDGE_COLOR = (0.05, 0.07, 0.10, 0.55)  # sRGB and alpha
_NORMAL_COLOR = (0.10, 0.75, 0.85, 1.0)
_NORMAL_LENGTH = 0.02  # length of drawn normals, relative to the figure's size
_COLORMAP_UNIT = 6


class MeshPass:
    """Pass that draws posed meshes with any shading."""

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.context, self.programs = context, programs
        self._arrays: Kept[PosedMesh, VertexArrays] = Kept()
        self._sorted: Kept[PosedMesh, SortedTriangles] = Kept()

    def draw(
        self,
        mesh: PosedMesh,
        placement: Floats,
        view: View,
        options: DisplayOptions,
        color: Color | None = None,
        blended: bool = False,
        opacity: float = 1.0,
    ) -> None:
        """Draw the opaque or the blended triangles; ``color``: of untextured surfaces, linear."""
        look = mesh.scalars.look if options.shading == "scalar" else None
        corners = "corners" if look is not None else ""
        program = self.programs.drawing(
            "mesh",
            "scalar" if look is not None else shading_of(mesh.mesh, options),
            geometry=corners,
            materials=_uses_materials(mesh, options),
            effects=fragment_macros(mesh.mesh, view, options),
        )
        set_model(program, view, placement, mesh.center)
        set_lights(program, view, options.lights)
        set_surface(program, mesh.mesh, options)
        look_of = {
            "u_color": SKIN_COLOR if color is None else color,
            "u_opacity": opacity * surface_opacity(options),
        }
        set_uniforms(program, look_of)
        if look is not None:
            set_uniforms(program, {"u_colormap": _COLORMAP_UNIT, **look.uniforms})
            mesh.scalars.use(_COLORMAP_UNIT)
        listed = mesh.index_set(options)
        indices: IndexSet | SortedTriangles = listed
        if blended and listed.is_blended:
            indices = self._sorted.get(mesh, lambda: SortedTriangles(self.context))
            indices.sort(mesh, listed, (view.matrix @ placement)[2, :3])
        is_mirrored = mesh.is_mirrored_by(placement)
        array = self.array(mesh, program, indices)
        backs: tuple[Region, ...] | None = None
        # Hidden parts may reveal back faces anywhere.
        if not (blended or mesh.hidden_parts or options.hidden_parts or options.reduced):
            seen_from = view.matrix @ placement, view.projection, self.context.viewport
            backs = mesh.back_faces.regions(*seen_from)
        # Blended surfaces write no depth, so their outlines are drawn below them.
        if blended:
            self._draw_hulls(mesh, placement, view, options, blended, look_of)
        draw_runs(
            array, indices, options, blended=blended, is_mirrored=is_mirrored, back_faces=backs
        )
        if not blended:
            self._draw_hulls(mesh, placement, view, options, blended, look_of)

    def _draw_hulls(
        self,
        mesh: PosedMesh,
        placement: Floats,
        view: View,
        options: DisplayOptions,
        blended: bool,
        look: Mapping[str, object],
    ) -> None:
        """Draw the outlines of toon materials: back faces of a surface moved along its normals."""
        indices = mesh.index_set(options)
        runs = [
            (run, run.surface.outline)
            for run in indices.runs
            if run.surface.outline is not None and run.surface.is_blended == blended
        ]
        is_shown = _uses_materials(mesh, options) and shading_of(mesh.mesh, options) == "pbr"
        if not runs or not is_shown:
            return
        effects = (*fragment_macros(mesh.mesh, view, options), "HULL")
        program = self.programs.drawing(
            "hull", "pbr", fragment="mesh", materials=True, effects=effects
        )
        set_model(program, view, placement, mesh.center)
        set_lights(program, view, options.lights)
        set_surface(program, mesh.mesh, options)
        set_uniforms(program, look)
        array, context = self.array(mesh, program, indices), self.context
        # Camera units per metre.
        scale = mean_scale(placement) / METRES.get(mesh.mesh.figure.unit, 1.0)
        context.enable(moderngl.CULL_FACE)
        context.cull_face = "front"
        context.front_face = "cw" if mesh.is_mirrored_by(placement) else "ccw"
        for run, outline in runs:
            run.surface.use(program, options.texture)
            set_uniforms(program, _hull_uniforms(run.surface, outline, scale, options.texture))
            array.render(moderngl.TRIANGLES, vertices=run.count, first=run.first)
        context.front_face, context.cull_face = "ccw", "back"
        context.disable(moderngl.CULL_FACE)

    def draw_shape(
        self,
        mesh: PosedMesh,
        placement: Floats,
        view: View,
        options: DisplayOptions,
        fragment: str,
        prepare: Prepare,
    ) -> None:
        """Draw the surface with a fragment shader that shows no colours, see ``draw_shapes``."""
        materials = _uses_materials(mesh, options)
        program = self.programs.drawing("mesh", fragment=fragment, materials=materials)
        set_model(program, view, placement, mesh.center)
        set_uniforms(program, {"u_has_tint": has_tints(mesh.mesh, options)})
        indices = mesh.index_set(options)
        array, is_mirrored = self.array(mesh, program, indices), mesh.is_mirrored_by(placement)
        draw_shapes(array, indices, options, fragment, prepare, is_mirrored=is_mirrored)

    def draw_lines(
        self,
        mesh: PosedMesh,
        placement: Floats,
        view: View,
        options: DisplayOptions,
        opacity: float = 1.0,
    ) -> None:
        """Draw the requested edges and normals over the surface."""
        self.context.depth_func = "<="
        if options.wireframe:
            self.draw_edges(mesh, placement, view, options, opacity)
        shape = mesh.mesh.figure.mesh
        if options.normals and shape is not None:
            size = box_size(bounding_box(shape.positions))
            self.draw_normals(mesh, placement, view, size, opacity)
        self.context.depth_func = "<"

    def draw_edges(
        self,
        mesh: PosedMesh,
        placement: Floats,
        view: View,
        options: DisplayOptions,
        opacity: float = 1.0,
    ) -> None:
        """Draw the edges of all triangles over the surface."""
        program = self.programs.drawing("edge", fragment="line")
        set_model(program, view, placement, mesh.center)
        set_uniforms(program, {"u_line_color": _premultiplied(_EDGE_COLOR, opacity)})
        self.context.wireframe = True
        indices = mesh.index_set(options, as_listed=True)
        array = self.array(mesh, program, indices)
        for first, count in indices.spans:
            array.render(moderngl.TRIANGLES, vertices=count, first=first)
        self.context.wireframe = False

    def draw_normals(
        self, mesh: PosedMesh, placement: Floats, view: View, size: float, opacity: float = 1.0
    ) -> None:
        """Draw a line along every vertex normal; ``size`` is the figure's size."""
        program = self.programs.drawing("line")
        set_model(program, view, placement, mesh.center)
        color = _premultiplied(_NORMAL_COLOR, opacity)
        set_uniforms(program, {"u_line_color": color, "u_length": _NORMAL_LENGTH * size})
        shown = mesh.mesh.lines_shown(mesh.hidden_parts)
        content = [
            (mesh.posed, "3f4 3f4/i", "in_position", "in_normal"),
            (shown, "f4/i", "in_shown"),
        ]
        array = self._arrays_of(mesh).get(program, lambda: content)
        array.render(moderngl.LINES, vertices=2, instances=mesh.mesh.n_vertices)

    def array(
        self, mesh: PosedMesh, program: moderngl.Program, indices: IndexSet | SortedTriangles
    ) -> moderngl.VertexArray:
        """Return the mesh's vertex array for a program, with the attributes that it uses."""

        def content() -> list[Source]:
            found = [(mesh.posed, "3f4 3f4", "in_position", "in_normal"), *mesh.mesh.attributes()]
            if mesh.scalars.values is not None:
                found.append((mesh.scalars.values, "f4", "in_scalar"))
            return found

        buffer = indices.indices
        return self._arrays_of(mesh).get(program, content, buffer, (id(buffer),))

    def _arrays_of(self, mesh: PosedMesh) -> VertexArrays:
        return self._arrays.get(mesh, lambda: VertexArrays(self.context))

    def forget(self, mesh: PosedMesh) -> None:
        """Free the vertex arrays of a mesh that is about to be released."""
        self._arrays.drop(mesh)
        self._sorted.drop(mesh)

    def release(self) -> None:
        """Free all vertex arrays and index buffers."""
        self._arrays.keep_only([])
        self._sorted.keep_only([])


def shading_of(mesh: MeshBuffers, options: DisplayOptions) -> Shading:
    """Return the shading of a mesh, a key of ``SHADING``."""
    # "auto" follows the materials, as does "scalar" if there are no values.
    if options.shading not in ("auto", "scalar"):
        return options.shading
    return "pbr" if mesh.is_physical else "phong"


def surface_opacity(options: DisplayOptions) -> float:
    """Return the opacity of surfaces, 0 to 1."""
    # Colours of scalar quantities must match the legend, so these surfaces stay opaque.
    return _XRAY_OPACITY if options.xray and options.shading != "scalar" else 1.0


def draw_layer(
    context: moderngl.Context, options: DisplayOptions, draw: Callable[[], object]
) -> None:
    """Draw surfaces; twice, and only the nearest layer, if they are translucent."""
    if surface_opacity(options) == 1.0:
        draw()
    else:
        draw_nearest(context, draw)


def fragment_macros(mesh: MeshBuffers, view: View, options: DisplayOptions) -> tuple[str, ...]:
    """Return the macros of the fragment shader that draws a mesh."""
    is_textured = mesh.has_materials or (options.texture and mesh.is_textured)
    return view.effects.defines if is_textured else (*view.effects.defines, "UNTEXTURED")


def _uses_materials(mesh: PosedMesh, options: DisplayOptions) -> bool:
    """Return whether a mesh is drawn with its materials, which scalar quantities replace."""
    has_values = options.shading == "scalar" and mesh.scalars.look is not None
    return mesh.mesh.has_materials and not has_values


def has_tints(mesh: MeshBuffers, options: DisplayOptions) -> bool:
    """Return whether a mesh is drawn with its vertex colours."""
    return options.vertex_colors and mesh.tints is not None


def set_surface(program: moderngl.Program, mesh: MeshBuffers, options: DisplayOptions) -> None:
    """Set the uniforms of a figure's surface."""
    values = {
        "u_flat": options.flat,
        "u_opacity": surface_opacity(options),
        "u_has_uv": mesh.uvs is not None,
        "u_has_colors": options.shading == "parts" and mesh.colors is not None,
        "u_has_tint": has_tints(mesh, options),
        **SAMPLERS,
        **STUDIO_SAMPLERS,
    }
    set_uniforms(program, values)


def _premultiplied(color: tuple[float, float, float, float], opacity: float) -> tuple[float, ...]:
    alpha = opacity * color[3]
    red, green, blue = (alpha * channel for channel in color[:3])
    return red, green, blue, alpha


def _hull_uniforms(
    surface: Surface, outline: Outline, scale: float, textured: bool
) -> dict[str, object]:
    """Return the uniforms of an outline; ``scale``: camera units per metre."""
    unit, factor = SAMPLERS["u_occlusion_map"], 1.0 if outline.mode == "screen" else scale
    has_map = textured and any(used == unit for used, _ in surface.textures)
    values = outline_uniforms(outline, surface.uniforms, has_map)
    return {**values, "u_hull_width": factor * outline.width}
