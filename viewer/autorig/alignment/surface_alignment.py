"""Alignment of a posed template with a target mesh: in place, by landmarks, or by search."""

from __future__ import annotations

from dataclasses import field
from typing import Literal, TypeAlias

import numpy as np

from viewer.autorig.alignment.axes_fit import fit_axes
from viewer.autorig.alignment.icp import (
    Cloud,
    Side,
    Triangles,
    capped_rms,
    gaps_between,
    iterate,
    slide,
    trimmed_rms,
)
from viewer.autorig.alignment.orientation_search import (
    axis_rotations,
    in_place,
    judge,
    quick_search,
    search,
)
from viewer.autorig.alignment.similarity import Similarity, fit_similarity
from viewer.data_classes import dataclass, setting
from viewer.diagnostics import Diagnostic, Phrase, note
from viewer.errors import RigError
from viewer.phrases import Remedy, rounded
from viewer.progress import part_of_work, report_fraction
from viewer.rigs.arrays import Floats, Ints, freeze_fields
from viewer.rigs.geometry.rotation import rotation_distance
from viewer.rigs.geometry.samples import sample_surface
from viewer.rigs.geometry.vectors import Up

AlignedBy: TypeAlias = Literal["in place", "search", "landmarks", "given", "fit"]
TemplateScale: TypeAlias = Literal["uniform", "axes", "none"]
SCALES: tuple[TemplateScale, ...] = ("uniform", "axes", "none")
"""One common scale, one scale along each axis of the target, or the template's size unchanged."""

DEFAULT_UP = "y"
"""Up axis of a target for which none is known."""

SAMPLES = 2_000
"""Default number of points of each surface that an alignment uses."""

_ROUNDS, _SLIDES = 60, 25  # numbers of iterations of point-to-point and of point-to-plane fits
_AXES_ROUNDS = 20
_IN_PLACE = 0.03  # ratio of misfit to size up to which a mesh may already be in place
_SURELY = 0.003  # ratio of mean distance to size up to which no search is performed
# The same ratio for two shapes that are nearly the same, after a few iterations with few points:
# for equal shapes it is 0.002, for realistic people in the same pose 0.005 or more.
_SIMILAR, _FEWER = 0.004, 4  # and for a fraction of the samples
_SLIDING = 0.02  # ratio of misfit to size up to which sliding refines the fit
# Fraction of that misfit that a search must reach to move the mesh: a part of a figure fits nearly
# as well in many other positions, whereas a whole figure does not.
_BETTER, _PART_BETTER = 0.8, 0.35
PART = 0.05
"""Fraction of the size: if template points are farther away, the target is only a part."""

# Fraction of the size to which larger distances, as of hair or a missing hand, are clamped.
_CAP = 0.05
_BAD = 0.03  # ratio of RMS error to size above which a warning is given


def stated_up(file_up: Up) -> str | None:
    """Return the up axis of a target that its file states; None for the one assumed otherwise."""
    return None if file_up == DEFAULT_UP else file_up


@dataclass(frozen=True, slots=True, eq=False)
class Posed:
    """A surface to align: the posed template, or the target."""

    positions: Floats
    """(V, 3). Positions in the mesh's own unit."""
    triangles: Ints
    """(T, 3). Vertex indices."""


@dataclass(frozen=True, slots=True, eq=False)
class AlignmentSettings:
    """Known facts about an alignment, and options."""

    up: str | None = setting(
        None, "up axis of the target (default: that of its file format, y for .obj and .ply)"
    )
    facing: str | None = setting(
        None, "front of the target (default: estimated from its feet and shape)"
    )
    scale: TemplateScale = setting(
        "uniform",
        "scale of the template: one factor, one factor per axis, or none (default: {default})",
        choices=SCALES,
    )
    landmarks: Floats | None = None
    """(N, 2, 3) or None. Pairs of points of the posed template and the target, three or more unless
    they are kept. They replace the search."""
    keeps_landmarks: bool = True
    """Whether a fit of pose and proportions keeps the landmarks together, and puts joints there."""
    refines: bool = setting(True, "skip the refinement of the alignment", flag="--no-refine")
    """Whether closest points refine landmarks or the result of the search."""
    matrix: Floats | None = None
    """(4, 4) or None. A given alignment, such as one set by hand in the window; it replaces the
    search."""
    samples: int = field(default_factory=lambda: SAMPLES)
    """Points distributed over each surface for which closest points on the other are searched. The
    run time of a fit is proportional to it."""

    @property
    def dense(self) -> int:
        """Points of each surface that represent it in the search of the first iterations."""
        return 6 * self.samples

    def __post_init__(self) -> None:
        if self.scale not in SCALES:
            raise RigError(f'scale: expected {", ".join(SCALES)}, found "{self.scale}"')
        freeze_fields(self, landmarks=(None, 2, 3), matrix=(4, 4))
        if self.landmarks is not None and len(self.landmarks) == 0:
            raise RigError("landmarks: expected 1 or more pairs, found 0")


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """Placement of the posed template in the target's frame."""

    similarity: Similarity
    """Template to target, in the target's unit; never a reflection."""
    error: float
    """Trimmed RMS distance (the best 90 %) of the target from the template, over the target's
    size."""
    away: float
    """The same distance of the template from the target; large if the target is only a part of a
    figure."""
    uneven: tuple[float, ...]
    """RMS distances over the size in the same two directions, without the median offset between the
    surfaces. All distances are included, each clamped to 5 %, so that protruding ends of limbs
    are included."""
    how: AlignedBy
    """``"fit"`` if pose and proportions were also fitted, unless landmarks were given."""
    has_limbs: bool = False
    """Whether the fit began at limbs that were found in the target."""

    @classmethod
    def of(cls, template: Side, target: Side, similarity: Similarity, how: AlignedBy) -> Alignment:
        """Return an alignment together with its errors."""
        size = target.size
        gaps = gaps_between(template, target, similarity)
        return cls(
            similarity,
            error=trimmed_rms(gaps.towards) / size,
            away=trimmed_rms(gaps.away) / size,
            uneven=tuple(
                capped_rms(way / size, _CAP) for way in (gaps.uneven_towards, gaps.uneven_away)
            ),
            how=how,
        )


