"""Faults of a figure that spoil its deformation: weights, bind matrices, stray vertices.

They are cheap to find: ``load`` reports them as warnings, ``lint`` reports them among other things.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.phrases import agree, counted, listed, rounded
from viewer.rigs.arrays import Bools, Floats, Ints, largest_first
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh, bounding_box, typical_place
from viewer.rigs.skeleton import joint_labels
from viewer.rigs.skin import Skin, has_influence, owners, weight_sums

if TYPE_CHECKING:
    from viewer.diagnostics.codes import Severity

# The tolerances of all formats. Readers that normalise report what they changed themselves.
_NOTED = 1e-3  # minimum deviation of a sum of weights from 1: files round to three digits
_WRONG = 5e-3  # four influences with three digits, each with an error of half a digit, and a margin
# Maximum determinant of a singular matrix, relative to the product of its column lengths.
_SINGULAR = 1e-12
_NEARLY = 1e6  # minimum condition number of an ill-conditioned matrix
_AFFINE = 1e-6  # maximum absolute error of the last row
UNIT_ROTATION = 1e-3
"""Maximum deviation of the length of a unit quaternion from 1: files round to three digits."""
# Multiple of the median distance of vertices from their median: feet are at 16 times that distance
# in models with half of their vertices in the face.
_FAR = 40.0

Indices = NDArray[np.int64] | Ints
NO_INDICES: Ints = np.zeros(0, dtype=np.int32)
Invalid = Mapping[str, Ints]
"""Data that a reader replaced because the data in the file is invalid: vertices by ``"positions"``
and ``"weights"``, ``"triangles"``, joints by ``"bindings"`` and ``"joints"``, rows by
``"frames"``."""


@dataclass(frozen=True, slots=True, eq=False)
class Fault:
    """A message about elements of a figure."""

    message: str
    """Key and sentence, as of ``Diagnostic``."""
    at: tuple[str, int]
    """Kind and index of the element to look at first, as for ``Source.remember``."""
    values: Mapping[str, Any]
    """Values of the message."""
    vertices: Indices = field(default_factory=lambda: NO_INDICES)
    triangles: Indices = field(default_factory=lambda: NO_INDICES)
    joints: Indices = field(default_factory=lambda: NO_INDICES)
    """(N,): indices, worst first."""
    severity: Severity | None = None
    """Severity, if different from that of the code."""


def faults_of(figure: Figure) -> Iterator[Fault]:
    """Yield all faults of a figure, in the order of the checks of ``lint``."""
    # Products of huge numbers overflow; vertices that far away are reported as strays.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        yield from weight_faults(figure, {})
        yield from bind_faults(figure, {})
        yield from stray_vertices(figure)


def valid(invalid: Invalid, part: str, count: int) -> Bools:
    """Return which of ``count`` items of a part are valid data of the file: (count,)."""
    result = np.ones(count, dtype=np.bool_)
    lost = invalid.get(part, NO_INDICES)
    result[lost[lost < count]] = False
    return result


def weight_faults(figure: Figure, invalid: Invalid) -> Iterator[Fault]:
    """Yield sums of weights that are not 1, negative weights, and vertices without weights."""
    skin, mesh = figure.skin, figure.mesh
    if skin is None or mesh is None:
        return
    # Weights missing from the file cannot be judged.
    known, moved = valid(invalid, "weights", skin.n_vertices), has_influence(skin)
    yield from _sums(skin, moved & known)
    yield from _negative(figure, skin)
    bare = known & ~moved
    if bare.any():
        yield from _bare(mesh, bare)
    if skin.unweighted is not None:
        yield from _attached(figure, skin, np.flatnonzero(skin.unweighted & known))


def _sums(skin: Skin, moved: Bools) -> Iterator[Fault]:
    sums = weight_sums(skin)
    errors = np.where(moved, np.abs(sums - 1.0), 0.0)
    off = np.flatnonzero(errors > _NOTED)
    if len(off):
        off = largest_first(off, errors)
        worst = int(off[0])
        error = float(errors[worst])
        values = {
            "n": counted(len(off), "vertex"),
            "sum": rounded(float(sums[worst]), 6),
            "vertex": worst,
            "error": rounded(error),
        }
        severity: Severity = "warning" if error > _WRONG else "note"
        message = (
            "W001.sums: weights of {n} do not sum to 1 (worst: {sum} at vertex {vertex}, an error "
            "of {error})"
        )
        yield Fault(message, ("weights", worst), values, off, severity=severity)


def _negative(figure: Figure, skin: Skin) -> Iterator[Fault]:
    negative = np.flatnonzero(skin.weights < 0.0)
    if len(negative):
        negative = negative[np.argsort(skin.weights[negative], kind="stable")]
        vertices, joints = owners(skin)[negative], skin.joints[negative]
        values = {
            "n": counted(len(negative), "negative weight"),
            "weight": rounded(float(skin.weights[negative[0]]), 6),
            "vertex": int(vertices[0]),
            "joint": _labels(figure, joints[:1])[0],
        }
        yield Fault(
            "W002.negative: {n} (first: {weight} at vertex {vertex} for joint {joint})",
            ("weights", int(vertices[0])),
            values,
            distinct(vertices),
            joints=distinct(joints),
        )


def _bare(mesh: Mesh, bare: Bools) -> Iterator[Fault]:
    """Yield islands without any weights, and single vertices apart from them."""
    from viewer.rigs.geometry.topology import components, welded

    corners = welded(mesh.positions, mesh.triangles)
    pairs = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]]])
    islands = components(mesh.n_vertices, pairs)[corners[:, 0]]
    # Islands consist of triangles; a loose vertex is not an island.
    has_weights = (~bare)[mesh.triangles].any(axis=1)
    held = np.bincount(islands, has_weights, minlength=mesh.n_vertices)
    lost = held[islands] == 0
    if lost.any():
        vertices = np.unique(mesh.triangles[lost])
        first = int(vertices[0])
        n_islands = len(np.unique(islands[lost]))
        values = {
            "n": counted(n_islands, "island"),
            "n_vertices": counted(len(vertices), "vertex"),
            "have": agree(n_islands, "has", "have"),
            "stay": agree(n_islands, "stays", "stay"),
            "vertex": first,
        }
        message = (
            "W005.islands: {n} with {n_vertices} {have} no weights and {stay} in the bind pose "
            "(first: at vertex {vertex})"
        )
        yield Fault(message, ("weights", first), values, vertices, np.flatnonzero(lost))
        bare = bare.copy()
        bare[vertices] = False
    single = np.flatnonzero(bare)
    if len(single):
        first = int(single[0])
        values = {
            "n": counted(len(single), "vertex", "has", "have"),
            "stay": agree(len(single), "stays", "stay"),
            "vertex": first,
        }
        message = (
            "W004.vertices: {n} no influence and {stay} in the bind pose (first: vertex {vertex})"
        )
        yield Fault(message, ("weights", first), values, single)


def _attached(figure: Figure, skin: Skin, vertices: Indices) -> Iterator[Fault]:
    """Yield vertices that move with a joint only because the file gives them no weights."""
    if len(vertices) == 0:
        return
    first = int(vertices[0])
    joints = distinct(skin.joints[np.isin(owners(skin), vertices)])
    values = {
        "n": counted(len(vertices), "vertex", "has", "have"),
        "follow": agree(len(vertices), "follows", "follow"),
        "names": listed(_labels(figure, joints)),
        "vertex": first,
    }
    message = "W004.attached: {n} no weights and {follow} {names} (first: vertex {vertex})"
    yield Fault(message, ("weights", first), values, vertices)


def are_singular(matrices: Floats) -> Bools:
    """Return which affine matrices (J, 4, 4) have a determinant of 0 within rounding: (J,)."""
    linear = matrices[:, :3, :3]
    lengths = np.linalg.norm(linear, axis=1).prod(axis=1)
    return np.abs(np.linalg.det(linear)) <= _SINGULAR * lengths


def bind_faults(figure: Figure, invalid: Invalid) -> Iterator[Fault]:
    """Yield inverse bind matrices that are singular, ill-conditioned, reflected or not affine."""
    skin = figure.skin
    if skin is None or skin.n_joints == 0:
        return
    known = valid(invalid, "bindings", skin.n_joints)
    linear = np.where(known[:, None, None], skin.inverse_bind[:, :3, :3], np.eye(3))
    determinants, flat = np.linalg.det(linear), are_singular(linear)
    conditions = np.zeros(len(linear))
    conditions[~flat] = np.linalg.cond(linear[~flat])
    off = affine_errors(skin) * known
    for message, wrong, numbers in (
        ("B002.singular: {n} singular: {names} (determinant {value})", flat, determinants),
        (
            "B003.ill-conditioned: {n} ill-conditioned: {names} (condition number {value})",
            conditions > _NEARLY,
            conditions,
        ),
        (
            "B005.reflected: {n} reflected: {names} (determinant {value})",
            (determinants < 0.0) & ~flat,
            determinants,
        ),
        ("B006.not-affine: {n} not affine: {names} (error {value})", off > _AFFINE, off),
    ):
        joints = np.flatnonzero(wrong)
        if len(joints):
            first, names = int(joints[0]), _labels(figure, joints)
            values = {
                "n": counted(len(joints), "bind matrix", "is", "are", of=len(linear)),
                "all": len(linear),
                "names": listed(names),
                # Adding 0 makes -0 positive.
                "value": rounded(float(numbers[first]) + 0.0),
            }
            yield Fault(message, ("bindings", first), values, joints=joints)


def affine_errors(skin: Skin) -> Floats:
    """Return the largest error of the last row of each inverse bind matrix: (J,)."""
    errors: Floats = np.abs(skin.inverse_bind[:, 3] - [0.0, 0.0, 0.0, 1.0]).max(axis=1)
    return errors


def are_usable(skin: Skin) -> Bools:
    """Return which inverse bind matrices are affine and can be inverted: (J,)."""
    usable: Bools = ~are_singular(skin.inverse_bind) & (affine_errors(skin) <= _AFFINE)
    return usable


def stray_vertices(figure: Figure) -> Iterator[Fault]:
    """Yield vertices that are much farther from the middle of the mesh than most."""
    mesh = figure.mesh
    if mesh is None or mesh.n_vertices == 0:
        return
    center, typical = typical_place(mesh)
    # The box is computed faster than the distances of all vertices.
    farthest = np.abs(bounding_box(mesh.positions) - center).max()
    if not farthest > _FAR * typical > 0.0:
        return
    distances = np.abs(mesh.positions - center).max(axis=1)
    far = np.flatnonzero(distances > _FAR * typical)
    far = largest_first(far, distances)
    first = int(far[0])
    values = {
        "n": counted(len(far), "stray vertex"),
        "vertex": first,
        "ratio": rounded(float(distances[first] / typical), 2),
    }
    message = (
        "M010.vertices: {n} (worst: vertex {vertex}, {ratio} times the typical distance from the "
        "centre)"
    )
    yield Fault(message, ("positions", first), values, far)


def _labels(figure: Figure, joints: Indices) -> list[str]:
    if figure.skeleton is None:
        return [f"#{joint}" for joint in joints]
    labels = joint_labels(figure.skeleton)
    return [labels[joint] for joint in joints]


def distinct(values: Indices) -> Indices:
    """Return each value once, in the given order."""
    _, first = np.unique(values, return_index=True)
    return values[np.sort(first)]
