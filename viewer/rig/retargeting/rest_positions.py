"""Positions of the joints of a figure and of the motion that drives it, in common axes."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.retargeting.drive import Drive
from viewer.rig.retargeting.joint_matches import Matches
from viewer.rig.retargeting.rest_poses import rest_of, up_rotation
from viewer.rig.retargeting.source_rest import with_source_rest, with_upright_rest

_SIDES = ("hip", "shoulder", "knee", "collar", "elbow")
_SHORT = 1e-6  # minimum distance with a reliable direction, as a fraction of the skeleton's size


def rest_positions(drive: Drive, figure: Figure) -> tuple[Floats, Floats]:
    """Return the joints of the motion and of the figure in the rest poses that are aligned.

    Returns (S, 3), (J, 3), positions in the figure's axes, each in its own unit.
    """
    motion = with_source_rest(with_upright_rest(drive.motion), drive.source_rest)[0].figure
    axes = up_rotation(motion.up, figure.up)
    source = rest_of(motion.require_skeleton(), axes, figure.up).points
    return source, rest_of(figure.require_skeleton(), np.eye(3), figure.up).points


def front_axes(points: Floats, matches: Matches, up: str, is_source: bool) -> Floats:
    """Return the axes of a front view: left of the body, up, and forward, as rows: (3, 3).

    The left side of the body is found from known joints; without such joints, it is along x.

    ``points``: (J, 3), positions, up along ``up``. ``up``: either "y" or "z", up axis.
    """
    upward = np.eye(3)["xyz".index(up)]
    joints = dict(zip(matches.names, range(len(matches.names)), strict=True))
    short = _SHORT * (float(np.ptp(points, axis=0).max()) or 1.0)
    for side in _SIDES:
        pair = [joints.get(f"{name}_{side}", -1) for name in ("left", "right")]
        if is_source:
            pair = [int(matches.partners[joint]) if joint >= 0 else -1 for joint in pair]
        if min(pair) < 0:
            continue
        left = points[pair[0]] - points[pair[1]]
        left = left - (left @ upward) * upward
        if np.linalg.norm(left) > short:
            left = left / np.linalg.norm(left)
            return np.stack([left, upward, np.cross(left, upward)])
    left = np.eye(3)[0]
    return np.stack([left, upward, np.cross(left, upward)])
