"""Annotations of a figure: body parts, keypoints, reduced meshes, fields."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Floats, Ints, freeze_fields


@dataclass(frozen=True, slots=True, eq=False)
class BodyParts:
    """The body part of every vertex."""

    names: tuple[str, ...]
    """Names of the parts; a part may have no vertices."""
    of_vertex: Ints
    """(V,) int32. Index into ``names``."""

    def __post_init__(self) -> None:
        freeze_fields(self, np.int32, of_vertex=(None,))
        values = self.of_vertex
        if len(values) and not 0 <= values.min() <= values.max() < len(self.names):
            raise RigError(
                f"body parts: expected 0 to {len(self.names) - 1}, "
                f"found {values.min()} to {values.max()}"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Keypoints:
    """Named points, each attached to a joint or to a point on a triangle."""

    names: tuple[str, ...]
    """Standard names."""
    joints: Ints
    """(N,) int32. Joint of each keypoint, -1 for a point on the mesh."""
    vertices: Ints
    """(N, 3) int32. Corners of the triangle; ignored for keypoints on a joint."""
    weights: Floats
    """(N, 3). Barycentric coordinates in that triangle."""

    def __post_init__(self) -> None:
        count = len(self.names)
        freeze_fields(self, np.int32, joints=(count,), vertices=(count, 3))
        freeze_fields(self, weights=(count, 3))


@dataclass(frozen=True, slots=True, eq=False)
class ReducedMesh:
    """A coarser level of detail that uses a subset of the vertices."""

    vertices: Ints
    """(R,) int32. Indices into the figure's vertices."""
    triangles: Ints
    """(T, 3) int32. Indices into ``vertices``."""

    def __post_init__(self) -> None:
        freeze_fields(self, np.int32, vertices=(None,), triangles=(None, 3))
        corners = self.triangles
        if len(corners) and not 0 <= corners.min() <= corners.max() < len(self.vertices):
            raise RigError(
                f"reduced triangles: expected 0 to {len(self.vertices) - 1}, "
                f"found {corners.min()} to {corners.max()}"
            )


@dataclass(frozen=True, slots=True, eq=False)
class VertexField:
    """A precomputed value per vertex, such as a distance or a confidence."""

    name: str
    """Identifier without spaces, for the command line."""
    title: str
    """Label in menus and the legend."""
    values: Floats
    """(V,). In ``unit``, or indices into ``names``."""
    unit: str = ""
    """``"length"`` for figure units, otherwise the unit's name; empty if dimensionless."""
    names: tuple[str, ...] = ()
    """Names of the classes if the values are indices."""

    def __post_init__(self) -> None:
        freeze_fields(self, values=(None,))
        low, high = (0.0, len(self.names) - 1.0) if self.names else (-np.inf, np.inf)
        values = self.values
        if len(values) and not low <= values.min() <= values.max() <= high:
            raise RigError(
                f"field {self.name}: expected {low:g} to {high:g}, "
                f"found {values.min():g} to {values.max():g}"
            )


def keypoint_positions(keypoints: Keypoints, vertices: Floats, joints: Floats) -> Floats:
    """Return the keypoints' positions (N, 3): posed joints, or sum_k b_k v_k of posed vertices."""
    placed = np.einsum("nk,nka->na", keypoints.weights, vertices[keypoints.vertices])
    at_joint = keypoints.joints >= 0
    placed[at_joint] = joints[keypoints.joints[at_joint]]
    return placed
