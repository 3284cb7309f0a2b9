"""Weights of a mesh without a template, from the bones of a skeleton inside it.

``bone_heat``: every bone heats the surface that it sees, and heat spreads over the surface (Baran
and Popović 2007). ``geodesic_voxels``: weights fall off with the length of the path from a bone
through the solid (Dionne and de Lasa 2013), which needs no connected surface.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from viewer.autorig.solid import Solid
from viewer.autorig.surface.laplacian import laplacian
from viewer.autorig.surface.welding import Welded, stiff_islands
from viewer.autorig.weights.weight_transfer import (
    conjugate_gradients,
    factorised,
    put_rows,
    scaled_rows,
)
from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.phrases import Remedy
from viewer.progress import part_of_work, report, report_fraction
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.closest_point import Surface, interpolate
from viewer.rigs.geometry.samples import sample_surface
from viewer.rigs.geometry.topology import part_volumes
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.hierarchy import path_to_root
from viewer.rigs.memo import Memo
from viewer.rigs.mesh import bounding_box, box_size, triangle_areas
from viewer.rigs.retargeting.joint_names import name_tokens
from viewer.rigs.skeleton import Skeleton, shown_joints, shown_parents

if TYPE_CHECKING:
    from scipy.sparse import csr_array

# Bones.
NEAR = 2.0
"""Distance from the solid, in voxels, up to which a joint or bone counts as inside: voxels do not
resolve fingers and ears."""
_STEP = 0.5  # distance of the points that represent a bone, in voxels
_TIP = 0.8  # length of the bone of a joint without children, relative to the way to the surface
_SAME = 0.5  # distance in voxels up to which two joints are at the same place
_CONTROLS = {"ik", "fk", "pole", "poletarget", "target", "control", "ctrl", "ctl", "mch"}

# Heat.
_CANDIDATES = 6  # nearest joints whose bones are tested for visibility
# Heat per squared distance. Baran and Popović use 1, which leaves half of a bend's weight far from
# it. Deformations of 23 characters by 6 makers are best from 3 to 10, and differ little there.
_HEAT = 4.0
_SHORTEST = 1e-4  # least distance that heats, relative to the mesh's size
_BLIND = 1.5  # length in voxels at both ends of a ray that may leave the solid
_EQUAL = 1e-4  # relative difference up to which bones are equally near, as at a joint
_LEAST = 1e-3  # weights below this are dropped: they decay, but never end
_BLOCK = 1 << 22  # most unknowns in a batch, and most lengths that are kept: 32 MB

# Exponent of the fall-off with the geodesic distance. Dionne and de Lasa (eq. 6) have 2 to 4.
# Deformations of the same characters are better with 8: less of a limb follows its neighbours.
_FALL_OFF = 8.0

_surfaces: Memo[Welded, tuple[csr_array, Floats]] = Memo()
_graphs: Memo[Solid, csr_array] = Memo()
_paths: Memo[Welded, dict[bytes, Floats]] = Memo()
"""What several skeletons in the same mesh have in common: Laplace operator, graph of the voxels,
and lengths of paths (W,) from the voxels of each bone."""

# Parts.
_RIGID = 0.8  # fraction of a part's vertices that are nearest to one joint, so that it is rigid
# The same of the area of a part that cannot bend in the middle: two bones that share it evenly
# would shear it.
_MOSTLY = 0.6
_SAMPLES = 20_000  # of the surface of all such parts
_CONVEX = 0.8  # fraction of its convex hull that a part without limbs of its own fills
_SHARE = 0.1  # fraction of that area, from which a joint counts where several branches share a part
# Of a part that lies on another: its size relative to the mesh's, its distance from the other, and
# that of its underside beyond its nearest vertex, both relative to its size; and the sum of weights
# in common from which the part keeps its own. From 0.55 to 0.65, the same parts are found.
_TRIFLE, _ON, _UNDER, _COMMON = 0.12, 0.5, 0.25, 0.6


@dataclass(frozen=True, slots=True, eq=False)
class Bones:
    """Points on the bones of a skeleton, in the mesh's space."""

    points: Floats
    """(P, 3). Points at most half a voxel apart, sorted by joint."""
    starts: Ints
    """(J + 1,). Joint j has the points from ``starts[j]`` up to ``starts[j + 1]``, maybe none."""
    outside: Bools
    """(J,). Joints outside the mesh, without roots and controls."""
    parents: Ints
    """(J,). The joint above each that is shown; -1 for none."""

    @property
    def joints(self) -> Ints:
        """Joints that have a bone in the mesh."""
        return np.flatnonzero(np.diff(self.starts)).astype(np.int32)

    @property
    def owners(self) -> Ints:
        """(P,). Joint of each point."""
        return np.repeat(np.arange(len(self.starts) - 1), np.diff(self.starts)).astype(np.int32)

    def of(self, joint: int) -> Floats:
        """Return the points of one joint (N, 3)."""
        return self.points[self.starts[joint] : self.starts[joint + 1]]


