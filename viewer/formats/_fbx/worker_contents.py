"""Contents of a scene of ufbx, without keys: nodes, meshes, skins, shapes, materials."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from viewer.formats._fbx.message import Arrays

__all__ = ["KeptScene", "contents_of", "integers"]

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


class KeptScene(Protocol):
    """A scene whose objects are held; see ``worker.py``."""

    ufbx: Any
    scene: Any
    arrays: Arrays
    converted: list[str]

    def keep(self, value: Any) -> Any:
        """Hold a value."""

    def get(self, item: Any, *names: str) -> Any:
        """Return an attribute."""

    def items(self, item: Any, *names: str) -> list[Any]:
        """Return the objects of a list attribute."""


def contents_of(kept: KeptScene) -> dict[str, Any]:
    """Return the JSON, after adding its arrays to the scene's."""
    scene = kept.scene
    settings, metadata = kept.get(scene, "settings"), kept.get(scene, "metadata")
    nodes = kept.items(scene, "nodes")
    _add_nodes(kept, nodes)
    is_metres = "target_unit_meters" in kept.converted
    is_y_up = "target_axes" in kept.converted or int(kept.get(settings, "axes")[1]) != 4
    warnings = kept.items(metadata, "warnings")
    return {
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


def _moved(kept: KeptScene, stack: Any, nodes: list[Any]) -> list[int]:
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


def _add_nodes(kept: KeptScene, nodes: list[Any]) -> None:
    count = len(nodes)
    parents = np.full(count, -1, dtype=np.int32)
    local = np.zeros((count, 10))
    geometry = np.zeros((count, 4, 4))
    for index, node in enumerate(nodes):
        for child in kept.items(node, "children"):
            parents[child.typed_id] = index
        local[index] = _transform(kept, kept.get(node, "local_transform"))
        geometry[index] = _matrix(kept.get(node, "geometry_to_node"))
    kept.arrays |= {"parents": parents, "local": local, "geometry": geometry}


def _transform(kept: KeptScene, transform: Any) -> list[float]:
    """Return a translation, a quaternion (x, y, z, w) and a scale: 10 numbers."""
    parts = (kept.get(transform, name) for name in ("translation", "rotation", "scale"))
    return [float(number) for part in parts for number in part]


def _matrix(matrix: Any) -> NDArray[np.float64]:
    """Return an affine matrix of ufbx, which stores four columns: (4, 4)."""
    result = np.eye(4)
    result[:3] = np.array([list(column) for column in matrix]).T
    return result


def integers(values: Any) -> NDArray[np.int32]:
    """Return a list of integers, which the binding does not expose as a buffer."""
    return np.array([values[index] for index in range(len(values))], dtype=np.int64).astype("i4")


def _numbers(values: Any, width: int) -> NDArray[np.float64]:
    """Return a copy of a list of numbers or vectors: (N, width)."""
    return np.array(memoryview(values), dtype=np.float64).reshape(-1, width)


def _mesh(kept: KeptScene, at: int, mesh: Any) -> dict[str, Any]:
    def put(name: str, values: NDArray[Any]) -> None:
        kept.arrays[f"mesh{at}.{name}"] = values

    put("vertices", _numbers(kept.get(mesh, "vertices"), 3))
    faces = np.array(memoryview(kept.get(mesh, "faces")), dtype=np.int64).reshape(-1, 2)
    put("faces", faces)
    put("corners", integers(kept.get(mesh, "vertex_indices")))
    put("face_materials", integers(kept.get(mesh, "face_material")))
    attributes = [("normals", kept.get(mesh, "vertex_normal"), 3)]
    uv_sets, colors = kept.items(mesh, "uv_sets"), kept.items(mesh, "color_sets")
    attributes += [
        (f"uvs{row}", kept.get(each, "vertex_uv"), 2) for row, each in enumerate(uv_sets)
    ]
    attributes += [("colors", kept.get(each, "vertex_color"), 4) for each in colors[:1]]
    for name, attribute, width in attributes:
        if kept.get(attribute, "exists"):
            put(name, _numbers(kept.get(attribute, "values"), width))
            put(f"{name}.corners", integers(kept.get(attribute, "indices")))
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


def _skin(kept: KeptScene, skin: Any, put: Any) -> dict[str, Any]:
    clusters = kept.items(skin, "clusters")
    bones, matrices, vertices, weights = [], [], [], []
    for cluster in clusters:
        bone = kept.get(cluster, "bone_node")
        bones.append(-1 if bone is None else int(bone.typed_id))
        matrices.append(_matrix(kept.get(cluster, "geometry_to_bone")))
        vertices.append(integers(kept.get(cluster, "vertices")))
        weights.append(_numbers(kept.get(cluster, "weights"), 1)[:, 0])
    put("skin.matrices", np.array(matrices).reshape(-1, 4, 4))
    put("skin.bones", np.array(bones, dtype=np.int32))
    put("skin.counts", np.array([len(each) for each in vertices], dtype=np.int64))
    put("skin.vertices", np.concatenate([*vertices, np.zeros(0, np.int32)]))
    put("skin.weights", np.concatenate([*weights, np.zeros(0)]))
    put("skin.blend", _numbers(kept.get(skin, "dq_weights"), 1)[:, 0])
    put("skin.blend.vertices", integers(kept.get(skin, "dq_vertices")))
    return {
        "name": str(kept.get(skin, "name")),
        "method": _METHODS[int(kept.get(skin, "skinning_method"))],
    }


def _shapes(kept: KeptScene, mesh: Any, put: Any) -> list[dict[str, Any]]:
    """Return every target of the blend channels: the last of each channel, and in-between ones."""
    told: list[dict[str, Any]] = []
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
                put(f"shape{row}.vertices", integers(kept.get(shape, "offset_vertices")))
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


def _camera(kept: KeptScene, camera: Any) -> dict[str, Any]:
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


def _material(kept: KeptScene, material: Any) -> dict[str, Any]:
    maps = kept.get(material, "pbr")
    told: dict[str, Any] = {
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


def _texture(kept: KeptScene, at: int, texture: Any) -> dict[str, Any]:
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
