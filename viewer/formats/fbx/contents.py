"""Contents of an ``.fbx``: messages of the child process, checked and converted.

The child runs once for everything except the keys, and once more for the keys of each animation
that is played. Its numbers must be finite and within reach, and its indices must exist. A mesh is
repeated for each list of materials and each placement with which nodes show it. Cameras get nodes
of their own, which turn them from +x to -z.
"""

from __future__ import annotations

import math
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path, PurePosixPath

import numpy as np

import viewer
from viewer.diagnostics import Phrase, wording
from viewer.errors import FormatError
from viewer.formats._references import load_image, referenced_path
from viewer.formats._scene_graph.content import (
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
from viewer.formats.fbx.meshes import Placed, mesh_on_node, on_nodes, skin_of
from viewer.formats.fbx.message import Arrays, unpacked
from viewer.media.image import decode_picture
from viewer.media.unfinished import new_prefix
from viewer.phrases import agree, counted, listed, optional, quoted, rounded
from viewer.rigs.arrays import Bytes, Floats, Ints
from viewer.rigs.file_record import Json
from viewer.rigs.material import Material, Texture
from viewer.rigs.units import METRES, UNIT_NAMES

_BINARY = b"Kaydara FBX Binary"  # first bytes of the binary variant
_UNSTRUCTURED = re.compile(rb'"[^"]*"|;[^\n]*')  # strings and comments of the text variant
_STACKED = 7000  # version since which animations are objects instead of a last section, Takes
_CONNECTED = 6000  # version since which objects are connected by a section of their own
_STRAIGHT = 180.0  # limit of a field of view, degrees

# Translation, rotation and scale that turn -z to +x: -90 degrees about y.
_TO_CAMERA = np.array([0.0, 0.0, 0.0, 0.0, -math.sqrt(0.5), 0.0, math.sqrt(0.5), 1.0, 1.0, 1.0])

_LEAST_ALPHA = 255  # minimum alpha of opaque pixels

_WHAT = {
    "vertices": "position",
    "normals": "normal",
    "colors": "colour",
    "matrices": "bind matrix",
    "weights": "weight",
    "blend": "weight",
    "offsets": "offset",
}
"""What a number in an array of a mesh is, by the array's name."""

# Limits of the child process.
_SECONDS = 60.0  # time limit for the smallest files, seconds
_STEP = 1 << 20  # bytes per step, which take about 0.1 s to read
_SECONDS_PER_STEP = 2.0  # seconds added to the time limit for each step
_MEMORY = 4 << 30  # bytes that the child may use for the smallest files
_MEMORY_PER_BYTE = 64  # bytes added for each byte of the file
_WORKER = "viewer.formats.fbx.worker"
_OWN = ".own"  # suffix of the name of an array with the times of the file's own keys


def node_file(source: Source) -> NodeFile:
    """Read a file in a child process; see ``viewer.formats.fbx.read``."""
    arrays, told = _run_worker(source)
    _check_end(source, told["version"])
    _check_arrays(source, arrays, partial(_place, told))
    _check_values(source, told, "")
    # Refuse skins and blend shapes of vertices that their mesh does not have.
    for name, array in arrays.items():
        if not name.endswith(".vertices") or array.dtype == np.float64:
            continue
        last = len(arrays[f"{name.split('.')[0]}.vertices"]) - 1
        wrong = (array < 0) | (array > last)
        if wrong.any():
            place = _place(told, name, int(wrong.argmax()))
            found = float(array[wrong.argmax()])
            raise source.fault(wording.VERTEX_RANGE, item=place, last=last, found=found)
    _say_unused(source, told)
    n_joints = len(told["names"])
    cameras, of_camera = _add_cameras(told, arrays)
    meshes: list[NodeMesh] = []
    skins: list[NodeSkin] = []
    of_node, skin_of_node = np.full((2, len(told["names"])), -1, dtype=np.int32)
    first_mesh: dict[tuple[int, tuple[int, ...], bytes], int] = {}
    for at, mesh in enumerate(told["meshes"]):
        prefix = f"mesh{at}"
        _say_reduced(source, mesh)
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
    parents, local = arrays["parents"], arrays["local"]
    # The root has no name in the file; this is its name in the FBX SDK.
    named = (
        name or ("RootNode" if parent < 0 else "")
        for name, parent in zip(told["names"], parents.tolist(), strict=True)
    )
    tree = NodeTree(
        tuple(named),
        parents,
        translations=local[:, :3],
        rotations=local[:, 3:7],
        scales=local[:, 7:],
        meshes=of_node,
        skins=skin_of_node,
        cameras=of_camera,
    )
    return NodeFile(
        source.path.stem,
        tree,
        roots=tuple(np.flatnonzero(parents < 0).tolist()),
        meshes=tuple(meshes),
        skins=tuple(skins),
        materials=materials_of(source, arrays, told),
        cameras=cameras,
        animations=_animations(source, told),
        up=told["up"],
        unit=min(METRES, key=lambda name: abs(np.log(METRES[name] / told["unit"]))),
        # Unanimated joints of a skeleton, such as its ends, stay joints.
        named_nodes=frozenset(range(n_joints) if told["stacks"] else ()),
        asset={"generator": told["creator"], "version": f"{told['version'] / 1000:g}"},
    )


def _run_worker(source: Source, *arguments: str) -> tuple[Arrays, Json]:
    """Run the worker on a file, and return its message."""
    if find_spec("ufbx") is None:
        raise source.fault(
            "F001.fbx-extra: reading .fbx files needs ufbx, which is not installed: pip "
            "install ufbx"
        )
    if source.is_piped:
        # The library reads files, in any order.
        prefix = new_prefix(tempfile.gettempdir(), "viewer-fbx")
        with tempfile.TemporaryDirectory(prefix=prefix) as folder:
            path = Path(folder, "piped.fbx")
            path.write_bytes(source.data)
            return _run(source, path, arguments)
    return _run(source, source.path.resolve(), arguments)


def _run(source: Source, path: Path, arguments: Sequence[str]) -> tuple[Arrays, Json]:
    size = path.stat().st_size
    seconds = _SECONDS + _SECONDS_PER_STEP * (size / _STEP)
    command = [sys.executable, "-m", _WORKER, str(path), *arguments]
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=seconds,
            env=_environment(_MEMORY + _MEMORY_PER_BYTE * size),
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise source.fault(
            "F001.fbx-slow: reading took more than {seconds:.0f} s and was stopped", seconds=seconds
        ) from None
    message = unpacked(done.stdout) if done.returncode == 0 else None
    if message is None:
        raise source.fault(
            "F001.fbx-crash: the FBX library failed on this file: {how}",
            how=_ending(done.returncode, done.stderr),
        )
    if "error" in message[1]:
        raise source.fault(
            "F002.fbx: not a readable FBX file: {reason}", reason=message[1]["error"]
        )
    return message


def _environment(memory: int) -> dict[str, str]:
    """Return the child's environment, in which it finds this package and uses one thread."""
    package = str(Path(viewer.__file__).resolve().parents[1])
    paths = filter(None, (package, os.environ.get("PYTHONPATH", "")))
    limits = {"VIEWER_FBX_MEMORY": str(memory), "OPENBLAS_NUM_THREADS": "1"}
    return {**os.environ, **limits, "PYTHONPATH": os.pathsep.join(paths)}


def _ending(code: int, errors: bytes) -> Phrase:
    """Return a phrase that describes how a process ended."""
    if code < 0:
        return Phrase("it crashed with signal {number}", number=-code)
    lines = errors.decode(errors="replace").strip().splitlines()
    return Phrase(
        "exit code {code}{error}", code=code, error=optional(": {}", lines[-1] if lines else "")
    )


def _check_end(source: Source, version: int) -> None:
    """Refuse a text file that is cut short, which ufbx reads as if the rest did not exist."""
    if source.peek(len(_BINARY)) == _BINARY:
        return
    bare = _UNSTRUCTURED.sub(b"", source.data)
    depth = bare.count(b"{") - bare.count(b"}")
    if depth > 0:
        raise source.fault(
            "F002.fbx-cut: expected the end of {n}, found the end of the file: it is cut short",
            source.end,
            n=counted(depth, "open section"),
        )
    if version >= _CONNECTED and b"Connections:" not in bare:
        raise source.fault(
            "F002.fbx-connections: expected a section Connections, found the end of the file: "
            "it is cut short",
            source.end,
        )
    if _CONNECTED <= version < _STACKED and b"Takes:" not in bare:
        # The SDK always writes this section, other programs may not, so the file can be whole.
        source.warn(
            "F007.fbx-takes: no section Takes before the end of the file: if it is cut short, "
            "its animations are missing",
            source.end,
        )


def _check_arrays(source: Source, arrays: Arrays, place: Callable[[str, int], Phrase]) -> None:
    """Refuse a message with a number that is not finite or out of reach."""
    for name, array in arrays.items():
        if array.dtype != np.float64:
            continue
        bad = ~(np.abs(array) <= REACH)
        if bad.any():
            row, found = int(np.argwhere(bad)[0][0]), float(array[bad][0])
            kind = wording.TOO_FAR if math.isfinite(found) else wording.NOT_FINITE
            at = place(name, row)
            raise source.fault(f"F003.{kind}", item=at, found=found, limit=rounded(REACH, 2), at="")


def _check_values(source: Source, told: object, path: str) -> None:
    """Refuse such numbers in the JSON of a message."""
    if isinstance(told, float):
        _check_arrays(source, {path: np.array([told])}, lambda name, _: Phrase("{of}", of=name))
    elif isinstance(told, dict):
        name = told.get("name")
        for key, value in told.items():
            _check_values(source, value, " ".join(filter(None, (path, name, key))))
    elif isinstance(told, list):
        for value in told:
            _check_values(source, value, path)


def _place(told: Json, name: str, row: int) -> Phrase:
    """Return where an array of the contents stands in the file."""
    if name in ("local", "geometry"):
        return Phrase("node {node} ({row}): transform", node=quoted(told["names"][row]), row=row)
    owner, *_, what = name.split(".")
    mesh = told["meshes"][int(owner.removeprefix("mesh"))]
    return Phrase(
        "mesh {mesh}: {what} {row}",
        mesh=quoted(mesh["name"]),
        what=Phrase(_WHAT.get(what, "texture coordinate")),
        row=row,
    )


def _place_of_keys(told: Json, track: Json) -> Phrase:
    """Return which property has invalid keys."""
    if track["path"] != "weight":
        name = told["names"][track["node"]]
    else:
        rows = [shape for mesh in told["meshes"] for shape in mesh["shapes"]]
        name = next((r["name"] for r in rows if r["element"] == track["element"]), "")
    return Phrase("keys of {node}: {path}", node=quoted(name), path=track["path"])


def _say_unused(source: Source, told: Json) -> None:
    """Report unused elements of the file, and converted axes or units."""
    if told["unused"]:
        items = [counted(n, word) for word, n in told["unused"].items()]
        source.warn("F007.fbx-unused: not used: {items}", items=listed(items, 12))
    for text in told["warnings"]:
        source.warn("F007.fbx-warning: FBX library: {text}", text=text)
    if told["converted"]:
        names = {"target_axes": "axes", "target_unit_meters": "unit"}
        what = [names[key] for key in told["converted"] if key in names]
        to = [Phrase("y up, right-handed") if name == "axes" else UNIT_NAMES["m"] for name in what]
        source.warn(
            "F007.fbx-converted: unsupported {what} converted to {to}",
            what=listed(what),
            to=listed(to),
        )


def _say_reduced(source: Source, mesh: Json) -> None:
    """Report the properties of a mesh that have no equivalent."""
    if mesh["color_sets"] > 1:
        source.warn(
            "F007.fbx-color-sets: mesh {mesh}: only the first of {n} colour sets is used",
            mesh=quoted(mesh["name"]),
            n=mesh["color_sets"],
        )
    for shape in mesh["shapes"]:
        if shape["place"] == len(shape["targets"]) - 1 > 0:
            source.warn(
                "F007.fbx-in-betweens: blend shape {shape}: {n} {are} of {their} own; animations "
                "set all weights",
                shape=quoted(shape["name"]),
                n=counted(shape["place"], "in-between target"),
                are=agree(shape["place"], "is a blend shape", "are blend shapes"),
                their=agree(shape["place"], "its", "their"),
            )


def _add_cameras(told: Json, arrays: Arrays) -> tuple[tuple[NodeCamera, ...], Ints]:
    """Return the cameras and each node's camera, after adding a node that turns -z to FBX's +x."""
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


def _animations(source: Source, told: Json) -> tuple[NodeAnimation, ...]:
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
            rate=told["rate"],
        )
        for number, stack in enumerate(told["stacks"])
    )


