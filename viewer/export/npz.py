"""Write a posed figure as named arrays, for programs in Python.

::

    vertices (V, 3)   normals (V, 3)   triangles (T, 3)   uvs (U, 2)   uv_triangles (T, 3)
    joints (J, 3)     world (J, 4, 4)  joint_names (J,)   parents (J,)
    own_numbers (N,)  shape_weights (S,)   up   unit   name
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from viewer.errors import printable
from viewer.formats import save_arrays
from viewer.rig.pose_vector import write_vector
from viewer.rig.scene import Actor
from viewer.rig.skinning import Skinning, deform, joint_matrices

__all__ = ["export"]


def export(actor: Actor, path: Path, skinning: Skinning) -> list[str]:
    """Write float64 arrays in the figure's own space and unit; see ``viewer.export.export``."""
    figure, pose, mesh = actor.figure, actor.pose, actor.figure.mesh
    arrays = {
        "name": np.array(figure.name),
        "up": np.array(figure.up),
        "unit": np.array(figure.unit),
    }
    if mesh is not None:
        arrays["vertices"], arrays["normals"] = deform(figure, pose, skinning)
        arrays["triangles"] = mesh.triangles
        if mesh.uvs is not None:
            corners = mesh.triangles if mesh.uv_triangles is None else mesh.uv_triangles
            arrays["uvs"], arrays["uv_triangles"] = mesh.uvs, corners
    if figure.skeleton is not None and pose is not None:
        world = joint_matrices(figure, pose)
        arrays |= {
            "joints": world[:, :3, 3],
            "world": world,
            "joint_names": np.array(figure.skeleton.names),
            "parents": figure.skeleton.parents,
            "own_numbers": write_vector(figure.pose_layout, figure.skeleton, pose),
            "shape_weights": pose.shape_weights,
        }
    save_arrays(path, arrays)
    return [f"{printable(path, 300)}: {', '.join(arrays)}"]
