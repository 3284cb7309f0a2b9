"""Which vertex or joint of an actor the words of a reader name."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from viewer.lint._finding import Finding
from viewer.rig.scene import Actor

__all__ = ["aimed_at"]

_VERTEX = re.compile(r"\bvertex (\d+)")
_MATRIX = re.compile(r"\bmatrix (\d+) of bindings")
_CHANNEL = re.compile(r"^channel (\d+)")
_JOINT = re.compile(r"\bof joint (.+?)(?:[:,]|$)")


def aimed_at(remark: Finding, actor: Actor, part: str) -> Finding | None:
    """Return a reader's finding with its places in an actor, None if it names none there.

    Parameters
    ----------
    remark : Finding
        In the words of the reader of this part.
    actor : Actor
        Who has it.
    part : "mesh", "skeleton" or "clip"
        Of the actor.
    """
    if part == "mesh":
        return _in_mesh(remark, actor)
    found = remark.diagnostic
    if part == "clip" and found.part == "channels" and found.places is not None:
        return _of_channels(remark, actor)
    joint = _joint_of(remark, actor, part)
    if joint is None:
        return remark if len(remark.joints) and part == "skeleton" else None
    return replace(remark, joints=np.array([joint], dtype=np.int32))


def _of_channels(remark: Finding, actor: Actor) -> Finding | None:
    """Return a finding about channels of a clip with the joints that they move."""
    channels, skeleton = remark.diagnostic.places, actor.figure.skeleton
    if channels is None or skeleton is None:
        return None
    known = channels[channels < skeleton.n_dofs]
    if len(known) == 0:
        return None
    return replace(remark, joints=np.unique(skeleton.dof_joints[known]))


def _in_mesh(remark: Finding, actor: Actor) -> Finding | None:
    if len(remark.vertices) or len(remark.triangles) or len(remark.joints):
        return remark
    mesh, skin = actor.figure.mesh, actor.figure.skin
    vertex, matrix = _VERTEX.search(remark.message), _MATRIX.search(remark.message)
    if vertex is not None and mesh is not None and int(vertex[1]) < mesh.n_vertices:
        return replace(remark, vertices=np.array([int(vertex[1])], dtype=np.int32))
    if matrix is not None and skin is not None and int(matrix[1]) < skin.n_joints:
        return replace(remark, joints=np.array([int(matrix[1])], dtype=np.int32))
    return None


def _joint_of(remark: Finding, actor: Actor, part: str) -> int | None:
    skeleton = actor.figure.skeleton
    if skeleton is None:
        return None
    if part == "clip":
        channel = _CHANNEL.search(remark.message)
        if channel is None or int(channel[1]) >= skeleton.n_dofs:
            return None
        return int(skeleton.dof_joints[int(channel[1])])
    named = _JOINT.search(remark.message)
    if named is None or named[1] not in skeleton.names:
        return None
    return skeleton.names.index(named[1])
