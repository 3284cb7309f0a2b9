"""Plan of the positions and times at which the feet of a driven figure must be planted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats
from viewer.rig.retargeting.source_contacts import (
    Contact,
    FootPath,
    foot_contacts,
    ground_level,
    step_height,
)

_SUNK = 0.015  # maximum depth of the source's feet below the ground, relative to the body


@dataclass(frozen=True, slots=True, eq=False)
class FootPlan:
    """Contacts of all feet, and the heights of the ground."""

    feet: list[FootPath]
    """Paths of the source's feet."""
    contacts: list[list[Contact]]
    """Contacts of each foot, in time order."""
    grounds: list[list[float]]
    """Height of the ground under the figure during each contact."""
    spans: list[tuple[int, int]]
    """Ranges of rows without gaps."""
    rate: float
    """Rows per second."""
    size: float
    """Approximate height of the body."""
    up: Floats
    """(3,). The up axis."""

    def stances(self, foot: int) -> Iterator[tuple[Contact, slice, float]]:
        """Return the contacts of a foot, their rows, and the heights of the ground."""
        for contact, ground in zip(self.contacts[foot], self.grounds[foot], strict=True):
            yield contact, slice(contact.start, contact.stop), ground

    def steps(self, points: tuple[Floats, Floats], contact: Contact) -> Floats:
        """Return the horizontal displacements of a planted foot from row to row.

        ``points``: ((N, 3), (N, 3)), paths of the ball and the heel.
        """
        rows = slice(contact.start, contact.stop)
        toe, heel = (np.diff(path[rows], axis=0, prepend=path[rows][:1]) for path in points)
        moved = np.where(contact.on_toe[:, None], toe, heel)
        return moved - (moved @ self.up)[:, None] * self.up

    def slide(self, feet: Sequence[tuple[Floats, Floats]]) -> float:
        """Return the total distance that balls and heels slide while they are in contact."""
        total = 0.0
        for points, contacts in zip(feet, self.contacts, strict=True):
            for contact in contacts:
                total += float(np.linalg.norm(self.steps(points, contact), axis=1).sum())
        return total

    def holds(self) -> Floats:
        """Return the degree to which each foot is held on the ground, 0 to 1: (N, L)."""
        result = np.zeros((len(self.feet[0].toe), len(self.feet)))
        for foot in range(len(self.contacts)):
            for contact, rows, _ in self.stances(foot):
                result[rows, foot] = contact.hold
        return result

    def gap(self, heights: Floats) -> float:
        """Return the largest distance of a planted foot from the ground.

        ``heights`` are the heights of the lowest point of each foot, (N, L).
        """
        stands, largest = self.holds() >= 1.0, 0.0
        for foot in range(len(self.contacts)):
            for _, rows, ground in self.stances(foot):
                gaps = np.abs(heights[rows, foot] - ground)[stands[rows, foot]]
                largest = max(largest, float(gaps.max(initial=0.0)))
        return largest

    def floor(self, foot: int) -> Floats:
        """Return the height below which a foot with contacts must not sink: (N,).

        This is the ground of the previous or next contact, whichever is lower. If the source's foot
        sinks below this ground, the limit follows it.
        """
        contacts, path = self.contacts[foot], self.feet[foot]
        rows = np.arange(len(path.toe))
        after = np.searchsorted([contact.start for contact in contacts], rows, side="right")
        before = np.maximum(after - 1, 0)
        after = np.minimum(after, len(contacts) - 1)
        levels = np.array(self.grounds[foot])
        stands = np.array([contact.height for contact in contacts])
        lowest = np.minimum(levels[before], levels[after])
        sunk = np.minimum(stands[before], stands[after]) - path.lowest(self.up)
        return lowest - np.maximum(sunk - _SUNK * self.size, 0.0)


def foot_plan(
    feet: list[FootPath],
    spans: list[tuple[int, int]],
    rate: float,
    shape: tuple[float, float],
    up: Floats,
    ease: float = 0.0,
) -> FootPlan:
    """Return the contacts of the source, and the heights of the ground under the figure.

    ``feet``, ``spans``, ``rate``, ``up``: as in ``FootPlan``. ``ease``: duration of the beginning
    and the end of a contact, as in ``foot_contacts``.
    """
    size, clearance = shape
    contacts = foot_contacts(feet, spans, rate, size, up, ease)
    if not any(contacts):
        return FootPlan(feet, contacts, [[] for _ in feet], spans, rate, size, up)
    level, is_usual = ground_level(contacts, size, clearance)
    ground = 0.0 if is_usual else level - clearance
    grounds = [[ground + step_height(one, level, size) for one in foot] for foot in contacts]
    return FootPlan(feet, contacts, grounds, spans, rate, size, up)
