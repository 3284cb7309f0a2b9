"""Trunk of a solid, where its skeleton has its root, and the limbs outwards from there.

The tree of limbs is made twice: first from a deep voxel near the middle, to find the trunk, then
from there. If the trunk is where the first search began, but not between its limbs, or if it is a
plate, such as the top of a table, and the search began far from its middle, the tree is made again
from there, up to three times. The trunk is where most limbs meet, so that no branch has most of the
tips; the foot of what stands on one limb, such as a plant or a robot's arm; the thick part between
two limbs; or the thicker end of what has no branches.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.autorig.anatomy import arc_lengths
from viewer.autorig.limbs.tree import PLATE, Tree, at_lengths, is_bone_inside, tree_of
from viewer.autorig.medial import Paths
from viewer.autorig.solid import Solid
from viewer.progress import report_fraction
from viewer.rigs.arrays import Bools, Floats, Ints

# Distance from the middle of the solid that one more unit of radius is worth where the search for
# the trunk begins: the deepest place may be at a border, as where the seat, the back and a leg of a
# chair meet. Beyond 1, that place is in the middle between surfaces.
_DEEP = 5.0
_ROUNDS = 4  # searches from the trunk: each finds the middle of a plate better
# Distance of a plate's middle, relative to the distance at which limbs begin, from where their
# search may as well begin: the limbs that it finds are the same.
_NEAR = 0.25
# What stands on one limb: heights of the lowest surface of the foot and of all other tips, relative
# to the solid's, and the ratio of the foot's half width to their radii.
_FOOT, _STANDS, _STEADY = 0.05, 0.12, 1.5
_UPRIGHT = 0.3  # height, relative to the size, of what stands rather than lies
# Radius or half width of a trunk between two limbs, relative to both: of a kettlebell, not of a
# snake.
_BODY = 2.0

# Length of the part of a trunk beyond its middle, relative to its half width, if it is long.
_SLENDER = 2.0


def rooted_tree(solid: Solid, paths: Paths, up: Floats) -> Tree:
    """Return the hubs and chains of a solid outwards from its trunk."""
    centers = solid.centers(solid.voxels)
    apart = np.linalg.norm(centers - centers.mean(axis=0), axis=1)
    source = int((apart - _DEEP * paths.radii).argmin())
    report_fraction(0.1)
    tree = tree_of(solid, paths, source)
    report_fraction(0.4)
    root: int | None = source
    if len(tree.chains):
        root = _trunk(solid, paths, tree, up)
        if root == source:
            # From a spider's abdomen, which is deeper, legs of the other part look like one.
            root = _middle(solid, tree, _between_limbs(tree))
    cuts = [tree.cuts]
    for _ in range(_ROUNDS):
        if root is None or root == tree.rows[0]:
            break
        # Loops stay cut.
        tree = tree_of(solid, paths, root)
        cuts.append(tree.cuts)
        root = _middle(solid, tree, _middle_of_plate(tree))
    return replace(_centred(solid, tree), cuts=np.concatenate(cuts))


def _trunk(solid: Solid, paths: Paths, tree: Tree, up: Floats) -> int:
    """Return the voxel in which the skeleton has its root."""
    heights = solid.centers(solid.voxels) @ up
    low, high = float(heights.min()), float(heights.max())
    inwards = [route[::-1] for route in tree.routes]
    ends = [int(route[0]) for route in inwards]
    if sum(chain.start == 0 for chain in tree.chains) == 1:
        blunt, is_long = _blunt_end(solid, paths, tree)
        inwards.append(blunt)
        ends.append(int(blunt[0 if is_long else -1]))
    inside = [_inside_end(solid, paths, route) for route in inwards]
    wide = paths.radii[inside]
    relative = (heights[inside] - wide - low) / max(high - low, solid.spacing)
    foot = int(relative.argmin())
    others = np.delete(np.arange(len(inside)), foot)
    steady = float(wide[foot])
    if high - low >= _UPRIGHT * solid.spacing * max(solid.inside.shape):
        # A foot may be a flat disc, which is as steady as it is wide; the jaw of a snake is none.
        steady = max(steady, footprint(solid, heights <= low + _FOOT * (high - low), up))
    if (
        relative[foot] <= _FOOT
        and (relative[others] >= _STANDS).all()
        and (steady >= _STEADY * wide[others]).all()
    ):
        top = low + 2.0 * float(wide[foot])
        if top > 0.5 * (low + high):  # a snake
            return inside[foot]
        # The way from a tip enters a foot at its rim. Nothing else is as low.
        is_foot = heights <= top
        return _deepest_near(solid, solid.centers(solid.voxels[is_foot]).mean(axis=0))
    if len(inwards) == 2:
        begins = [chain.begin for chain in tree.chains if chain.start == 0]
        thickest = max(chain.half_width for chain in tree.chains)
        # A foot of two posts is wider than thick.
        half = max(float(tree.radii[0]), min(begins))
        if len(begins) == 2 and half >= _BODY * thickest:
            return int(tree.rows[0])
        return _thicker_end(solid, paths, ends)
    # As in the centroid of a tree, with tips as weights; ties go to the wider place.
    count = len(tree.routes)
    most = []
    for hub in range(len(tree.hubs)):
        beyond = [len(chain.tips) for chain in tree.chains if chain.start == hub]
        before = count - sum(beyond) if hub else 0
        most.append((max([before, *beyond]), -float(tree.radii[hub])))
    return int(tree.rows[min(range(len(most)), key=lambda hub: most[hub])])


def footprint(solid: Solid, lowest: Bools, up: Floats) -> float:
    """Return the radius of the largest circle below the lowest voxels, a mask (N,) of all."""
    from scipy import ndimage

    voxels = solid.voxels[lowest]
    upwards = int(np.abs(up).argmax())
    ground = np.zeros(np.delete(solid.inside.shape, upwards), dtype=np.bool_)
    ground[tuple(np.delete(voxels, upwards, axis=1).T)] = True
    return solid.spacing * float(ndimage.distance_transform_edt(ground).max())


def _blunt_end(solid: Solid, paths: Paths, tree: Tree) -> tuple[Ints, bool]:
    """Return the voxels of the way from the end opposite of the only limb to the first hub.

    Also returns whether that part is long: the head of a fish is no limb, as it is wider than long,
    but the end of a long trunk. The foot of a bottle or the hat of a mushroom is not.
    """
    from scipy.sparse import csgraph

    hub = int(tree.rows[0])
    (limb,) = (chain for chain in tree.chains if chain.start == 0)
    (outer,) = solid.nearest(limb.points[-1:]).tolist()
    ways, inner = csgraph.dijkstra(paths.steps, indices=[outer, hub])
    # What is nearer to the end of the limb is beyond it: the other branches of a plant.
    beyond = (ways >= ways[hub]) & (ways >= inner)
    end = int(np.where(beyond, ways, -1.0).argmax())
    (found,) = paths.to(np.array([hub]), np.array([end]))
    if end == hub:
        return found, False
    # As in ``LevelSets.half_widths``, but of the second largest extent: a plate has two.
    extents = np.linalg.eigvalsh(np.cov(solid.centers(solid.voxels[beyond]).T))
    return found, bool(ways[end] - ways[hub] >= _SLENDER * 2.0 * np.sqrt(extents[1]))


def _middle(solid: Solid, tree: Tree, place: Floats | None) -> int | None:
    """Return the voxel in the middle of a trunk around a place; None if the root is near it."""
    if place is None:
        return None
    begins = [chain.begin for chain in tree.chains if chain.start == 0]
    # The second is less than the first in a plate.
    near = max(_NEAR * float(np.median(begins)), float(tree.radii[0]))
    return None if np.linalg.norm(place - tree.hubs[0]) <= near else _deepest_near(solid, place)


def _middle_of_plate(tree: Tree) -> Floats | None:
    """Return the middle (3,) of a trunk that is a plate, as a table's; None for other trunks.

    The deepest place may be where the plate and one leg meet.
    """
    begins = [chain.begin for chain in tree.chains if chain.start == 0]
    is_plate = len(begins) >= 3 and np.median(begins) > PLATE * tree.radii[0]
    return _between_limbs(tree) if is_plate else None


def _between_limbs(tree: Tree) -> Floats | None:
    """Return the middle (3,) of where limbs begin around the trunk; None for less than three."""
    limbs = [chain for chain in tree.chains if chain.start == 0]
    if len(limbs) < 3:
        return None
    bases = [at_lengths(limb.points, np.array([limb.begin]))[0] for limb in limbs]
    middle: Floats = np.mean(bases, axis=0)
    return middle


def _centred(solid: Solid, tree: Tree) -> Tree:
    """Return a tree whose root is in the middle of a trunk that is a plate, not only near it."""
    middle = _middle_of_plate(tree)
    if middle is None:
        return tree
    root = solid.centers(solid.voxels[_deepest_near(solid, middle)])
    if not all(
        is_bone_inside(solid, root, chain.points[1]) for chain in tree.chains if chain.start == 0
    ):
        return tree
    chains = tuple(chain if chain.start else chain.starting(root) for chain in tree.chains)
    return replace(tree, hubs=np.concatenate([root[None], tree.hubs[1:]]), chains=chains)


def _deepest_near(solid: Solid, place: Floats) -> int:
    """Return the deepest voxel in the ball around the one that is nearest to a place (3,)."""
    centers, radii = solid.centers(solid.voxels), solid.radii()
    nearest = solid.nearest(place[None])[0]
    apart = np.linalg.norm(centers - centers[nearest], axis=1)
    near = np.flatnonzero(apart <= radii[nearest])  # not back to a deeper part beside it
    return int(near[np.lexsort((apart[near], -radii[near]))[0]])


def _thicker_end(solid: Solid, paths: Paths, ends: list[int]) -> int:
    """Return the end of a solid without branches at which its third is thicker."""
    (route,) = paths.to(np.array(ends[:1]), np.array(ends[1:]))
    third = max(1, len(route) // 3)
    first, last = paths.radii[route[:third]].mean(), paths.radii[route[-third:]].mean()
    return _inside_end(solid, paths, route if first > last else route[::-1])


def _inside_end(solid: Solid, paths: Paths, route: Ints) -> int:
    """Return the voxel in the middle of the solid near the beginning of a path from a tip."""
    if len(route) < 2:
        return int(route[0])
    lengths = arc_lengths(solid.centers(solid.voxels)[route])
    radius = float(np.median(paths.radii[route]))
    near = lengths <= max(2.0 * radius, solid.spacing)
    return int(route[int(np.where(near, paths.radii[route], -1.0).argmax())])
