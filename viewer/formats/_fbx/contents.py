"""Contents of an ``.fbx`` from the messages of the child process."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from viewer.diagnostics import Phrase
from viewer.formats._fbx.child import run_worker
from viewer.formats._fbx.materials import materials_of
from viewer.formats._fbx.meshes import Placed, mesh_on_node, on_nodes, skin_of
from viewer.formats._fbx.message import Arrays
from viewer.formats._nodes.content import (
    REACH,
    NodeAnimation,
    NodeCamera,
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

__all__ = ["node_file", "target_weights"]


_STRAIGHT = 180.0  # limit of a field of view, degrees
# Translation, rotation and scale that turn -z to +x: -90 degrees about y.
_TO_CAMERA = np.array([0.0, 0.0, 0.0, 0.0, -math.sqrt(0.5), 0.0, math.sqrt(0.5), 1.0, 1.0, 1.0])
_BINARY = b"Kaydara FBX Binary"  # first bytes of the binary variant
_UNSTRUCTURED = re.compile(rb'"[^"]*"|;[^\n]*')  # strings and comments of the text variant
_STACKED = 7000  # version since which animations are objects instead of a last section, Takes
_CONNECTED = 6000  # version since which objects are connected by a section of their own


def node_file(source: Source) -> NodeFile:
    """Read a file in a child process; see ``viewer.formats.fbx.read``."""
    arrays, told = run_worker(source)
    _check_end(source, told["version"])
    _check_arrays(source, arrays, partial(_place, told))
    _check_values(source, told, "")
    _check_indices(source, arrays, told)
    _say_unused(source, told)
    n_joints = len(told["names"])
    cameras, of_camera = _add_cameras(told, arrays)
    count = len(told["names"])
    meshes: list[NodeMesh] = []
    skins: list[NodeSkin] = []
    of_node, skin_of_node = np.full((2, count), -1, dtype=np.int32)
    first_mesh: dict[tuple[int, tuple[int, ...], bytes], int] = {}
    for at, mesh in enumerate(told["meshes"]):
        prefix = f"mesh{at}"
        _say_reduced(source, arrays, prefix, mesh)
        skin = skin_of(source, arrays, prefix, mesh)
        first_skin = len(skins)
        if skin is not None:
            skins += on_nodes(arrays, prefix, skin, mesh["nodes"])
        for at_node, (node, materials) in enumerate(
            zip(mesh["nodes"], mesh["materials"], strict=True)
        ):
            placement = np.eye(4) if skin is not None else arrays["geometry"][node]
            key = (at, tuple(materials), placement.tobytes())
            if key not in first_mesh:
                first_mesh[key] = len(meshes)
                placed = Placed(prefix, mesh, materials, placement)
                meshes.append(mesh_on_node(arrays, placed))
            of_node[node] = first_mesh[key]
            if skin is not None:
                skin_of_node[node] = min(first_skin + at_node, len(skins) - 1)
    tree = _tree(told["names"], arrays, of_node, skin_of_node, of_camera)
    return NodeFile(
        source.path.stem,
        tree,
        roots=tuple(np.flatnonzero(arrays["parents"] < 0).tolist()),
        meshes=tuple(meshes),
        skins=tuple(skins),
        materials=materials_of(source, arrays, told),
        cameras=cameras,
        animations=_animations(source, told),
        up=told["up"],
        unit=_unit(told["unit"]),
        # Unanimated joints of a skeleton, such as its ends, stay joints.
        named_nodes=frozenset(range(n_joints) if told["stacks"] else ()),
        asset={"generator": told["creator"], "version": f"{told['version'] / 1000:g}"},
    )


def _check_end(source: Source, version: int) -> None:
    """Refuse a text file that is cut short, which ufbx reads as if the rest did not exist."""
    if source.peek(len(_BINARY)) == _BINARY:
        return
    bare = _UNSTRUCTURED.sub(b"", source.data)
    depth = bare.count(b"{") - bare.count(b"}")
    if depth > 0:
        raise source.fault("F002.fbx-cut", source.end, n=depth)
    if version >= _CONNECTED and b"Connections:" not in bare:
        raise source.fault("F002.fbx-connections", source.end)
    if _CONNECTED <= version < _STACKED and b"Takes:" not in bare:
        # The SDK always writes this section, other programs may not, so the file can be whole.
        source.warn("F007.fbx-takes", source.end)


def _check_arrays(source: Source, arrays: Arrays, place: Callable[[str, int], Phrase]) -> None:
    """Refuse a message with a number that is not finite or out of reach."""
    for name, array in arrays.items():
        if array.dtype != np.float64:
            continue
        bad = ~(np.abs(array) <= REACH)
        if bad.any():
            row, found = int(np.argwhere(bad)[0][0]), float(array[bad][0])
            kind = "limit" if math.isfinite(found) else "finite"
            at = place(name, row)
            raise source.fault(f"F003.{kind}", item=at, found=found, limit=REACH, at="")


def _check_values(source: Source, told: Any, path: str) -> None:
    """Refuse such numbers in the JSON of a message."""
    if isinstance(told, float):
        _check_arrays(
            source, {path: np.array([told])}, lambda name, _: Phrase("fbx-value", of=name)
        )
    elif isinstance(told, dict):
        name = told.get("name")
        for key, value in told.items():
            _check_values(source, value, " ".join(filter(None, (path, name, key))))
    elif isinstance(told, list):
        for value in told:
            _check_values(source, value, path)


def _check_indices(source: Source, arrays: Arrays, told: dict[str, Any]) -> None:
    """Refuse skins and blend shapes of vertices that their mesh does not have."""
    for name, array in arrays.items():
        if not name.endswith(".vertices") or array.dtype == np.float64:
            continue
        last = len(arrays[f"{name.split('.')[0]}.vertices"]) - 1
        wrong = (array < 0) | (array > last)
        if wrong.any():
            place = _place(told, name, int(wrong.argmax()))
            found = float(array[wrong.argmax()])
            raise source.fault("F002.vertex-range", item=place, last=last, found=found)


_WHAT = {
    "vertices": "position",
    "normals": "normal",
    "colors": "color",
    "matrices": "bind-matrix",
    "weights": "weight",
    "blend": "weight",
    "offsets": "offset",
}
"""Phrase of a number in an array of a mesh, by the array's name."""


