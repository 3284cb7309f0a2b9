"""Parts of a figure that glTF cannot store, and errors measured by reading a file back."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase
from viewer.export._left_out import extra_parts, not_held_note
from viewer.export._losses.largest_distances import (
    apart,
    apart_notes,
    extent_of,
    negligible,
    with_values,
)
from viewer.export._losses.pose_errors import requested_causes
from viewer.export._losses.posed_bodies import Rows, Side, body_rows, changing, figure_side
from viewer.export.gltf.nodes import Tree
from viewer.export.gltf.reading import GltfFile, Keys, Placed, frame_keys, read_back
from viewer.export.gltf.skin import PER_SET, Influences, Shape
from viewer.phrases import agree, counted, listed, optional
from viewer.rig.arrays import Ints
from viewer.rig.figure import Figure
from viewer.rig.motion.evaluation import Frames
from viewer.rig.scalars import length_text
from viewer.rig.skeleton import Skeleton
from viewer.rig.skinning import METHODS, Skinning


@dataclass(frozen=True, slots=True, eq=False)
class Written:
    """A written file, and indices of its contents."""

    path: Path
    """Path of the file."""
    file: GltfFile
    """Its parsed contents."""
    tree: Tree
    """Indices of the nodes."""
    meshes: list[Placed]
    """Its meshes."""
    start: int = 0
    """Frame of the figure that comes first in the file."""
    keys: Keys | None = None
    """Animated values of each frame; by default, the file's keys, one per frame."""
    animations: Sequence[int] = ()
    """Indices of the figure's animations."""

    @property
    def sources(self) -> Ints:
        """Indices of the figure's vertices, one for each vertex of the file that copies it."""
        return np.concatenate([placed.part.sources for placed in self.meshes])


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
    """Return notes with the largest distances between a file and the posed figure."""
    expected, read = sides(written, figure, frames, how, shape)
    sources = written.sources if written.meshes else None
    least = negligible(figure, frames, rows)
    found = apart(expected, read(None), rows, least)
    causes = []
    if found.vertices is not None:
        causes = causes_of(figure, frames, rows, how, shape, influences, least)
    notes = apart_notes(written.path, figure, found, first_frame, sources)
    notes = with_values(notes, causes=optional(": {}", causes))
    return notes + first_set_note(expected, read, figure, rows, least, influences)


def sides(
    written: Written, figure: Figure, frames: Frames, how: Skinning, shape: Shape
) -> tuple[Side, Callable[[int | None], Side]]:
    """Return a figure's poses, and a function that reads the file's by n influence sets or all."""
    weights = frames.shape_weights
    still = weights[min(written.start, len(weights) - 1)] if shape.baked is None else shape.baked
    columns = changing(frames, still)
    expected = figure_side(figure, frames, how.unreduced(), still)
    if written.meshes:
        expected = _split(expected, written.sources)
    else:
        expected = replace(expected, body=None, exact=None)
    targets = np.flatnonzero(np.isin(shape.targets, columns))
    keys = frame_keys(written.file) if written.keys is None else written.keys
    place = written.file, written.tree, written.meshes, shape.figure, targets, keys, written.start
    return expected, lambda sets: read_back(*place, sets)


def _split(side: Side, sources: Ints) -> Side:
    """Return a posed figure with its vertices duplicated as in the file."""
    whole = side.exact
    assert side.body is not None  # the caller has checked that there is a mesh
    body = body_rows(side.body, sources)
    return replace(
        side, body=body, exact=None if whole is None else lambda row: whole(row)[sources]
    )


def first_set_note(
    expected: Side,
    read: Callable[[int | None], Side],
    figure: Figure,
    rows: Rows,
    least: float,
    influences: Influences | None,
) -> list[Diagnostic]:
    """Return a note about the error of programs that read only four influences, if it matters."""
    if influences is None or influences.most <= PER_SET or expected.body is None:
        return []
    found = apart(expected, read(1), rows, least)
    most, worst = int(influences.most), found.vertices
    if worst is None:
        return [
            Diagnostic(
                "X005.influences: up to {most} influences per vertex, all of them written, "
                "strongest first",
                values={"most": most},
            )
        ]
    values = {
        "most": most,
        "length": length_text(figure, worst.distance),
        "distance": worst.distance,
        "unit": figure.unit,
        "extent": optional(" ({})", extent_of(found)),
    }
    return [
        Diagnostic(
            "X002.first-influences: up to {most} influences per vertex, all of them written, "
            "strongest first; programs that read only the first four are wrong by up to "
            "{length}{extent}",
            values=values,
        )
    ]


