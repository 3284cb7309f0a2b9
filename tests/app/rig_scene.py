"""A bent arm as template, and its mesh, rotated and scaled by thirty, as target for rigging."""

from dataclasses import replace

import numpy as np
from autorig.rigged_shapes import arm, mesh_of, turn

from viewer.rigs.figure import Figure
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.pose import rest_pose
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skinning import deform

SCALE, ROTATION, MOVE = 30.0, turn([0.1, 1, 0.2], 2.0), np.array([3.0, -4.0, 5.0])
TRUE = np.eye(4)
TRUE[:3, :3], TRUE[:3, 3] = SCALE * ROTATION, MOVE
TO_Z = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # from y up to z up


def bent():
    """Return the arm and the pose of arm and mesh."""
    figure = arm()
    pose = rest_pose(figure.skeleton)
    pose.dofs[6:] = 0.2, -0.1, 0.7
    return figure, pose


def scan(figure, pose) -> Figure:
    """Return the transformed mesh of the posed arm, without its rig."""
    positions = deform(figure, pose)[0] @ TRUE[:3, :3].T + MOVE
    return Figure("scan", mesh_of(positions, figure.mesh.triangles))


def swing(figure) -> Clip:
    """Return a motion of the arm: it moves along x by 1 and its tip rotates about z by 1."""
    channels = []
    for dof in range(figure.skeleton.n_dofs):
        last = 1.0 if dof in (0, 8) else 0.0
        tangents = (("linear", "linear"),) * 2
        channels.append(Channel(dof, np.array([0.0, 1.0]), np.array([0.0, last]), tangents))
    return Clip("swing", tuple(channels), 0.0, 1.0)


def scene(with_template=True, with_clip=False, up="y") -> Scene:
    """Return a scene of the mesh, with an up axis, and the posed arm."""
    figure, pose = bent()
    target = scan(figure, pose)
    if up == "z":
        mesh = replace(target.mesh, positions=target.mesh.positions @ TO_Z[:3, :3].T)
        target = replace(target, mesh=mesh, up="z")
    actors = [Actor(target)]
    if with_template:
        clip = swing(figure) if with_clip else None
        actors.append(Actor(figure, pose.copy(), clip))
    return Scene(actors)
