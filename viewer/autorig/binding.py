"""Binding of a mesh to a given skeleton: its place in the mesh, and weights from its bones."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from viewer.autorig.alignment.orientation_search import axis_rotations
from viewer.autorig.alignment.similarity import Similarity, fit_similarity
from viewer.autorig.alignment.surface_alignment import AlignmentSettings, similarity_of
from viewer.autorig.checks import check_lines, residual_of, with_joint_name
from viewer.autorig.rigged import Rigged, with_fields
from viewer.autorig.settings import TransferSettings
from viewer.autorig.solid import Solid, solid_of
from viewer.autorig.surface.welding import Welded, one_sided, weld
from viewer.autorig.transfer.rest_skeleton import scaled_pose, with_offsets
from viewer.autorig.weights.bone_weights import (
    NEAR,
    Bones,
    BoneWeights,
    bone_heat,
    bones_in,
    geodesic_voxels,
    names_control,
)
from viewer.autorig.weights.result import RigidIslands, WeightTransfer, rigid_lines
from viewer.autorig.weights.weight_transfer import WeightSettings, skin_of, smooth
from viewer.diagnostics import Diagnostic, note
from viewer.errors import RigError
from viewer.phrases import agree, counted, listed, printable, rounded
from viewer.progress import part_of_work, report_fraction
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import axis_rotations as about_axis
from viewer.rigs.geometry.rotation import rotation_distance
from viewer.rigs.geometry.transform import affine_matrices, apply_transform
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.memo import Memo
from viewer.rigs.mesh import Mesh
from viewer.rigs.pose import Pose, placement_matrix
from viewer.rigs.shape import shaped_skeleton
from viewer.rigs.skeleton import Skeleton, joint_label, shown_joints
from viewer.rigs.skin import Skin, idle_joints, skin_rows
from viewer.rigs.units import METRES, unit_of_scaled

_Weigh = Callable[[Welded, Solid, Bones], BoneWeights]
_METHODS: dict[str, tuple[_Weigh, str]] = {
    "heat": (bone_heat, "bone heat"),
    "voxel": (geodesic_voxels, "geodesic voxels"),
}

_enclosed: Memo[Mesh, tuple[Welded, Solid]] = Memo()

# Place of the skeleton.
_ENOUGH = 0.5  # fraction of joints inside with which a skeleton may be where it should be
_MUCH_BETTER = 0.25  # difference of that fraction that another place needs
_SURELY = 0.75  # fraction of joints inside that another place needs
# Sizes of the joints' box relative to the mesh's, in place and anywhere else: a skeleton in the
# wrong unit may be a point inside the mesh, or be so large that only its root is there.
_SIZES, _LIKELY_SIZES = (0.15, 3.0), (0.4, 1.5)
_UNITS = (1.0, *sorted({a / b for a, b in product(METRES.values(), repeat=2) if a != b}))
# Fraction of joints inside that a place needs if the skeleton may also slide, and the difference
# from the best up to which places are alike.
_SLID, _ALIKE = 0.85, 0.1
_TELLING = 0.5  # fraction of joints with weights from which the others are known to be idle
# Networks that predict skeletons scale the longest side of a mesh to 2, centred, or to 1. Programs
# that store lengths in another unit take these for metres: in a .fbx file of Blender, they are 200
# and 100.
_NORMALISED = (2.0, 1.0)
# Some leave a margin, so that the skeleton is placed too small. Of artists' skeletons of 16 meshes,
# at most 0.93 of what is inside stays there if they are made this much larger; of the same ones
# with a margin of a tenth, at least 0.98.
_LARGER, _STAY = 1.1, 0.96
_BONE_SAMPLES = 5
_ROUNDING = 1e-9
_MOST_TIMES = 1000  # ratio of sizes beyond which the number says no more


def enclosed(target: Mesh) -> tuple[Welded, Solid]:
    """Return the surface of a mesh and the solid in it, which all skeletons have in common."""

    def make() -> tuple[Welded, Solid]:
        mesh = one_sided(weld(target.positions, target.triangles))
        return mesh, solid_of(mesh.positions, mesh.triangles, fills_hollows=True)

    return _enclosed.get(target, None, make)


def bind(source: Figure, pose: Pose, target: Mesh, how: TransferSettings, name: str) -> Rigged:
    """Bind a mesh to the posed skeleton of a figure; see ``transfer``, which checks the mesh."""
    report_fraction(0.0, "finding the inside")
    with part_of_work(span=(0.0, 0.2)):
        mesh, solid = enclosed(target)
    skeleton = shaped_skeleton(source, pose.shape_weights)
    report_fraction(0.2, "placing the skeleton")
    place = placement_matrix(pose)
    joints = apply_transform(place, world_matrices(skeleton, pose)[:, :3, 3])
    asked = _asked(source, skeleton)
    moved, placed = _placed(source, joints, asked, solid, how.alignment)
    skeleton, posed, turn = _moved(skeleton, pose, moved)
    worlds = world_matrices(skeleton, posed)
    bones = bones_in(solid, skeleton, turn @ worlds, _deforming(source), _holders(source))
    if len(bones.joints) == 0:
        size = moved.scale * _ratio(joints[asked], solid)
        raise _misplaced(source, 0, int(asked.sum()), size)
    with part_of_work(span=(0.25, 0.9)):
        weigh, title = _METHODS[how.method]
        found = weigh(mesh, solid, bones)
    report_fraction(0.9, "checking the result")
    skin = _skin(mesh, found, _inverse(source, skeleton, worlds), how.weights)
    figure = Figure(
        name=name,
        mesh=_turned_back(target, turn[:3, :3]),
        skeleton=skeleton,
        skin=skin,
        up=source.up,
        unit=unit_of_scaled(source.unit, moved.scale),
        hands=source.hands,
        pose_layout=source.pose_layout,
        facts=(("rig", f"bound to the skeleton of {source.name} by {title}"),),
    )
    weights = _result(mesh, found, skin)
    guarded = np.zeros(target.n_vertices, dtype=np.bool_)
    residual = residual_of(figure, posed, turn, target)
    out = tuple(np.flatnonzero(bones.outside).tolist())
    lines = (
        placed,
        *_size_lines(source, skeleton, joints, moved, solid),
        *_weight_lines(mesh, found, how.method),
        *(with_joint_name(line, figure) for line in rigid_lines(weights.rigid, from_bones=True)),
        *_trifle_lines(int(found.lies.sum())),
        *_bone_lines(skeleton, bones, skin),
        *check_lines(figure, posed, guarded, out, residual),
    )
    rigged = Rigged(
        figure=figure,
        pose=posed,
        placement=turn,
        alignment=None,
        weights=weights,
        guarded=guarded,
        residual=residual,
        outside=out,
        length_scale=moved.scale,
        figure_scale=1.0,
        path_scale=moved.scale,
        lines=lines,
        max_influences=how.weights.max_influences,
    )
    return with_fields(rigged, ("sees a bone", "diffused", "rigid"), "Distance to the bone")


def _skin(mesh: Welded, found: BoneWeights, inverse: Floats, how: WeightSettings) -> Skin:
    """Return weights of a welded mesh as the skin of the original vertices."""
    rows = found.rows
    if how.smoothing_rounds:
        active = found.rigid[mesh.islands] < 0
        rows = smooth(rows, mesh.triangles, active, how.smoothing_rounds)
    return skin_rows(skin_of(rows, inverse, how.max_influences), mesh.vertices)


def _turned_back(mesh: Mesh, rotation: Floats) -> Mesh:
    """Return a mesh rotated to the axes of a skeleton that ``rotation`` would rotate to it."""
    if np.array_equal(rotation, np.eye(3)):
        return mesh
    # v' = R^-1 v: the vectors are rows, so they are multiplied by R.
    return replace(mesh, positions=mesh.positions @ rotation, normals=mesh.normals @ rotation)


def _deforming(source: Figure) -> Bools | None:
    """Return the joints (J,) with weights in the skeleton's own figure; None if that says little.

    Files of a predicted skeleton may have a mesh that is bound to a few of its joints only.
    """
    if not source.is_rigged:
        return None
    idle = idle_joints(source.require_skin(), source.skeleton)
    found = np.ones(source.require_skeleton().n_joints, dtype=np.bool_)
    found[idle] = False
    return found if found.mean() >= _TELLING else None


def _holders(source: Figure) -> Bools:
    """Return the joints (J,) that are the nodes of rigid parts, such as a sword or a cape.

    Among the parts of a skinned file, such a node is a joint with the name of its part.
    """
    skeleton = source.require_skeleton()
    if source.mesh is None or source.record is None or not source.record.has_skin:
        return np.zeros(skeleton.n_joints, dtype=np.bool_)
    parts, above = set(source.mesh.parts), set(skeleton.parents.tolist())
    holds = [j not in above and name in parts for j, name in enumerate(skeleton.names)]
    return np.array(holds)


def _asked(source: Figure, skeleton: Skeleton) -> Bools:
    """Return the joints (J,) that should be inside the mesh: no roots, no controls."""
    drawn = np.zeros(skeleton.n_joints, dtype=np.bool_)
    drawn[shown_joints(skeleton)] = True
    deforming = _deforming(source)
    if deforming is None:
        deforming = ~names_control(skeleton)
    wanted = drawn & deforming & ~_holders(source) & (skeleton.parents >= 0)
    return wanted if wanted.any() else drawn


def _placed(
    source: Figure, joints: Floats, asked: Bools, solid: Solid, how: AlignmentSettings
) -> tuple[Similarity, Diagnostic]:
    """Return the map of a skeleton into the mesh, and a message about it."""
    points = joints[asked]
    scale = 1.0 if how.scale == "none" else None
    if how.scale == "axes":
        raise RigError("--scale axes: expected uniform or none for a skeleton, found axes")
    pairs, given = how.landmarks, None
    if how.matrix is not None:
        given = similarity_of(how.matrix)
    elif pairs is not None:
        given = fit_similarity(pairs[:, 0], pairs[:, 1], scale)
    if given is not None:
        if not given.is_plain:
            raise RigError("alignment: expected one scale for a skeleton, found one for each axis")
        inside = _counts_inside(solid, points, [given])[0]
        if inside == 0:
            raise _misplaced(source, 0, len(points), given.scale * _ratio(points, solid))
        return given, _placed_line(given, inside, len(points), None)
    candidates = _candidates(source, solid, how)
    count = len(points)
    low, high = _SIZES if count > 1 and how.scale != "none" else (0.0, np.inf)
    size = _ratio(points, solid)
    first = _counts_inside(solid, points, candidates[:1])[0]
    as_is = first / count if low <= size * candidates[0].scale <= high else 0.0
    if as_is == 1.0:
        return candidates[0], _placed_line(candidates[0], count, count, None)
    counts = _counts_inside(solid, points, candidates)
    sizes = size * np.array([each.scale for each in candidates])
    low, high = _LIKELY_SIZES
    shares = np.where((low <= sizes) & (sizes <= high), np.array(counts) / count, 0.0)
    best = int(shares.argmax())
    if as_is >= _ENOUGH and as_is > shares[best] - _MUCH_BETTER:
        return candidates[0], _placed_line(candidates[0], first, count, None)
    if shares[best] < _SURELY:
        likely = [
            place
            for place, ratio in zip(candidates, sizes.tolist(), strict=True)
            if low <= ratio <= high
        ]
        slid = [_slid(solid, points, place) for place in likely]
        found = np.array(_counts_inside(solid, points, slid) if slid else [0]) / count
        # Of places that are nearly as good, the first is the least changed one.
        best = int((found >= found.max() - _ALIKE).argmax())
        if found[best] < _SLID:
            raise _misplaced(source, first, count, size)
        return slid[best], _placed_line(slid[best], round(found[best] * count), count, first)
    before = first if best else None
    return candidates[best], _placed_line(candidates[best], counts[best], count, before)


def _candidates(source: Figure, solid: Solid, how: AlignmentSettings) -> list[Similarity]:
    """Return possible places of a skeleton, the most likely first: as it is, in other units."""
    if how.up is None and how.facing is None:
        # Other up axes, then other facings: quarter turns about x and about the skeleton's own up.
        about_up, quarters = "xyz".index(source.up), np.pi / 2 * np.arange(4)
        rotations = [
            np.round(about_axis(0, np.asarray(tilt)) @ about_axis(about_up, np.asarray(turn))) + 0.0
            for turn in quarters
            for tilt in (0.0, np.pi / 2, -np.pi / 2)
        ]
    else:
        rotations = axis_rotations(source.up, how.up, how.facing)
    middle, longest = _box(solid)
    places = [(unit, np.zeros(3)) for unit in (_UNITS if how.scale != "none" else (1.0,))]
    if how.scale != "none":
        places += [(longest / side, middle) for side in _normalised_sides(source)]
    return [
        Similarity(scale, rotation, shift, np.ones(3))
        for scale, shift in places
        for rotation in rotations
    ]


def _box(solid: Solid) -> tuple[Floats, float]:
    """Return the middle (3,) of a solid's box and its longest side, both to half a voxel."""
    centers = solid.centers(solid.voxels)
    low, high = centers.min(axis=0), centers.max(axis=0)
    return 0.5 * (low + high), float((high - low).max()) + solid.spacing


