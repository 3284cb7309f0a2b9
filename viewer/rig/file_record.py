"""Properties of a figure that only its file format uses, stored to be written back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Any

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats, Ints


@dataclass(frozen=True, slots=True, eq=False)
class StoredImage:
    """An encoded image.

    Attributes
    ----------
    name : str
        Name in the file; may be empty.
    data : bytes
        The encoded image.
    """

    name: str
    data: bytes


@dataclass(frozen=True, slots=True, eq=False)
class StoredTextures:
    """Textures of a glTF file in its own lists.

    Attributes
    ----------
    textures, samplers : tuple
        As parsed from JSON.
    image : callable
        Returns an image by its index; None if it cannot be read.
    """

    textures: tuple[Any, ...]
    samplers: tuple[Any, ...]
    image: Callable[[int], StoredImage | None]


@dataclass(frozen=True, slots=True, eq=False)
class VrmRecord:
    """Extensions of a VRM file as parsed from JSON, and what their indices refer to.

    Attributes
    ----------
    version : int
        0 for the extension ``VRM``, 1 for ``VRMC_vrm``.
    extensions : mapping
        Extensions of the root.
    joints, parts : mapping of int
        Joint, and part of the mesh, of each node that has one.
    meshes : mapping of int
        Mesh of each node that ``parts`` lists.
    materials : tuple of int
        Index in the file of each material of the figure's mesh.
    toon : mapping
        Extensions ``VRMC_materials_mtoon`` and ``KHR_materials_unlit`` of the file's materials, by
        index.
    textures : StoredTextures or None
        Textures of the file.
    """

    version: int
    extensions: Mapping[str, Any]
    joints: Mapping[int, int]
    parts: Mapping[int, int]
    meshes: Mapping[int, int]
    materials: tuple[int, ...]
    toon: Mapping[int, Any]
    textures: StoredTextures | None = None


@dataclass(frozen=True, slots=True, eq=False)
class FileRecord:
    """Data of a file of nodes other than a figure's shape and motion.

    Attributes
    ----------
    copyright : str
        Copyright notice of the asset; empty if there is none.
    extras : Any
        Application data of the whole file, as parsed from JSON; None if the file has none.
    joint_extras, part_extras, mesh_extras : mapping of int
        Application data of joints, of the nodes of parts that are not joints, and of the meshes of
        parts, by the index of the joint or part.
    mesh_names : tuple of P str
        Name of the mesh of each part.
    part_shapes : tuple of P (S,) int32
        Blend shapes that are the morph targets of each part, in the order of its mesh.
    target_names : tuple of P tuple of str
        Names of these blend shapes in the file, which may repeat between parts or be empty.
    scene : mapping
        Name and application data of the scene, as parsed from JSON.
    tangents : callable
        Returns the tangents of the mesh in binding space, with the sign of the bitangent, (V, 4):
        zeros for vertices without any; None if no vertex has one.
    unkept : callable
        Returns the members of the file that are not stored, such as ``images.extras``.
    lost_nodes : tuple of str
        Names of the nodes of the file that are neither joints, meshes nor cameras.
    vrm : VrmRecord or None
        Properties of a VRM character.
    has_skin : bool
        Whether the file skins the meshes; otherwise each follows its node.
    skin_names : tuple of str
        Names of the skins of the figure.
    """

    copyright: str = ""
    extras: Any = None
    joint_extras: Mapping[int, Any] = field(default_factory=dict)
    part_extras: Mapping[int, Any] = field(default_factory=dict)
    mesh_extras: Mapping[int, Any] = field(default_factory=dict)
    mesh_names: tuple[str, ...] = ()
    part_shapes: tuple[Ints, ...] = ()
    target_names: tuple[tuple[str, ...], ...] = ()
    scene: Mapping[str, Any] = field(default_factory=dict)
    tangents: Callable[[], Floats | None] = lambda: None
    unkept: Callable[[], tuple[str, ...]] = tuple
    lost_nodes: tuple[str, ...] = ()
    vrm: VrmRecord | None = None
    has_skin: bool = True
    skin_names: tuple[str, ...] = ()
