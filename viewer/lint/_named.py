"""Locations, in an actor, of the elements named by a reader's diagnostic."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.lint._finding import Finding
from viewer.rig.scene import Actor

__all__ = ["aimed_at"]


def aimed_at(remark: Finding, actor: Actor, part: str) -> Finding | None:
    """Return a reader's finding with its locations in an actor, or None if there are none.

    Parameters
    ----------
    remark : Finding
        Finding about the file from which the part was read.
    actor : Actor
        The actor with this part.
    part : "mesh", "skeleton" or "clip"
        Part of the actor.
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
    # If faulty data is unchanged, the vertex is found by its value.
    vertices = remark.vertices if len(remark.vertices) else [found.values.get("vertex")]
    known = [vertex for vertex in vertices if vertex is not None and vertex < mesh.n_vertices]
    return replace(remark, vertices=np.array(known, dtype=np.int32)) if known else None


def _in_clip(remark: Finding, actor: Actor) -> Finding | None:
    """Return a finding about channels of a clip with the joints that they animate."""
    found, skeleton = remark.diagnostic, actor.figure.skeleton
    if found.part != "channels" or found.places is None or skeleton is None:
        return None
    channels = found.places[found.places < skeleton.n_dofs]
    if len(channels) == 0:
        return None
    return replace(remark, joints=np.unique(skeleton.dof_joints[channels]))
