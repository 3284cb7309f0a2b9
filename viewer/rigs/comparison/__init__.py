"""Comparison of two figures or motions: magnitude and location of their differences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Literal, TypeAlias

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.phrases import counted, listed, quoted
from viewer.progress import report
from viewer.rigs.arrays import Floats
from viewer.rigs.comparison.pairs import (
    Pairs,
    pair_joints,
    pair_names,
    row_distances,
    skin_at,
)
from viewer.rigs.comparison.steps import FrameRange, Steps, steps_of
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.closest_point import Surface, SurfacePoints
from viewer.rigs.geometry.rotation import nearest_rotations, rotation_distance
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.material import Material, Outline, Rim, Texture
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.pose import placement_matrix
from viewer.rigs.scene import Actor, actor_points
from viewer.rigs.shape import shaped_skeleton
from viewer.rigs.skinning import Skinning, deform
from viewer.rigs.units import METRES, UNIT_NAMES

# A closest-point search takes about a second, so at most this many steps run it.
_MOST_SEARCHES = 32
_ROUNDING = 1e-5  # relative tolerance for numbers that were written as text or as float32
_WORDS = {"is_physical": "surface model", "double_sided": "sidedness", "unlit": "lighting"}


def compare(
    first: Actor,
    second: Actor,
    skinning: Skinning | None = None,
    n_poses: int = 8,
    frames: FrameRange | None = None,
) -> Difference:
    """Compare two actors joint by joint (by name) and vertex by vertex, wherever they stand.

    Vertices are paired by index if the triangles are the same, otherwise with the closest point of
    the other surface, both ways. The first is the reference, and lengths are in its unit. Actors
    are left in the pose in which their meshes are farthest apart. RigError if the range is empty.
    """
    steps = steps_of(first, second, n_poses, frames)
    return _Comparison(first, second, skinning or Skinning(), steps).run()


MeasureKind: TypeAlias = Literal["length", "angle", "weight"]


@dataclass(frozen=True, slots=True)
class Difference:
    """The differences of two figures or motions."""

    measures: tuple[Measure, ...]
    """One for each property that both figures have."""
    mismatches: tuple[Diagnostic, ...]
    """Items that only one figure has, such as joints or frames; no tolerance applies to them."""
    notes: tuple[Diagnostic, ...]
    """Notes on the method of comparison."""
    size: float
    """Diagonal of the box of the first figure's rest mesh, or of its skeleton, in its unit."""
    unit: str
    """Unit of the first figure, as in ``Figure.unit``."""

    def exceeds(self, tolerance: float) -> bool:
        """Return whether a length (fraction of the size), angle or weight exceeds a tolerance."""
        # Written as "not within" rather than "more than", so that NaN exceeds any tolerance.
        within = all(measure.relative(self.size) <= tolerance for measure in self.measures)
        return bool(self.mismatches) or not within or not self.measures


@dataclass(frozen=True, slots=True)
class Measure:
    """The difference of one property."""

    name: str
    """``"joint positions"``, ``"joint orientations"``, ``"vertices"`` …."""
    kind: MeasureKind
    """Lengths are in the first figure's unit, angles in radians; weights are dimensionless."""
    maximum: float
    mean: float
    """Maximum and mean over all compared items and steps."""
    step: str
    item: str
    """Location of the maximum: a frame or test pose, and a joint or vertex. The step is empty for
    weights, which do not depend on the pose."""
    items: tuple[str, ...]
    """Names of the entries of ``item_maxima``; empty for vertices, which have indices."""
    item_maxima: Floats
    """(N,). Largest value of each joint or vertex over all steps; 0 where nothing was compared."""
    n_compared: int
    """Number of values in the mean."""

    def relative(self, size: float) -> float:
        """Return the value that a tolerance applies to: lengths as a fraction of the size."""
        return self.maximum / size if self.kind == "length" and size > 0.0 else self.maximum


def content_notes(first: Figure, second: Figure) -> list[Diagnostic]:
    """Note what differs in content that both have: few formats store all kinds of it."""
    notes = []
    for what, names in (
        ("parts", _parts),
        ("blend shapes", _shapes),
        ("animations", _animations),
    ):
        notes += _lone(what, names(first), names(second))
    return notes + _materials(first, second)


