"""Computations of the Rig panel's jobs, independent of the state of the window."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from viewer.app.rigging.state import Placing, RigChoices, Template
from viewer.autorig.alignment.posed_alignment import align_posed
from viewer.autorig.alignment.similarity import Similarity
from viewer.autorig.alignment.surface_alignment import AlignmentSettings, alignment_lines
from viewer.autorig.correspondence.matching import MatchSettings, match
from viewer.autorig.correspondence.matching import Template as Surface
from viewer.autorig.rigged import Rigged
from viewer.autorig.settings import TransferSettings
from viewer.autorig.surface.welding import weld
from viewer.autorig.weights.weight_transfer import WeightSettings
from viewer.rig.annotations import VertexField
from viewer.rig.mesh import Mesh, bounding_box, box_size
from viewer.rig.pose import pose_key
from viewer.rig.shape import shaped
from viewer.rig.skinning import deform

__all__ = [
    "align_template",
    "match_fields",
    "match_settings",
    "transfer_settings",
    "with_known_method",
]

_Progress = Callable[[float, str], None]


def align_template(
    template: Template,
    own: Template,
    target: Mesh,
    settings: AlignmentSettings,
    fits: bool,
    progress: _Progress,
) -> Placing:
    """Align a template with a target.

    Parameters
    ----------
    template : Template
        Template in its initial pose.
    own : Template
        Template before any fit.
    target : Mesh
        Mesh with which to align it.
    settings : AlignmentSettings
        Settings of the alignment.
    fits : bool
        Whether joints may be rotated and limbs resized.
    progress : callable
        Called with the fraction done and the name of the current step; may raise to cancel.

    Raises
    ------
    RigError
        As for ``align``.
    """
    plain = template.pose.copy()
    plain.shape_weights = np.zeros(0)  # the shape is now part of the figure
    figure = shaped(template.figure, template.pose.shape_weights)
    found = align_posed(figure, plain, target, settings, fits, progress)
    is_other = template.figure is not own.figure or pose_key(template.pose) != pose_key(own.pose)
    is_fitted = is_other or bool(found.lines)
    return Placing(
        similarity=found.alignment.similarity,
        alignment=found.alignment,
        settings=settings,
        fitted=replace(template, figure=found.figure, pose=found.pose) if is_fitted else None,
        lines=found.lines,
        meshes=(target, own.figure),
        pose=pose_key(own.pose),
    )


def with_known_method(rigged: Rigged, placing: Placing | None) -> Rigged:
    """Return a result whose report names the alignment method, if the alignment was given.

    Parameters
    ----------
    rigged : Rigged
        Result of the transfer.
    placing : Placing or None
        Placement that was passed to the transfer; None if there was none.
    """
    known = placing.alignment if placing is not None else None
    if placing is None or known is None or rigged.alignment is None:
        return rigged
    if rigged.alignment.how != "given":
        return rigged  # the transfer has aligned the template itself
    known_alignment = replace(rigged.alignment, how=known.how)
    rest = rigged.lines[len(alignment_lines(rigged.alignment)) :]
    lines = (*alignment_lines(known_alignment), *placing.lines, *rest)
    return replace(rigged, alignment=known_alignment, lines=lines)


def match_fields(
    template: Template, similarity: Similarity, mesh: Mesh, settings: MatchSettings
) -> tuple[tuple[VertexField, ...], float]:
    """Find the vertices of a target that match an aligned template.

    Parameters
    ----------
    template : Template
        Template in its current pose.
    similarity : Similarity
        Transform from template to target.
    mesh : Mesh
        Mesh of the target.
    settings : MatchSettings
        Conditions for a match.

    Returns
    -------
    fields : tuple of VertexField
        Matched or not, distance, and angle in degrees, of each vertex.
    fraction : float
        Fraction of the vertices that match.
    """
    assert template.figure.mesh is not None  # templates have meshes
    posed = similarity.apply(deform(template.figure, template.pose)[0])
    welded = weld(mesh.positions, mesh.triangles)
    size = box_size(bounding_box(mesh.positions))
    surface = Surface(posed, template.figure.mesh.triangles)
    found = match(surface, welded, size, settings)
    matched, rows = found.matched[welded.vertices], welded.vertices
    distances, angles = found.points.distances[rows], np.degrees(found.angles[rows])
    # In the order of CONFIDENCE, so that matched vertices have the same colour in both maps.
    classes = ("matched", "unmatched")
    fields = (
        VertexField("match", "Match with the template", (~matched).astype(float), names=classes),
        VertexField("match distance", "Distance to the template", distances, "length"),
        VertexField("match angle", "Angle to the template", angles, "degrees"),
    )
    return fields, float(matched.mean())


def match_settings(choices: RigChoices) -> MatchSettings:
    """Return the conditions for a match that are set in the panel."""
    angle, usual = math.radians(choices.max_angle), MatchSettings()
    return MatchSettings(
        max_distance=choices.max_distance, max_angle=angle, near_angle=max(angle, usual.near_angle)
    )


def transfer_settings(
    choices: RigChoices, method: str, placing: Placing | None
) -> TransferSettings:
    """Return the settings to transfer the rig of a template from its current placement.

    Parameters
    ----------
    choices : RigChoices
        Settings of the panel.
    method : str
        A key of ``METHODS``.
    placing : Placing or None
        Placement of the template; None for a method that needs none.
    """
    alignment = AlignmentSettings()
    if placing is not None:
        alignment = AlignmentSettings(matrix=placing.similarity.matrix)
    return TransferSettings(
        method=method,
        alignment=alignment,
        weights=WeightSettings(
            match=match_settings(choices),
            smoothing_rounds=choices.smoothing,
            max_influences=choices.max_influences or None,
        ),
        joints=choices.joints,
        fits=False,  # the template was fitted during the alignment
        correctives=choices.correctives,
    )
