"""One fault each, planted in a sound figure or motion: its code and its place are found."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from lint.sound import (
    FRAMES,
    RATE,
    column,
    keypoints,
    legs,
    make_mesh,
    make_skeleton,
    scene_of,
    standing,
)

from viewer.lint import CODES, Finding, lint_scene
from viewer.rig.figure import Figure
from viewer.rig.mesh import Mesh
from viewer.rig.motion.clip import Channel, Clip
from viewer.rig.motion.timing import Timing
from viewer.rig.pose import rest_pose
from viewer.rig.scene import Scene
from viewer.rig.skin import Skin, skin_from_lists


def lists(skin: Skin) -> list[list[tuple[int, float]]]:
    """Return the influences of each vertex."""
    pairs = list(zip(skin.joints.tolist(), skin.weights.tolist(), strict=True))
    return [pairs[a:b] for a, b in zip(skin.starts[:-1], skin.starts[1:], strict=True)]


def weighted(rows: dict[int, list[tuple[int, float]]], figure: Figure | None = None) -> Figure:
    """Return the column with other influences of some vertices."""
    figure = figure or column()
    every = lists(figure.skin)
    for vertex, row in rows.items():
        every[vertex] = row
    return replace(figure, skin=skin_from_lists(every, figure.skin.inverse_bind))


def bound(joint: int, matrix: np.ndarray) -> Figure:
    """Return the column with another inverse bind matrix."""
    figure = column()
    matrices = figure.skin.inverse_bind.copy()
    matrices[joint] = matrix
    return replace(figure, skin=replace(figure.skin, inverse_bind=matrices))


def meshed(triangles: Callable[[np.ndarray], np.ndarray]) -> Figure:
    """Return the column with other triangles and the same normals."""
    figure = column()
    changed = triangles(figure.mesh.triangles.copy())
    mesh = replace(figure.mesh, triangles=changed, triangle_materials=None)
    return replace(figure, mesh=mesh)


def moved(vertex: int, by: tuple[float, float, float]) -> Figure:
    """Return the column with one vertex elsewhere."""
    figure = column()
    positions = figure.mesh.positions.copy()
    positions[vertex] += by
    return replace(figure, mesh=replace(figure.mesh, positions=positions))


def with_normal(vertex: int, normal: tuple[float, float, float]) -> Figure:
    figure = column()
    normals = figure.mesh.normals.copy()
    normals[vertex] = normal
    return replace(figure, mesh=replace(figure.mesh, normals=normals))


def with_island(weights: list[tuple[int, float]]) -> Figure:
    """Return the column and a tetrahedron beside it, vertices 20 to 23."""
    figure = column()
    far = np.array([[5.0, 0, 0], [6, 0, 0], [5, 1, 0], [5, 0, 1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]) + 20
    mesh = make_mesh(
        np.vstack([figure.mesh.positions, far]), np.vstack([figure.mesh.triangles, faces])
    )
    skin = skin_from_lists([*lists(figure.skin), *[weights] * 4], figure.skin.inverse_bind)
    return Figure("column", mesh, figure.skeleton, skin, unit="m")


def skeleton_with(**changes) -> Figure:
    figure = column()
    return replace(figure, skeleton=replace(figure.skeleton, **changes))


def posed_outside() -> Scene:
    figure = column()
    pose = rest_pose(figure.skeleton)
    pose.dofs[7] = 4.0  # knee.y, which ends at 3
    return scene_of(figure, pose=pose)


def three_on_an_edge(triangles: np.ndarray) -> np.ndarray:
    return np.vstack([triangles, [[0, 1, 16]]])


def turned(*indices: int) -> Callable[[np.ndarray], np.ndarray]:
    def turn(triangles: np.ndarray) -> np.ndarray:
        triangles[list(indices)] = triangles[list(indices)][:, ::-1]
        return triangles

    return turn


def moebius() -> Figure:
    """Return a band of 12 quads with half a turn in it."""
    count = 12
    angles = np.arange(count) * 2 * np.pi / count
    across = np.stack(
        [
            np.cos(angles / 2) * np.cos(angles),
            np.cos(angles / 2) * np.sin(angles),
            np.sin(angles / 2),
        ],
        axis=1,
    )
    middle = 3 * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    points = np.concatenate([middle + across, middle - across])
    faces = []
    for k in range(count):
        a, b = k, k + count
        c, d = (k + 1, k + 1 + count) if k + 1 < count else (count, 0)
        faces += [[a, c, b], [b, c, d]]
    return Figure("band", make_mesh(points, faces))


def keyed(channels: dict[int, tuple[list[float], list[float]]], end: float = 1.0) -> Scene:
    """Return the column with a clip of keys; the other channels stay at 0."""
    figure = column()
    made = []
    for target in range(figure.skeleton.n_dofs):
        times, values = channels.get(target, ([0.0], [0.0]))
        made.append(Channel(target, times, values, (("linear", "linear"),) * len(times)))
    return scene_of(figure, Clip("keys", tuple(made), 0.0, end))


def moving(change: Callable[[np.ndarray, np.ndarray], None], timing: Timing | None = None) -> Scene:
    """Return standing legs whose root's translations (F, 3) and rotations (F, J, 4) are changed."""
    figure = legs()
    clip = standing(figure)
    translations, rotations = clip.translations.copy(), clip.rotations.copy()
    change(translations[:, 0], rotations)
    clip = replace(clip, translations=translations, rotations=rotations)
    return scene_of(figure, clip if timing is None else replace(clip, timing=timing))


