"""The check registry, lint codes, progress, and scene locations of findings."""

from collections.abc import Iterable
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from faults import told
from linting.planted import FAULTS, exchanged, made, people, weighted
from linting.sound import FRAMES, column, keypoints, make_skeleton, scene_of, standing

import viewer.linting
from viewer.diagnostics import Diagnostic
from viewer.linting import CHECKS, CODES, SEVERITIES, Finding, lint_files, lint_scene, points_of
from viewer.progress import Cancelled, receiving
from viewer.rigs.arrays import Ints
from viewer.rigs.figure import Figure
from viewer.rigs.inspection.faults import are_singular
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skin import skin_from_lists


def test_registry_matches_its_folder():
    folder = Path(viewer.linting.__file__).parent
    assert {p.stem for p in folder.glob("*.py") if not p.name.startswith("_")} == set(CHECKS)
    for name in CHECKS:
        assert callable(import_module(f"viewer.linting.{name}").check)


def test_codes_have_a_severity_a_title_and_a_hint():
    for name, code in CODES.items():
        assert name[0] in "FGWBSMYC" and name[1:].isdecimal() and len(name) == 4
        assert code.severity in SEVERITIES and code.title and code.hint


def test_titles_are_unique():
    assert len({code.title for code in CODES.values()}) == len(CODES)


def test_progress_counts_every_check():
    steps: list[tuple[int, int, str]] = []
    with receiving(lambda done, total, unit, what: steps.append((done, total, what))):
        lint_scene(scene_of(column()))
    assert [step[:2] for step in steps] == [(k, len(CHECKS)) for k in range(len(CHECKS))]
    assert steps[0][2] == "column: weights"


def test_progress_may_cancel():
    def stop(done: int, total: int, unit: str, what: str) -> None:
        if done == 2:
            raise Cancelled

    with pytest.raises(Cancelled), receiving(stop):
        lint_scene(scene_of(column()))


def test_figure_shared_by_actors_is_checked_once():
    figure = weighted({5: [(0, 0.9)]})
    scene = Scene([Actor(figure), Actor(figure), Actor(column())])
    scene.actors[1].pose.dofs[7] = 4.0
    assert [(f.code, f.actor) for f in lint_scene(scene)] == [("W001", 0), ("S004", 1)]


def test_checks_do_not_change_the_scene():
    figure = column()
    scene = scene_of(figure, standing(figure))
    pose = scene.actors[0].pose.copy()
    lint_scene(scene)
    assert np.array_equal(scene.actors[0].pose.dofs, pose.dofs)
    assert np.array_equal(scene.actors[0].pose.translations, pose.translations)


def test_locations_of_vertices_triangles_and_joints_are_their_points():
    scene = scene_of(column())
    scene.actors[0].placement[:3, 3] = 10.0, 0.0, 0.0
    vertex = Finding(Diagnostic("W001.some: text"), actor=0, vertices=np.array([5]))
    assert points_of(vertex, scene).tolist() == [[9, 1, 1]]
    triangle = Finding(Diagnostic("M001.some: text"), actor=0, triangles=np.array([0]))
    assert points_of(triangle, scene).tolist() == [[11, 0, 1], [11, 1, 1], [9, 0, 1]]
    joint = Finding(Diagnostic("S006.some: text"), actor=0, joints=np.array([1]))
    assert points_of(joint, scene).tolist() == [[10, 2, 0]]


def test_locations_in_captures_are_points_and_may_be_empty():
    figure, clip = keypoints()
    scene = scene_of(figure, clip)
    scene.actors[0].points = clip.points[0]
    ankle = Finding(Diagnostic("C011.some: text"), actor=0, joints=np.array([2]))
    assert points_of(ankle, scene).tolist() == [[0, 0, 0]]
    assert points_of(Finding(Diagnostic("F001.some: text")), scene).shape == (0, 3)
    assert len(points_of(Finding(Diagnostic("C010.some: text"), actor=0), scene)) == 3


@pytest.mark.parametrize("name", FAULTS)
def test_every_finding_can_be_framed(name):
    scene = made(FAULTS[name][0])
    for finding in lint_scene(scene):
        points = points_of(finding, scene)
        if "singular" not in name and "not affine" not in name:
            assert np.isfinite(points).all()


def test_placement_scale_is_applied():
    """The speed of a figure in centimetres that is placed in metres is that of the drawn figure."""
    scene = made(FAULTS["jump"][0])
    before = [f.message for f in lint_scene(scene)]
    actor = scene.actors[0]
    scene.actors[0] = replace(actor, placement=np.diag([0.01, 0.01, 0.01, 1.0]))
    assert [f.message for f in lint_scene(scene)] == before


