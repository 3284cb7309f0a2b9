"""Legs and soles of a body in every frame of its motion."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Floats, Ints, runs_of
from viewer.rigs.feet.contacts import FootPath
from viewer.rigs.feet.legs import Leg, legs_of, reach
from viewer.rigs.feet.soles import Soles, extent, soles_of_feet
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.geometry.rotation import quaternion_to_matrix
from viewer.rigs.hierarchy import path_to_root, with_ancestors
from viewer.rigs.kinematics import joint_worlds
from viewer.rigs.motion.evaluation import rest_translations_of
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.shape import rest_joints, shaped
from viewer.rigs.skeleton import Skeleton

_UNEVEN = 1e-3  # maximum relative difference of a joint's scale factors
_FOLDED = 1e-3  # extension at rest below which a leg is folded


@dataclass(frozen=True, slots=True, eq=False)
class BodyLegs:
    """Legs and soles of a body, and their forward kinematics."""

    chains: Chains
    """Joints of the legs and feet, and their ancestors."""
    legs: tuple[Leg, ...]
    """The legs, as indices into ``chains``."""
    soles: Soles
    """Soles of the feet, as indices into ``chains``."""
    level: Floats
    """(L, 3). The direction that points up in a standing foot, in the ankle's space."""
    toe_level: Floats
    """(L, 3). The same direction in the ball's space."""
    rests: Floats
    """(2, J, 3). Rest translations and scales of the skeleton."""
    extensions: Floats
    """(L,). Distance from hip to ankle in the rest pose, as a fraction of the leg's length."""
    size: float
    """Approximate height of the body."""
    clearance: float
    """Height of the balls above the soles in the rest pose."""
    travel: Floats | None = None
    """(N, 3) or None. Translation relative to moving ground in each row; None if the ground does
    not move."""

    def worlds(self, clip: SampledClip) -> Floats:
        """Return the world matrices of the chains, moved by the travel: (N, K, 4, 4)."""
        found = chain_worlds(clip, self.chains, *self.rests)
        if self.travel is not None:
            found[..., :3, 3] += self.travel[:, None]
        return found

    def heights(self, worlds: Floats, up: Floats) -> Floats:
        """Return the height of the lowest point of each foot: (N, L)."""
        # The matrices include the scales of the joints, and the soles are in the same unit.
        return self.soles.heights(worlds, np.append(up, 0.0), 1.0)

    def straightness(self, worlds: Floats) -> Floats:
        """Return hip to ankle relative to rest (N, L), or to a straight leg if legs rest folded."""
        usual = np.where(self.extensions > _FOLDED, self.extensions, 1.0)
        return _extensions(worlds, self.legs) / usual

    def feet_from_ankles(self, worlds: Floats) -> list[tuple[Floats, Floats]]:
        """Return the vectors from the ankles to the balls and the heels: (N, 3) each."""
        ankles = [worlds[:, leg.ankle, :3, 3] for leg in self.legs]
        return [
            (toe - ankle, heel - ankle)
            for ankle, (toe, heel) in zip(ankles, self.feet(worlds), strict=True)
        ]

    def paths(self, worlds: Floats) -> list[FootPath]:
        """Return the paths of all feet with their hips."""
        hips = [worlds[:, leg.hip, :3, 3] for leg in self.legs]
        pairs = zip(self.legs, self.feet(worlds), hips, strict=True)
        # A foot without a ball stands on its heel only.
        return [
            FootPath(toe if leg.toe != leg.ankle else heel, heel, hip)
            for leg, (toe, heel), hip in pairs
        ]

    def feet(self, worlds: Floats) -> list[tuple[Floats, Floats]]:
        """Return the paths of the balls and the heels of all feet: (N, 3) each."""
        return [
            (worlds[:, leg.toe, :3, 3], worlds[:, leg.ankle, :3] @ heel)
            for leg, heel in zip(self.legs, self.soles.heels, strict=True)
        ]


def spans_of(timing: Timing) -> list[tuple[int, int]]:
    """Return the ranges of present frames as ranges of rows, if rows are in frame order."""
    lengths = np.array([b - a for a, b in runs_of(timing.present)], dtype=np.intp)
    stops = np.cumsum(lengths)
    return [(int(b - n), int(b)) for b, n in zip(stops, lengths, strict=True)]


