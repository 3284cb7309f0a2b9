"""Labels with the names of joints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.phrases import printable
from viewer.rendering.overlay.annotation import LABEL_COLOR, Labels
from viewer.rendering.overlay.joint_marks import HIGHLIGHT, JointMarks
from viewer.rig.skeleton import joint_labels, shown_joints

__all__ = ["name_labels"]

_LONGEST = 40  # maximum number of characters of a name
_LATE = 1000  # rank of unselected joints, so that other labels take precedence


def name_labels(marks: Sequence[JointMarks], selected: tuple[int, int]) -> Labels:
    """Return the joints' names: the selected joint first, then nearer joints.

    Parameters
    ----------
    marks : sequence of JointMarks
        Joints of all actors.
    selected : (int, int)
        Index of an actor and of its selected joint; -1 for none.
    """
    shown = [shown_joints(one.skeleton) for one in marks]
    texts = [
        printable(labels[joint], _LONGEST)
        for one, joints in zip(marks, shown, strict=True)
        for labels in (joint_labels(one.skeleton),)
        for joint in joints.tolist()
    ]
    if not texts:
        return Labels((), np.zeros((0, 3)), np.zeros(0, dtype=np.int32), np.zeros((0, 3)))
    is_chosen = np.concatenate(
        [
            (joints == selected[1]) & (one.actor == selected[0])
            for one, joints in zip(marks, shown, strict=True)
        ]
    )
    points = np.concatenate([one.points[joints] for one, joints in zip(marks, shown, strict=True)])
    colors = np.where(is_chosen[:, None], HIGHLIGHT[:3], LABEL_COLOR)
    return Labels(tuple(texts), points, np.where(is_chosen, 0, _LATE).astype(np.int32), colors)
