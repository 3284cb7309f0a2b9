"""Figures made from the contents of a file of nodes: parts, records, facts, cameras, messages."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from viewer.data_classes import dataclass
from viewer.formats._scene_graph.bindings import bind_rigid, bind_skins, inverse_binds
from viewer.formats._scene_graph.content import REACH, NodeCamera, NodeFile, NodeTree
from viewer.formats._scene_graph.grouping import Members, group_nodes, is_skinned, scene_order
from viewer.formats._scene_graph.joints import Joints, make_joints, rest_worlds, skeleton_of
from viewer.formats._scene_graph.motions import Reader, animations_of, read_once
from viewer.formats._scene_graph.shapes import blend_shapes_of, shape_columns
from viewer.formats._scene_graph.surfaces import (
    Piece,
    mesh_of,
    pieces_of,
    skin_of,
    tangents_of,
    used_materials,
)
from viewer.phrases import Remedy, agree, counted, listed, quoted, rounded
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.captures.cameras import CameraMount, CameraPath, CameraView, extrinsics
from viewer.rigs.figure import Figure, FigureGroup, read_from
from viewer.rigs.file_record import GENERATOR, FileRecord, VrmRecord
from viewer.rigs.hierarchy import path_to_root, with_ancestors
from viewer.rigs.motion.transform_clip import Animation

if TYPE_CHECKING:
    from viewer.formats._source import Source

_MOST_VERTICES = 1 << 27  # of all parts of all figures
_LONGEST = 200  # maximum number of characters of a fact

_ASSET = ("version", "generator", "copyright")

_ATTRIBUTES = {"positions": "POSITION", "normals": "NORMAL", "weights": "WEIGHTS_0"}


@dataclass(frozen=True, slots=True, eq=False)
class _Made:
    """A figure, its record and joints, its primitives, and the nodes that move it."""

    figure: Figure
    record: FileRecord
    joints: Joints
    pieces: list[Piece]
    moved: set[int]


def figure_group(file: NodeFile, source: Source) -> FigureGroup:
    """Return figures and cameras in scene space; nodes become ball joints about their rest pose."""
    groups = group_nodes(file)
    if not groups:
        contents = file.contents()
        if contents and not source.diagnostics.errors:
            raise source.fault(
                "F008.contents: expected triangles, a skin or a hierarchy of nodes, found only "
                "{contents}",
                contents=listed(contents),
            )
        raise source.fault(
            "F002.no-figure: expected meshes, skins or a hierarchy of nodes, found nothing to show"
        )
    # Refuse a file whose meshes, repeated at many nodes, would exhaust the memory.
    sizes = [sum(len(p.positions) for p in mesh.primitives) for mesh in file.meshes]
    meshes = (int(file.tree.meshes[node]) for members in groups for node in members.meshes)
    count = sum(sizes[mesh] for mesh in meshes)
    if count > _MOST_VERTICES:
        raise source.fault(
            "F002.many-vertices: expected at most {most} vertices, found {found} over all nodes",
            most=_MOST_VERTICES,
            found=count,
        )
    readers = read_once(file.animations)
    order = scene_order(file) if file.cameras else []
    cameras = moved_cameras(file, groups, order)
    written = set[int]().union(*(_above(file, own) for own in cameras))
    file = replace(file, lost_nodes=_lost_nodes(file, groups, written))
    found = [
        _figure(file, members, readers, source, _above(file, own))
        for members, own in zip(groups, cameras, strict=True)
    ]
    _note_normals([piece for each in found for piece in each.pieces], source)
    _note_weights([piece for each in found for piece in each.pieces], source)
    shown = {node for each in found for node in each.moved}
    _note_others(file, shown | written, source)
    _note_methods(file, groups, source)
    carriers = [
        Carrier(each.record, each.joints, own) for each, own in zip(found, cameras, strict=True)
    ]

    def animations(joints: Joints) -> tuple[Animation, ...]:
        return animations_of(file.animations, readers, joints.own, {})

    views, left_out = views_of(file.tree, order, file.cameras, carriers, animations)
    if left_out:
        source.warn(
            "F007.orthographic: orthographic cameras are not supported: {names}",
            names=listed(left_out),
        )
    return FigureGroup(file.name, tuple(each.figure for each in found), views)


def _above(file: NodeFile, cameras: set[int]) -> set[int]:
    """Return the nodes of some cameras and the nodes above them."""
    return with_ancestors(file.tree.parents.tolist(), cameras)


def _lost_nodes(file: NodeFile, groups: list[Members], written: set[int]) -> tuple[str, ...]:
    """Return the names of nodes that are neither joints, meshes, cameras nor above these."""
    kept = written | {node for members in groups for node in (*members.nodes, *members.meshes)}
    lost = [n for n in scene_order(file) if n not in kept and file.tree.cameras[n] < 0]
    extras = file.tree.extras
    if file.asset.get("generator") == GENERATOR:
        # The node around a figure has no data: writers of other files decide whether to have one.
        lost = [n for n in lost if file.tree.parents[n] >= 0 or n in extras]
    return tuple(
        (file.tree.names[n] or f"node {n}") + (" (with extras)" if n in extras else "")
        for n in lost
        if file.has_pointers
    )


def _figure(
    file: NodeFile, members: Members, readers: list[Reader], source: Source, beside: set[int]
) -> _Made:
    """Return one figure, which plays the animations of some nodes beside it, too."""
    joints = make_joints(file.tree, members.nodes)
    worlds = _worlds(joints, source)
    bindings = bind_skins(joints, worlds, {index: file.skins[index] for index in members.skins})
    parts = ((node, file.meshes[int(file.tree.meshes[node])]) for node in members.meshes)
    bind_rigid(
        bindings,
        [node for node, mesh in parts if not is_skinned(mesh, int(file.tree.skins[node]))],
    )
    pieces = pieces_of(file, members.meshes, bindings)
    matrices = inverse_binds(bindings)
    # Refuse vertices that the rest pose moves out of reach.
    with np.errstate(over="ignore", invalid="ignore"):
        palette = np.abs(worlds @ matrices[: len(worlds)]).max(axis=(1, 2), initial=0.0)
    palette = np.concatenate([palette, np.zeros(len(matrices) - len(worlds))])
    for piece in pieces:
        with np.errstate(over="ignore", invalid="ignore"):
            reach = np.abs(piece.baked).max() * np.abs(piece.primitive.positions).max(initial=1.0)
            far = ~(reach * palette[piece.influences.joints] <= REACH)
        if far.any():
            joint = int(piece.influences.joints[far.argmax()])
            name = joints.names[joint]
            raise source.fault(
                "F003.bind-reach: joint {joint}: expected vertices within ±{limit} in the rest "
                "pose, found larger ones",
                joint=quoted(name),
                limit=rounded(REACH, 2),
            )
    columns = shape_columns(file, members.meshes, readers)
    record = _record_of(file, joints, members.meshes, columns, pieces)
    figure = Figure(
        name=members.name or file.name,
        mesh=mesh_of(file, members.meshes, pieces) if pieces else None,
        skeleton=skeleton_of(joints, file.humanoid, file.constraints, file.springs),
        skin=skin_of(file, pieces, matrices) if pieces else None,
        up=file.up,
        unit=file.unit,
        blend_shapes=blend_shapes_of(file, columns, pieces) if pieces else None,
        facts=_facts_of(file, pieces),
        animations=animations_of(file.animations, readers, joints.own, columns, beside),
        record=record,
    )
    pointer_of = _pointers(file, members, joints, pieces) if file.has_pointers else None
    figure = read_from(source.path, figure, pointer_of)
    return _Made(figure, record, joints, pieces, joints.own.keys() | columns.keys())


def _worlds(joints: Joints, source: Source) -> Floats:
    """Return the rest transforms of the joints of nodes; refuse those that are out of reach."""
    with np.errstate(over="ignore", invalid="ignore"):
        worlds = rest_worlds(joints)
    far = ~(np.abs(worlds) <= REACH).all(axis=(1, 2))
    if far.any():
        joint = int(far.argmax())
        found = worlds[joint].flat[int((~(np.abs(worlds[joint]) <= REACH)).argmax())]
        raise source.fault(
            "F003.joint-reach: joint {joint}: expected a rest transform within ±{limit}, found "
            "{found}",
            joint=quoted(joints.names[joint]),
            limit=rounded(REACH, 2),
            found=rounded(found),
        )
    return worlds


def _record_of(
    file: NodeFile,
    joints: Joints,
    nodes: list[int],
    columns: Mapping[int, Ints],
    pieces: list[Piece],
) -> FileRecord:
    """Return the record of a figure whose parts are ``nodes``, with the columns of their shapes."""
    extras = file.tree.extras
    meshes = [file.meshes[int(file.tree.meshes[node])] for node in nodes]
    none = np.zeros(0, dtype=np.int32)
    skins = {int(file.tree.skins[node]) for node in nodes} - {-1}
    return FileRecord(
        copyright=str(file.asset.get("copyright") or ""),
        extras=file.extras,
        joint_extras={joint: extras[node] for node, joint in joints.own.items() if node in extras},
        part_extras={
            part: extras[node]
            for part, node in enumerate(nodes)
            if node in extras and node not in joints.own
        },
        mesh_extras={
            part: mesh.extras for part, mesh in enumerate(meshes) if mesh.extras is not None
        },
        mesh_names=tuple(mesh.name for mesh in meshes),
        skin_names=tuple(file.skins[skin].name for skin in sorted(skins)),
        part_shapes=tuple(columns.get(node, none) for node in nodes),
        target_names=tuple(mesh.target_names for mesh in meshes),
        scene=file.scene,
        tangents=partial(tangents_of, pieces),
        unkept=file.unkept,
        lost_nodes=file.lost_nodes,
        vrm=_vrm_record(file, joints, nodes, pieces),
        has_skin=any(
            is_skinned(mesh, int(file.tree.skins[node]))
            for mesh, node in zip(meshes, nodes, strict=True)
        ),
    )


def _vrm_record(
    file: NodeFile, joints: Joints, nodes: list[int], pieces: list[Piece]
) -> VrmRecord | None:
    """Return the VRM properties of the figure that has the humanoid; None for others."""
    is_vrm = "VRMC_vrm" in file.extensions
    if not is_vrm or not any(node in joints.own for node in file.humanoid.values()):
        return None
    return VrmRecord(
        extensions=file.extensions,
        joints=joints.own,
        parts={node: part for part, node in enumerate(nodes)},
        materials=tuple(used_materials(pieces)),
        toon=file.toon,
        textures=file.textures,
        old_members=file.old_members,
    )


def _facts_of(file: NodeFile, pieces: list[Piece]) -> tuple[tuple[str, str], ...]:
    """Return the facts about a figure and its file, each a heading and a text."""
    facts = [
        (key, str(file.asset[key])[:_LONGEST]) for key in _ASSET if file.asset.get(key) is not None
    ]
    licence = file.asset.get("license") or file.asset.get("licence")
    extras = file.asset.get("extras")
    if licence is None and isinstance(extras, dict):
        licence = extras.get("license") or extras.get("licence")
    if isinstance(licence, str):
        facts.append(("licence", licence[:_LONGEST]))
    sums = max((piece.influences.deviation for piece in pieces), default=0.0)
    # Smaller deviations are rounding errors of float32.
    if sums > 1e-6:
        facts.append(("weight sums", f"within {sums:.2g} of 1, divided by their sum"))
    return (*facts, *file.facts)


def _pointers(
    file: NodeFile, members: Members, joints: Joints, pieces: list[Piece]
) -> Callable[[str, int], str]:
    """Return the function that returns JSON pointers to nodes, skin joints and primitives."""
    first_vertices = np.cumsum([0, *(piece.n_vertices for piece in pieces)])
    first_triangles = np.cumsum([0, *(len(piece.triangles) for piece in pieces)])
    primitives = [piece.primitive.pointer for piece in pieces]
    nodes, skins = joints.nodes, {index: file.skins[index].joints for index in members.skins}

    def pointer_of(kind: str, index: int) -> str:
        if kind in ("joints", "bindings"):
            return _joint(nodes[index], skins if kind == "bindings" else {})
        if kind == "triangles":
            return primitives[int(np.searchsorted(first_triangles, index, "right")) - 1]
        if kind in _ATTRIBUTES:
            piece = int(np.searchsorted(first_vertices, index, "right")) - 1
            return f"{primitives[piece]}/attributes/{_ATTRIBUTES[kind]}"
        return ""

    return pointer_of


def _joint(node: int, skins: Mapping[int, Ints]) -> str:
    """Return the pointer to a joint's entry in a skin, or to its node; empty if auxiliary."""
    if node < 0:
        return ""
    for index, joints in skins.items():
        places = np.flatnonzero(joints == node)
        if len(places):
            return f"/skins/{index}/joints/{places[0]}"
    return f"/nodes/{node}"


