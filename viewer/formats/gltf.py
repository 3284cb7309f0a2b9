"""Reader of glTF 2.0: ``.gltf``, ``.glb``, characters (``.vrm``) and their motions (``.vrma``).

The grammar is in ``_gltf/node_file.py``; ``_nodes`` describes the conversion to figures.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from viewer.formats._gltf.node_file import read_nodes
from viewer.formats._nodes.figures import figure_group
from viewer.formats._source import Source
from viewer.formats._vrm.reading import with_vrm
from viewer.rig.figure_group import FigureGroup

if TYPE_CHECKING:
    from viewer.rig.motion.skeleton_motion import SkeletonMotion

__all__ = ["read"]


_MOTION = "VRMC_vrm_animation"


def read(source: Source) -> FigureGroup | SkeletonMotion:
    """Read the figures and cameras of a file, or the motion of a ``.vrma`` file.

    Parameters
    ----------
    source : Source
        A ``.gltf``, ``.glb``, ``.vrm`` or ``.vrma`` file.

    Returns
    -------
    FigureGroup or SkeletonMotion
        Figures with skeletons of ball joints, blend shapes and animations, in metres; or a
        skeleton with its motion.

    Raises
    ------
    FormatError
        If the file is invalid, requires an unsupported extension, or has nothing to show.
    """
    file = read_nodes(source)
    if isinstance(file.extensions.get(_MOTION), dict):
        from viewer.formats._vrm.animation import read_motion

        return read_motion(file, source)
    return figure_group(with_vrm(file, source), source)
