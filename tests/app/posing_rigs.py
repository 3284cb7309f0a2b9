"""Synthetic rigs for the posing tools, and window positions."""

import numpy as np

from viewer.app.posing.posed_joint import posed_joint
from viewer.rigs.figure import Figure
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skeleton import Skeleton

SIZE = (1280, 800)


def arm_figure(orders=("xyz", "z", "xyz"), limits=None, root="", name="arm", up="y") -> Figure:
    """Return a figure of three joints along x, one unit apart; each rotates about its named axes.

    ``root`` names the translations of the first joint; ``limits`` maps (joint, axis) to limits.
    """
    dofs = [(0, "xyz".index(axis)) for axis in root]
    dofs += [(joint, 3 + "xyz".index(a)) for joint, word in enumerate(orders) for a in word]
    bounds = np.tile([-np.inf, np.inf], (len(dofs), 1))
    for row, (joint, kind) in enumerate(dofs):
        bounds[row] = (limits or {}).get((joint, "XYZxyz"[kind]), bounds[row])
    skeleton = Skeleton(
        names=("shoulder", "elbow", "hand"),
        parents=np.array([-1, 0, 1]),
        rest_translations=np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 0]]),
        rest_rotations=np.tile([0.0, 0, 0, 1], (3, 1)),
        rest_scales=np.ones((3, 3)),
        dof_joints=np.array([joint for joint, _ in dofs]),
        dof_kinds=np.array([kind for _, kind in dofs]),
        rest_dofs=np.clip(np.zeros(len(dofs)), *bounds.T),
        dof_limits=bounds,
        boxes=np.tile([[-0.05] * 3, [0.05] * 3], (3, 1, 1)),
    )
    return Figure(name=name, skeleton=skeleton, up=up)


def arm_scene(**settings) -> Scene:
    return Scene([Actor(arm_figure(**settings))])


def seen_at(hand, point):
    """Return the window coordinates of a point, by the camera's matrices."""
    camera = hand.state.camera
    x, y, width, height = hand.state.view_rect
    matrix = camera.projection_matrix(width / height, hand.state.box) @ camera.view_matrix()
    clip = matrix @ np.append(point, 1.0)
    across, upward = clip[:2] / clip[3]
    return float(x + width * (across + 1) / 2), float(y + height * (1 - upward) / 2)


def joint_seen(hand, joint):
    """Return the window position of a joint of the active actor."""
    return seen_at(hand, posed_joint(hand.state.actor, joint).center)


def around(center, radius, start, end, steps=8):
    """Return window positions on a circle; angles are in radians, counter-clockwise from +x."""
    return [
        (center[0] + radius * np.cos(a), center[1] - radius * np.sin(a))
        for a in np.linspace(start, end, steps)
    ]


def drag_along(hand, places, held=""):
    """Drag with the mouse from the first position to the last."""
    with hand.holding(held):
        hand.move(places[0])
        hand.press()
        for place in places[1:]:
            hand.move(place)
        hand.let_go()
    hand.step(2)