def _note_normals(pieces: list[Piece], source: Source) -> None:
    """Report primitives without normals, and the number of vertices that flat shading adds."""
    split = [piece for piece in pieces if piece.shading == "flat"]
    added = sum(piece.n_vertices - len(piece.primitive.positions) for piece in split)
    if added:
        source.warn(
            "F007.flat-normals: {n} without normals: flat shaded, with {vertices} along the edges",
            n=counted(len(split), "primitive"),
            vertices=counted(added, "additional vertex"),
        )
    smooth = [piece for piece in pieces if piece.shading == "smooth"]
    if smooth:
        source.warn(
            "F007.smooth-normals: {n} without normals: smoothly shaded",
            n=counted(len(smooth), "large primitive"),
        )


def _note_weights(pieces: list[Piece], source: Source) -> None:
    """Record sums of weights that are not 1, located at the first."""
    odd = [piece for piece in pieces if piece.influences.n_deviating]
    if odd:
        n = sum(piece.influences.n_deviating for piece in odd)
        most = max(piece.influences.deviation for piece in odd)
        pointer = odd[0].primitive.pointer
        source.warn(
            "W001.divided: weights of {n} do not sum to 1 (error up to {most}): divided by "
            "their sum",
            f"{pointer}/attributes/WEIGHTS_0" if pointer else None,
            n=counted(n, "vertex"),
            most=rounded(most, 2),
        )


