"""Creation of a figure from a long chain of nodes, compared with a chain of half the length."""

import numpy as np
from measure import interleaved, report

from viewer.formats._scene_graph.content import NodeFile, NodeMesh, NodeTree, Primitive
from viewer.formats._scene_graph.figures import figure_group
from viewer.formats._source import Source

COUNT = 100_000
# Quadratic time would have a ratio of 4; larger arrays miss the caches more often.
GOAL = 3.0


def chain(count: int) -> NodeFile:
    """Return a chain of nodes in which every thousandth has a mesh."""
    meshes = np.full(count, -1, dtype=np.int32)
    meshes[::1000] = 0
    none = np.full(count, -1, dtype=np.int32)
    tree = NodeTree(
        names=("node",) * count,
        parents=np.arange(-1, count - 1, dtype=np.int32),
        translations=np.full((count, 3), 1e-3),
        rotations=np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)),
        scales=np.ones((count, 3)),
        meshes=meshes,
        skins=none,
        cameras=none,
    )
    triangle = Primitive(np.eye(3), np.array([[0, 1, 2]], dtype=np.int32), np.eye(3))
    return NodeFile("chain", tree, (0,), meshes=(NodeMesh("", (triangle,)),))


def main(rounds: int = 5) -> None:
    """Print milliseconds and their ratio."""
    whole, half = chain(COUNT), chain(COUNT // 2)
    times = interleaved(
        {
            "whole": lambda: figure_group(whole, Source("chain.glb", data=b"")),
            "half": lambda: figure_group(half, Source("chain.glb", data=b"")),
        },
        rounds,
    )
    report(f"figure of {COUNT} nodes", times, ("whole", "half"), GOAL)
