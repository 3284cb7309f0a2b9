"""A figure's mesh and skin on the GPU, uploaded on first use and never changed.

A vertex has a range of influences in a list of (joint, weight) pairs, the strongest pair first.
"""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np

from viewer.rendering.gpu.corrective_sums import CorrectiveSums
from viewer.rendering.gpu.index_sets import (
    IndexSet,
    curve_order,
    index_set,
    kept_triangles,
    split_vertices,
    triangle_order,
)
from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.surfaces import drawn_sets, needs_materials, upload_surfaces
from viewer.rendering.gpu.upload import buffer, float32, pair_texture
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.topology import Shell, shell_of
from viewer.rigs.mesh import bounding_box, visible_vertices
from viewer.rigs.skin import (
    Skin,
    has_influence,
    joint_fractions,
    strongest_first,
    weight_sums,
)
from viewer.rigs.skinning import Skinning, skin_used

_MOST_VISIBLE = 64  # maximum number of combinations of hidden parts whose runs are cached


class MeshBuffers:
    """Rest vertices, triangle indices, influences and textures of one figure.

    Along texture seams, a vertex is uploaded once per texture coordinate, as several split
    vertices. Positions are stored relative to ``center``, (3,) in figure space, so that float32
    keeps its precision even if the mesh is far from the origin. ``sources``: (R,) int32, vertex of
    the figure for each split vertex. ``copies``: (V,) int32, one split vertex for each vertex.
    """

    def __init__(self, context: moderngl.Context, figure: Figure, notes: list[str]) -> None:
        mesh = figure.require_mesh()
        self.context, self.figure = context, figure
        self.sources, uv_indices, self.triangles = split_vertices(figure)
        self.n_vertices = len(self.sources)
        self.copies: Ints = np.empty(mesh.n_vertices, dtype=np.int32)
        self.copies[self.sources] = np.arange(self.n_vertices)
        self.center: Floats = bounding_box(mesh.positions).mean(axis=0)
        self._owner = Owner()
        self._index_sets: dict[tuple[bool, tuple[int, ...], bool], IndexSet] = {}
        self._visible: dict[tuple[int, frozenset[int]], IndexSet] = {}
        self._skins: dict[tuple[int, bool], SkinBuffers] = {}
        self._colors: moderngl.Buffer | None = None
        self._shown: tuple[frozenset[int], moderngl.Buffer] | None = None
        self._sums: CorrectiveSums | None = None
        self._shell: tuple[Shell | None] | None = None
        keep = self._owner.keep
        with self._owner.guard():
            self.positions = self.upload(mesh.positions - self.center)
            self.normals = self.upload(mesh.normals)
            self.uvs: moderngl.Buffer | None = None
            if mesh.uvs is not None and len(mesh.uvs):
                self.uvs = keep(buffer(self.context, mesh.uvs[uv_indices], "f4"))
            sets = drawn_sets(mesh, notes)
            self.other_uvs: moderngl.Buffer | None = None
            if self.uvs is not None and len(sets) > 1:
                rows = np.zeros((len(uv_indices), 4), "f4")
                for slot, number in enumerate(sets[1:]):
                    rows[:, 2 * slot : 2 * slot + 2] = mesh.other_uvs[number - 1][uv_indices]
                self.other_uvs = keep(buffer(self.context, rows, "f4"))
            self.tints = None if mesh.colors is None else self.upload(mesh.colors)
            self.has_materials = needs_materials(mesh)
            self.surfaces = upload_surfaces(
                self.context,
                mesh.materials,
                sets if self.uvs is not None else (),
                notes,
                self._owner,
            )
            self.index_set(False, ())
            self.skin(Skinning())

    def upload(self, rows: Floats) -> moderngl.Buffer:
        """Return a buffer with a row per split vertex, copied from rows (V, 3) per vertex."""
        return self._owner.keep(buffer(self.context, rows[self.sources], "f4"))

    def index_set(
        self,
        reduced: bool,
        hidden: tuple[int, ...],
        as_listed: bool = False,
        hidden_parts: frozenset[int] = frozenset(),
    ) -> IndexSet:
        """Return the triangles of the full or the reduced mesh, without hidden body parts."""
        # The file's order is kept on request, as it affects how translucent edges blend. Hidden
        # parts of the mesh are omitted by drawing only the other runs.
        reduced = reduced and self.figure.reduced is not None
        key = (reduced, hidden, as_listed)
        if key not in self._index_sets:
            self._index_sets[key] = self._make_index_set(*key)
        whole = self._index_sets[key]
        if len(self._visible) > _MOST_VISIBLE:
            self._visible.clear()
        found = id(whole), hidden_parts
        if found not in self._visible:
            self._visible[found] = whole.without(hidden_parts)
        return self._visible[found]

    def _make_index_set(self, reduced: bool, hidden: tuple[int, ...], as_listed: bool) -> IndexSet:
        mesh, coarse = self.figure.require_mesh(), self.figure.reduced
        if reduced and coarse is not None:
            of_figure = coarse.vertices[coarse.triangles]
            split, materials = self.copies[of_figure], np.full(len(of_figure), -1, dtype=np.int32)
            parts = materials
        else:
            of_figure, split, materials = mesh.triangles, self.triangles, mesh.material_indices
            parts = mesh.part_indices
        kept = kept_triangles(self.figure, hidden, of_figure)
        keeps_all = bool(kept.all())
        if not keeps_all:
            split, materials, parts = split[kept], materials[kept], parts[kept]
        order: Ints | None = None
        if not as_listed and split is self.triangles:
            order = triangle_order(self.figure)
        elif not as_listed:
            order = curve_order(split, materials, parts, mesh.positions[self.sources])
        made = index_set(self.context, split, materials, self.surfaces, order, parts)
        self._owner.keep(made.indices)
        if keeps_all:
            return made
        return replace(made, order=np.flatnonzero(kept).astype(np.int32)[made.order])

    def skin(self, skinning: Skinning) -> SkinBuffers:
        """Return the influences that a skinning method uses."""
        key = (skinning.max_influences, skinning.normalize)
        if key not in self._skins:
            skin = self.figure.skin
            used = None if skin is None else skin_used(skin, skinning)
            buffers = SkinBuffers(self.context, used, self.sources)
            self._skins[key] = self._owner.keep(buffers)
        return self._skins[key]

    def attributes(self) -> list[tuple[moderngl.Buffer, str, str]]:
        """Return the texture coordinates and colours, for a vertex array."""
        found = (
            (self.uvs, "2f4", "in_uv"),
            (self.other_uvs, "4f4", "in_other_uvs"),
            (self.tints, "4f4", "in_tint"),
            (self.colors, "3f4", "in_color"),
        )
        return [(rows, layout, name) for rows, layout, name in found if rows is not None]

    def lines_shown(self, hidden_parts: frozenset[int]) -> moderngl.Buffer:
        """Return 1 for every split vertex of a visible triangle, else 0, as float32."""
        if self._shown is None or self._shown[0] != hidden_parts:
            shown = visible_vertices(self.figure.require_mesh(), hidden_parts)
            values = shown[self.sources].astype(np.float64)
            if self._shown is None:
                self._shown = hidden_parts, self._owner.keep(buffer(self.context, values, "f4"))
            else:
                self._shown[1].write(float32(values))
                self._shown = hidden_parts, self._shown[1]
        return self._shown[1]

    @property
    def shell(self) -> Shell | None:
        """Closed surface of the opaque mesh; None if its back faces may be visible."""
        if self._shell is None:
            mesh, skin = self.figure.require_mesh(), self.figure.skin
            is_opaque = all(material.alpha_mode == "opaque" for material in mesh.materials)
            # With negative weights, vertices may lie outside the bounding spheres.
            is_bounded = skin is None or not (skin.weights < 0.0).any()
            self._shell = (shell_of(mesh, skin) if is_opaque and is_bounded else None,)
        return self._shell[0]

    @property
    def is_physical(self) -> bool:
        """Whether a material is described by metalness and roughness."""
        return any(surface.is_physical for surface in self.surfaces)

    @property
    def is_textured(self) -> bool:
        """Whether a material has a base colour texture."""
        return any(surface.uniforms["u_textured"] for surface in self.surfaces)

    @property
    def is_blended(self) -> bool:
        """Whether a material is translucent."""
        return any(surface.is_blended for surface in self.surfaces)

    @property
    def colors(self) -> moderngl.Buffer | None:
        """A colour for every split vertex, by its body part; None if the figure has no parts."""
        parts = self.figure.body_parts
        if self._colors is None and parts is not None:
            from viewer.rendering.colors import part_colors

            self._colors = self.upload(part_colors(len(parts.names))[parts.of_vertex])
        return self._colors

    @property
    def corrective_sums(self) -> CorrectiveSums:
        """The sums of the figure's pose correctives; it must have some."""
        if self._sums is None:
            correctives = self.figure.correctives
            assert correctives is not None  # checked by the caller
            self._sums = CorrectiveSums(self.context, correctives, self.sources)
            self._owner.keep(self._sums)
        return self._sums

    def release(self) -> None:
        """Free every buffer and texture."""
        self._owner.release()


