"""A rig for a moving mesh: the bones of a decomposition as a skeleton, with their motion as a clip.

Bones move freely, so any hierarchy reproduces them; a good one has parents whose joints hardly move
in both bones. For two bones a and b, the joint is the point c that minimises the sum over frames of
|M_a c - M_b c|^2 (Le and Deng 2014, section 5). Bones that share vertices are neighbours; the
skeleton is the spanning tree of neighbours with the smallest distances, and its root the bone with
half of the weight on no side. Bones without shared vertices are children of a joint of their own,
``root``, that does not move. A mesh far from the origin, where single precision would spoil it, is
bound at the origin, and ``root`` is where it is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.autorig.decomposition import Decomposition, DecompositionSettings, decompose
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note
from viewer.errors import RigError
from viewer.phrases import Remedy, counted, rounded
from viewer.progress import part_of_work
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.quaternion import align_signs
from viewer.rigs.geometry.rotation import matrix_to_quaternion, up_rotation
from viewer.rigs.geometry.transform import affine_matrices, apply_transform
from viewer.rigs.motion.moving_mesh import FrameErrors, MovingMesh, frame_errors, posed_rows
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scalars import length_text
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import Skeleton, ball_skeleton
from viewer.rigs.skin import Skin, skin_from_entries
from viewer.rigs.units import UNIT_NAMES

# Pull of a joint towards the vertices that its two bones share, as a squared angle in radians:
# bones that turn against each other by less than 0.1 (6 degrees) say too little about its place.
# With 1e-4, half of the joints of a walking fox are outside of its box; their images in both bones
# are then 1.2 times nearer to each other.
_VAGUE = 1e-2
# Sum of products of weights below which two bones are no neighbours, in vertices.
_SHARED = 1e-3
# Distances as fractions of the size: of vertices in one place, and of a vertex from the nearest one
# of the file if the file does not have it. Single precision may be coarser than the first.
_PLACE, _LOST = 1e-6, 1e-3
_FAR = 100.0  # distance from the origin, in sizes, at which single precision has 5 digits left

_MOST_LINES = 100  # frames whose errors are printed


@dataclass(frozen=True, slots=True, eq=False)
class MovingRig:
    """The rig of a moving mesh."""

    actor: Actor
    """The figure, at rest in the bind frame, with the motion of its joints."""
    clip: SampledClip
    """The motion of the joints."""
    times: Floats
    """(F,). Seconds of the frames of the mesh; the clip also has those that were missing."""
    lines: tuple[Diagnostic, ...]
    """Messages for the user."""


def rig_motion(moving: MovingMesh, settings: DecompositionSettings | None = None) -> MovingRig:
    """Find joints, weights and a motion that reproduce a moving mesh."""
    rest = moving.rest
    with part_of_work(span=(0.0, 1.0)):
        found = decompose(rest, moving.positions, settings)
    mesh, place = moving.figure.require_mesh(), _far_place(rest)
    skeleton, order = _skeleton(found, rest, place)
    skin = _skin(found, skeleton, order, place)
    figure = Figure(
        moving.figure.name,
        mesh if place is None else replace(mesh, positions=mesh.positions - place),
        skeleton,
        skin,
        up=moving.figure.up,
        unit=moving.figure.unit,
        facts=(("rig", f"{counted(len(order), 'bone')} found from {moving.n_frames} frames"),),
    )
    clip, times = _clip(moving, found, skeleton, order)
    n_loose = int((skeleton.parents == 0).sum()) if skeleton.n_joints > len(order) else 1
    lines = [
        note(
            "R008.decomposed: {n} from {frames}, at most {most} per vertex, bound in frame {bind}",
            n=counted(len(order), "bone"),
            frames=counted(moving.n_frames, "frame"),
            most=int((found.weights > 0.0).sum(axis=1).max()),
            bind=int(moving.numbers[moving.bind]),
        ),
        note("R008.tree: hierarchy: neighbouring bones, joined where they move alike"),
    ]
    if n_loose > 1:
        lines.append(
            note(
                "R008.loose-bones: {n} that share no vertices: their bones are children of a joint "
                "called root",
                n=counted(n_loose, "part"),
            )
        )
    if place is not None:
        lines.append(
            note(
                "R014.far: far from the origin: bound there, with a joint called root where the "
                "mesh is"
            )
        )
    return MovingRig(Actor(figure, clip=clip), clip, times, tuple(lines))


def read_back_errors(moving: MovingMesh, times: Floats, actor: Actor) -> tuple[FrameErrors, Ints]:
    """Compare a written rig, opened again, with the moving mesh at its times (F,).

    Also returns the vertices (N,) that the file does not have. Files may have another up axis, copy
    vertices along seams of their texture, and start at another time.
    """
    from scipy.spatial import KDTree

    figure, clip = actor.figure, actor.joint_motion
    if clip is None:
        raise RigError(f"{actor.name}: expected a motion in the written file, found none")
    times = times - times[0] + clip.start
    skinned = posed_rows(figure, clip, times, actor.own_pose)
    back = np.eye(4)
    back[:3, :3] = up_rotation(figure.up, moving.figure.up)
    place = back @ actor.placement

    def placed(rows: slice) -> Floats:
        return apply_transform(place, skinned(rows))

    # A vertex of the file is the nearest one in the bind frame; of several in one place, as at a
    # cut, the one that is nearest in the first, middle and last frame, too.
    bind, count = slice(moving.bind, moving.bind + 1), moving.n_frames
    rest = moving.rest
    first = placed(bind)[0]
    off, near = KDTree(rest).query(first, k=min(8, len(rest)))
    off, near = off.reshape(len(first), -1), near.reshape(len(first), -1)
    far = off > off[:, :1] + _PLACE * moving.size
    apart = np.where(far, np.inf, 0.0)
    for frame in sorted({0, count // 2, count - 1}):
        moved = placed(slice(frame, frame + 1))[0]
        apart += ((moving.positions[frame][near] - moved[:, None]) ** 2).sum(axis=2)
    vertices = near[np.arange(len(first)), apart.argmin(axis=1)].astype(np.int32)
    lost = KDTree(first).query(rest)[0] > _LOST * moving.size
    return frame_errors(moving, placed, vertices), np.flatnonzero(lost).astype(np.int32)


def frame_lines(moving: MovingMesh, errors: FrameErrors) -> list[Diagnostic]:
    """Return the error of each frame, or of the worst of very many."""
    rows = np.arange(moving.n_frames)
    if len(rows) > _MOST_LINES:
        rows = np.sort(np.argsort(-errors.rms, kind="stable")[:_MOST_LINES])
    key = (
        "X002.frame-error: frame {frame}: RMS {rms} ({rms_percent} %), largest {largest} "
        "({largest_percent} %) at vertex {vertex}"
    )
    lines = [note(key, **_errors_of(moving, errors, row)) for row in rows.tolist()]
    if len(rows) < moving.n_frames:
        n = counted(moving.n_frames - len(rows), "frame", "is", "are")
        lines.append(note("X002.other-frames: {n} closer than these", n=n))
    return lines


def _errors_of(moving: MovingMesh, errors: FrameErrors, row: int) -> dict[str, object]:
    """Return the values of a message about a frame."""
    figure, size = moving.figure, moving.size
    rms, largest = float(errors.rms[row]), float(errors.largest[row])
    return {
        "frame": int(moving.numbers[row]),
        "rms": _length(figure, rms),
        "rms_percent": rounded(100.0 * rms / size),
        "largest": _length(figure, largest),
        "largest_percent": rounded(100.0 * largest / size),
        "vertex": int(errors.vertices[row]),
    }


def error_lines(
    moving: MovingMesh, errors: FrameErrors, missing: Ints, how: DecompositionSettings
) -> list[Diagnostic]:
    """Return the error of all frames together, and what it does not count."""
    figure, size, worst = moving.figure, moving.size, errors.worst
    total = {
        "total": _length(figure, errors.total),
        "total_percent": rounded(100.0 * errors.total / size),
    }
    key = (
        "X002.sequence-error: error of the skinned mesh: RMS {total} ({total_percent} % of the "
        "size); worst frame {frame}: RMS {rms} ({rms_percent} %), largest {largest} "
        "({largest_percent} %)"
    )
    lines = [note(key, **_errors_of(moving, errors, worst), **total)]
    over = 100.0 * float(errors.rms[worst]) / size
    if not how.bones and over > how.tolerance:
        key = (
            "X002.over-tolerance: more than the tolerance of {tolerance:g} %: {bones} finds more "
            "bones, {most} uses more for each vertex"
        )
        values = {
            "bones": Remedy("a number of Bones", "--bones N"),
            "most": Remedy("Max. influences", "--max-influences N"),
        }
        lines.append(note(key, tolerance=how.tolerance, **values))
    if len(missing):
        n = counted(len(missing), "vertex", "is", "are")
        lines.append(note("X003.loose-vertices: {n} without a face and not in the file", n=n))
    return lines


def _length(figure: Figure, length: float) -> str:
    """Return a length in the figure's unit; a plain number if that is unknown."""
    return length_text(figure, length) if figure.unit in UNIT_NAMES else rounded(length)


