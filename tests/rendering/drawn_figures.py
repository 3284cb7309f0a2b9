"""Figures for rendering tests: random figures with any number of joints, and simple solids."""

import math
from collections.abc import Sequence

import numpy as np

from viewer.rendering.lineup import Crowd, Group, Lineup, is_culled, lineup
from viewer.rendering.options import DisplayOptions
from viewer.rigs.figure import Figure
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.material import Material, Texture
from viewer.rigs.mesh import Mesh
from viewer.rigs.pose import Pose, rest_pose
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.skin import Skin, skin_from_lists

ROTATIONS = (3, 4, 5)


def skeleton(parents, offsets, boxes=None) -> Skeleton:
    """Return a skeleton in which all joints rotate freely about x, y and z."""
    n_joints = len(parents)
    return Skeleton(
        names=tuple(f"j{joint}" for joint in range(n_joints)),
        parents=np.asarray(parents, dtype=np.int32),
        rest_translations=np.asarray(offsets, dtype=float).reshape(-1, 3),
        rest_rotations=np.tile([0.0, 0.0, 0.0, 1.0], (n_joints, 1)),
        rest_scales=np.ones((n_joints, 3)),
        dof_joints=np.repeat(np.arange(n_joints, dtype=np.int32), 3),
        dof_kinds=np.tile(np.array(ROTATIONS, dtype=np.int32), n_joints),
        rest_dofs=np.zeros(3 * n_joints),
        dof_limits=np.tile([-np.inf, np.inf], (3 * n_joints, 1)),
        boxes=boxes,
    )


def random_pose(skeleton: Skeleton, rng: np.random.Generator, reach: float = math.pi) -> Pose:
    """Return a random pose with every DOF within its limits, and unlimited DOFs within +-reach."""
    pose = rest_pose(skeleton)
    low = np.maximum(skeleton.dof_limits[:, 0], -reach)
    high = np.minimum(skeleton.dof_limits[:, 1], reach)
    pose.dofs[:] = rng.uniform(np.minimum(low, high), high)
    return pose


def random_figure(
    rng,
    n_joints,
    n_vertices=600,
    size=1.0,
    origin=(0.0, 0.0, 0.0),
    counts=(1, 5),
    sums=(1.0, 1.0),
    empty=0.0,
    skew=False,
    chain=False,
) -> Figure:
    """Return a cloud of vertices bound at random to a random tree of joints. counts: range of
    influences per vertex; sums: range of weight sums; empty: fraction of vertices without
    influence; skew: bindings with shear and non-uniform scale.
    """
    indices = np.arange(n_joints)
    parents = indices - 1 if chain else np.array([-1, *(rng.integers(0, i) for i in indices[1:])])
    offsets = 0.15 * size * rng.normal(size=(n_joints, 3)) / (math.sqrt(n_joints) if chain else 1)
    offsets[0] = origin
    joints = skeleton(parents, offsets)
    bindings = world_matrices(joints, rest_pose(joints))
    if skew:
        bindings[:, :3, :3] = np.eye(3) * rng.uniform(0.3, 3.0, (n_joints, 1, 3))
        bindings[:, :3, :3] += 0.2 * rng.normal(size=(n_joints, 3, 3))
    positions = np.asarray(origin) + size * rng.uniform(-0.5, 0.5, (n_vertices, 3))
    normals = rng.normal(size=(n_vertices, 3)) * rng.uniform(0.1, 10.0, (n_vertices, 1))
    n_influences = rng.integers(counts[0], counts[1] + 1, n_vertices)
    n_influences[rng.random(n_vertices) < empty] = 0
    starts = np.concatenate([[0], np.cumsum(n_influences)])
    weights = rng.uniform(0.05, 1.0, starts[-1])
    owners = np.repeat(np.arange(n_vertices), n_influences)
    totals = np.bincount(owners, weights, n_vertices)
    wanted = rng.uniform(*sums, n_vertices)
    weights *= (wanted / np.where(totals == 0.0, 1.0, totals))[owners]
    skin = Skin(
        starts=starts.astype(np.int32),
        joints=rng.integers(0, n_joints, starts[-1]).astype(np.int32),
        weights=weights,
        inverse_bind=np.linalg.inv(bindings),
    )
    triangles = rng.integers(0, n_vertices, (n_vertices, 3)).astype(np.int32)
    return Figure("cloud", Mesh(positions, normals, triangles), joints, skin)


def sphere(rings=24, radius=1.0, center=(0.0, 0.0, 0.0), sides=None) -> Mesh:
    """Return a sphere with smooth outward normals and uvs, counter-clockwise from outside."""
    sides = sides or 2 * rings
    polar = np.linspace(0.0, math.pi, rings + 1)
    around = np.linspace(0.0, 2.0 * math.pi, sides + 1)
    a, p = np.meshgrid(around, polar)
    normals = np.stack([np.sin(p) * np.sin(a), np.cos(p), np.sin(p) * np.cos(a)], -1)
    uvs = np.stack([a / (2.0 * math.pi), 1.0 - p / math.pi], -1).reshape(-1, 2)
    corner = (np.arange(rings)[:, None] * (sides + 1) + np.arange(sides)).ravel()
    below = corner + sides + 1
    triangles = np.concatenate(
        [np.stack([corner, below, below + 1], 1), np.stack([corner, below + 1, corner + 1], 1)]
    )
    normals = normals.reshape(-1, 3)
    return Mesh(radius * normals + np.asarray(center), normals, triangles, uvs)


