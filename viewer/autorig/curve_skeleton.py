"""Curve skeleton of any solid with limbs: joints where it branches and bends, or evenly spaced.

The limbs are the protrusions of the solid as seen from its trunk (``limbs``): the way from there to
their tips (``tree``, ``trunk``), those that mirror each other (``sides``) and their joints
(``joints``).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from viewer.autorig.alignment.orientation_search import (
    axis_direction,
    axis_rotations,
)
from viewer.autorig.alignment.surface_alignment import AlignmentSettings
from viewer.autorig.anatomy import arc_lengths
from viewer.autorig.checks import require_target
from viewer.autorig.limbs.joints import joint_points, parted
from viewer.autorig.limbs.sides import TRUNK, Names, completed, on_plane, symmetry_of
from viewer.autorig.limbs.tree import Tree
from viewer.autorig.limbs.trunk import rooted_tree
from viewer.autorig.medial import Paths
from viewer.autorig.parts import MOST_PARTS, Parts, parts_of
from viewer.autorig.settings import SkeletonSettings
from viewer.autorig.solid import Solid, solid_within
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase, note
from viewer.errors import RigError
from viewer.phrases import Remedy, counted, listed, rounded
from viewer.progress import part_of_work, report_fraction
from viewer.rigs.arrays import Floats, Ints, largest_first
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh
from viewer.rigs.skeleton import ball_skeleton

_FINEST = 160  # voxels along the longest side of thin meshes: legs of spiders
_OWN_JOINTS = Remedy("Edit skeleton adds joints", "--skeleton takes a skeleton with joints there")
# Fractions of the solid in an object that only touches the largest one: of one that is refused,
# and of one that is reported. Smaller ones are ornaments.
_OBJECT, _PART = 0.2, 0.05
_APART, _FEW = 3.0, 0.02  # distance in voxels from the solid, and fraction of the vertices there
# Distance from the skeleton, relative to its half width and to the largest radius of the solid, and
# fraction of the solid there for which sheets are reported.
_FAR, _MISSED = 2.0, 0.1
# Radius of what is thin, such as a fin, relative to the largest one, and fraction of the surface
# from which it is reported if it has no joints.
_SLIM, _SEEN = 0.5, 0.02
_SAME = 2.0  # distance in voxels up to which cuts are one: some need two searches
_THIN = 1.0  # radius in voxels of a sheet: its voxels are those of the surface
_ON_GROUND = 0.12  # height of the tip of a leg, relative to the solid's, as in ``anatomy``


@dataclass(frozen=True, slots=True, eq=False)
class CurveSkeleton:
    """A skeleton found in a mesh."""

    figure: Figure
    """The skeleton, without a mesh."""
    lines: tuple[Diagnostic, ...]
    """Messages for the user."""


def find_skeleton(
    source: Figure, target: Mesh, how: SkeletonSettings, alignment: AlignmentSettings
) -> CurveSkeleton:
    """Return the skeleton of a figure's mesh; ``RigError`` if it is no single solid.

    ``alignment``: up axis and front, if they are known. ``target``: the mesh in the current pose.
    """
    require_target(target)
    named = alignment.up or source.up
    # Any axis beside the up axis is a front; the usual ones are those of figures.
    usual = "x" if named[-1] == "z" else "z"
    front = alignment.facing or usual
    axis_rotations(source.up, named, front)  # checks the names
    with part_of_work(span=(0.0, 0.4)):
        solid = solid_within(target.positions, target.triangles, _FINEST, fills_hollows=True)
    n_stray = _check_one(target, solid)
    parts = parts_of(target, solid)
    where = "" if parts.contact is None else listed([rounded(x) for x in parts.contact.tolist()])
    if parts.touching >= _OBJECT:
        raise RigError(
            f"expected one object, found separate ones that only touch, the largest at {where}; "
            "rig each object alone"
        )
    with part_of_work(span=(0.4, 1.0)):
        found = joints_in(
            solid,
            axis_direction(named),
            axis_direction(front),
            how,
            parts,
            is_facing_known=alignment.facing is not None,
        )
    names, parents, places = found.names, found.parents, found.positions
    figure = Figure(
        name=source.name,
        skeleton=ball_skeleton(names, parents, places),
        up="z" if named == "z" else "y" if named == "y" else source.up,
        unit=source.unit,
    )
    lines = [*_lines(found, alignment.facing is None)]
    if parts.count > 1:
        n = counted(parts.count, "separate part", "is", "are")
        lines.append(note("R015.parts: {n} rigged as one object", n=n))
    if parts.count > MOST_PARTS:
        lines.append(
            note(
                "R016.many-parts: only the {most} largest parts were searched for hinges and for "
                "separate objects that touch",
                most=MOST_PARTS,
            )
        )
    if parts.touching >= _PART:
        lines.append(
            note(
                "R016.touching: a part only touches the others at {place}: a separate object "
                "should be rigged alone",
                place=where,
            )
        )
    if n_stray:
        n = counted(n_stray, "vertex", "is", "are")
        lines.append(note("R016.stray: {n} far from the largest part, which has all joints", n=n))
    return CurveSkeleton(figure, tuple(lines))


def _check_one(target: Mesh, solid: Solid) -> int:
    """Return the number of vertices far from the largest part; ``RigError`` if they are many."""
    used = np.unique(target.triangles)
    apart = solid.gaps(target.positions[used]) > _APART * solid.spacing
    if apart.mean() > _FEW:
        raise RigError(
            f"expected one object, found parts far from the largest one: {int(apart.sum())} of "
            f"{counted(len(used), 'vertex')}; rig each object alone"
        )
    return int(apart.sum())


def _lines(found: Joints, is_assumed: bool) -> Iterator[Diagnostic]:
    """Return messages about the joints, their symmetry and the front."""
    if len(found.names) == 1:
        yield note("R016.no-limbs: no limbs found: one joint moves the whole mesh")
        return
    limbs = counted(found.limbs, "limb") if found.limbs else Phrase("the trunk only")
    yield note(
        "R015.skeleton: skeleton found in the mesh: {n}, {limbs}, {pairs} mirrored",
        n=counted(len(found.names), "joint"),
        limbs=limbs,
        pairs=counted(found.pairs, "pair"),
    )
    for place in found.cuts:
        yield note(
            "R016.loop-cut: a loop is cut at {place}: bones cannot form one, so both sides move "
            "apart there",
            place=listed([rounded(value) for value in place.tolist()]),
        )
    if found.has_loops:
        yield note(
            "R016.more-loops: some loops are not cut: one side of each has no joints; {remedy}",
            remedy=_OWN_JOINTS,
        )
    if found.missed > _MISSED:
        yield note(
            "R016.loops: {missed:.0%} of the mesh is far from the skeleton, as wide sheets are, "
            "and has no joints of its own",
            missed=found.missed,
        )
    if len(found.thin):
        yield note(
            "R016.thin: without joints: {n}, {share:.0%} of the surface, the largest at {place}; "
            "{remedy}",
            remedy=_OWN_JOINTS,
            n=counted(len(found.thin), "thin part"),
            share=float(found.thin.sum()),
            place=listed([rounded(value) for value in found.thin_at[0].tolist()]),
        )
    if found.pairs and is_assumed:
        yield note(
            "R015.front: left and right, and numbers from front to back: assuming that the front "
            "is {front}",
            front=_axis_name(found.front),
        )


def _axis_name(way: Floats) -> str:
    """Return the axis next to a direction (3,), with its sign."""
    axis = int(np.abs(way).argmax())
    return f"{'+' if way[axis] > 0.0 else '-'}{'xyz'[axis]}"


@dataclass(frozen=True, slots=True, eq=False)
class Joints:
    """Joints found in a solid."""

    names: tuple[str, ...]
    parents: Ints
    """(J,). -1 for the root, which is the first."""
    positions: Floats
    """(J, 3)."""
    limbs: int
    """Number of limbs that begin at the trunk."""
    pairs: int
    """Number of pairs of them that mirror each other."""
    missed: float
    """Fraction of the solid that is far from the skeleton."""
    thin: Floats
    """(T,). Fractions of the surface in thin parts without joints, the largest first."""
    thin_at: Floats
    """(T, 3). Their middles."""
    cuts: Floats
    """(C, 3). Places where loops were cut."""
    has_loops: bool
    """Whether there are more loops than were cut."""
    front: Floats
    """(3,). The direction that was taken as the front."""


def joints_in(
    solid: Solid,
    up: Floats,
    front: Floats,
    how: SkeletonSettings,
    parts: Parts,
    is_facing_known: bool,
) -> Joints:
    """Return the joints of a solid; ``up``, ``front``: (3,), its directions."""
    report_fraction(0.0, "looking for limbs")
    paths = Paths(solid)
    tree = completed(solid, paths, rooted_tree(solid, paths, up), up, front, how.symmetry)
    if len(tree.chains) == 0 and float(paths.radii.max()) <= _THIN * solid.spacing:
        raise RigError(
            f"expected a solid with limbs, found a sheet without thickness; {_OWN_JOINTS}"
        )
    report_fraction(0.8, "placing joints")
    if parts.count > 1:
        owners = parts.around(tree.levels)[tree.levels]
        chains = tuple(parted(chain, solid, owners, parts.stiff) for chain in tree.chains)
        tree = replace(tree, chains=chains)
    plane, partner = symmetry_of(solid, tree, up, front, how.symmetry)
    if plane is not None and not is_facing_known:
        # The front is in the plane of symmetry: a figure along x does not face along z.
        front = np.cross(plane.lateral, up)
    points = joint_points(solid, tree, plane, partner, how.joint_spacing)
    heights = solid.centers(solid.voxels) @ up
    low = float(heights.min()) + _ON_GROUND * float(np.ptp(heights))
    labels = Names(tree, plane, partner, front if is_facing_known else None)
    chain_names = labels.of_chains(up, low, front)
    names, parents, places = ["root"], [-1], [on_plane(plane, tree.hubs[0])]
    joint_of, counts = {0: 0}, dict[str, int]()
    for chain, name, own in zip(tree.chains, chain_names, points, strict=True):
        above = joint_of[chain.start]
        for index, place in enumerate(own):
            if name.startswith(TRUNK):
                side = name.removeprefix(TRUNK)
                joint = f"{TRUNK}_{counts.setdefault(side, 1)}{side}"
                counts[side] += 1
            elif chain.end < 0 and index and index + 1 == len(own):
                joint = name + "_end"
            else:
                joint = f"{name}_{index + 1}" if index else name
            names.append(joint)
            parents.append(above)
            places.append(place)
            above = len(names) - 1
        if chain.end >= 0:
            joint_of[chain.end] = above
    thin, thin_at = _thin_parts(solid, parts, np.array(parents), np.array(places))
    return Joints(
        tuple(names),
        np.array(parents, dtype=np.int32),
        np.array(places),
        labels.limbs,
        labels.pairs,
        _missed(solid, tree),
        thin,
        thin_at,
        distinct_places(tree.cuts, _SAME * solid.spacing),
        tree.has_loops,
        front,
    )


def distinct_places(places: Floats, least: float) -> Floats:
    """Return the places (N, 3) that are farther than ``least`` from all returned before."""
    found = np.zeros((0, 3))
    for place in places:
        if (np.linalg.norm(found - place, axis=1) > least).all():
            found = np.concatenate([found, place[None]])
    return found


def _missed(solid: Solid, tree: Tree) -> float:
    """Return the fraction of a solid that is far from all chains, as a wide sheet is."""
    from scipy import spatial

    if len(tree.chains) == 0:
        return 0.0
    points = [tree.hubs, *(chain.points for chain in tree.chains)]
    widths = [2.0 * tree.radii]
    for chain in tree.chains:
        # The trunk reaches to where the limb begins: the top of a table needs no joints.
        is_trunk = arc_lengths(chain.points) < chain.begin
        widths.append(np.where(is_trunk, max(chain.begin, chain.half_width), chain.half_width))
    centers = solid.centers(solid.voxels)
    gaps, nearest = spatial.cKDTree(np.concatenate(points)).query(centers)
    # Inside the trunk, the nearest point may be that of a thin limb.
    wide = np.maximum(_FAR * np.concatenate(widths)[nearest], _FAR * float(solid.radii().max()))
    return float((gaps > wide).mean())


def _thin_parts(solid: Solid, parts: Parts, parents: Ints, joints: Floats) -> tuple[Floats, Floats]:
    """Return the parts of a solid that are thin and have no bone, as fins and the brims of hats.

    ``joints`` (J, 3). Returns fractions of the surface (T,), the largest first, and middles (T, 3).
    """
    from scipy import ndimage

    # A ball of half the radius of the trunk does not fit into them: they are not in the opening of
    # the solid by it, which also lacks the edges of a box.
    ball = _SLIM * float(solid.radii().max())
    core = solid.distance >= ball
    beyond = solid.spacing * ndimage.distance_transform_edt(~core) - ball
    labels, count = ndimage.label(solid.inside & (beyond > solid.spacing), np.ones((3, 3, 3)))
    numbers = np.arange(1, count + 1)
    sticks_out = np.array(ndimage.maximum(beyond, labels, numbers)) >= ball
    starts, ends = joints[np.maximum(parents, 0)], joints
    steps = 2 + int(np.linalg.norm(ends - starts, axis=1).max() / solid.spacing)
    bones = np.linspace(starts, ends, steps).reshape(-1, 3)
    own = labels[tuple(solid.voxel_of(bones).T)]
    of_surface = labels[tuple(solid.voxels[parts.rows].T)]
    shares = np.bincount(of_surface, parts.areas, count + 1)[1:] / parts.areas.sum()
    found = np.flatnonzero(sticks_out & ~np.isin(numbers, own) & (shares >= _SEEN))
    found = largest_first(found, shares)
    middles = ndimage.center_of_mass(labels > 0, labels, numbers[found])
    return shares[found], solid.centers(np.array(middles).reshape(-1, 3))