def _normalised_sides(source: Figure) -> list[float]:
    """Return the longest sides of the meshes for which networks predict skeletons."""
    units = sorted({1.0, METRES.get(source.unit, 1.0)}, reverse=True)
    return [side / unit for unit in units for side in _NORMALISED]


def _slid(solid: Solid, points: Floats, place: Similarity) -> Similarity:
    """Return a place moved to where most points are inside, and far from the surface."""
    # The root of a .bvh file is often at the origin. From matching boxes, all 26 directions are
    # tried with steps from an eighth of the mesh down to a voxel.
    there = place.scale * points @ place.rotation.T
    middle = solid.origin + 0.5 * solid.spacing * (np.array(solid.inside.shape) - 1)
    shift = middle - 0.5 * (there.min(axis=0) + there.max(axis=0))
    ways = np.array(list(product((-1.0, 0.0, 1.0), repeat=3)))
    ways = ways[np.argsort(np.abs(ways).sum(axis=1), kind="stable")]
    step = 0.125 * solid.spacing * max(solid.inside.shape)
    while step >= solid.spacing:
        moved = there + (shift + step * ways)[:, None]
        depths = solid.distance[tuple(np.moveaxis(solid.voxel_of(moved), -1, 0))]
        inside = (depths > 0.0).sum(axis=1)
        score = inside + depths.mean(axis=1) / (solid.spacing * max(solid.inside.shape))
        best = int(score.argmax())
        shift = shift + step * ways[best]
        if best == 0:  # no direction is better
            step *= 0.5
    return replace(place, shift=shift)


