"""Figure: a mesh, a skeleton and the skin that ties them; any part may be missing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from viewer.errors import RigError
from viewer.rig.arrays import Floats
from viewer.rig.kinematics import world_matrices
from viewer.rig.mesh import Mesh
from viewer.rig.pose import Pose
from viewer.rig.skeleton import Skeleton
from viewer.rig.skin import Skin

__all__ = ["Figure", "skeleton_points"]


@dataclass(frozen=True, slots=True, eq=False)
class Figure:
    """A character as its files hold it.

    Attributes
    ----------
    name : str
        What menus call it.
    mesh : Mesh or None
        In the space where it was bound.
    skeleton : Skeleton or None
        Without one the mesh stays in its binding space.
    skin : Skin or None
        Without one the mesh does not follow the skeleton.
    up : "y" or "z"
        The axis that points up in the file; the camera obeys it.
    """

    name: str
    mesh: Mesh | None = None
    skeleton: Skeleton | None = None
    skin: Skin | None = None
    up: Literal["y", "z"] = "y"

    def __post_init__(self) -> None:
        if self.mesh is None and self.skeleton is None:
            raise RigError(f"figure {self.name}: expected a mesh or a skeleton, found neither")
        if self.skin is None:
            return
        if self.mesh is None or self.skin.n_vertices != self.mesh.n_vertices:
            found = 0 if self.mesh is None else self.mesh.n_vertices
            raise RigError(
                f"figure {self.name}: the skin binds {self.skin.n_vertices} vertices, "
                f"the mesh has {found}"
            )
        if self.skeleton is not None and self.skeleton.n_joints != self.skin.n_joints:
            raise RigError(
                f"figure {self.name}: the skin has {self.skin.n_joints} binding matrices, "
                f"the skeleton has {self.skeleton.n_joints} joints"
            )

    @property
    def is_attached(self) -> bool:
        """Whether the mesh follows the skeleton."""
        return self.mesh is not None and self.skin is not None and self.skeleton is not None


def skeleton_points(skeleton: Skeleton, pose: Pose) -> Floats:
    """Return points that span the posed skeleton: joint origins and the corners of its boxes.

    Parameters
    ----------
    skeleton : Skeleton
        With or without boxes.
    pose : Pose
        DOFs in lengths and radians.

    Returns
    -------
    (N, 3)
        Figure space.
    """
    world = world_matrices(skeleton, pose)
    if skeleton.boxes is None:
        return world[:, :3, 3]
    choice = np.array([[i >> axis & 1 for axis in range(3)] for i in range(8)])
    corners = skeleton.boxes[:, choice, np.arange(3)]
    placed = np.einsum("jab,jcb->jca", world[:, :3, :3], corners) + world[:, None, :3, 3]
    return np.concatenate([world[:, :3, 3], placed.reshape(-1, 3)])
