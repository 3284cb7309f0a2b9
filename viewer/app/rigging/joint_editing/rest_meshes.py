"""What the mesh of an edited figure alone determines: its shape at rest, its plane of symmetry."""

from __future__ import annotations

import numpy as np

from viewer.autorig.anatomy import sagittal_plane
from viewer.autorig.binding import enclosed
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.geometry.vectors import axis_vector
from viewer.rigs.inspection.front import guess_front
from viewer.rigs.joint_edits import Plane, rest_worlds
from viewer.rigs.memo import Memo
from viewer.rigs.mesh import Mesh, bounding_box, box_size
from viewer.rigs.retargeting.joint_names import sided_words
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skinning import posed_mesh

_SAME = 1e-9  # distance of the mesh at rest from the bind pose that is rounding, of its size
_rest_meshes: Memo[Figure, Mesh] = Memo()
_planes: Memo[Mesh, Plane] = Memo()


def rest_mesh(figure: Figure) -> Mesh:
    """Return the mesh at rest: the mesh itself if it was bound so."""
    mesh = figure.require_mesh()
    if not figure.is_attached:
        return mesh

    def make() -> Mesh:
        posed = posed_mesh(figure, figure_pose(figure))
        apart = np.abs(posed.positions - mesh.positions).max(initial=0.0)
        return mesh if apart <= _SAME * box_size(bounding_box(mesh.positions)) else posed

    return _rest_meshes.get(figure, None, make)


def keep_rest_mesh(figure: Figure, mesh: Mesh) -> None:
    """Record the mesh at rest of an edited figure, which stays the same object."""
    _rest_meshes.get(figure, None, lambda: mesh)


def plane_of(figure: Figure, mesh: Mesh) -> Plane:
    """Return the plane in which the solid of a mesh mirrors itself best."""

    def make() -> Plane:
        up = axis_vector(figure.up)
        normal, offset, _ = sagittal_plane(enclosed(mesh)[1], up)
        left = _left_of(figure, mesh)
        return Plane(normal, offset) if normal @ left >= 0.0 else Plane(-normal, -offset)

    return _planes.get(mesh, None, make)


def _left_of(figure: Figure, mesh: Mesh) -> Floats:
    """Return the direction (3,) to a figure's left, by the names of its joints or by its feet."""
    if figure.skeleton is not None:
        sides = np.array([side for side, _ in sided_words(figure.skeleton.names)])
        places = rest_worlds(figure)[:, :3, 3]
        if (sides == "left").any() and (sides == "right").any():
            apart = places[sides == "left"].mean(axis=0) - places[sides == "right"].mean(axis=0)
            if np.linalg.norm(apart) > 0.0:
                return np.asarray(apart)
    plain = Figure(figure.name, mesh, up=figure.up)
    front = guess_front(Scene([Actor(plain)]))
    left = np.cross(axis_vector(figure.up), axis_vector(front[1]))
    return left if front[0] == "+" else -left
