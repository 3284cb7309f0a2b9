"""Transfer of a rig to a mesh: align, weigh, transfer the joints, invert the pose, and check."""

from __future__ import annotations

import numpy as np

from viewer.autorig.rigged import Rigged, with_fields
from viewer.autorig.robust import robust
from viewer.autorig.seed import nearest
from viewer.autorig.settings import METHODS, Report, TransferSettings
from viewer.errors import RigError
from viewer.rig.figure import Figure
from viewer.rig.mesh import Mesh
from viewer.rig.pose import Pose
from viewer.rig.shape import shaped

__all__ = ["METHODS", "Report", "TransferSettings", "transfer"]


def transfer(
    template: Figure,
    pose: Pose,
    target: Mesh,
    settings: TransferSettings | None = None,
    report: Report | None = None,
    name: str = "rigged",
) -> Rigged:
    """Make a figure of a mesh with the rig of another.

    Parameters
    ----------
    template : Figure
        With mesh, skeleton and skin.
    pose : Pose
        Poses and shapes the template roughly like the target.
    target : Mesh
        Never altered: posed as ``Rigged.pose`` says, the figure is the target again.
    settings : TransferSettings, optional
        The robust method with its usual limits if omitted.
    report : callable, optional
        For progress; may raise to cancel.
    name : str
        Of the new figure.

    Returns
    -------
    Rigged
        Figure, pose, and what is to be known.

    Raises
    ------
    RigError
        If the template lacks a part, the target has no surface, nothing of it meets the
        template, or SciPy is missing.
    """
    how = settings or TransferSettings()
    tell = report or _silent
    if not template.is_attached:
        raise RigError(
            f"{template.name}: expected a template with mesh, skeleton and skin, found "
            f"{_parts(template)}"
        )
    if target.n_triangles == 0:
        raise RigError("expected a target with triangles, found none")
    figure = shaped(template, pose.shape_weights)
    # The shape is the mesh's own from here on.
    plain = pose.copy()
    plain.shape_weights = np.zeros(0)
    if how.method == "nearest":
        rigged = nearest(figure, plain, target, tell, name)
    else:
        rigged = robust(figure, plain, target, how, tell, name)
    tell(1.0, "done")
    return with_fields(rigged)


def _silent(fraction: float, what: str) -> None:
    """Tell nobody."""


def _parts(figure: Figure) -> str:
    parts = {"mesh": figure.mesh, "skeleton": figure.skeleton, "skin": figure.skin}
    return " and ".join(name for name, part in parts.items() if part is not None) or "none"