def _channels(
    source: Source, told: Json, meshes: dict[int, int], stack: int
) -> tuple[NodeChannel, ...]:
    """Sample one animation stack in another child process."""
    arrays, keys = _run_worker(source, str(stack))
    tracks = {each["keys"]: each for each in keys["keys"]}
    _check_arrays(
        source, arrays, lambda name, _: _place_of_keys(told, tracks[name.removesuffix(_OWN)])
    )
    if keys["cut"]:
        source.warn(
            "F007.fbx-continued: {n} that {verb} before or after {their} keys {are} held after "
            "20000 frames",
            n=counted(keys["cut"], "curve"),
            verb=agree(keys["cut"], "continues", "continue"),
            their=agree(keys["cut"], "its", "their"),
            are=agree(keys["cut"], "is", "are"),
        )
    channels: list[NodeChannel] = []
    # Weights and times of the file's own keys, by mesh, then by blend channel.
    weights: dict[int, dict[int, tuple[Floats, Floats | None]]] = {}
    for each in keys["keys"]:
        table, own = arrays[each["keys"]], arrays.get(each["keys"] + _OWN)
        if each["path"] == "weight":
            if each["element"] in meshes:
                weights.setdefault(meshes[each["element"]], {})[each["element"]] = table, own
        else:
            values = table[:, 1:]
            channels.append(
                NodeChannel(each["node"], each["path"], table[:, 0], values, key_times=own)
            )
    for at, tables in weights.items():
        mesh = told["meshes"][at]
        times, values = _joined({key: table for key, (table, _) in tables.items()}, mesh["shapes"])
        own = np.unique(
            np.concatenate([table[:, 0] if own is None else own for table, own in tables.values()])
        )
        channels += [
            NodeChannel(node, "weights", times, values, key_times=own) for node in mesh["nodes"]
        ]
    return tuple(channels)


