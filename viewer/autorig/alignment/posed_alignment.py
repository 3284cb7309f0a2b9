"""Alignment of a template whose pose and proportions differ from the target's.

People in scans have lowered arms and individual proportions, templates have outstretched arms: no
similarity aligns one with the other. Unless the shapes are nearly the same, pose and proportions
are therefore fitted from the limbs of the target (``anatomy_fit``) if it has those of the template.
If the fit is poor, another one begins there in the template's own pose and proportions. If there
are no limbs, or the fit is still bad, a similarity is searched and pose and proportions are fitted
from there; the fit with the least distance between the surfaces, in both directions, is accepted if
it removes most of the error. Feet decide which way a figure faces; if they are stumps, both facings
are fitted. If their surfaces hardly differ, the result has both: only a person can tell.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeAlias

import numpy as np

from viewer.autorig.alignment.anatomy_fit import (
    NO_LANDMARKS,
    Start,
    left_of,
    start_of_landmarks,
    starts_of,
    straightened,
    template_body,
)
from viewer.autorig.alignment.axes_fit import fit_axes
from viewer.autorig.alignment.icp import Cloud, Triangles, iterate
from viewer.autorig.alignment.orientation_search import axis_direction, nearest_axis
from viewer.autorig.alignment.pose_fit import Fitted, Marks, fit_pose, start_of
from viewer.autorig.alignment.proportions import limbs_of, resized
from viewer.autorig.alignment.similarity import Similarity, fit_similarity
from viewer.autorig.alignment.surface_alignment import (
    DEFAULT_UP,
    PART,
    AlignedBy,
    Alignment,
    AlignmentSettings,
    Posed,
    align,
    misfit,
    nearly_similar,
)
from viewer.autorig.anatomy import LimbPair, anatomies_of
from viewer.autorig.solid import Solid
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase, note, wording
from viewer.errors import RigError
from viewer.phrases import Remedy
from viewer.progress import part_of_work
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix
from viewer.rigs.geometry.samples import sample_surface
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
_ENOUGH = 0.03  # misfit of fitted limbs up to which no other alignment is searched
_STRETCHES = 10  # number of iterations to stretch a template
_ROUNDS = 30  # number of iterations to align the template facing the other way
_FOUND = ("search", "in place")  # origins of alignments that were not given by the user

_CLEARLY = 0.85  # fraction of the misfit that an unusual facing must reach
_STRAIGHTER = 0.75  # ratio of bends below which the straighter start is right
_FEWEST_LANDMARKS = 3  # from which a similarity follows
_MOST_STARTS = 2  # starts from anatomy that are fitted to the surface
_NEARBY = 0.08  # ratio of the search radius to the size at the beginning of such a fit
_CLOSER = 0.03  # the same ratio for a fit to the surface only
# Weight of all points of the anatomy relative to the surface; landmarks keep their weights.
_MARKED = 0.3
# Ratio of misfits from which two facings look alike. With feet ignored, 11 of 20 characters fitted
# back to front with 0.88 to 1.16 times the misfit of the right facing, others, such as realistic
# people, with 1.2 to 2.5 times.
_ALIKE = 0.7


ALIKE = (
    "R004.facing: front and back look alike (facing {front} leaves a gap of {gap:.2f} % of the "
    "size, facing {back} {other:.2f} %), so check the front, and if it is {back}, {remedy}"
)
FACING = ALIKE.partition(":")[0]
"""Key of this message."""


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
    bend: float = 0.0
    """Root mean square rotation of the joints, radians."""
    legs: tuple[LimbPair, ...] = ()
    """The target's legs from which it was fitted."""
    solids: tuple[Solid, Solid] | None = None
    """The solids of the template in the given pose and of the target, if they were looked at."""
    front: str = ""
    """The axis that the target faces, if only the surfaces decided that, and not clearly."""
    other: PosedAlignment | None = None
    """The fit that faces the other way, which is nearly as close."""

    @property
    def alike(self) -> Diagnostic | None:
        """The message that the fit that faces the other way is nearly as close."""
        return next((line for line in self.lines if line.key == FACING), None)


