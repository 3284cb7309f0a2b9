"""Reader of glTF 2.0: ``.gltf``, ``.glb``, characters (``.vrm``) and their motions (``.vrma``).

::

    asset         {"version": "2.0", …}
    scenes        root nodes; scene is the default one
    nodes         children; matrix, or translation, rotation, scale; mesh, skin, camera, weights
    meshes        primitives of vertex attributes, indices, material and morph targets
    skins         joints (nodes) and inverseBindMatrices
    animations    channels (node and path) with samplers: LINEAR, STEP or CUBICSPLINE
    accessors     typed arrays in bufferViews of buffers: the binary chunk, data URIs or files

Errors name the element by its JSON pointer. Figures are made by ``formats/_scene_graph``.
Specification: Khronos Group, glTF 2.0, ISO/IEC 12113.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from viewer.diagnostics import Phrase
from viewer.formats._scene_graph.content import NodeFile, NodeMesh, NodeSkin, NodeTree
from viewer.formats._scene_graph.figures import figure_group
from viewer.formats._source import Source
from viewer.formats._vrm.parts import objects_in
from viewer.formats._vrm.reading import with_vrm
from viewer.formats.gltf.animations import Targets, read_animations
from viewer.formats.gltf.checks import check_document
from viewer.formats.gltf.document import Document, open_document
from viewer.formats.gltf.materials import DEFAULT_MATERIAL, DRAWN_EXTENSIONS, reading_materials
from viewer.formats.gltf.meshes import node_weights, read_meshes
from viewer.formats.gltf.nodes import (
    checked_bindings,
    in_own_axes,
    read_cameras,
    read_skins,
    read_tree,
    shown_roots,
    shown_scene,
)
from viewer.formats.gltf.toon import stored_textures, stored_toon
from viewer.phrases import agree, counted, listed
from viewer.rigs.figure import FigureGroup
from viewer.rigs.file_record import GENERATOR, Json
from viewer.rigs.geometry.vectors import Up
from viewer.rigs.hierarchy import descendants

if TYPE_CHECKING:
    from viewer.rigs.motion.skeleton_motion import SkeletonMotion

_VRM = {"VRM", "VRMC_vrm"}
_MOTION = "VRMC_vrm_animation"


def read(source: Source) -> FigureGroup | SkeletonMotion:
    """Read figures and cameras with ball joints, or the motion of a ``.vrma`` file.

    They are in metres with y up, except for figures that this program wrote from other axes or
    units, which get those again.
    """
    file = read_nodes(source)
    if isinstance(file.extensions.get(_MOTION), dict):
        from viewer.formats._vrm.animation import read_motion

        return read_motion(file, source)
    return figure_group(with_vrm(file, source), source)


def read_nodes(source: Source) -> NodeFile:
    """Return the contents of a glTF file; the keys of animations are read when they are played."""
    document = open_document(source)
    check_extensions(document)
    with reading_materials(document) as finish_materials:
        tree, skins = _without_empty(read_tree(document), read_skins(document))
        meshes = checked_bindings(document, tree, read_meshes(document), skins)
        tree = replace(tree, shape_weights=node_weights(document, tree, meshes))
        if source.diagnostics.keeps_errors:
            check_document(document, tree, meshes, skins)
        animations = read_animations(document, Targets(tree, meshes))
        materials = finish_materials()
    if any(one.material < 0 for mesh in meshes for one in mesh.primitives):
        meshes = tuple(_with_material(mesh, len(materials)) for mesh in meshes)
        materials = (*materials, DEFAULT_MATERIAL)
    root, extensions = document.root, _object(document, "extensions")
    asset, roots = _object(document, "asset"), shown_roots(document, tree)
    moved = set[int]().union(*(animation.nodes for animation in animations))
    is_vrm = not _VRM.isdisjoint(extensions)
    up: Up = "y"
    unit = "m"
    if asset.get("generator") == GENERATOR and not is_vrm:
        tree, roots, up, unit = in_own_axes(tree, roots, moved)
    return NodeFile(
        name=source.path.stem,
        tree=tree,
        roots=roots,
        up=up,
        unit=unit,
        meshes=meshes,
        skins=skins,
        materials=materials,
        animations=animations,
        cameras=read_cameras(document),
        part_views=dict.fromkeys(hidden_nodes(document, tree), "hidden"),
        extensions=extensions,
        extras=root.values.get("extras"),
        asset=asset,
        scene=shown_scene(document),
        unkept=partial(unkept_members, root.values),
        contents=partial(contents_of, root.values),
        has_pointers=True,
        toon=stored_toon(document) if is_vrm else {},
        textures=stored_textures(document) if is_vrm else None,
    )


def _without_empty(
    tree: NodeTree, skins: tuple[NodeSkin, ...]
) -> tuple[NodeTree, tuple[NodeSkin, ...]]:
    """Return nodes and skins after removing skins without joints, and references to them."""
    is_kept = np.array([len(skin.joints) > 0 for skin in skins], dtype=np.bool_)
    if is_kept.all():
        return tree, skins
    # Nodes without a skin have the index -1, which selects the last entry.
    numbers = np.append(np.where(is_kept, np.cumsum(is_kept) - 1, -1), -1).astype(np.int32)
    return replace(tree, skins=numbers[tree.skins]), tuple(s for s in skins if len(s.joints))


def _with_material(mesh: NodeMesh, index: int) -> NodeMesh:
    """Return a mesh with this material assigned to primitives that have none."""
    primitives = (
        replace(one, material=index) if one.material < 0 else one for one in mesh.primitives
    )
    return replace(mesh, primitives=tuple(primitives))


def _object(document: Document, name: str) -> dict[str, object]:
    part = document.root.part(name)
    return {} if part is None else part.values


# Extensions and contents that are read and written back, and messages about the others.

# Extensions of geometry and animation, and of characters; materials and textures list their own.
_GEOMETRY = (
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "EXT_meshopt_compression",
)
_CHARACTERS = (
    "VRM",
    "VRMC_node_constraint",
    "VRMC_springBone",
    "VRMC_springBone_extended_collider",
    "VRMC_vrm",
    "VRMC_vrm_animation",
)
_VISIBILITY = "KHR_node_visibility"

# Lights are counted below, and hidden nodes by ``hidden_nodes``.
_WITHOUT_EFFECT = ("KHR_lights_punctual", "KHR_xmp_json_ld")

# Extensions that the reader of materials reports.
_ABOUT = re.compile(r"[A-Z]+_(materials|texture)_")

# Without these, a file has the same surfaces and motions, although it may look or sound different.
_LOOK = re.compile(r"[A-Z]+_(materials|texture|lights|image)_")
_LOOKS = ("FB_ngon_encoding", "KHR_audio", "KHR_audio_emitter", "KHR_xmp", "MSFT_lod")
_KEPT_EXTENSIONS = frozenset((*_GEOMETRY, *DRAWN_EXTENSIONS, *_CHARACTERS))
"""Extensions whose effect is written back, although not always in the same form."""
_KNOWN = _KEPT_EXTENSIONS | {*_WITHOUT_EFFECT, _VISIBILITY}
"""Extensions that are read, or have no visible effect."""

# Lists whose items have application data that is written back.
_KEPT = frozenset({"nodes", "meshes", "materials", "scenes", "animations"})

# Lists whose items lose their names: the writer makes new ones, or names cameras after their nodes.
_UNNAMED = frozenset({"textures", "samplers", "cameras"})
_DRAWN = {0: "points", 1: "lines", 2: "lines", 3: "lines"}
_READ = re.compile(r"POSITION|NORMAL|TANGENT|COLOR_0|(TEXCOORD|JOINTS|WEIGHTS)_\d+")


def check_extensions(document: Document) -> None:
    """Refuse a document that needs an unknown extension; report other unknown ones once."""
    required = [name for name in _names(document, "extensionsRequired") if name not in _KNOWN]
    unknown = [name for name in required if not (name in _LOOKS or _LOOK.match(name) is not None)]
    pointer = document.root.at("extensionsRequired")
    if unknown:
        document.source.refuse(
            "F002.gltf-extensions: expected supported extensions, found {names}, without which "
            "the file may have another shape or motion",
            pointer,
            names=listed(unknown, 12),
        )
    looks = [name for name in required if name not in unknown]
    if looks:
        document.source.warn(
            "F007.gltf-look: {names} not shown: surfaces and motions do not depend on {them}",
            pointer,
            names=listed(looks, 12),
            n=len(looks),
            them=agree(len(looks), "it", "them"),
        )
    optional = [name for name in _names(document, "extensionsUsed") if name not in _KNOWN]
    optional = [name for name in optional if name not in required and not _ABOUT.match(name)]
    if optional:
        document.root.warn(
            "F007.gltf-extensions: ignored unsupported {names}",
            "extensionsUsed",
            names=listed(optional, 12),
        )
    lights = document.root.extension("KHR_lights_punctual")
    if lights is not None and len(lights.table("lights")):
        document.root.warn(
            "F007.gltf-lights: {n} not used",
            "extensions",
            n=counted(len(lights.table("lights")), "light"),
        )


def _names(document: Document, member: str) -> list[str]:
    items: Any = document.root.values.get(member, [])
    if type(items) is not list or set(map(type, items)) - {str}:
        raise document.root.wrong(member, "a list of names")
    return list(dict.fromkeys(items))


def hidden_nodes(document: Document, tree: NodeTree) -> list[int]:
    """Return the nodes that ``KHR_node_visibility`` hides with everything below them."""
    extensions = tree.extensions
    stated = [
        node
        for node, told in extensions.items()
        if isinstance(told, dict)
        and isinstance(found := told.get(_VISIBILITY), dict)
        and found.get("visible") is False
    ]
    if not stated:
        return []
    hidden = np.zeros(tree.n_nodes, dtype=np.bool_)
    for node in stated:
        hidden |= descendants(tree.parents, node)
    drawn = np.flatnonzero(hidden & (tree.meshes >= 0)).tolist()
    if drawn:
        names = [tree.names[node] or f"node {node}" for node in drawn]
        document.source.warn(
            "F007.gltf-hidden: {n} hidden by KHR_node_visibility: {names}",
            "/nodes",
            n=counted(len(drawn), "node", "is", "are"),
            names=listed(names, 12),
        )
    return drawn


def unkept_members(root: Json) -> tuple[str, ...]:
    """Return the members that are not written back, each once, such as ``images.extras``.

    >>> images = [{"extras": 1}, {"extras": 2}]
    >>> attributes = {"POSITION": 0, "_SPEED": 1}
    >>> meshes = [{"extras": 3, "primitives": [{"attributes": attributes}]}]
    >>> unkept_members({"images": images, "meshes": meshes, "extras": 4})
    ('images.extras', 'attributes._SPEED')
    """
    found: dict[str, None] = {}
    for kind, told in root.items():
        if kind == "extensions":
            found |= dict.fromkeys(_extensions(kind, told))
        if kind == "asset":
            found |= dict.fromkeys(_members(kind, [told], False))
        elif isinstance(told, list):
            found |= dict.fromkeys(_names_not_kept(kind, root))
            found |= dict.fromkeys(_members(kind, told, kind in _KEPT))
    return tuple(found)


def _members(kind: str, listed: list[object], keeps_extras: bool) -> Iterator[str]:
    """Yield the members of the objects in a list, and of the objects within these."""
    for item in listed:
        if not isinstance(item, dict):
            continue
        for name, value in item.items():
            if name == "extras":
                yield from () if keeps_extras else (f"{kind}.{name}",)
            elif name == "extensions":
                yield from _extensions(kind, value)
            elif name == "attributes" and isinstance(value, dict):
                yield from (f"{name}.{each}" for each in value if not _READ.fullmatch(each))
            elif isinstance(value, list | dict):
                yield from _members(name, value if isinstance(value, list) else [value], False)


def _names_not_kept(kind: str, root: Json) -> Iterator[str]:
    """Yield the name of a list whose items lose names."""
    named = {at: item["name"] for at, item in objects_in(root, kind) if item.get("name")}
    if kind == "cameras":
        # The node's name comes first; without one, the camera keeps its own.
        nodes = [node for _, node in objects_in(root, "nodes") if node.get("name")]
        lost = any(
            named.get(node.get("camera", -1), node["name"]) != node["name"] for node in nodes
        )
    else:
        lost = bool(named)
    if lost and kind in _UNNAMED:
        yield f"{kind}.name"


def _extensions(kind: str, told: object) -> Iterator[str]:
    for name in told if isinstance(told, dict) else ():
        if name not in _KEPT_EXTENSIONS:
            yield f"{kind}.{name}"


def contents_of(root: Json) -> tuple[Phrase, ...]:
    """Return what a document holds, with numbers, as parts of a message."""
    counts: Counter[str] = Counter()
    for _, mesh in objects_in(root, "meshes"):
        for _, primitive in objects_in(mesh, "primitives"):
            counts[_DRAWN.get(primitive.get("mode", 4), "triangles")] += 1
    parts = [
        ("{n} of points", "primitive", counts["points"]),
        ("{n} of lines", "primitive", counts["lines"]),
        ("{n} of triangles that no node shows", "primitive", counts["triangles"]),
    ]
    for kind in ("camera", "node", "skin", "animation", "material", "image"):
        parts.append(("{n}", kind, len([*objects_in(root, f"{kind}s")])))
    lights = [*objects_in(root, "extensions", "KHR_lights_punctual", "lights")]
    parts.append(("{n}", "light", len(lights)))
    return tuple(Phrase(text, n=counted(n, noun)) for text, noun, n in parts if n)