class _Comparison:
    """Two actors, their matched parts, and their accumulated differences."""

    def __init__(self, first: Actor, second: Actor, skinning: Skinning, steps: Steps) -> None:
        self.first, self.second, self.skinning, self.steps = first, second, skinning, steps
        self.mismatches, self.notes = list(steps.mismatches), list(steps.notes)
        self.tallies: list[_Tally] = []
        self.numbers: dict[str, int] = {}  # step numbers, by name of the step
        self._pair_skeletons()
        self._pair_meshes()
        self._pair_points()
        self.notes += content_notes(first.figure, second.figure)
        self.factor = self._unit_factor()

    def _unit_factor(self) -> float:
        """Return the ratio of the second unit to the first; 1 if either is unknown."""
        units = [actor.figure.unit for actor in (self.first, self.second)]
        if units[0] == units[1] or not all(unit in METRES for unit in units):
            return 1.0
        named = {"first": UNIT_NAMES[units[0]], "second": UNIT_NAMES[units[1]]}
        self.notes.append(
            Diagnostic(
                "D002.unit: units differ ({first} and {second}): compared in {first}", values=named
            )
        )
        return METRES[units[1]] / METRES[units[0]]

    def _pair_skeletons(self) -> None:
        first, second = self.first.figure.skeleton, self.second.figure.skeleton
        self.joints: Pairs | None = None
        if first is None or second is None:
            self._lone("D001.skeleton: only the {side} has a skeleton", first, second)
            return
        self.joints = pair_joints(first, second)
        self.mismatches += self.joints.mismatches
        self.notes += self.joints.notes
        names = self.joints.names
        self.places = self._tally("joint positions", "length", len(names), names)
        self.orientations = self._tally("joint orientations", "angle", len(names), names)

    def _pair_meshes(self) -> None:
        first, second = self.first.figure.mesh, self.second.figure.mesh
        self.has_meshes, self.is_same = False, False
        if first is None or second is None:
            self._lone("D001.mesh: only the {side} has a mesh", first, second)
            return
        self.has_meshes, is_as_large = True, first.n_vertices == second.n_vertices
        self.is_same = is_as_large and np.array_equal(first.triangles, second.triangles)
        if self.is_same:
            self.vertices = self._tally("vertices", "length", first.n_vertices)
            return
        counts = {
            "vertices": counted(first.n_vertices, "vertex"),
            "triangles": counted(first.n_triangles, "triangle"),
            "other_vertices": counted(second.n_vertices, "vertex"),
            "other_triangles": counted(second.n_triangles, "triangle"),
        }
        self.notes.append(
            Diagnostic(
                "D002.meshes: meshes differ ({vertices}, {triangles}; {other_vertices}, "
                "{other_triangles}): closest points are compared",
                values=counts,
            )
        )
        self.vertices = self._tally("surface, from the first", "length", first.n_vertices)
        self.back = self._tally("surface, from the second", "length", second.n_vertices)

    def _pair_points(self) -> None:
        first, second = self.first.figure.points, self.second.figure.points
        self.points: Pairs | None = None
        if first is None or second is None:
            self._lone("D001.point-set: only the {side} has captured points", first, second)
            return
        self.points = pair_names(first.names, second.names, "point")
        self.mismatches += self.points.mismatches
        self.notes += self.points.notes
        names = self.points.names
        self.captured = self._tally("captured points", "length", len(names), names)

    def _lone(self, key: str, first: object, second: object) -> None:
        if first is not None or second is not None:
            side = "first" if second is None else "second"
            self.mismatches.append(Diagnostic(key, values={"side": side}))

    def _tally(
        self, name: str, kind: MeasureKind, count: int, items: tuple[str, ...] = ()
    ) -> _Tally:
        self.tallies.append(_Tally(name, kind, count, items))
        return self.tallies[-1]

    def run(self) -> Difference:
        """Compare the actors in all steps."""
        count, size = self.steps.count, 0.0
        n_searches = min(count, _MOST_SEARCHES)
        searched = set(np.linspace(0, count - 1, n_searches).round().astype(int).tolist())
        if self.has_meshes and not self.is_same and count > _MOST_SEARCHES:
            values = {"n": counted(n_searches, "frame", of=count), "all": count}
            self.notes.append(
                Diagnostic("D002.searched: closest points computed in {n}", values=values)
            )
        absent = 0
        for number in range(count):
            step = self.steps.pose(number, self.first, self.second)
            report(number, count)
            if self.first.is_present != self.second.is_present:
                absent += 1
            if not (self.first.is_present and self.second.is_present):
                continue
            self.numbers[step] = number
            if size == 0.0:
                size = _size(self.first)
                self._compare_weights()
                self._compare_shapes()
            self._compare_joints(step)
            self._compare_points(step)
            self._compare_meshes(step, number in searched)
        if absent:
            self.mismatches.append(
                Diagnostic(
                    "D001.absent: only one of the two is present in {n}",
                    values={"n": counted(absent, "frame")},
                )
            )
        self._pose_at_worst()
        measures = [tally.result() for tally in self.tallies]
        return Difference(
            measures=tuple(measure for measure in measures if measure is not None),
            mismatches=tuple(self.mismatches),
            notes=tuple(self.notes),
            size=size,
            unit=self.first.figure.unit,
        )

    def _pose_at_worst(self) -> None:
        """Pose both actors at the step in which the meshes, or the joints, are farthest apart."""
        lengths = [tally for tally in self.tallies if tally.kind == "length" and tally.step]
        if not lengths:
            return
        of_meshes = [tally for tally in lengths if not tally.items]
        worst = max(of_meshes or lengths, key=lambda tally: tally.worst).step
        self.steps.pose(self.numbers[worst], self.first, self.second)

    def _compare_joints(self, step: str) -> None:
        if self.joints is None:
            return
        worlds = [
            _joint_frames(actor)[chosen]
            for actor, chosen in (
                (self.first, self.joints.first),
                (self.second, self.joints.second),
            )
        ]
        offsets = worlds[0][:, :3, 3] - self.factor * worlds[1][:, :3, 3]
        self.places.add(step, np.linalg.norm(offsets, axis=1))
        # Joints may scale or shear: only the rotations are compared.
        rotations = [nearest_rotations(world[:, :3, :3])[0] for world in worlds]
        self.orientations.add(step, rotation_distance(rotations[0], rotations[1]))

    def _compare_points(self, step: str) -> None:
        if self.points is None or self.first.points is None or self.second.points is None:
            return
        one = self.first.points[self.points.first]
        other = self.second.points[self.points.second]
        distances = np.linalg.norm(one[:, :3] - self.factor * other[:, :3], axis=1)
        seen = (one[:, 3] > 0.0) & (other[:, 3] > 0.0)
        self.captured.add(step, np.where(seen, distances, np.nan))

    def _compare_meshes(self, step: str, searches: bool) -> None:
        if not self.has_meshes or not (self.is_same or searches):
            return
        one, other = self._posed(self.first), self._posed(self.second)
        if self.is_same:
            self.vertices.add(step, np.linalg.norm(one - other, axis=1))
            return
        self.vertices.add(step, _closest(one, other, self.second).distances)
        self.back.add(step, _closest(other, one, self.first).distances)

    def _compare_weights(self) -> None:
        """Compare the weights once, as they do not depend on the pose."""
        first, second = self.first.figure, self.second.figure
        if first.skin is None or second.skin is None or self.joints is None:
            return
        other = second.skin
        if not self.is_same:
            found = _closest(self._posed(self.first), self._posed(self.second), self.second)
            other = skin_at(second.skin, second.require_mesh().triangles, found)
        tally = self._tally("weights", "weight", first.skin.n_vertices)
        tally.add("", row_distances(first.skin, other, self.joints))

    def _compare_shapes(self) -> None:
        """Compare the offsets of blend shapes with the same name on the same mesh."""
        first, second = self.first.figure.blend_shapes, self.second.figure.blend_shapes
        if first is None or second is None or not self.is_same:
            return
        pairs = [
            (index, second.names.index(name))
            for index, name in enumerate(first.names)
            if name in second.names
        ]
        if not pairs:
            return
        one, other = np.array(pairs).T
        converted = self.factor * second.direction_values()[other]
        distances = np.linalg.norm(first.direction_values()[one] - converted, axis=-1)
        tally = self._tally("blend shapes", "length", distances.shape[-1])
        tally.add("", distances.max(axis=0))

    def _posed(self, actor: Actor) -> Floats:
        """Return the posed vertices in the unit of the first figure."""
        factor = self.factor if actor is self.second else 1.0
        return factor * deform(actor.figure, actor.own_pose, self.skinning)[0]


