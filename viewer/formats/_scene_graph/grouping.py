"""Division of a tree of nodes into figures: which nodes are joints of which figure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field

import numpy as np

from viewer.data_classes import dataclass
from viewer.formats._scene_graph.content import NodeFile, NodeMesh, NodeTree
from viewer.rigs.geometry.topology import components
from viewer.rigs.hierarchy import roots_of, with_ancestors

_MOST_TREES = 16  # maximum number of separate figures made from root trees of rigid meshes
_MOST_COPIES = 4  # maximum number of joints of all figures, relative to the number of nodes


@dataclass(slots=True, eq=False)
class Members:
    """The nodes of one figure."""

    nodes: list[int] = field(default_factory=list)
    """Nodes that become joints, parents first."""
    skins: list[int] = field(default_factory=list)
    """Skins of the figure; skins of meshes come first, in the order of the meshes."""
    meshes: list[int] = field(default_factory=list)
    """Nodes whose meshes are parts of the figure, in tree order."""
    name: str = ""
    """Name of the topmost node that is not in another figure, or of the skin of which this node is
    a joint; empty for the only figure of a file."""


def is_skinned(mesh: NodeMesh, skin: int) -> bool:
    """Return whether a skin moves all primitives of a mesh, so that its node has no effect."""
    return skin >= 0 and all(p.joints is not None for p in mesh.primitives)


def group_nodes(file: NodeFile) -> list[Members]:
    """Return the figures of a file, in the order of their first node.

    Skins belong to one figure if they share a joint, or if one has a joint below a joint of the
    other. Meshes without a skin belong to the figure that has their node or an ancestor as a
    joint; the others form one figure per root tree, or a single figure if the file has no skins.
    A file without meshes and skins is one figure of its animated nodes, or of all its nodes.

    The result is empty if there is nothing to show.
    """
    return _Grouping(file).result()


def scene_order(file: NodeFile) -> list[int]:
    """Return the nodes of the scene that is shown, parents first."""
    roots = roots_of(file.tree.parents)
    return _preorder(file.tree, dict.fromkeys(int(roots[root]) for root in file.roots))


class _Grouping:
    """State of the division: the figures found so far, by key."""

    def __init__(self, file: NodeFile) -> None:
        self.file, self.tree = file, file.tree
        self.parents: list[int] = file.tree.parents.tolist()
        self.meshes: list[int] = file.tree.meshes.tolist()
        self.roots = roots_of(file.tree.parents)
        tree = self.tree
        moved = np.concatenate(
            [tree.translations, tree.rotations[:, :3], tree.scales - 1.0], axis=1
        )
        self.is_identity = np.array(~moved.any(axis=1))
        self.is_identity[list(tree.matrices)] = False
        self.moved = set(file.humanoid.values()) | file.named_nodes
        self.moved.update(*(animation.nodes for animation in file.animations))
        for constraint in file.constraints:
            self.moved.update((constraint.joint, constraint.source))
        self.drawn = {
            index
            for index, mesh in enumerate(file.meshes)
            if any(len(primitive.triangles) for primitive in mesh.primitives)
        }
        self.order = self._order()
        self.place = {node: place for place, node in enumerate(self.order)}
        self.mesh_nodes = [n for n in self.order if self.meshes[n] in self.drawn]
        self.skins = self._skins()
        self.owners = self._owners()
        self.figures: dict[tuple[str, int], Members] = {}
        # Nodes of each figure that must be joints; their ancestors are added later.
        self.wanted: dict[tuple[str, int], set[int]] = {}

    def result(self) -> list[Members]:
        """Return the figures."""
        for skin in self.skins:
            figure, wanted = self._figure(("skin", self.same[skin]))
            figure.skins.append(skin)
            wanted.update(self.file.skins[skin].joints.tolist())
        for node in self.mesh_nodes:
            self._add_mesh(node)
        self._add_animated()
        if not self.figures and self._is_hierarchy():
            self._figure(("all", 0))[1].update(self._bare())
        self._close()
        found = sorted(self.figures.values(), key=lambda figure: self.place[figure.nodes[0]])
        self._name(found)
        return found

    def _order(self) -> list[int]:
        """Return the nodes of the scene, and of trees with joints of its skins, parents first."""
        tops = [int(self.roots[root]) for root in self.file.roots]
        order = _preorder(self.tree, dict.fromkeys(tops))
        used = {int(self.tree.skins[n]) for n in order if self.meshes[n] in self.drawn} - {-1}
        joints = (self.file.skins[skin].joints for skin in sorted(used))
        more = {int(root) for nodes in joints for root in np.unique(self.roots[nodes])}
        return order + _preorder(self.tree, sorted(more - set(tops)))

    def _skins(self) -> list[int]:
        """Return the skins of the meshes, then other skins whose joints are all in the scene."""
        used = dict.fromkeys(int(self.tree.skins[node]) for node in self.mesh_nodes)
        used.pop(-1, None)
        rest = (n for n in range(len(self.file.skins)) if n not in used)
        skins = self.file.skins
        return [*used] + [n for n in rest if all(j in self.place for j in skins[n].joints.tolist())]

    def _owners(self) -> dict[int, int]:
        """Return a skin for each node that is a joint or below one; unite skins of one figure."""
        of_node: dict[int, list[int]] = {}
        for skin in self.skins:
            for node in self.file.skins[skin].joints.tolist():
                of_node.setdefault(node, []).append(skin)
        owners: dict[int, int] = {}
        links = list[tuple[int, int]]()
        for node in self.order:
            above = owners.get(self.parents[node])
            own = of_node.get(node, [])
            for skin in own if above is None else [above, *own]:
                owners[node] = skin
                links.append((skin, own[0] if own else skin))
        pairs = np.array(links, dtype=np.int32).reshape(-1, 2)
        self.same = components(len(self.file.skins), pairs).tolist()
        return owners

    def _figure(self, key: tuple[str, int]) -> tuple[Members, set[int]]:
        return self.figures.setdefault(key, Members()), self.wanted.setdefault(key, set())

    def _add_mesh(self, node: int) -> None:
        mesh, skin = self.file.meshes[self.meshes[node]], int(self.tree.skins[node])
        if skin >= 0 and any(p.joints is not None for p in mesh.primitives):
            key = "skin", self.same[skin]
        else:
            key = self._key(node)
        figure, wanted = self._figure(key)
        figure.meshes.append(node)
        if not is_skinned(mesh, skin):
            wanted.add(node)

    def _key(self, node: int) -> tuple[str, int]:
        """Return the key of the figure to which a node without a skin belongs."""
        if node in self.owners:
            return "skin", self.same[self.owners[node]]
        return ("root", int(self.roots[node])) if self.skins else ("all", 0)

    def _add_animated(self) -> None:
        """Add animated nodes to their figure, or to the only figure of their tree."""
        in_tree: dict[int, list[tuple[str, int]]] = {}
        for key, wanted in self.wanted.items():
            for root in {int(self.roots[node]) for node in wanted}:
                in_tree.setdefault(root, []).append(key)
        skinned = {
            node
            for node in self.mesh_nodes
            if is_skinned(self.file.meshes[self.meshes[node]], int(self.tree.skins[node]))
        }
        is_alone = not self.figures
        for node in sorted(self.moved & self.place.keys() - skinned, key=self.place.__getitem__):
            key = self._key(node)
            if key not in self.figures and not is_alone:
                keys = in_tree.get(int(self.roots[node]), [])
                if len(keys) != 1 or self.tree.cameras[node] >= 0:
                    continue
                key = keys[0]
            self._figure(("all", 0) if is_alone else key)[1].add(node)

    def _bare(self) -> list[int]:
        return [node for node in self.order if self.tree.cameras[node] < 0]

    def _is_hierarchy(self) -> bool:
        """Return whether nodes without content form a tree that could be a skeleton."""
        return any(self.parents[node] >= 0 for node in self._bare())

    def _close(self) -> None:
        """Add the ancestors of all joints; merge figures if there are too many."""
        trees = [key for key in self.figures if key[0] == "root"]
        if len(trees) > _MOST_TREES:
            self._merge(trees)
        most = _MOST_COPIES * len(self.order) + 1000
        for key, wanted in self.wanted.items():
            nodes = self._with_ancestors(wanted)
            most -= len(nodes)
            if most < 0:
                self._merge(list(self.figures))
                return self._close()
            self.figures[key].nodes = self._trimmed(nodes, wanted)
        return None

    def _merge(self, keys: list[tuple[str, int]]) -> None:
        """Merge figures into the first one."""
        into, wanted = self.figures[keys[0]], self.wanted[keys[0]]
        for key in keys[1:]:
            figure = self.figures.pop(key)
            into.skins += figure.skins
            into.meshes += figure.meshes
            wanted |= self.wanted.pop(key)
        into.meshes.sort(key=self.place.__getitem__)

    def _with_ancestors(self, wanted: Iterable[int]) -> list[int]:
        """Return nodes and their ancestors, parents first."""
        return sorted(with_ancestors(self.parents, wanted), key=self.place.__getitem__)

    def _trimmed(self, nodes: list[int], wanted: set[int]) -> list[int]:
        """Return the nodes, except for topmost ones without effect."""
        children: dict[int, int] = {}
        for node in nodes:
            above = self.parents[node]
            children[above] = children.get(above, 0) + 1
        first = 0
        while children[-1] == 1 and first + 1 < len(nodes):
            node = nodes[first]
            if node in wanted or node in self.moved or children.get(node) != 1:
                break
            if not self.is_identity[node]:
                break
            first += 1
        return nodes[first:]

    def _name(self, figures: list[Members]) -> None:
        """Name each of several figures after its topmost node that is not in another figure."""
        if len(figures) < 2:
            return
        counts: dict[int, int] = {}
        for figure in figures:
            for node in self._with_ancestors(figure.nodes):
                counts[node] = counts.get(node, 0) + 1
        for figure in figures:
            own = (n for n in self._with_ancestors(figure.nodes) if counts[n] == 1)
            top = next((node for node in own if self.tree.names[node]), -1)
            # Exporters store a figure's name in its skin; its topmost joint may be called ``root``.
            skins = (self.file.skins[number] for number in figure.skins)
            of_skins = (skin.name for skin in skins if skin.name and top in skin.joints)
            figure.name = next(of_skins, self.tree.names[top] if top >= 0 else "")


def _preorder(tree: NodeTree, tops: Iterable[int]) -> list[int]:
    """Return the nodes of some trees in preorder, with children in file order."""
    order = np.argsort(tree.parents, kind="stable")
    starts = np.searchsorted(tree.parents[order], np.arange(tree.n_nodes + 1)).tolist()
    # Children are pushed in reverse order, so that the first child is popped first.
    children = order.tolist()
    found: list[int] = []
    stack = [*tops][::-1]
    while stack:
        node = stack.pop()
        found.append(node)
        stack += children[starts[node] : starts[node + 1]][::-1]
    return found
