"""Which of many labels are drawn, and where, so that none covers another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from viewer.rig.arrays import Floats, Ints

__all__ = ["Layout", "lay_out"]

_SIDES = ((0.0, 1.0), (-1.0, -1.0))
"""Where a label may lie beside its point: shift in its own widths, and in gaps."""


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """The labels that are drawn.

    Attributes
    ----------
    chosen : (M,)
        Indices of the labels, in the order in which they were placed.
    corners : (M, 2)
        Their left upper corners, whole pixels.
    """

    chosen: Ints
    corners: Ints


def lay_out(
    anchors: Floats,
    order: Ints,
    sizes: Ints,
    picture: tuple[int, int],
    gap: float,
) -> Layout:
    """Place labels one after the other beside their points, and leave out those that collide.

    A label lies right of its point, or left of it if that is not free.

    Parameters
    ----------
    anchors : (N, 2)
        The points, pixels from the picture's left and upper edge.
    order : (N,)
        Indices of the labels: those that come first are placed first.
    sizes : (N, 2)
        Width and height of the labels, pixels.
    picture : (int, int)
        Width and height of the picture; labels lie within it.
    gap : float
        Pixels between a point and its label.
    """
    (width, height), apart = picture, round(0.5 * gap)
    taken = np.zeros((height, width), dtype=bool)
    chosen: list[int] = []
    corners: list[tuple[int, int]] = []
    for index in order.tolist():
        (x, y), (across, down) = anchors[index].tolist(), sizes[index].tolist()
        top = round(min(max(y - 0.5 * down, 0.0), height - down))
        for share, gaps in _SIDES:
            left = round(x + share * across + gaps * gap)
            if left < 0 or top < 0 or left + across > width:
                continue
            # Half a gap stays free around each: two words beside each other are not one.
            around = slice(max(left - apart, 0), left + across + apart)
            if not taken[top : top + down, around].any():
                taken[top : top + down, left : left + across] = True
                chosen.append(index)
                corners.append((left, top))
                break
    return Layout(
        np.array(chosen, dtype=np.int32), np.array(corners, dtype=np.int32).reshape(-1, 2)
    )