class _Tally:
    """Running maximum of a ``Measure``; ``worst`` is negative before the first step."""

    def __init__(
        self, name: str, kind: MeasureKind, count: int, items: tuple[str, ...] = ()
    ) -> None:
        self.name, self.kind, self.items = name, kind, items
        self._maxima = np.zeros(count)
        self._sum, self._count = 0.0, 0
        self.worst, self.step, self._item = -1.0, "", -1

    def add(self, step: str, values: Floats) -> None:
        """Add the values of one step, NaN for items that cannot be compared."""
        known = ~np.isnan(values)
        if not known.any():
            return
        filled = np.where(known, values, 0.0)
        np.maximum(self._maxima, filled, out=self._maxima)
        self._sum += float(filled.sum())
        self._count += int(known.sum())
        item = int(filled.argmax())
        if filled[item] > self.worst:
            self.worst, self.step, self._item = float(filled[item]), step, item

    def result(self) -> Measure | None:
        """Return the measure; None if nothing was compared."""
        if self._count == 0:
            return None
        item = self.items[self._item] if self.items else f"vertex {self._item}"
        return Measure(
            name=self.name,
            kind=self.kind,
            maximum=self.worst,
            mean=self._sum / self._count,
            step=self.step,
            item=item,
            items=self.items,
            item_maxima=self._maxima,
            n_compared=self._count,
        )