def _counts_inside(solid: Solid, points: Floats, places: list[Similarity]) -> list[int]:
    """Return how many of the points are inside with each of the maps."""
    moved = np.concatenate([place.apply(points) for place in places])
    inside = solid.gaps(moved) <= NEAR * solid.spacing
    return [int(row.sum()) for row in inside.reshape(len(places), len(points))]


def _ratio(points: Floats, solid: Solid) -> float:
    """Return the longest side of the joints' box over that of the mesh's."""
    return float(np.ptp(points, axis=0).max()) / _box(solid)[1]


def _placed_line(found: Similarity, inside: int, count: int, before: int | None) -> Diagnostic:
    """Return the message about a skeleton's place; ``before``: joints inside without moving it."""
    values = {"inside": inside, "all": counted(count, "joint")}
    matrix = found.matrix
    if np.array_equal(matrix, np.eye(4)):
        return note(
            "R001.skeleton: skeleton: not moved, {inside} of {all} inside the mesh", **values
        )
    angle = float(np.degrees(rotation_distance(found.rotation, np.eye(3))))
    moved = {"scale": rounded(found.scale, 6), "angle": angle, **values}
    # A fit leaves rounding errors where nothing moves.
    shift = np.where(np.abs(found.shift) > _ROUNDING * np.abs(found.shift).max(), found.shift, 0.0)
    moved |= dict(zip("xyz", shift.tolist(), strict=True))
    if before is None:
        return note(
            "R001.skeleton-given: skeleton: scale {scale}, rotation {angle:.2f} degrees, "
            "translation ({x:z.4g}, {y:z.4g}, {z:z.4g}); {inside} of {all} inside the mesh",
            **moved,
        )
    return note(
        "R001.skeleton-moved: skeleton: scale {scale}, rotation {angle:.2f} degrees, translation "
        "({x:z.4g}, {y:z.4g}, {z:z.4g}); {inside} of {all} inside the mesh, {before} where it was",
        before=before,
        **moved,
    )


