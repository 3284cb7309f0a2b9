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

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from viewer.formats._scene_graph.content import NodeFile, NodeMesh, NodeSkin, NodeTree
from viewer.formats._scene_graph.figures import figure_group
from viewer.formats._source import Source
from viewer.formats._vrm.reading import with_vrm
from viewer.formats.gltf.animations import Targets, read_animations
from viewer.formats.gltf.checks import check_document
from viewer.formats.gltf.document import Document, open_document
from viewer.formats.gltf.extensions import (
    check_extensions,
    contents_of,
    hidden_nodes,
    unkept_members,
)
from viewer.formats.gltf.materials import DEFAULT_MATERIAL, reading_materials
from viewer.formats.gltf.meshes import node_weights, read_meshes
from viewer.formats.gltf.nodes import (
    checked_bindings,
    read_cameras,
    read_skins,
    read_tree,
    shown_roots,
    shown_scene,
)
from viewer.formats.gltf.toon import stored_textures, stored_toon
from viewer.rigs.figure import FigureGroup

if TYPE_CHECKING:
    from viewer.rigs.motion.skeleton_motion import SkeletonMotion

_VRM = {"VRM", "VRMC_vrm"}
_MOTION = "VRMC_vrm_animation"


def read(source: Source) -> FigureGroup | SkeletonMotion:
    """Read figures and cameras in metres, with ball joints, or the motion of a ``.vrma`` file."""
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
    is_vrm = not _VRM.isdisjoint(extensions)
    return NodeFile(
        name=source.path.stem,
        tree=tree,
        roots=shown_roots(document, tree),
        meshes=meshes,
        skins=skins,
        materials=materials,
        animations=animations,
        cameras=read_cameras(document),
        part_views=dict.fromkeys(hidden_nodes(document, tree), "hidden"),
        extensions=extensions,
        extras=root.values.get("extras"),
        asset=_object(document, "asset"),
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
