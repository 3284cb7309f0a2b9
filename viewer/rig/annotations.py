"""What is known of a figure beyond how it moves: parts, keypoints, coarser meshes, fields."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from viewer.errors import RigError
from viewer.rig.arrays import Floats, Ints, frozen

__all__ = ["BodyParts", "Keypoints", "ReducedMesh", "VertexField", "keypoint_positions"]


@dataclass(frozen=True, slots=True, eq=False)
class BodyParts:
    """A part for every vertex.

    Attributes
    ----------
    names : tuple of P str
        May name parts without vertices.
    of_vertex : (V,) int32
        Index into ``names``.
    """

    names: tuple[str, ...]
    of_vertex: Ints

    def __post_init__(self) -> None:
        values = frozen("of_vertex", self.of_vertex, (None,), np.int32)
        object.__setattr__(self, "of_vertex", values)
        if len(values) and not 0 <= values.min() <= values.max() < len(self.names):
            raise RigError(
                f"body parts: expected 0 to {len(self.names) - 1}, "
                f"found {values.min()} to {values.max()}"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Keypoints:
    """Named points that follow a joint, or a place on a triangle.

    Attributes
    ----------
    names : tuple of N str
        As the field calls them.
    joints : (N,) int32
        The joint of each, -1 for a place on the mesh.
    vertices : (N, 3) int32
        The corners of each place; any where a joint is given.
    weights : (N, 3)
        Barycentric coordinates.
    """

    names: tuple[str, ...]
    joints: Ints
    vertices: Ints
    weights: Floats

    def __post_init__(self) -> None:
        count = len(self.names)
        put = object.__setattr__
        put(self, "joints", frozen("joints", self.joints, (count,), np.int32))
        put(self, "vertices", frozen("vertices", self.vertices, (count, 3), np.int32))
        put(self, "weights", frozen("weights", self.weights, (count, 3)))


@dataclass(frozen=True, slots=True, eq=False)
class ReducedMesh:
    """A second level of detail over some of the same vertices.

    Attributes
    ----------
    vertices : (R,) int32
        Indices into the figure's vertices.
    triangles : (T, 3) int32
        Indices into ``vertices``.
    """

    vertices: Ints
    triangles: Ints

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "vertices", frozen("vertices", self.vertices, (None,), np.int32))
        put(self, "triangles", frozen("triangles", self.triangles, (None, 3), np.int32))
        corners = self.triangles
        if len(corners) and not 0 <= corners.min() <= corners.max() < len(self.vertices):
            raise RigError(
                f"reduced triangles: expected 0 to {len(self.vertices) - 1}, "
                f"found {corners.min()} to {corners.max()}"
            )


@dataclass(frozen=True, slots=True, eq=False)
class VertexField:
    """A number for every vertex that somebody computed: a distance, a confidence.

    Attributes
    ----------
    name : str
        One word, for the command line.
    title : str
        For menus and the legend.
    values : (V,)
        In ``unit``, or indices into ``names``.
    unit : str
        ``"length"``: figure units; else the word for it, empty for none.
    names : tuple of str
        What the numbers stand for if those are indices: ``("matched", "filled")``.
    """

    name: str
    title: str
    values: Floats
    unit: str = ""
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", frozen("values", self.values, (None,)))
        low, high = (0.0, len(self.names) - 1.0) if self.names else (-np.inf, np.inf)
        values = self.values
        if len(values) and not low <= values.min() <= values.max() <= high:
            raise RigError(
                f"field {self.name}: expected {low:g} to {high:g}, "
                f"found {values.min():g} to {values.max():g}"
            )


def keypoint_positions(keypoints: Keypoints, vertices: Floats, joints: Floats) -> Floats:
    """Return where the keypoints are.

    Parameters
    ----------
    keypoints : Keypoints
        N of them.
    vertices : (V, 3)
        Posed.
    joints : (J, 3)
        Posed, in the same space.

    Returns
    -------
    (N, 3)
        In that space.
    """
    placed = np.einsum("nk,nka->na", keypoints.weights, vertices[keypoints.vertices])
    at_joint = keypoints.joints >= 0
    placed[at_joint] = joints[keypoints.joints[at_joint]]
    return placed
