"""Figures: a mesh, a skeleton and the skin that binds them; any part may be missing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeAlias

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.phrases import counted, printable
from viewer.rigs.arrays import Floats, Ints, freeze_fields
from viewer.rigs.bodies.smpl_family import ShapeSpace
from viewer.rigs.checked_fields import checked
from viewer.rigs.geometry.vectors import Up
from viewer.rigs.kinematics import posed_skeleton
from viewer.rigs.mesh import Mesh
from viewer.rigs.pose import Pose, rest_pose
from viewer.rigs.skeleton import Skeleton

if TYPE_CHECKING:
    from pathlib import Path

    from viewer.diagnostics import Diagnostic
    from viewer.rigs.annotations import BodyParts, Keypoints, ReducedMesh, VertexField
    from viewer.rigs.blendshapes import BlendShapes, Correctives, JointRegressor
    from viewer.rigs.bodies.model_parameters import ModelParameters
    from viewer.rigs.captures.cameras import CameraView
    from viewer.rigs.captures.points import PointLayout
    from viewer.rigs.file_record import FileRecord
    from viewer.rigs.hands import Hand
    from viewer.rigs.motion.transform_clip import Animation
    from viewer.rigs.posing.pose_vector import PoseLayout
    from viewer.rigs.skin import Skin


FilePart: TypeAlias = Literal["mesh", "skeleton"]
"""A part of a figure that comes from one file: the mesh with its skin, or the skeleton."""


_LONGEST = 60  # characters of a name in descriptions


@dataclass(frozen=True, slots=True, eq=False)
class Origin:
    """The file that parts of a figure were read from."""

    path: Path
    parts: dict[FilePart, tuple[object, ...]]
    """The parts as read, None for a missing one. An edited part consists of other objects, whose
    origin is therefore unknown."""
    pointer_of: Callable[[str, int], str] | None = None
    """Returns the JSON pointer to an element of a kind, as for ``Source.remember``; empty if there
    is none."""


class AttachedFigure(NamedTuple):
    """The mesh, skeleton and skin of a figure whose mesh follows its skeleton."""

    mesh: Mesh
    skeleton: Skeleton
    skin: Skin


@checked
@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Figure:
    """A character as read from its files."""

    name: str
    """Label in menus."""
    mesh: Mesh | None = None
    """In bind pose."""
    skeleton: Skeleton | None = None
    """Without a skeleton, the mesh stays in the bind pose."""
    skin: Skin | None = None
    """Without a skin, the mesh does not follow the skeleton."""
    up: Up = "y"
    """Up axis of the file, which the camera follows."""
    unit: str = ""
    """Unit of length, a key of ``viewer.rigs.units.METRES``, given by the file or estimated; empty
    if unknown."""
    blend_shapes: BlendShapes | None = None
    """Weighted offsets of the rest mesh, which the joints follow."""
    correctives: Correctives | None = None
    """Offsets that depend on the pose."""
    joint_regressor: JointRegressor | None = None
    """Computes the joints of a changed rest mesh."""
    hands: tuple[Hand, ...] = ()
    """Principal components of the hand poses."""
    pose_layout: PoseLayout | None = None
    """Order of the values in the model's own pose vectors; None if those are the DOFs."""
    parameters: ModelParameters | None = None
    """Parameters of the model that determine its DOFs and scales."""
    body_parts: BodyParts | None = None
    keypoints: Keypoints | None = None
    reduced: ReducedMesh | None = None
    """Other annotations of the mesh."""
    symmetry: Ints | None = None
    """(V,) int32 or None. Mirror counterpart of each vertex."""
    points: PointLayout | None = None
    """Layout of a figure that consists of captured keypoints only."""
    fields: tuple[VertexField, ...] = ()
    """Precomputed values per vertex, to be shown as colours."""
    facts: tuple[tuple[str, str | Diagnostic], ...] = ()
    """Findings of the reader for ``viewer info``, as pairs of heading and text."""
    animations: tuple[Animation, ...] = ()
    """Motions from the figure's file, in file order."""
    shape_space: ShapeSpace = ShapeSpace()
    """Model and gender whose shape coefficients apply to it, if it is a body model."""
    record: FileRecord | None = None
    """Other data of its glTF or FBX file, to be written back."""
    origins: tuple[Origin, ...] = ()
    """The files that it was read from; a skin and its skeleton may come from two."""

    def __post_init__(self) -> None:
        if self.mesh is None and self.skeleton is None and self.points is None:
            raise RigError(f"figure {self.name}: expected a mesh or a skeleton, found neither")
        self._check_vertices()
        if self.skin is None:
            return
        if self.mesh is None or self.skin.n_vertices != self.mesh.n_vertices:
            found = 0 if self.mesh is None else self.mesh.n_vertices
            raise RigError(
                f"figure {self.name}: the skin binds {self.skin.n_vertices} vertices, "
                f"but the mesh has {found}"
            )
        if self.skeleton is not None and self.skeleton.n_joints != self.skin.n_joints:
            raise RigError(
                f"figure {self.name}: the skin has {self.skin.n_joints} binding matrices, "
                f"but the skeleton has {self.skeleton.n_joints} joints"
            )

    def __repr__(self) -> str:
        parts = list[str]()
        if self.mesh is not None:
            parts.append(counted(self.mesh.n_vertices, "vertex"))
        if self.skeleton is not None:
            parts.append(counted(self.skeleton.n_joints, "joint"))
        if self.points is not None:
            parts.append(counted(len(self.points.names), "point"))
        if self.n_shapes:
            parts.append(counted(self.n_shapes, "blend shape"))
        if self.animations:
            parts.append(counted(len(self.animations), "animation"))
        unit = f"; unit {self.unit}" if self.unit else ""
        return f"<Figure {printable(self.name, _LONGEST)}: {', '.join(parts)}; {self.up} up{unit}>"

    def origin_of(self, part: FilePart) -> Origin | None:
        """Return the file of a part that has not been edited since; None if there is none."""
        own = _parts(self)[part]
        for origin in self.origins:
            known = origin.parts[part]
            # Something that the file lacks may have been added when it was opened.
            if known[0] is not None and all(
                old is None or old is new for old, new in zip(known, own, strict=True)
            ):
                return origin
        return None

    def _check_vertices(self) -> None:
        """Check that all per-vertex data fits the mesh."""
        count = 0 if self.mesh is None else self.mesh.n_vertices
        freeze_fields(self, np.int32, symmetry=(count,))
        ends: dict[str, int | None] = {
            "blend shapes": self.blend_shapes.n_vertices if self.blend_shapes else None,
            "correctives": self.correctives.n_vertices if self.correctives else None,
            "body parts": len(self.body_parts.of_vertex) if self.body_parts else None,
        }
        ends |= {f"field {field.name}": len(field.values) for field in self.fields}
        for what, found in ends.items():
            if found is not None and found != count:
                raise RigError(
                    f"figure {self.name}: the {what} have {found} vertices, "
                    f"but the mesh has {count}"
                )
        indices: dict[str, Ints | None] = {
            "joint regressor": self.joint_regressor.vertices if self.joint_regressor else None,
            "list of keypoints": self.keypoints.vertices if self.keypoints else None,
            "reduced mesh": self.reduced.vertices if self.reduced else None,
            "symmetry map": self.symmetry,
        }
        for what, listed in indices.items():
            if listed is not None and listed.size and not 0 <= listed.min() <= listed.max() < count:
                raise RigError(
                    f"figure {self.name}: the {what} refers to vertices {listed.min()} to "
                    f"{listed.max()}, but the mesh has {count}"
                )

    @property
    def n_shapes(self) -> int:
        """Number of blend shapes, S."""
        return 0 if self.blend_shapes is None else self.blend_shapes.n_shapes

    @property
    def rest_shape_weights(self) -> Floats:
        """Shape weights of the pose stored in the file: (S,)."""
        shapes = self.blend_shapes
        if shapes is None or shapes.rest_weights is None:
            return np.zeros(self.n_shapes)
        return shapes.rest_weights

    @property
    def is_attached(self) -> bool:
        """Whether the mesh follows the skeleton."""
        return self.mesh is not None and self.skin is not None and self.skeleton is not None

    @property
    def is_rigged(self) -> bool:
        """Whether it has a mesh that is more than rigid parts at the nodes of its file."""
        is_posed = bool(self.animations) or self.record is None or self.record.has_skin
        return self.is_attached and is_posed

    def require_mesh(self) -> Mesh:
        """Return the mesh; ``RigError`` if there is none."""
        if self.mesh is None:
            raise RigError(f"figure {self.name} has no mesh")
        return self.mesh

    def require_skeleton(self) -> Skeleton:
        """Return the skeleton; ``RigError`` if there is none."""
        if self.skeleton is None:
            raise RigError(f"figure {self.name} has no skeleton")
        return self.skeleton

    def require_skin(self) -> Skin:
        """Return the skin; ``RigError`` if there is none."""
        if self.skin is None:
            raise RigError(f"figure {self.name} has no skin")
        return self.skin

    def attached(self) -> AttachedFigure:
        """Return mesh, skeleton and skin; ``RigError`` if one of them is missing."""
        return AttachedFigure(self.require_mesh(), self.require_skeleton(), self.require_skin())