@dataclass(frozen=True, slots=True, eq=False)
class _Job:
    """Inputs common to all fits."""

    template: Figure
    pose: Pose
    cloud: Cloud
    exact: Triangles
    scales: bool
    settings: AlignmentSettings


_LimbFit: TypeAlias = tuple[Start, PosedAlignment]
"""A start from anatomy, and the fit that began there."""


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
    if not fits or settings.scale == "axes":
        rigid = align(ours, theirs, template.up, settings)
        return PosedAlignment(rigid, template, pose, posed, ())
    exact = Triangles(target.positions, triangles, settings.samples)
    cloud = Cloud(exact.samples, sample_surface(target.positions, triangles, settings.dense))
    job = _Job(template, pose, cloud, exact, settings.scale != "none", settings)
    if keeps(settings):
        return _by_landmarks(job, ours, theirs)
    by_limbs: list[_LimbFit] = []
    solids: tuple[Solid, Solid] | None = None
    # Whoever gives a place or a scale knows better; and equal shapes need no other fit.
    is_searched = settings.matrix is None and settings.landmarks is None
    has_limbs = is_searched and settings.scale == "uniform"
    with part_of_work(span=(0.0, 0.05)):
        is_new = has_limbs and not nearly_similar(ours, theirs, template.up, settings)
    if is_new:
        with part_of_work(span=(0.05, 0.5)):
            starts, solids = _starts(job, ours, theirs)
            by_limbs = _fits_of_limbs(job, starts)
        found = _best_of_limbs(job, by_limbs)
        if found is not None and misfit(found.alignment, False) <= _ENOUGH:
            return replace(_stretched(job, ours, found) or found, solids=solids)
    with part_of_work(span=(0.5, 0.7)):
        rigid = align(ours, theirs, template.up, settings)
    kept = PosedAlignment(rigid, template, pose, posed, (), solids=solids)
    if misfit(rigid, rigid.away > PART) <= _CLOSE:
        return kept
    if has_limbs and rigid.away <= PART and (found := _stretched(job, ours, kept)) is not None:
        return found
    if has_limbs and not is_new and rigid.how in _FOUND:
        with part_of_work(span=(0.7, 0.8)):
            starts, solids = _starts(job, ours, theirs)
            by_limbs = _fits_of_limbs(job, starts)
    with part_of_work(span=(0.8, 1.0)):
        return replace(_best(job, kept, by_limbs), solids=solids)


def _stretched(job: _Job, ours: Posed, found: PosedAlignment) -> PosedAlignment | None:
    """Return the template in the given pose, stretched, if that is the shape of the target.

    Limbs of such a target are neither as long nor as thick as those of any posed figure.
    """
    exact = Triangles(ours.positions, ours.triangles, job.settings.samples)
    start = found.alignment.similarity
    stretched = fit_axes(exact, job.exact, start, _STRETCHES, rotations=True)
    alignment = Alignment.of(exact, job.exact, stretched, "fit")
    if misfit(alignment, False) > min(_CLOSE, misfit(found.alignment, False)):
        return None
    return PosedAlignment(alignment, job.template, job.pose, ours.positions, (), legs=found.legs)


def keeps(settings: AlignmentSettings) -> bool:
    """Return whether landmarks are constraints of the fit."""
    is_free = settings.scale == "uniform" and settings.matrix is None
    return settings.landmarks is not None and settings.keeps_landmarks and is_free


