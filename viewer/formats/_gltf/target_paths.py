"""Targets of animation channels: the nodes and the property that a channel animates."""

from __future__ import annotations

import re
from typing import Any, cast

from viewer.data_classes import dataclass
from viewer.formats._gltf.elements import Element
from viewer.formats._nodes.content import NodeMesh, NodeTree
from viewer.rig.motion.transform_clip import TRANSFORM_PATHS, TransformPath

__all__ = ["Moved", "Targets"]

_NODE_POINTER = re.compile(r"/nodes/([0-9]{1,9})/(translation|rotation|scale|weights)")
_MESH_POINTER = re.compile(r"/meshes/([0-9]{1,9})/weights")
_INDEX = re.compile(r"/[0-9]+")

_OF_NODES = frozenset(TRANSFORM_PATHS) - {"weights"}


@dataclass(frozen=True, slots=True)
class Moved:
    """Target of a channel.

    Attributes
    ----------
    path : str
        Entry of ``TRANSFORM_PATHS``; for other targets, a name for messages.
    nodes : tuple of int
        Nodes that the channel animates; empty if it has no visible effect.
    """

    path: str
    nodes: tuple[int, ...]

    @property
    def transform_path(self) -> TransformPath:
        """Path of a channel that animates nodes."""
        return cast("TransformPath", self.path)


class Targets:
    """Nodes that channels can animate.

    Parameters
    ----------
    tree : NodeTree
        All nodes.
    meshes : tuple of NodeMesh
        All meshes, whose morph targets have weights.
    """

    def __init__(self, tree: NodeTree, meshes: tuple[NodeMesh, ...]) -> None:
        self._tree, self._meshes = tree, meshes
        self._with_shapes = {
            node
            for node, mesh in enumerate(tree.meshes.tolist())
            if mesh >= 0 and meshes[mesh].target_names
        }

    def n_shapes(self, node: int) -> int:
        """Return the number of morph targets of a node's mesh."""
        mesh = int(self._tree.meshes[node])
        return len(self._meshes[mesh].target_names) if mesh >= 0 else 0

    def moves(self, node: Any, path: Any) -> bool:
        """Return whether a channel of this node and path, as in the file, has a visible effect."""
        if type(node) is not int or not 0 <= node < self._tree.n_nodes:
            return False
        return node in self._with_shapes if path == "weights" else path in TRANSFORM_PATHS

    def moves_all(self, ends: list[Any]) -> bool:
        """Return whether all channels with these targets, as in the file, have a visible effect.

        Files have tens of thousands of them, most of which are transforms. A target that is not an
        object, or lacks a member, raises a ``TypeError`` or ``KeyError``.
        """
        nodes, paths = {end["node"] for end in ends}, {end["path"] for end in ends}
        if set(map(type, nodes)) == {int} and paths.issubset(_OF_NODES):
            return min(nodes) >= 0 and max(nodes) < self._tree.n_nodes
        return all(self.moves(end["node"], end["path"]) for end in ends)

    def of(self, channel: Element) -> Moved:
        """Return the target of a channel.

        Raises
        ------
        FormatError
            If the channel has no target, or refers to a missing node.
        """
        target = channel.part("target")
        if target is None:
            raise channel.wrong("target", "an object")
        path = target.text("path")
        if path == "pointer":
            return self._pointed(target)
        node = target.index("node", self._tree.n_nodes, "nodes")
        return Moved(path, (node,) if self.moves(node, path) else ())

    def _pointed(self, target: Element) -> Moved:
        """Return the target of a JSON pointer (KHR_animation_pointer)."""
        extension = target.extension("KHR_animation_pointer")
        pointer = "" if extension is None else extension.text("pointer")
        if match := _NODE_POINTER.fullmatch(pointer):
            node, path = int(match[1]), match[2]
            return Moved(path, (node,) if self.moves(node, path) else ())
        if match := _MESH_POINTER.fullmatch(pointer):
            mesh = int(match[1])
            # Weights of a node override the weights of its mesh.
            users = (node for node in self._with_shapes if self._tree.meshes[node] == mesh)
            nodes = (node for node in users if node not in self._tree.shape_weights)
            return Moved("weights", tuple(sorted(nodes)))
        return Moved(_INDEX.sub("", pointer).removeprefix("/")[:60] or "pointer", ())
