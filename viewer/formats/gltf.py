"""Reader of glTF 2.0 files: ``.gltf`` with files beside it, ``.glb``, and ``.vrm`` characters.

The grammar is in ``_gltf/node_file.py``; ``_nodes`` describes the conversion to figures.
"""

from __future__ import annotations

from viewer.formats._gltf.node_file import read_nodes
from viewer.formats._nodes.figures import figure_group
from viewer.formats._source import Source
from viewer.formats._vrm.reading import with_vrm
from viewer.rig.figure_group import FigureGroup

__all__ = ["read"]


def read(source: Source) -> FigureGroup:
    """Read the figures and cameras of a file.

    Parameters
    ----------
    source : Source
        A ``.gltf``, ``.glb`` or ``.vrm`` file.

    Returns
    -------
    FigureGroup
        Figures with skeletons of ball joints, blend shapes and animations, in metres.

    Raises
    ------
    FormatError
        If the file is invalid, requires an unsupported extension, or has nothing to show.
    """
    return figure_group(with_vrm(read_nodes(source), source), source)
