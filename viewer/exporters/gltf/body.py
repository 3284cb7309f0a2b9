"""A figure as nodes, meshes and a skin of a glTF file."""

from __future__ import annotations

import json

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase
from viewer.errors import RigError
from viewer.exporters.gltf.document import Document, named, text_of
from viewer.exporters.gltf.materials import Color, Materials
from viewer.exporters.gltf.mesh import EXTENSION, Encoding, Placed, add_mesh, parts_of, quantized
from viewer.exporters.gltf.nodes import Locals, Tree, add_nodes
from viewer.exporters.gltf.skin import Influences, Shape, influences_of, inverse_bind_matrices
from viewer.phrases import counted
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.file_record import FileRecord, Json
from viewer.rigs.geometry.vectors import SignedUp
from viewer.rigs.pose import Pose
from viewer.rigs.skinning import Skinning, skin_used

_SOURCES, _FIGURES, _EXTRAS = "sources", "figures", "extras"


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """Data shared by all files of an export."""

    shape: Shape
    influences: Influences | None  # None if the mesh is not skinned

    @property
    def figure(self) -> Figure:
        """The figure as written."""
        return self.shape.figure


@dataclass(frozen=True, slots=True)
class Built:
    """Indices and statistics of one file's contents."""

    tree: Tree
    meshes: list[Placed]
    counts: list[Phrase]
    errors: dict[str, float]  # largest rounding errors of quantised attributes
    roots: list[int]  # root nodes of the scene
    materials: dict[int, int]  # indices of written materials by material of the mesh


def body_of(figure: Figure, shape: Shape, skinning: Skinning) -> Body:
    """Return a figure in the form that glTF can store, with ``shape`` as it is written."""
    if figure.mesh is None and figure.skeleton is None:
        raise RigError(f"figure {figure.name} has neither mesh nor skeleton to write as glTF")
    if not figure.is_attached or figure.skin is None:
        return Body(shape, None)
    return Body(shape, influences_of(skin_used(figure.skin, skinning)))


def add_body(
    document: Document,
    body: Body,
    up: SignedUp,
    pose: Pose | None,
    still: Locals | None,
    color: Color | None = None,
    is_still: bool = True,
    optimizes: bool = False,
) -> Built:
    """Add nodes, meshes and skin of a figure, which as a whole does not move if ``is_still``."""
    figure, influences = body.figure, body.influences
    fixes, record = influences is not None and influences.n_fixed > 0, figure.record
    # A mesh that is not bound is below the node that moves the whole figure.
    bare = record is not None and is_still and (influences is not None or figure.mesh is None)
    tree = add_nodes(
        document, figure.name, up, figure.unit, figure.skeleton, pose, still, fixes, bare
    )
    if record is not None:
        _add_record(document, record, tree.joints, figure.name)
    scene, counts, meshes = [tree.root], list[Phrase](), list[Placed]()
    errors: dict[str, float] = {}
    materials: dict[int, int] = {}
    if figure.mesh is not None and figure.mesh.n_vertices:
        encoding = _encoding(document, body, optimizes)
        errors = encoding.errors
        meshes, materials = _add_meshes(encoding, body, tree, color)
        scene += _place_meshes(document, body, tree, meshes)
        written, before = sum(len(each.part.sources) for each in meshes), figure.mesh.n_vertices
        key = (
            "{n}"
            if written == before
            else "{n} ({before} before they were split along texture seams)"
        )
        counts = [Phrase(key, n=counted(written, "vertex"), before=before)]
        counts.append(Phrase("{n}", n=counted(figure.mesh.n_triangles, "triangle")))
    if figure.skeleton is not None:
        counts.append(Phrase("{n}", n=counted(figure.skeleton.n_joints, "joint")))
    if "scenes" not in document.root:
        document.root["scene"] = document.add("scenes", {**_scene_members(record), "nodes": []})
    document.root["scenes"][0]["nodes"] += scene
    return Built(tree, meshes, counts, errors, scene, materials)


def _encoding(document: Document, body: Body, optimizes: bool) -> Encoding:
    """Return the writer of vertex attributes."""
    if not optimizes:
        return Encoding(document)
    for member in ("extensionsUsed", "extensionsRequired"):
        document.declare(EXTENSION, member=member)
    shapes, offsets = body.figure.blend_shapes, list[Floats]()
    if shapes is not None and len(body.shape.targets):
        offsets = [shapes.direction_values()[row] for row in body.shape.targets]
    return quantized(document, body.figure.require_mesh().positions, offsets)