def _by_landmarks(job: _Job, ours: Posed, theirs: Posed) -> PosedAlignment:
    """Return the closest fit that keeps the landmarks: from limbs, or from the landmarks alone."""
    landmarks = job.settings.landmarks
    assert landmarks is not None  # checked by the caller
    with part_of_work(span=(0.0, 0.4)):
        starts, solids = _starts(job, ours, theirs, landmarks)
    fits = []
    for number, start in enumerate(starts[:_MOST_STARTS]):
        with part_of_work(span=(0.4 + 0.2 * number, 0.6 + 0.2 * number)):
            fits.append(_fitted_limbs(job, start))
    if len(landmarks) >= _FEWEST_LANDMARKS:
        placed = fit_similarity(landmarks[:, 0], landmarks[:, 1])
        alone = start_of_landmarks(job.template, job.pose, ours.positions, landmarks, placed)
        with part_of_work(span=(0.8, 1.0)):
            fits.append(_fitted_marks(job, *alone))
    if not fits:
        raise RigError(
            f"landmarks: expected {_FEWEST_LANDMARKS} or more pairs, as no limbs were found, "
            f"found {len(landmarks)}"
        )
    best = min(fits, key=lambda fit: misfit(fit.alignment, False))
    best = replace(best, alignment=replace(best.alignment, how="landmarks"), solids=solids)
    return replace(best, lines=(*best.lines, note(wording.GAP, gap=_gap_left(best))))


def _starts(
    job: _Job, ours: Posed, theirs: Posed, landmarks: Floats = NO_LANDMARKS
) -> tuple[list[Start], tuple[Solid, Solid] | None]:
    """Return the starts from anatomy, and the solids of template and target.

    There is none if template or target has no two pairs of limbs.
    """
    with part_of_work(span=(0.0, 0.15)):
        body = template_body(job.template, job.pose, ours.positions)
    if body is None:
        return [], None
    settings = job.settings
    up = axis_direction(settings.up or DEFAULT_UP)
    front = None if settings.facing is None else axis_direction(settings.facing)
    lateral = None if front is None else np.cross(up, front)
    with part_of_work(span=(0.15, 0.3)):
        targets = anatomies_of(theirs.positions, theirs.triangles, up, lateral)
    solids = body.anatomy.solid, targets[0].solid
    if targets[0].is_symmetric and not len(landmarks):
        # Where the template turns its head, ears and muzzle would begin off their places, and a
        # round head does not show its rotation. Landmarks are points of the given pose.
        straight = straightened(job.template, job.pose)
        if not np.allclose(straight.values, job.pose.values, atol=1e-3):
            posed = deform(job.template, straight)[0]
            body = template_body(job.template, straight, posed) or body
    found = []
    for number, target in enumerate(targets):
        span = (0.3 + 0.1 * number / len(targets), 0.3 + 0.1 * (number + 1) / len(targets))
        with part_of_work(span=span):
            found += starts_of(body, target, front, landmarks)
    return sorted(found, key=lambda start: start.error), solids


def _best(job: _Job, kept: PosedAlignment, by_limbs: list[_LimbFit]) -> PosedAlignment:
    """Return the closest of all fits if it removes most of the error."""
    rigid, best = kept.alignment, _best_of_limbs(job, by_limbs)
    is_part = rigid.away > PART and best is None
    before = misfit(rigid, is_part)
    found = _fitted(job, _facing(job, kept, by_limbs))
    is_whole = rigid.how == "search" and not is_part
    if kept.solids is not None and not by_limbs and is_whole and job.settings.facing is None:
        # The search compares the facings before a pose is fitted, and no feet were found.
        back = _fitted(job, _in_given_pose(job, kept, _half_turn(job)))
        pair = sorted((found, back), key=lambda fit: misfit(fit.alignment, False))
        found = _with_other(job, *pair)
    other = _if_better(kept, found, before, is_part)
    if best is None:
        return other
    # A figure of another kind can be squeezed into any surface: its limbs count more.
    limit = misfit(best.alignment, False)
    limit = limit if limit <= _POOR else _CLEARLY * limit
    return other if misfit(other.alignment, False) < limit else best


def _best_of_limbs(job: _Job, by_limbs: list[_LimbFit]) -> PosedAlignment | None:
    """Return the closest fit of a whole figure, None without any."""
    # Only a whole figure has all limbs of the template where they should be.
    whole = [
        (start, replace(fit, lines=(*fit.lines, note(wording.GAP, gap=_gap_left(fit)))))
        for start, fit in by_limbs
        if fit.alignment.away <= PART
    ]
    if not whole:
        return None
    start, best = min(whole, key=lambda each: _doubtful_misfit(*each))
    others = [fit for other, fit in whole if float(other.plan.left @ start.plan.left) < 0.0]
    if start.is_sure or not others:
        return best
    return _with_other(job, best, min(others, key=lambda fit: misfit(fit.alignment, False)))


