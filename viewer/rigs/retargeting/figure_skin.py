"""Points of a figure's skin, of what part of the body they are, and what is inside them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.feet.legs import unscaled
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.samples import sample_surface
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.hierarchy import descendants
from viewer.rigs.mesh import area_vectors
from viewer.rigs.retargeting.body_joints import ARMS, LEG, THIGHS, TOPS, Body
from viewer.rigs.shape import rest_joints
from viewer.rigs.skin import owners, strongest_influences

# Points of the skin of a person, whose area is about the height squared, 3 cm from each other.
# Stout figures have more; hands are chosen from so many times as many.
_POINTS, _MOST, _DENSER = 2000, 3000, 4
_HAND_POINTS = 48  # those of a hand that are kept outside the others
_BLUNT = 0.04  # radius of the end of a hand that comes along a ray
# Winding number between that of points of a closed skin, 1/2, and of an open sheet, 0.
_SOLID = 0.25
_BATCH = 64  # rows that are computed at once

Singles = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class SkinPoints:
    """Points spread evenly over the skin of a body, each of which moves with one joint."""

    joints: Ints
    """(P,) int32, ascending. The joints of the skeleton."""
    places: Floats
    normals: Floats
    """(P, 3). Positions, and outward normals, in the space of the joints."""
    arms: Ints
    """(P,). 0 and 1 for points of the arms, as of ``ARMS``, else -1."""
    parts: Ints
    """(P,). 0 for points of upper arms, 1 of forearms, 2 of hands, -1 for all others."""
    skin: Ints
    """Rows of the points of the skin."""
    hands: tuple[Ints, ...]
    """Rows of the points of each hand that are kept outside the skin."""
    regions: dict[str, Bools]
    """(P,) each. Whether points are around the bones of a part, as ``region_of`` names it."""
    area: float
    """Area of the piece of the skin at each point."""
    crown: float | None
    """Height of the crown above the head's joint; None if the head has no skin."""


def points_of(figure: Figure, joints: dict[str, int]) -> SkinPoints | None:
    """Return points of a figure's skin; None if a hand has none."""
    mesh, skin = figure.mesh, figure.skin
    if mesh is None or skin is None or not figure.is_attached or not mesh.n_triangles:
        return None
    vectors = area_vectors(mesh.positions, mesh.triangles)
    area = 0.5 * float(np.linalg.norm(vectors, axis=1).sum())
    if not area > 0.0:
        return None
    rest = rest_joints(figure)
    top = next(joints[name] for name in TOPS if name in joints)
    trunk = rest[top] - rest[joints["pelvis"]]
    leg = np.diff(rest[[joints[name] for name in LEG]], axis=0)
    height = float(np.linalg.norm(trunk) + np.linalg.norm(leg, axis=1).sum())
    count = int(np.clip(_POINTS * area / max(height, 1e-30) ** 2, _POINTS, _MOST))
    samples = sample_surface(mesh.positions, mesh.triangles, _DENSER * count)
    points = samples.positions
    from_middle = mesh.positions[mesh.triangles[:, 0]] - mesh.positions.mean(axis=0)
    outward = np.sign(np.einsum("ta,ta->", from_middle, vectors))
    normals = (outward or 1.0) * samples.normals
    # Each moves with the strongest joint of the nearest corner.
    corners = mesh.triangles[samples.triangles]
    nearest = np.take_along_axis(corners, samples.weights.argmax(axis=1)[:, None], axis=1)[:, 0]
    strongest = np.full(mesh.n_vertices, -1, dtype=np.int32)
    influences = strongest_influences(skin)
    strongest[owners(skin)[influences]] = skin.joints[influences]
    movers = strongest[nearest]
    is_bound = movers >= 0
    is_skin = (np.arange(len(points)) % _DENSER == 0)[is_bound]
    movers, points, normals = movers[is_bound], points[is_bound], normals[is_bound]
    parents = figure.require_skeleton().parents
    arms, hands, parts = np.full((3, len(movers)), -1)
    for number, arm in enumerate(ARMS):
        shoulder, elbow, wrist = (joints[name] for name in arm)
        for part, joint in enumerate((shoulder, elbow, wrist)):
            is_moved = descendants(parents, joint)[movers]
            arms[is_moved], parts[is_moved] = number, part
        # A hand is at most as long as its forearm; beyond it are things that it holds.
        reach = np.linalg.norm(rest[wrist] - rest[elbow])
        is_hand = descendants(parents, wrist)[movers]
        hands[is_hand & (np.linalg.norm(points - rest[wrist], axis=1) < reach)] = number
    every = np.flatnonzero(is_skin)
    if not {0, 1} <= set(hands.tolist()) or not len(every):
        return None
    some = every[:: max(round(len(every) / _POINTS), 1)]
    piece = area / count * len(every) / len(some)
    is_solid = encloses(points[some], normals[some], piece, points[every])
    chosen = [every[is_solid | (hands[every] >= 0)]]
    for number in range(len(ARMS)):
        rows = np.flatnonzero(hands == number)
        chosen.append(rows[_spread(points[rows], _HAND_POINTS)])
    kept = np.unique(np.concatenate(chosen))
    kept = kept[np.argsort(movers[kept], kind="stable")]
    skin_rows, *ends = (np.flatnonzero(np.isin(kept, rows)).astype(np.int32) for rows in chosen)
    movers, arms, parts = movers[kept], arms[kept], parts[kept]
    points, normals = points[kept], normals[kept]
    crown = None
    if "head" in joints:
        own = descendants(parents, joints["head"])[movers]
        if own.any():
            crown = float(np.quantile((points[own] - rest[joints["head"]]) @ unit(trunk), 0.98))
    regions = {"pelvis": arms < 0}
    if "head" in joints:
        regions["head"] = descendants(parents, joints["head"])[movers]
        regions["pelvis"] &= ~regions["head"]
    for hip, knee in THIGHS:
        is_leg = descendants(parents, joints[hip])[movers]
        regions[hip] = is_leg
        # The trunk ends at the hips.
        thigh = np.linalg.norm(rest[joints[knee]] - rest[joints[hip]])
        regions["pelvis"] &= ~is_leg | (
            np.linalg.norm(points - rest[joints[hip]], axis=1) < 0.4 * thigh
        )
    bind = skin.inverse_bind[movers]
    places = np.einsum("pab,pb->pa", bind[:, :3, :3], points) + bind[:, :3, 3]
    normals = unit(np.einsum("pab,pb->pa", bind[:, :3, :3], normals))
    return SkinPoints(
        movers.astype(np.int32), places, normals, arms, parts, skin_rows, tuple(ends), regions,
        area / count, crown,
    )  # fmt: skip


