"""Child process that reads an ``.fbx`` with ufbx and writes its contents to standard output.

``python -m viewer.formats.fbx.worker FILE`` returns everything except the keys; with the number of
an animation stack after the file, it returns the keys of that stack. It writes an ``.npz``: arrays,
and JSON under ``"json"``. Only some uses of ufbx's binding are safe: see ``_Scene``.

ufbx bakes the curves of a stack, with their pivots and layers, at the file's frame rate and at
their keys. Three things are added: samples before the first and after the last key of curves that
continue there, samples at frames that ufbx leaves out beside keys between frames, and samples
within frames in which a joint rotates so far that the shorter arc between two samples would be the
wrong way round. So the motion is exact at the frames of the file.
"""

from __future__ import annotations

import gc
import os
import sys
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.formats.fbx.message import Arrays, packed
from viewer.rigs.file_record import Json

_METRES = (1.0, 0.01, 0.001, 0.0254)  # metres per unit, for the units that figures can have
_LIGHT = 1e-6  # relative rounding error of a unit stated by an exporter
_METHODS = ("lbs", "lbs", "dqs", "mix")  # method of each value of ufbx.SkinningMethod

# Elements without equivalent, by the list of the scene that contains them.
_UNUSED = {
    "lights": "light",
    "nurbs_curves": "NURBS curve",
    "nurbs_surfaces": "NURBS surface",
    "line_curves": "line",
    "cache_deformers": "cache deformer",
    "constraints": "constraint",
}
_PHYSICAL = range(3, 11)  # values of ufbx.ShaderType from OSL standard surface to ShaderFX graph

# Sampling of the keys.
_PATHS = ("translation", "rotation", "scale")
_STANDARD_RATE = 30.0  # frames per second of files that state none
_RATES = (1.0, 1000.0)  # frame rates that files use
_MILLISECONDS = 12  # value of ufbx.TimeMode of files that count milliseconds, not frames
_ON_FRAME = 1e-3  # tolerance in frames
_JUMP = 1e-6  # time between the two samples on either side of a jump, seconds
_LARGEST_ARC = 45.0  # maximum rotation between two samples, degrees
_MOST_FRAMES = 20_000  # maximum number of frames for which a curve is continued
_LONGEST = 1_000_000  # maximum number of frames between two keys
_MOST_PIECES = 64  # maximum number of samples for each interval between two others
_Times = NDArray[np.float64]


def main(arguments: list[str]) -> None:
    """Read a file, write the message, and exit without cleaning up."""
    _limit_memory()
    gc.disable()
    import ufbx

    scene = None  # held until the process exits, since the destructors of the binding crash
    try:
        scene = _Scene(ufbx, arguments[0])
        arrays, told = scene.message(arguments[1:])
    except ufbx.UfbxError as problem:
        arrays, told = {}, {"error": str(problem)}
    sys.stdout.buffer.write(packed(arrays, told))
    sys.stdout.buffer.flush()
    # The destructors of the binding crash on some files.
    os._exit(0)


def _limit_memory() -> None:
    """Limit the memory of this process, so that a hostile file cannot exhaust the machine."""
    limit = int(os.environ.get("VIEWER_FBX_MEMORY", "0"))
    if limit and find_spec("resource") is not None:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


