"""Contents of an ``.fbx`` from the messages of the child process."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from viewer.diagnostics import Phrase
from viewer.formats._fbx.child import run_worker
from viewer.formats._fbx.materials import materials_of
from viewer.formats._fbx.meshes import Placed, mesh_on_node, skin_of
from viewer.formats._fbx.message import Arrays
from viewer.formats._nodes.content import (
    NodeAnimation,
    NodeChannel,
    NodeFile,
    NodeMesh,
    NodeSkin,
    NodeTree,
)
from viewer.formats._source import Source
from viewer.phrases import counted
from viewer.rig.arrays import Floats, Ints
from viewer.rig.units import METRES, UNIT_NAMES

__all__ = ["node_file"]

_PERCENT = 100.0  # full weight of a blend channel


def node_file(source: Source) -> NodeFile:
    """Read a file in a child process; see ``viewer.formats.fbx.read``."""
    arrays, told = run_worker(source)
    _say_unused(source, told)
    count = len(told["names"])
    meshes: list[NodeMesh] = []
    skins: list[NodeSkin] = []
    of_node, skin_of_node = np.full((2, count), -1, dtype=np.int32)
    first_mesh: dict[tuple[int, tuple[int, ...], bytes], int] = {}
    for at, mesh in enumerate(told["meshes"]):
        prefix = f"mesh{at}"
        _say_reduced(source, arrays, prefix, mesh)
        skin = skin_of(source, arrays, prefix, mesh)
        if skin is not None:
            skins.append(skin)
        for node, materials in zip(mesh["nodes"], mesh["materials"], strict=True):
            placement = np.eye(4) if skin is not None else arrays["geometry"][node]
            key = (at, tuple(materials), placement.tobytes())
            if key not in first_mesh:
                first_mesh[key] = len(meshes)
                placed = Placed(prefix, mesh, materials, placement)
                meshes.append(mesh_on_node(arrays, placed))
            of_node[node] = first_mesh[key]
            skin_of_node[node] = len(skins) - 1 if skin is not None else -1
    tree = _tree(told["names"], arrays, of_node, skin_of_node)
    return NodeFile(
        source.path.stem,
        tree,
        roots=tuple(np.flatnonzero(arrays["parents"] < 0).tolist()),
        meshes=tuple(meshes),
        skins=tuple(skins),
        materials=materials_of(source, arrays, told),
        animations=_animations(source, told, tree),
        up=told["up"],
        unit=_unit(told["unit"]),
        asset={"generator": told["creator"], "version": f"{told['version'] / 1000:g}"},
    )


def _tree(names: list[str], arrays: Arrays, meshes: Ints, skins: Ints) -> NodeTree:
    local, parents = arrays["local"], arrays["parents"]
    # The root has no name in the file; this is its name in the FBX SDK.
    named = (
        name or ("RootNode" if parent < 0 else "")
        for name, parent in zip(names, parents.tolist(), strict=True)
    )
    return NodeTree(
        tuple(named),
        parents,
        translations=local[:, :3],
        rotations=local[:, 3:7],
        scales=local[:, 7:],
        meshes=meshes,
        skins=skins,
        cameras=np.full(len(names), -1, dtype=np.int32),
    )


def _unit(metres: float) -> str:
    return min(METRES, key=lambda name: abs(np.log(METRES[name] / metres)))


def _say_unused(source: Source, told: dict[str, Any]) -> None:
    """Report unused elements of the file, and converted axes or units."""
    if told["unused"]:
        items = [counted(n, word) for word, n in told["unused"].items()]
        source.warn("F007.fbx-unused", items=items)
    for text in told["warnings"]:
        source.warn("F007.fbx-warning", text=text)
    if told["converted"]:
        names = {"target_axes": "axes", "target_unit_meters": "unit"}
        what = [names[key] for key in told["converted"] if key in names]
        to = [Phrase("fbx-axes") if name == "axes" else UNIT_NAMES["m"] for name in what]
        source.warn("F007.fbx-converted", what=what, to=to)


def _say_reduced(source: Source, arrays: Arrays, prefix: str, mesh: dict[str, Any]) -> None:
    """Report the properties of a mesh that have no equivalent."""
    if mesh["color_sets"] > 1:
        source.warn("F007.fbx-color-sets", mesh=mesh["name"], n=mesh["color_sets"])
    for shape in mesh["shapes"]:
        if shape["in_betweens"] > 0:
            source.warn("F007.fbx-in-betweens", shape=shape["name"], n=shape["in_betweens"])


def _animations(source: Source, told: dict[str, Any], tree: NodeTree) -> tuple[NodeAnimation, ...]:
    everything = frozenset(range(tree.n_nodes))
    shapes = {
        shape["element"]: (at, row)
        for at, mesh in enumerate(told["meshes"])
        for row, shape in enumerate(mesh["shapes"])
    }
    return tuple(
        NodeAnimation(
            stack["name"],
            stack["start"],
            stack["end"],
            everything,
            partial(_channels, source, told, shapes, number),
        )
        for number, stack in enumerate(told["stacks"])
    )


def _channels(
    source: Source, told: dict[str, Any], shapes: dict[int, tuple[int, int]], stack: int
) -> tuple[NodeChannel, ...]:
    """Bake one animation stack in another child process."""
    arrays, keys = run_worker(source, str(stack))
    channels: list[NodeChannel] = []
    weights: dict[int, dict[int, Floats]] = {}  # weights by mesh, then by row of its shapes
    for each in keys["keys"]:
        table = arrays[each["keys"]]
        if each["path"] == "weight":
            at, row = shapes.get(each["element"], (-1, -1))
            if at >= 0:
                weights.setdefault(at, {})[row] = table[:, :2]
            continue
        values = table[:, 1:]
        channels.append(NodeChannel(each["node"], each["path"], table[:, 0], values))
    for at, rows in weights.items():
        mesh = told["meshes"][at]
        times, values = _joined(rows, [shape["weight"] for shape in mesh["shapes"]])
        channels += [NodeChannel(node, "weights", times, values) for node in mesh["nodes"]]
    return tuple(channels)


def _joined(rows: dict[int, Floats], still: list[float]) -> tuple[Floats, Floats]:
    """Return all key times of a mesh's shapes, (N,), and the weights at these times, (N, S)."""
    times = np.unique(np.concatenate([table[:, 0] for table in rows.values()]))
    values = np.tile(still, (len(times), 1))
    for row, table in rows.items():
        values[:, row] = np.interp(times, table[:, 0], table[:, 1]) / _PERCENT
    return times, values