def _size_lines(
    source: Figure, skeleton: Skeleton, joints: Floats, place: Similarity, solid: Solid
) -> Iterator[Diagnostic]:
    """Yield a warning if a skeleton that was scaled to the mesh's size may be too small."""
    middle, longest = _box(solid)
    if not any(np.isclose(place.scale * side, longest) for side in _normalised_sides(source)):
        return
    ends = np.flatnonzero(skeleton.parents >= 0)
    bones = np.linspace(joints[skeleton.parents[ends]], joints[ends], _BONE_SAMPLES)
    there = place.apply(bones.reshape(-1, 3))
    larger = middle + _LARGER * (there - middle)
    inside, still = (int((solid.gaps(points) <= solid.spacing).sum()) for points in (there, larger))
    if inside and still >= _STAY * inside:
        yield note(
            "R002.small-skeleton: the skeleton may be too small: as much of it would be inside the "
            "mesh if it were 10% larger; place it with --landmarks"
        )


def _misplaced(source: Figure, inside: int, count: int, size: float) -> RigError:
    return RigError(
        f"skeleton {printable(source.name, 60)}: expected its joints inside the mesh, found "
        f"{inside} of {count} there and a skeleton {_compared(size)}; other "
        "units and up axes fit no better: place it with --landmarks, or pose it with "
        "--template-pose or --template-frame"
    )