def _note_others(file: NodeFile, shown: set[int], source: Source) -> None:
    """Report animated nodes of no figure, such as those of cameras."""
    moved = set[int]().union(*(each.nodes for each in file.animations))
    others = [node for node in sorted(moved - shown) if file.tree.skins[node] < 0]
    if others:
        names = [file.tree.names[node] or f"node {node}" for node in others]
        source.warn(
            "F007.animated-others: animations of {n} that {belong} to no figure are omitted: "
            "{names}",
            n=counted(len(names), "node"),
            names=listed(names),
            belong=agree(len(names), "belongs", "belong"),
        )


def _note_methods(file: NodeFile, groups: list[Members], source: Source) -> None:
    """Report skins that the file deforms by a method other than LBS."""
    used = (file.skins[skin] for members in groups for skin in members.skins)
    others: dict[str, list[str]] = {}
    for skin in used:
        if skin.method != "lbs":
            others.setdefault(skin.method, []).append(skin.name)
    for method, names in others.items():
        source.warn(
            "F007.skinning-method: {skins} {names} {ask} for the method {method}: used unless "
            "{remedy} selects another one",
            names=listed(names),
            n=len(names),
            method=method,
            skins=agree(len(names), "skin", "skins"),
            ask=agree(len(names), "asks", "ask"),
            remedy=Remedy("the Skinning panel", "--method"),
        )