@dataclass(frozen=True, slots=True, eq=False)
class BoneWeights:
    """Weights of a welded mesh."""

    rows: csr_array
    """Sparse (W, J); rows sum to 1."""
    nearest: Ints
    """(W,). Joint whose bone is nearest; -1 where none is seen."""
    distances: Floats
    """(W,). Distance from that bone, in the mesh's unit; infinite where none is seen."""
    rigid: Ints
    """(I,). The joint with which each island moves rigidly, -1 for the others."""
    lies: Bools
    """(I,). Islands that have the weights of the surface beneath them."""


def bones_in(
    solid: Solid,
    skeleton: Skeleton,
    worlds: Floats,
    deforming: Bools | None = None,
    holders: Bools | None = None,
) -> Bones:
    """Return the bones of a posed skeleton, ``worlds`` (J, 4, 4), that lie in a solid.

    ``deforming`` (J,): joints that have weights in the skeleton's own figure, if it has a mesh;
    others may still be the ends of bones. ``holders`` (J,): joints that are no bones nor ends.
    """
    positions, parents = worlds[:, :3, 3], shown_parents(skeleton)
    count, space = skeleton.n_joints, solid.spacing
    drawn = np.zeros(count, dtype=np.bool_)
    drawn[shown_joints(skeleton)] = True
    is_near = solid.gaps(positions) <= NEAR * space
    controlling = _controls(skeleton, positions, is_near, _SAME * space)
    if holders is not None:
        controlling |= holders
    plays = drawn & ~controlling
    if deforming is not None:
        plays &= deforming
    # A root outside, often on the ground, moves the whole figure; what a bone from there to the
    # hips or to an IK foot would pass belongs to other joints.
    plays &= is_near | (parents >= 0)
    apart = np.linalg.norm(positions - positions[parents], axis=1) > _SAME * space
    children: list[list[int]] = [[] for _ in range(count)]
    for joint in np.flatnonzero(drawn & ~controlling & (parents >= 0)).tolist():
        children[parents[joint]].append(joint)
    # A joint at the place of its parent, with nothing below, holds a weapon or a cape: the bone is
    # the parent's.
    is_leaf = np.array([not below for below in children])
    plays &= apart | ~is_leaf | (parents < 0)
    lines, owners = [np.zeros((0, 3))], [np.zeros(0, dtype=np.int32)]
    for joint in np.flatnonzero(plays).tolist():
        ends = [positions[child] for child in children[joint] if is_near[child] and apart[child]]
        if not ends and is_near[joint]:
            ends = [_tip(solid, skeleton, worlds, parents, joint)]
        for end in ends:
            lines.append(_line(positions[joint], end, _STEP * space))
            owners.append(np.full(len(lines[-1]), joint, dtype=np.int32))
    points, owner = np.concatenate(lines), np.concatenate(owners)
    kept = solid.gaps(points) <= NEAR * space
    counts = np.bincount(owner[kept], minlength=count)
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    return Bones(points[kept], starts, plays & ~is_near & (parents >= 0), parents)


