"""Properties of a figure that only its own kind of file uses, kept to be written back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from viewer.rig.arrays import Ints

__all__ = ["FileRecord"]


@dataclass(frozen=True, slots=True, eq=False)
class FileRecord:
    """Data of a file of nodes other than a figure's shape and motion.

    Attributes
    ----------
    copyright : str
        Copyright notice of the asset; empty if there is none.
    extras : Any
        Application data of the whole file, as parsed from JSON; None if there is none.
    joint_extras, part_extras, mesh_extras : mapping of int
        Application data of joints, of the nodes of parts that are not joints, and of the meshes of
        parts, by the index of the joint or part.
    mesh_names : tuple of P str
        Name of the mesh of each part.
    part_shapes : tuple of P (S,) int32
        Blend shapes that are the morph targets of each part, in the order of its mesh.
    target_names : tuple of P tuple of str
        Their names in the file, which may repeat between parts or be empty.
    """

    copyright: str = ""
    extras: Any = None
    joint_extras: Mapping[int, Any] = field(default_factory=dict)
    part_extras: Mapping[int, Any] = field(default_factory=dict)
    mesh_extras: Mapping[int, Any] = field(default_factory=dict)
    mesh_names: tuple[str, ...] = ()
    part_shapes: tuple[Ints, ...] = ()
    target_names: tuple[tuple[str, ...], ...] = ()
