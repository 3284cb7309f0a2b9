"""Spring joints, compared with closed forms and an independent implementation."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rigs.springs.reference_springs import Reference, turn

from viewer.rigs.geometry.rotation import quaternion_to_matrix
from viewer.rigs.kinematics import forward_kinematics
from viewer.rigs.skeleton import Skeleton, ball_skeleton
from viewer.rigs.springs.simulation import STEPS_PER_SECOND, Simulation
from viewer.rigs.springs.spring_joints import INSIDE, PLANE, Colliders, Springs

STEP = 1.0 / STEPS_PER_SECOND


def skeleton_of(springs, parents=(-1, 0), places=((0, 1, 0), (1, 0, 0)), turns=None) -> Skeleton:
    names = tuple(f"j{index}" for index in range(len(parents)))
    made = ball_skeleton(names, np.array(parents), np.array(places, float))
    rests = made.rest_rotations if turns is None else np.array(turns, float)
    moves = np.array(places, float)
    return replace(made, rest_translations=moves, rest_rotations=rests, springs=springs)


def springs_of(joints, tails, **values) -> Springs:
    count = len(joints)
    given = {"stiffness": 0.0, "drags": 0.0, "radii": 0.0} | values
    scalars = {name: np.full(count, given.pop(name)) for name in ("stiffness", "drags", "radii")}
    gravities = np.tile(given.pop("gravity", (0.0, 0.0, 0.0)), (count, 1))
    centers = np.full(count, given.pop("center", -1))
    return Springs(
        np.array(joints),
        np.array(tails, float),
        **scalars,
        gravities=gravities,
        centers=centers,
        **given,
    )


def pose_of(skeleton: Skeleton, turns=None, shift=(0, 0, 0)):
    """Return the joints of one pose: world and local matrices, scales and placement."""
    local = np.tile(np.eye(4), (skeleton.n_joints, 1, 1))
    rotations = skeleton.rest_rotations if turns is None else turns
    local[:, :3, :3] = quaternion_to_matrix(rotations)
    local[:, :3, 3] = skeleton.rest_translations
    local[0, :3, 3] += shift
    scales = np.ones((skeleton.n_joints, 3))
    return forward_kinematics(skeleton.parents, local), local, scales, np.eye(4)


def run(skeleton: Skeleton, n_steps: int, tails=None):
    """Return the points and rotations after some steps in the rest pose."""
    simulation, pose = Simulation(skeleton), pose_of(skeleton)
    tails = simulation.start(*pose) if tails is None else tails
    rotations = simulation.rests
    for _ in range(n_steps):
        tails, rotations = simulation.step(tails, *pose)
    return tails, rotations


def test_spring_without_forces_stays_at_rest():
    tails, rotations = run(skeleton_of(springs_of([0], [[0, -2, 0]])), 10)
    assert_allclose(tails.now, [[0, -1, 0]], rtol=0, atol=1e-12)
    assert_allclose(rotations, [[0, 0, 0, 1]], rtol=0, atol=1e-12)


def test_pendulum_comes_to_rest_along_gravity():
    springs = springs_of([0], [[2, 0, 0]], gravity=(0, -3, 0), drags=0.2)
    tails, rotations = run(skeleton_of(springs), 600)
    assert_allclose(tails.now, [[0, -1, 0]], rtol=0, atol=1e-6)
    # From +x to -y is -90 degrees about z.
    half = np.sqrt(0.5)
    assert_allclose(rotations, [[0, 0, -half, half]], rtol=0, atol=1e-6)


def test_stiffness_and_gravity_balance_along_their_sum():
    # At rest, the point is in the direction of stiffness * axis + gravity, 3 x - 4 y.
    springs = springs_of([0], [[1, 0, 0]], gravity=(0, -4, 0), stiffness=3.0, drags=0.5)
    tails, _ = run(skeleton_of(springs), 600)
    assert_allclose(tails.now, [[0.6, 1.0 - 0.8, 0]], rtol=0, atol=1e-9)


def test_stiffness_alone_returns_to_the_rest_direction():
    springs = springs_of([0], [[1, 0, 0]], stiffness=2.0, drags=0.6)
    skeleton = skeleton_of(springs)
    simulation = Simulation(skeleton)
    start = simulation.start(*pose_of(skeleton))
    moved = type(start)(np.array([[0.0, 2.0, 0.0]]), np.array([[0.0, 2.0, 0.0]]))
    tails, rotations = run(skeleton, 600, moved)
    assert_allclose(tails.now, start.now, rtol=0, atol=1e-9)
    assert_allclose(rotations, [[0, 0, 0, 1]], rtol=0, atol=1e-9)


def test_first_step_moves_by_the_force_times_the_time_step():
    springs = springs_of([0], [[1, 0, 0]], gravity=(0, -3, 0))
    tails, _ = run(skeleton_of(springs), 1)
    wanted = np.array([1.0, -3.0 * STEP, 0.0])
    assert_allclose(tails.now[0] - [0, 1, 0], wanted / np.linalg.norm(wanted), rtol=0, atol=1e-12)


def test_sphere_stops_the_point_at_the_sum_of_both_radii():
    # The sphere is below the pivot, in the path of a pendulum that swings down from +x.
    shape = Colliders(
        np.array([1]), np.array([[0, -1, 0]]), np.array([[0, -1, 0]]), np.array([0.5])
    )
    springs = springs_of(
        [0],
        [[1, 0, 0]],
        gravity=(0, -1, 0),
        drags=0.3,
        radii=0.25,
        colliders=shape,
        obstacles=((0,),),
    )
    # Joint 1 is a second root at the same position, which does not swing.
    skeleton = skeleton_of(springs, (-1, -1), ((0, 1, 0), (0, 1, 0)))
    tails, _ = run(skeleton, 600)
    # The constant length pulls the point back into the sphere by less than gravity moves it in a
    # step.
    assert_allclose(np.linalg.norm(tails.now[0] - [0, 0, 0]), 0.75, rtol=0, atol=STEP / 2)
    assert_allclose(np.linalg.norm(tails.now[0] - [0, 1, 0]), 1.0, rtol=0, atol=1e-12)
    assert tails.now[0, 0] > 0.0


@pytest.mark.parametrize(
    ("kind", "offset", "tail", "radius"),
    [
        # A floor at the height -0.5 from the pivot.
        (PLANE, (0, -0.5, 0), (0, 0.5, 0), 0.0),
        # Hollow shapes around the point at rest, 1 from the pivot.
        (INSIDE, (1, 0, 0), (1, 0, 0), 0.8),
        (INSIDE, (1, 0, -2), (1, 0, 2), 0.8),
    ],
    ids=["plane", "sphere", "capsule"],
)
def test_planes_and_hollow_shapes_hold_the_point(kind, offset, tail, radius):
    """The point with the radius 0.25 falls from +x onto the plane, or to the wall of the shape."""
    rows = np.array([offset], float), np.array([tail], float), np.array([radius])
    shape = Colliders(np.array([1]), *rows, np.array([kind]))
    springs = springs_of(
        [0],
        [[1, 0, 0]],
        gravity=(0, -1, 0),
        drags=0.3,
        radii=0.25,
        colliders=shape,
        obstacles=((0,),),
    )
    skeleton = skeleton_of(springs, (-1, -1), ((0, 1, 0), (0, 1, 0)))
    tails, _ = run(skeleton, 600)
    point = tails.now[0] - [0, 1, 0]
    if kind == PLANE:
        assert_allclose(point[1], -0.25, rtol=0, atol=STEP / 2)
    else:
        assert_allclose(np.linalg.norm(point - [1, 0, 0]), 0.8 - 0.25, rtol=0, atol=STEP / 2)
    assert point[0] > 0.5


def test_scaled_plane_pushes_along_its_own_normal():
    """The plane 3 y = 4 x through the pivot, four times as wide in x, is 3 y = x."""
    normal = np.array([[-0.8, 0.6, 0.0]])
    shape = Colliders(np.array([1]), np.zeros((1, 3)), normal, np.zeros(1), np.array([PLANE]))
    springs = springs_of([0], [[1, 0, 0]], colliders=shape, obstacles=((0,),))
    skeleton = skeleton_of(springs, (-1, -1), ((0, 1, 0), (0, 1, 0)))
    simulation, (world, local, scales, place) = Simulation(skeleton), pose_of(skeleton)
    tails = simulation.start(world, local, scales, place)
    scales[1] = 4.0, 1.0, 1.0
    world[1, :3, :3] *= scales[1]
    tails, _ = simulation.step(tails, world, local, scales, place)
    # (1, 0) lies 1 / sqrt(10) below; its foot (0.9, 0.3) is moved to the distance 1.
    assert_allclose(tails.now[0] - [0, 1, 0], np.array([3, 1, 0]) / np.sqrt(10), atol=1e-12)


def test_colliders_on_other_chains_are_met_where_they_have_swung():
    """A plane hangs from a joint that has swung from +x to -y, where it is the floor y = -1."""
    normal = np.array([[-1.0, 0.0, 0.0]])
    shape = Colliders(np.array([1]), np.zeros((1, 3)), normal, np.zeros(1), np.array([PLANE]))
    springs = springs_of([0, 2], [[1, 0, 0], [1, 0, 0]], colliders=shape, obstacles=((), (0,)))
    skeleton = skeleton_of(springs, (-1, 0, -1), ((0, 0, 0), (1, 0, 0), (0, -1, 0)))
    simulation, pose = Simulation(skeleton), pose_of(skeleton)
    now = np.array([[0, -1, 0], [0.6, -1.8, 0]])
    tails = replace(simulation.start(*pose), now=now, before=now)
    tails, _ = simulation.step(tails, *pose)
    # The second point, (0.6, -0.8) from its pivot on the floor, is lifted to (0.6, 0), then
    # moved to the distance 1.
    assert_allclose(tails.now, [[0, -1, 0], [1, -1, 0]], rtol=0, atol=1e-12)


@pytest.mark.parametrize("center", [-1, 0])
def test_inertia_is_relative_to_the_center(center):
    springs = springs_of([1], [[0, -1, 0]], drags=0.0, center=center)
    skeleton = skeleton_of(springs, places=((0, 1, 0), (0, 0, 0)))
    simulation = Simulation(skeleton)
    tails = simulation.start(*pose_of(skeleton))
    shifted = pose_of(skeleton, shift=(1, 0, 0))
    _, rotations = simulation.step(tails, *shifted)
    tilt = abs(rotations[0, 2])
    # The point either follows its centre or stays behind, pulled from (0, -1) to (-1, -1) /
    # sqrt(2).
    assert_allclose(tilt, 0.0 if center == 0 else np.sin(np.pi / 8), rtol=0, atol=1e-12)


def _random_figure(rng: np.random.Generator) -> Skeleton:
    parents = (-1, 0, 1, 2, 3, 1, 5, 0)
    places = rng.normal(size=(8, 3)) * 0.3
    turns = rng.normal(size=(8, 4))
    shapes = Colliders(
        np.array([0, 7]),
        rng.normal(size=(2, 3)) * 0.2,
        rng.normal(size=(2, 3)) * 0.2,
        np.array([0.3, 0.2]),
    )
    # Joint 3 is between spring joints, but is not a spring joint itself.
    springs = Springs(
        np.array([2, 4, 5, 6]),
        rng.normal(size=(4, 3)) * 0.3,
        rng.uniform(0, 4, 4),
        rng.uniform(0, 1, 4),
        rng.normal(size=(4, 3)),
        rng.uniform(0, 0.1, 4),
        np.array([-1, -1, 1, 0]),
        shapes,
        ((0, 1), (1,), (), (1, 0)),
    )
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    return skeleton_of(springs, parents, places, turns)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_chains_agree_with_the_pseudocode_of_the_specification(seed):
    rng = np.random.default_rng(seed)
    skeleton = _random_figure(rng)
    simulation, turns = Simulation(skeleton), skeleton.rest_rotations.copy()
    world, local, scales, place = pose_of(skeleton)
    reference = Reference(skeleton, local)
    tails = simulation.start(world, local, scales, place)
    for _ in range(40):
        turns = turns + 0.05 * rng.normal(size=turns.shape)
        turns /= np.linalg.norm(turns, axis=1, keepdims=True)
        world, local, _, _ = pose_of(skeleton, turns)
        tails, rotations = simulation.step(tails, world, local, scales, place)
        wanted = reference.step(local, world)
        for row, joint in enumerate(skeleton.springs.joints.tolist()):
            # The tolerance is 40 steps of 1e-16 relative rounding, amplified by inertia.
            assert_allclose(turn(rotations[row]), wanted[joint], rtol=0, atol=1e-9)


def test_joints_hidden_by_a_scale_of_zero_do_not_swing():
    springs = springs_of([1], [[0, -1, 0]], gravity=(1, 0, 0), center=0)
    skeleton = skeleton_of(springs)
    world, local, scales, place = pose_of(skeleton)
    scales[0] = 0.0
    world = forward_kinematics(skeleton.parents, local * np.array([0.0, 0.0, 0.0, 1.0]))
    simulation = Simulation(skeleton)
    tails = simulation.start(world, local, scales, place)
    for _ in range(3):
        tails, rotations = simulation.step(tails, world, local, scales, place)
    assert np.isfinite(tails.now).all()
    assert_allclose(np.linalg.norm(rotations, axis=1), 1.0, rtol=0, atol=1e-12)