def square(z=0.0, half=1.0, material=None, clockwise=False, uv_scale=1.0) -> Mesh:
    """Return a square that faces +z, u to the right and v upwards."""
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    return Mesh(
        positions=np.column_stack([half * corners, np.full(4, z)]),
        normals=np.tile([0.0, 0.0, 1.0], (4, 1)),
        triangles=triangles[:, ::-1] if clockwise else triangles,
        uvs=uv_scale * (0.5 * corners + 0.5),
        materials=() if material is None else (material,),
        triangle_materials=None if material is None else np.zeros(2, dtype=np.int32),
    )


def picture(rows) -> Material:
    """Return a material with a texture of these rows of (r, g, b), the first at the top."""
    colors = np.array(rows, dtype=np.uint8)
    alpha = np.full((*colors.shape[:2], 1), 255, dtype=np.uint8)
    return Material("paint", Texture("paint.png", np.concatenate([colors, alpha], axis=2)))


def checker(n=8, first=(230, 200, 60), second=(40, 70, 160)) -> Material:
    """Return a material with n x n squares of 8 pixels."""
    odd = np.add.outer(np.arange(8 * n) // 8, np.arange(8 * n) // 8) % 2 == 1
    return picture(np.where(odd[..., None], second, first))


def arm(n_joints=4, sides=16, rings=40, material=None) -> Figure:
    """Return a tube along +x with a joint per unit and weights blended at the elbows."""
    x = np.linspace(0.0, n_joints, rings + 1)
    around = np.linspace(0.0, 2.0 * math.pi, sides + 1)
    along, angle = np.meshgrid(x, around, indexing="ij")
    normals = np.stack([0 * angle, np.cos(angle), np.sin(angle)], -1).reshape(-1, 3)
    positions = 0.28 * normals
    positions[:, 0] = along.ravel()
    corner = (np.arange(rings)[:, None] * (sides + 1) + np.arange(sides)).ravel()
    above = corner + sides + 1
    triangles = np.concatenate(
        [np.stack([corner, corner + 1, above], 1), np.stack([corner + 1, above + 1, above], 1)]
    )
    triangles = triangles[:, ::-1]
    uvs = np.stack([along / n_joints, angle / (2 * math.pi)], -1).reshape(-1, 2)
    box = np.array([[0.1, -0.12, -0.12], [0.9, 0.12, 0.12]])
    joints = skeleton(
        np.arange(n_joints) - 1,
        [[0.0, 0.0, 0.0], *[[1.0, 0.0, 0.0]] * (n_joints - 1)],
        np.tile(box, (n_joints, 1, 1)),
    )
    mesh = Mesh(
        positions,
        normals,
        triangles,
        uvs,
        () if material is None else (material,),
        None if material is None else np.zeros(len(triangles), dtype=np.int32),
    )
    influences = []
    for place in positions[:, 0]:
        joint = min(int(place), n_joints - 1)
        blend = 0.5 * max(0.0, 1.0 - 2.5 * (place - joint)) if joint else 0.0
        ahead = 0.5 * max(0.0, 1.0 - 2.5 * (joint + 1 - place)) if joint < n_joints - 1 else 0.0
        pairs = [(joint, 1.0 - blend - ahead), (joint - 1, blend), (joint + 1, ahead)]
        influences.append([pair for pair in pairs if pair[1] > 0.0])
    inverse_bind = np.linalg.inv(world_matrices(joints, rest_pose(joints)))
    return Figure("arm", mesh, joints, skin_from_lists(influences, inverse_bind))


def bent(figure: Figure, *turns: tuple[int, str, float]) -> Actor:
    """Return an actor with DOFs set: (joint, axis, radians)."""
    actor = Actor(figure)
    assert figure.skeleton is not None
    for joint, axis, angle in turns:
        actor.pose.dofs[3 * joint + "xyz".index(axis)] = angle
    return actor


def scene_of(*meshes: Mesh) -> Scene:
    """Return a scene of meshes without skeletons."""
    return Scene([Actor(Figure(f"mesh {i}", mesh)) for i, mesh in enumerate(meshes)])


def group_of(actors: Sequence[Actor], known: Group | None = None) -> Group:
    """Return actors as one group that is up to date: the known one if it has the same actors."""
    shapes = [actor.pose.shape_weights.tolist() for actor in actors]
    assert shapes.count(shapes[0]) == len(shapes)
    is_other = known is not None and known.crowd.shape_weights.tolist() != shapes[0]
    if known is None or is_other or known.actors != list(actors):
        known = Group(Crowd(list(actors)), np.arange(len(actors)), list(actors))
    known.crowd.poses = [actor.pose for actor in actors]
    known.crowd.update()
    return known


def groups_of(actors: Sequence[Actor], options: DisplayOptions) -> list[list[Actor]]:
    """Return the actors that are drawn together."""
    return [
        group.actors
        for crowd in lineup(actors, options, Lineup()).crowds.values()
        for group in crowd.groups(is_culled(crowd.actors[0].figure, options), 1000)
    ]