def names_control(skeleton: Skeleton) -> Bools:
    """Return the joints (J,) whose names say that they control others, such as an IK target."""
    return np.array([bool(_CONTROLS & set(name_tokens(name))) for name in skeleton.names])


def _controls(skeleton: Skeleton, positions: Floats, is_inside: Bools, near: float) -> Bools:
    """Return the joints that only control others: (J,).

    Their names say so, as do those of all joints below them, and either these are all outside the
    mesh, or one of them is at the place of a joint that they control. A foot that hangs from an IK
    joint has no such counterpart.
    """
    named = names_control(skeleton)
    parents, result = skeleton.parents, named.copy()
    for joint in range(len(named) - 1, 0, -1):
        if parents[joint] >= 0:
            result[parents[joint]] &= result[joint]
    top = np.arange(len(named))
    for joint, parent in enumerate(parents.tolist()):
        if parent >= 0 and result[joint] and result[parent]:
            top[joint] = top[parent]
    others = positions[~named]
    if not result.any() or len(others) == 0:
        # Where all names sound like controls, none is one.
        return np.zeros(len(named), dtype=np.bool_)
    apart = np.linalg.norm(positions[:, None] - others, axis=2).min(axis=1)
    copies = np.unique(top[result & (apart <= near)])
    useful = np.unique(top[result & is_inside])
    return result & (np.isin(top, copies) | ~np.isin(top, useful))


def _tip(solid: Solid, skeleton: Skeleton, worlds: Floats, parents: Ints, joint: int) -> Floats:
    """Return the end (3,) of the bone of a joint without children."""
    start, space = worlds[joint, :3, 3], solid.spacing
    if skeleton.boxes is not None and skeleton.boxes_from_bones:
        # Such a box is centred halfway to the end that the file states.
        end = worlds[joint, :3, :3] @ skeleton.boxes[joint].sum(axis=0) + start
        if np.linalg.norm(end - start) > space:
            return np.asarray(end)
    # Otherwise the bone continues the previous one: a head to its top, a hand to its fingertips.
    above = parents[joint]
    while above >= 0 and np.linalg.norm(start - worlds[above, :3, 3]) <= _SAME * space:
        above = parents[above]
    if above < 0:
        return start
    way = unit(start - worlds[above, :3, 3])
    steps = np.arange(1, 2 * max(solid.inside.shape)) * _STEP * space
    inside = _contains(solid, start + steps[:, None] * way)
    first = int(inside.argmax())
    if not inside[first] or steps[first] > NEAR * space:
        return start
    end = first + int((~inside[first:]).argmax())
    return np.asarray(start + _TIP * steps[end] * way)


def _line(start: Floats, end: Floats, step: float) -> Floats:
    """Return points from one to another, at most ``step`` apart: (N, 3)."""
    count = int(np.ceil(np.linalg.norm(end - start) / step)) + 1
    return start + np.linspace(0.0, 1.0, count)[:, None] * (end - start)


def _contains(solid: Solid, points: Floats) -> Bools:
    """Return whether points (N, 3) lie in voxels of the solid: (N,)."""
    # The border of the grid is outside, so points beyond it are, too.
    found: Bools = solid.inside[tuple(solid.voxel_of(points).T)]
    return found


