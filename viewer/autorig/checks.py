"""What is looked at when a rig has been carried over, and how it is told."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.autorig.transfer.joint_transfer import outside
from viewer.rig.arrays import Bools, Floats
from viewer.rig.figure import Figure
from viewer.rig.geometry.transform import apply_transform
from viewer.rig.mesh import Mesh, bounding_box, box_size
from viewer.rig.pose import Pose
from viewer.rig.skeleton import joint_label
from viewer.rig.skinning import deform, joint_matrices

__all__ = ["check_lines", "joint_list", "newly_outside", "residual_of", "with_joint_name"]

_EXACT = 1e-4  # residual over size above which a person is warned
_LISTED = 8  # vertices or joints named one by one


def newly_outside(
    template: Figure,
    pose: Pose,
    posed: Floats,
    target: Mesh,
    joints: Floats | None = None,
    carried: Bools | None = None,
) -> tuple[int, ...]:
    """Return the joints that lie inside the template, but not inside the target.

    Parameters
    ----------
    template : Figure
        Already shaped.
    pose : Pose
        Its own.
    posed : (V, 3)
        Its posed vertices.
    target : Mesh
        The mesh that was rigged.
    joints : (J, 3) or None
        In the target's frame; None if they are the template's.
    carried : (J,) bool or None
        Which are expected inside: a joint of a part that the target lacks is not. None for all.
    """
    assert template.mesh is not None  # the callers looked
    own = joint_matrices(template, pose)[:, :3, 3]
    before = outside(posed, template.mesh.triangles, own)
    asked = np.flatnonzero(~before if carried is None else carried & ~before)
    there = own if joints is None else joints
    after = outside(target.positions, target.triangles, there[asked])
    return tuple(asked[after].tolist())


def residual_of(figure: Figure, pose: Pose, placement: Floats, target: Mesh) -> float:
    """Return how far a figure posed again is from the target, at most, over the target's size.

    Parameters
    ----------
    figure : Figure
        With as many vertices as the target.
    pose : Pose
        In which the target was found.
    placement : (4, 4)
        Figure space to the target's frame.
    target : Mesh
        What should come back.
    """
    again = apply_transform(placement, deform(figure, pose)[0])
    size = box_size(bounding_box(target.positions))
    return float(np.linalg.norm(again - target.positions, axis=1).max(initial=0.0)) / size


def check_lines(figure: Figure, guarded: Bools, out: tuple[int, ...], residual: float) -> list[str]:
    """Return what the checks found, one sentence each.

    Parameters
    ----------
    figure : Figure
        Names its joints.
    guarded : (V,) bool
        From ``unpose``.
    out : tuple of int
        From ``newly_outside``.
    residual : float
        From ``residual_of``.
    """
    lines = []
    if out:
        lines.append(f"warning: outside the mesh: {joint_list(figure, out)}")
    count = int(guarded.sum())
    if count:
        first = ", ".join(map(str, np.flatnonzero(guarded)[:_LISTED]))
        more = " …" if count > _LISTED else ""
        lines.append(
            f"warning: {count} vertices bent too far to be undone exactly, smoothed: {first}{more}"
        )
    lines.append(f"posed again, the mesh is off by at most {residual:.2e} of its size")
    if residual > _EXACT and not count:
        lines.append(f"warning: that is more than {_EXACT:g}")
    return lines


def joint_list(figure: Figure, joints: Sequence[int]) -> str:
    """Return the names of the first few joints, and how many more there are."""
    skeleton = figure.skeleton
    assert skeleton is not None  # the callers looked
    names = [joint_label(skeleton, joint) for joint in joints[:_LISTED]]
    return ", ".join(names) + (f" and {len(joints) - _LISTED} more" * (len(joints) > _LISTED))


def with_joint_name(line: str, figure: Figure) -> str:
    """Give joints that a line tells by number their names."""
    skeleton = figure.skeleton
    assert skeleton is not None  # it was just made
    head, mark, number = line.rpartition("joint ")
    is_joint = bool(mark) and number.isdecimal() and int(number) < skeleton.n_joints
    return head + mark + joint_label(skeleton, int(number)) if is_joint else line
