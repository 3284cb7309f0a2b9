"""JSON pointers to the elements of a file from which a figure was made."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from viewer.formats._nodes.content import NodeFile
from viewer.formats._nodes.grouping import Members
from viewer.formats._nodes.joints import Joints
from viewer.formats._nodes.surfaces import Piece
from viewer.rig.skeleton import Skeleton

if TYPE_CHECKING:
    from viewer.formats._source import Source

__all__ = ["remember_pointers"]

_ATTRIBUTES = {"positions": "POSITION", "normals": "NORMAL", "weights": "WEIGHTS_0"}


def remember_pointers(
    source: Source,
    skeleton: Skeleton | None,
    file: NodeFile,
    members: Members,
    joints: Joints,
    pieces: list[Piece],
) -> None:
    """Register the JSON pointers of nodes, skin joints and primitives, if the file has any.

    Parameters
    ----------
    source : Source
        The file.
    skeleton : Skeleton
        The figure's skeleton.
    file : NodeFile
        Its contents.
    members : Members
        The nodes of the figure.
    joints : Joints
        The joints of the figure.
    pieces : list of Piece
        The primitives of the figure.
    """
    if not file.has_pointers:
        return
    first_vertices = np.cumsum([0, *(piece.n_vertices for piece in pieces)])
    first_triangles = np.cumsum([0, *(len(piece.triangles) for piece in pieces)])

    def pointer_of(kind: str, index: int) -> str:
        if kind in ("joints", "bindings"):
            return _joint(file, members, joints.nodes[index], kind)
        if kind == "triangles":
            piece = int(np.searchsorted(first_triangles, index, "right")) - 1
            return pieces[piece].primitive.pointer
        if kind in _ATTRIBUTES:
            piece = int(np.searchsorted(first_vertices, index, "right")) - 1
            return f"{pieces[piece].primitive.pointer}/attributes/{_ATTRIBUTES[kind]}"
        return ""

    source.remember_pointers(skeleton, pointer_of)


def _joint(file: NodeFile, members: Members, node: int, kind: str) -> str:
    """Return the pointer to a joint's node, or to its entry in a skin; empty if it is auxiliary."""
    if node < 0:
        return ""
    for index in members.skins if kind == "bindings" else ():
        places = np.flatnonzero(file.skins[index].joints == node)
        if len(places):
            return f"/skins/{index}/joints/{places[0]}"
    return f"/nodes/{node}"
