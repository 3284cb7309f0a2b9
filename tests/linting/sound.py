"""Small valid figures and motions for tests that introduce one error."""

from dataclasses import replace

import numpy as np

from viewer.rigs.captures.points import PointClip, PointLayout
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.mesh import Mesh, vertex_normals
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.skin import skin_from_lists

HEIGHTS = 5
RATE = 30.0
FRAMES = 60


def column() -> Figure:
    """Return a closed square column of 5 rings of 4 vertices on two joints, symmetric in x.
    Vertices 4 h + k are ring h at y = h, with k = 0 to 3 at (1, 1), (-1, 1), (-1, -1), (1, -1) in x
    and z; 0 mirrors 1, and 2 mirrors 3. Joint 0 is at the foot, joint 1 at y = 2.
    """
    ring = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], dtype=float)
    positions = np.array([[x, h, z] for h in range(HEIGHTS) for x, z in ring])
    triangles = []
    for h in range(HEIGHTS - 1):
        for k in range(4):
            a, b = 4 * h + k, 4 * h + (k + 1) % 4
            triangles += [[a, a + 4, b], [b, a + 4, b + 4]]
    top = 4 * (HEIGHTS - 1)
    triangles += [[0, 1, 2], [0, 2, 3], [top, top + 2, top + 1], [top, top + 3, top + 2]]
    mesh = make_mesh(positions, np.array(triangles))
    rows = {0: [(0, 1.0)], 1: [(0, 1.0)], 2: [(0, 0.5), (1, 0.5)], 3: [(1, 1.0)], 4: [(1, 1.0)]}
    joints = np.array([[0.0, 0, 0], [0, 2, 0]])
    skin = skin_from_lists(
        [rows[v // 4] for v in range(len(positions))], translation_matrix(-joints)
    )
    partner = np.arange(len(positions)) + np.tile([1, -1, 1, -1], HEIGHTS)
    skeleton = make_skeleton(("foot", "knee"), [-1, 0], [[0, 0, 0], [0, 2, 0]])
    return Figure("column", mesh, skeleton, skin, unit="m", symmetry=partner)


def make_mesh(positions, triangles) -> Mesh:
    """Build a mesh with unit normals."""
    triangles = np.asarray(triangles, dtype=np.int32)
    return Mesh(positions, vertex_normals(np.asarray(positions), triangles), triangles)


def make_skeleton(names, parents, offsets, limits=(-3.0, 3.0)) -> Skeleton:
    """Build a skeleton with joints that rotate about x, y and z; the root also translates."""
    count = len(names)
    dofs = 3 + 3 * count
    bounds = np.tile(limits, (dofs, 1))
    bounds[:3] = -np.inf, np.inf
    return Skeleton(
        names=names,
        parents=np.array(parents, dtype=np.int32),
        rest_translations=np.array(offsets, dtype=float),
        rest_rotations=np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)),
        rest_scales=np.ones((count, 3)),
        dof_joints=np.concatenate([[0, 0, 0], np.repeat(np.arange(count), 3)]).astype(np.int32),
        dof_kinds=np.concatenate([[0, 1, 2], np.tile([3, 4, 5], count)]).astype(np.int32),
        rest_dofs=np.zeros(dofs),
        dof_limits=bounds,
    )


def legs() -> Figure:
    """Return a skeleton of a pelvis at y = 1 and two legs of hip, knee and ankle at y = 0.1."""
    names = ("pelvis", *(f"{s}_{j}" for s in ("left", "right") for j in ("hip", "knee", "ankle")))
    offsets = [[0, 1, 0], *([[x, -0.1, 0], [0, -0.4, 0], [0, -0.4, 0]] for x in (0.1, -0.1))]
    flat = [offsets[0], *offsets[1], *offsets[2]]
    return Figure("legs", skeleton=make_skeleton(names, [-1, 0, 1, 2, 0, 4, 5], flat), unit="m")


def standing(figure: Figure, **changes) -> SampledClip:
    """Return a motion of 60 frames at 30 fps without movement."""
    count = figure.skeleton.n_joints
    clip = SampledClip(
        name="still",
        timing=Timing(RATE, np.arange(FRAMES), first_frame=100),
        rotations=np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, count, 1)),
        translations=np.zeros((FRAMES, count, 3)),
    )
    return replace(clip, **changes)


def keypoints() -> tuple[Figure, PointClip]:
    """Return three static points that are visible for 60 frames."""
    limbs = np.array([[0, 1], [1, 2]])
    layout = PointLayout("three", ("hip", "knee", "ankle"), limbs, np.zeros(3, dtype=np.int32))
    rows = np.tile([[0, 1, 0, 0.9], [0, 0.5, 0, 0.9], [0, 0, 0, 0.9]], (FRAMES, 1, 1))
    clip = PointClip("points", Timing(RATE, np.arange(FRAMES), first_frame=100), rows)
    return Figure("points", points=layout), clip


def scene_of(figure: Figure, clip=None, pose=None) -> Scene:
    """Return a scene of one actor."""
    return Scene([Actor(figure, own_pose=pose, clip=clip)])
