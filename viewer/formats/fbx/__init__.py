"""Reader of ``.fbx``: meshes, skins, blend shapes, materials and animation stacks of a node tree.

The format belongs to Autodesk and is not published. ufbx (github.com/ufbx/ufbx) reads versions 3.0
to 7.7, ASCII and binary, in a child process, because its Python binding can crash. Transforms with
pivots are folded into translation, rotation and scale, which is exact. Animations are sampled at
the file's frame rate and at their keys, beyond their keys if curves are extrapolated, and more
densely in fast spins. Right-handed axes with y or z up and units of m, cm, mm or
inches are preserved; others are converted to y up and metres.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from viewer.formats._source import Source
    from viewer.rigs.figure import FigureGroup


def read(source: Source) -> FigureGroup:
    """Read the figures of a file; the keys of animations are read when they are first needed."""
    # The child process imports this package, too, and needs neither module.
    from viewer.formats._scene_graph.figures import figure_group
    from viewer.formats.fbx.contents import node_file

    return figure_group(node_file(source), source)
