"""Alignment of a template whose pose and proportions differ from the target's.

People in scans have lowered arms and individual proportions, templates have outstretched arms: no
similarity aligns one with the other. If the alignment leaves a large error, pose and proportions
are therefore fitted too, and the fit is accepted if it removes most of the error. A figure in a
different pose also looks nearly the same from behind: if the alignment is ambiguous, both facings
are fitted.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.autorig.alignment.axes_fit import fit_axes
from viewer.autorig.alignment.icp import Cloud, Triangles, iterate
from viewer.autorig.alignment.orientation_search import axis_direction
from viewer.autorig.alignment.pose_fit import Fitted, fit_pose
from viewer.autorig.alignment.similarity import Similarity
from viewer.autorig.alignment.surface_alignment import (
    PART,
    Alignment,
    AlignmentSettings,
    Posed,
    align,
    misfit,
)
from viewer.autorig.surface.samples import sample_surface
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase, note, wording
from viewer.phrases import Remedy, rounded
from viewer.progress import part_of_work, report_fraction
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.geometry.rotation import rotation_vector_to_matrix
from viewer.rig.geometry.vectors import Up
from viewer.rig.mesh import Mesh, volume
from viewer.rig.pose import Pose
from viewer.rig.skeleton import joint_label
from viewer.rig.skinning import deform

_CLOSE = 0.002  # ratio of misfit to size up to which joints are not rotated
# Fraction of the misfit that rotated joints may leave to be accepted: clothes fit a little better
# with a bent body, but only a figure in a different pose fits much better.
_KEPT, _PART_KEPT = 0.65, 0.5
# A misfit above the first value, after a joint was rotated by more than the second, indicates a
# different kind of figure: a fox fitted to a pig bends its spine until its legs meet some surface.
_POOR, _BENT = 0.01, np.radians(45.0)
_SURE = 0.004  # ratio of misfit after the fit to size up to which the opposite facing is not tried
_ALIKE = 1.5  # ratio of misfits up to which front and back are ambiguous
_CLEARLY = 0.85  # fraction of the misfit that the opposite facing must reach after the fit
_ROUNDS = 30  # number of iterations to align the template facing the other way
_AXES_ROUNDS = 20
_FOUND = ("search", "in place")  # origins of alignments that were not given by the user
# Separate scales are tried if the error exceeds the first value, and accepted if they reduce it to
# at most the second fraction and differ by more than the third value.
_STRETCH_GAP, _STRETCH_LEFT, _STRETCH = 0.001, 0.5, 1.02


@dataclass(frozen=True, slots=True, eq=False)
class PosedAlignment:
    """Alignment, pose and proportions of a template."""

    alignment: Alignment
    """Alignment of the template in ``pose``."""
    figure: Figure
    """The template, with scaled limbs if needed."""
    pose: Pose
    """The given pose of the template, or the fitted pose."""
    positions: Floats
    """(V, 3). The template's vertices in that pose, in the template's frame."""
    lines: tuple[Diagnostic, ...]
    """Messages about changes to pose and proportions, and about better options."""
    most_rotated: tuple[float, str] = (0.0, "")
    """The largest joint rotation in radians, and the joint's name; (0, "") if none."""


@dataclass(frozen=True, slots=True, eq=False)
class _Job:
    """Inputs common to all fits."""

    template: Figure
    pose: Pose
    cloud: Cloud
    exact: Triangles
    scales: bool
    settings: AlignmentSettings


def align_posed(
    template: Figure,
    pose: Pose,
    target: Mesh,
    settings: AlignmentSettings,
    fits: bool,
) -> PosedAlignment:
    """Align a template with a target, rotating its joints if its pose differs.

    With a separate scale per axis, nothing is fitted; with a known scale, only the pose is fitted.
    Returns an alignment of the unchanged template, unless a fitted template is much better.
    """
    posed = deform(template, pose)[0]
    ours = Posed(posed, template.require_mesh().triangles)
    triangles = target.triangles
    if volume(target.positions, triangles) < 0.0:
        triangles = triangles[:, ::-1]  # outward normals distinguish the two sides of a limb
    theirs = Posed(target.positions, triangles)
    with part_of_work(span=(0.0, 0.5)):
        rigid = align(ours, theirs, template.up, settings)
    kept = PosedAlignment(rigid, template, pose, posed, ())
    is_part = rigid.away > PART
    gap = misfit(rigid, is_part)
    if settings.scale == "axes" or gap <= min(_CLOSE, _STRETCH_GAP):
        return kept
    exact = Triangles(target.positions, triangles, settings.samples)
    stretched = None
    if settings.scale == "uniform" and rigid.how in _FOUND and not is_part:
        report_fraction(0.5, "proportions")
        stretched = _stretched(ours, exact, kept, settings.samples)
        if fits and stretched is not None and misfit(stretched.alignment, False) <= _STRETCH_GAP:
            return stretched
    if fits and gap > _CLOSE:
        dense = sample_surface(target.positions, triangles, settings.dense)
        scales = settings.scale != "none" and not is_part
        job = _Job(template, pose, Cloud(exact.samples, dense), exact, scales, settings)
        kept = _if_better(job, ours, kept)
    if stretched is None or not _is_closer(stretched, kept):
        return kept
    return stretched if fits else replace(kept, lines=(_advice(stretched, kept),))