def _joined(tables: dict[int, Floats], shapes: list[Json]) -> tuple[Floats, Floats]:
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

    ``weights``: (N,), weights of the channel. Returns (N, K).

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
        # Between two keys the weight is linear, so it passes the stop at the fraction a / (a - b)
        # of their interval, where a and b are the distances of the keys' weights from it.
        above, below = weights[:-1] - stop, weights[1:] - stop
        passed = above * below < 0.0
        fractions = above[passed] / (above[passed] - below[passed])
        found.append(times[:-1][passed] + fractions * np.diff(times)[passed])
    return np.concatenate(found)


def materials_of(source: Source, arrays: Arrays, told: Json) -> tuple[Material, ...]:
    """Return all materials; pictures are embedded, at stated paths, or near the file."""
    pictures: dict[int, Bytes | None] = {}
    sets: list[str] = next((mesh["uv_sets"] for mesh in told["meshes"] if mesh["uv_sets"]), [])

    def texture(number: int | None) -> Texture | None:
        if number is None:
            return None
        stated = told["textures"][number]
        name = _picture_name(source, stated["names"])
        if number not in pictures:
            pictures[number] = _picture(source, arrays[f"texture{number}"].tobytes(), name)
        matrix = np.array(stated["transform"])
        place = sets.index(stated["uv_set"]) if stated["uv_set"] in sets else 0
        return Texture(
            name,
            pictures[number],
            uv_set=place,
            transform=matrix[:2][:, [0, 1, 3]],
            wrap=tuple(stated["wrap"]),
        )

    return tuple(_material(source, each, texture) for each in told["materials"])