def _closest(points: Floats, positions: Floats, actor: Actor) -> SurfacePoints:
    return Surface(positions, actor.figure.require_mesh().triangles).closest(points)


def _joint_frames(actor: Actor) -> Floats:
    """Return the joint matrices with the figure's own scale and translation: (J, 4, 4)."""
    pose = actor.pose
    shape = shaped_skeleton(actor.figure, pose.shape_weights)
    return placement_matrix(pose) @ world_matrices(shape, pose)


def _size(actor: Actor) -> float:
    """Return the diagonal of the rest mesh's box, or of the posed joints if there is no mesh."""
    mesh = actor.figure.mesh
    points = actor_points(actor) if mesh is None else mesh.positions
    return box_size(bounding_box(points))


def _parts(figure: Figure) -> Sequence[str]:
    return () if figure.mesh is None else figure.mesh.parts


def _shapes(figure: Figure) -> Sequence[str]:
    return () if figure.blend_shapes is None else figure.blend_shapes.names


def _animations(figure: Figure) -> Sequence[str]:
    return [animation.name for animation in figure.animations]


def _lone(what: str, first: Sequence[str], second: Sequence[str]) -> list[Diagnostic]:
    """Return notes about names that only one of two lists has."""
    if not first or not second:
        return []
    notes = []
    for side, names, others in (("first", first, second), ("second", second, first)):
        lone = sorted(set(names) - set(others))
        if lone:
            values = {"what": what, "side": side, "names": listed(lone)}
            notes.append(Diagnostic("D002.only: {what} only in the {side}: {names}", values=values))
    return notes


def _materials(first: Figure, second: Figure) -> list[Diagnostic]:
    """Return notes about materials, matched by name, or by index if unnamed."""
    if first.mesh is None or second.mesh is None:
        return []
    one, other = _named(first.mesh.materials), _named(second.mesh.materials)
    notes = _lone("materials", list(one), list(other))
    for name in one.keys() & other.keys():
        properties = _different(one[name], other[name])
        if properties:
            values = {"name": quoted(name), "properties": listed(properties)}
            notes.append(
                Diagnostic("D002.material: material {name} differs: {properties}", values=values)
            )
    return sorted(notes, key=lambda note: str(note.values.get("name", "")))


def _named(materials: Sequence[Material]) -> dict[str, Material]:
    """Return materials by name; those without a name, or with one already used, by index."""
    result: dict[str, Material] = {}
    for index, material in enumerate(materials):
        is_own = material.name and material.name not in result
        result[material.name if is_own else f"#{index}"] = material
    return result


def _different(one: Material, other: Material) -> list[str]:
    """Return the names of the properties in which two materials differ."""
    names = [each.name for each in fields(Material) if each.name != "name"]
    return [
        _WORDS.get(name, name.replace("_", " "))
        for name in names
        if not _equal(getattr(one, name), getattr(other, name))
    ]


def _equal(one: object, other: object) -> bool:
    if isinstance(one, Texture) and isinstance(other, Texture):
        # Textures are the same if they look the same: their names are file names.
        placed = (one.channel, one.uv_set, one.wrap) == (other.channel, other.uv_set, other.wrap)
        if not placed or not _same_transform(one, other):
            return False
        if one.image is None or other.image is None:
            return one.image is other.image
        return one.image is other.image or np.array_equal(one.image, other.image)
    if isinstance(one, Rim | Outline) and type(one) is type(other):
        return all(_equal(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    if isinstance(one, float | tuple) and isinstance(other, float | tuple):
        first, second = np.asarray(one, dtype=float), np.asarray(other, dtype=float)
        return first.shape == second.shape and np.allclose(first, second, atol=_ROUNDING)
    return one == other


def _same_transform(one: Texture, other: Texture) -> bool:
    if one.transform is None or other.transform is None:
        return one.transform is other.transform
    return np.allclose(one.transform, other.transform, atol=_ROUNDING)
