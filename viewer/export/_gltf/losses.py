"""Parts of a figure that glTF cannot store, and errors measured by reading a file back."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase
from viewer.export._gltf.nodes import Tree
from viewer.export._gltf.reading import GltfFile, read_back
from viewer.export._gltf.shape import Shape
from viewer.export._gltf.skin import PER_SET, Influences
from viewer.export._left_out import extra_parts, not_held_note
from viewer.export._losses.apart import apart, apart_notes, extent_of, negligible, with_values
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
        Path of the file.
    file : GltfFile
        Its parsed contents.
    tree : Tree
        Indices of the nodes.
    mesh_nodes : list of int
        Indices of the nodes of the meshes, which share their vertices.
    start : int
        Frame of the figure that comes first in the file.
    """

    path: Path
    file: GltfFile
    tree: Tree
    mesh_nodes: list[int]
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
) -> list[Diagnostic]:
    """Return notes with the largest distances between a file and the posed figure.

    ``written``: the file.
    ``figure``: the original, without its shape applied.
    ``frames``: its poses.
    ``rows`` (F,): frames to compare.
    ``how``: the requested skinning.
    ``shape``, ``influences``: the written shape and skin.
    ``first_frame``: number of the first frame; None for a single pose.
    """
    weights = frames.shape_weights
    still = weights[min(written.start, len(weights) - 1)] if shape.baked is None else shape.baked
    columns = changing(frames, still)
    expected = figure_side(figure, frames, how, still)
    sources = None
    node = written.mesh_nodes[0] if written.mesh_nodes else None
    if figure.mesh is not None and node is not None:
        sources = split_seams(figure.mesh)[0]
        expected = _split(expected, sources)
    else:
        expected = replace(expected, body=None, exact=None)
    least = negligible(figure, frames, rows)
    targets = np.flatnonzero(np.isin(shape.targets, columns))
    place = (written.file, written.tree, node, targets, written.start)
    found = apart(expected, read_back(*place), rows, least)
    causes = []
    if found.vertices is not None:
        causes = _causes(figure, frames, rows, how, shape, influences, least)
    notes = apart_notes(written.path, figure, found, first_frame, sources)
    notes = with_values(notes, causes=causes)
    if influences is not None and influences.most > PER_SET and sources is not None:
        notes += _first_set(expected, read_back(*place, 1), figure, rows, least, influences)
    return notes


def _split(side: Side, sources: Ints) -> Side:
    """Return a side with vertices duplicated as in the file."""
    whole = side.exact
    assert side.body is not None  # the caller checked for a mesh
    body = body_rows(side.body, sources)
    return replace(
        side, body=body, exact=None if whole is None else lambda row: whole(row)[sources]
    )


def _first_set(
    expected: Side, cut: Side, figure: Figure, rows: Rows, least: float, influences: Influences
) -> list[Diagnostic]:
    """Return a note about the error in programs that read only four influences per vertex."""
    found = apart(expected, cut, rows, least)
    most, worst = int(influences.most), found.vertices
    if worst is None:
        return [Diagnostic("X005.influences", values={"most": most})]
    values = {
        "most": most,
        "length": length_text(figure, worst.distance),
        "distance": worst.distance,
        "unit": figure.unit,
        "extent": extent_of(found),
    }
    return [Diagnostic("X002.first-influences", values=values)]


def _causes(
    figure: Figure,
    frames: Frames,
    rows: Rows,
    how: Skinning,
    shape: Shape,
    influences: Influences | None,
    least: float,
) -> list[Phrase]:
    """Return the causes of vertex errors."""
    found = []
    if influences is not None and (influences.n_scaled or influences.n_negative):
        found.append(_weights_phrase(influences))
    if influences is not None and how.method != "lbs":
        found.append(Phrase("nonlinear-skinning", method=METHODS[how.method].title))
    if influences is not None and figure.correctives is not None and how.correctives:
        found.append(Phrase("unsupported-correctives"))
    weights = frames.shape_weights
    weights = weights if len(weights) == 1 else weights[rows]
    if shape.baked is not None and np.ptp(weights, axis=0).any():
        found.append(Phrase("unsupported-shape-change"))
    mesh = shape.figure.require_mesh()
    coarse = np.abs(mesh.positions - mesh.positions.astype(np.float32)).max(initial=0.0)
    if coarse > least:
        found.append(Phrase("single-precision"))
    return found


def _weights_phrase(influences: Influences) -> Phrase:
    n, negative = int(influences.n_scaled), int(influences.n_negative)
    key = "weights-both" if n and negative else "weights-unnormalized" if n else "weights-negative"
    return Phrase(key, n=n, negative=negative)


def not_held(figure: Figure, shape: Shape) -> list[Diagnostic]:
    """Return a note that lists the parts of a figure that the file does not contain."""
    unused = figure.n_shapes - len(shape.targets)
    skeleton, lost = figure.skeleton, []
    if shape.baked is not None:
        lost.append(Phrase("part-baked-shapes", n=figure.n_shapes))
    elif unused > 0:
        lost.append(Phrase("part-blend-shapes", n=unused))
    if figure.correctives is not None:
        lost.append(Phrase("part-correctives"))
    lost += extra_parts(figure)
    if skeleton is not None and np.isfinite(skeleton.dof_limits).any():
        lost.append(Phrase("part-limits"))
    return not_held_note("glTF", lost)
