"""Meshes of an ``.fbx``: conversion of polygons with per-corner attributes to triangles."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.formats._polygons import triangulate
from viewer.formats._scene_graph.content import MorphTargets, NodeMesh, NodeSkin, Primitive
from viewer.formats._source import Source
from viewer.formats.fbx.message import Arrays
from viewer.phrases import counted, quoted
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.file_record import Json


@dataclass(frozen=True, slots=True)
class Placed:
    """One mesh of the message, at one of its nodes."""

    prefix: str
    """Prefix of the names of its arrays."""
    told: Json
    """Parsed JSON of the mesh."""
    materials: list[int]
    """Material of each slot, to which its faces refer."""
    placement: Floats
    """Geometry to node, (4, 4); the identity for skinned meshes, whose inverse bind matrices
    include it."""


def mesh_on_node(arrays: Arrays, placed: Placed) -> NodeMesh:
    """Return a mesh with one primitive per material."""
    get = _getter(arrays, placed.prefix)
    positions, faces, corners = get("vertices"), get("faces"), get("corners")
    shown = np.flatnonzero(faces[:, 1] >= 3)
    starts, counts = faces[shown, 0], faces[shown, 1]
    listed = np.repeat(starts - np.cumsum(counts) + counts, counts) + np.arange(counts.sum())
    if not len(listed):
        return NodeMesh(placed.told["name"], ())
    picks, owners = triangulate(positions, corners[listed].astype(np.int64), counts)
    wanted = listed[picks]  # corner in the file for each corner of each triangle
    slots = get("face_materials")
    if len(slots) != len(faces):
        slots = np.zeros(len(faces), dtype=np.int32)
    slots = slots[shown[owners]]
    linear, shift = placed.placement[:3, :3], placed.placement[:3, 3]
    if np.linalg.det(linear) < 0.0:
        wanted = wanted[:, ::-1]
    influences = _influences(arrays, placed)
    sets = range(len(placed.told["uv_sets"]))
    names = ["normals", "colors", *(f"uvs{row}" for row in sets)]
    names = [name for name in names if f"{placed.prefix}.{name}" in arrays]
    # An index of the value of each attribute at every corner of the file: (C,) each.
    numbered = []
    for name in names:
        # Equal values get one index, because exporters repeat values for every corner.
        _, number = np.unique(get(name) + 0.0, axis=0, return_inverse=True)
        numbered.append(number.reshape(-1)[get(f"{name}.corners")])
    shapes = placed.told["shapes"]
    primitives = []
    for slot in np.unique(slots).tolist():
        rows = wanted[slots == slot]
        used = np.unique(rows)
        chosen, inverse = _distinct(corners, numbered, used)
        renumbered = np.zeros(len(corners), dtype=np.int32)
        renumbered[used] = inverse
        vertices = corners[chosen]
        values = {name: get(name)[get(f"{name}.corners")[chosen]] for name in names}
        normals = values.get("normals")
        offsets, normal_offsets = (
            [_spread(get, row, name, len(positions))[vertices] for row in range(len(shapes))]
            for name in ("offsets", "normals")
        )
        primitives.append(
            Primitive(
                positions=positions[vertices] @ linear.T + shift,
                triangles=renumbered[rows],
                normals=None if normals is None else _turned(normals, linear),
                uvs=tuple(values[name] for name in values if name.startswith("uvs")),
                colors=values.get("colors"),
                joints=None if influences is None else influences[0][vertices],
                weights=None if influences is None else influences[1][vertices],
                dqs_fractions=_fractions(arrays, placed, vertices),
                material=placed.materials[slot] if 0 <= slot < len(placed.materials) else -1,
                targets=_targets([each @ linear.T for each in offsets]),
                normal_targets=_normal_targets(normal_offsets, linear),
            )
        )
    return NodeMesh(
        placed.told["name"],
        tuple(primitives),
        tuple(shape["name"] for shape in shapes),
        np.array([shape["weight"] for shape in shapes], dtype=np.float64),
    )


def _getter(arrays: Arrays, prefix: str) -> Any:
    return lambda name: arrays[f"{prefix}.{name}"]


def _distinct(
    vertices: Ints, attributes: list[NDArray[np.intp]], corners: NDArray[np.intp]
) -> tuple[NDArray[np.intp], Ints]:
    """Return a corner per vertex with its own position and attributes, and each corner's vertex."""
    keys = [vertices[corners].astype(np.intp), *(numbers[corners] for numbers in attributes)]
    _, first, inverse = np.unique(np.stack(keys), axis=1, return_index=True, return_inverse=True)
    return corners[first], inverse.reshape(-1).astype(np.int32)


def _spread(get: Any, row: int, name: str, count: int) -> Floats:
    """Return the offsets of a shape for all vertices: (V, 3)."""
    result = np.zeros((count, 3))
    vertices, offsets = get(f"shape{row}.vertices"), get(f"shape{row}.{name}")
    if len(offsets) == len(vertices):
        np.add.at(result, vertices, offsets)
    return result


