"""Checks of a transferred rig, and messages about their results."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from viewer.autorig.surface.welding import edges
from viewer.autorig.transfer.joint_transfer import outside
from viewer.diagnostics import Diagnostic, note
from viewer.errors import RigError
from viewer.phrases import agree, counted, listed
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.hierarchy import descendants
from viewer.rigs.mesh import Mesh, bounding_box, box_size
from viewer.rigs.pose import Pose
from viewer.rigs.skeleton import joint_label
from viewer.rigs.skinning import deform, joint_matrices

_EXACT = 1e-4  # ratio of residual to size above which a warning is given

# Edges that tear if one joint rotates: by how much their ends move apart, as a fraction of the
# size, and relative to their length. Of 23 rigs of people, animals and robots, 18 have no joint
# with as many such edges; the others have spikes at a belt, a collar or a jaw.
_BEND = np.radians(60.0)
_GAP, _LONGER, _FEWEST = 0.05, 2.0, 4

FARTHEST = 1e9
"""Largest coordinate of a mesh to rig and of a landmark, in any unit. With coordinates of 1e30, the
search for closest points excludes few triangles, and a fit takes minutes."""


def require_target(target: Mesh) -> None:
    """Raise ``RigError`` if a mesh cannot be rigged: it has no triangles, or is too large."""
    if target.n_triangles == 0:
        raise RigError("expected a target with triangles, found none")
    largest = float(np.abs(target.positions).max())
    if largest > FARTHEST:
        raise RigError(
            f"expected a target with coordinates up to {FARTHEST:g}, found {largest:.3g}; scale "
            "the mesh, or delete what is so far away"
        )


def newly_outside(
    template: Figure,
    pose: Pose,
    posed: Floats,
    target: Mesh,
    joints: Floats | None = None,
    transferred: Bools | None = None,
) -> tuple[int, ...]:
    """Return the joints that lie inside the template but outside the target.

    ``joints``: (J, 3) in the target's frame, by default the template's. ``transferred``: (J,), the
    joints expected to be inside, unlike those of parts that the target lacks; by default all.
    """
    own = joint_matrices(template, pose)[:, :3, 3]
    before = outside(posed, template.require_mesh().triangles, own)
    asked = np.flatnonzero(~before if transferred is None else transferred & ~before)
    there = own if joints is None else joints
    after = outside(target.positions, target.triangles, there[asked])
    return tuple(asked[after].tolist())


def residual_of(figure: Figure, pose: Pose, placement: Floats, target: Mesh) -> float:
    """Return the largest distance of a reposed figure from the target, over the target's size."""
    again = apply_transform(placement, deform(figure, pose)[0])
    size = box_size(bounding_box(target.positions))
    return float(np.linalg.norm(again - target.positions, axis=1).max(initial=0.0)) / size


def check_lines(
    figure: Figure, pose: Pose, guarded: Bools, out: tuple[int, ...], residual: float
) -> Iterator[Diagnostic]:
    """Return messages about the results of ``invert_skinning`` and of the checks above."""
    if out:
        skeleton = figure.skeleton
        assert skeleton is not None  # only joints of a skeleton are listed
        names = [joint_label(skeleton, joint) for joint in out]
        joints = np.array(out, dtype=np.int32)
        yield Diagnostic(
            "R009.joints: joints outside the mesh: {names}",
            None,
            None,
            "joints",
            joints,
            {"names": listed(names, 8)},
        )
    vertices = np.flatnonzero(guarded).astype(np.int32)
    if len(vertices):
        values = {"n": counted(len(vertices), "vertex"), "vertices": listed(vertices.tolist(), 8)}
        yield Diagnostic(
            "R010.vertices: {n} bent too far for exact inverse skinning, so smoothed: {vertices}",
            None,
            None,
            "positions",
            vertices,
            values,
        )
    yield from _torn_lines(figure, pose)
    yield note(
        "R011.residual: after posing, the mesh differs from the target by at most "
        "{residual:.3%} of its size",
        residual=residual,
    )
    if residual > _EXACT and not len(vertices):
        yield note(
            "R012.residual: after posing, the mesh differs from the target by more than "
            "{limit:.2%} of its size",
            limit=_EXACT,
        )


def _torn_lines(figure: Figure, pose: Pose) -> Iterator[Diagnostic]:
    """Yield a warning of places that tear when a joint rotates from the pose of the target.

    Where neighbours have the weights a and b of all joints below one at the distance r, and it
    rotates by t about the worst axis, they move apart by 2 |a - b| r sin(t / 2).
    """
    from scipy import sparse

    mesh, skeleton, skin = figure.attached()
    positions, places = deform(figure, pose)[0], joint_matrices(figure, pose)[:, :3, 3]
    links, count = edges(mesh.triangles), skin.n_joints
    weights = sparse.csr_array(
        (skin.weights, skin.joints, skin.starts), shape=(skin.n_vertices, count)
    )
    below = np.stack([descendants(skeleton.parents, joint) for joint in range(count)], axis=1)
    total = weights @ sparse.csr_array(below.astype(float))
    steps = sparse.coo_array(total[links[:, 0]] - total[links[:, 1]])
    rows, joints = steps.coords
    ends = positions[links]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    arms = np.linalg.norm(ends.mean(axis=1)[rows] - places[joints], axis=1)
    gaps = 2.0 * np.sin(0.5 * _BEND) * np.abs(steps.data) * arms
    size = box_size(bounding_box(positions))
    torn = np.flatnonzero((gaps > _GAP * size) & (gaps > _LONGER * lengths[rows]))
    # Several joints of a chain may tear an edge: the one that tears it most is named.
    torn = torn[np.argsort(-gaps[torn], kind="stable")]
    torn = torn[np.unique(rows[torn], return_index=True)[1]]
    numbers = np.bincount(joints[torn], minlength=count)
    torn = torn[numbers[joints[torn]] >= _FEWEST]
    if len(torn) == 0:
        return
    worst = torn[gaps[torn].argmax()]
    named = np.unique(joints[torn])
    named = named[np.argsort(-numbers[named], kind="stable")]
    yield Diagnostic(
        "R018.torn: the mesh may tear when {joints} {rotate}: at 60°, vertices {one} and {other} "
        "would move {gap:.0%} of its size apart",
        None,
        None,
        "weights",
        np.unique(links[rows[torn]]).astype(np.int32),
        {
            "joints": listed([joint_label(skeleton, joint) for joint in named.tolist()], 4),
            "rotate": agree(len(named), "rotates", "rotate"),
            "gap": float(gaps[worst]) / size,
            "one": int(links[rows[worst], 0]),
            "other": int(links[rows[worst], 1]),
        },
    )


def with_joint_name(line: Diagnostic, figure: Figure) -> Diagnostic:
    """Replace the index of a joint in a message with its name."""
    skeleton, joint = figure.skeleton, line.values.get("joint")
    if skeleton is None or not isinstance(joint, int):
        return line
    return replace(line, values={**line.values, "joint": joint_label(skeleton, joint)})
