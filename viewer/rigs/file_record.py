"""Properties of a figure that only its file format uses, stored to be written back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Any, TypeAlias

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Floats, Ints

Json: TypeAlias = dict[str, Any]
"""A JSON object that was parsed, or will be written."""

GENERATOR = "viewer"
"""Name by which glTF files state that this program wrote them."""


@dataclass(frozen=True, slots=True, eq=False)
class StoredImage:
    """An encoded image."""

    name: str
    """Name in the file; may be empty."""
    data: bytes
    """The encoded image."""


@dataclass(frozen=True, slots=True, eq=False)
class StoredTextures:
    """Textures of a glTF file in its own lists."""

    textures: tuple[Any, ...]
    samplers: tuple[Any, ...]
    """As parsed from JSON."""
    image: Callable[[int], StoredImage | None]
    """Returns an image by its index; None if it cannot be read."""


@dataclass(frozen=True, slots=True, eq=False)
class VrmRecord:
    """Extensions of a VRM 1.0 file as parsed from JSON, and what their indices refer to."""

    extensions: Mapping[str, Any]
    """Extensions of the root; those of a VRM 0.x file are upgraded."""
    joints: Mapping[int, int]
    parts: Mapping[int, int]
    """Joint, and part of the mesh, of each node that has one."""
    materials: tuple[int, ...]
    """Index in the file of each material of the figure's mesh."""
    toon: Mapping[int, Any]
    """Extensions ``VRMC_materials_mtoon`` and ``KHR_materials_unlit`` of the file's materials, by
    index."""
    textures: StoredTextures | None = None
    """Textures of the file."""
    old_members: tuple[str, ...] | None = None
    """Members of a VRM 0.x file, whose character faces -z, that VRM 1.0 cannot hold; None for a
    VRM 1.0 file."""


@dataclass(frozen=True, slots=True, eq=False)
class FileRecord:
    """Data of a file of nodes other than a figure's shape and motion."""

    copyright: str = ""
    """Copyright notice of the asset; empty if there is none."""
    extras: Any = None
    """Application data of the whole file, as parsed from JSON; None if the file has none."""
    joint_extras: Mapping[int, Any] = field(default_factory=dict)
    part_extras: Mapping[int, Any] = field(default_factory=dict)
    mesh_extras: Mapping[int, Any] = field(default_factory=dict)
    """Application data of joints, of the nodes of parts that are not joints, and of the meshes of
    parts, by the index of the joint or part."""
    mesh_names: tuple[str, ...] = ()
    """Name of the mesh of each part."""
    part_shapes: tuple[Ints, ...] = ()
    """tuple of P (S,) int32. Blend shapes that are the morph targets of each part, in the order of
    its mesh."""
    target_names: tuple[tuple[str, ...], ...] = ()
    """Names of these blend shapes in the file, which may repeat between parts or be empty."""
    scene: Mapping[str, Any] = field(default_factory=dict)
    """Name and application data of the scene, as parsed from JSON."""
    tangents: Callable[[], Floats | None] = lambda: None
    """Returns the tangents of the mesh in binding space, with the sign of the bitangent, (V, 4):
    zeros for vertices without any; None if no vertex has one."""
    unkept: Callable[[], tuple[str, ...]] = tuple
    """Returns the members of the file that are not stored, such as ``images.extras``."""
    lost_nodes: tuple[str, ...] = ()
    """Names of the nodes of the file that are neither joints, meshes nor cameras."""
    vrm: VrmRecord | None = None
    """Properties of a VRM character."""
    has_skin: bool = True
    """Whether the file skins the meshes; otherwise each follows its node."""
    skin_names: tuple[str, ...] = ()
    """Names of the skins of the figure."""