class _Scene:
    """A scene of ufbx.

    Objects of the binding hold no references to their parents, so all objects are held until the
    process ends. Iterating over a list of the binding runs past its end, so lists are indexed.
    """

    def __init__(self, ufbx: Any, path: str) -> None:
        self.ufbx, self.held, self.arrays = ufbx, list[Any](), Arrays({})
        self.scene = self.keep(ufbx.load_file(path, **self._options(None)))
        wanted = self._conversion()
        if wanted:
            self.scene = self.keep(ufbx.load_file(path, **self._options(wanted)))
        self.converted = sorted(wanted)

    def keep(self, value: Any) -> Any:
        """Return a value, and hold it until the process ends."""
        self.held.append(value)
        return value

    def get(self, item: Any, *names: str) -> Any:
        """Return an attribute, which may be nested; all intermediate objects are held."""
        for name in names:
            item = self.keep(getattr(item, name))
        return item

    def items(self, item: Any, *names: str) -> list[Any]:
        """Return the objects of a list attribute; all are held."""
        found = self.get(item, *names)
        return [self.keep(found[index]) for index in range(len(found))]

    def _options(self, wanted: Json | None) -> Json:
        # Nodes that do not inherit their parent's scale get a helper node, which is exact.
        helpers = self.ufbx.InheritModeHandling.HELPER_NODES
        return {
            "inherit_mode_handling": helpers,
            "generate_missing_normals": True,
            "load_external_files": False,
            "clean_skin_weights": True,
            **(wanted or {}),
        }

    def _conversion(self) -> Json:
        """Return options for the conversion of axes or units that a figure cannot have."""
        settings, wanted = self.get(self.scene, "settings"), {}
        right, up, front = (int(axis) for axis in self.get(settings, "axes"))
        # Axes of ufbx are +x, -x, +y and so on.
        vectors = [
            np.eye(3)[axis % 6 // 2] * (1.0 if axis % 2 == 0 else -1.0)
            for axis in (right, up, front)
        ]
        is_known = max(right, up, front) < 6
        is_right_handed = is_known and np.allclose(np.cross(vectors[0], vectors[1]), vectors[2])
        if is_known and not (is_right_handed and up in (2, 4)):
            wanted["target_axes"] = self.ufbx.axes_right_handed_y_up
        unit = float(settings.unit_meters)
        if not any(abs(unit - known) <= _LIGHT * known for known in _METRES):
            wanted["target_unit_meters"] = 1.0
        if wanted:
            wanted["space_conversion"] = self.ufbx.SpaceConversion.ADJUST_TRANSFORMS
        return wanted

    def message(self, stack: list[str]) -> tuple[Arrays, Json]:
        """Return everything except the keys, or the keys of one stack."""
        if stack:
            sampled = _Sampled(self, self.items(self.scene, "anim_stacks")[int(stack[0])])
            return self.arrays, sampled.result()
        return self.arrays, _contents_of(self)


def _contents_of(kept: _Scene) -> Json:
    """Return the JSON, after adding its arrays to the scene's."""
    scene = kept.scene
    settings, metadata = kept.get(scene, "settings"), kept.get(scene, "metadata")
    nodes = kept.items(scene, "nodes")
    _add_nodes(kept, nodes)
    is_metres = "target_unit_meters" in kept.converted
    is_y_up = "target_axes" in kept.converted or int(kept.get(settings, "axes")[1]) != 4
    warnings = kept.items(metadata, "warnings")
    return {
        "rate": _stated_rate(kept),
        "names": [str(kept.get(node, "name")) for node in nodes],
        "unit": 1.0 if is_metres else float(settings.unit_meters),
        "up": "y" if is_y_up else "z",
        "converted": kept.converted,
        "version": int(metadata.version),
        "creator": str(kept.get(metadata, "creator")),
        "warnings": [str(kept.get(each, "description")) for each in warnings],
        "unused": {
            word: len(kept.get(scene, name))
            for name, word in _UNUSED.items()
            if len(kept.get(scene, name))
        },
        "meshes": [_mesh(kept, at, mesh) for at, mesh in enumerate(kept.items(scene, "meshes"))],
        "materials": [_material(kept, each) for each in kept.items(scene, "materials")],
        "textures": [
            _texture(kept, at, each) for at, each in enumerate(kept.items(scene, "textures"))
        ],
        "cameras": [_camera(kept, each) for each in kept.items(scene, "cameras")],
        "stacks": [
            {
                "name": str(kept.get(stack, "name")),
                "start": float(stack.time_begin),
                "end": float(stack.time_end),
                "nodes": _moved(kept, stack, nodes),
            }
            for stack in kept.items(scene, "anim_stacks")
        ],
    }


def _stated_rate(kept: _Scene) -> float | None:
    """Return the frames per second that the file states; None if it states no usable rate."""
    settings = kept.get(kept.scene, "settings")
    rate = float(settings.frames_per_second)
    is_usable = _RATES[0] <= rate <= _RATES[1] and int(settings.time_mode) != _MILLISECONDS
    return rate if is_usable else None


def _moved(kept: _Scene, stack: Any, nodes: list[Any]) -> list[int]:
    """Return the nodes that a stack moves, or whose blend shapes it changes."""
    elements = {
        int(kept.get(each, "element").element_id)
        for layer in kept.items(stack, "layers")
        for each in kept.items(layer, "anim_props")
    }
    found: set[int] = set()
    for index, node in enumerate(nodes):
        owners = [node]
        if node.is_scale_helper or node.is_scale_compensate_parent:
            owners.append(kept.get(node, "parent"))
        mesh = kept.get(node, "mesh")
        if mesh is not None and len(kept.get(mesh, "blend_deformers")):
            deformers = kept.items(mesh, "blend_deformers")
            owners += [mesh, *(each for one in deformers for each in kept.items(one, "channels"))]
        if any(each is not None and int(each.element_id) in elements for each in owners):
            found.add(index)
    return sorted(found)


def _add_nodes(kept: _Scene, nodes: list[Any]) -> None:
    count = len(nodes)
    parents = np.full(count, -1, dtype=np.int32)
    local = np.zeros((count, 10))
    geometry = np.zeros((count, 4, 4))
    for index, node in enumerate(nodes):
        for child in kept.items(node, "children"):
            parents[child.typed_id] = index
        transform = kept.get(node, "local_transform")
        parts = (kept.get(transform, name) for name in ("translation", "rotation", "scale"))
        local[index] = [float(number) for part in parts for number in part]
        geometry[index] = _matrix(kept.get(node, "geometry_to_node"))
    kept.arrays |= {"parents": parents, "local": local, "geometry": geometry}


def _matrix(matrix: Any) -> NDArray[np.float64]:
    """Return an affine matrix of ufbx, which stores four columns: (4, 4)."""
    result = np.eye(4)
    result[:3] = np.array([list(column) for column in matrix]).T
    return result


def _integers(values: Any) -> NDArray[np.int32]:
    """Return a list of integers, which the binding does not expose as a buffer."""
    return np.array([values[index] for index in range(len(values))], dtype=np.int64).astype("i4")


def _numbers(values: Any, width: int) -> NDArray[np.float64]:
    """Return a copy of a list of numbers or vectors: (N, width)."""
    return np.array(memoryview(values), dtype=np.float64).reshape(-1, width)


def _mesh(kept: _Scene, at: int, mesh: Any) -> Json:
    def put(name: str, values: NDArray[Any]) -> None:
        kept.arrays[f"mesh{at}.{name}"] = values

    put("vertices", _numbers(kept.get(mesh, "vertices"), 3))
    faces = np.array(memoryview(kept.get(mesh, "faces")), dtype=np.int64).reshape(-1, 2)
    put("faces", faces)
    put("corners", _integers(kept.get(mesh, "vertex_indices")))
    put("face_materials", _integers(kept.get(mesh, "face_material")))
    attributes = [("normals", kept.get(mesh, "vertex_normal"), 3)]
    uv_sets, colors = kept.items(mesh, "uv_sets"), kept.items(mesh, "color_sets")
    attributes += [
        (f"uvs{row}", kept.get(each, "vertex_uv"), 2) for row, each in enumerate(uv_sets)
    ]
    attributes += [("colors", kept.get(each, "vertex_color"), 4) for each in colors[:1]]
    for name, attribute, width in attributes:
        if kept.get(attribute, "exists"):
            put(name, _numbers(kept.get(attribute, "values"), width))
            put(f"{name}.corners", _integers(kept.get(attribute, "indices")))
    instances = kept.items(mesh, "instances")
    skins, shapes = kept.items(mesh, "skin_deformers"), _shapes(kept, mesh, put)
    return {
        "name": str(kept.get(mesh, "name")),
        "nodes": [int(node.typed_id) for node in instances],
        # A mesh lists the materials of its first node; each node has its own list.
        "materials": [
            [int(material.typed_id) for material in kept.items(node, "materials")]
            for node in instances
        ],
        "uv_sets": [str(kept.get(each, "name")) for each in uv_sets],
        "color_sets": len(colors),
        "skin": _skin(kept, skins[0], put) if skins else None,
        "n_skins": len(skins),
        "shapes": shapes,
    }


def _skin(kept: _Scene, skin: Any, put: Any) -> Json:
    clusters = kept.items(skin, "clusters")
    bones, matrices, vertices, weights = [], [], [], []
    for cluster in clusters:
        bone = kept.get(cluster, "bone_node")
        bones.append(-1 if bone is None else int(bone.typed_id))
        matrices.append(_matrix(kept.get(cluster, "geometry_to_bone")))
        vertices.append(_integers(kept.get(cluster, "vertices")))
        weights.append(_numbers(kept.get(cluster, "weights"), 1)[:, 0])
    put("skin.matrices", np.array(matrices).reshape(-1, 4, 4))
    put("skin.bones", np.array(bones, dtype=np.int32))
    put("skin.counts", np.array([len(each) for each in vertices], dtype=np.int64))
    put("skin.vertices", np.concatenate([*vertices, np.zeros(0, np.int32)]))
    put("skin.weights", np.concatenate([*weights, np.zeros(0)]))
    put("skin.blend", _numbers(kept.get(skin, "dq_weights"), 1)[:, 0])
    put("skin.blend.vertices", _integers(kept.get(skin, "dq_vertices")))
    return {
        "name": str(kept.get(skin, "name")),
        "method": _METHODS[int(kept.get(skin, "skinning_method"))],
    }


def _shapes(kept: _Scene, mesh: Any, put: Any) -> list[Json]:
    """Return every target of the blend channels: the last of each channel, and in-between ones."""
    told: list[Json] = []
    for deformer in kept.items(mesh, "blend_deformers"):
        for channel in kept.items(deformer, "channels"):
            targets = kept.items(channel, "keyframes")
            stops = [float(target.target_weight) for target in targets]
            for place, target in enumerate(targets):
                row, shape = len(told), kept.get(target, "shape")
                name = str(kept.get(channel, "name")) or str(kept.get(shape, "name"))
                offsets = _numbers(kept.get(shape, "position_offsets"), 3)
                normals = _numbers(kept.get(shape, "normal_offsets"), 3)
                # Blender writes a weight for each vertex.
                weights = _numbers(kept.get(shape, "offset_weights"), 1)
                if len(weights) == len(offsets):
                    offsets = offsets * weights
                    normals = normals * weights if len(normals) == len(weights) else normals
                put(f"shape{row}.vertices", _integers(kept.get(shape, "offset_vertices")))
                put(f"shape{row}.offsets", offsets)
                put(f"shape{row}.normals", normals)
                told.append(
                    {
                        "name": name if target is targets[-1] else f"{name} {stops[place]:.0%}",
                        "element": int(channel.element_id),
                        "weight": float(target.effective_weight),
                        "targets": stops,
                        "place": place,
                    }
                )
    return told


def _camera(kept: _Scene, camera: Any) -> Json:
    is_parallel = int(kept.get(camera, "projection_mode")) == 1
    angle, height = kept.get(camera, "field_of_view_deg").y, kept.get(camera, "orthographic_size").y
    return {
        "name": str(kept.get(camera, "name")),
        "nodes": [int(node.typed_id) for node in kept.items(camera, "instances")],
        "angle": None if is_parallel else float(angle),
        "aspect": float(camera.aspect_ratio),
        "height": float(height) if is_parallel else 0.0,
        "near": float(camera.near_plane),
        "far": float(camera.far_plane),
    }


def _material(kept: _Scene, material: Any) -> Json:
    maps = kept.get(material, "pbr")
    told: Json = {
        "name": str(kept.get(material, "name")),
        "is_physical": int(kept.get(material, "shader_type")) in _PHYSICAL,
    }
    for name in (
        *("base_factor", "base_color", "roughness", "metalness", "emission_factor"),
        *("emission_color", "opacity", "normal_map", "ambient_occlusion"),
    ):
        each = kept.get(maps, name)
        texture = kept.get(each, "texture")
        value = kept.get(each, "value_vec4")
        told[name] = {
            "value": [float(number) for number in value] if kept.get(each, "has_value") else None,
            "texture": None if texture is None else int(texture.typed_id),
        }
    return told


def _texture(kept: _Scene, at: int, texture: Any) -> Json:
    content = kept.get(texture, "content")
    video = kept.get(texture, "video")
    if not content and video is not None:
        content = kept.get(video, "content")
    kept.arrays[f"texture{at}"] = np.frombuffer(content or b"", dtype=np.uint8)
    return {
        "names": [
            str(kept.get(texture, name))
            for name in ("relative_filename", "filename", "absolute_filename")
        ],
        "uv_set": str(kept.get(texture, "uv_set")),
        "wrap": ["clamp" if int(kept.get(texture, f"wrap_{a}")) else "repeat" for a in "uv"],
        "transform": _matrix(kept.get(texture, "uv_to_texture")).tolist(),
    }


class _Sampled:
    """The curves of a stack, and their samples."""

    def __init__(self, kept: _Scene, stack: Any) -> None:
        self.kept, self.animation = kept, kept.get(stack, "anim")
        self.start, self.end = float(stack.time_begin), float(stack.time_end)
        self.rate = _stated_rate(kept) or _STANDARD_RATE
        self.told: list[Json] = []
        self.cut = 0
        # The animated properties of each element: their names and values.
        self.animated: dict[int, list[tuple[str, Any]]] = {}
        for layer in kept.items(self.animation, "layers"):
            for each in kept.items(layer, "anim_props"):
                row = str(kept.get(each, "prop_name")), kept.get(each, "anim_value")
                element = int(kept.get(each, "element").element_id)
                self.animated.setdefault(element, []).append(row)

    def result(self) -> Json:
        """Return the channels, ``"keys"``, and the number of curves that end early, ``"cut"``."""
        # A channel states its node or element, its path, and the name of its array: times in
        # seconds and values, for linear interpolation, or slerp for rotations. The times of the
        # file's own keys follow in an array of their own, if there are others.
        self._add_nodes()
        self._add_weights()
        return {"keys": self.told, "cut": self.cut}

    def _add_nodes(self) -> None:
        """Add the channels of nodes: their baked keys, and their transforms at further times."""
        kept = self.kept
        baked = kept.keep(
            kept.ufbx.bake_anim(
                kept.scene,
                self.animation,
                resample_rate=self.rate,
                minimum_sample_rate=self.rate,
                maximum_sample_rate=max(self.rate, 240.0),
                step_handling=kept.ufbx.BakeStepHandling.ADJACENT_DOUBLE,
                max_keyframe_segments=1024,
            )
        )
        nodes, of_file = kept.items(kept.scene, "nodes"), int(kept.ufbx.BakedKeyFlags.KEYFRAME)
        for moved in kept.items(baked, "nodes"):
            node = nodes[int(moved.typed_id)]
            values = self._values(node)
            further = self._further([value for _, value in values])
            for path in _PATHS:
                keys = kept.get(moved, f"{path}_keys")
                every = [keys[at] for at in range(len(keys))]
                rows = [(key.time, *key.value) for key in every]
                table = np.array(rows, dtype=np.float64).reshape(len(rows), -1)
                own = np.array([key.time for key in every if int(key.flags) & of_file])
                extra = np.union1d(further, self._skipped(table[:, 0]))
                if path == "rotation":
                    turns = [value for name, value in values if name == "Lcl Rotation"]
                    extra = np.union1d(extra, self._turning(turns, table[:, 0], extra))
                extra = np.setdiff1d(extra, table[:, 0])
                if len(extra):
                    more = []
                    for time in extra.tolist():
                        transform = kept.ufbx.evaluate_transform(self.animation, node, time)
                        more.append((time, *getattr(transform, path)))
                    table = np.concatenate([table.reshape(-1, len(more[0])), np.array(more)])
                    table = table[np.argsort(table[:, 0], kind="stable")]
                self._put({"node": int(moved.typed_id), "path": path}, table, own)

    def _values(self, node: Any) -> list[tuple[str, Any]]:
        """Return the animated properties that move a node; helper nodes follow their parents."""
        found = [*self.animated.get(int(node.element_id), [])]
        if node.is_scale_helper or node.is_scale_compensate_parent:
            above = self.kept.get(node, "parent")
            found += self.animated.get(int(above.element_id), []) if above is not None else []
        return found

    def _put(self, channel: Json, table: NDArray[np.float64], own: _Times) -> None:
        """Add a channel and the times of its own keys; if it is constant, only the first key."""
        if not len(table):
            return
        is_constant = not (table[:, 1:] != table[0, 1:]).any()
        name = f"keys{len(self.told)}"
        self.kept.arrays[name] = table[: 1 if is_constant else None]
        if not is_constant and len(own) < len(table):
            self.kept.arrays[f"{name}.own"] = own
        self.told.append({**channel, "keys": name})

    def _add_weights(self) -> None:
        """Add the weights of blend channels; before version 7, curves are those of the mesh."""
        kept = self.kept
        for mesh in kept.items(kept.scene, "meshes"):
            owners = [mesh, *kept.items(mesh, "instances")]
            above = [row for each in owners for row in self.animated.get(int(each.element_id), [])]
            for deformer in kept.items(mesh, "blend_deformers"):
                for channel in kept.items(deformer, "channels"):
                    name = str(kept.get(channel, "name"))
                    own = self.animated.get(int(channel.element_id), [])
                    own = [value for called, value in own if called == "DeformPercent"]
                    own += [value for called, value in above if called == name]
                    if own:
                        self._add_weight(channel, own)

    def _add_weight(self, channel: Any, values: list[Any]) -> None:
        own = self._key_times(values)
        times = np.union1d(own, self._further(values))
        for low, high in self._curved(values):
            times = np.union1d(times, self._frames(low, high))
        weight = self.kept.ufbx.evaluate_blend_weight
        rows = [(time, weight(self.animation, channel, time)) for time in times.tolist()]
        table = np.array(rows, dtype=np.float64).reshape(-1, 2)
        self._put({"element": int(channel.element_id), "path": "weight"}, table, own)

    def _curves(self, values: list[Any]) -> list[Any]:
        """Return the curves with keys of some animated properties."""
        curves = [curve for value in values for curve in self.kept.get(value, "curves")]
        found = [self.kept.keep(curve) for curve in curves if curve is not None]
        return [curve for curve in found if len(self.kept.get(curve, "keyframes"))]

    def _key_times(self, values: list[Any]) -> _Times:
        """Return the times of all keys."""
        times = [self._times_of(curve) for curve in self._curves(values)]
        return np.unique(np.concatenate([np.zeros(0), *times]))

    def _times_of(self, curve: Any) -> _Times:
        """Return the times of a curve's keys."""
        keys = self.kept.get(curve, "keyframes")
        return np.array([keys[at].time for at in range(len(keys))])

    def _beside_steps(self, values: list[Any]) -> _Times:
        """Return the times just before or after a key at which a curve steps."""
        steps, found = self.kept.ufbx.Interpolation, np.zeros(0)
        for curve in self._curves(values):
            keys = self.kept.get(curve, "keyframes")
            kinds = np.array([int(keys[at].interpolation) for at in range(len(keys) - 1)])
            times = self._times_of(curve)
            ends = times[1:][kinds == int(steps.CONSTANT_PREV)] - _JUMP
            starts = times[:-1][kinds == int(steps.CONSTANT_NEXT)] + _JUMP
            found = np.concatenate([found, ends, starts])
        return np.unique(found)

    def _curved(self, values: list[Any]) -> list[tuple[float, float]]:
        """Return the intervals between keys that are not straight lines."""
        curves, cubic = self._curves(values), self.kept.ufbx.Interpolation.CUBIC
        if len(values) > 1:
            # Layers multiply each other's curves.
            return [(float(curve.min_time), float(curve.max_time)) for curve in curves]
        found = []
        for curve in curves:
            keys = self.kept.get(curve, "keyframes")
            found += [
                (keys[at].time, keys[at + 1].time)
                for at in range(len(keys) - 1)
                if keys[at].interpolation == cubic
            ]
        return found

    def _frames(self, start: float, end: float) -> _Times:
        """Return the times of the frames in a range, and its ends."""
        if not 0.0 < (end - start) * self.rate <= _LONGEST:
            return np.array([start, end]) if end >= start else np.zeros(0)
        frames = np.arange(np.ceil(start * self.rate), np.floor(end * self.rate) + 1) / self.rate
        return np.unique([start, *frames, end])

    def _skipped(self, baked: _Times) -> _Times:
        """Return the frames that ufbx leaves out, next to keys between frames."""
        frames = self._frames(baked[0], baked[-1])[1:-1] if len(baked) else baked
        after = np.searchsorted(baked, frames)
        gaps = (baked[after] - baked[after - 1]) * self.rate
        # Longer gaps are constant, or straight lines.
        is_skipped = (gaps > 1.0 + _ON_FRAME) & (gaps < 2.0 - _ON_FRAME)
        return frames[is_skipped]

    def _further(self, values: list[Any]) -> _Times:
        """Return times that ufbx leaves out: beside steps, and where curves are extrapolated."""
        found = self._beside_steps(values)
        constant = self.kept.ufbx.ExtrapolationMode.CONSTANT
        for curve in self._curves(values):
            first, last = float(curve.min_time), float(curve.max_time)
            for side, low, high in (
                ("pre_extrapolation", self.start, first),
                ("post_extrapolation", last, self.end),
            ):
                if self.kept.get(curve, side).mode == constant or not high > low:
                    continue
                if (high - low) * self.rate > _MOST_FRAMES:
                    self.cut += 1
                    reach = _MOST_FRAMES / self.rate
                    low, high = (low, low + reach) if low == last else (high - reach, high)
                times = np.union1d(self._frames(low, high), self._repeated(curve, low, high))
                found = np.union1d(found, times[(times >= low) & (times <= high)])
        return found

    def _repeated(self, curve: Any, low: float, high: float) -> _Times:
        """Return the times of a curve's keys in all its repetitions, on either side of jumps."""
        keys = self._times_of(curve)
        period = keys[-1] - keys[0]
        count = (high - low) / period if period > 0.0 else np.inf
        if not count * len(keys) <= _MOST_FRAMES:
            return np.zeros(0)
        cycles = np.arange(np.floor((low - keys[0]) / period), (high - keys[0]) / period + 1)
        offsets = np.union1d(keys - keys[0], keys[-1] - keys)
        times = (keys[0] + cycles[:, None] * period + offsets).ravel()
        return np.unique(times[:, None] + np.array([-_JUMP, 0.0, _JUMP]))

    def _turning(self, values: list[Any], baked: _Times, further: _Times) -> _Times:
        """Return times that divide the intervals in which the angles change too much."""
        spans = [curve.max_value - curve.min_value for curve in self._curves(values)]
        if not values or (sum(spans) <= _LARGEST_ARC and not len(further)):
            return np.zeros(0)
        times = np.unique(np.concatenate([baked, further, self._key_times(values)]))
        evaluate = self.kept.ufbx.evaluate_anim_value_vec3
        arcs = np.zeros(max(len(times) - 1, 0))
        for value in values:
            angles = np.array([tuple(evaluate(value, time)) for time in times.tolist()])
            arcs += np.abs(np.diff(angles, axis=0)).sum(axis=1)
        arcs[np.diff(times) <= 2.5 * _JUMP] = 0.0
        counts = np.clip(np.ceil(arcs / _LARGEST_ARC), 1.0, _MOST_PIECES)
        found = [
            np.linspace(times[row], times[row + 1], int(counts[row]) + 1)
            for row in np.flatnonzero(counts > 1.0).tolist()
        ]
        return np.concatenate([np.zeros(0), *found])


if __name__ == "__main__":
    main(sys.argv[1:])
