"""Figures of the SMPL family for all test folders: a made-up model, written and read back."""

from pathlib import Path

import numpy as np
from formats.synthetic_smpl import model

import viewer
from viewer.rig.figure import Figure


def family_figure(kind: str, folder: Path, n_vertices: int = 96, **changes) -> Figure:
    """Return the figure of ``synthetic_smpl.model``; an array set to None is left out."""
    arrays = {**model(kind, n_vertices), **changes}
    path = folder / f"{kind}.npz"
    np.savez(path, **{key: value for key, value in arrays.items() if value is not None})
    return viewer.load(path).actors[0].figure