def bone_heat(mesh: Welded, solid: Solid, bones: Bones) -> BoneWeights:
    """Return the equilibrium of heat from the bones that vertices see."""
    size = float(np.ptp(mesh.positions, axis=0).max())
    report_fraction(0.0, "looking for bones")
    with part_of_work(span=(0.0, 0.5)):
        chances, distances = _seen(mesh.positions, solid, bones)
    first = np.asarray(chances.argmax(axis=1)).ravel()
    nearest = np.where(np.isfinite(distances), first, -1).astype(np.int32)
    sees = nearest >= 0
    # A part that sees no bone, such as a button in front of a gap, is heated by the bone that is
    # nearest through the solid.
    blind = np.bincount(mesh.islands, sees, mesh.n_islands)[mesh.islands] == 0
    through, far = _nearest_through(solid, bones, mesh.positions[blind])
    lost = np.flatnonzero(blind)
    rows = _unit_rows(chances, lost, through)
    distances = distances.copy()
    distances[lost], nearest[lost] = far, through
    report_fraction(0.5, "measuring the surface")
    # The equilibrium of a surface with the Laplacian L (negative of the usual sign), vertex areas M
    # and heat H_i = c / d_i^2 from the nearest bones p_i is (L + M H) w = M H p (Baran and Popović
    # 2007, section 4). The mesh is scaled to size 1.
    scaled = replace(mesh, positions=mesh.positions / size)
    operator, areas = _surfaces.get(mesh, None, lambda: laplacian(scaled))
    heated = np.isfinite(distances)
    ratio = np.maximum(np.where(heated, distances / size, 1.0), _SHORTEST)
    heat = np.where(heated, _HEAT * areas / ratio**2, 0.0)
    from scipy import sparse

    matrix = sparse.csr_array(operator + sparse.diags_array(heat))
    solve = factorised(matrix) or conjugate_gradients(matrix)
    right = sparse.csc_array(scaled_rows(rows, heat))
    parts, step = [], max(1, _BLOCK // len(distances))
    for start in range(0, right.shape[1], step):
        report_fraction(0.6 + 0.4 * start / right.shape[1], "spreading heat")
        values = solve(right[:, start : start + step].toarray())
        parts.append(sparse.csc_array(np.where(values < _LEAST, 0.0, values)))
    found = sparse.csr_array(sparse.hstack(parts))
    return _finished(mesh, solid, bones, found, nearest, distances)


def geodesic_voxels(mesh: Welded, solid: Solid, bones: Bones) -> BoneWeights:
    """Return weights that fall off with the distance from the bones through the solid."""
    from scipy import sparse
    from scipy.sparse import csgraph

    joints, places = bones.joints.tolist(), solid.nearest(bones.points)
    # From the surface to the first voxel, the path is straight.
    first, rows = solid.tree.query(mesh.positions)
    known = _paths.get(mesh, solid, dict)
    measured: dict[bytes, Floats] = {}
    lengths = np.empty((len(rows), len(joints)))
    for column, joint in enumerate(joints):
        report(column, len(joints), "", "measuring paths")
        sources = np.unique(places[bones.starts[joint] : bones.starts[joint + 1]])
        key = sources.tobytes()
        if key not in known:
            # Of a symmetric matrix, the steps in the stored direction suffice.
            graph = _graphs.get(solid, None, solid.graph)
            found = csgraph.dijkstra(graph, indices=sources, min_only=True)
            known[key] = found[rows] + first
        lengths[:, column] = measured[key] = known[key]
    # Only bones of the last skeleton are kept: after an edit, most of them are the same.
    known.clear()
    if lengths.size <= _BLOCK:
        known.update(measured)
    distances = lengths.min(axis=1, initial=np.inf)
    floor = np.finfo(float).tiny
    # w_j ~ d_j^-k, scaled by the least distance so that no power overflows.
    values = (np.maximum(distances, floor)[:, None] / np.maximum(lengths, floor)) ** _FALL_OFF
    values[values < _LEAST] = 0.0
    found = sparse.csr_array(values)
    shape = (len(rows), len(bones.starts) - 1)
    columns = np.array(joints, dtype=np.int32)
    weights = sparse.csr_array((found.data, columns[found.indices], found.indptr), shape=shape)
    nearest = columns[lengths.argmin(axis=1)]
    return _finished(mesh, solid, bones, weights, nearest, distances)


def _seen(points: Floats, solid: Solid, bones: Bones) -> tuple[csr_array, Floats]:
    """Return equal chances for the nearest bones in sight, sparse (W, J), and their distances."""
    from scipy import sparse

    candidates, lengths, ends = _candidates(points, solid, bones)
    order = np.argsort(lengths, axis=1)
    rows = np.arange(len(points))
    distances = np.full(len(points), np.inf)
    entries = []
    for rank in range(lengths.shape[1]):
        report(rank, lengths.shape[1], "", "looking for bones")
        column = order[:, rank]
        gap, end = lengths[rows, column], ends[rows, column]
        # Bones that meet at a joint are equally near around it, and share the heat.
        wanted = np.flatnonzero(np.isfinite(gap) & (gap <= distances * (1.0 + _EQUAL)))
        clear = wanted[_is_clear(solid, points[wanted], end[wanted])]
        distances[clear] = np.minimum(distances[clear], gap[clear])
        entries.append((clear, candidates[clear, column[clear]]))
    which = np.concatenate([row for row, _ in entries])
    joints = np.concatenate([joint for _, joint in entries])
    shape = (len(points), len(bones.starts) - 1)
    found = sparse.csr_array((np.ones(len(which)), (which, joints)), shape=shape)
    sums = np.asarray(found.sum(axis=1)).ravel()
    return scaled_rows(found, 1.0 / np.maximum(sums, 1.0)), distances


def _candidates(points: Floats, solid: Solid, bones: Bones) -> tuple[Ints, Floats, Floats]:
    """Return the nearest joints of points (N, K), distances (N, K) and points there (N, K, 3)."""
    from scipy import spatial

    # Vertices in the same voxel have nearly the same distances, so that only the nearest joints of
    # its centre are measured for each of them.
    joints = bones.joints
    voxels, inverse = np.unique(solid.voxel_of(points), axis=0, return_inverse=True)
    trees = [spatial.cKDTree(bones.of(joint)) for joint in joints.tolist()]
    centers = solid.centers(voxels)
    rough = np.stack([tree.query(centers)[0] for tree in trees], axis=1)
    count = min(_CANDIDATES, len(joints))
    chosen = np.argsort(rough, axis=1)[:, :count][inverse.reshape(-1)]
    lengths, ends = np.full(chosen.shape, np.inf), np.zeros((*chosen.shape, 3))
    for number, (joint, tree) in enumerate(zip(joints.tolist(), trees, strict=True)):
        rows, columns = np.nonzero(chosen == number)
        lengths[rows, columns], nearest = tree.query(points[rows])
        ends[rows, columns] = bones.of(joint)[nearest]
    return joints[chosen], lengths, ends


def _is_clear(solid: Solid, starts: Floats, ends: Floats) -> Bools:
    """Return whether straight lines between points (N, 3) stay in the solid: (N,)."""
    lengths = np.linalg.norm(ends - starts, axis=1)
    count = int(np.ceil(lengths.max(initial=0.0) / solid.spacing)) + 1
    clear = np.ones(len(starts), dtype=np.bool_)
    for fraction in np.linspace(0.0, 1.0, count).tolist():
        # The ends are on the surface and perhaps on a bone just outside: voxels are too coarse.
        beside = np.minimum(fraction, 1.0 - fraction) * lengths < _BLIND * solid.spacing
        asked = np.flatnonzero(clear & ~beside)
        clear[asked] = _contains(solid, starts[asked] + fraction * (ends[asked] - starts[asked]))
    return clear


def _nearest_through(solid: Solid, bones: Bones, points: Floats) -> tuple[Ints, Floats]:
    """Return the joint nearest to each point (N,) through the solid, and the distance (N,)."""
    from scipy.sparse import csgraph

    if len(points) == 0:
        return np.zeros(0, dtype=np.int32), np.zeros(0)
    rows = solid.nearest(bones.points)
    sources, first = np.unique(rows, return_index=True)
    lengths, _, origins = csgraph.dijkstra(
        solid.graph(), directed=False, indices=sources, min_only=True, return_predecessors=True
    )
    at = solid.nearest(points)
    owners = bones.owners[first][np.searchsorted(sources, origins[at])]
    return owners, lengths[at] + solid.gaps(points)


def _unit_rows(rows: csr_array, where: NDArray[np.integer], joints: Ints) -> csr_array:
    """Return sparse rows (W, J); the empty rows at ``where`` get weight 1 for a joint each."""
    from scipy import sparse

    added = sparse.csr_array((np.ones(len(where)), (where, joints)), shape=rows.shape)
    return sparse.csr_array(rows + added)


def _stiff_votes(mesh: Welded, solid: Solid, bones: Bones) -> Floats:
    """Return the fraction of the area of each stiff island that moves with each joint: (I, J).

    That is the joint with the nearest bone, as the few vertices of the island are at its ends,
    where other bones begin. Rows of other islands are 0.
    """
    owners = mesh.islands[mesh.triangles[:, 0]]
    triangles = mesh.triangles[stiff_islands(mesh)[owners]]
    votes = np.zeros((mesh.n_islands, len(bones.starts) - 1))
    if len(triangles) == 0 or not triangle_areas(mesh.positions, triangles).any():
        return votes
    samples = sample_surface(mesh.positions, triangles, _SAMPLES)
    where = mesh.islands[triangles[samples.triangles, 0]]
    joints, _ = _nearest_through(solid, bones, samples.positions)
    np.add.at(votes, (where, joints), 1.0)
    votes /= np.maximum(votes.sum(axis=1, keepdims=True), 1.0)
    for island in np.flatnonzero(votes.max(axis=1) > 0.0).tolist():
        above = _above_branches(votes[island], bones.parents)
        if above >= 0 and votes[island].max() < _MOSTLY and _is_convex(mesh, island):
            votes[island] = np.arange(votes.shape[1]) == above
    return votes


def _above_branches(votes: Floats, parents: Ints) -> int:
    """Return the joint above several branches that share a part; -1 if one line of joints has it.

    The armrest between the back and the seat of a chair, or a chest between two arms, would be
    sheared by its joints, or go to one side.
    """
    sharing = np.flatnonzero(votes >= _SHARE).tolist()
    lines = [path_to_root(parents, joint) for joint in sharing]
    longest = max(lines, key=len, default=[])
    if set(sharing) <= {*longest}:
        return -1
    return next((joint for joint in longest if all(joint in line for line in lines)), -1)


def _is_convex(mesh: Welded, island: int) -> bool:
    """Return whether an island has no limbs of its own, as trousers have, in its convex hull."""
    from scipy.spatial import ConvexHull, QhullError

    corners = mesh.positions[mesh.triangles[mesh.islands[mesh.triangles[:, 0]] == island]]
    try:
        hull = ConvexHull(corners.reshape(-1, 3)).volume
    except QhullError:  # flat
        return True
    volume = float(part_volumes(corners, np.zeros(len(corners), dtype=np.int32), 1)[0][0])
    return abs(volume) >= _CONVEX * hull


def _finished(
    mesh: Welded, solid: Solid, bones: Bones, rows: csr_array, nearest: Ints, distances: Floats
) -> BoneWeights:
    """Return normalised weights, with parts of mostly one joint moving rigidly."""
    from scipy import sparse

    stiff = _stiff_votes(mesh, solid, bones)
    # Eyes, buttons, armour and the plates of robots are separate surfaces that do not bend.
    n_joints = rows.shape[1]
    seen = np.flatnonzero(nearest >= 0)
    votes = sparse.csr_array(
        (np.ones(len(seen)), (mesh.islands[seen], nearest[seen])), shape=(mesh.n_islands, n_joints)
    )
    members = np.bincount(mesh.islands, minlength=mesh.n_islands)
    joint = np.asarray(votes.argmax(axis=1)).ravel().astype(np.int32)
    share = np.asarray(votes.max(axis=1).toarray()).ravel() / np.maximum(members, 1)
    known = stiff.max(axis=1) > 0.0
    joint = np.where(known, stiff.argmax(axis=1), joint).astype(np.int32)
    share = np.where(known, stiff.max(axis=1), share)
    is_rigid = share >= np.where(known, _MOSTLY, _RIGID)
    # The body itself may be one long bone.
    is_rigid[members.argmax()] &= known[members.argmax()]
    rigid = np.where(is_rigid, joint, -1).astype(np.int32)
    where = np.flatnonzero(is_rigid[mesh.islands])
    kept = scaled_rows(rows, np.where(is_rigid[mesh.islands], 0.0, 1.0))
    rows = _unit_rows(kept, where, rigid[mesh.islands[where]])
    sums = np.asarray(rows.sum(axis=1)).ravel()
    if not (sums > 0.0).all():
        raise RigError(
            "the weights could not be computed: the mesh is too irregular; try another "
            f"{Remedy('Method', '--method')}"
        )
    rows, lies = _with_trifles(mesh, bones, scaled_rows(rows, 1.0 / sums))
    return BoneWeights(rows, nearest, distances, np.where(lies, -1, rigid), lies)


def _with_trifles(mesh: Welded, bones: Bones, rows: csr_array) -> tuple[csr_array, Bools]:
    """Give small islands that would leave the surface on which they lie its weights: those (I,).

    The bone nearest to an eye of a large head may be a shoulder's. An island that moves mostly like
    the surface beneath it keeps its own weights, as does one with a bone inside: it may be a finger
    of a robot.
    """
    from scipy import sparse

    count = mesh.n_islands
    lies = np.zeros(count, dtype=np.bool_)
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, mesh.islands, mesh.positions)
    np.maximum.at(high, mesh.islands, mesh.positions)
    sizes = np.linalg.norm(high - low, axis=1)
    has_faces = np.bincount(mesh.islands[mesh.triangles[:, 0]], minlength=count) > 0
    is_small = has_faces & (sizes <= _TRIFLE * box_size(bounding_box(mesh.positions)))
    for island in np.flatnonzero(is_small).tolist():
        inside = (bones.points >= low[island]) & (bones.points <= high[island])
        is_small[island] = not inside.all(axis=1).any()
    beneath = mesh.triangles[~is_small[mesh.islands[mesh.triangles[:, 0]]]]
    if not is_small.any() or len(beneath) == 0:
        return rows, lies
    members = np.flatnonzero(is_small[mesh.islands])
    points = Surface(mesh.positions, beneath).closest(mesh.positions[members])
    owners, gaps = mesh.islands[members], np.full(count, np.inf)
    np.minimum.at(gaps, owners, points.distances)
    under = (gaps <= _ON * sizes)[owners]
    under &= points.distances <= (gaps + _UNDER * sizes)[owners]
    numbers = np.bincount(owners[under], minlength=count)
    means, own = (
        sparse.csr_array((np.ones(len(each)), (each, np.arange(len(each)))), (count, len(each)))
        @ values
        for each, values in (
            (owners[under], interpolate(points, beneath, rows)[under]),
            (owners, rows[members]),
        )
    )
    means = scaled_rows(means, 1.0 / np.maximum(numbers, 1))
    own = scaled_rows(own, 1.0 / np.maximum(np.bincount(owners, minlength=count), 1))
    common = np.asarray(own.minimum(means).sum(axis=1)).ravel()
    strongest, other = (np.asarray(each.argmax(axis=1)).ravel() for each in (own, means))
    lies = (numbers > 0) & (common < _COMMON) & (strongest != other)
    changed = members[lies[owners]]
    return put_rows(rows, changed, means[mesh.islands[changed]]), lies