def body_legs(figure: Figure, clip: SampledClip, legs: list[Leg], up: Floats) -> BodyLegs | None:
    """Return the legs of a figure; None if they cannot be solved."""
    skeleton = figure.require_skeleton()
    for leg in legs:
        # Feet must move with their legs: animators' controls may be joints of the root.
        if not {leg.hip, leg.knee, leg.ankle} <= set(path_to_root(skeleton.parents, leg.toe)):
            return None
    weights = shape_of(figure, clip)
    body = shaped(figure, weights)
    soles = soles_of_feet(body, [[leg.toe, leg.ankle] for leg in legs], figure.is_attached)
    chains = chains_to(skeleton, [*(leg.toe for leg in legs), *soles.movers])
    constrained = [each.joint for each in skeleton.constraints]
    if (chains.place[constrained] >= 0).any():
        return None
    rests = np.stack([rest_translations_of(figure, weights[None])[0], skeleton.rest_scales])
    world = rest_worlds(skeleton, chains, rests)
    if not is_solvable(world[:, :3, :3]):
        return None
    place = chains.place
    own = tuple(
        Leg(*(int(place[joint]) for joint in (leg.hip, leg.knee, leg.ankle, leg.toe)))
        for leg in legs
    )
    moved = replace(
        soles,
        joints=place[soles.joints],
        movers=place[soles.movers],
        ankles=place[soles.ankles],
    )
    ankles = world[[leg.ankle for leg in own]]
    floor = extent(body)[0]
    level = np.einsum("lab,b->la", np.linalg.inv(ankles[:, :3, :3]), up)
    balls = world[[leg.toe for leg in own]]
    toe_level = np.einsum("lab,b->la", np.linalg.inv(balls[:, :3, :3]), up)
    toes = balls[:, :3, 3] @ up
    extensions, size = _extensions(world[None], own)[0], _size(world[:, :3, 3], own)
    clearance = float(toes.mean() - floor)
    levels = level, toe_level
    return BodyLegs(chains, own, moved, *levels, rests, extensions, size, clearance)


def shape_of(figure: Figure, clip: SampledClip) -> Floats:
    """Return the shape weights (S,) at the start of a motion: its own, or the figure's."""
    if clip.shape_weights is None:
        return figure_pose(figure).shape_weights
    return clip.shape_weights[0]


def is_solvable(linear: Floats) -> bool:
    """Return whether joints are scaled uniformly and not mirrored: (K, 3, 3)."""
    lengths = np.linalg.norm(linear, axis=-2)
    is_uniform = np.ptp(lengths, axis=-1) <= _UNEVEN * lengths.min(axis=-1)
    return bool(is_uniform.all() and (np.linalg.det(linear) > 0.0).all())


def _extensions(worlds: Floats, legs: tuple[Leg, ...]) -> Floats:
    """Return the distances from hips to ankles as fractions of the legs' lengths: (N, L)."""
    result = np.empty((len(worlds), len(legs)))
    for number, leg in enumerate(legs):
        hips, knees, ankles = (worlds[:, j, :3, 3] for j in (leg.hip, leg.knee, leg.ankle))
        distance = np.linalg.norm(ankles - hips, axis=1)
        result[:, number] = distance / np.maximum(reach(hips, knees, ankles), 1e-30)
    return result


def _size(points: Floats, legs: Sequence[Leg]) -> float:
    """Return the approximate height of a body, twice the length of its longest leg."""
    lengths = [
        np.linalg.norm(points[leg.knee] - points[leg.hip])
        + np.linalg.norm(points[leg.ankle] - points[leg.knee])
        for leg in legs
    ]
    return 2.0 * float(max(lengths))


def body_size(figure: Figure) -> float:
    """Return the size of a figure to which ``limits`` relate; its height if legs have no names."""
    legs = legs_of(figure.require_skeleton())
    return _size(rest_joints(figure), legs) if legs else extent(figure)[1]


@dataclass(frozen=True, slots=True, eq=False)
class Chains:
    """Some joints of a skeleton and all their ancestors, renumbered."""

    joints: Ints
    """(K,) int32. Indices of the joints in the skeleton, parents before children."""
    parents: Ints
    """(K,) int32. Parents as indices into ``joints``; -1 for a root."""
    place: Ints
    """(J,) int32. Index into ``joints`` of each joint of the skeleton, -1 if it is not included."""


def chains_to(skeleton: Skeleton, ends: Iterable[int]) -> Chains:
    """Return the given joints of a skeleton and all their ancestors."""
    parents = skeleton.parents
    joints = np.array(sorted(with_ancestors(parents.tolist(), map(int, ends))), dtype=np.int32)
    place = np.full(skeleton.n_joints, -1, dtype=np.int32)
    place[joints] = np.arange(len(joints))
    above = np.where(parents[joints] >= 0, place[parents[joints]], -1).astype(np.int32)
    return Chains(joints, above, place)


def rest_worlds(skeleton: Skeleton, chains: Chains, rests: Floats) -> Floats:
    """Return the world matrices (K, 4, 4) of some joints at rest, with all DOFs at 0."""
    still = SampledClip("", Timing(1.0, np.zeros(1, dtype=np.int32)), skeleton.rest_rotations[None])
    return chain_worlds(still, chains, *rests)[0]


def chain_worlds(clip: SampledClip, chains: Chains, translations: Floats, scales: Floats) -> Floats:
    """Return the world matrices (N, K, 4, 4) of some joints; a clip's own scales come first."""
    joints = chains.joints
    factors = scales[None, joints] if clip.scales is None else clip.scales[:, joints]
    linear = quaternion_to_matrix(clip.rotations[:, joints]) * factors[:, :, None, :]
    offsets = translations[joints]
    if clip.translations is not None:
        offsets = offsets + clip.translations[:, joints]
    world = joint_worlds(chains.parents, linear, offsets)
    if clip.figure_scales is not None:
        world[..., :3, :] *= clip.figure_scales[:, None, None, None]
    if clip.figure_translations is not None:
        world[..., :3, 3] += clip.figure_translations[:, None]
    return world
