"""The facing direction of a figure or scene: a horizontal axis, from several kinds of evidence.

Each kind (sides, toes, faces, heads and tails, soles, travel) yields a horizontal vector towards
the front. Its length is the confidence: 1 for complete and consistent evidence, 0 for none. The
weighted sum is the vote of a figure, and the axis nearest to the mean vote of all figures is the
front.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeAlias

import numpy as np

from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.geometry.vectors import Up, axis_vector, reflected
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.retargeting.joint_names import joint_meanings, sided_words
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skinning import joint_matrices

Front: TypeAlias = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
"""A signed axis, such as ``"+z"``; never the up axis."""
WantedFront: TypeAlias = Front | Literal["auto"]
"""A front, or that it is estimated."""
FRONTS: tuple[Front, ...] = ("+x", "-x", "+y", "-y", "+z", "-z")
"""All signed axes; the two along a scene's up axis do not apply to it."""
_MOST_ACTORS, _MOST_JOINTS, _MOST_VERTICES = 16, 2000, 100_000
_N_TIMES = 9  # number of sampled frames of a motion
_SURE = 0.5  # minimum component of a vote along an axis; smaller ones are inconclusive
_WEIGHTS = {"sides": 3.0, "toes": 2.0, "face": 2.0, "ends": 2.0, "travel": 1.0}
"""Weight of each kind of evidence.

Joint names state left and right explicitly; the other kinds are heuristics and outvote names
only if they agree. Travel has the smallest weight, as a person may walk backwards.
"""

# Minimum length of offsets with a reliable direction, as a fraction of the figure's size.
_LEAST = 0.01

# Minimum distance from the centre, as a fraction of the figure's size, of a head in front of the
# body.
_CLEAR = 0.2
_TOES, _FACE = ("toe", "ball"), ("eye", "nose", "jaw", "beak", "muzzle", "snout")

# Height of the soles and range of the ankles, as fractions of the figure's height.
_SLAB, _ABOVE = 0.015, (0.05, 0.09)

# Minimum fraction of a symmetric mesh's vertices whose mirror images are near other vertices.
_MIRRORED = 0.98
_LOOKED_AT = 2000  # maximum number of vertices in the symmetry test


def usual_front(up: Up) -> Front:
    """Return the default front: +z if y is up, -y if z is up."""
    return "+z" if up == "y" else "-y"


def front_axes(up: Up) -> tuple[Front, ...]:
    """Return the four horizontal fronts: +x, -x, +z and -z if y is up."""
    return tuple(front for front in FRONTS if front[1] != up)


def guess_front(scene: Scene) -> Front:
    """Estimate the front of a posed scene; ``usual_front`` if the evidence is weak.

    Each actor votes by its posed joints (left and right, toes, face, head and tail) and the
    direction of its motion, or by the shape of its feet if it has neither joints nor captured
    points. The votes of actors that face opposite directions cancel out.
    """
    return clear_front(scene) or usual_front(scene.up)


def clear_front(scene: Scene) -> Front | None:
    """Return the front for which there is clear evidence; None without it."""
    up = axis_vector(scene.up)
    drawn = [actor for actor in scene.actors if actor.is_drawn][:_MOST_ACTORS]
    votes = [vote for actor in drawn if (vote := _vote(actor, up)).any()]
    return _nearest(sum(votes, np.zeros(3)) / max(len(votes), 1), scene.up)


def _nearest(vote: Floats, up: Up) -> Front | None:
    """Return the axis closest to a vote; None if none is close."""
    fronts = front_axes(up)
    signs = [1.0 if front[0] == "+" else -1.0 for front in fronts]
    axes = ["xyz".index(front[1]) for front in fronts]
    components = vote[axes] * signs
    best = int(np.argmax(components))
    return fronts[best] if components[best] >= _SURE else None