def one_jump(root: np.ndarray, _: np.ndarray) -> None:
    root[20] = 3.0, 0.0, 0.0


def one_turn(_: np.ndarray, rotations: np.ndarray) -> None:
    rotations[20, 2] = 1.0, 0.0, 0.0, 0.0  # by half a turn about x, at the left knee


def slide(root: np.ndarray, _: np.ndarray) -> None:
    root[:, 2] = 0.5 * np.arange(FRAMES) / RATE


def sink(root: np.ndarray, _: np.ndarray) -> None:
    root[40:, 1] = -0.2


def float_about(root: np.ndarray, _: np.ndarray) -> None:
    root[:, 1] = 2.0 + 0.3 * np.sin(2.0 * np.pi * np.arange(FRAMES) / 20)


def gaps() -> Timing:
    rows = np.arange(FRAMES)
    rows[10:13] = rows[30] = -1
    return Timing(RATE, rows, first_frame=100)


def captured(change: Callable[[np.ndarray], None]) -> Scene:
    figure, clip = keypoints()
    points = clip.points.copy()
    change(points)
    return scene_of(figure, replace(clip, points=points))


def low_confidence(points: np.ndarray) -> None:
    points[10:30, 2, 3] = 0.1


def unseen(points: np.ndarray) -> None:
    points[:, 1, 3] = 0.0


def point_jump(points: np.ndarray) -> None:
    points[20, 0, 0] += 2.0