class SkinBuffers:
    """Influences of a mesh's split vertices.

    ``bindings``: one row per split vertex, see ``skin.vert``. ``joint_fractions``:
    (J,), each joint's fraction of the sum of all weights, for the mean motion of the figure.
    """

    def __init__(self, context: moderngl.Context, skin: Skin | None, sources: Ints) -> None:
        self._owner = Owner()
        keep = self._owner.keep
        with self._owner.guard():
            if skin is None:
                self.joint_fractions: Floats = np.zeros(0)
                ranges, excess = np.zeros((len(sources), 2), "u4"), np.zeros(len(sources))
                self.pairs = keep(pair_texture(context, [], []))
            else:
                skin = strongest_first(skin)
                counts = np.where(has_influence(skin), np.diff(skin.starts), 0)
                ranges = np.stack([skin.starts[:-1], counts], axis=1)[sources]
                self.pairs = keep(pair_texture(context, skin.joints, skin.weights))
                self.joint_fractions = joint_fractions(skin)
                # In float64: float32 sums deviate from 1, which displaces vertices far from the
                # origin.
                excess = (weight_sums(skin) - 1.0)[sources]
            # One packed attribute: each attribute costs software drivers as much as a matrix
            # product.
            bindings = np.empty((len(sources), 3), dtype="u4")
            bindings[:, :2], bindings[:, 2] = ranges, excess.astype("f4").view("u4")
            self.bindings = keep(buffer(context, bindings, "u4"))
            stated = None if skin is None else skin.dqs_fractions
            fractions = np.zeros(len(sources)) if stated is None else stated[sources]
            self.fractions = keep(buffer(context, fractions, "f4"))

    def release(self) -> None:
        """Free everything."""
        self._owner.release()