def _if_better(
    job: _Job,
    ours: Posed,
    kept: PosedAlignment,
) -> PosedAlignment:
    """Return the template with fitted pose and proportions if these remove most of the error."""
    rigid = kept.alignment
    is_part = rigid.away > PART
    before = misfit(rigid, is_part)
    with part_of_work(span=(0.5, 0.75)):
        found = _fitted(job, rigid)
    may_face_back = rigid.how in _FOUND and job.settings.facing is None and not is_part
    if may_face_back and misfit(found.alignment, False) > _SURE:
        behind = _facing_back(job, ours, rigid, job.template.up)
        if misfit(behind, False) < _ALIKE * before:
            with part_of_work(span=(0.75, 1.0)):
                other = _fitted(job, behind)
            if misfit(other.alignment, False) < _CLEARLY * misfit(found.alignment, False):
                found = other
    after = misfit(found.alignment, is_part)
    bent, name = found.most_rotated
    gap = {"gap": _gap(after, before)}
    if after > (_PART_KEPT if is_part else _KEPT) * before:
        return replace(
            kept,
            lines=(note("R003.not-fitted: pose: not fitted, because {gap} would remain", **gap),),
        )
    if after <= _POOR:
        return replace(found, lines=(*found.lines, note(wording.GAP, **gap)))
    if bent > _BENT:
        values = {**gap, "joint": name, "angle": float(np.degrees(bent))}
        return replace(
            kept,
            lines=(
                note(
                    "R004.not-fitted: pose: not fitted, because {joint} would rotate by "
                    "{angle:.0f} "
                    "degrees and {gap} would remain; use a template of the same kind as the target",
                    **values,
                ),
            ),
        )
    return replace(
        found,
        lines=(
            *found.lines,
            note(
                "R004.gap: poor fit: {gap}; use a template of the same kind as the target",
                **gap,
            ),
        ),
    )


def _fitted(job: _Job, start: Alignment) -> PosedAlignment:
    template = job.template
    found = fit_pose(template, job.pose, start.similarity, job.cloud, job.exact, job.scales)
    posed = deform(found.figure, found.pose)[0]
    ours = Triangles(posed, template.require_mesh().triangles, job.settings.samples)
    how = start.how if start.how == "landmarks" else "fit"
    alignment = Alignment.of(ours, job.exact, found.similarity, how)
    return PosedAlignment(
        alignment, found.figure, found.pose, posed, _lines(found), _most_rotated(found)
    )


def _facing_back(job: _Job, ours: Posed, rigid: Alignment, up: Up) -> Alignment:
    """Return the template facing the other way, aligned with the target as well as possible."""
    similarity = rigid.similarity
    half = rotation_vector_to_matrix(np.pi * axis_direction(up))
    middle = similarity.apply(ours.positions.mean(axis=0))
    rotation = similarity.rotation @ half
    shift = middle - similarity.scale * rotation @ ours.positions.mean(axis=0)
    exact = Triangles(ours.positions, ours.triangles, job.settings.samples)
    dense = sample_surface(ours.positions, ours.triangles, job.settings.dense)
    cloud = Cloud(exact.samples, dense)
    start = Similarity(similarity.scale, rotation, shift, similarity.factors)
    return Alignment.of(
        exact, job.exact, iterate(cloud, job.cloud, start, _ROUNDS, job.scales), "search"
    )


