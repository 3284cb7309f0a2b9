"""Places of joints: in figure space, in the scene, and under the pointer."""

from __future__ import annotations

import numpy as np

from viewer.app.core.state import AppState
from viewer.app.core.view_frame import Place, ViewFrame
from viewer.app.rigging.joint_editing.rest_meshes import rest_mesh
from viewer.autorig.binding import enclosed
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.pose import placement_matrix
from viewer.rigs.scene import Actor


def figure_place(actor: Actor) -> Floats:
    """Return the matrix (4, 4) from figure space to the scene."""
    return np.asarray(actor.placement @ placement_matrix(actor.pose))


def scene_place(actor: Actor) -> Floats:
    """Return the matrix (4, 4) from the scene to figure space."""
    return np.asarray(np.linalg.inv(figure_place(actor)), dtype=np.float64)


def middle_under(state: AppState, actor: Actor, frame: ViewFrame, at: Place) -> Floats | None:
    """Return the middle of the solid under a window position, in figure space."""
    origin, direction = frame.ray(at)
    back = scene_place(actor)
    solid = enclosed(rest_mesh(actor.figure))[1]
    return solid.middle(apply_transform(back, origin[None])[0], back[:3, :3] @ direction)
