"""Parts of a figure that glTF cannot hold, and measured errors of a file that is read back."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from viewer.export._gltf.nodes import Tree
from viewer.export._gltf.reading import GltfFile, read_back
from viewer.export._gltf.shape import Shape
from viewer.export._gltf.skin import PER_SET, Influences
from viewer.export._losses.apart import apart, apart_lines, negligible, shared_extent
from viewer.export._losses.skinned import Rows, Side, body_rows, changing, figure_side
from viewer.rig.arrays import Ints
from viewer.rig.figure import Figure
from viewer.rig.mesh import split_seams
from viewer.rig.motion.evaluation import Frames
from viewer.rig.scalars import length_text
from viewer.rig.skinning import METHODS, Skinning


@dataclass(frozen=True, slots=True, eq=False)
class Written:
    """A written file, and indices of its contents.

    Attributes
    ----------
    path : Path
        Its path.
    file : GltfFile
        Its parsed contents.
    tree : Tree
        Indices of the nodes.
    mesh_node : int or None
        Index of the mesh's node.
    start : int
        Frame of the figure that is the first in the file.
    """

    path: Path
    file: GltfFile
    tree: Tree
    mesh_node: int | None
    start: int = 0


def gltf_losses(
    written: Written,
    figure: Figure,
    frames: Frames,
    rows: Rows,
    how: Skinning,
    shape: Shape,
    influences: Influences | None,
    first_frame: int | None,
) -> list[str]:
    """Return messages with the largest distances between the posed figure and a file.

    ``written``: the file.
    ``figure``: the original, without its shape applied.
    ``frames``: its poses.
    ``rows`` (F,): the frames to compare.
    ``how``: the requested skinning.
    ``shape``, ``influences``: the written shape and skin.
    ``first_frame``: number of the first frame; None for a single pose.
    """
    weights = frames.shape_weights
    still = weights[min(written.start, len(weights) - 1)] if shape.baked is None else shape.baked
    columns = changing(frames, still)
    expected = figure_side(figure, frames, how, still)
    sources = None
    if figure.mesh is not None and written.mesh_node is not None:
        sources = split_seams(figure.mesh)[0]
        expected = _split(expected, sources)
    else:
        expected = replace(expected, body=None, exact=None)
    least = negligible(figure, frames, rows)
    targets = np.flatnonzero(np.isin(shape.targets, columns))
    place = (written.file, written.tree, written.mesh_node, targets, written.start)
    found = apart(expected, read_back(*place), rows, least)
    why = []
    if found.vertices is not None:
        why = _reasons(figure, frames, rows, how, shape, influences, least)
    lines = apart_lines(written.path, figure, found, first_frame, sources)
    lines = [line + f": {'; '.join(why)}" * bool(why) for line in lines]
    if influences is not None and influences.most > PER_SET and sources is not None:
        lines += _first_set(expected, read_back(*place, 1), figure, rows, least, influences)
    return lines


def _split(side: Side, sources: Ints) -> Side:
    """Return a side with its vertices duplicated as in a file."""
    whole = side.exact
    assert side.body is not None  # the caller checked for a mesh
    body = body_rows(side.body, sources)
    return replace(
        side, body=body, exact=None if whole is None else lambda row: whole(row)[sources]
    )


def _first_set(
    expected: Side, cut: Side, figure: Figure, rows: Rows, least: float, influences: Influences
) -> list[str]:
    """Return a message about the error of programs that read four influences per vertex."""
    found = apart(expected, cut, rows, least)
    text = f"up to {influences.most} influences per vertex, all of them written, strongest first"
    if found.vertices is None:
        return [text]
    off = length_text(figure, found.vertices.distance)
    extent = shared_extent(found)
    return [f"{text}: programs that read only JOINTS_0 have errors of up to {off}{extent}"]


def _reasons(
    figure: Figure,
    frames: Frames,
    rows: Rows,
    how: Skinning,
    shape: Shape,
    influences: Influences | None,
    least: float,
) -> list[str]:
    """Return the causes of vertex errors."""
    found = []
    if influences is not None and (influences.n_scaled or influences.n_negative):
        found.append(_weights_text(influences))
    if influences is not None and how.method != "lbs":
        found.append(
            f"{METHODS[how.method].title} skinning is not supported, glTF uses linear blending"
        )
    if influences is not None and figure.correctives is not None and how.correctives:
        found.append("pose correctives are not supported")
    weights = frames.shape_weights
    weights = weights if len(weights) == 1 else weights[rows]
    if shape.baked is not None and np.ptp(weights, axis=0).any():
        found.append("the shape changes over time, which is not supported")
    mesh = shape.figure.require_mesh()
    coarse = np.abs(mesh.positions - mesh.positions.astype(np.float32)).max(initial=0.0)
    if coarse > least:
        found.append("the mesh is far from its origin for glTF's single precision")
    return found


def _weights_text(influences: Influences) -> str:
    parts = []
    if influences.n_scaled:
        parts.append(f"weights of {vertices_text(influences.n_scaled)} do not add up to 1")
    if influences.n_negative:
        parts.append(f"weights of {vertices_text(influences.n_negative)} are negative")
    done = "omitted and the others scaled" if influences.n_negative else "scaled"
    return f"{' and '.join(parts)}: {done}, as glTF requires"


def vertices_text(count: int) -> str:
    """Return a number of vertices as text."""
    return "1 vertex" if count == 1 else f"{count} vertices"


def not_held(figure: Figure, shape: Shape) -> list[str]:
    """Return a message that lists the parts of a figure that the file does not hold."""
    unused = figure.n_shapes - len(shape.targets)
    parts = {
        f"{unused} blend shapes": unused > 0 and shape.baked is None,
        f"{figure.n_shapes} blend shapes as such": shape.baked is not None,
        "pose correctives": figure.correctives is not None,
        "body parts": figure.body_parts is not None,
        "keypoints": figure.keypoints is not None,
        "the symmetry map": figure.symmetry is not None,
        "the reduced mesh": figure.reduced is not None,
        "the joint regressor": figure.joint_regressor is not None,
        "limits of joints": figure.skeleton is not None
        and bool(np.isfinite(figure.skeleton.dof_limits).any()),
    }
    lost = [name for name, is_lost in parts.items() if is_lost]
    return [f"not held by glTF: {', '.join(lost)}"] if lost else []