def _parts(figure: Figure) -> dict[FilePart, tuple[object, ...]]:
    """Return the objects that each part consists of; another texture leaves a mesh the same."""
    mesh = figure.mesh
    arrays = (None,) * 3 if mesh is None else (mesh.positions, mesh.normals, mesh.triangles)
    return {"mesh": (*arrays, figure.skin), "skeleton": (figure.skeleton,)}


def read_from(
    path: Path, figure: Figure, pointer_of: Callable[[str, int], str] | None = None
) -> Figure:
    """Return a figure that knows the file from which all its parts were read."""
    return replace(figure, origins=(Origin(path, _parts(figure), pointer_of),))


def skeleton_points(skeleton: Skeleton, pose: Pose) -> Floats:
    """Return points (N, 3) that span the posed skeleton: joint origins and corners of boxes."""
    world = posed_skeleton(skeleton, pose).world
    if skeleton.boxes is None:
        return world[:, :3, 3]
    choice = np.array([[i >> axis & 1 for axis in range(3)] for i in range(8)])
    corners = skeleton.boxes[:, choice, np.arange(3)]
    placed = np.einsum("jab,jcb->jca", world[:, :3, :3], corners) + world[:, None, :3, 3]
    return np.concatenate([world[:, :3, 3], placed.reshape(-1, 3)])


@dataclass(frozen=True, slots=True, eq=False)
class FigureGroup:
    """All figures of a file, in one common space, and its cameras."""

    name: str
    """Title of the group."""
    figures: tuple[Figure, ...]
    """At least one; all have the same up axis and unit."""
    views: tuple[CameraView, ...] = ()
    """Cameras of the file, in the space of the figures."""

    def __post_init__(self) -> None:
        if not self.figures:
            raise RigError(f"{self.name}: expected at least one figure, found none")


def figure_pose(figure: Figure) -> Pose:
    """Return a new pose of a figure with a skeleton: the pose and shape weights of the file."""
    pose = rest_pose(figure.require_skeleton())
    pose.shape_weights = figure.rest_shape_weights.copy()
    return pose