def _place(told: dict[str, Any], name: str, row: int) -> Phrase:
    """Return where an array of the contents stands in the file."""
    if name in ("local", "geometry"):
        return Phrase("fbx-node", node=told["names"][row], row=row)
    owner, *_, what = name.split(".")
    mesh = told["meshes"][int(owner.removeprefix("mesh"))]
    return Phrase(
        "fbx-mesh", mesh=mesh["name"], what=Phrase(f"fbx-{_WHAT.get(what, 'uv')}"), row=row
    )


def _place_of_keys(told: dict[str, Any], track: dict[str, Any]) -> Phrase:
    """Return which property has invalid keys."""
    if track["path"] != "weight":
        name = told["names"][track["node"]]
    else:
        rows = [shape for mesh in told["meshes"] for shape in mesh["shapes"]]
        name = next((r["name"] for r in rows if r["element"] == track["element"]), "")
    return Phrase("fbx-keys", node=name, path=track["path"])


def _add_cameras(told: dict[str, Any], arrays: Arrays) -> tuple[tuple[NodeCamera, ...], Ints]:
    """Return the cameras, and the camera of each node, after adding a node for each.

    A camera of an FBX looks along +x of its node instead of -z.
    """
    made, parents, of_node = [], [], [-1] * len(told["names"])
    for number, camera in enumerate(told["cameras"]):
        angle, aspect = camera["angle"], camera["aspect"]
        made.append(
            NodeCamera(
                camera["name"],
                None if angle is None or not 0.0 < angle < _STRAIGHT else math.radians(angle),
                aspect if aspect > 0.0 else None,
                camera["height"],
                camera["near"] if camera["near"] > 0.0 else None,
                camera["far"] if camera["far"] > camera["near"] else None,
            )
        )
        parents += camera["nodes"]
        of_node += [number] * len(camera["nodes"])
        told["names"] += [told["names"][node] for node in camera["nodes"]]
    added = np.tile(_TO_CAMERA, (len(parents), 1))
    same = np.tile(np.eye(4), (len(parents), 1, 1))
    arrays["parents"] = np.append(arrays["parents"], parents).astype(np.int32)
    arrays["local"] = np.concatenate([arrays["local"], added])
    arrays["geometry"] = np.concatenate([arrays["geometry"], same])
    return tuple(made), np.array(of_node, dtype=np.int32)


def _tree(names: list[str], arrays: Arrays, meshes: Ints, skins: Ints, cameras: Ints) -> NodeTree:
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
        cameras=cameras,
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
        if shape["place"] == len(shape["targets"]) - 1 > 0:
            source.warn("F007.fbx-in-betweens", shape=shape["name"], n=shape["place"])