def _with_other(job: _Job, best: PosedAlignment, other: PosedAlignment) -> PosedAlignment:
    """Return a fit, with the one that faces the other way if the surfaces hardly differ."""
    gaps = [misfit(fit.alignment, False) for fit in (best, other)]
    if gaps[0] < _ALIKE * gaps[1]:
        return best
    ahead = np.cross(left_of(job.template, job.pose), axis_direction(job.template.up))
    # A fit may lean: an axis along the way up is no front.
    level = np.eye(3) - np.outer(*2 * [axis_direction(job.settings.up or DEFAULT_UP)])
    fronts = [
        nearest_axis(level @ fit.alignment.similarity.rotation @ ahead) for fit in (best, other)
    ]
    if fronts[0] == fronts[1]:
        return best
    values = {
        "front": fronts[0],
        "gap": 100.0 * gaps[0],
        "back": fronts[1],
        "other": 100.0 * gaps[1],
        "remedy": Remedy("click its picture", f"specify --facing {fronts[1]}"),
    }
    return replace(
        best,
        lines=(*best.lines, note(ALIKE, **values)),
        front=fronts[0],
        other=replace(other, front=fronts[1]),
    )


def _fits_of_limbs(job: _Job, starts: list[Start]) -> list[_LimbFit]:
    """Fit the starts that face the usual way, and the best one also facing the other way."""
    usual = [start for start in starts if start.is_sure or start.is_usual] or starts
    # To make arms of ears, trunk and legs must bend, too.
    least = min((start.fitted.bend for start in usual), default=0.0)
    usual = [start for start in usual if _STRAIGHTER * start.fitted.bend <= least]
    found = []
    for number, start in enumerate(usual[:_MOST_STARTS]):
        with part_of_work(span=(0.4 + 0.2 * number, 0.6 + 0.2 * number)):
            found.append((start, _fitted_limbs(job, start)))
    if found:
        best = min(found, key=lambda each: _doubtful_misfit(*each))[0].plan
        same = {id(best.lower), id(best.upper)}
        for start in starts:
            if start not in usual and {id(start.plan.lower), id(start.plan.upper)} == same:
                with part_of_work(span=(0.8, 1.0)):
                    found.append((start, _fitted_limbs(job, start)))
    return found


def _doubtful_misfit(start: Start, fit: PosedAlignment) -> float:
    """Return the misfit, larger for an unusual facing that feet do not show."""
    gap = misfit(fit.alignment, False)
    return gap if start.is_sure or start.is_usual else gap / _CLEARLY


def _facing(job: _Job, kept: PosedAlignment, by_limbs: list[_LimbFit]) -> Alignment:
    """Return the alignment, reversed if all fits of limbs face the other way."""
    rigid = kept.alignment
    if rigid.how not in _FOUND or rigid.away > PART or not by_limbs:
        return rigid
    # Columns of the rotations: the template's left and the starts' left in the target.
    left = rigid.similarity.rotation @ left_of(job.template, job.pose)
    if all(float(left @ start.plan.left) < 0.0 for start, _ in by_limbs):
        return _in_given_pose(job, kept, _half_turn(job))
    return rigid


def _fitted_limbs(job: _Job, start: Start) -> PosedAlignment:
    """Fit a template to the surface whose limbs are already where the target's are."""
    with part_of_work(span=(0.0, 0.8)):
        found = _fitted_marks(job, start.marked, start.fitted, start.marks)
    if not (start.marks.kept == 1.0).any():
        with part_of_work(span=(0.8, 1.0)):
            found = _or_in_given_pose(job, found)
    return replace(found, alignment=replace(found.alignment, has_limbs=True), legs=start.legs)


