"""What the Rig panel's threads compute: no state of the window, only figures and numbers."""

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

__all__ = ["align_template", "match_fields", "match_settings", "retold", "transfer_settings"]

_Tell = Callable[[float, str], None]


def align_template(
    template: Template,
    own: Template,
    target: Mesh,
    settings: AlignmentSettings,
    fits: bool,
    tell: _Tell,
) -> Placing:
    """Lay a template onto a target.

    Parameters
    ----------
    template : Template
        In the pose to begin with.
    own : Template
        In the pose that is its own.
    target : Mesh
        What it is laid onto.
    settings : AlignmentSettings
        How.
    fits : bool
        Whether its joints may be turned and its limbs resized.
    tell : callable
        Told the share that is done, and what is being done; may raise to cancel.

    Raises
    ------
    RigError
        As ``align``.
    """
    plain = template.pose.copy()
    plain.shape_weights = np.zeros(0)  # the shape is the mesh's own from here on
    figure = shaped(template.figure, template.pose.shape_weights)
    found = align_posed(figure, plain, target, settings, fits, tell)
    is_other = template.figure is not own.figure or pose_key(template.pose) != pose_key(own.pose)
    is_fitted = is_other or bool(found.lines)
    return Placing(
        similarity=found.alignment.placed,
        alignment=found.alignment,
        settings=settings,
        fitted=replace(template, figure=found.figure, pose=found.pose) if is_fitted else None,
        lines=found.lines,
        meshes=(target, own.figure),
        pose=pose_key(own.pose),
    )


def retold(rigged: Rigged, placing: Placing | None) -> Rigged:
    """Let a report say how its alignment was found: the transfer only knows where it was given.

    Parameters
    ----------
    rigged : Rigged
        What the transfer made.
    placing : Placing or None
        Where it was told that the template lies; None if it was told nothing.
    """
    known = placing.alignment if placing is not None else None
    if placing is None or known is None or rigged.alignment is None:
        return rigged
    if rigged.alignment.how != "given":
        return rigged  # it was found anew
    told = replace(rigged.alignment, how=known.how)
    rest = rigged.lines[len(alignment_lines(rigged.alignment)) :]
    lines = (*alignment_lines(told), *placing.lines, *rest)
    return replace(rigged, alignment=told, lines=lines)


def match_fields(
    template: Template, similarity: Similarity, mesh: Mesh, settings: MatchSettings
) -> tuple[tuple[VertexField, ...], float]:
    """Return where a target meets a template that lies on it.

    Parameters
    ----------
    template : Template
        As it is posed there.
    similarity : Similarity
        Template to target.
    mesh : Mesh
        The target.
    settings : MatchSettings
        When a vertex matches.

    Returns
    -------
    fields : tuple of VertexField
        Matched or not, distance, and angle in degrees, of each vertex.
    share : float
        Of the vertices that match.
    """
    assert template.figure.mesh is not None  # it is attached
    posed = similarity.apply(deform(template.figure, template.pose)[0])
    welded = weld(mesh.positions, mesh.triangles)
    size = box_size(bounding_box(mesh.positions))
    surface = Surface(posed, template.figure.mesh.triangles)
    found = match(surface, welded, size, settings)
    matched, rows = found.matched[welded.vertices], welded.vertices
    distances, angles = found.points.distances[rows], np.degrees(found.angles[rows])
    # In the order of CONFIDENCE, so that both maps have one colour for what is matched.
    classes = ("matched", "unmatched")
    fields = (
        VertexField("match", "Match with the template", (~matched).astype(float), names=classes),
        VertexField("match distance", "Distance to the template", distances, "length"),
        VertexField("match angle", "Angle to the template", angles, "degrees"),
    )
    return fields, float(matched.mean())


def match_settings(choices: RigChoices) -> MatchSettings:
    """Return when a vertex matches, as the panel says."""
    angle, usual = math.radians(choices.max_angle), MatchSettings()
    return MatchSettings(
        max_distance=choices.max_distance, max_angle=angle, near_angle=max(angle, usual.near_angle)
    )


def transfer_settings(
    choices: RigChoices, method: str, placing: Placing | None
) -> TransferSettings:
    """Return how a rig is carried over from a template that lies where it was laid.

    Parameters
    ----------
    choices : RigChoices
        What the panel says.
    method : str
        A key of ``METHODS``.
    placing : Placing or None
        Where the template lies; None for a method that does not ask.
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
        fits=False,  # it was fitted when it was laid there
        correctives=choices.correctives,
    )