def _compared(size: float) -> str:
    """Return how large a skeleton is, relative to the mesh, in words."""
    if size == 0.0:
        return "at one point"
    ratio = max(size, 1.0 / size)
    times = f"over {_MOST_TIMES}" if ratio > _MOST_TIMES else f"{rounded(ratio, 2)}"
    if times == "1":
        return "as large as the mesh"
    return f"{times} times {'as large as' if size > 1.0 else 'smaller than'} the mesh"


def _moved(skeleton: Skeleton, pose: Pose, place: Similarity) -> tuple[Skeleton, Pose, Floats]:
    """Return a scaled and shifted skeleton, its pose, and the rotation that maps it to the mesh.

    The rotation stays outside of the skeleton, so that its root keeps its axes, limits and clips.
    """
    own = placement_matrix(pose)
    scale = place.scale * pose.figure_scale
    # R s (p + t) = R (s p + R^-1 (s R t_own + t)).
    shift = (place.apply(own[:3, 3])) @ place.rotation
    scales = np.full(skeleton.n_joints, scale)
    offsets = scale * skeleton.rest_translations
    offsets[skeleton.parents < 0] += shift
    moved = with_offsets(skeleton, offsets, scales)
    if skeleton.boxes is not None:
        moved = replace(moved, boxes=scale * skeleton.boxes)
    if scale == 1.0 and not shift.any():
        moved = skeleton
    turn = affine_matrices(place.rotation, np.zeros(3))
    return moved, scaled_pose(skeleton, pose, scales), turn