def misfit(alignment: Alignment, is_part: bool) -> float:
    """Return the mean of the uneven errors both ways, by which alignments are compared."""
    towards, away = alignment.uneven
    return towards if is_part else 0.5 * (towards + away)


def nearly_similar(
    template: Posed, target: Posed, template_up: str, settings: AlignmentSettings
) -> bool:
    """Return whether some similarity brings the target close to the template."""
    report_fraction(0.0, "comparing the shapes")
    sides, few = (template, target), max(1, settings.samples // _FEWER)
    exact = [Triangles(side.positions, side.triangles, few) for side in sides]
    clouds = [
        Cloud(
            sample_surface(side.positions, side.triangles, settings.samples),
            sample_surface(side.positions, side.triangles, settings.dense),
        )
        for side in sides
    ]
    scaled = settings.scale != "none"
    rotations = axis_rotations(template_up, settings.up, settings.facing)
    stays = in_place(clouds[0], clouds[1], rotations, scaled)
    # Distances from the surfaces, as those from few points are never small.
    gaps = gaps_between(exact[0], exact[1], stays.similarity)
    if float(np.mean(gaps.towards)) <= _SIMILAR * exact[1].size:
        return True
    rotations = axis_rotations(template_up, settings.up or DEFAULT_UP, settings.facing)
    best = quick_search(clouds[0], clouds[1], rotations, None if scaled else 1.0)[0]
    return judge(exact[0], exact[1], best.similarity).error <= _SIMILAR


def align(
    template: Posed,
    target: Posed,
    template_up: str,
    settings: AlignmentSettings,
) -> Alignment:
    """Find the similarity that aligns the template with the target."""
    report_fraction(0.0, "matching the surfaces")
    samples = settings.samples
    ours, theirs = fine = _surface(template, samples), _surface(target, samples)
    if settings.matrix is not None:
        return Alignment.of(ours, theirs, similarity_of(settings.matrix), "given")
    coarse = [
        Cloud(exact.samples, sample_surface(side.positions, side.triangles, settings.dense))
        for exact, side in zip(fine, (template, target), strict=True)
    ]
    scale = 1.0 if settings.scale == "none" else None
    if settings.landmarks is not None:
        start = fit_similarity(settings.landmarks[:, 0], settings.landmarks[:, 1], scale)
        if settings.refines:
            report_fraction(0.2, "matching the surfaces")
            start = iterate(coarse[0], coarse[1], start, _ROUNDS, settings.scale != "none")
        return Alignment.of(ours, theirs, _refined(fine, start, settings), "landmarks")
    # A target that is already in place, up to its unit and rotations by multiples of 90 degrees, is
    # not moved: fitting a part (a shirt, an open shell) would only move it away. Otherwise the
    # rotations by 90 degrees about the up axis are tried, each with a few iterations of closest
    # points; the best is refined on the surfaces.
    rotations = axis_rotations(template_up, settings.up, settings.facing)
    stays = in_place(coarse[0], coarse[1], rotations, scaled=settings.scale != "none")
    report_fraction(0.1, "matching the surfaces")
    if stays.error <= _SURELY:
        return Alignment.of(ours, theirs, stays.similarity, "in place")
    # A figure with other proportions may fit best upside down: only a mesh that coincides with the
    # template may be rotated.
    rotations = axis_rotations(template_up, settings.up or DEFAULT_UP, settings.facing)
    stays = in_place(coarse[0], coarse[1], rotations, scaled=settings.scale != "none")
    with part_of_work(span=(0.1, 0.8)):
        best = search(coarse[0], coarse[1], rotations, scale)
    left = Alignment.of(ours, theirs, stays.similarity, "in place")
    found = Alignment.of(ours, theirs, best.similarity, "search")
    is_part = found.away > PART
    # Sliding refines a close fit; between different poses it is slow and does not converge.
    if settings.scale == "axes" or misfit(found, True) <= _SLIDING:
        similarity = _refined(fine, best.similarity, settings)
        slid = Alignment.of(ours, theirs, similarity, "search")
        is_part &= slid.away > PART
        # Sliding considers only surfaces that face the same way, and may miss the ends of limbs.
        if settings.scale == "axes" or misfit(slid, is_part) <= misfit(found, is_part):
            found = slid
    fraction = _PART_BETTER if is_part else _BETTER
    gap = misfit(left, is_part)
    return found if gap > _IN_PLACE or misfit(found, is_part) < fraction * gap else left


def _surface(side: Posed, samples: int) -> Triangles:
    return Triangles(side.positions, side.triangles, samples)


def _refined(
    fine: tuple[Triangles, Triangles],
    start: Similarity,
    settings: AlignmentSettings,
) -> Similarity:
    if settings.refines:
        report_fraction(0.85, "matching the surfaces")
        start = slide(fine[0], fine[1], start, _SLIDES, settings.scale != "none")
    if settings.scale == "axes":
        return fit_axes(fine[0], fine[1], start, _AXES_ROUNDS, settings.refines)
    return start


def similarity_of(matrix: Floats) -> Similarity:
    """Return a 4 x 4 matrix as a similarity, or raise ``RigError`` if it shears or reflects."""
    linear = np.asarray(matrix, dtype=np.float64)[:3, :3]
    determinant = float(np.linalg.det(linear))
    if not determinant > 0.0:
        raise RigError("alignment: expected a matrix without reflection or singularity")
    scale, shift = float(np.cbrt(determinant)), np.asarray(matrix)[:3, 3]
    rotation = linear / scale
    if _is_rotation(rotation):
        return Similarity(scale, rotation, shift, np.ones(3))
    for axis in (1, 0):
        # The rows of F R have the lengths F, the columns of R H the lengths H.
        factors = np.linalg.norm(rotation, axis=axis)
        factors = factors / np.cbrt(np.prod(factors))
        plain = rotation / (factors[:, None] if axis else factors)
        if _is_rotation(plain):
            both = (factors, np.ones(3)) if axis else (np.ones(3), factors)
            return Similarity(scale, plain, shift, *both)
    raise RigError(
        "alignment: expected a rotation, a shift, and one scale or one along each axis, found a "
        "shear"
    )


def _is_rotation(linear: Floats) -> bool:
    return bool(np.abs(linear @ linear.T - np.eye(3)).max() <= 1e-6)


_HOW: dict[AlignedBy, str] = {
    "in place": "the template is scaled and rotated about the shared origin",
    "search": "found by matching closest points",
    "landmarks": "from the landmarks",
    "given": "as given",
    "fit": "found by fitting pose and proportions",
}


def alignment_lines(alignment: Alignment) -> list[Diagnostic]:
    """Return messages about scale, rotation, shift and error, and about doubtful results."""
    similarity = alignment.similarity
    angle = float(np.degrees(rotation_distance(similarity.rotation, np.eye(3))))
    how = Phrase(_HOW[alignment.how])
    if alignment.how == "in place" and similarity.scale == 1.0 and angle == 0.0:
        how = Phrase("the target already coincides with the template")
    factors: Phrase | str = ""
    for numbers, axes in (
        (similarity.factors, "x, y, z"),
        (similarity.own_factors, "the template's x, y, z"),
    ):
        if (numbers != 1.0).any():
            shown = {axis: rounded(value, 4) for axis, value in _by_axis(numbers).items()}
            factors = Phrase(f" (along {axes}: {{x}}, {{y}}, {{z}})", **shown)
    values = {
        "how": how,
        "scale": rounded(float(similarity.scale), 6),
        "factors": factors,
        "angle": float(angle),
    }
    errors = {"error": 100.0 * alignment.error, "away": 100.0 * alignment.away}
    lines = [
        note(
            "R001.alignment: alignment: {how}; scale {scale}{factors}, rotation {angle:.2f} "
            "degrees, translation ({x:z.4g}, {y:z.4g}, {z:z.4g})",
            **values,
            **_by_axis(similarity.shift),
        ),
        note(
            "R001.error: alignment error: {error:.2f} % of the target's size (RMS of the best "
            "90 %), {away:.2f} % from template to target",
            **errors,
        ),
    ]
    if alignment.error > _BAD:
        lines.append(
            note(
                "R002.error: unreliable alignment, with an error above {limit:g} %: specify "
                "{remedy}, or pose the template like the target ({remedy2})",
                limit=100.0 * _BAD,
                remedy=Remedy("Up, Facing or landmarks", "--up, --facing or --landmarks"),
                remedy2=Remedy("Pose it", "--template-pose"),
            )
        )
    return lines


def _by_axis(numbers: Floats) -> dict[str, float]:
    """Return three values as parameters of a message, by axis."""
    return dict(zip("xyz", numbers.tolist(), strict=True))