def test_singularity_does_not_depend_on_scale():
    matrices = np.tile(np.eye(4), (5, 1, 1))
    matrices[1, :3, :3] *= 1e-30
    matrices[2, 2, 2] = 1e-11
    matrices[3, 1] = 2 * matrices[3, 0]
    matrices[4, :3, :3] = 0.0
    assert are_singular(matrices).tolist() == [False, False, False, True, True]


def test_other_joints_are_compared_despite_a_singular_matrix():
    """The knee is bound at y = 3 and at rest at y = 2."""
    figure = column()
    matrices = figure.skin.inverse_bind.copy()
    matrices[0, :3, :3] = 0.0
    matrices[1, 1, 3] = -3.0
    scene = scene_of(replace(figure, skin=replace(figure.skin, inverse_bind=matrices)))
    found = {finding.code: finding for finding in lint_scene(scene)}
    assert found["B002"].joints.tolist() == [0]
    assert found["B004"].joints.tolist() == [1]
    values = {"n": 1, "joint": "knee", "distance": "1 m"}
    assert told([found["B004"].diagnostic]) == [("B004.joints", values)]


def test_stray_vertex_does_not_hide_joints_with_a_different_bind_position():
    """0.1 is 2 % of the column's size, but negligible relative to a box of 1700."""
    figure = column()
    mesh, skin = figure.mesh, figure.skin
    # Three copies of the column have enough vertices for one of them to be a stray.
    positions = np.tile(mesh.positions, (3, 1))
    positions[-1] = 1000.0
    counts = np.tile(np.diff(skin.starts), 3)
    matrices = skin.inverse_bind.copy()
    matrices[1, 1, 3] = -2.1
    thrice = replace(
        skin,
        starts=np.concatenate([[0], np.cumsum(counts)]).astype(np.int32),
        joints=np.tile(skin.joints, 3),
        weights=np.tile(skin.weights, 3),
        inverse_bind=matrices,
    )
    normals = np.tile(mesh.normals, (3, 1))
    strayed = replace(mesh, positions=positions, normals=normals)
    scene = scene_of(replace(figure, mesh=strayed, skin=thrice, symmetry=None))
    assert "B004" in {finding.code for finding in lint_scene(scene)}


FRAME = np.arange(FRAMES)


def found(scene: Scene):
    return [finding for finding in lint_scene(scene) if finding.code == "C015"]


def test_exchange_is_reported_with_the_other_person_and_the_distance():
    (finding,) = found(exchanged())
    assert finding.message == ("swaps positions with person 1, 2 m away, in 1 frame: 120")


def test_exchange_and_its_reversal_are_reported_in_two_frames():
    step = np.where((FRAME >= 20) & (FRAME < 30), 2.0, 0.0)
    (finding,) = found(people(step, 2.0 - step))
    assert finding.frames.tolist() == [120, 130]


def test_exchange_during_a_short_gap_is_found():
    step = np.where(FRAME < 20, 0.0, 2.0)
    other = 2.0 - step
    step[18:21] = np.nan
    (finding,) = found(people(step, other))
    assert finding.frames.tolist() == [121]


def test_people_who_pass_each_other_are_not_exchanged():
    walk = 0.05 * (FRAME - 30.0)  # 1.5 m/s
    assert found(people(walk, -walk)) == []


def test_single_person_who_jumps_is_not_exchanged():
    assert found(people(np.where(FRAME < 20, 0.0, 2.0), np.full(FRAMES, 2.0))) == []


def test_track_that_continues_with_a_different_number_is_a_note():
    first = np.where(FRAME < 20, 0.0, np.nan)
    second = np.where(FRAME < 25, np.nan, 0.1)
    (finding,) = found(people(first, second))
    assert finding.severity == "note" and finding.actor == 1
    assert finding.frames.tolist() == [125]
    assert "100 mm from where person 0 disappears in frame 119" in finding.message
    assert "--merge-ids 0,1" in finding.message


def test_person_who_appears_elsewhere_or_much_later_is_a_different_person():
    first = np.where(FRAME < 10, 0.0, np.nan)
    assert found(people(first, np.where(FRAME < 12, np.nan, 1.0))) == []
    assert found(people(first, np.where(FRAME < 50, np.nan, 0.0))) == []


def test_people_of_different_recordings_are_not_compared():
    scene = exchanged()
    scene.actors[1] = replace(scene.actors[1], called="other")
    assert found(scene) == []


