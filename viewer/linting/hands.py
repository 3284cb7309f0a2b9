"""Check of motions for hands inside the body."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.data_classes import dataclass
from viewer.linting._finding import Finding
from viewer.linting._subject import Indices, Subject, ends_of, track_of, world_turns
from viewer.linting._surface import FEWEST, support_of
from viewer.phrases import counted
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import nearest_rotations, quaternion_to_matrix
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.memo import Memo
from viewer.rigs.retargeting.joint_names import LIMBS, joint_meanings
from viewer.rigs.skeleton import joint_labels
from viewer.rigs.skin import bind_positions

_CHEST = ("spine3", "spine2", "spine1")
_TRUNK = ("pelvis", "spine1", "spine2", "spine3")
_ENDS = ("neck", "head")
_ARMS = tuple(limb for limb in LIMBS if limb[2].endswith("_wrist"))
# The trunk is compared in slices across its axis, in the space of the chest. Hands that touch the
# body have their wrist near the skin; none is in the inner half of a closed slice.
_SLICES, _SECTORS = 48, 8
_THICK = 2.0  # thickness of a slice, in slices
_FILLED = 7  # minimum number of sectors with skin: the slice is closed
_INNER = 0.5  # maximum distance from the middle, relative to that of the skin in the same sector
_FINEST = 6  # maximum number of steps along the edges of large triangles
_FRAMES = 3  # minimum number of frames: one or two are a pop
_MOSTLY = 0.5  # minimum weight of the trunk in its own vertices


@dataclass(frozen=True, slots=True, eq=False)
class _Trunk:
    """Inside of the trunk, in the axes of its chest."""

    chest: int
    """The joint."""
    axes: Floats
    """(3, 3): rows are two axes across the trunk, and the one along it, in joint space."""
    low: float
    thickness: float
    """Beginning of the first slice along the axis, and thickness of each."""
    middles: Floats
    """(S, 2): middle of each slice."""
    radii: Floats
    """(S, 8): distance of the skin from it in each sector; 0 without skin."""

    def inside(self, points: Floats) -> Bools:
        """Return which points (F, 3), in joint space, are in the inner half of a slice: (F,)."""
        across = points @ self.axes.T
        slices = np.floor((across[:, 2] - self.low) / self.thickness).astype(np.int64)
        is_within = (slices >= 0) & (slices < len(self.radii))
        slices = np.clip(slices, 0, len(self.radii) - 1)
        to = across[:, :2] - self.middles[slices]
        radii = self.radii[slices]
        is_closed = (radii > 0.0).sum(axis=1) >= _FILLED
        limits = _INNER * radii[np.arange(len(to)), _sectors(to)]
        inside: Bools = is_within & is_closed & (np.linalg.norm(to, axis=1) < limits)
        return inside


_trunks: Memo[Figure, _Trunk | None] = Memo()


def check(subject: Subject) -> Iterator[Finding]:
    """Check the wrists of a person with a mesh."""
    figure = subject.actor.figure
    track = track_of(subject)
    if track is None or figure.mesh is None or figure.skin is None or not figure.is_attached:
        return
    if subject.lacks("weights", "positions", "bindings", "joints"):
        return
    if figure.mesh.n_vertices < FEWEST:
        return
    trunk = _trunks.get(figure, (), lambda: _trunk(figure))
    if trunk is None:
        return
    skeleton = figure.require_skeleton()
    names = joint_meanings(skeleton)
    # Scene to figure axes, then to those of the chest.
    linear = subject.actor.placement[:3, :3] / track.scale**2
    turns = quaternion_to_matrix(world_turns(track.rotations, skeleton, trunk.chest))
    for arm in _ARMS:
        ends = ends_of(arm, names, skeleton)
        if not ends:
            continue
        hand = track.positions[:, ends].mean(axis=1)
        offsets = (hand - track.positions[:, trunk.chest]) @ linear
        inside = trunk.inside(np.einsum("fba,fb->fa", turns, offsets)) & track.present
        rows = track.of_each(np.flatnonzero(inside))
        if len(rows) < _FRAMES:
            continue
        yield subject.found(
            "C025.hand: {n}: {joint} is deep inside the body, from frame {frame} on",
            n=counted(len(rows), "frame", of=track.n_frames),
            all=track.n_frames,
            joint=joint_labels(skeleton)[ends[0]],
            frame=int(track.numbers[rows[0]]),
            part="clip",
            joints=ends,
            frames=track.numbers[rows],
            times=track.times[rows],
            at=("frames", int(rows[0])),
        )


def _trunk(figure: Figure) -> _Trunk | None:
    """Return the trunk of a figure at the bind pose; None without named joints or enough skin."""
    skeleton, mesh, skin = figure.require_skeleton(), figure.require_mesh(), figure.require_skin()
    names = joint_meanings(skeleton)
    chests = [names.index(name) for name in _CHEST if name in names]
    ends = [names.index(name) for name in _ENDS if name in names]
    if not chests or not ends or "pelvis" not in names:
        return None
    found, places = support_of(figure), bind_positions(skin)
    trunk = [joint for joint, name in enumerate(names) if name in _TRUNK]
    of_trunk = np.isin(found.joints, trunk)
    weights = np.bincount(
        found.vertices[of_trunk], found.weights[of_trunk], minlength=mesh.n_vertices
    )
    vertices = np.flatnonzero(weights > _MOSTLY)
    turn = nearest_rotations(skin.inverse_bind[chests[0], :3, :3])[0]
    along = unit(turn @ (places[ends[0]] - places[names.index("pelvis")]))
    first = unit(np.cross(along, np.eye(3)[int(np.abs(along).argmin())]))
    axes = np.stack([first, np.cross(along, first), along])
    points = (mesh.positions - places[chests[0]]) @ turn.T @ axes.T
    corners = mesh.triangles[np.isin(mesh.triangles, vertices).all(axis=1)]
    if len(vertices) < FEWEST or len(corners) == 0:
        return None
    low, high = points[vertices, 2].min(), points[vertices, 2].max()
    thickness = float(high - low) / _SLICES
    if not thickness > 0.0:
        return None
    points = _surface_points(points[corners], thickness)
    middles, radii = np.zeros((_SLICES, 2)), np.zeros((_SLICES, _SECTORS))
    for number in range(_SLICES):
        centre = low + (number + 0.5) * thickness
        part = points[np.abs(points[:, 2] - centre) < 0.5 * _THICK * thickness, :2]
        if len(part):
            middles[number] = 0.5 * (part.min(axis=0) + part.max(axis=0))
            to = part - middles[number]
            np.maximum.at(radii[number], _sectors(to), np.linalg.norm(to, axis=1))
    return _Trunk(chests[0], axes, float(low), thickness, middles, radii)


def _surface_points(corners: Floats, spacing: float) -> Floats:
    """Return points on triangles (T, 3, 3), about as far apart as given where these are large."""
    edge = float(np.median(np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1)))
    steps = int(np.clip(np.ceil(edge / spacing), 1, _FINEST))
    grid = np.array([[i, j, steps - i - j] for i in range(steps + 1) for j in range(steps + 1 - i)])
    return np.einsum("gk,tka->gta", grid / steps, corners).reshape(-1, 3)


def _sectors(to: Floats) -> Indices:
    """Return the sector of each direction (N, 2)."""
    turns = np.arctan2(to[:, 1], to[:, 0]) / (2.0 * np.pi)
    return np.floor((turns % 1.0) * _SECTORS).astype(np.int64) % _SECTORS
