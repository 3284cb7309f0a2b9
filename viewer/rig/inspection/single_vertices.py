"""Skinning of a few vertices of a posed figure."""

from __future__ import annotations

from viewer.errors import RigError
from viewer.rig.arrays import Floats, Ints
from viewer.rig.figure import Figure
from viewer.rig.geometry.transform import apply_transform
from viewer.rig.geometry.vectors import unit
from viewer.rig.kinematics import posed_skeleton
from viewer.rig.pose import Pose, placement_matrix, rest_pose
from viewer.rig.shape import pose_weights, shaped
from viewer.rig.skinning import Skinning, skinned

__all__ = ["check_vertices", "deform_vertices", "rest_vertices"]


def deform_vertices(
    figure: Figure, pose: Pose | None, skinning: Skinning, vertices: Ints
) -> tuple[Floats, Floats]:
    """Skin a selection of vertices, with the same result as ``viewer.rig.skinning.deform``.

    Parameters
    ----------
    figure : Figure
        Figure with a mesh.
    pose : Pose or None
        None for the pose stored in the file.
    skinning : Skinning
        Skinning options of the drawn mesh.
    vertices : (N,)
        Indices.

    Returns
    -------
    positions, normals : (N, 3)
        Figure units; unit length.

    Raises
    ------
    RigError
        If the figure has no such vertices.
    """
    check_vertices(figure, vertices)
    if pose is not None:
        figure = shaped(figure, pose.shape_weights)
    mesh, skeleton, skin = figure.mesh, figure.skeleton, figure.skin
    assert mesh is not None  # checked by check_vertices
    if skeleton is None or skin is None:
        moved, normals = mesh.positions[vertices], unit(mesh.normals[vertices])
        return moved if pose is None else apply_transform(placement_matrix(pose), moved), normals
    pose = rest_pose(skeleton) if pose is None else pose
    palette = posed_skeleton(skeleton, pose).palette(skin)
    rest = rest_vertices(figure, pose, vertices, skinning.correctives)
    moved, normals = skinned(mesh, skin, rest, palette, skinning, vertices)
    return apply_transform(placement_matrix(pose), moved), normals


def rest_vertices(figure: Figure, pose: Pose, vertices: Ints, correct: bool = True) -> Floats:
    """Return some vertices before skinning: the rest mesh plus the pose correctives.

    Parameters
    ----------
    figure : Figure
        Figure with a mesh, already shaped.
    pose : Pose
        DOFs in lengths and radians.
    vertices : (N,)
        Indices.
    correct : bool
        Whether to add the pose correctives, if the figure has any.

    Returns
    -------
    (N, 3)
        Vertices in the bind pose.
    """
    rest = figure.require_mesh().positions[vertices]
    if not correct or figure.correctives is None or figure.skeleton is None:
        return rest
    weights = pose_weights(figure.correctives, figure.skeleton, pose)
    return rest + figure.correctives.of_vertices(vertices, weights) if weights.any() else rest


def check_vertices(figure: Figure, vertices: Ints) -> None:
    """Check that indices refer to vertices of a figure.

    Raises
    ------
    RigError
        If an index is out of range; the message states the index and the range.
    """
    count = 0 if figure.mesh is None else figure.mesh.n_vertices
    wrong = vertices[(vertices < 0) | (vertices >= count)]
    if count == 0:
        raise RigError(f"figure {figure.name} has no vertices")
    if len(wrong):
        raise RigError(f"vertex: expected 0 to {count - 1}, found {wrong[0]}")
