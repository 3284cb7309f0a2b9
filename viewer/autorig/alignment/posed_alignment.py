"""Alignment of a template whose pose and proportions differ from the target's.

People in scans have lowered arms and individual proportions, templates have outstretched arms: no
similarity aligns one with the other. If the alignment leaves a large error, pose and proportions
are therefore fitted too: from that alignment, and from the limbs of the target (``anatomy_fit``) if
it has those of the template. The fit with the least distance between the surfaces, in both
directions, is accepted if it removes most of the error. Feet decide which way a figure faces; if
they are stumps, both facings are fitted.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.autorig.alignment.anatomy_fit import Start, left_of, starts_of, template_body
from viewer.autorig.alignment.icp import Cloud, Triangles, iterate
from viewer.autorig.alignment.orientation_search import axis_direction
from viewer.autorig.alignment.pose_fit import Fitted, fit_pose, start_of
from viewer.autorig.alignment.proportions import limbs_of, resized
from viewer.autorig.alignment.similarity import Similarity
from viewer.autorig.alignment.surface_alignment import (
    DEFAULT_UP,
    PART,
    AlignedBy,
    Alignment,
    AlignmentSettings,
    Posed,
    align,
    misfit,
)
from viewer.autorig.anatomy import anatomy_of
from viewer.autorig.surface.samples import sample_surface
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase, note, wording
from viewer.phrases import Remedy
from viewer.progress import part_of_work
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix
from viewer.rigs.geometry.vectors import Up
from viewer.rigs.mesh import Mesh, volume
from viewer.rigs.pose import Pose
from viewer.rigs.skeleton import joint_label
from viewer.rigs.skinning import deform

_CLOSE = 0.002  # ratio of misfit to size up to which joints are not rotated
# Fraction of the misfit that rotated joints may leave to be accepted: clothes fit a little better
# with a bent body, but only a figure in a different pose fits much better.
_KEPT, _PART_KEPT = 0.65, 0.5
# A misfit above the first value, after a joint was rotated by more than the second, indicates a
# different kind of figure: a fox fitted to a pig bends its spine until its legs meet some surface.
_POOR, _BENT = 0.01, np.radians(45.0)
_ROUNDS = 30  # number of iterations to align the template facing the other way
_FOUND = ("search", "in place")  # origins of alignments that were not given by the user

_FACING = Remedy("Facing", "--facing")
_CLEARLY = 0.85  # fraction of the misfit that an unusual facing must reach
_STRAIGHTER = 0.75  # ratio of bends below which the straighter start is right
_MOST_STARTS = 2  # starts from anatomy that are fitted to the surface
_NEARBY = 0.08  # ratio of the search radius to the size at the beginning of such a fit
_CLOSER = 0.03  # the same ratio for a fit to the surface only
# Strength of the points of the anatomy relative to the surface, and the fraction left at the end.
_MARKED, _FADES = 0.3, 0.1
_ALIKE = "R004.facing: front and back look alike: check the front, or specify {remedy}"


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
    with part_of_work(span=(0.0, 0.3)):
        rigid = align(ours, theirs, template.up, settings)
    kept = PosedAlignment(rigid, template, pose, posed, ())
    gap = misfit(rigid, rigid.away > PART)
    if settings.scale == "axes" or gap <= _CLOSE or not fits:
        return kept
    exact = Triangles(target.positions, triangles, settings.samples)
    dense = sample_surface(target.positions, triangles, settings.dense)
    cloud = Cloud(exact.samples, dense)
    scales = settings.scale != "none"
    job = _Job(template, pose, cloud, exact, scales, settings)
    starts: list[Start] = []
    if rigid.how in _FOUND and scales:
        with part_of_work(span=(0.3, 0.45)):
            starts = _starts(job, ours, theirs)
    return _best(job, ours, kept, starts)


def _starts(job: _Job, ours: Posed, theirs: Posed) -> list[Start]:
    """Return the starts from anatomy, none if template or target has no two pairs of limbs."""
    with part_of_work(span=(0.0, 0.4)):
        body = template_body(job.template, job.pose, ours.positions)
    if body is None:
        return []
    settings = job.settings
    up = axis_direction(settings.up or DEFAULT_UP)
    front = None if settings.facing is None else axis_direction(settings.facing)
    lateral = None if front is None else np.cross(up, front)
    with part_of_work(span=(0.4, 0.8)):
        target = anatomy_of(theirs.positions, theirs.triangles, up, lateral)
    with part_of_work(span=(0.8, 1.0)):
        return starts_of(body, target, front)


def _best(job: _Job, ours: Posed, kept: PosedAlignment, starts: list[Start]) -> PosedAlignment:
    """Return the closest of all fits if it removes most of the error."""
    rigid = kept.alignment
    fits = _fits_of_limbs(job, starts)
    # Only a whole figure has all limbs of the template where they should be.
    whole = [(start, fit) for start, fit in fits if fit.alignment.away <= PART]
    is_part = rigid.away > PART and not whole
    before = misfit(rigid, is_part)
    best: PosedAlignment | None = None
    if whole:
        start, best = min(whole, key=lambda each: _doubtful_misfit(*each))
        after = misfit(best.alignment, False)
        lines = [*best.lines, note(wording.GAP, gap=_gap(after, before))]
        if not start.is_sure:
            lines.append(note(_ALIKE, remedy=_FACING))
        best = replace(best, lines=tuple(lines))
    with part_of_work(span=(0.8, 1.0)):
        found = _fitted(job, _facing(job, ours, rigid, starts))
    other = _if_better(kept, found, before, is_part)
    if best is None:
        return other
    # A figure of another kind can be squeezed into any surface: its limbs count more.
    limit = misfit(best.alignment, False)
    limit = limit if limit <= _POOR else _CLEARLY * limit
    return other if misfit(other.alignment, False) < limit else best


def _fits_of_limbs(job: _Job, starts: list[Start]) -> list[tuple[Start, PosedAlignment]]:
    """Fit the starts that face the usual way, and the best one also facing the other way."""
    usual = [start for start in starts if start.is_sure or start.is_usual] or starts
    # To make arms of ears, trunk and legs must bend, too.
    least = min((start.bend for start in usual), default=0.0)
    usual = [start for start in usual if _STRAIGHTER * start.bend <= least]
    found = []
    for number, start in enumerate(usual[:_MOST_STARTS]):
        with part_of_work(span=(0.45 + 0.12 * number, 0.57 + 0.12 * number)):
            found.append((start, _fitted_limbs(job, start)))
    if found:
        best = min(found, key=lambda each: _doubtful_misfit(*each))[0].plan
        same = {id(best.lower), id(best.upper)}
        for start in starts:
            if start not in usual and {id(start.plan.lower), id(start.plan.upper)} == same:
                with part_of_work(span=(0.69, 0.8)):
                    found.append((start, _fitted_limbs(job, start)))
    return found


def _doubtful_misfit(start: Start, fit: PosedAlignment) -> float:
    """Return the misfit, larger for an unusual facing that feet do not show."""
    gap = misfit(fit.alignment, False)
    return gap if start.is_sure or start.is_usual else gap / _CLEARLY


def _facing(job: _Job, ours: Posed, rigid: Alignment, starts: list[Start]) -> Alignment:
    """Return the alignment, reversed if all starts from anatomy face the other way."""
    if rigid.how not in _FOUND or rigid.away > PART or not starts:
        return rigid
    # Columns of the rotations: the template's left and the starts' left in the target.
    left = rigid.similarity.rotation @ left_of(job.template, job.pose)
    if all(float(left @ start.plan.left) < 0.0 for start in starts):
        return _facing_back(job, ours, rigid, job.template.up)
    return rigid


def _fitted_limbs(job: _Job, start: Start) -> PosedAlignment:
    """Fit a template to the surface whose limbs are already where the target's are."""
    marks = replace(start.marks, strength=_MARKED)
    state = fit_pose(
        start.marked, start.fitted, job.cloud, job.exact, True, marks, _NEARBY, fades=_FADES
    )
    figure = resized(job.template, limbs_of(job.template), *np.exp(state.grown))
    state = replace(state, figure=figure)
    found = _result(job, state, "fit")
    if misfit(found.alignment, False) > _POOR:
        return found
    # The surface of a similar figure is a better guide to its joints than the anatomy.
    state = fit_pose(job.template, state, job.exact, job.exact, True, reach=_CLOSER)
    return _result(job, state, "fit")


def _if_better(
    kept: PosedAlignment, found: PosedAlignment, before: float, is_part: bool
) -> PosedAlignment:
    """Return the fitted template if it removes most of the error, the unchanged one otherwise."""
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
    scales = job.scales and start.away <= PART
    begun = start_of(template, job.pose, start.similarity)
    found = fit_pose(template, begun, job.cloud, job.exact, scales)
    return _result(job, found, start.how if start.how == "landmarks" else "fit")


def _result(job: _Job, found: Fitted, how: AlignedBy) -> PosedAlignment:
    posed = deform(found.figure, found.pose)[0]
    ours = Triangles(posed, job.template.require_mesh().triangles, job.settings.samples)
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
