"""State of the Joint match panel, and the match that it shows."""

from __future__ import annotations

from dataclasses import field

import numpy as np

from viewer.app.core.state import AppState
from viewer.app.retargeting.drive_changes import shown_drive
from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats, Ints
from viewer.rig.figure import Figure
from viewer.rig.retargeting.drive import Drive
from viewer.rig.retargeting.driven_clip import matches_of
from viewer.rig.retargeting.joint_positions import front_axes, rest_positions
from viewer.rig.skeleton import joint_labels, shown_joints

__all__ = ["JointMatch", "Shown", "Side", "shown_match"]

_LONG = 1.3  # ratio of length to width from which a body is shown from the side
_SIDE_VIEW = -1.1  # yaw of the view from the side, radians


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """One of the two skeletons.

    Attributes
    ----------
    name : str
        Name of the figure or the motion.
    labels : tuple of J str
        Labels of its joints.
    joints : (N,) int32
        Joints that are shown.
    parents : (J,)
        Parents of its joints.
    points : (J, 3)
        Joints at rest seen from the front: to the body's left, up, and forward.
    """

    name: str
    labels: tuple[str, ...]
    joints: Ints
    parents: Ints
    points: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """A match of joints with everything that the panel draws.

    Attributes
    ----------
    drive, figure : Drive, Figure
        The drive and the figure that were matched.
    target, source : Side
        The figure and the motion.
    partners : (J,)
        Joint of the motion for each joint of the figure, -1 for none.
    origins : tuple of J str
        How each joint was matched, see ``Matches``.
    driven : dict
        Joints of the figure that each joint of the motion drives.
    """

    drive: Drive
    figure: Figure
    target: Side
    source: Side
    partners: Ints
    origins: tuple[str, ...]
    driven: dict[int, list[int]]

    @property
    def n_driven(self) -> int:
        """Number of joints of the figure that are driven."""
        return int((self.partners[self.target.joints] >= 0).sum())

    @property
    def unused(self) -> list[int]:
        """Joints of the motion that drive no joint."""
        return [joint for joint in self.source.joints.tolist() if joint not in self.driven]


@dataclass(slots=True)
class JointMatch:
    """State of the panel.

    Attributes
    ----------
    filter : str
        Text that the names of a listed pair must contain.
    source_filter : str
        Text that the names offered in an open list must contain.
    only_unmatched : bool
        Whether only joints without a partner are listed.
    yaw : float
        Rotation of the drawn skeletons about the up axis, radians.
    hovered : (set of int, set of int)
        Joints of the figure and of the motion under the mouse, and their partners.
    scrolls_to : int
        Joint to whose row the table scrolls, -1 for none.
    shown : Shown or None
        The match, computed again when the drive or the figure changes.
    """

    filter: str = ""
    source_filter: str = ""
    only_unmatched: bool = False
    yaw: float = 0.0
    hovered: tuple[set[int], set[int]] = field(default_factory=lambda: (set(), set()))
    scrolls_to: int = -1
    shown: Shown | None = None


def shown_match(state: AppState) -> Shown | None:
    """Return the match of the chosen actor's joints; None if no motion drives it.

    A change is shown at once, even while the motion is still retargeted.
    """
    view, actor = state.of(JointMatch), state.actor
    drive, figure = shown_drive(state, actor), actor.figure
    if drive is None:
        return None
    shown = view.shown
    if shown is None or shown.drive is not drive or shown.figure is not figure:
        is_other = shown is None or shown.drive.motion is not drive.motion
        shown = view.shown = _match(drive, figure)
        if is_other:
            lengths = np.ptp(shown.target.points, axis=0)
            view.yaw = _SIDE_VIEW if lengths[2] > _LONG * lengths[0] else 0.0
            view.filter, view.only_unmatched = "", False
    return shown


def _match(drive: Drive, figure: Figure) -> Shown:
    """Return the match of a drive with a figure."""
    matches = matches_of(drive, figure)
    driven: dict[int, list[int]] = {}
    for joint, partner in enumerate(matches.partners.tolist()):
        if partner >= 0:
            driven.setdefault(partner, []).append(joint)
    source, target = rest_positions(drive, figure)
    mine = target @ front_axes(target, matches, figure.up, is_source=False).T
    theirs = source @ front_axes(source, matches, figure.up, is_source=True).T
    sides = _side(figure, mine), _side(drive.motion.figure, theirs)
    return Shown(drive, figure, *sides, matches.partners, matches.origins, driven)


def _side(figure: Figure, points: Floats) -> Side:
    skeleton = figure.require_skeleton()
    joints = shown_joints(skeleton)
    return Side(figure.name, joint_labels(skeleton), joints, skeleton.parents, points)