# Cameras, as views that the nodes above them move.

_HEIGHT = 1080  # height of a view, pixels
_ASPECT = 16.0 / 9.0  # aspect ratio of cameras that specify none


@dataclass(frozen=True, slots=True, eq=False)
class Carrier:
    """A figure whose joints can carry cameras, and the cameras that its animations move."""

    record: FileRecord
    joints: Joints
    cameras: AbstractSet[int] = frozenset()


def moved_cameras(
    file: NodeFile, groups: Sequence[Members], order: Sequence[int]
) -> list[set[int]]:
    """Return for each figure the cameras that animated nodes move, other than joints."""
    found = [set[int]() for _ in groups]
    joints = [set(each.nodes) for each in groups]
    plays = [
        {at for at, each in enumerate(file.animations) if each.nodes & {*own, *group.meshes}}
        for own, group in zip(joints, groups, strict=True)
    ]
    for node in order:
        if file.tree.cameras[node] < 0 or any(node in own for own in joints):
            continue
        path = path_to_root(file.tree.parents, node)
        above = next((at for at in path if any(at in own for own in joints)), None)
        own = path if above is None else path[: path.index(above)]
        moving = {at for at, each in enumerate(file.animations) if not each.nodes.isdisjoint(own)}
        if moving:
            # Of the figures with the nearest joint above, or of all, it belongs to the one that
            # plays most of the animations.
            owners = [at for at, each in enumerate(joints) if above is None or above in each]
            found[max(owners, key=lambda at: len(plays[at] & moving))].add(node)
    return found


