"""Chains of springs, such as hair and skirts: ``VRMC_springBone`` 1.0, ``secondaryAnimation``."""

from __future__ import annotations

from viewer.formats._nodes.content import NodeFile
from viewer.formats._source import Source
from viewer.formats._vrm.json_parts import part

__all__ = ["note_springs"]

_EXTENSION = "VRMC_springBone"


def note_springs(file: NodeFile, source: Source) -> None:
    """Report the number of spring chains, which are not simulated.

    Parameters
    ----------
    file : NodeFile
        The file, with its extensions. In version 0, every bone of a group starts a chain.
    source : Source
        Records the note.
    """
    springs = part(file.extensions, _EXTENSION, "springs")
    count = len(springs) if isinstance(springs, list) else 0
    pointer = f"/extensions/{_EXTENSION}/springs"
    if not count:
        groups = part(file.extensions, "VRM", "secondaryAnimation", "boneGroups")
        bones = [part(each, "bones") for each in groups] if isinstance(groups, list) else []
        count = sum(len(each) for each in bones if isinstance(each, list))
        pointer = "/extensions/VRM/secondaryAnimation/boneGroups"
    if count:
        source.warn("F007.vrm-springs", pointer, n=count)
