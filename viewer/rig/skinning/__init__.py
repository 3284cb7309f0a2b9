"""Skinning methods: how joint matrices move vertices. One module and one GLSL chunk each."""

from __future__ import annotations

from importlib import import_module

from viewer.errors import RigError
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.kinematics import skinning_matrices, world_matrices
from viewer.rig.pose import Pose, rest_pose

__all__ = ["METHODS", "deform"]

METHODS = {
    "lbs": "Linear blend skinning",
}
"""Module in this folder and GLSL chunk in ``shaders/skin``, with the name that menus show."""


def deform(figure: Figure, pose: Pose | None = None, method: str = "lbs") -> tuple[Floats, Floats]:
    """Return a figure's posed vertices: the float64 reference that the GPU is held to.

    Parameters
    ----------
    figure : Figure
        With a mesh. Without skeleton or skin the mesh comes back in its binding space.
    pose : Pose, optional
        DOFs in lengths and radians; the file's own pose if omitted.
    method : str
        A key of ``METHODS``.

    Returns
    -------
    positions : (V, 3)
        Figure units.
    normals : (V, 3)
        Unit length.

    Raises
    ------
    RigError
        If the figure has no mesh or the method is unknown.

    >>> import viewer
    >>> figure = viewer.load().actors[0].figure
    >>> positions, normals = viewer.deform(figure, viewer.rest_pose(figure.skeleton))
    >>> positions.shape == figure.mesh.positions.shape
    True
    """
    if figure.mesh is None:
        raise RigError(f"figure {figure.name} has no mesh to deform")
    if method not in METHODS:
        raise RigError(f'no skinning method "{method}"; there are: {", ".join(METHODS)}')
    module = import_module(f"{__name__}.{method}")
    if figure.skeleton is None or figure.skin is None:
        return figure.mesh.positions.copy(), module.unit(figure.mesh.normals)
    pose = rest_pose(figure.skeleton) if pose is None else pose
    palette = skinning_matrices(world_matrices(figure.skeleton, pose), figure.skin.inverse_bind)
    return module.deform(figure.mesh, figure.skin, palette)
