"""Search for a mesh's orientation, unit and position among all likely ones."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np

from viewer.autorig.alignment.icp import Cloud, Side, gaps_between, iterate
from viewer.autorig.alignment.similarity import Similarity
from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.progress import part_of_work, report_fraction
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.samples import SurfaceSamples

AXES = ("x", "y", "z", "-x", "-y", "-z")
"""Allowed values of an up axis or a facing."""

_UNITS = (1.0, 100.0, 0.01, 1000.0, 0.001, 39.37, 1.0 / 39.37)
"""Ratios between metres and centimetres, millimetres and inches, in both directions."""

_NEAR_UNIT = 0.15  # relative tolerance for interpreting a ratio of sizes as a ratio of units
# Fraction of the distances that is used, to exclude hair, skirts and cropped parts.
_TRIM = 0.8
_QUICK, _LONG = 12, 60  # numbers of iterations for every candidate, and for the best candidates
_FINALISTS = 4
# A mesh that is already in place is rotated only if that reduces the error below this fraction.
_NO_BETTER = 0.7
_IN_PLACE = 300  # number of samples from which it is determined whether a mesh is already in place


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A possible alignment with its error."""

    similarity: Similarity
    """Template to target."""
    error: float
    """Trimmed mean distance over the target's size: in both directions in a search; only from the
    target to the template for a mesh that is in place, as it may be a part of the template."""


def axis_direction(name: str) -> Floats:
    """Return the unit vector of an axis: ``"-z"`` is (0, 0, -1)."""
    direction = np.zeros(3)
    direction["xyz".index(name[-1])] = -1.0 if name.startswith("-") else 1.0
    return direction


def nearest_axis(way: Floats) -> str:
    """Return the axis nearest to a direction (3,)."""
    return max(AXES, key=lambda name: float(way @ axis_direction(name)))


def stated_front(template_up: str) -> str:
    """Return the axis that counts as the front of a template: +z if y is up, +x if z is up."""
    return "z" if template_up == "y" else "x"


def axis_rotations(
    template_up: str, up: str | None = None, facing: str | None = None
) -> list[Floats]:
    """Return the rotations (3, 3) that map axes to axes: 24, 4 or 1, the least angle first.

    The template's up axis is mapped to ``up``, its ``stated_front`` to ``facing``.
    """
    for name in filter(None, (up, facing)):
        if name not in AXES:
            raise RigError(f'expected an axis, one of {", ".join(AXES)}, found "{name}"')
    if up is not None and facing is not None and up[-1] == facing[-1]:
        raise RigError(f"expected a facing perpendicular to the up axis {up}, found {facing}")
    forward = stated_front(template_up)
    rotations = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        matrix = np.zeros((3, 3))
        matrix[np.arange(3), order] = signs
        if np.linalg.det(matrix) < 0.0:
            continue
        if up is not None and (matrix @ axis_direction(template_up) != axis_direction(up)).any():
            continue
        if facing is None or (matrix @ axis_direction(forward) == axis_direction(facing)).all():
            rotations.append(matrix)
    return sorted(rotations, key=lambda rotation: -float(np.trace(rotation)))


def unit_scale(ratio: float) -> float:
    """Return the unit factor within 15 % of a ratio of sizes; the ratio itself if there is none.

    >>> unit_scale(93.0), unit_scale(1.4)
    (100.0, 1.4)
    """
    near = [unit for unit in _UNITS if abs(ratio / unit - 1.0) <= _NEAR_UNIT]
    return near[0] if near else ratio


def in_place(template: Cloud, target: Cloud, rotations: list[Floats], scaled: bool) -> Candidate:
    """Return the best placement that keeps the origin fixed; ``scaled`` also tries other units."""
    few = target.samples.positions[:: max(1, len(target.samples.positions) // _IN_PLACE)]
    found = []
    for unit, rotation in product(_UNITS if scaled else (1.0,), rotations):
        similarity = Similarity(unit, rotation, np.zeros(3), np.ones(3))
        # Only from the target to the template: a shirt on the body fits, whatever it does not
        # cover.
        near = similarity.apply(template.find(similarity.undo(few)).positions)
        error = _trimmed_mean(np.linalg.norm(near - few, axis=1)) / target.size
        found.append(Candidate(similarity, error))
    # The first of several candidates with similar errors, so that nothing is rotated unnecessarily:
    # most figures look nearly the same from behind.
    enough = min(candidate.error for candidate in found) / _NO_BETTER + 1e-9
    return next(candidate for candidate in found if candidate.error <= enough)


def search(
    template: Cloud,
    target: Cloud,
    rotations: list[Floats],
    scale: float | None,
) -> Candidate:
    """Return the best candidate after a few iterations for each, and more for the best four."""
    with part_of_work(span=(0.0, 0.6)):
        found = quick_search(template, target, rotations, scale)
    best = []
    for index, finalist in enumerate(found[:_FINALISTS]):
        similarity = iterate(template, target, finalist.similarity, _LONG, scales=scale is None)
        best.append(judge(template, target, similarity))
        report_fraction(0.6 + 0.4 * (index + 1) / _FINALISTS)
    return min(best, key=lambda candidate: candidate.error)


def quick_search(
    template: Cloud,
    target: Cloud,
    rotations: list[Floats],
    scale: float | None,
) -> list[Candidate]:
    """Return the candidates after a few iterations with a few samples, the best one first."""
    ours, theirs = template.samples.positions, target.samples.positions
    # Unlike box sizes, distances from the centroid do not depend on the orientation of a mesh.
    start = unit_scale(_radius(theirs) / _radius(ours)) if scale is None else scale
    few = [_thinned(side, 300) for side in (template, target)]
    found = []
    for index, rotation in enumerate(rotations):
        shift = theirs.mean(axis=0) - start * rotation @ ours.mean(axis=0)
        begun = Similarity(start, rotation, shift, np.ones(3))
        similarity = iterate(few[0], few[1], begun, _QUICK, scales=scale is None)
        found.append(judge(few[0], few[1], similarity))
        report_fraction((index + 1) / len(rotations))
    return sorted(found, key=lambda candidate: candidate.error)


def judge(template: Side, target: Side, similarity: Similarity) -> Candidate:
    """Return an alignment with its two-way error."""
    gaps = gaps_between(template, target, similarity)
    both = _trimmed_mean(gaps.towards) + _trimmed_mean(gaps.away)
    return Candidate(similarity, 0.5 * both / target.size)


def _thinned(side: Cloud, count: int) -> Cloud:
    step = max(1, len(side.samples.positions) // count)
    every = side.samples
    samples = SurfaceSamples(
        every.positions[::step],
        every.normals[::step],
        every.triangles[::step],
        every.weights[::step],
    )
    return side.with_samples(samples)


def _radius(points: Floats) -> float:
    """Return the root mean square distance of points from their centroid."""
    return float(np.sqrt(points.var(axis=0).sum()))


def _trimmed_mean(distances: Floats) -> float:
    count = max(1, int(np.ceil(_TRIM * len(distances))))
    return float(np.partition(distances, count - 1)[:count].mean())
