"""A template laid onto a target, its joints turned and limbs resized to what the target is.

People in scans stand with lowered arms and have limbs of their own, templates stretch their arms
out: no alignment of the whole lays one onto the other. So where the alignment leaves a gap, pose
and proportions are fitted too, and kept if that closes most of it. A figure that stands otherwise
also looks much the same from behind: where the alignment cannot tell, both ways are fitted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

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
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.geometry.rotation import rotation_vector_to_matrix
from viewer.rig.mesh import Mesh, volume
from viewer.rig.number_text import number_text
from viewer.rig.pose import Pose
from viewer.rig.skeleton import joint_label
from viewer.rig.skinning import deform

__all__ = ["PosedAlignment", "align_posed"]

_CLOSE = 0.002  # misfit over size up to which nothing is gained by turning joints
# Share of the misfit that may be left if turned joints are to be kept: clothes can be fitted a
# little better by bending the body, but only a figure in another pose much better.
_KEPT, _PART_KEPT = 0.65, 0.5
# A fit that leaves more than this and turned a joint by more is of another kind of figure, as of a
# fox onto a pig: it bends the spine until the legs meet something.
_POOR, _BENT = 0.01, np.radians(45.0)
_SURE = 0.004  # misfit after the fit up to which a figure faces the right way: no other is tried
_ALIKE = 1.5  # misfits nearer than this do not tell front from back
_CLEARLY = 0.85  # of the misfit, which standing the other way must reach after the fit
_ROUNDS = 30  # to lay the template the other way round
_AXES_ROUNDS = 20
_FOUND = ("search", "in place")  # alignments that nobody vouches for
# Scales of their own are looked at where a gap above the first is left, and taken if they leave at
# most the second of it and differ by more than the third.
_STRETCH_GAP, _STRETCH_LEFT, _STRETCH = 0.001, 0.5, 1.02


@dataclass(frozen=True, slots=True, eq=False)
class PosedAlignment:
    """Where the template lies, and how it is made to fit.

    Attributes
    ----------
    alignment : Alignment
        Of the template in ``pose``.
    figure : Figure
        The template, its limbs resized if that was needed.
    pose : Pose
        The template's own, or fitted.
    positions : (V, 3)
        The template's vertices in that pose, in its own frame.
    lines : tuple of str
        What was done to pose and proportions, and what would fit better.
    most_turned : (float, str)
        The largest turn of a joint in radians, and its name; (0, "") if none was turned.
    """

    alignment: Alignment
    figure: Figure
    pose: Pose
    positions: Floats
    lines: tuple[str, ...]
    most_turned: tuple[float, str] = (0.0, "")


@dataclass(frozen=True, slots=True, eq=False)
class _Job:
    """What every fit needs to know."""

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
    report: Callable[[float, str], None],
) -> PosedAlignment:
    """Lay a template onto a target, and turn its joints if it stands otherwise.

    Parameters
    ----------
    template : Figure
        With mesh, skeleton and skin, already shaped.
    pose : Pose
        Of the template, without shape weights.
    target : Mesh
        With triangles.
    settings : AlignmentSettings
        What is known of how they lie. Where each axis has a scale of its own nothing is fitted,
        where the scale is known only the pose.
    fits : bool
        Whether pose and proportions may change.
    report : callable
        Told the share that is done, and what is being done; may raise to cancel.

    Returns
    -------
    PosedAlignment
        The template as it was given, where a fitted one is not much better.

    Raises
    ------
    RigError
        As ``align``.
    """
    assert template.mesh is not None  # the caller looked
    posed = deform(template, pose)[0]
    ours = Posed(posed, template.mesh.triangles)
    triangles = target.triangles
    if volume(target.positions, triangles) < 0.0:
        triangles = triangles[:, ::-1]  # normals tell which side of a limb is which
    theirs = Posed(target.positions, triangles)
    rigid = align(ours, theirs, template.up, settings, lambda s, what: report(0.5 * s, what))
    kept = PosedAlignment(rigid, template, pose, posed, ())
    is_part = rigid.away > PART
    gap = misfit(rigid, is_part)
    if settings.scale == "axes" or gap <= min(_CLOSE, _STRETCH_GAP):
        return kept
    exact = Triangles(target.positions, triangles, settings.samples)
    stretched = None
    if settings.scale == "uniform" and rigid.how in _FOUND and not is_part:
        report(0.5, "proportions")
        stretched = _stretched(ours, exact, kept, settings.samples)
        if fits and stretched is not None and misfit(stretched.alignment, False) <= _STRETCH_GAP:
            return stretched
    if fits and gap > _CLOSE:
        dense = sample_surface(target.positions, triangles, settings.dense)
        scales = settings.scale != "none" and not is_part
        job = _Job(template, pose, Cloud(exact.samples, dense), exact, scales, settings)
        kept = _if_better(job, ours, kept, report)
    if stretched is None or not _is_closer(stretched, kept):
        return kept
    return stretched if fits else replace(kept, lines=(_advice(stretched, kept),))


def _if_better(
    job: _Job,
    ours: Posed,
    kept: PosedAlignment,
    report: Callable[[float, str], None],
) -> PosedAlignment:
    """Return the template with fitted pose and proportions if these close most of the gap."""
    rigid = kept.alignment
    is_part = rigid.away > PART
    before = misfit(rigid, is_part)
    found = _fitted(job, rigid, lambda share: report(0.5 + 0.25 * share, "pose"))
    may_turn = rigid.how in _FOUND and job.settings.facing is None and not is_part
    if may_turn and misfit(found.alignment, False) > _SURE:
        behind = _turned_round(job, ours, rigid, job.template.up)
        if misfit(behind, False) < _ALIKE * before:
            other = _fitted(job, behind, lambda share: report(0.75 + 0.25 * share, "pose"))
            if misfit(other.alignment, False) < _CLEARLY * misfit(found.alignment, False):
                found = other
    after = misfit(found.alignment, is_part)
    bent, name = found.most_turned
    gaps = _gaps(after, before)
    if after > (_PART_KEPT if is_part else _KEPT) * before:
        return replace(kept, lines=(f"pose: not fitted, as that would leave {gaps}",))
    if after <= _POOR:
        return replace(found, lines=(*found.lines, f"that leaves {gaps}"))
    doubt = "is the template of the same kind as the target?"
    if bent > _BENT:
        turn = f"{name} turned by {np.degrees(bent):.0f} degrees"
        line = f"warning: pose: not fitted, as that would leave {gaps}, with {turn}: {doubt}"
        return replace(kept, lines=(line,))
    return replace(found, lines=(*found.lines, f"warning: that leaves {gaps}: {doubt}"))


def _fitted(job: _Job, start: Alignment, report: Callable[[float], None]) -> PosedAlignment:
    template = job.template
    assert template.mesh is not None  # the caller looked
    found = fit_pose(template, job.pose, start.placed, job.cloud, job.exact, job.scales, report)
    posed = deform(found.figure, found.pose)[0]
    ours = Triangles(posed, template.mesh.triangles, job.settings.samples)
    how = start.how if start.how == "landmarks" else "fit"
    alignment = Alignment.of(ours, job.exact, found.placed, how)
    return PosedAlignment(
        alignment, found.figure, found.pose, posed, _lines(found), _most_turned(found)
    )


def _turned_round(job: _Job, ours: Posed, rigid: Alignment, up: str) -> Alignment:
    """Return the template facing the other way, laid onto the target as well as it goes."""
    placed = rigid.placed
    half = rotation_vector_to_matrix(np.pi * axis_direction(up))
    middle = placed.apply(ours.positions.mean(axis=0))
    rotation = placed.rotation @ half
    shift = middle - placed.scale * rotation @ ours.positions.mean(axis=0)
    exact = Triangles(ours.positions, ours.triangles, job.settings.samples)
    dense = sample_surface(ours.positions, ours.triangles, job.settings.dense)
    cloud = Cloud(exact.samples, dense)
    start = Similarity(placed.scale, rotation, shift, placed.factors)
    return Alignment.of(
        exact, job.exact, iterate(cloud, job.cloud, start, _ROUNDS, job.scales), "search"
    )


def _stretched(
    ours: Posed, exact: Triangles, kept: PosedAlignment, samples: int
) -> PosedAlignment | None:
    """Return the template with a scale along each axis, if that closes most of the gap."""
    rigid = kept.alignment
    template = Triangles(ours.positions, ours.triangles, samples)
    trials = [
        fit_axes(template, exact, rigid.placed, _AXES_ROUNDS, turns=True, own=own)
        for own in (False, True)
    ]
    alignments = [
        Alignment.of(template, exact, placed, "fit")
        for placed in trials
        if _stretch(placed) >= _STRETCH
    ]
    if not alignments:
        return None
    # Where both are the same axes, those that --scale axes speaks of.
    alignment, *other = alignments
    if other and misfit(other[0], False) < _CLEARLY * misfit(alignment, False):
        alignment = other[0]
    after, before = misfit(alignment, False), misfit(rigid, False)
    found = replace(
        kept,
        alignment=alignment,
        lines=(
            f"proportions: the template stretched by {_scales(alignment.placed)}, pose kept",
            f"that leaves {_gaps(after, before)}",
        ),
    )
    return found if _is_closer(found, kept) else None


def _is_closer(stretched: PosedAlignment, other: PosedAlignment) -> bool:
    """Tell whether a stretched template leaves much less of a gap than another."""
    gap = misfit(stretched.alignment, False)
    return gap <= _STRETCH_LEFT * misfit(other.alignment, False)


def _advice(stretched: PosedAlignment, kept: PosedAlignment) -> str:
    gaps = [100.0 * misfit(one.alignment, False) for one in (stretched, kept)]
    placed = stretched.alignment.placed
    cure = "fit proportions" if (placed.factors == 1.0).all() else "ask for it (--scale axes)"
    return (
        f"warning: stretched by {_scales(placed)}, the template fits much better, with a gap of "
        f"{gaps[0]:.3f} % instead of {gaps[1]:.3f} %: if the target was stretched, {cure}"
    )


def _stretch(placed: Similarity) -> float:
    factors = placed.factors * placed.own_factors
    return float(factors.max() / factors.min())


def _scales(placed: Similarity) -> str:
    is_own = bool((placed.factors == 1.0).all())
    scales = placed.scale * (placed.own_factors if is_own else placed.factors)
    texts = ", ".join(f"{value:.4g}" for value in scales)
    whose = "its own" if is_own else "the target's"
    return f"{texts} along {whose} x, y and z"


def _gaps(after: float, before: float) -> str:
    return f"a gap of {100.0 * after:.3f} % of the size, before {100.0 * before:.3f} %"


def _lines(found: Fitted) -> tuple[str, ...]:
    """Say which joint was turned most, and which limb resized most."""
    skeleton = found.figure.skeleton
    assert skeleton is not None  # the caller looked
    angle, name = _most_turned(found)
    longest = int(np.abs(found.grown[0]).argmax())
    change = 100.0 * np.expm1(found.grown[0, longest])
    longer = number_text(change, "+.0f")
    return (
        f"pose: the template's joints turned to fit, {name} by {np.degrees(angle):.0f} degrees; "
        f"its limbs resized, {joint_label(skeleton, longest)} by {longer} % in length",
    )


def _most_turned(found: Fitted) -> tuple[float, str]:
    """Return the largest turn of a joint in radians, and the joint's name."""
    skeleton = found.figure.skeleton
    assert skeleton is not None  # the caller looked
    angles = np.linalg.norm(found.turned, axis=1)
    most = int(angles.argmax())
    return float(angles[most]), joint_label(skeleton, most)