def _inverse(source: Figure, skeleton: Skeleton, worlds: Floats) -> Floats:
    """Return the inverse bind matrices (J, 4, 4); ``RigError`` if a joint has no inverse."""
    flat = np.flatnonzero(np.abs(np.linalg.det(worlds[:, :3, :3])) < np.finfo(float).tiny)
    if len(flat):
        raise RigError(
            f"skeleton {printable(source.name, 60)}: expected joints with a scale, found 0 at "
            f"{joint_label(skeleton, int(flat[0]))}"
        )
    return np.asarray(np.linalg.inv(worlds), dtype=np.float64)


def _result(mesh: Welded, found: BoneWeights, skin: Skin) -> WeightTransfer:
    """Return the weights with their origin, for the vertices that were welded."""
    welded, islands = mesh.vertices, np.flatnonzero(found.rigid >= 0)
    is_rigid = found.rigid[mesh.islands] >= 0
    sees = (found.nearest >= 0) & ~is_rigid
    counts = np.bincount(mesh.islands, minlength=mesh.n_islands)
    rows = np.unique(mesh.islands, return_index=True)[1][islands]
    first = np.unique(welded, return_index=True)[1][rows].astype(np.int32)
    known = np.where(np.isfinite(found.distances), found.distances, 0.0)
    rigid = RigidIslands(first, counts[islands].astype(np.int32), found.rigid[islands], known[rows])
    return WeightTransfer(
        starts=skin.starts,
        joints=skin.joints,
        weights=skin.weights,
        matched=sees[welded],
        inpainted=(~sees & ~is_rigid)[welded],
        distances=known[welded],
        angles=np.zeros(len(welded)),
        points=None,
        backwards=np.zeros(len(welded), dtype=np.bool_),
        rigid=rigid,
        lines=(),
    )


def _weight_lines(mesh: Welded, found: BoneWeights, method: str) -> Iterator[Diagnostic]:
    """Return messages about the origin of weights."""
    count = len(found.nearest)
    if method == "voxel":
        yield note("R005.voxels: weights by distance from the bones through the solid")
        return
    sees = int((found.nearest >= 0).sum())
    if sees == count:
        yield note(
            "R005.heat-all: weights by heat from the bones: straight lines inside the mesh lead to "
            "a bone from all {all} vertices",
            all=count,
        )
        return
    yield note(
        "R005.heat: weights by heat from the bones: straight lines inside the mesh lead to a bone "
        "from {n} of {all} vertices; the others take their weights from the surface around them",
        n=sees,
        all=count,
    )


def _trifle_lines(count: int) -> Iterator[Diagnostic]:
    """Return a message about parts with the weights of the surface beneath them."""
    if count:
        yield note(
            "R007.trifles: {n} {move} with the surface beneath, not with the nearest bone",
            n=counted(count, "small part"),
            move=agree(count, "moves", "move"),
        )


def _bone_lines(skeleton: Skeleton, bones: Bones, skin: Skin) -> Iterator[Diagnostic]:
    """Return messages about the joints without weights."""
    joints = bones.joints
    outside = np.setdiff1d(shown_joints(skeleton), joints)
    labels = [joint_label(skeleton, joint) for joint in outside.tolist()]
    if labels:
        yield note(
            "R008.some-bones: {n} bound; no bone in the mesh, so no weights: {idle}",
            n=counted(len(joints), "joint"),
            idle=listed(labels, 8),
        )
    else:
        yield note("R008.bones: {n} bound", n=counted(len(joints), "joint"))
    # The end of a limb often has none.
    inner = np.intersect1d(joints, skeleton.parents)
    moved = np.intersect1d(inner, idle_joints(skin, skeleton))
    if len(moved):
        yield note(
            "R008.stiff-parts: no weights: {idle}; the parts of the mesh around {them} stay rigid "
            "and follow other joints",
            them=agree(len(moved), "it", "them"),
            idle=listed([joint_label(skeleton, joint) for joint in moved.tolist()], 8),
        )