def grid(n: int, wraps: bool) -> np.ndarray:
    """Return the triangles of n x n vertices row by row, or of a torus if they wrap around."""
    rows, columns = np.divmod(np.arange(n * n), n)
    quads = [
        (rows + down) % n * n + (columns + right) % n
        for down, right in ((0, 0), (0, 1), (1, 1), (1, 0))
    ]
    inside = np.full(n * n, wraps) | ((rows < n - 1) & (columns < n - 1))
    a, b, c, d = (quad[inside] for quad in quads)
    return np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], 1).reshape(-1, 3)


def bowl(n: int, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and triangles of an open sheet with a low or high middle."""
    y, x = np.divmod(np.arange(n * n), n)
    middle = (n - 1) / 2
    z = height * ((x - middle) ** 2 + (y - middle) ** 2)
    return np.stack([x, y, z], axis=1), grid(n, wraps=False)


def ring(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and triangles of a closed torus that is inside out."""
    turns, tilts = 2 * np.pi * np.stack(np.divmod(np.arange(n * n), n)) / n
    radii = 3 + np.cos(tilts)
    positions = np.stack([radii * np.cos(turns), radii * np.sin(turns), np.sin(tilts)], axis=1)
    triangles = grid(n, wraps=True)
    a, b, c = np.moveaxis(positions[triangles], 1, 0)
    # The expected direction is independent of the check: outwards is away from the centre circle.
    middle = (a + b + c) / 3
    core = middle * [1, 1, 0]
    outward = middle - 3 * core / np.linalg.norm(core, axis=1, keepdims=True)
    sides = np.einsum("ta,ta->t", np.cross(b - a, c - a), outward)
    assert (sides > 0).all() or (sides < 0).all()
    return positions, triangles[:, ::-1] if sides[0] > 0 else triangles


def codes(
    folder: Path,
    mesh: tuple[np.ndarray, np.ndarray],
    lost: Iterable[int] = (),
    nowhere: Iterable[int] = (),
) -> set[str]:
    """Write a mesh with triangles that use vertex 999 and vertices at nan; return the codes."""
    positions, triangles = mesh
    gone, blank = set(lost), set(nowhere)
    lines = [
        f"v {x:.6g} {y:.6g} {'nan' if vertex in blank else format(z, '.6g')}"
        for vertex, (x, y, z) in enumerate(positions.tolist())
    ]
    lines += [
        f"f {a} {b} {999 if triangle in gone else c}"
        for triangle, (a, b, c) in enumerate((triangles + 1).tolist())
    ]
    (folder / "a.obj").write_text("\n".join(lines) + "\n")
    return {finding.code for finding in lint_files([folder / "a.obj"])[1]}


def border(n: int) -> tuple[list[int], list[int]]:
    """Return the triangles and vertices at the border of a bowl."""
    y, x = np.divmod(np.arange(n * n), n)
    at_end = (x % (n - 1) == 0) | (y % (n - 1) == 0)
    touching = at_end[grid(n, wraps=False)].any(axis=1)
    return np.flatnonzero(touching).tolist(), np.flatnonzero(at_end).tolist()


@pytest.mark.parametrize("height", [0.1, -0.1, 0.02, -0.02])
@pytest.mark.parametrize("n", [4, 6, 12])
def test_open_sheet_without_its_border_is_not_closed(tmp_path, n, height):
    triangles, vertices = border(n)
    mesh = bowl(n, height)
    assert codes(tmp_path, mesh) == {"M005"}
    assert "M003" not in codes(tmp_path, mesh, lost=triangles)
    assert "M003" not in codes(tmp_path, mesh, nowhere=vertices)
    assert "M003" not in codes(tmp_path, mesh, lost=range(0, len(mesh[1]), 2))


def test_sheet_on_another_one_is_not_flipped_by_an_edge_that_they_share(tmp_path):
    """A badge of two by two squares, whose middle sticks out, at one side of a plate of six by six:
    two of its edges are those of the border of the plate, and the others have three triangles.
    """
    y, x = np.divmod(np.arange(49), 7)
    plate = np.stack([x, y, 0 * x], axis=1).astype(float)
    badge = plate[(x > 1) & (x < 5) & (y < 3)]
    badge[4, 2] = 0.1
    triangles = grid(7, wraps=False)
    both = np.concatenate([plate, badge]), np.concatenate([triangles, grid(3, wraps=False) + 49])
    assert "M002" not in codes(tmp_path, both)
    patch = np.isin(triangles, np.flatnonzero((x > 1) & (x < 5) & (y < 3))).all(axis=1)
    triangles[patch] = triangles[patch, ::-1]
    assert patch.sum() == 8 and "M002" in codes(tmp_path, (plate, triangles))


def test_closed_surface_with_few_lost_triangles_is_still_inside_out(tmp_path):
    mesh = ring(12)  # the square of 8 open edges is less than a quarter of the 288 triangles
    assert codes(tmp_path, mesh) == {"M003"}
    assert codes(tmp_path, mesh, lost=[7]) == {"M003", "F002"}
    assert codes(tmp_path, mesh, lost=[7, 99]) == {"M003", "F002"}
    assert codes(tmp_path, mesh, nowhere=[50]) == {"M003", "F003"}


def test_closed_surface_with_many_lost_triangles_is_not_checked(tmp_path):
    mesh = ring(12)
    assert codes(tmp_path, mesh, lost=[7, 99, 150]) == {"F002"}
    assert codes(tmp_path, mesh, lost=range(0, 288, 2)) == {"F002"}
    assert codes(tmp_path, mesh, nowhere=range(0, 144, 3)) == {"F003"}


CROWDED = [(0, 0.3), (1, 0.3), (2, 0.2), (3, 0.15), (4, 0.05)]
LAST = [(0, 0.3), (1, 0.3), (2, 0.2), (3, 0.15), (5, 0.05)]


def scene(rows: dict[int, list[tuple[int, float]]], singular: bool = True) -> Scene:
    """Return the column on a chain of six joints; joint 4 is 2 m aside, the last is singular."""
    figure = column()
    offsets = [[0, 0, 0]] + [[0, 1, 0]] * 5
    skeleton = make_skeleton(tuple("abcdef"), [-1, 0, 1, 2, 3, 4], offsets, (0.0, 0.0))
    matrices = np.tile(np.eye(4), (6, 1, 1))
    matrices[:, 1, 3] = -np.arange(6.0)
    if singular:
        matrices[5, 1, 1] = 0.0
    influences = [rows.get(v, [(v // 4, 1.0)]) for v in range(20)]
    skin = skin_from_lists(influences, matrices)
    result = scene_of(Figure("column", figure.mesh, skeleton, skin, unit="m"))
    result.actors[0].pose.translations[4, 0] = 2.0
    return result


def cost(scene: Scene, **invalid: Ints) -> Finding:
    (found,) = [f for f in lint_scene(scene, invalid=[invalid]) if f.code == "W007"]
    return found


# Joint 4 is 2 m from its rest position, so a weight of 0.05 is 100 mm; no other joint moves.
COST = (
    "pruning to 4 moves the mesh by up to 100 mm (vertex 8), 100 mm on average over these "
    "vertices, in 6 poses"
)


def without(n: int) -> str:
    """Return the part of a message with the number of vertices of unknown error."""
    verb = "vertex is" if n == 1 else "vertices are"
    return f"{n} {verb} omitted because a required position or bind matrix is invalid"


def values_of(n: int, cost: str) -> tuple[str, dict[str, object]]:
    return "W007.influences", {"n": n, "most": 5, "cost": cost}


def test_vertices_of_a_singular_joint_are_left_out_and_counted():
    found = cost(scene({8: CROWDED, 5: LAST}))
    known = f"{COST}; {without(1)}"
    assert told([found.diagnostic]) == [values_of(2, known)]
    assert found.vertices.tolist() == [8, 5]  # unknown values are last
    found = cost(scene({8: CROWDED, 5: LAST, 6: LAST}))
    known = f"{COST}; {without(2)}"
    assert told([found.diagnostic]) == [values_of(3, known)]


def test_joint_of_weight_0_leaves_out_no_vertex():
    found = cost(scene({8: [*CROWDED, (5, 0.0)]}))
    assert told([found.diagnostic]) == [values_of(1, COST)]


def test_unknown_error_is_not_reported_as_0():
    unknown = f"the effect of pruning to 4 is unknown: {without(1)}"
    assert told([cost(scene({5: LAST})).diagnostic]) == [values_of(1, unknown)]


@pytest.mark.parametrize(("part", "places"), [("bindings", [5]), ("positions", [5])])
def test_vertices_not_from_the_file_are_left_out(part, places):
    lost = np.array(places, dtype=np.int32)
    found = cost(scene({8: CROWDED, 5: LAST}, singular=False), **{part: lost})
    known = f"{COST}; {without(1)}"
    assert told([found.diagnostic]) == [values_of(2, known)]


def test_overflowing_errors_are_left_out():
    whole = scene({8: CROWDED, 5: LAST}, singular=False)
    figure = whole.actors[0].figure
    matrices = figure.skin.inverse_bind.copy()
    matrices[5, :3, :3] *= 1e308  # squares of the displacements are infinite
    whole.actors[0].figure = replace(figure, skin=replace(figure.skin, inverse_bind=matrices))
    known = f"{COST}; {without(1)}"
    assert told([cost(whole).diagnostic]) == [values_of(2, known)]