def _or_in_given_pose(job: _Job, found: PosedAlignment) -> PosedAlignment:
    """Return a poor fit, or a better one that begins at its place in the given pose.

    Trousers, and hands that touch the thighs, hide where limbs begin, and so do arms of blocks that
    are as thick as the trunk. Wrong lengths mislead a fit, but place and facing are right, and may
    be all that is needed: the other fit is better if it is much closer, or if it is closer and so
    much straighter that the product of both ratios is as small.
    """
    gap = misfit(found.alignment, False)
    if gap <= _POOR:
        return found
    plain = _fitted(job, _in_given_pose(job, found))
    other = misfit(plain.alignment, False)
    straighter = min(plain.bend, found.bend) / found.bend if found.bend else 1.0
    return plain if other <= gap and other * straighter <= _KEPT * gap else found


def _fitted_marks(job: _Job, marked: Figure, start: Fitted, marks: Marks) -> PosedAlignment:
    """Fit a template with marks to the surface; ``start`` has them where they should be."""
    is_landmark = marks.kept == 1.0
    marks = replace(marks, weights=marks.weights * np.where(is_landmark, 1.0, _MARKED))
    with part_of_work(span=(0.0, 0.4)):
        state = fit_pose(marked, start, job.cloud, job.exact, True, marks, _NEARBY)
    found = _unmarked(job, state)
    if misfit(found.alignment, False) > _POOR:
        return found
    # The surface of a similar figure is a better guide to its joints than the anatomy. What the
    # surface does not show, such as the joints of the spine, bends as in the template. Of lengths
    # and girths, template and anatomy are two estimates: the template's alone would make a wide
    # body narrower again, the anatomy of a thick coat is inaccurate. The surface decides between
    # the template's and the mean of the logarithms of both.
    since = start_of(marked, job.pose, state.similarity)
    kept = marks.chosen(is_landmark)
    if kept is None:
        marked, state = job.template, _of_template(job, state)
    fits = []
    for number, fraction in enumerate((0.0, 0.5)):
        estimate = replace(since, grown=fraction * state.grown)
        with part_of_work(span=(0.4 + 0.3 * number, 0.7 + 0.3 * number)):
            fit = fit_pose(marked, state, job.exact, job.exact, True, kept, _CLOSER, estimate)
            fits.append(_unmarked(job, fit))
    return min(fits, key=lambda fit: misfit(fit.alignment, False))


def _unmarked(job: _Job, state: Fitted) -> PosedAlignment:
    return _result(job, _of_template(job, state), "fit")


def _of_template(job: _Job, state: Fitted) -> Fitted:
    """Return the state of a template without the marks."""
    figure = resized(job.template, limbs_of(job.template), *np.exp(state.grown))
    return replace(state, figure=figure)


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
        alignment, found.figure, found.pose, posed, _lines(found), _most_rotated(found), found.bend
    )


def _in_given_pose(job: _Job, fit: PosedAlignment, turn: Floats | None = None) -> Alignment:
    """Return the template in the given pose, aligned with the target where a fit of it is.

    ``turn``: rotation (3, 3) of the template before that, none by default.
    """
    posed = deform(job.template, job.pose)[0]
    triangles = job.template.require_mesh().triangles
    similarity = fit.alignment.similarity
    placed = similarity.apply(fit.positions)
    rotation = similarity.rotation if turn is None else similarity.rotation @ turn
    scale = float(placed.std(axis=0).sum() / similarity.apply(posed).std(axis=0).sum())
    scale *= similarity.scale
    shift = placed.mean(axis=0) - scale * rotation @ posed.mean(axis=0)
    exact = Triangles(posed, triangles, job.settings.samples)
    cloud = Cloud(exact.samples, sample_surface(posed, triangles, job.settings.dense))
    start = Similarity(scale, rotation, shift, similarity.factors)
    return Alignment.of(
        exact, job.exact, iterate(cloud, job.cloud, start, _ROUNDS, job.scales), "search"
    )


def _half_turn(job: _Job) -> Floats:
    """Return the rotation (3, 3) that makes the template face the other way."""
    return rotation_vector_to_matrix(np.pi * axis_direction(job.template.up))


def _gap_left(fit: PosedAlignment) -> Phrase:
    """Return the fitting error that remains as text."""
    after = 100.0 * misfit(fit.alignment, False)
    return Phrase("a gap of {after:.2f} % of the size", after=after)


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
