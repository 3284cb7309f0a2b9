"""Interpolation between linear blend and dual quaternion skinning by a blend factor."""

from __future__ import annotations

import numpy as np

from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.vectors import inverse_transposed, unit
from viewer.rigs.skin import Skin, skin_rows
from viewer.rigs.skinning import dqs, lbs
from viewer.rigs.skinning.lbs import rigid_vertices


def deform(
    positions: Floats,
    normals: Floats,
    skin: Skin,
    palette: Floats,
    blend_factor: float | None = 0.5,
) -> tuple[Floats, Floats]:
    """Interpolate each vertex: (1 - blend_factor) LBS + blend_factor DQS.

    None stands for the fractions of the skin at each vertex. Where joints scale or shear, normals
    use the inverse transpose of the interpolated linear maps.
    """
    factor: Floats | float
    if blend_factor is not None:
        factor = float(blend_factor)
    elif skin.dqs_fractions is None:
        factor = 0.0
    else:
        factor = skin.dqs_fractions[:, None]
    linear = lbs.deform(positions, normals, skin, palette)
    dual = dqs.deform(positions, normals, skin, palette)
    moved, rotated = ((1.0 - factor) * a + factor * b for a, b in zip(linear, dual, strict=True))
    affine = np.flatnonzero(~rigid_vertices(skin, palette)).astype(np.int32)
    if len(affine):
        # Interpolated normals would not be perpendicular to the interpolated surface.
        own = skin_rows(skin, affine)
        of_maps = factor if isinstance(factor, float) else factor[affine, :, None]
        maps = (1.0 - of_maps) * lbs.blended_matrices(own, palette)[:, :, :3]
        maps += of_maps * dqs.linear_maps(own, palette)
        rotated[affine] = inverse_transposed(np.moveaxis(maps, 0, -1), normals[affine])
    return moved, unit(rotated)