def _targets(offsets: list[Floats]) -> MorphTargets | None:
    return MorphTargets(len(offsets[0]), offsets) if offsets else None


def _normal_targets(rows: list[Floats], linear: Floats) -> MorphTargets | None:
    """Return the offsets of normals; None if the file has none, so that they are recomputed."""
    if not any(each.any() for each in rows):
        return None
    return _targets([_turned(each, linear, unit=False) for each in rows])


def _turned(normals: Floats, linear: Floats, unit: bool = True) -> Floats:
    """Return normals of a transformed surface."""
    if np.array_equal(linear, np.eye(3)):
        return normals
    cofactors = np.linalg.det(linear) * np.linalg.pinv(linear).T
    turned = normals @ cofactors.T
    lengths = np.linalg.norm(turned, axis=-1, keepdims=True)
    return turned / np.where(lengths > 0.0, lengths, 1.0) if unit else turned


def _influences(arrays: Arrays, placed: Placed) -> tuple[Ints, Floats] | None:
    """Return the joints and the weights of the file's vertices: (V, K), (V, K)."""
    if placed.told["skin"] is None:
        return None
    get = _getter(arrays, f"{placed.prefix}.skin")
    kept = get("bones") >= 0
    numbers = np.cumsum(kept) - 1
    cluster = np.repeat(np.arange(len(kept)), get("counts"))
    vertices, weights = get("vertices"), get("weights")
    used = kept[cluster] & (weights != 0.0)
    cluster, vertices, weights = cluster[used], vertices[used], weights[used]
    # Vertices without weights follow their first slot: the node of the mesh; see ``on_nodes``.
    alone = _without_weights(arrays, placed.prefix)
    vertices = np.concatenate([vertices, alone])
    weights = np.concatenate([weights, np.zeros(len(alone))])
    slots = np.concatenate([numbers[cluster], np.full(len(alone), kept.sum())])
    order = np.argsort(vertices, kind="stable")
    slots, vertices, weights = slots[order], vertices[order], weights[order]
    count = len(arrays[f"{placed.prefix}.vertices"])
    counts = np.bincount(vertices, minlength=count)
    slot = np.arange(len(vertices)) - np.repeat(np.cumsum(counts) - counts, counts)
    width = max(int(counts.max(initial=0)), 1)
    joints, table = np.zeros((count, width), dtype=np.int32), np.zeros((count, width))
    joints[vertices, slot] = slots
    table[vertices, slot] = weights
    return joints, table


def _fractions(arrays: Arrays, placed: Placed, chosen: Ints) -> Floats | None:
    """Return the fraction of DQS of some vertices, if the skin blends both methods."""
    skin = placed.told["skin"]
    if skin is None or skin["method"] != "mix":
        return None
    get = _getter(arrays, f"{placed.prefix}.skin.blend")
    fractions = np.zeros(len(arrays[f"{placed.prefix}.vertices"]))
    fractions[get("vertices")] = np.clip(arrays[f"{placed.prefix}.skin.blend"], 0.0, 1.0)
    found: Floats = fractions[chosen]
    return found


def _without_weights(arrays: Arrays, prefix: str) -> Ints:
    """Return the vertices that no joint moves: (M,)."""
    get = _getter(arrays, f"{prefix}.skin")
    cluster = np.repeat(np.arange(len(get("counts"))), get("counts"))
    is_used = (get("bones") >= 0)[cluster] & (get("weights") != 0.0)
    count = len(arrays[f"{prefix}.vertices"])
    found: Ints = np.setdiff1d(np.arange(count, dtype=np.int32), get("vertices")[is_used])
    return found


def on_nodes(arrays: Arrays, prefix: str, skin: NodeSkin, nodes: list[int]) -> list[NodeSkin]:
    """Return a mesh's skin at each node; vertices without weights follow it as the last joint."""
    if not len(_without_weights(arrays, prefix)):
        return [skin]
    return [
        replace(
            skin,
            joints=np.append(skin.joints, node).astype(np.int32),
            inverse_bind=np.concatenate([skin.inverse_bind, arrays["geometry"][node][None]]),
        )
        for node in nodes
    ]


def skin_of(source: Source, arrays: Arrays, prefix: str, told: Json) -> NodeSkin | None:
    """Return the skin of a mesh, and report which parts of it are not used."""
    if told["skin"] is None:
        return None
    get = _getter(arrays, f"{prefix}.skin")
    kept = get("bones") >= 0
    if not kept.all():
        source.warn(
            "F007.fbx-no-bone: mesh {mesh}: {n} without a joint ignored",
            mesh=quoted(told["name"]),
            n=counted(int((~kept).sum()), "skin cluster"),
        )
    if told["n_skins"] > 1:
        source.warn(
            "F007.fbx-skins: mesh {mesh}: only the first of {n} skin deformers is used",
            mesh=quoted(told["name"]),
            n=told["n_skins"],
        )
    if not kept.any():
        return None
    return NodeSkin(
        told["skin"]["name"], get("bones")[kept], get("matrices")[kept], told["skin"]["method"]
    )