def _material(
    source: Source, told: Json, texture: Callable[[int | None], Texture | None]
) -> Material:
    def number(name: str, default: float) -> float:
        value = told[name]["value"]
        return default if value is None else value[0]

    factor, color = number("base_factor", 1.0), told["base_color"]["value"] or [1.0] * 4
    base = texture(told["base_color"]["texture"])
    shown = [1.0, 1.0, 1.0] if base is not None else color[:3]
    red, green, blue = (min(max(factor * part, 0.0), 1.0) for part in shown[:3])
    opacity = min(max(number("opacity", 1.0), 0.0), 1.0)
    cut = texture(told["opacity"]["texture"])
    if cut is not None and (base is None or cut.name != base.name):
        source.warn(
            "F007.fbx-opacity: material {material}: the opacity texture {texture} is not used, "
            "only the alpha of the colour texture",
            material=quoted(told["name"]),
            texture=quoted(cut.name),
        )
        cut = None
    has_alpha = (
        cut is not None
        and base is not None
        and base.image is not None
        and int(base.image[..., 3].min()) < _LEAST_ALPHA
    )
    # In FBX, a texture replaces the value of its property; in a material, it multiplies the value.
    metallic, roughness = (
        texture(told["metalness"]["texture"]),
        texture(told["roughness"]["texture"]),
    )
    glow = texture(told["emission_color"]["texture"])
    emission = [1.0] * 3 if _is_drawn(glow) else told["emission_color"]["value"] or [0.0] * 3
    strength = number("emission_factor", 1.0)
    red_glow, green_glow, blue_glow = (max(strength * part, 0.0) for part in emission[:3])
    return Material(
        told["name"],
        base_texture=base,
        base_color=(red, green, blue, opacity),
        metallic=1.0 if _is_drawn(metallic) else min(max(number("metalness", 0.0), 0.0), 1.0),
        roughness=1.0 if _is_drawn(roughness) else min(max(number("roughness", 0.6), 0.0), 1.0),
        metallic_texture=metallic,
        roughness_texture=roughness,
        normal_texture=texture(told["normal_map"]["texture"]),
        occlusion_texture=texture(told["ambient_occlusion"]["texture"]),
        emissive=(red_glow, green_glow, blue_glow),
        emissive_texture=glow,
        alpha_mode="blend" if opacity < 1.0 or has_alpha else "opaque",
        is_physical=told["is_physical"],
    )


def _is_drawn(texture: Texture | None) -> bool:
    return texture is not None and texture.image is not None


def _picture_name(source: Source, names: list[str]) -> str:
    """Return the first path at which the picture exists; if there is none, its bare file name."""
    folder = source.path.parent
    stated = [name.replace("\\", "/") for name in names if name]
    bare = PurePosixPath(stated[0]).name if stated else ""
    places = [*stated, bare, f"textures/{bare}", f"{source.path.stem}.fbm/{bare}"]
    for name in filter(None, places):
        path = referenced_path(folder, name)
        if path is not None and path.is_file():
            return name
    return bare


def _picture(source: Source, content: bytes, name: str) -> Bytes | None:
    """Return the pixels of a picture that is embedded in the file or lies below its folder."""
    if not content:
        return load_image(source, name, None) if name else None
    try:
        return decode_picture(source.path, content)
    except FormatError as problem:
        source.warn(wording.TEXTURE, problem=problem.diagnostic)
        return None
