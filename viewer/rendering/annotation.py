"""What is drawn over a picture to explain it: lines and dots in the scene, words beside points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from viewer.rendering.label_layout import lay_out
from viewer.rendering.lettering import Lettering
from viewer.rendering.projection import picture_scale, project
from viewer.rendering.segments import Manner, Segments
from viewer.rendering.view import View
from viewer.rig.arrays import Floats, Ints

__all__ = ["LABEL_COLOR", "Annotation", "Labels", "PlacedLabels", "letters_for", "place_labels"]

LABEL_COLOR = (0.97, 0.97, 0.98)
"""Usual colour of words, sRGB."""

_LETTERS = 13.0  # pixels of a picture of usual height
_GAP = 7.0  # pixels between a point and its word


@dataclass(frozen=True, slots=True, eq=False)
class Labels:
    """Words beside points.

    Attributes
    ----------
    words : tuple of N str
        What they say.
    points : (N, 3)
        Scene space.
    ranks : (N,) int
        Where there is no room for all, the lower are drawn; of equal ones those that are nearer.
    colors : (N, 3)
        Of the letters, sRGB, 0 to 1.
    """

    words: tuple[str, ...]
    points: Floats
    ranks: Ints
    colors: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Annotation:
    """Segments, and words over them.

    Attributes
    ----------
    segments : Segments
        In the order in which they lie over each other.
    manner : Manner
        How they are drawn.
    labels : Labels or None
        Words, which nothing hides.
    """

    segments: Segments
    manner: Manner
    labels: Labels | None = None


@dataclass(frozen=True, slots=True, eq=False)
class PlacedLabels:
    """The words that are drawn.

    Attributes
    ----------
    words : tuple of M str
        What they say.
    corners : (M, 2)
        Left upper corners, pixels from the picture's left and upper edge.
    colors : (M, 3)
        sRGB, 0 to 1.
    n_seen : int
        How many points are within the picture.
    """

    words: tuple[str, ...]
    corners: Ints
    colors: Floats
    n_seen: int

    @property
    def n_left_out(self) -> int:
        """How many of them have no word drawn, because it would cover another one."""
        return self.n_seen - len(self.words)


def letters_for(size: tuple[int, int]) -> int:
    """Return how high letters are in a picture, pixels.

    Parameters
    ----------
    size : (int, int)
        Width and height of the picture, pixels.
    """
    return round(_LETTERS * picture_scale(size))


def place_labels(
    labels: Labels, view: View, size: tuple[int, int], lettering: Lettering
) -> PlacedLabels:
    """Place words beside their points: those of low rank first, then the nearer ones.

    Parameters
    ----------
    labels : Labels
        What is to be said where.
    view : View
        The camera's matrices.
    size : (int, int)
        Width and height of the picture, pixels.
    lettering : Lettering
        The letters.
    """
    if not labels.words:
        return PlacedLabels((), np.zeros((0, 2), np.int32), np.zeros((0, 3)), 0)
    points = project(view, size, labels.points)
    nearest = np.lexsort((points.depths, labels.ranks))
    order = nearest[points.seen[nearest]].astype(np.int32)
    sizes = lettering.sizes(labels.words)
    layout = lay_out(points.pixels, order, sizes, size, _GAP * picture_scale(size))
    words = tuple(labels.words[index] for index in layout.chosen.tolist())
    return PlacedLabels(words, layout.corners, labels.colors[layout.chosen], len(order))
