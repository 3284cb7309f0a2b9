"""Names of joints in a picture: which are drawn, where, and how many are not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from viewer.errors import printable
from viewer.rendering.joint_marks import HIGHLIGHT, JointMarks
from viewer.rendering.label_layout import lay_out
from viewer.rendering.lettering import Lettering
from viewer.rendering.projection import picture_scale, project
from viewer.rendering.view import View
from viewer.rig.arrays import Floats, Ints
from viewer.rig.skeleton import joint_labels

__all__ = ["PlacedNames", "letters_for", "place_names"]

_LETTERS = 13.0  # pixels of a picture of usual height
_LONGEST = 40  # letters of a name
_GAP = 7.0  # pixels between a joint and its name
_WHITE = (0.97, 0.97, 0.98)


@dataclass(frozen=True, slots=True, eq=False)
class PlacedNames:
    """The names that are drawn.

    Attributes
    ----------
    words : tuple of N str
        What they say.
    corners : (N, 2)
        Left upper corners, pixels from the picture's left and upper edge.
    colors : (N, 3)
        sRGB, 0 to 1.
    n_seen : int
        How many joints are within the picture.
    """

    words: tuple[str, ...]
    corners: Ints
    colors: Floats
    n_seen: int

    @property
    def n_left_out(self) -> int:
        """How many of them have no name drawn, because it would cover another one."""
        return self.n_seen - len(self.words)


def letters_for(size: tuple[int, int]) -> int:
    """Return how high the letters of names are in a picture, pixels."""
    return round(_LETTERS * picture_scale(size))


def place_names(
    marks: Sequence[JointMarks],
    view: View,
    size: tuple[int, int],
    selected: tuple[int, int],
    lettering: Lettering,
) -> PlacedNames:
    """Place names beside their joints: that of the selected joint first, then the nearer ones.

    Parameters
    ----------
    marks : sequence of JointMarks
        Of all actors.
    view : View
        The camera's matrices.
    size : (int, int)
        Width and height of the picture, pixels.
    selected : (int, int)
        An actor's index and a joint of it; -1 for none.
    lettering : Lettering
        The letters.
    """
    words = [printable(word, _LONGEST) for one in marks for word in joint_labels(one.skeleton)]
    if not words:
        return PlacedNames((), np.zeros((0, 2), np.int32), np.zeros((0, 3)), 0)
    points = project(view, size, np.concatenate([one.points for one in marks]))
    is_chosen = np.concatenate(
        [(np.arange(len(one.points)) == selected[1]) & (one.actor == selected[0]) for one in marks]
    )
    nearest = np.lexsort((points.depths, ~is_chosen))
    order = nearest[points.seen[nearest]].astype(np.int32)
    sizes = lettering.sizes(words)
    gap = _GAP * picture_scale(size)
    layout = lay_out(points.pixels, order, sizes, size, gap)
    colors = np.where(is_chosen[layout.chosen, None], HIGHLIGHT[:3], _WHITE)
    chosen = tuple(words[index] for index in layout.chosen.tolist())
    return PlacedNames(chosen, layout.corners, colors, len(order))
