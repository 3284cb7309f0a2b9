"""Properties of a file of nodes for ``viewer info``."""

from __future__ import annotations

from viewer.formats._nodes.content import NodeFile
from viewer.formats._nodes.surfaces import Piece

__all__ = ["facts_of"]

_ASSET = ("version", "generator", "copyright")
_LONGEST = 200  # maximum number of characters of a fact


def facts_of(file: NodeFile, pieces: list[Piece]) -> tuple[tuple[str, str], ...]:
    """Return the facts about a figure and its file, each a heading and a text.

    Parameters
    ----------
    file : NodeFile
        The file, whose asset information is reported.
    pieces : list of Piece
        The primitives of the figure.
    """
    facts = [
        (key, str(file.asset[key])[:_LONGEST]) for key in _ASSET if file.asset.get(key) is not None
    ]
    licence = file.asset.get("license") or file.asset.get("licence")
    extras = file.asset.get("extras")
    if licence is None and isinstance(extras, dict):
        licence = extras.get("license") or extras.get("licence")
    if isinstance(licence, str):
        facts.append(("licence", licence[:_LONGEST]))
    sums = max((piece.influences.deviation for piece in pieces), default=0.0)
    # Smaller deviations are rounding errors of float32.
    if sums > 1e-6:
        facts.append(("weight sums", f"within {sums:.2g} of 1, divided by their sum"))
    return (*facts, *file.facts)
