"""Mesh of a figure in a pose, without its rig."""

from __future__ import annotations

from dataclasses import replace

from viewer.rig.figure import Figure
from viewer.rig.mesh import Mesh
from viewer.rig.pose import Pose
from viewer.rig.skinning import deform

__all__ = ["posed_mesh"]


def posed_mesh(figure: Figure, pose: Pose | None) -> Mesh:
    """Return a figure's mesh with the positions and normals of a pose.

    Parameters
    ----------
    figure : Figure
        A figure with a mesh; without a skin, its mesh is returned as it is.
    pose : Pose or None
        Pose of the figure; that of the file if omitted.

    Raises
    ------
    RigError
        If the figure has no mesh.
    """
    mesh = figure.require_mesh()
    if not figure.is_attached:
        return mesh
    positions, normals = deform(figure, pose)
    return replace(mesh, positions=positions, normals=normals)
