"""Single vertices of a posed figure: their skinning, and all facts about one of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.phrases import printable
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.number_text import number_text
from viewer.rigs.pose import Pose
from viewer.rigs.scalars import joint_text
from viewer.rigs.skeleton import shown_joint_of
from viewer.rigs.skin import merged, skin_rows, strongest_first
from viewer.rigs.skinning import Skinning, deformed, skin_used


def deform_vertices(
    figure: Figure, pose: Pose | None, skinning: Skinning, vertices: Ints
) -> tuple[Floats, Floats]:
    """Skin vertices (N,) with the same result as ``viewer.rigs.skinning.deform``: two of (N, 3)."""
    check_vertices(figure, vertices)
    return deformed(figure, pose, skinning, vertices)


def check_vertices(figure: Figure, vertices: Ints) -> None:
    """Raise ``RigError`` if an index does not refer to a vertex of the figure."""
    count = 0 if figure.mesh is None else figure.mesh.n_vertices
    wrong = vertices[(vertices < 0) | (vertices >= count)]
    if count == 0:
        raise RigError(f"figure {figure.name} has no vertices")
    if len(wrong):
        raise RigError(f"vertex: expected 0 to {count - 1}, found {wrong[0]}")


_LONGEST = 40  # maximum number of characters of a name
_MOST = 8  # maximum number of influences that are listed individually


@dataclass(frozen=True, slots=True, eq=False)
class VertexFacts:
    """Properties of a vertex."""

    vertex: int
    triangle: int
    """Indices; -1 for no triangle."""
    position: Floats
    """(3,). Drawn position, figure space and units."""
    normal: Floats
    """(3,). Unit length."""
    uvs: Floats
    """(N, 2). Texture coordinates, several along a seam; the triangle's coordinates come first."""
    body_part: str
    """Body part; empty if there is none."""
    joints: Ints
    """(K,). Joints of the effective influences of non-zero weight, by decreasing weight."""
    names: tuple[str, ...]
    """Names of these joints."""
    weights: Floats
    """(K,). Weights; duplicates of a joint are summed."""


def vertex_facts(
    figure: Figure, pose: Pose | None, skinning: Skinning, vertex: int, triangle: int = -1
) -> VertexFacts:
    """Return the properties of a vertex; without a pose, in that of the file."""
    chosen = np.array([vertex], dtype=np.int32)
    check_vertices(figure, chosen)
    mesh, parts, skin = figure.require_mesh(), figure.body_parts, figure.skin
    if not -1 <= triangle < mesh.n_triangles:
        raise RigError(f"triangle: expected -1 to {mesh.n_triangles - 1}, found {triangle}")
    positions, normals = deform_vertices(figure, pose, skinning, chosen)
    joints, weights = np.zeros(0, dtype=np.int32), np.zeros(0)
    if skin is not None:
        row = skin_rows(skin_used(skin, skinning), chosen)
        if figure.skeleton is not None:
            row = replace(row, joints=shown_joint_of(figure.skeleton)[row.joints])
        row = strongest_first(merged(row))
        counts = row.weights != 0.0
        joints, weights = row.joints[counts], row.weights[counts]
    return VertexFacts(
        vertex,
        triangle,
        positions[0],
        normals[0],
        _uvs(figure, vertex, triangle),
        "" if parts is None else parts.names[parts.of_vertex[vertex]],
        joints,
        tuple(joint_text(figure, joint) for joint in joints.tolist()),
        weights,
    )


def nearest_corner(positions: Floats, triangle: Ints, point: Floats) -> int:
    """Return the vertex of a triangle (3,) with corners (3, 3) that is closest to a point on it."""
    return int(triangle[np.linalg.norm(positions - point, axis=1).argmin()])


def facts_text(facts: VertexFacts) -> list[str]:
    """Return the properties as lines: indices, position, and influences by decreasing weight."""
    triangle = f", triangle {facts.triangle}" if facts.triangle >= 0 else ""
    part = f", {printable(facts.body_part, _LONGEST)}" if facts.body_part else ""
    lines = [
        f"vertex {facts.vertex}{triangle}{part}",
        f"position {_numbers(facts.position)}",
        f"normal {_numbers(facts.normal)}",
    ]
    lines += [f"uv {_numbers(uv)}" for uv in facts.uvs]
    lines += [
        f"{number_text(weight, '.4f')} {printable(name, _LONGEST)}"
        for weight, name in zip(facts.weights[:_MOST], facts.names[:_MOST], strict=True)
    ]
    if len(facts.weights) > _MOST:
        rest = facts.weights[_MOST:]
        lines.append(f"{number_text(float(rest.sum()), '.4f')} {len(rest)} more")
    if len(facts.weights) == 0:
        lines.append("no influence")
    return lines


def _uvs(figure: Figure, vertex: int, triangle: int) -> Floats:
    """Return a vertex's distinct texture coordinates, the triangle's first: (N, 2)."""
    mesh = figure.require_mesh()
    if mesh.uvs is None or len(mesh.uvs) == 0:
        return np.zeros((0, 2))
    if mesh.uv_triangles is None:
        return mesh.uvs[[vertex]]
    used = mesh.uv_triangles[mesh.triangles == vertex]
    if triangle >= 0:
        own = mesh.uv_triangles[triangle][mesh.triangles[triangle] == vertex]
        used = np.concatenate([own, used])
    _, first = np.unique(used, return_index=True)
    return mesh.uvs[used[np.sort(first)]]


def _numbers(values: Floats) -> str:
    return "  ".join(number_text(value, ".4f") for value in values.tolist())