def _vote(actor: Actor, up: Floats) -> Floats:
    """Return the direction of an actor's front: a unit vector, 0 if unclear."""
    names, parents, places = _places(actor)
    if not names:
        mesh = actor.figure.mesh
        way = np.zeros(3)
        if mesh is not None and mesh.n_vertices and actor.figure.skeleton is None:
            some = mesh.positions[:: max(mesh.n_vertices // _MOST_VERTICES, 1)]
            way = _from_soles(apply_transform(actor.placement, some), up)
        return _unit(way, _SURE)
    found = {
        "sides": _from_sides(names, places, up),
        # Toes are in front of their parent joints, eyes and jaws in front of the head joint.
        "toes": _by_word(_TOES, names, parents, places, up),
        "face": _by_word(_FACE, names, parents, places, up),
        "ends": _from_ends(names, places, up),
        "travel": _from_travel(_path(actor), box_size(bounding_box(places)), up),
    }
    # Every kind is a vector of length 0 to 1, whose sum is a weighted vote: kinds that agree add
    # up, kinds that disagree cancel, and a kind without evidence does not vote. At least a quarter
    # of what those with evidence could say together must be left.
    total = sum(weight for kind, weight in _WEIGHTS.items() if found[kind].any())
    vote = sum((_WEIGHTS[kind] * way for kind, way in found.items()), np.zeros(3))
    return _unit(vote, max(0.25 * total, _SURE))


def _unit(way: Floats, least: float) -> Floats:
    length = float(np.linalg.norm(way))
    return way / length if length >= least else np.zeros(3)


def _places(actor: Actor) -> tuple[tuple[str, ...], Ints, Floats]:
    """Return names, parents and positions of an actor's joints or captured points."""
    nothing: tuple[tuple[str, ...], Ints, Floats] = (), np.zeros(0, np.int32), np.zeros((0, 3))
    figure = actor.figure
    if actor.points is not None and figure.points is not None:
        seen = np.flatnonzero(actor.points[:, 3] > 0.0)
        names = tuple(figure.points.names[point] for point in seen)
        roots = np.full(len(seen), -1, np.int32)
        return names, roots, apply_transform(actor.placement, actor.points[seen, :3])
    if figure.skeleton is None or actor.own_pose is None or figure.skeleton.n_joints > _MOST_JOINTS:
        return nothing
    joints = joint_matrices(figure, actor.own_pose)[:, :3, 3]
    skeleton = figure.skeleton
    return (
        # Joint roles stated by the file are more certain than joint names.
        joint_meanings(skeleton) if skeleton.humanoid is not None else skeleton.names,
        skeleton.parents,
        apply_transform(actor.placement, joints),
    )


def _path(actor: Actor) -> Floats:
    """Return the path of an actor's centre over its motion, scene space: (F, 3)."""
    clip = actor.clip
    if clip is None or clip.end <= clip.start:
        return np.zeros((0, 3))
    times = np.linspace(clip.start, clip.end, _N_TIMES)
    if clip.points is not None:
        found = clip.sample(None, times)
        assert found.points is not None  # it is a motion of points
        seen = [points[points[:, 3] > 0.0, :3] for points in found.points[found.present]]
        places = np.array([points.mean(axis=0) for points in seen if len(points)])
    else:
        from viewer.rigs.motion.evaluation import frames_between, frames_of, world_frames

        frames = frames_of(actor.figure, clip, times, actor.own_pose)
        frames = frames_between(frames, np.flatnonzero(frames.present))
        places = world_frames(actor.figure, frames)[..., :3, 3].mean(axis=1)
    return apply_transform(actor.placement, places.reshape(-1, 3))


def _from_sides(names: Sequence[str], places: Floats, up: Floats) -> Floats:
    """Return evidence from left and right joints: the mean of the pairs' unit vectors left x up."""
    # With y up and left along +x, left x up is x cross y = z, the front; the same in any axes.
    found: dict[str, dict[str, list[Floats]]] = {}
    for (side, word), place in zip(sided_words(names), places, strict=True):
        if side:
            found.setdefault(word, {"left": [], "right": []})[side].append(place)
    pairs = [
        np.mean(pair["left"], axis=0) - np.mean(pair["right"], axis=0)
        for pair in found.values()
        if pair["left"] and pair["right"]
    ]
    across = _horizontal(np.array(pairs).reshape(-1, 3), up)
    return _agreement(np.cross(across, up), _size(places))


def _by_word(
    words: tuple[str, ...], names: Sequence[str], parents: Ints, places: Floats, up: Floats
) -> Floats:
    """Return the mean direction from parents to joints whose names contain a word."""
    chosen = [
        joint
        for joint, (_, word) in enumerate(sided_words(names))
        if parents[joint] >= 0 and any(part in word for part in words)
    ]
    ways = places[chosen] - places[parents[chosen]]
    return _agreement(_horizontal(ways, up), _size(places))


def _from_ends(names: Sequence[str], places: Floats, up: Floats) -> Floats:
    """Return evidence from the ends of an animal: the head is in front, the tail behind."""
    words = [word for _, word in sided_words(names)]
    heads = [j for j, word in enumerate(words) if word.startswith("head")]
    tails = [j for j, word in enumerate(words) if word.startswith("tail")]
    size = _size(places)
    if not size or not (heads or tails):
        return np.zeros(3)
    others = [j for j in range(len(words)) if j not in heads and j not in tails]
    middle = places[others or slice(None)].mean(axis=0)
    ahead = places[heads].mean(axis=0) - middle if heads else np.zeros(3)
    behind = places[tails].mean(axis=0) - middle if tails else np.zeros(3)
    # A head directly above the centre, as in people, has no horizontal part: no evidence.
    way = _horizontal(ahead - behind, up) / (_CLEAR * size)
    return way / max(float(np.linalg.norm(way)), 1.0)


def _from_travel(places: Floats, size: float, up: Floats) -> Floats:
    """Return evidence from positions (F, 3) over time: figures usually move forwards."""
    # A straight walk has a displacement as long as its path: length 1. Walking in a circle, or to
    # and fro, returns to the start: near 0. A path shorter than the figure is no travel but
    # balancing.
    steps = _horizontal(np.diff(places, axis=0), up)
    path = float(np.linalg.norm(steps, axis=1).sum())
    return steps.sum(axis=0) / max(path, size) if size > 0.0 else np.zeros(3)


def _from_soles(positions: Floats, up: Floats) -> Floats:
    """Return evidence from a mesh alone: two symmetric soles that extend in front of the ankles."""
    # People are symmetric, so the front lies in the mirror plane; which of its two directions it is
    # show the feet: the middle of the soles (the lowest 1.5 % of the height) is in front of the
    # middle of the ankles (5 to 9 %). Both sides of the plane need a sole: a vase has one in the
    # middle.
    height = positions @ up
    low, tall = float(height.min()), float(np.ptp(height))
    planes = [
        axis
        for axis in range(3)
        if up[axis] == 0.0 and tall > 0.0 and _is_symmetric(positions, axis)
    ]
    if len(planes) != 1:
        return np.zeros(3)
    box = bounding_box(positions)
    beside = positions[:, planes[0]] - box.mean(axis=0)[planes[0]]
    soles = height < low + _SLAB * tall
    ankles = (height > low + _ABOVE[0] * tall) & (height < low + _ABOVE[1] * tall)
    is_apart = (np.abs(beside[soles]) > _LEAST * tall).all()
    if not ankles.any() or not is_apart:
        return np.zeros(3)
    way = positions[soles].mean(axis=0) - positions[ankles].mean(axis=0)
    way[planes[0]] = 0.0
    # Soles that extend in front of the ankles by at least 2 % of the height are full evidence.
    way = _horizontal(way, up) / (2.0 * _LEAST * tall)
    return way / max(float(np.linalg.norm(way)), 1.0)


def _is_symmetric(positions: Floats, axis: int) -> bool:
    """Return whether a mesh is nearly symmetric about a plane through its centre."""
    size = _LEAST * _size(positions)
    middle = bounding_box(positions).mean(axis=0)[axis]
    mirrored = reflected(positions[:: max(len(positions) // _LOOKED_AT, 1)], axis, middle)
    low = positions.min(axis=0)
    # Vertices that are no farther apart than the cell size lie in the same or in adjacent cells, so
    # 27 look-ups find them without a search tree.
    known = np.unique(_cells((positions - low) / size))
    found = np.zeros(len(mirrored), dtype=bool)
    for step in np.ndindex(3, 3, 3):
        cells = _cells((mirrored - low) / size + step - 1.0)
        found |= known[np.minimum(np.searchsorted(known, cells), len(known) - 1)] == cells
    return bool(found.mean() > _MIRRORED)


def _cells(places: Floats) -> Ints:
    """Return the index of the unit cell that contains each position: (N,)."""
    x, y, z = np.floor(places).astype(np.int64).T + 2
    return np.asarray((x * 1000 + y) * 1000 + z)


def _agreement(ways: Floats, size: float) -> Floats:
    """Normalise the vectors that are long enough, and return their mean."""
    lengths = np.linalg.norm(ways, axis=1)
    clear = lengths > _LEAST * size
    if not clear.any():
        return np.zeros(3)
    return np.asarray((ways[clear] / lengths[clear, None]).mean(axis=0))


def _horizontal(vectors: Floats, up: Floats) -> Floats:
    return np.asarray(vectors - (vectors @ up)[..., None] * up)


def _size(places: Floats) -> float:
    return box_size(bounding_box(places)) if len(places) else 0.0