def _add_meshes(
    encoding: Encoding, body: Body, tree: Tree, color: Color | None
) -> tuple[list[Placed], dict[int, int]]:
    """Add the parts of a figure, each with its node; also return the written materials."""
    figure, meshes, document = body.figure, list[Placed](), encoding.document
    record = figure.record
    materials = Materials(document, figure.require_mesh(), color, record is not None)
    tangents = _tangents(body)
    for part in parts_of(f"{figure.name} mesh", body.shape, body.influences):
        mesh = add_mesh(encoding, materials, part, body.shape, body.influences, tangents)
        if part.joint >= 0:
            node = tree.joints[part.joint]
            document.root["nodes"][node]["mesh"] = mesh
        else:
            item = named(part.name)
            if record is not None and part.index in record.part_extras:
                item["extras"] = record.part_extras[part.index]
            node = document.add("nodes", {**item, "mesh": mesh})
        meshes.append(Placed(node, part, encoding.decoding if part.joint < 0 else np.eye(4)))
    return meshes, materials.written


def _tangents(body: Body) -> Floats | None:
    """Return the tangents of the file, if the figure still has its vertices."""
    record, count = body.figure.record, body.figure.require_mesh().n_vertices
    if record is None or body.shape.baked is not None:
        return None
    found = record.tangents()
    return found if found is not None and len(found) == count else None


def _place_meshes(document: Document, body: Body, tree: Tree, meshes: list[Placed]) -> list[int]:
    """Bind the meshes that have their own nodes; return the nodes that are roots of the scene."""
    nodes = document.root["nodes"]
    own = [placed.node for placed in meshes if placed.part.joint < 0]
    influences, skin = body.influences, body.figure.skin
    if not own:
        return []
    if influences is None or skin is None:
        nodes[tree.place].setdefault("children", []).extend(own)
        for placed in meshes:
            if not np.array_equal(placed.decoding, np.eye(4)):
                nodes[placed.node]["translation"] = placed.decoding[:3, 3].tolist()
                nodes[placed.node]["scale"] = placed.decoding.diagonal()[:3].tolist()
        return []
    decoding = next(placed.decoding for placed in meshes if placed.part.joint < 0)
    matrices = inverse_bind_matrices(influences, skin.inverse_bind, decoding)
    bound = document.array(matrices, "MAT4")
    # Several skins become one.
    known = () if body.figure.record is None else body.figure.record.skin_names
    name = known[0] if len(known) == 1 and known[0] else body.figure.name
    item = {"name": text_of(name), "joints": tree.joints + tree.fixed}
    index = document.add("skins", {**item, "inverseBindMatrices": bound})
    for node in own:
        nodes[node]["skin"] = index
    return own  # glTF ignores the transform of a skinned mesh's own node


def _add_record(document: Document, record: FileRecord, joints: list[int], name: str) -> None:
    """Add the application data and copyright of a file and of its nodes ``joints`` (J,)."""
    asset, holder = document.root["asset"], text_of(record.copyright)
    if holder and holder not in asset.get("copyright", ""):
        asset["copyright"] = "; ".join(filter(None, (asset.get("copyright"), holder)))
    if record.extras is not None:
        document.extras.append((text_of(name), record.extras))
        document.root["extras"] = _merged_extras(document.extras)
    for joint, extras in record.joint_extras.items():
        document.root["nodes"][joints[joint]]["extras"] = extras


def _scene_members(record: FileRecord | None) -> Json:
    """Return the name and application data of the scene of a figure's file."""
    scene = {} if record is None else record.scene
    return {name: text_of(value) if name == "name" else value for name, value in scene.items()}


def _merged_extras(given: list[tuple[str, object]]) -> object:
    """Return the application data of a file: that of all figures, or a list if these differ.

    >>> _merged_extras([("a", 1), ("b", 2), ("c", 1)])["sources"]
    [{'figures': ['a', 'c'], 'extras': 1}, {'figures': ['b'], 'extras': 2}]
    """
    owners: dict[str, list[str]] = {}
    values: Json = {}
    for name, extras in given:
        key = json.dumps(extras, sort_keys=True)
        values[key] = extras
        owners.setdefault(key, []).append(name)
    if len(values) == 1:
        return given[0][1]
    merged: list[Json] = []
    for key, extras in values.items():
        entry = {_FIGURES: owners[key], _EXTRAS: extras}
        # The lists of files that were already merged are joined.
        merged += [each for each in _listed(extras) or [entry] if each not in merged]
    return {_SOURCES: merged}


def _listed(extras: object) -> list[Json]:
    """Return the entries of application data that was already merged; empty for other data."""
    entries = extras.get(_SOURCES) if isinstance(extras, dict) and len(extras) == 1 else None
    is_ours = isinstance(entries, list) and all(
        isinstance(each, dict) and set(each) == {_FIGURES, _EXTRAS} for each in entries
    )
    return entries if is_ours and isinstance(entries, list) else []
