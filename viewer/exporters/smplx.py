"""Exporter for SMPL-X motions in the layout of programs that retarget human motion to robots.

::

    root_orient (N, 3)   pose_body (N, 63)   pose_hand (N, 90)   pose_jaw (N, 3)   pose_eye (N, 6)
    poses (N, 165)   trans (N, 3)   betas (16,)   num_betas   gender
    mocap_frame_rate   mocap_framerate   mocap_time_length   surface_model_type "smplx"   up

This is the layout of AMASS for SMPL-X: GMR reads ``pose_body``, ``root_orient``, ``trans``,
``betas``, ``gender`` and ``mocap_frame_rate``; PHC and related programs read ``poses``, of which
they use the first 66 columns, ``trans``, ``betas``, ``gender`` and ``mocap_framerate``. They expect
z up and one shape. ``up``, and ``present`` if frames are missing, are extensions.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, note
from viewer.exporters._exporter import Selection
from viewer.exporters._family import FamilyFrames, member_of_figure, padded
from viewer.exporters._options import ExportOptions
from viewer.exporters.amass import FEWEST, write_layout
from viewer.phrases import Remedy, counted
from viewer.rigs.arrays import Arrays
from viewer.rigs.bodies.smpl_family import FAMILY
from viewer.rigs.figure import Figure

_MEMBER = FAMILY[55]
_PARTS = {
    "root_orient": slice(0, 1),
    "pose_body": slice(1, 22),
    "pose_jaw": slice(22, 23),
    "pose_eye": slice(23, 25),
    "pose_hand": slice(25, 55),
}
"""Joints of each array, in the order of SMPL-X."""


def export(selection: Selection, path: Path, options: ExportOptions) -> list[Diagnostic]:
    """Write a motion of a body of the family, z up unless another up axis is requested."""
    animation = selection.part.animation
    wanted = replace(options, up=options.up or "z")
    notes = write_layout(animation, path, wanted, "SMPL-X", _arrays)
    if len(animation.frames.shape_weights) > 1:
        n_present = int(animation.frames.present.sum())
        notes.append(
            note(
                "X005.shape-averaged: the shape changes: betas are its average over {n}",
                n=counted(n_present, "frame"),
            )
        )
    if len(animation.figure.require_skeleton().names) != len(_MEMBER.names):
        notes.append(
            note(
                "X005.as-smplx: {figure} is not SMPL-X: translations are exact only with an SMPL-X "
                "model{remedy}",
                figure=animation.figure.name,
                remedy=Remedy(", opened before the motion", " (--model)"),
            )
        )
    return notes


def require(figure: Figure) -> None:
    """Raise RigError for a figure without the joints of an SMPL-family body."""
    member_of_figure(figure, "an SMPL-X motion", ("pelvis",))


def _arrays(body: FamilyFrames, part: slice, rate: float, up: str) -> Arrays:
    vectors = np.zeros((len(body.vectors[part]), len(_MEMBER.names), 3))
    for row, name in enumerate(body.member.names):
        if name in _MEMBER.names:  # SMPL's hand joints do not exist in SMPL-X
            vectors[:, _MEMBER.names.index(name)] = body.vectors[part, row]
    count = len(vectors)
    arrays: Arrays = {key: vectors[:, joints].reshape(count, -1) for key, joints in _PARTS.items()}
    # Filled frames repeat or blend others and must not count.
    rows = body.shape if len(body.shape) == 1 else body.shape[body.present]
    shape = padded(rows.mean(axis=0, keepdims=True), FEWEST)[0]
    return arrays | {
        "poses": vectors.reshape(count, -1),
        "trans": body.translations[part],
        "betas": shape,
        "num_betas": np.array(len(shape)),
        "gender": np.array(body.gender),
        "surface_model_type": np.array("smplx"),
        "mocap_frame_rate": np.array(float(rate)),
        "mocap_framerate": np.array(float(rate)),
        "mocap_time_length": np.array(count / rate),
        "up": np.array(up),
    }
