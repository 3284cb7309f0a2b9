"""Places in an actor that a reader's diagnostic is about."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.lint._finding import Finding
from viewer.rig.scene import Actor

__all__ = ["aimed_at"]


def aimed_at(remark: Finding, actor: Actor, part: str) -> Finding | None:
    """Return a reader's finding with its places in an actor, None if it is about none there.

    Parameters
    ----------
    remark : Finding
        Of the file that this part was read from.
    actor : Actor
        Whose part it is.
    part : "mesh", "skeleton" or "clip"
        Of the actor.
    """
    if part == "mesh":
        return _in_mesh(remark, actor)
    if part == "clip":
        return _in_clip(remark, actor)
    return remark if len(remark.joints) else None


def _in_mesh(remark: Finding, actor: Actor) -> Finding | None:
    mesh, skin, found = actor.figure.mesh, actor.figure.skin, remark.diagnostic
    if mesh is None:
        return None
    if len(remark.triangles) or len(remark.joints):
        return remark if found.part != "bindings" or skin is not None else None
    # Of faults whose data stay as they are only the value tells the vertex.
    vertices = remark.vertices if len(remark.vertices) else [found.values.get("vertex")]
    known = [vertex for vertex in vertices if vertex is not None and vertex < mesh.n_vertices]
    return replace(remark, vertices=np.array(known, dtype=np.int32)) if known else None


def _in_clip(remark: Finding, actor: Actor) -> Finding | None:
    """Return a finding about channels of a clip with the joints that they move."""
    found, skeleton = remark.diagnostic, actor.figure.skeleton
    if found.part != "channels" or found.places is None or skeleton is None:
        return None
    channels = found.places[found.places < skeleton.n_dofs]
    if len(channels) == 0:
        return None
    return replace(remark, joints=np.unique(skeleton.dof_joints[channels]))
