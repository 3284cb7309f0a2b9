"""Figures and motions with one planted error each."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from linting.sound import (
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

from viewer.linting import Finding, lint_scene
from viewer.rigs.figure import Figure
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.pose import rest_pose
from viewer.rigs.scene import Scene
from viewer.rigs.skin import Skin, skin_from_lists


def lists(skin: Skin) -> list[list[tuple[int, float]]]:
    """Return the influences of each vertex."""
    pairs = list(zip(skin.joints.tolist(), skin.weights.tolist(), strict=True))
    return [pairs[a:b] for a, b in zip(skin.starts[:-1], skin.starts[1:], strict=True)]


def weighted(rows: dict[int, list[tuple[int, float]]], figure: Figure | None = None) -> Figure:
    """Return the column with changed influences of some vertices."""
    figure = figure or column()
    every = lists(figure.skin)
    for vertex, row in rows.items():
        every[vertex] = row
    return replace(figure, skin=skin_from_lists(every, figure.skin.inverse_bind))


def bound(joint: int, matrix: np.ndarray) -> Figure:
    """Return the column with one inverse bind matrix replaced."""
    figure = column()
    matrices = figure.skin.inverse_bind.copy()
    matrices[joint] = matrix
    return replace(figure, skin=replace(figure.skin, inverse_bind=matrices))


def meshed(triangles: Callable[[np.ndarray], np.ndarray]) -> Figure:
    """Return the column with replaced triangles and the same normals."""
    figure = column()
    changed = triangles(figure.mesh.triangles.copy())
    mesh = replace(figure.mesh, triangles=changed, triangle_materials=None, triangle_parts=None)
    return replace(figure, mesh=mesh)


def moved(vertex: int, by: tuple[float, float, float]) -> Figure:
    """Return the column with one vertex moved."""
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
    """Return the column and a tetrahedron of vertices 20 to 23 next to it."""
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
    pose.dofs[7] = 4.0  # knee.y, with an upper limit of 3
    return scene_of(figure, pose=pose)


def three_on_an_edge(triangles: np.ndarray) -> np.ndarray:
    return np.vstack([triangles, [[0, 1, 16]]])


def turned(*indices: int) -> Callable[[np.ndarray], np.ndarray]:
    def turn(triangles: np.ndarray) -> np.ndarray:
        triangles[list(indices)] = triangles[list(indices)][:, ::-1]
        return triangles

    return turn


def moebius() -> Figure:
    """Return a band of 12 quads with a half twist."""
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
    """Return the column with a clip of these keys; the other channels are 0."""
    figure = column()
    made = []
    for target in range(figure.skeleton.n_dofs):
        times, values = channels.get(target, ([0.0], [0.0]))
        made.append(Channel(target, times, values, (("linear", "linear"),) * len(times)))
    return scene_of(figure, Clip("keys", tuple(made), 0.0, end))


def moving(change: Callable[[np.ndarray, np.ndarray], None], timing: Timing | None = None) -> Scene:
    """Return standing legs with changed root translations (F, 3) and rotations (F, J, 4)."""
    figure = legs()
    clip = standing(figure)
    translations, rotations = clip.translations.copy(), clip.rotations.copy()
    change(translations[:, 0], rotations)
    clip = replace(clip, translations=translations, rotations=rotations)
    return scene_of(figure, clip if timing is None else replace(clip, timing=timing))


def one_jump(root: np.ndarray, _: np.ndarray) -> None:
    root[20] = 3.0, 0.0, 0.0


def one_turn(_: np.ndarray, rotations: np.ndarray) -> None:
    rotations[20, 2] = 1.0, 0.0, 0.0, 0.0  # by 180 degrees about x, at the left knee


def slide(root: np.ndarray, _: np.ndarray) -> None:
    root[:, 2] = 0.5 * np.arange(FRAMES) / RATE


def sink(root: np.ndarray, _: np.ndarray) -> None:
    root[40:, 1] = -0.2


def float_about(root: np.ndarray, _: np.ndarray) -> None:
    root[:, 1] = 2.0 + 0.3 * np.sin(2.0 * np.pi * np.arange(FRAMES) / 20)


def hover(root: np.ndarray, _: np.ndarray) -> None:
    root[50:, 1] = 0.05


def shake(root: np.ndarray, _: np.ndarray) -> None:
    root[:, [0, 2]] = np.random.default_rng(4).normal(0.0, 0.02, (FRAMES, 2))


def shaking_point(points: np.ndarray) -> None:
    points[:, 1, :3] += np.random.default_rng(5).normal(0.0, 0.05, (FRAMES, 3))


def people(*places: np.ndarray) -> Scene:
    """Return people of one capture at given x in each frame; NaN means absent."""
    found = []
    for number, x in enumerate(places):
        scene = moving(lambda root, _, x=x: np.copyto(root[:, 0], np.nan_to_num(x)))
        actor, there = scene.actors[0], ~np.isnan(x)
        rows = np.where(there, np.arange(FRAMES), -1)
        clip = replace(actor.clip, timing=replace(actor.clip.timing, rows=rows, holds=False))
        found.append(replace(actor, clip=clip, person=number, called="take"))
    return Scene(found)


def exchanged() -> Scene:
    step = np.where(np.arange(FRAMES) < 20, 0.0, 2.0)
    return people(step, 2.0 - step)


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
    """Return the column bound to a chain of five joints, all of which influence vertex 8."""
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


def limited_in_degrees() -> Figure:
    limits = column().skeleton.dof_limits.copy()
    limits[8] = -10.0, 140.0
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
    """Return a bind matrix for joint 1 that also scales."""
    matrix = np.diag([*factors, 1.0])
    matrix[:3, 3] = matrix[:3, :3] @ [0.0, -2.0, 0.0]
    return matrix


# Values by name: (maker, code, kind of location, expected locations).
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
    "limits in degrees": (limited_in_degrees, "S014", "joints", [1]),
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
    "floating": (lambda: moving(hover), "C016", "frames", list(range(150, 160))),
    "jitter": (lambda: moving(shake), "C014", "joints", list(range(7))),
    "shaking point": (lambda: captured(shaking_point), "C014", "joints", [1]),
    "exchanged people": (exchanged, "C015", "frames", [120]),
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
