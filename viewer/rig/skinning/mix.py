"""A mixture of linear blend and dual quaternion skinning: between the two by a share."""

from __future__ import annotations

from viewer.rig.arrays import Floats
from viewer.rig.geometry.vectors import unit
from viewer.rig.skin import Skin
from viewer.rig.skinning import dqs, lbs

__all__ = ["deform"]


def deform(
    positions: Floats, normals: Floats, skin: Skin, palette: Floats, share: float = 0.5
) -> tuple[Floats, Floats]:
    """Return (1 - share) LBS + share DQS, vertex by vertex.

    Parameters
    ----------
    positions, normals : (V, 3)
        Binding space.
    skin : Skin
        Of V vertices.
    palette : (J, 4, 4)
        Skinning matrices, bind to posed.
    share : float
        0 for LBS alone, 1 for DQS alone.

    Returns
    -------
    positions : (V, 3)
        Figure units.
    normals : (V, 3)
        Unit length.
    """
    linear = lbs.deform(positions, normals, skin, palette)
    dual = dqs.deform(positions, normals, skin, palette)
    moved, turned = ((1.0 - share) * a + share * b for a, b in zip(linear, dual, strict=True))
    return moved, unit(turned)