def encloses(
    skin: Floats | Singles, normals: Floats | Singles, area: float, points: Floats
) -> Bools:
    """Return which points (..., P, 3) are inside a skin, (..., P).

    ``skin``, ``normals``: (..., S, 3), points of it, each in the middle of a piece with an area.
    The winding number (Barill et al. 2018) sums the solid angles of all pieces of the skin, as
    fractions of the sphere: 1 inside, 0 outside. It is 1/2 at a point of a closed skin, or of one
    with small openings, but 0 at one of an open sheet, such as a cape.
    """
    # Single precision, around the middle, takes half the time.
    middle = points.mean(axis=-2, keepdims=True)
    ends, starts, outward = (
        np.asarray(each, dtype=np.float32) for each in (points - middle, skin - middle, normals)
    )
    squares = (ends**2).sum(axis=-1)[..., None] + (starts**2).sum(axis=-1)[..., None, :]
    # Pieces have a width, so that those next to a point subtend less than a small one would.
    squares = np.maximum(squares - 2.0 * ends @ starts.swapaxes(-1, -2), 0.0) + area
    heights = (starts * outward).sum(axis=-1)[..., None, :] - ends @ outward.swapaxes(-1, -2)
    angles = (heights / (squares * np.sqrt(squares))).sum(axis=-1)
    is_inside: Bools = area / (4.0 * np.pi) * angles > _SOLID
    return is_inside


def _spread(points: Floats, count: int) -> Ints:
    """Return the rows of at most ``count`` points, each the farthest from those before it."""
    rows = [int(np.linalg.norm(points - points.mean(axis=0), axis=1).argmax())]
    distances = np.linalg.norm(points - points[rows[0]], axis=1)
    while len(rows) < count and distances.max() > 0.0:
        rows.append(int(distances.argmax()))
        distances = np.minimum(distances, np.linalg.norm(points - points[rows[-1]], axis=1))
    return np.array(rows, dtype=np.int32)


class Solid:
    """The skin of a body in the rows of its motion, with lengths relative to its height."""

    def __init__(self, points: SkinPoints, body: Body) -> None:
        self.points, self.body = points, body
        self.area = points.area / body.height**2
        """Area of the piece of the skin at each point."""
        self.place = body.chains.place[points.joints]
        """(P,). Places of the points' joints in ``Body.world``."""
        # The end of a hand is wide enough to meet one of half of the points.
        self.regions = {
            name: points.skin[each[points.skin]][::2] for name, each in points.regions.items()
        }

    def posed(self, rows: Ints, points: Ints) -> tuple[Floats, Floats]:
        """Return the positions and normals (R, P, 3) of some points (P,) in some rows."""
        worlds, joints = self.body.world[rows], self.place[points]
        placed, normals = np.empty((2, len(rows), len(points), 3))
        # Multiplying by joints takes a quarter of the time of multiplying by points.
        starts = np.flatnonzero(np.diff(joints, prepend=-1))
        for start, stop in pairwise([*starts, len(points)]):
            linear, offset = np.split(worlds[:, joints[start], :3] / self.body.height, [3], axis=2)
            own = points[start:stop]
            np.matmul(self.points.places[own], linear.swapaxes(1, 2), out=placed[:, start:stop])
            placed[:, start:stop] += offset.swapaxes(1, 2)
            turns = unscaled(linear).swapaxes(1, 2)
            np.matmul(self.points.normals[own], turns, out=normals[:, start:stop])
        return placed, normals

    def radii(self, region: str, starts: Floats, ways: Floats, needed: Bools) -> Floats:
        """Return how far from the starts of rays (N, 3) a blunt hand meets the skin: (N,).

        NaN where it meets none, and in rows that are not needed.
        """
        result, rows = np.full(len(starts), np.nan), np.flatnonzero(needed).astype(np.int32)
        for chosen in batches(rows if len(self.regions[region]) else rows[:0]):
            away = self.posed(chosen, self.regions[region])[0] - starts[chosen, None]
            along = np.einsum("rpa,ra->rp", away, ways[chosen])
            aside = np.einsum("rpa,rpa->rp", away, away) - along**2
            is_ahead = (along > 0.0) & (aside < (2.0 * _BLUNT) ** 2)
            farthest = np.where(is_ahead, along - aside / (2.0 * _BLUNT), -np.inf).max(axis=1)
            result[chosen] = np.where(np.isfinite(farthest), farthest, np.nan)
        return result


def batches(rows: Ints) -> list[Ints]:
    """Return rows in pieces whose arrays fit into the cache."""
    return [rows[start : start + _BATCH] for start in range(0, len(rows), _BATCH)]