def causes_of(
    figure: Figure,
    frames: Frames,
    rows: Rows,
    how: Skinning,
    shape: Shape,
    influences: Influences | None,
    least: float,
) -> list[Phrase]:
    """Return the causes of vertex errors."""
    found = requested_causes(figure, replace(how, correctives=True))
    if influences is not None and (influences.n_scaled or influences.n_negative):
        found.append(_weights_phrase(influences))
    if influences is not None and how.method != "lbs":
        found.append(
            Phrase(
                "{method} skinning is not supported: glTF uses linear blending",
                method=METHODS[how.method].title,
            )
        )
    if influences is not None and figure.correctives is not None:
        found.append(Phrase("pose correctives are not supported"))
    weights = frames.shape_weights
    weights = weights if len(weights) == 1 else weights[rows]
    if shape.baked is not None and np.ptp(weights, axis=0).any():
        found.append(Phrase("the shape changes over time, which is not supported"))
    mesh = shape.figure.require_mesh()
    coarse = np.abs(mesh.positions - mesh.positions.astype(np.float32)).max(initial=0.0)
    if coarse > least:
        found.append(Phrase("the mesh is too far from its origin for glTF's single precision"))
    return found


def _weights_phrase(influences: Influences) -> Phrase:
    n, negative = int(influences.n_scaled), int(influences.n_negative)
    key = (
        "weights of {n} do not add up to 1 and weights of {negative} are negative: omitted "
        "and the others scaled, as glTF requires"
        if n and negative
        else "weights of {n} do not add up to 1: scaled, as glTF requires"
        if n
        else "weights of {negative} are negative: omitted and the others scaled, as glTF requires"
    )
    return Phrase(key, n=counted(n, "vertex"), negative=counted(negative, "vertex"))


def not_held(figure: Figure, shape: Shape, is_vrm: bool = False) -> list[Diagnostic]:
    """Return a note that lists the parts of a figure that the file does not contain."""
    shapes, skeleton, lost = figure.blend_shapes, figure.skeleton, list[Phrase]()
    rows = set(range(figure.n_shapes)) - set(shape.targets.tolist())
    mixed = 0 if shapes is None else sum(shapes.is_expression(row) for row in rows)
    unused = len(rows) - mixed
    if shape.baked is not None:
        lost.append(Phrase("{n} (baked into the mesh)", n=counted(figure.n_shapes, "blend shape")))
    elif unused > 0:
        lost.append(Phrase("{n}", n=counted(unused, "blend shape")))
    if mixed and shape.baked is None and not is_vrm:
        lost.append(
            Phrase("{n} (combinations of morph targets, as in VRM)", n=counted(mixed, "expression"))
        )
    lost += [] if is_vrm else _lost_looks(figure)
    if skeleton is not None and skeleton.humanoid is not None and not is_vrm:
        lost.append(Phrase("the humanoid bone map"))
    if skeleton is not None and skeleton.springs is not None and not is_vrm:
        lost.append(Phrase("{n}", n=counted(skeleton.springs.n_chains, "spring chain")))
    if figure.record is not None and figure.record.vrm is not None and not is_vrm:
        lost.append(Phrase("authors and licence of the VRM character"))
    if figure.correctives is not None:
        lost.append(Phrase("pose correctives"))
    lost += extra_parts(figure)
    if skeleton is not None and skeleton.constraints and not is_vrm:
        lost.append(
            Phrase(
                "{n} (the joints have their rotations)",
                n=counted(len(skeleton.constraints), "constraint"),
            )
        )
    if skeleton is not None and _is_limited(skeleton):
        lost.append(Phrase("joint limits"))
    members = () if figure.record is None else figure.record.unkept()
    if figure.record is not None and len(figure.record.skin_names) > 1:
        members = (*members, *(["skins.name"] if any(figure.record.skin_names) else []))
    values = {
        "names": listed(members),
        "n": counted(len(members), "member"),
        "are": agree(len(members), "is", "are"),
    }
    notes = not_held_note("glTF", lost)
    notes += (
        [
            Diagnostic(
                "X003.file-members: {n} of the original file {are} not copied: {names}",
                values=values,
            )
        ]
        if members
        else []
    )
    nodes = () if figure.record is None else figure.record.lost_nodes
    values = {
        "names": listed(nodes, 12),
        "n": counted(len(nodes), "node"),
        "are": agree(len(nodes), "is", "are"),
    }
    return notes + (
        [
            Diagnostic(
                "X003.file-nodes: {n} of the original file without a joint, mesh or camera {are} "
                "not copied: {names}",
                values=values,
            )
        ]
        if nodes
        else []
    )


def _lost_looks(figure: Figure) -> list[Phrase]:
    """Return toon shading, and changes of materials by expressions."""
    shapes, found = figure.blend_shapes, list[Phrase]()
    materials = () if figure.mesh is None else figure.mesh.materials
    n_toon = sum(material.shade_color is not None for material in materials)
    if n_toon:
        found.append(
            Phrase("toon shading of {n} (unlit in the file)", n=counted(n_toon, "material"))
        )
    if shapes is not None and shapes.material_binds is not None:
        count = len(shapes.material_binds.n_materials)
        found.append(Phrase("material changes by {n}", n=counted(count, "expression")))
    return found


def _is_limited(skeleton: Skeleton) -> bool:
    """Return whether any joint has limits, except joints that a constraint drives."""
    followers = [constraint.joint for constraint in skeleton.constraints]
    is_own = ~np.isin(skeleton.dof_joints, followers)
    return bool(np.isfinite(skeleton.dof_limits[is_own]).any())