def _far_place(rest: Floats) -> Floats | None:
    """Return the middle of a mesh (3,) that is far from the origin; None for any other."""
    middle = rest.mean(axis=0)
    if np.abs(middle).max() < _FAR * np.ptp(rest, axis=0).max():
        return None
    return middle.astype(np.float32).astype(np.float64)  # exact in the file


def _skeleton(found: Decomposition, rest: Floats, place: Floats | None) -> tuple[Skeleton, Ints]:
    """Return the skeleton in the bind frame, and the bone of each joint after an added root."""
    weights, count = found.weights, found.weights.shape[1]
    shared, strength = _neighbours(weights, rest)
    joints = np.zeros((count, count, 3))
    cost = np.zeros((count, count))
    for a, b in zip(*np.nonzero(np.triu(strength > _SHARED, 1)), strict=True):
        joints[a, b], cost[a, b] = _joint(found.transforms, a, b, shared[a, b])
        joints[b, a], cost[b, a] = joints[a, b], cost[a, b]
    parents, order = _tree(cost, weights.sum(axis=0))
    centres = weights.T @ rest / weights.sum(axis=0)[:, None]
    places = np.array(
        [centres[b] if parents[b] < 0 else joints[b, parents[b]] for b in order.tolist()]
    )
    # Parents as rows of the order, which has them before their children.
    rank = np.empty(count, dtype=np.int32)
    rank[order] = np.arange(count)
    above = np.where(parents[order] < 0, -1, rank[parents[order]])
    names = tuple(f"bone_{number + 1}" for number in range(count))
    if (above < 0).sum() > 1 or place is not None:
        above, names = np.concatenate([[-1], above + 1]), ("root", *names)
        middle = rest.mean(axis=0) if place is None else place
        places = np.concatenate([middle[None], places])
    return ball_skeleton(names, above.astype(np.int32), places), order


