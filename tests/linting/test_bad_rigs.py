"""Faults of weights, joints, bindings and sides in the bundled body, which has none."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from types import ModuleType

import numpy as np
import pytest
from linting.sound import make_mesh, make_skeleton

import viewer
from viewer.linting import (
    Finding,
    Subject,
    bindings,
    blending,
    hands,
    joint_places,
    noise,
    spikes,
    stray_weights,
    symmetry,
    volumes,
)
from viewer.loading import bundled_body
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import axis_rotations
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.hierarchy import descendants
from viewer.rigs.mesh import Mesh
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.motion.transform_clip import TransformChannel, TransformClip
from viewer.rigs.scene import Actor
from viewer.rigs.shape import rest_joints
from viewer.rigs.skin import normalized, owners, skin_from_entries, skin_from_lists, skin_rows

CHECKS = (stray_weights, blending, noise, bindings, joint_places, spikes, symmetry)


@cache
def body() -> Figure:
    """Return the body without its symmetry map, as a file of another program has none."""
    return replace(viewer.load(bundled_body()).actors[0].figure, symmetry=None)


@cache
def table() -> np.ndarray:
    """Return the weights of the body: (V, J)."""
    skin = normalized(body().skin)
    weights = np.zeros((skin.n_vertices, skin.n_joints))
    weights[owners(skin), skin.joints] = skin.weights
    return weights


def joint(name: str) -> int:
    return body().skeleton.names.index(name)


def below(name: str) -> np.ndarray:
    """Return which joints move with a joint: (J,)."""
    parents, found = body().skeleton.parents, np.arange(body().skeleton.n_joints) == joint(name)
    for each in range(len(parents)):
        found[each] |= parents[each] >= 0 and found[parents[each]]
    return found


def weighted(weights: np.ndarray, figure: Figure | None = None) -> Figure:
    figure = figure or body()
    vertices, joints = np.nonzero(weights)
    values = weights[vertices, joints] / weights.sum(axis=1)[vertices]
    skin = skin_from_entries(len(weights), vertices, joints, values, figure.skin.inverse_bind)
    return replace(figure, skin=skin)


def placed(figure: Figure, scale: float, up: str) -> Figure:
    """Return a figure in another unit, with z up if requested."""
    turn = np.eye(3)
    if up == "z":
        turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    mesh, skin, skeleton = figure.mesh, figure.skin, figure.skeleton
    binds = skin.inverse_bind.copy()
    binds[:, :3, :3] = binds[:, :3, :3] @ turn.T
    binds[:, :3, 3] *= scale
    moved = scale * skeleton.rest_translations
    moved[0] = moved[0] @ turn.T
    rotations = skeleton.rest_rotations.copy()
    if up == "z":
        rotations[0] = np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)
    return Figure(
        figure.name,
        Mesh(scale * mesh.positions @ turn.T, mesh.normals @ turn.T, mesh.triangles),
        replace(skeleton, rest_translations=moved, rest_rotations=rotations),
        replace(skin, inverse_bind=binds),
        up=up,
    )


def linted(figure: Figure, checks: tuple[ModuleType, ...] = CHECKS) -> list[Finding]:
    subject = Subject(Actor(figure), up=figure.up)
    return [found for check in checks for found in check.check(subject)]


# The head's vertex with the largest weight of the head.
NOSE = 121
# A vertex in the middle of the left thigh, which no other joint moves.
THIGH = int(
    np.argmin(
        np.linalg.norm(
            body().mesh.positions
            - rest_joints(body())[[joint("left_hip"), joint("left_knee")]].mean(axis=0),
            axis=1,
        )
    )
)


def stray(fraction: float) -> Callable[[], Figure]:
    def make() -> Figure:
        weights = table().copy()
        weights[NOSE] *= 1.0 - fraction
        weights[NOSE, joint("right_foot")] += fraction
        return weighted(weights)

    return make


def leak() -> Figure:
    weights = table().copy()
    on_head = np.flatnonzero(weights[:, joint("head")] > 0.5)
    weights[on_head] *= 0.98
    weights[on_head, joint("right_foot")] += 0.02
    return weighted(weights)


def leak_everywhere(fraction: float = 0.02) -> Figure:
    """Return the body with a head four times as large, which also moves all other vertices."""
    mesh, head = body().mesh, joint("head")
    away = mesh.positions - rest_joints(body())[head]
    points = mesh.positions + 3.0 * table()[:, [head]] * away
    weights = (1.0 - fraction) * table()
    weights[:, head] += fraction
    return weighted(weights, replace(body(), mesh=replace(mesh, positions=points)))


def swapped() -> Figure:
    names = body().skeleton.names
    legs = below("left_hip") | below("right_hip")
    other = {"left": "right", "right": "left"}
    partner = [
        names.index(f"{other[name.split('_')[0]]}_{name.split('_')[1]}") if legs[k] else k
        for k, name in enumerate(names)
    ]
    return weighted(table()[:, partner])


def hard() -> Figure:
    return weighted((table() == table().max(axis=1, keepdims=True)).astype(float))


def hard_elbow() -> Figure:
    return weighted(hard_arm(np.ones(len(table()), dtype=bool)))


def hard_arm(where: np.ndarray) -> np.ndarray:
    weights, arm = table().copy(), [joint("left_shoulder"), joint("left_elbow")]
    around = (weights[:, arm].sum(axis=1) > 0.9) & where
    weights[around] = weights[around] == weights[around].max(axis=1, keepdims=True)
    return weights


def mostly_hard_elbow() -> Figure:
    """Return the body with a hard elbow, except at its upper side."""
    mesh, elbow = body().mesh, rest_joints(body())[joint("left_elbow")]
    return weighted(hard_arm(mesh.positions[:, 1] < elbow[1] + 0.02))


def noisy(size: float, root: str = "pelvis") -> Callable[[], Figure]:
    """Return the body with noise in all weights that blend, or in those of one limb."""

    def make() -> Figure:
        weights = table()
        noise = np.random.default_rng(0).uniform(-size, size, weights.shape) * (weights > 0.02)
        on = weights[:, below(root)].sum(axis=1) > 0.3
        return weighted(np.clip(weights + noise * on[:, None], 0.0, 1.0))

    return make


def crossed() -> Figure:
    """Return the body with a vertex of a thigh that moves by 30 % with the other thigh."""
    weights = table().copy()
    weights[THIGH] *= 0.7
    weights[THIGH, joint("right_hip")] += 0.3
    return weighted(weights)


def turned_in_another_pose() -> Figure:
    """Return the body with a rotated knee, whose joints at rest are rotated about random axes."""
    figure, rng = turned(), np.random.default_rng(1)
    rotations = rng.normal(size=(figure.skeleton.n_joints, 4))
    rotations /= np.linalg.norm(rotations, axis=1)[:, None]
    return replace(figure, skeleton=replace(figure.skeleton, rest_rotations=rotations))


def lopsided() -> Figure:
    weights, wrist = table().copy(), below("left_elbow")
    arm = weights[:, wrist].sum(axis=1) > 0.3
    weights[arm, joint("left_shoulder")] += 0.3
    return weighted(weights)


def moved(*changes: tuple[str, list[float]]) -> Figure:
    """Return the body with moved joints, whose bindings follow."""
    figure = body()
    binds, skeleton = figure.skin.inverse_bind.copy(), figure.skeleton
    offsets = skeleton.rest_translations.copy()
    for name, by in changes:
        binds[joint(name), :3, 3] -= by
        offsets[joint(name)] += by
        offsets[skeleton.parents == joint(name)] -= by
    skeleton = replace(skeleton, rest_translations=offsets)
    return replace(figure, skeleton=skeleton, skin=replace(figure.skin, inverse_bind=binds))


def renamed() -> Figure:
    swap = {"left_knee": "right_knee", "right_knee": "left_knee"}
    skeleton = body().skeleton
    names = tuple(swap.get(name, name) for name in skeleton.names)
    return replace(body(), skeleton=replace(skeleton, names=names))


def renamed_asymmetric() -> Figure:
    """Return the body with exchanged names whose mesh is not symmetric: moved by up to 1 mm."""
    mesh, rng = body().mesh, np.random.default_rng(0)
    points = mesh.positions + rng.uniform(-1e-3, 1e-3, mesh.positions.shape)
    return replace(renamed(), mesh=replace(mesh, positions=points))


def limited() -> Figure:
    skeleton = body().skeleton
    limits = skeleton.dof_limits.copy()
    limits[skeleton.dof_joints == joint("left_knee")] = [-0.5, 1.5]
    return replace(body(), skeleton=replace(skeleton, dof_limits=limits))


def turned() -> Figure:
    """Return the body whose left knee is bound with a rotation of 30 degrees about z."""
    binds = body().skin.inverse_bind.copy()
    turn = np.eye(4)
    turn[:3, :3] = axis_rotations(2, np.radians(-30.0))
    binds[joint("left_knee")] = turn @ binds[joint("left_knee")]
    return replace(body(), skin=replace(body().skin, inverse_bind=binds))


def lying() -> Figure:
    """Return the body whose z axis, not its y axis, is said to point up."""
    return replace(body(), up="z")


def bound_elsewhere() -> Figure:
    """Return the body whose head is bound 100 mm above its place at rest."""
    binds = body().skin.inverse_bind.copy()
    binds[joint("head"), 1, 3] -= 0.1
    return replace(body(), skin=replace(body().skin, inverse_bind=binds))


def flattened() -> Figure:
    """Return the body whose left elbow is at its shoulder."""
    return moved(("left_elbow", list(-body().skeleton.rest_translations[joint("left_elbow")])))


def spiked() -> Figure:
    """Return the body with one vertex of its symmetric mesh 30 mm out of the surface."""
    mesh = body().mesh
    points = mesh.positions.copy()
    points[NOSE] += 0.03 * mesh.normals[NOSE]
    return replace(body(), mesh=replace(mesh, positions=points))


def stuck_out() -> Figure:
    """Return the body with one vertex 300 mm out of the surface."""
    mesh = body().mesh
    points = mesh.positions.copy()
    points[NOSE] += 0.3 * mesh.normals[NOSE]
    return replace(body(), mesh=replace(mesh, positions=points))


def taken(names: tuple[str, ...] = ("left_knee",), by: str = "right_knee") -> Figure:
    """Return the body with all weights of some joints at another."""
    weights = table().copy()
    for name in names:
        weights[:, joint(by)] += weights[:, joint(name)]
        weights[:, joint(name)] = 0.0
    return weighted(weights)


def feet_swapped() -> Figure:
    """Return the body with exchanged weights of the feet, which are 40 mm beside the middle."""
    figure, weights = body(), table().copy()
    feet = [np.flatnonzero(below(f"{side}_ankle")) for side in ("left", "right")]
    points, binds = figure.mesh.positions.copy(), figure.skin.inverse_bind.copy()
    for side, own in zip((1.0, -1.0), feet, strict=True):
        ankle = rest_joints(figure)[own[0], 0]
        by = side * 0.04 - ankle
        points[:, 0] += by * weights[:, own].sum(axis=1)
        binds[own] = binds[own] @ translation_matrix([-by, 0.0, 0.0])
    weights[:, np.concatenate(feet)] = weights[:, np.concatenate(feet[::-1])]
    near = replace(
        figure,
        mesh=replace(figure.mesh, positions=points),
        skin=replace(figure.skin, inverse_bind=binds),
    )
    return weighted(weights, near)


CHECKED = {
    ("W011", "W012", "W013"): stray_weights,
    ("W014", "W015"): blending,
    ("W016",): noise,
    ("B",): bindings,
    ("S",): joint_places,
    ("M",): spikes,
    ("Y",): symmetry,
}
LEG = ("hip", "knee", "ankle", "foot")
FAULTS = {
    "stray vertex": (stray(1.0), "W011.strays", ["right_foot"], [NOSE]),
    "30 % stray": (stray(0.3), "W011.strays", ["right_foot"], [NOSE]),
    "leak": (leak, "W011.strays", ["right_foot"], "head"),
    "leak everywhere": (leak_everywhere, "W011.strays", ["head"], None),
    "legs swapped": (
        swapped, "W013.swapped", [f"{s}_{j}" for s in ("left", "right") for j in LEG], []
    ),
    "feet swapped": (
        feet_swapped, "W013.swapped",
        [f"{s}_{j}" for s in ("left", "right") for j in ("ankle", "foot")], [],
    ),
    "knee moved by the other": (taken, "W012.taken", ["left_knee"], None),
    "hard everywhere": (hard, "W015.everywhere", [], None),
    "hard elbow": (hard_elbow, "W015.border", ["left_shoulder", "left_elbow"], None),
    "mostly hard elbow": (
        mostly_hard_elbow, "W015.border", ["left_shoulder", "left_elbow"], None
    ),
    "noise": (noisy(0.2), "W016.noise", None, None),
    "mild noise": (noisy(0.1), "W016.alternating", None, None),
    "noise of one side": (noisy(0.05, "left_shoulder"), "W016.sides", None, None),
    "crossed": (crossed, "W011.strays", ["right_hip"], [THIGH]),
    "one arm differs": (lopsided, "Y002.joints", None, None),
    "one elbow moved": (
        lambda: moved(("left_elbow", [0.0, 0.1, 0.0])), "Y003.joints",
        ["left_elbow", "right_elbow"], [],
    ),
    "lying": (lying, "S013.lies", ["head", "left_ankle", "right_ankle"], []),
    "bound elsewhere": (bound_elsewhere, "B007.places", ["head"], []),
    "bound with 30 degrees": (turned, "B007.rotations", ["left_knee"], []),
    "bound with 30 degrees in another pose": (
        turned_in_another_pose, "B007.rotations", ["left_knee"], []
    ),
    "elbow at the shoulder": (flattened, "S011.joints", ["left_elbow"], []),
    "knees before the legs": (
        lambda: moved(("left_knee", [0.0, 0.0, 0.2]), ("right_knee", [0.0, 0.0, 0.2])),
        "S012.joints", ["left_knee", "right_knee"], [],
    ),
    "spike of 30 mm": (spiked, "M013.vertices", [], [NOSE]),
    "spike of 300 mm": (stuck_out, "M013.vertices", [], [NOSE]),
    "names swapped": (renamed, "Y004.names", ["left_knee", "right_knee"], []),
    "names swapped, asymmetric": (
        renamed_asymmetric, "Y004.names", ["left_knee", "right_knee"], []
    ),
    "limits of one knee": (limited, "Y005.limits", ["left_knee", "right_knee"], []),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_fault_is_found_at_its_joints_and_vertices(name):
    make, key, joints, vertices = FAULTS[name]
    check = next(check for codes, check in CHECKED.items() if key.startswith(codes))
    (found,) = [one for one in linted(make(), (check,)) if one.diagnostic.key == key]
    assert found.severity == "warning"
    if joints is not None:
        names = body().skeleton.names
        assert sorted(names[each] for each in found.joints) == sorted(joints)
    if vertices == "head":
        vertices = np.flatnonzero(table()[:, joint("head")] > 0.5).tolist()
    assert vertices is None or sorted(found.vertices.tolist()) == vertices


def test_joints_without_sides_in_their_names_are_compared_by_place():
    names = tuple(f"bone_{number:03d}" for number in range(body().skeleton.n_joints))

    def nameless(figure: Figure) -> Figure:
        return replace(figure, skeleton=replace(figure.skeleton, names=names))

    assert linted(nameless(body())) == []
    (found,) = linted(nameless(lopsided()), (symmetry,))
    (named,) = linted(lopsided(), (symmetry,))
    assert found.diagnostic.key == named.diagnostic.key == "Y002.joints"
    assert found.joints.tolist() == named.joints.tolist()


def test_a_joint_bound_elsewhere_has_one_finding():
    subject = Subject(Actor(bound_elsewhere()))
    assert [found.diagnostic.key for found in bindings.check(subject)] == ["B007.places"]


def test_joint_without_weights_beside_another_limb_is_a_helper():
    """A hand without weights moves with the arm."""
    assert linted(taken(("left_wrist",), "left_elbow"), (stray_weights,)) == []


def test_hands_of_crossed_arms_have_the_right_names():
    across = [("wrist", [-0.8, 0.0, 0.3]), ("hand", [-0.8, 0.0, 0.3])]
    moves = [
        (f"{side}_{name}", [sign * x, y, z])
        for side, sign in (("left", 1.0), ("right", -1.0))
        for name, (x, y, z) in across
    ]
    assert linted(moved(*moves), (symmetry,)) == []


@pytest.mark.parametrize(("copies", "severity"), [(0, "warning"), (4000, "note")])
def test_small_weights_are_seen_on_a_thousandth_of_the_vertices(copies, severity):
    """Ten of 7,813 vertices of the head have 0.02 of a foot; copies of one are without it."""
    weights = table().copy()
    head = np.flatnonzero(weights[:, joint("head")] > 0.99)
    weights[head[:10]] *= 0.98
    weights[head[:10], joint("right_foot")] += 0.02
    rows = np.concatenate([np.arange(len(weights)), np.full(copies, head[20])])
    mesh = body().mesh
    mesh = replace(mesh, positions=mesh.positions[rows], normals=mesh.normals[rows])
    vertices, joints = np.nonzero(weights[rows])
    values, binds = weights[rows][vertices, joints], body().skin.inverse_bind
    skin = skin_from_entries(len(rows), vertices, joints, values, binds)
    figure = Figure("dense", mesh=mesh, skeleton=body().skeleton, skin=skin, up=body().up)
    (found,) = stray_weights.check(Subject(Actor(figure), up=figure.up))
    assert (found.code, found.severity, len(found.vertices)) == ("W011", severity, 10)


def test_large_head_is_no_leak():
    assert linted(leak_everywhere(0.0), (stray_weights,)) == []


@pytest.mark.parametrize(("scale", "up"), [(0.01, "z")])
def test_body_has_no_finding_in_other_axes(scale, up):
    figure = placed(body(), scale, up)
    assert linted(figure) == []
    again = linted(placed(stray(0.3)(), scale, up), (stray_weights,))
    assert [one.diagnostic.key for one in again] == ["W011.strays"]


def test_joints_below_one_without_valid_data_are_not_compared():
    """All joints of the arm are bound with 60 degrees, whose rotation at rest is invalid."""
    figure, shoulder = body(), joint("left_shoulder")
    turn = np.eye(4)
    turn[:3, :3] = axis_rotations(2, np.radians(-60.0))
    about = translation_matrix(rest_joints(figure)[shoulder])
    arm = descendants(figure.skeleton.parents, shoulder)
    binds = figure.skin.inverse_bind.copy()
    binds[arm] = binds[arm] @ about @ turn @ np.linalg.inv(about)
    actor = Actor(replace(figure, skin=replace(figure.skin, inverse_bind=binds)))
    (found,) = [one for one in bindings.check(Subject(actor)) if one.code == "B007"]
    assert sorted(found.joints) == np.flatnonzero(arm).tolist()
    assert [*bindings.check(Subject(actor, invalid={"joints": np.array([shoulder])}))] == []


def cut_off(vertex: int) -> tuple[Figure, np.ndarray]:
    """Return the body with a patch around a vertex cut off, and the vertices of the patch."""
    mesh = body().mesh
    away = np.linalg.norm(mesh.positions - mesh.positions[vertex], axis=1)
    inside = np.isin(mesh.triangles, np.flatnonzero(away < 0.03))
    kept = mesh.triangles[inside.all(axis=1) | ~inside.any(axis=1)]
    figure = replace(body(), mesh=Mesh(mesh.positions, mesh.normals, kept))
    return figure, np.unique(mesh.triangles[inside.all(axis=1)])


def test_part_that_moves_with_a_distant_joint_is_found():
    """A patch of the head, cut off, moves with a wrist, or with the head."""
    cut, island = cut_off(NOSE)
    for name, expected in (("head", []), ("left_wrist", ["W012.islands"])):
        weights = table().copy()
        weights[island] = np.arange(weights.shape[1]) == joint(name)
        found = linted(weighted(weights, cut), (stray_weights,))
        assert [one.diagnostic.key for one in found] == expected
        assert all(sorted(one.vertices.tolist()) == island.tolist() for one in found)


def test_part_is_not_distant_from_the_only_joint_that_moves_vertices():
    """A mesh below a node moves with it, whatever its parts are; here one is 2 m above the rest."""
    cut, island = cut_off(NOSE)
    positions = cut.mesh.positions.copy()
    positions[island] += [0.0, 2.0, 0.0]
    moved = replace(cut, mesh=replace(cut.mesh, positions=positions))
    alone = np.tile(1.0 * (np.arange(table().shape[1]) == joint("pelvis")), (len(positions), 1))
    found = linted(weighted(alone, moved), (stray_weights,))
    assert "W012.islands" not in {one.diagnostic.key for one in found}


def test_figure_on_its_head_is_upside_down():
    """With y and z reversed, the head, 1.35 m above the ankles, is below them."""
    figure, turn = body(), np.diag([1.0, -1.0, -1.0, 1.0])
    skeleton, mesh = figure.skeleton, figure.mesh
    offsets, rotations = skeleton.rest_translations.copy(), skeleton.rest_rotations.copy()
    offsets[0] = turn[:3, :3] @ offsets[0]
    rotations[0] = 1.0, 0.0, 0.0, 0.0
    figure = Figure(
        figure.name,
        Mesh(mesh.positions @ turn[:3, :3], mesh.normals @ turn[:3, :3], mesh.triangles),
        replace(skeleton, rest_translations=offsets, rest_rotations=rotations),
        replace(figure.skin, inverse_bind=figure.skin.inverse_bind @ turn),
        unit="m",
    )
    (found,) = linted(figure, (bindings, joint_places, spikes))
    assert found.code == "S013" and "the head is 1.3" in found.message


@pytest.mark.parametrize(("flip", "expected"), [(1.0, []), (-1.0, ["S013.motion"])])
def test_skeleton_that_moves_on_its_head_is_upside_down(flip, expected):
    """The head is 0.7 above two feet, or below them, in all but one of 20 frames."""
    names = ("hips", "head", "left_foot", "right_foot")
    offsets = np.array([[0.0, 1, 0], [0, 0.5, 0], [0.1, -0.2, 0], [-0.1, -0.2, 0]])
    figure = Figure("x", skeleton=make_skeleton(names, [-1, 0, 0, 0], offsets), unit="m")
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (20, 4, 1))
    turns[1:, 0] = [1.0, 0.0, 0.0, 0.0] if flip < 0.0 else [0.0, 0.0, 0.0, 1.0]
    clip = SampledClip("x", Timing(30.0, np.arange(20)), turns, np.zeros((20, 4, 3)))
    found = [*joint_places.check(Subject(Actor(figure, clip=clip)))]
    assert [one.diagnostic.key for one in found] == expected
    assert all("0.7 m" in one.message or "700 mm" in one.message for one in found)


def tube(weight: Callable[[np.ndarray], np.ndarray]) -> Figure:
    """Return a tube of radius 0.1 along x with a wrist at 0.

    ``weight``: (N,) at x, -1 to 1. It is that of the wrist; from 1 to 2, the hand takes over.
    """
    x, angle = np.meshgrid(np.linspace(-1.0, 1.0, 41), np.arange(12) * np.pi / 6, indexing="ij")
    points = np.stack([x, 0.1 * np.cos(angle), 0.1 * np.sin(angle)], axis=-1).reshape(-1, 3)
    ring, step = np.divmod(np.arange(40 * 12), 12)
    a, b = ring * 12 + step, ring * 12 + (step + 1) % 12
    faces = np.concatenate([np.stack([a, b, a + 12], 1), np.stack([b, b + 12, a + 12], 1)])
    names = ("left_shoulder", "left_elbow", "left_wrist", "left_hand")
    places = np.array([[-2.0, 0, 0], [-1.0, 0, 0], [0.0, 0, 0], [1.0, 0, 0]])
    binds = np.tile(np.eye(4), (4, 1, 1))
    binds[:, :3, 3] = -places
    weights = weight(points[:, 0])
    rows = [
        [(1, 1.0 - w), (2, w)] if w <= 1.0 else [(2, 2.0 - w), (3, w - 1.0)]
        for w in weights.tolist()
    ]
    skeleton = make_skeleton(names, [-1, 0, 1, 2], np.diff(places, axis=0, prepend=0.0))
    return Figure("tube", make_mesh(points, faces), skeleton, skin_from_lists(rows, binds))


def test_twist_loses_half_of_what_moves_with_equal_weights():
    """An even change loses a third, 2 w (1 - w) in the mean over w; equal weights lose half."""
    even = tube(lambda x: np.clip(0.5 + 0.5 * x, 0.0, 1.0))
    assert linted(even, (volumes,)) == []
    equal = tube(lambda x: np.where(np.abs(x) < 0.9, 0.5, np.where(x < 0.0, 0.0, 1.0)))
    (found,) = linted(equal, (volumes,))
    assert found.code == "W017" and found.joints.tolist() == [2]
    assert "left_wrist 50 %" in found.message


def test_equal_weights_along_most_of_a_limb_are_found_where_they_lose_less():
    """Equal weights at |x| < 0.55: (1.1 * 50 + 0.9 * 33) / 2, 42 % of the volume are lost."""
    x = np.array([-1.0, -0.55, -0.549, 0.549, 0.55, 1.0])
    w = np.array([0.0, 0.5, 0.5, 0.5, 0.5, 1.0])
    figure = tube(lambda at: np.interp(at, x, w))
    skeleton = replace(figure.skeleton, names=("bone_1", "bone_2", "bone_3", "bone_4"))
    for one in (figure, replace(figure, skeleton=skeleton)):
        (found,) = linted(one, (volumes,))
        assert found.diagnostic.key == "W017.equal" and found.joints.tolist() == [2]
    # Rings are 0.05 apart: from -0.55 to 0.55, 23 of 12 vertices.
    assert len(found.vertices) == 23 * 12


def test_joints_with_a_single_ring_each_blend_evenly():
    """A limb of few vertices: half of the weight at the ring of a joint, all or none beside it."""
    blend = tube(lambda x: np.select([x < -0.01, x < 0.01, x < 0.06], [0.0, 0.5, 1.5], 2.0))
    assert linted(blend, (volumes,)) == []


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize(("flip", "expected"), [(1.0, []), (-1.0, ["S013"])])
def test_animal_on_its_back_is_upside_down(flip, expected, up):
    names = ("body", "head", "fore_foot_l", "fore_foot_r")
    joints = np.array([[0.0, 1, 0], [0.0, 1.2, 1], [0.3, 0, 0.5], [-0.3, 0, 0.5]])
    joints *= [1.0, flip, 1.0]
    if up == "z":
        joints = joints @ [[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]
    binds = np.tile(np.eye(4), (4, 1, 1))
    binds[:, :3, 3] = -joints
    skeleton = make_skeleton(names, [-1, 0, 0, 0], joints - [[0, 0, 0], *[joints[0]] * 3])
    mesh = make_mesh(joints, [[0, 1, 2], [0, 2, 3]])
    skin = skin_from_lists([[(k, 1.0)] for k in range(4)], binds)
    found = linted(Figure("cat", mesh, skeleton, skin, up=up, unit="m"), (joint_places,))
    assert [one.code for one in found] == expected
    assert all(one.message.endswith(f"along {up}") for one in found)


def apart(figure: Figure, vertices: np.ndarray) -> tuple[Figure, np.ndarray]:
    """Return a figure whose triangles around some vertices use copies of them, and the copies."""
    mesh, count = figure.mesh, figure.mesh.n_vertices
    copies = count + np.arange(len(vertices))
    triangles = mesh.triangles.copy()
    number = np.arange(count)
    number[vertices] = copies
    above = mesh.positions[triangles].mean(axis=1)[:, 1] > mesh.positions[vertices, 1].mean()
    triangles[above] = number[triangles[above]]
    every = np.concatenate([np.arange(count), vertices])
    split = Mesh(mesh.positions[every], mesh.normals[every], triangles)
    skin = skin_rows(figure.skin, every)
    return Figure(figure.name, split, figure.skeleton, skin), copies


def torn_seam() -> tuple[Figure, Figure, np.ndarray]:
    """Return a body with a seam, the same with other weights on one side, and their vertices.

    The triangles above a height have vertices of their own.
    """
    ring = np.flatnonzero(np.abs(body().mesh.positions[:, 1] - 0.2) < 0.1)
    split, copies = apart(body(), ring)
    weights = np.concatenate([table(), table()[ring]])
    torn = copies[np.isin(copies, split.mesh.triangles)][::9]
    weights[torn] = 0.7 * weights[torn]
    weights[torn, joint("pelvis")] += 0.3
    return split, weighted(weights, split), torn[weights[torn, joint("pelvis")] < 1.0]


def test_seam_with_other_weights_on_one_side_is_torn():
    split, torn, changed = torn_seam()
    assert linted(split, (blending,)) == []
    (one,) = (one for one in linted(torn) if one.code == "W014")
    assert set(one.vertices.tolist()) <= set(changed.tolist()) and len(one.vertices)


@pytest.mark.parametrize(("frames", "expected"), [(0, []), (10, [*range(20, 30)])])
def test_wrist_in_the_chest_is_found(frames, expected):
    """The wrist is at the joint of the chest, or 25 cm in front of it, outside of the skin."""
    figure = body()
    rest = rest_joints(figure)
    chest, wrist = joint("spine3"), joint("left_wrist")
    held = rest[chest] + [0.0, 0.0, 0.25] - rest[joint("left_elbow")]
    keys = np.tile(held, (60, 1))
    keys[20 : 20 + frames] -= [0.0, 0.0, 0.25]
    channel = TransformChannel(wrist, "translation", np.arange(60) / 30.0, keys)
    actor = Actor(figure, clip=TransformClip("x", (channel,), 0.0, 59 / 30.0))
    found = [*hands.check(Subject(actor))]
    assert [one.joints.tolist() for one in found] == ([[wrist]] if frames else [])
    numbers = [number for one in found for number in one.frames.tolist()]
    # Between the samples before and after, the wrist passes the skin.
    assert set(expected) <= set(numbers) <= {19, *expected, 30}
    again = [*hands.check(Subject(actor, invalid={"normals": np.arange(3)}))]
    assert [one.message for one in again] == [one.message for one in found]