def _stretched(
    ours: Posed, exact: Triangles, kept: PosedAlignment, samples: int
) -> PosedAlignment | None:
    """Return the template with separate scales per axis, if that removes most of the error."""
    rigid = kept.alignment
    template = Triangles(ours.positions, ours.triangles, samples)
    trials = [
        fit_axes(template, exact, rigid.similarity, _AXES_ROUNDS, rotations=True, own=own)
        for own in (False, True)
    ]
    alignments = [
        Alignment.of(template, exact, similarity, "fit")
        for similarity in trials
        if _stretch(similarity) >= _STRETCH
    ]
    if not alignments:
        return None
    # If both have the same axes, use the target's, to which --scale axes refers.
    alignment, *other = alignments
    if other and misfit(other[0], False) < _CLEARLY * misfit(alignment, False):
        alignment = other[0]
    after, before = misfit(alignment, False), misfit(rigid, False)
    found = replace(
        kept,
        alignment=alignment,
        lines=(
            note(
                "R003.proportions: proportions: template stretched by {scales}, pose kept",
                scales=_scales(alignment.similarity),
            ),
            note(wording.GAP, gap=_gap(after, before)),
        ),
    )
    return found if _is_closer(found, kept) else None


def _is_closer(stretched: PosedAlignment, other: PosedAlignment) -> bool:
    """Return whether a stretched template leaves a much smaller error than the other alignment."""
    gap = misfit(stretched.alignment, False)
    return gap <= _STRETCH_LEFT * misfit(other.alignment, False)


def _advice(stretched: PosedAlignment, kept: PosedAlignment) -> Diagnostic:
    """Return a message saying that a stretched template would fit better."""
    gap, other = (100.0 * misfit(one.alignment, False) for one in (stretched, kept))
    similarity = stretched.alignment.similarity
    is_own = (similarity.factors == 1.0).all()
    key = (
        "R004.stretched-along-its-axes: the template fits much better if stretched by "
        "{scales} ({gap:.2f} % of the size apart instead of {kept:.2f} %): fit proportions "
        "if the target was stretched"
        if is_own
        else "R004.stretched-along-the-target: the template fits much better if stretched by "
        "{scales} ({gap:.2f} % of the size apart instead of {kept:.2f} %): use {remedy} if "
        "the target was stretched"
    )
    return note(
        key,
        scales=_scales(similarity),
        gap=gap,
        kept=other,
        remedy=Remedy("another Scale", "--scale axes"),
    )


def _stretch(similarity: Similarity) -> float:
    factors = similarity.factors * similarity.own_factors
    return float(factors.max() / factors.min())


def _scales(similarity: Similarity) -> Phrase:
    """Return the scales along the axes of the template or the target."""
    is_own = bool((similarity.factors == 1.0).all())
    scales = similarity.scale * (similarity.own_factors if is_own else similarity.factors)
    x, y, z = scales.tolist()
    key = (
        "{x}, {y}, {z} along its own x, y and z"
        if is_own
        else "{x}, {y}, {z} along the target's x, y and z"
    )
    return Phrase(key, x=rounded(x, 4), y=rounded(y, 4), z=rounded(z, 4))


def _gap(after: float, before: float) -> Phrase:
    """Return the fitting errors after and before a fit as text."""
    return Phrase(
        "a gap of {after:.2f} % of the size ({before:.2f} % before)",
        after=100.0 * after,
        before=100.0 * before,
    )


def _lines(found: Fitted) -> tuple[Diagnostic, ...]:
    """Return messages about the joint rotated most and the limb scaled most."""
    skeleton = found.figure.skeleton
    assert skeleton is not None  # the caller checks this
    angle, name = _most_rotated(found)
    longest = int(np.abs(found.grown[0]).argmax())
    values = {
        "joint": name,
        "angle": float(np.degrees(angle)),
        "limb": joint_label(skeleton, longest),
        "change": 100.0 * float(np.expm1(found.grown[0, longest])),
    }
    return (
        note(
            "R003.pose: pose: template joints rotated to fit, by up to {angle:.0f} degrees "
            "({joint}); limb lengths changed by up to {change:+z.0f} % ({limb})",
            **values,
        ),
    )


def _most_rotated(found: Fitted) -> tuple[float, str]:
    """Return the largest rotation of a joint in radians, and the joint's name."""
    skeleton = found.figure.require_skeleton()
    angles = np.linalg.norm(found.rotated, axis=1)
    most = int(angles.argmax())
    return float(angles[most]), joint_label(skeleton, most)