def five_joints() -> Figure:
    """Return the column on five joints in a row, vertex 8 with influences of all of them."""
    figure = column()
    names = ("a", "b", "c", "d", "e")
    skeleton = make_skeleton(names, [-1, 0, 1, 2, 3], [[0, 0, 0]] + [[0, 1, 0]] * 4)
    matrices = np.tile(np.eye(4), (5, 1, 1))
    matrices[:, 1, 3] = -np.arange(5.0)
    rows = [[(v // 4, 1.0)] for v in range(20)]
    rows[8] = [(0, 0.3), (1, 0.3), (2, 0.2), (3, 0.15), (4, 0.05)]
    return Figure("column", figure.mesh, skeleton, skin_from_lists(rows, matrices), unit="m")


def nine_joints() -> Figure:
    figure = column()
    names = tuple("abcdefghi")
    skeleton = make_skeleton(names, [-1, *[0] * 8], [[0, 0, 0]] * 9)
    rows = [[(v % 9, 1.0)] for v in range(20)]
    rows[3] = [(joint, 1 / 9) for joint in range(9)]
    skin = skin_from_lists(rows, np.tile(np.eye(4), (9, 1, 1)))
    return Figure("column", figure.mesh, skeleton, skin, unit="m")


def rooted() -> Figure:
    return skeleton_with(parents=[-1, -1], rest_translations=[[0, 0, 0], [0, 2, 0]])


def locked() -> Figure:
    limits = column().skeleton.dof_limits.copy()
    limits[8] = 0.0
    return skeleton_with(dof_limits=limits)


def with_unused() -> Figure:
    figure = column()
    mesh = figure.mesh
    mesh = replace(
        mesh,
        positions=np.vstack([mesh.positions, [[0, 1, 0]]]),
        normals=np.vstack([mesh.normals, [[0, 1, 0]]]),
    )
    skin = skin_from_lists([*lists(figure.skin), [(0, 1.0)]], figure.skin.inverse_bind)
    return replace(figure, mesh=mesh, skin=skin, symmetry=np.append(figure.symmetry, 20))


def inside_out() -> Figure:
    figure = column()
    mesh = make_mesh(figure.mesh.positions, figure.mesh.triangles[:, ::-1])
    return replace(figure, mesh=mesh)


def against() -> Figure:
    figure = column()
    return replace(figure, mesh=replace(figure.mesh, normals=-figure.mesh.normals))


def singular() -> np.ndarray:
    return np.diag([1.0, 0.0, 1.0, 1.0])


def not_affine() -> np.ndarray:
    matrix = np.eye(4)
    matrix[1, 3], matrix[3, 0] = -2.0, 0.5
    return matrix


def scaled(*factors: float) -> np.ndarray:
    """Return a bind matrix of joint 1 that also scales."""
    matrix = np.diag([*factors, 1.0])
    matrix[:3, 3] = matrix[:3, :3] @ [0.0, -2.0, 0.0]
    return matrix


# name: (maker, code, where, what is expected there, first)
FAULTS: dict[str, tuple[Callable[[], Figure | Scene], str, str, list[int]]] = {
    "sum too small": (lambda: weighted({5: [(0, 0.9)]}), "W001", "vertices", [5]),
    "sum too large": (
        lambda: weighted({9: [(0, 0.5), (1, 0.6)], 2: [(0, 1.05)]}), "W001", "vertices", [9, 2]
    ),
    "negative": (lambda: weighted({7: [(0, 1.25), (1, -0.25)]}), "W002", "vertices", [7]),
    "no influence": (lambda: weighted({11: []}), "W004", "vertices", [11]),
    "weights of 0": (lambda: weighted({11: [(0, 0.0), (1, 0.0)]}), "W004", "vertices", [11]),
    "bare island": (lambda: with_island([]), "W005", "vertices", [20, 21, 22, 23]),
    "idle joint": (
        lambda: weighted({v: [(0, 1.0)] for v in range(20)}), "W006", "joints", [1]
    ),
    "five influences": (five_joints, "W007", "vertices", [8]),
    "nine influences": (nine_joints, "W008", "vertices", [3]),
    "joint twice": (lambda: weighted({4: [(0, 0.5), (0, 0.5)]}), "W009", "vertices", [4]),
    "singular": (lambda: bound(1, singular()), "B002", "joints", [1]),
    "hardly invertible": (lambda: bound(1, scaled(1.0, 1e-7, 1.0)), "B003", "joints", [1]),
    "bound elsewhere": (
        lambda: replace(column(), skeleton=make_skeleton(("foot", "knee"), [-1, 0],
                                                         [[0, 0, 0], [0, 3, 0]])),
        "B004", "joints", [1],
    ),
    "mirroring": (lambda: bound(1, scaled(-1.0, 1.0, 1.0)), "B005", "joints", [1]),
    "not affine": (lambda: bound(1, not_affine()), "B006", "joints", [1]),
    "pose outside limits": (posed_outside, "S004", "joints", [1]),
    "locked": (locked, "S005", "joints", [1]),
    "same names": (lambda: skeleton_with(names=("foot", "foot")), "S006", "joints", [0, 1]),
    "no name": (lambda: skeleton_with(names=("foot", "")), "S007", "joints", [1]),
    "two roots": (rooted, "S008", "joints", [0, 1]),
    "long quaternion": (
        lambda: skeleton_with(rest_rotations=[[0, 0, 0, 1], [0, 0, 0, 2]]), "S009", "joints", [1]
    ),
    "no scale": (lambda: skeleton_with(rest_scales=[[1, 1, 1], [1, 0, 1]]), "S010", "joints", [1]),
    "flat triangle": (
        lambda: meshed(lambda t: np.vstack([t, [[4, 4, 5]]])), "M001", "triangles", [36]
    ),
    "sliver": (lambda: meshed(lambda t: np.vstack([t, [[0, 4, 8]]])), "M001", "triangles", [36]),
    "flipped": (lambda: meshed(turned(6)), "M002", "triangles", [6]),
    "two flipped": (lambda: meshed(turned(3, 17)), "M002", "triangles", [3, 17]),
    "inside out": (inside_out, "M003", "triangles", list(range(36))),
    "unused": (with_unused, "M004", "vertices", [20]),
    "hole": (lambda: meshed(lambda t: t[1:]), "M005", "vertices", [0, 1, 4]),
    "three on an edge": (lambda: meshed(three_on_an_edge), "M006", "vertices", [0, 1]),
    "one normal inwards": (
        lambda: with_normal(3, tuple(-column().mesh.normals[3])), "M009", "vertices", [3]
    ),
    "zero normal": (lambda: with_normal(3, (0, 0, 0)), "M007", "vertices", [3]),
    "long normal": (lambda: with_normal(3, (0.8, -0.9, -0.8)), "M008", "vertices", [3]),
    "normals inwards": (against, "M009", "vertices", list(range(20))),
    "stray vertex": (lambda: moved(6, (1e8, 0, 0)), "M010", "vertices", [6]),
    "vertex a hundred sizes away": (lambda: moved(6, (100, 0, 0)), "M010", "vertices", [6]),
    "triangle twice": (
        lambda: meshed(lambda t: np.vstack([t, t[4:5, [1, 2, 0]]])), "M011", "triangles", [36]
    ),
    "one side": (moebius, "M012", "triangles", list(range(24))),
    "askew": (lambda: moved(12, (0.5, 0, 0)), "Y001", "vertices", [12, 13]),
    "uneven weights": (
        lambda: weighted({4: [(0, 0.6), (1, 0.4)]}), "Y002", "vertices", [4, 5]
    ),
    "two keys at one time": (
        lambda: keyed({4: ([0.0, 0.5, 0.5], [0.0, 0.1, 0.2])}), "C002", "times", [0.5]
    ),
    "jump": (lambda: moving(one_jump), "C003", "frames", [120, 121]),
    "fast turn": (lambda: moving(one_turn), "C004", "frames", [120, 121]),
    "gaps": (
        lambda: moving(lambda root, turns: None, gaps()), "C005", "frames", [110, 111, 112, 130]
    ),
    "keys outside limits": (
        lambda: keyed({7: ([0.0, 1.0], [0.0, 3.5])}), "C006", "joints", [1]
    ),
    "sliding": (lambda: moving(slide), "C007", "joints", [3]),
    "sinking": (lambda: moving(sink), "C008", "frames", list(range(140, 160))),
    "no ground": (lambda: moving(float_about), "C013", "frames", []),
    "no duration": (lambda: keyed({}, end=0.0), "C010", "frames", []),
    "low confidence": (lambda: captured(low_confidence), "C011", "joints", [2]),
    "never seen": (lambda: captured(unseen), "C012", "joints", [1]),
    "jumping point": (lambda: captured(point_jump), "C003", "frames", [120, 121]),
}  # fmt: skip


def made(maker: Callable[[], Figure | Scene]) -> Scene:
    found = maker()
    return found if isinstance(found, Scene) else scene_of(found)


def findings_of(maker: Callable[[], Figure | Scene]) -> list[Finding]:
    return lint_scene(made(maker))


@pytest.mark.parametrize("name", FAULTS)
def test_a_planted_fault_is_found_where_it_is(name: str) -> None:
    maker, code, where, expected = FAULTS[name]
    found = [finding for finding in findings_of(maker) if finding.code == code]
    assert len(found) == 1, name
    assert sorted(getattr(found[0], where).tolist()) == pytest.approx(sorted(expected))
    assert found[0].severity == CODES[code].severity
    assert found[0].actor == 0 and found[0].message and found[0].hint


# What else a planted fault truly brings with it.
COMPANIONS = {
    "sum too large": {"Y002"},
    "negative": {"Y002"},
    "no influence": {"Y002"},
    "weights of 0": {"Y002"},
    "flat triangle": {"M006"},  # the edge from 4 to 5 is listed once more
    "sliver": {"M006"},
    "three on an edge": {"M005"},
    "triangle twice": {"M006"},
    "stray vertex": {"Y001", "M001"},  # triangles to it are slivers
    "vertex a hundred sizes away": {"Y001", "M003"},  # it pulls the volume inside out
    "fast turn": {"C003"},  # the ankle goes where the knee turns it
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_planted_fault_brings_nothing_else_of_weight(name: str) -> None:
    """Errors and warnings are the fault's own, or follow from it as listed."""
    maker, code, _, _ = FAULTS[name]
    heavy = {finding.code for finding in findings_of(maker) if finding.severity != "note"}
    assert heavy - {code} <= COMPANIONS.get(name, set()), name


def test_there_are_more_than_40_planted_faults() -> None:
    assert len(FAULTS) >= 40


@pytest.mark.parametrize(
    "maker",
    [column, lambda: moving(lambda root, turns: None), lambda: captured(lambda points: None),
     lambda: keyed({7: ([0.0, 1.0], [0.0, 2.0])})],
    ids=["column", "legs", "points", "keys"],
)  # fmt: skip
def test_what_faults_are_planted_in_is_sound(maker) -> None:
    assert findings_of(maker) == []


def test_numbers_of_the_messages() -> None:
    messages = {name: findings_of(FAULTS[name][0]) for name in ("sum too large", "jump", "sliding")}
    texts = {f.code: f.message for found in messages.values() for f in found}
    assert texts["W001"] == (
        "weights of 2 vertices do not sum to 1 (worst: 1.1 at vertex 9, an error of 0.1)"
    )
    # 3 m in 1/30 s; the legs are 0.2 m wide and 0.9 m high, and may move at 15 times 0.922 m.
    assert texts["C003"] == (
        "2 of 60 frames: pelvis moves at 90 m/s (limit 13.8 m/s) at frame 120, 0.667 s"
    )
    # All of the 59 steps of 0.5 / 30 m.
    assert "left_ankle slides by 983 mm in total, at up to 0.5 m/s (frame " in texts["C007"]


def test_numbers_of_meshes_and_gaps() -> None:
    """Both ends of an edge, the first vertex of a normal, and which frames are missing."""
    names = ("three on an edge", "hole", "one normal inwards", "gaps", "pose outside limits")
    texts = {f.code: f.message for name in names for f in findings_of(FAULTS[name][0])}
    assert texts["M006"] == (
        "1 non-manifold edge with up to 3 triangles (first: between vertices 0 and 1)"
    )
    assert texts["M005"].startswith("3 boundary edges (first: between vertices 0")
    assert texts["M009"] == (
        "1 of 20 normals opposes the winding of all adjacent triangles (first: vertex 3)"
    )
    assert texts["C005"] == "4 of 60 frames are missing in 2 gaps: frames 110 to 112, frame 130"
    # 4 and 3 radians.
    assert texts["S004"] == (
        "1 DOF of the pose is outside its limits: knee.y is 229.2°, its limits are -171.9° and "
        "171.9°"
    )


@pytest.mark.parametrize("name", FAULTS)
def test_one_is_singular(name: str) -> None:
    """No count of 1 has a plural behind it, nor "are" or "have"."""
    for finding in findings_of(FAULTS[name][0]):
        text = re.sub(r"[\d.]+ of ", "", finding.message)  # the whole decides: 1 of 60 frames
        of_one = re.findall(r"(?<![\d.:])1 ((?!units\b)[a-zA-Z]+s)\b(?! to | at )", text)
        assert set(of_one) <= {"has", "is"}, finding.message
        one = re.match(r"1 (?:of \d+ )?[\w ]*?\b(are|have|lie|move|list|point|belong)\b", text)
        assert one is None, finding.message


def test_a_gap_is_looked_at_just_before_it() -> None:
    (gap,) = findings_of(FAULTS["gaps"][0])
    # Frame 109 is the tenth, 9 / 30 s after the first.
    assert gap.seek == pytest.approx(0.3)


def test_who_is_not_there_for_long_is_counted_so() -> None:
    """Person 1 is there in frames 100 to 119, 2 of them missing."""
    rows = np.arange(FRAMES)
    rows[20:] = rows[5] = rows[6] = -1
    timing = Timing(RATE, rows, first_frame=100, holds=False)
    (gap,) = lint_scene(moving(lambda root, turns: None, timing))
    assert gap.message == "2 of 20 frames are missing in 1 gap: frames 105 to 106"


def test_thin_sheets_and_creases_have_no_normals_against_them() -> None:
    """Each side of a sheet has its own; a sheet whose sides share vertices agrees with one."""
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    front = np.array([[0, 1, 2], [0, 2, 3]])
    sides = Mesh(
        np.vstack([square, square]),
        np.repeat([[0.0, 0, 1], [0, 0, -1]], 4, axis=0),
        np.vstack([front, front[:, ::-1] + 4]).astype(np.int32),
    )
    shared = Mesh(
        square, np.tile([0.0, 0, 1], (4, 1)), np.vstack([front, front[:, ::-1]]).astype(np.int32)
    )
    for mesh in (sides, shared):
        assert "M009" not in {f.code for f in lint_scene(scene_of(Figure("sheet", mesh)))}
    turned = replace(sides, normals=-sides.normals)
    found = [f for f in lint_scene(scene_of(Figure("sheet", turned))) if f.code == "M009"]
    assert found[0].vertices.tolist() == list(range(8))


def test_the_cost_of_a_cut_is_how_far_it_moves_the_mesh() -> None:
    """All joints but the root stay; e is moved by a translation of its own: 0.05 of it is lost."""
    figure = five_joints()
    scene = scene_of(figure)
    scene.actors[0].pose.translations[1:, 0] = 0.0
    scene.actors[0].pose.translations[4, 0] = 2.0
    locked = replace(figure.skeleton, dof_limits=np.zeros_like(figure.skeleton.dof_limits))
    scene.actors[0].figure = replace(figure, skeleton=locked)
    (found,) = [finding for finding in lint_scene(scene) if finding.code == "W007"]
    # The whole: 0.05 of 2 m. The cut keeps nothing of e: 100 mm in the present pose, 0 at rest.
    assert found.message == (
        "1 vertex has more than 4 influences (maximum: 5); pruning to 4 moves the mesh "
        "by up to 100 mm (vertex 8), 100 mm on average over these vertices, in 6 poses"
    )


def test_a_foot_that_swings_does_not_slide() -> None:
    def step(root: np.ndarray, _: np.ndarray) -> None:
        root[:, 2] = 2.5 * np.arange(FRAMES) / RATE  # 2.5 m/s, as a foot passes the ground

    assert [finding.code for finding in lint_scene(moving(step))] == []


def test_a_person_who_comes_later_has_no_gap() -> None:
    rows = np.arange(FRAMES)
    rows[:20] = rows[50:] = -1
    timing = Timing(RATE, rows, first_frame=100, holds=False)
    assert lint_scene(moving(lambda root, turns: None, timing)) == []


def test_seams_are_no_borders() -> None:
    """Vertices at one place count as one: a closed mesh with a seam is closed."""
    figure = column()
    positions = np.vstack([figure.mesh.positions, figure.mesh.positions[0::4]])
    triangles = figure.mesh.triangles.copy()
    side = np.isin(triangles, np.arange(0, 20, 4)) & (np.arange(36) % 8 < 2)[:, None]
    triangles[side] = 20 + triangles[side] // 4
    mesh = make_mesh(positions, triangles)
    codes = {finding.code for finding in lint_scene(scene_of(Figure("seam", mesh)))}
    assert codes == set()


def test_rare_keypoints_of_low_confidence_are_told_by_how_often_they_are_seen() -> None:
    """Low in 3 of the 10 frames that see it; in 3 of 60, which is 5 %; and once of 2."""

    def change(points: np.ndarray) -> None:
        points[10:, 0, 3] = 0.0
        points[4:7, 0, 3] = 0.2
        points[20:23, 1, 3] = 0.1
        points[2:, 2, 3] = 0.0
        points[1, 2, 3] = 0.1

    (low,) = lint_scene(captured(change))
    assert low.message == (
        "hip has a confidence below 0.3 in 30 % of the 10 frames in which it is "
        "visible (first: frame 104)"
    )
    assert low.frames.tolist() == [104, 105, 106] and low.joints.tolist() == [0]
