"""Pipeline of a rig transfer: align, transfer weights and joints, invert the pose, and check."""

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
    """Rig a mesh with the rig of another figure.

    Parameters
    ----------
    template : Figure
        Figure with mesh, skeleton and skin.
    pose : Pose
        Pose and shape of the template, approximately those of the target.
    target : Mesh
        Mesh to rig, not modified; the new figure, posed by ``Rigged.pose``, reproduces it.
    settings : TransferSettings, optional
        Settings; the robust method with its default limits if omitted.
    report : callable, optional
        Called with progress; may raise to cancel.
    name : str
        Name of the new figure.

    Returns
    -------
    Rigged
        Figure, pose, and facts about the transfer.

    Raises
    ------
    RigError
        If the template lacks a part, the target has no surface, no part of it meets the
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
    # The shape has become part of the mesh.
    plain = pose.copy()
    plain.shape_weights = np.zeros(0)
    if how.method == "nearest":
        rigged = nearest(figure, plain, target, tell, name)
    else:
        rigged = robust(figure, plain, target, how, tell, name)
    tell(1.0, "done")
    return with_fields(rigged)


def _silent(fraction: float, what: str) -> None:
    """Ignore progress."""


def _parts(figure: Figure) -> str:
    parts = {"mesh": figure.mesh, "skeleton": figure.skeleton, "skin": figure.skin}
    return " and ".join(name for name, part in parts.items() if part is not None) or "none"
