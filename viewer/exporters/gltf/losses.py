"""Parts of a figure that glTF cannot store, and errors measured by reading a file back.

Joints and vertices of the file, as the program's reader of glTF returns them, are compared in the
figure's space, below the node that rotates and scales the whole figure.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase, note
from viewer.exporters._left_out import extra_parts, not_held_note
from viewer.exporters._losses.largest_distances import (
    apart,
    apart_notes,
    extent_of,
    negligible,
    with_values,
)
from viewer.exporters._losses.pose_errors import requested_causes
from viewer.exporters._losses.posed_bodies import (
    Body,
    Poses,
    Rows,
    Side,
    body_rows,
    changing,
    figure_side,
)
from viewer.exporters.gltf.mesh import Placed
from viewer.exporters.gltf.nodes import Tree
from viewer.exporters.gltf.skin import PER_SET, Influences, Shape
from viewer.formats import Source
from viewer.formats._scene_graph.content import NodeTree
from viewer.formats.gltf.animations import Targets, read_animations
from viewer.formats.gltf.document import Document, open_document, parsed_json
from viewer.formats.gltf.meshes import read_vertices
from viewer.formats.gltf.nodes import read_skins, read_tree
from viewer.phrases import agree, counted, listed, optional
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import quaternion_to_matrix
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.kinematics import joint_worlds
from viewer.rigs.motion.evaluation import Frames
from viewer.rigs.scalars import length_text
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.skin import Skin, influence_counts, skin_from_entries
from viewer.rigs.skinning import METHODS, Skinning

Keys: TypeAlias = dict[tuple[int, str], Floats]
"""Animated values by node and path, one row per frame."""


class GltfFile:
    """A written file, read again from the bytes of a ``.glb``, or of a ``.gltf`` and its buffer.

    ``unplaced``: nodes whose matrices are ignored, as errors are measured in each figure's space.
    """

    def __init__(self, path: Path, files: Sequence[bytes], unplaced: Sequence[int] = ()) -> None:
        source, (first, *others) = Source(path, files[0]), files
        if first[:4] == b"glTF":
            document = open_document(source)
        else:
            root = parsed_json(source, first, has_lines=True)
            for buffer in root.get("buffers", ()):
                del buffer["uri"]
            document = Document(source, root, memoryview(b"".join(others)))
            document.buffers.n_bytes_read += sum(map(len, others))
        for node in unplaced:
            del document.root.values["nodes"][node]["matrix"]
        self.tree, self.skins = read_tree(document), read_skins(document)
        count = len(document.table("meshes"))
        self.meshes = tuple(read_vertices(document, mesh) for mesh in range(count))
        self.animations = read_animations(document, Targets(self.tree, self.meshes))


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
        # Vertices are duplicated as in the file.
        sources, whole = written.sources, expected.exact
        assert expected.body is not None  # there are meshes
        expected = replace(
            expected,
            body=body_rows(expected.body, sources),
            exact=None if whole is None else lambda row: whole(row)[sources],
        )
    else:
        expected = replace(expected, body=None, exact=None)
    targets = np.flatnonzero(np.isin(shape.targets, columns))
    keys = frame_keys(written.file) if written.keys is None else written.keys
    place = written.file, written.tree, written.meshes, shape.figure, targets, keys, written.start
    return expected, lambda sets: read_back(*place, sets)


def read_back(
    file: GltfFile,
    tree: Tree,
    meshes: list[Placed],
    figure: Figure,
    targets: Rows,
    keys: Keys,
    start: int = 0,
    sets: int | None = None,
) -> Side:
    """Return the contents of a file in a form that can be compared with the figure.

    ``targets`` (M,): the figure's morph targets that change. ``start``: the figure's frame that is
    the first of the file. ``sets``: influence sets that are used, normalised; all if None.
    """
    parents, n_joints = file.tree.parents, len(tree.joints)
    bound = np.tile(np.eye(4), (n_joints + 1, 1, 1))
    joints = [*tree.joints, file.tree.n_nodes if tree.place < 0 else tree.place]
    if figure.skin is not None and n_joints:
        bound[:-1] = figure.skin.inverse_bind
    for placed in meshes:
        number = int(file.tree.skins[placed.node])
        if number >= 0:
            skin = file.skins[number]
            bound[: len(skin.joints)] = skin.inverse_bind @ np.linalg.inv(placed.decoding)
            joints[: len(skin.joints)] = skin.joints.tolist()
        elif placed.part.joint < 0:
            joints[-1] = placed.node
            bound[-1] = np.linalg.inv(placed.decoding)
    body, morphs = None, np.zeros((1, 0))
    if meshes:
        body, morphs = _body(file, meshes, keys, bound, targets, sets)

    def poses(rows: Rows) -> Poses:
        world = _world(file.tree, keys, rows - start)
        world = np.concatenate([world, np.broadcast_to(np.eye(4), (len(rows), 1, 4, 4))], axis=1)
        above = parents[tree.place] if tree.place >= 0 else -1
        if above >= 0:
            world = np.linalg.inv(world[:, above : above + 1]) @ world
        places = world[:, tree.joints][..., :3, 3]
        weights = morphs if len(morphs) == 1 else morphs[rows - start]
        still = np.zeros((len(rows), 3))
        return Poses(places, world[:, joints] @ bound, still, weights, np.zeros((len(rows), 0)))

    return Side(body, poses)


def frame_keys(file: GltfFile) -> Keys:
    """Return the animated values of a file with one key per frame."""
    return {
        (channel.node, channel.path): channel.values
        for animation in file.animations
        for channel in animation.read()
    }


def _world(tree: NodeTree, keys: Keys, rows: Rows) -> Floats:
    """Return the global matrices of all nodes: (F, N, 4, 4)."""
    still = {
        "translation": tree.translations,
        "rotation": tree.rotations,
        "scale": tree.scales,
    }
    parts = {path: np.repeat(values[:, None], len(rows), axis=1) for path, values in still.items()}
    for (node, path), moved in keys.items():
        if path in parts:
            parts[path][node] = moved[rows]
    rotations = parts["rotation"] / np.linalg.norm(parts["rotation"], axis=-1, keepdims=True)
    linear = quaternion_to_matrix(rotations) * parts["scale"][..., None, :]
    return joint_worlds(
        tree.parents, np.swapaxes(linear, 0, 1), np.swapaxes(parts["translation"], 0, 1)
    )


def _body(
    file: GltfFile,
    meshes: list[Placed],
    keys: Keys,
    bound: Floats,
    changing: Rows,
    sets: int | None,
) -> tuple[Body, Floats]:
    """Return all meshes in the shape of the first frame, and the weights that change it: (F, M)."""
    found = [_one_body(file, placed, keys, bound, sets) for placed in meshes]
    positions = np.concatenate([each.positions for each in found])
    skins = [each.skin for each in found]
    counts = np.concatenate([influence_counts(skin) for skin in skins])
    skin = Skin(
        starts=np.concatenate([[0], np.cumsum(counts)]).astype(np.int32),
        joints=np.concatenate([skin.joints for skin in skins]),
        weights=np.concatenate([skin.weights for skin in skins]),
        inverse_bind=bound,
    )
    count = max((len(each.weights) for each in found), default=1)
    weights = np.zeros((count, len(changing)))
    shapes = np.zeros((len(changing), len(positions), 3))
    first = 0
    for placed, each in zip(meshes, found, strict=True):
        rows = slice(first, first + len(each.positions))
        first = rows.stop
        for column, target in enumerate(changing.tolist()):
            for own in np.flatnonzero(placed.part.targets == target).tolist():
                shapes[column, rows] = each.targets[own]
                weights[:, column] = each.weights[:, own] - each.weights[0, own]
    return Body(positions, skin, shapes if len(changing) else None), weights


@dataclass(frozen=True, slots=True, eq=False)
class _OneBody:
    """One mesh: positions (V, 3) in the first frame, skin, targets (S, V, 3), weights (F, S)."""

    positions: Floats
    skin: Skin
    targets: Floats
    weights: Floats


def _one_body(
    file: GltfFile, placed: Placed, keys: Keys, bound: Floats, sets: int | None
) -> _OneBody:
    mesh = file.meshes[int(file.tree.meshes[placed.node])]
    (primitive,) = mesh.primitives
    positions, weights = primitive.positions, np.zeros((1, 0))
    directions = np.zeros((0, *positions.shape))
    if primitive.targets is not None:
        directions = primitive.targets.dense()
        weights = keys.get((placed.node, "weights"), mesh.shape_weights[None])
        # The shape of the first frame is the reference, to which later weights are relative.
        positions = positions + np.einsum("s,sva->va", weights[0], directions)
    joint = placed.part.joint
    # The comparison is in binding space.
    space = placed.decoding if joint < 0 else np.linalg.inv(bound[joint])
    if not np.array_equal(space, np.eye(4)):
        positions = apply_transform(space, positions)
        directions = directions @ space[:3, :3].T
    count = len(positions)
    if primitive.joints is not None and primitive.weights is not None:
        most = None if sets is None else PER_SET * sets
        slots, values = primitive.joints[:, :most], primitive.weights[:, :most]
        if sets is not None:
            values = values / values.sum(axis=1, keepdims=True)
        used = values != 0.0
        rows, followed, values = np.nonzero(used)[0], slots[used], values[used]
    else:
        # All vertices follow the node of the mesh.
        rows, values = np.arange(count), np.ones(count)
        followed = np.full(count, joint if joint >= 0 else len(bound) - 1)
    skin = skin_from_entries(count, rows.astype(np.int32), followed.astype(np.int32), values, bound)
    return _OneBody(positions, skin, directions, weights)


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
            note(
                "X005.influences: up to {most} influences per vertex, all of them written, "
                "strongest first",
                most=most,
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
        note(
            "X002.first-influences: up to {most} influences per vertex, all of them written, "
            "strongest first; programs that read only the first four are wrong by up to "
            "{length}{extent}",
            **values,
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
        [note("X003.file-members: {n} of the original file {are} not copied: {names}", **values)]
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
            note(
                "X003.file-nodes: {n} of the original file without a joint, mesh or camera {are} "
                "not copied: {names}",
                **values,
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