def _animations(source: Source, told: dict[str, Any]) -> tuple[NodeAnimation, ...]:
    meshes: dict[int, int] = {}  # mesh of each blend channel
    for at, mesh in enumerate(told["meshes"]):
        meshes |= dict.fromkeys((shape["element"] for shape in mesh["shapes"]), at)
    return tuple(
        NodeAnimation(
            stack["name"],
            stack["start"],
            stack["end"],
            frozenset(stack["nodes"]),
            partial(_channels, source, told, meshes, number),
        )
        for number, stack in enumerate(told["stacks"])
    )


def _channels(
    source: Source, told: dict[str, Any], meshes: dict[int, int], stack: int
) -> tuple[NodeChannel, ...]:
    """Sample one animation stack in another child process."""
    arrays, keys = run_worker(source, str(stack))
    tracks = {each["keys"]: each for each in keys["keys"]}
    _check_arrays(source, arrays, lambda name, row: _place_of_keys(told, tracks[name]))
    if keys["cut"]:
        source.warn("F007.fbx-continued", n=keys["cut"])
    channels: list[NodeChannel] = []
    weights: dict[int, dict[int, Floats]] = {}  # weights by mesh, then by blend channel
    for each in keys["keys"]:
        table = arrays[each["keys"]]
        if each["path"] == "weight":
            if each["element"] in meshes:
                weights.setdefault(meshes[each["element"]], {})[each["element"]] = table
        else:
            values = table[:, 1:]
            channels.append(NodeChannel(each["node"], each["path"], table[:, 0], values))
    for at, tables in weights.items():
        mesh = told["meshes"][at]
        times, values = _joined(tables, mesh["shapes"])
        channels += [NodeChannel(node, "weights", times, values) for node in mesh["nodes"]]
    return tuple(channels)


def _joined(tables: dict[int, Floats], shapes: list[dict[str, Any]]) -> tuple[Floats, Floats]:
    """Return all key times of a mesh's shapes, (N,), and the weights at these times, (N, S)."""
    targets = {shape["element"]: shape["targets"] for shape in shapes}
    times = [_crossings(table, targets[element]) for element, table in tables.items()]
    times += [table[:, 0] for table in tables.values()]
    joined = np.unique(np.concatenate(times))
    values = np.tile([shape["weight"] for shape in shapes], (len(joined), 1))
    effective = {
        element: target_weights(np.interp(joined, table[:, 0], table[:, 1]), targets[element])
        for element, table in tables.items()
    }
    for row, shape in enumerate(shapes):
        if shape["element"] in effective:
            values[:, row] = effective[shape["element"]][:, shape["place"]]
    return joined, values


def target_weights(weights: Floats, targets: list[float]) -> Floats:
    """Return the weights of the targets of a blend channel.

    The channel interpolates between the two targets around its weight, and between the mesh
    itself, at 0, and the first target. Beyond the last target, it extrapolates.

    Parameters
    ----------
    weights : (N,)
        Weights of the channel.
    targets : list of K float
        Weights of the channel at which a target is fully on.

    Returns
    -------
    (N, K)
        Weights of the targets.

    >>> target_weights(np.array([0.25, 0.75, 1.25]), [0.5, 1.0]).tolist()
    [[0.5, 0.0], [0.5, 0.5], [-0.5, 1.5]]
    """
    stops = np.unique([0.0, *targets])
    if len(stops) < 2:
        return np.zeros((len(weights), len(targets)))
    low = np.clip(np.searchsorted(stops, weights, side="right") - 1, 0, len(stops) - 2)
    fractions = (weights - stops[low]) / (stops[low + 1] - stops[low])
    found = np.zeros((len(weights), len(stops)))
    rows = np.arange(len(weights))
    found[rows, low], found[rows, low + 1] = 1.0 - fractions, fractions
    # The mesh itself needs no weight.
    found[:, np.searchsorted(stops, 0.0)] = 0.0
    return found[:, np.searchsorted(stops, targets)]


def _crossings(table: Floats, targets: list[float]) -> Floats:
    """Return the times at which the weight of a channel passes 0 or one of its targets."""
    times, weights = table.T
    found = [np.zeros(0)]
    for stop in {0.0, *targets} if len(targets) > 1 or min(targets) < 0.0 else ():
        above, below = weights[:-1] - stop, weights[1:] - stop
        passed = above * below < 0.0
        fractions = above[passed] / (above[passed] - below[passed])
        found.append(times[:-1][passed] + fractions * np.diff(times)[passed])
    return np.concatenate(found)