def views_of(
    tree: NodeTree,
    order: list[int],
    cameras: tuple[NodeCamera, ...],
    carriers: Sequence[Carrier] = (),
    animations: Callable[[Joints], tuple[Animation, ...]] = lambda _: (),
) -> tuple[tuple[CameraView, ...], list[str]]:
    """Return perspective cameras in the space of the scene, and names of orthographic ones."""
    chosen = [node for node in order if tree.cameras[node] >= 0]
    if not chosen:
        return (), []
    needed = with_ancestors(tree.parents.tolist(), chosen)
    joints = make_joints(tree, [node for node in order if node in needed])
    worlds = rest_worlds(joints)
    views, left_out = [], []
    for node in chosen:
        camera = cameras[int(tree.cameras[node])]
        name = tree.names[node] or camera.name or f"camera {node}"
        if camera.vertical_angle is None:
            left_out.append(name)
            continue
        width, height = max(1, round(_HEIGHT * (camera.aspect or _ASPECT))), _HEIGHT
        focal = 0.5 * height / math.tan(0.5 * camera.vertical_angle)
        # glTF projects the axis of the camera to the centre of the picture. Pixel coordinates begin
        # at the centre of the first pixel, so the principal point is at (W - 1) / 2, (H - 1) / 2.
        across, down = 0.5 * (width - 1.0), 0.5 * (height - 1.0)
        rotation, translation = extrinsics(worlds[joints.carrier[node]])
        views.append(
            CameraView(
                name=name,
                intrinsic=np.array([[focal, 0.0, across], [0.0, focal, down], [0.0, 0.0, 1.0]]),
                rotation=rotation,
                translation=translation,
                size=(width, height),
                near=camera.near,
                far=camera.far,
                mount=_mount(tree, node, carriers, animations),
            )
        )
    return tuple(views), left_out


def _mount(
    tree: NodeTree,
    node: int,
    carriers: Sequence[Carrier],
    animations: Callable[[Joints], tuple[Animation, ...]],
) -> CameraMount | None:
    """Return the joint at or above a camera, or animated nodes below that; None without either."""
    mover = next((carrier for carrier in carriers if node in carrier.cameras), None)
    choice = carriers if mover is None else (mover,)
    owner, joint, below = mover, -1, list[int]()
    for above in path_to_root(tree.parents, node):
        found = next((each for each in choice if above in each.joints.carrier), None)
        if found is not None:
            owner, joint = found, found.joints.carrier[above]
            break
        below.append(above)
    if owner is None:
        return None
    if not below:
        return CameraMount(owner.record, joint, np.eye(4))
    # Without the nodes above, the rest transforms are relative to the joint.
    chain = make_joints(tree, below[::-1])
    path = None if mover is None else CameraPath(skeleton_of(chain), animations(chain))
    return CameraMount(owner.record, joint, rest_worlds(chain)[-1], path)