def _neighbours(weights: Floats, rest: Floats) -> tuple[Floats, Floats]:
    """Return the middle of the vertices that bones share (B, B, 3), and how many those are."""
    strength = weights.T @ weights
    sums = np.stack([(weights * rest[:, axis, None]).T @ weights for axis in range(3)], axis=2)
    return sums / np.maximum(strength, np.finfo(float).tiny)[:, :, None], strength


def _joint(transforms: Floats, a: int, b: int, near: Floats) -> tuple[Floats, float]:
    """Return the point that two bones move most alike, and the RMS distance of its two images."""
    apart = transforms[:, a, :3] - transforms[:, b, :3]
    # The images differ by D c + t. With c = near + x: minimise |D x + (D near + t)|^2 + k |x|^2.
    turn, off = apart[:, :, :3], apart[:, :, :3] @ near + apart[:, :, 3]
    normal = np.einsum("fij,fik->jk", turn, turn) + len(apart) * _VAGUE * np.eye(3)
    x = np.linalg.solve(normal, -np.einsum("fij,fi->j", turn, off))
    return near + x, float(np.sqrt(np.mean(((turn @ x + off) ** 2).sum(axis=1))))


def _tree(cost: Floats, mass: Floats) -> tuple[Ints, Ints]:
    """Return parents (B,), -1 for a root of each component, and an order with parents first."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import breadth_first_order, connected_components
    from scipy.sparse.csgraph import minimum_spanning_tree as spanning

    count = len(mass)
    rows, columns = np.nonzero(cost)
    # Sparse graphs have no edges of length 0.
    lengths = cost[rows, columns] + np.finfo(float).tiny
    tree = spanning(csr_array((lengths, (rows, columns)), shape=(count, count)))
    _, component = connected_components(tree, directed=False)
    parents, order = np.full(count, -1, dtype=np.int32), list[int]()
    for number in range(component.max() + 1):
        members = np.flatnonzero(component == number)
        found, above = breadth_first_order(tree, int(members[0]), directed=False)
        root = _middle(found, above, mass)
        found, above = breadth_first_order(tree, root, directed=False)
        parents[found] = np.where(found == root, -1, above[found])
        order += found.tolist()
    return parents, np.array(order, dtype=np.int32)


def _middle(order: Ints, parents: Ints, mass: Floats) -> int:
    """Return the bone whose removal leaves no part of the tree with more than half of the mass."""
    below = mass.astype(np.float64).copy()
    for bone in order[:0:-1].tolist():
        below[parents[bone]] += below[bone]
    half, bone = 0.5 * below[order[0]], int(order[0])
    while True:
        children = order[parents[order] == bone]
        heavy = [child for child in children.tolist() if below[child] > half and child != bone]
        if not heavy:
            return bone
        bone = heavy[0]


def _skin(found: Decomposition, skeleton: Skeleton, order: Ints, place: Floats | None) -> Skin:
    """Return the weights, for a mesh that is bound at the origin instead of a place, if given."""
    extra = skeleton.n_joints - len(order)
    weights = found.weights[:, order]
    rows, columns = (each.astype(np.int32) for each in np.nonzero(weights))
    bound = _places(skeleton) - (0.0 if place is None else place)
    inverse = affine_matrices(np.eye(3), -bound)
    joints = columns + np.int32(extra)
    return skin_from_entries(len(weights), rows, joints, weights[rows, columns], inverse)


def _places(skeleton: Skeleton) -> Floats:
    """Return the joints (J, 3) of a skeleton without rotations at rest."""
    places = skeleton.rest_translations.copy()
    for joint in np.flatnonzero(skeleton.parents >= 0).tolist():
        places[joint] += places[skeleton.parents[joint]]
    return places


def _clip(
    moving: MovingMesh, found: Decomposition, skeleton: Skeleton, order: Ints
) -> tuple[SampledClip, Floats]:
    """Return the motion of the joints, and the seconds of the frames of the mesh."""
    places, parents = _places(skeleton), skeleton.parents
    extra, count = skeleton.n_joints - len(order), moving.n_frames
    # The world matrix of a joint is M T(c): a bone's transform of the joint at rest.
    turns = np.tile(np.eye(3), (count, skeleton.n_joints, 1, 1))
    turns[:, extra:] = found.transforms[:, order, :3, :3]
    spots = np.tile(places, (count, 1, 1))
    spots[:, extra:] = (
        np.einsum("fbij,bj->fbi", turns[:, extra:], places[extra:])
        + found.transforms[:, order][:, :, :3, 3]
    )
    # Local to the parent: R_p^T R, and R_p^T (p - p_p) with the offset at rest left out.
    has = parents >= 0
    above = turns[:, parents[has]].transpose(0, 1, 3, 2)
    offsets = spots - skeleton.rest_translations
    offsets[:, has] = (above @ (spots[:, has] - spots[:, parents[has]])[..., None])[..., 0]
    offsets[:, has] -= skeleton.rest_translations[has]
    turns[:, has] = above @ turns[:, has]
    rotations = matrix_to_quaternion(turns)
    align_signs(rotations)  # for programs that blend keys
    return _timed(moving, SampledClip(moving.figure.name, _timing(moving), rotations, offsets))


def _timing(moving: MovingMesh) -> Timing:
    """Return a frame for every number, also the missing ones."""
    numbers = moving.numbers
    step = int(np.gcd.reduce(np.diff(numbers)))
    rows = np.full((int(numbers[-1]) - int(numbers[0])) // step + 1, -1, dtype=np.int32)
    rows[(numbers - numbers[0]) // step] = np.arange(len(numbers))
    first = int(numbers[0]) if step == 1 else 0
    return Timing(moving.frame_rate, rows, first_frame=first, start=moving.start)


def _timed(moving: MovingMesh, clip: SampledClip) -> tuple[SampledClip, Floats]:
    """Return a clip with missing frames interpolated, and the times of the known ones."""
    timing = clip.timing
    known = np.flatnonzero(timing.present)
    times: Floats = timing.times[known]
    if len(known) == timing.n_frames:
        return clip, times
    every = timing.times
    filled = clip.sample(None, every, interpolate=True)
    whole = replace(timing, rows=np.arange(timing.n_frames, dtype=np.int32))
    return (
        replace(clip, timing=whole, rotations=filled.rotations, translations=filled.translations),
        times,
    )
