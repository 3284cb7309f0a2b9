"""Fixes: the fault is gone, what was sound is unchanged, and the note states by how much."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from formats.gltf.files import File, skinned
from linting.planted import column, inside_out, moved, weighted, with_normal
from linting.test_bad_keys import FRAMES, RATE, K, about_z, arm, waving
from linting.test_bad_rigs import (
    NOSE,
    body,
    bound_elsewhere,
    cut_off,
    joint,
    noisy,
    renamed,
    stray,
    stuck_out,
    swapped,
    table,
    taken,
    torn_seam,
    tube,
    turned,
    turned_in_another_pose,
)
from linting.test_bad_rigs import weighted as shaped_by

from viewer.cli import run
from viewer.diagnostics import note
from viewer.diagnostics.codes import CODES
from viewer.exporters import export
from viewer.linting import (
    Subject,
    bindings,
    blending,
    lint_files,
    meshes,
    noise,
    places_of,
    pops,
    spikes,
    stray_weights,
    symmetry,
    weights,
)
from viewer.linting.fixes import FIXES, fix_scene, motions
from viewer.linting.fixes import weights as weights_fix
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.motion.transform_clip import Animation, TransformChannel, TransformClip
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skin import normalized, owners


def fixed(figure, check):
    """Fix what one check finds in a figure, in up to four rounds; return it and the first note."""
    subject, notes = Subject(Actor(figure), up=figure.up), []
    for _ in range(5):
        found = [one for one in check.check(subject) if one.code in FIXES]
        if not found:
            return subject.actor.figure, notes[0]
        for one in found:
            fix = import_module(f"viewer.linting.fixes.{FIXES[one.code]}").fix
            notes.append(str(fix(subject, one)))
    raise AssertionError(f"still found after four rounds: {found}")


def weights_of(figure) -> np.ndarray:
    skin = normalized(figure.skin)
    found = np.zeros((skin.n_vertices, skin.n_joints))
    np.add.at(found, (owners(skin), skin.joints), skin.weights)
    return found


def test_every_code_with_a_fix_exists():
    assert set(FIXES) <= set(CODES)


def test_sums_and_signs_are_corrected():
    figure, note = fixed(weighted({5: [(0, 0.9)]}), weights)
    assert weights_of(figure)[5].tolist() == [1.0, 0.0] and "changed by up to 0.1 " in note
    figure, _ = fixed(weighted({7: [(0, 1.25), (1, -0.25)]}), weights)
    assert weights_of(figure)[7].tolist() == [1.0, 0.0]


def test_actors_of_one_figure_still_share_it():
    figure = weighted({5: [(0, 0.9)]})
    scene = Scene([Actor(figure), Actor(figure)])
    (_note,) = fix_scene(scene).notes
    one, other = scene.actors
    assert one.figure is other.figure and weights_of(one.figure)[5].tolist() == [1.0, 0.0]


def test_actors_of_one_figure_play_the_fixed_animation_of_their_own():
    scales = TransformChannel(2, "scale", [0.0, 1.0], np.full((2, 3), 1.4))
    turns = TransformChannel(3, "rotation", K / RATE, about_z(waving()))
    clip = TransformClip("x", (scales, turns), 0.0, 1.9)
    figure = replace(arm(), animations=(Animation("x", 0.0, 1.9, lambda: clip),))
    scene = Scene([Actor(figure, clip=clip, animation=0) for _ in range(2)])
    fix_scene(scene)
    for actor in scene.actors:
        assert [one.path for one in actor.clip.channels] == ["rotation"]
        assert actor.figure.animations[0].plays(actor.clip)


def test_finding_that_an_earlier_fix_settles_is_not_fixed(monkeypatch):
    """A leak makes the seams between rigid parts seem torn; without it, they are not."""
    fixed_codes, leaks = list[str](), weighted({})

    def found(scene, _options):
        subject = Subject(scene.actors[0], 0)
        if subject.actor.figure is not leaks:
            return []
        torn = subject.found("W014.seams: torn", joints=[0], at=("weights", 0))
        return [torn, subject.found("W011.strays: a leak", joints=[0], at=("weights", 0))]

    def fix(subject, finding):
        fixed_codes.append(finding.code)
        subject.actor.figure = replace(subject.actor.figure, name="fixed")
        return note("X007.names: fixed")

    monkeypatch.setattr("viewer.linting.fixes.lint_scene", found)
    monkeypatch.setattr(weights_fix, "fix", fix)
    assert fix_scene(Scene([Actor(leaks)])).codes == {"W011"} and fixed_codes == ["W011"]


def test_vertex_without_weights_gets_those_of_its_neighbours():
    """Of vertex 11, two are below it, with joint 0, two above, and two on its ring, with both."""
    figure, _ = fixed(weighted({11: []}), weights)
    assert weights_of(figure)[11].tolist() == [0.5, 0.5]


@pytest.mark.parametrize("amount", [1.0, 0.3])
def test_stray_weight_goes_to_the_joints_of_its_surroundings(amount):
    figure, note = fixed(stray(amount)(), stray_weights)
    found = weights_of(figure)
    assert found[NOSE, joint("right_foot")] == 0.0
    assert found[NOSE, joint("head")] == pytest.approx(table()[NOSE, joint("head")], abs=0.05)
    others = np.arange(len(found)) != NOSE
    np.testing.assert_allclose(found[others], table()[others], atol=1e-12)
    assert "weights of 1 vertex" in note


@pytest.mark.parametrize(
    "given",
    [
        (("left_knee",), "right_knee"),
        # The legs are also nearer to the left wrist than to the head.
        (("left_wrist", "left_knee", "right_knee"), "head"),
    ],
)
def test_taken_weights_go_back(given):
    # Weights below 0.01 are not seen.
    figure, note = fixed(taken(*given), stray_weights)
    np.testing.assert_allclose(weights_of(figure), table(), atol=0.01)
    assert "W012 fixed" in note


def test_part_that_moved_with_a_distant_joint_moves_as_a_whole():
    """A patch of the elbow, where weights blend, is cut off, and moves with the other wrist."""
    sound = table()
    vertex = int(np.abs(sound[:, joint("left_elbow")] - 0.5).argmin())
    cut, island = cut_off(vertex)
    assert np.ptp(sound[island], axis=0).max() > 0.1
    bad = sound.copy()
    bad[island] = np.arange(bad.shape[1]) == joint("right_wrist")
    figure, note = fixed(shaped_by(bad, cut), stray_weights)
    found = weights_of(figure)
    assert f"weights of {len(island)} vertices" in note
    np.testing.assert_allclose(found[island], found[island[:1]].repeat(len(island), 0), atol=1e-12)
    others = np.setdiff1d(np.arange(len(sound)), island)
    away = np.linalg.norm(
        cut.mesh.positions[others, None] - cut.mesh.positions[island], axis=2
    ).min(axis=1)
    np.testing.assert_allclose(found[island[0]], sound[others[away.argmin()]], atol=1e-12)
    np.testing.assert_allclose(found[others], sound[others], atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_mild_noise_is_reduced_where_weights_are_steep(seed):
    """The wrist takes over and lets go within three rings each; the noise is up to 0.05."""
    sound = tube(lambda x: np.clip(1.0 + 8.0 * x, 0.0, 2.0))
    # Without a mirror plane, the sides are not averaged.
    points = sound.mesh.positions @ np.array([[1.0, 0, 0], [0, 1, 0.3], [0, 0, 1]])
    points[:, 0] += 0.2 * points[:, 0] ** 2
    sound = replace(sound, mesh=replace(sound.mesh, positions=points))
    expected = weights_of(sound)
    blends = (expected > 0.02) & (expected < 0.98)
    shaken = np.random.default_rng(seed).uniform(-0.05, 0.05, expected.shape) * blends
    bad = shaped_by(np.clip(expected + shaken, 0.0, 1.0), sound)
    subject = Subject(Actor(bad))
    vertices = np.flatnonzero(blends.any(axis=1))
    weights_fix.fix(subject, subject.found("W016.noise: noise", vertices=vertices))
    errors = [np.linalg.norm(weights_of(one) - expected) for one in (bad, subject.actor.figure)]
    assert errors[1] < 0.95 * errors[0]


def test_exchanged_legs_are_exchanged_back():
    figure, _ = fixed(swapped(), stray_weights)
    np.testing.assert_allclose(weights_of(figure), table(), atol=1e-9)


def test_noise_is_smoothed_towards_the_weights_before():
    noise_of_limb = noisy(0.2, "left_shoulder")()
    figure, _ = fixed(noise_of_limb, noise)
    errors = [np.linalg.norm(weights_of(one) - table()) for one in (noise_of_limb, figure)]
    assert errors[1] < 0.7 * errors[0]


def test_torn_seam_gets_the_weights_of_its_sound_side():
    sound, torn, _ = torn_seam()
    (found,) = (one for one in blending.check(Subject(Actor(torn))) if one.code == "W014")
    figure, note = fixed(torn, blending)
    named = found.vertices
    np.testing.assert_allclose(weights_of(figure)[named], weights_of(sound)[named], atol=1e-9)
    assert f"weights of {len(named)} vertices changed" in note


def test_names_and_bindings_are_corrected():
    figure, note = fixed(renamed(), symmetry)
    assert figure.skeleton.names == body().skeleton.names and "knee" in note
    figure, _ = fixed(turned(), bindings)
    np.testing.assert_allclose(figure.skin.inverse_bind, body().skin.inverse_bind, atol=1e-9)
    figure, _ = fixed(bound_elsewhere(), bindings)
    np.testing.assert_allclose(figure.skin.inverse_bind, body().skin.inverse_bind, atol=1e-9)
    # The shin is nearly perpendicular to z, about which its binding was rotated: the rest of that
    # rotation, about the shin, is not seen.
    figure, note = fixed(turned_in_another_pose(), bindings)
    knee, was = (one.skin.inverse_bind[joint("left_knee"), :3, :3] for one in (figure, body()))
    apart = np.degrees(np.arccos(0.5 * (np.trace(knee @ was.T) - 1.0)))
    assert "bones bound in the direction at rest: left_knee" in note and apart < 3.0


def test_spike_and_normal_are_corrected():
    """The middle of its neighbours is within 10 mm of where the vertex was."""
    figure, note = fixed(stuck_out(), spikes)
    away = np.linalg.norm(figure.mesh.positions[NOSE] - body().mesh.positions[NOSE])
    assert away < 0.01 and "1 place moved" in note
    figure, _ = fixed(with_normal(3, (0.0, 0.0, 0.0)), meshes)
    np.testing.assert_allclose(figure.mesh.normals[3], column().mesh.normals[3], atol=1e-9)


@pytest.mark.parametrize("frames", [1, 2])
@pytest.mark.parametrize("is_captured", [False, True])
def test_pop_is_interpolated(is_captured, frames):
    """The path without the pop is smooth: interpolation is off by at most its curvature."""
    figure, bends = arm(), waving()
    popping = bends.copy()
    popping[30 : 30 + frames] += 50.0
    turns = about_z(popping)
    if is_captured:
        every = np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, 6, 1))
        every[:, 3] = turns
        clip = SampledClip("x", Timing(RATE, K), every, np.zeros((FRAMES, 6, 3)))
    else:
        channel = TransformChannel(3, "rotation", K / RATE, turns)
        clip = TransformClip("x", (channel,), 0.0, (FRAMES - 1) / RATE)
    scene = Scene([Actor(figure, clip=clip)])
    (note,) = fix_scene(scene).notes
    rotations = scene.actors[0].clip.sample(figure.skeleton, K / RATE).rotations
    rotations = rotations[:, 3 if is_captured else 0]
    np.testing.assert_allclose(np.abs(np.sum(rotations * about_z(bends), axis=1)), 1.0, atol=1e-4)
    assert "left_elbow" in str(note)


def test_run_of_popping_frames_is_interpolated_as_a_whole():
    """Frames 29 and 33 are sound: the angles between them are evenly spaced."""
    bends = waving()
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, 6, 1))
    turns[:, 3] = about_z(bends + 50.0 * ((K >= 30) & (K < 33)))
    clip = SampledClip("x", Timing(RATE, K), turns, np.zeros((FRAMES, 6, 3)))
    subject = Subject(Actor(arm(), clip=clip))
    (found,) = pops.check(subject)
    # Another joint of the finding pops in two more frames.
    motions.fix(subject, replace(found, times=np.arange(30, 35) / RATE))
    wanted = about_z(np.linspace(bends[29], bends[33], 5))
    np.testing.assert_allclose(subject.actor.clip.rotations[29:34, 3], wanted, atol=1e-9)


def test_keys_of_scales_are_deleted():
    scales = TransformChannel(2, "scale", [0.0, 1.0], np.full((2, 3), 1.4))
    turns = TransformChannel(3, "rotation", K / RATE, about_z(waving()))
    scene = Scene([Actor(arm(), clip=TransformClip("x", (scales, turns), 0.0, 1.9))])
    fix_scene(scene)
    assert [one.path for one in scene.actors[0].clip.channels] == ["rotation"]
    np.testing.assert_array_equal(scene.actors[0].pose.scales[2], 1.0)


def test_captured_bones_keep_the_length_at_rest():
    """The forearm, 0.3 long, is 1.5 times as long in six frames; only it is set back."""
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, 6, 1))
    turns[:, 3] = about_z(waving())
    offsets = np.zeros((FRAMES, 6, 3))
    offsets[:, 0] = np.linspace([0.0, 0.0, 0.0], [0.2, 0.0, 0.0], FRAMES)
    moved_offsets = offsets.copy()
    moved_offsets[30:36, 4, 0] = 0.15
    scene = Scene([Actor(arm(), clip=SampledClip("x", Timing(RATE, K), turns, moved_offsets))])
    (note,) = fix_scene(scene).notes
    assert "C022 fixed: translations of left_wrist set to those at rest" in str(note)
    np.testing.assert_array_equal(scene.actors[0].clip.translations, offsets)


def test_weights_that_a_fix_does_not_touch_stay_as_they_are():
    """Sums that a file rounded to 0.9995 are no fault, and vertex 5 is not beside vertex 11."""
    figure, note = fixed(weighted({5: [(0, 0.9995)], 11: []}), weights)
    assert "weights of 1 vertex" in note
    assert figure.skin.weights[figure.skin.starts[5]] == 0.9995


@pytest.mark.parametrize(
    ("figure", "code", "said"),
    [
        (weighted({4: [(0, 0.5), (0, 0.5)]}), "W009", "duplicate influences of 1 vertex merged"),
        (inside_out(), "M003", "winding of 36 triangles reversed"),
        (with_normal(3, (0.8, -0.9, -0.8)), "M008", "1 normal normalised"),
    ],
)
def test_convert_fixes_what_it_names(tmp_path, capsys, figure, code, said):
    export(Actor(figure), tmp_path / "bad.skel")
    bad, good = ([str(tmp_path / f"{n}.{s}") for s in ("skel", "skin")] for n in ("bad", "good"))
    before = {one.code for one in lint_files(bad)[1]}
    assert run(["convert", *bad, "-o", good[0], "--fix", code]) == 0
    assert f"{code} fixed: {said}" in capsys.readouterr().out
    assert code in before and {one.code for one in lint_files(good)[1]} <= before - {code}


def test_what_was_fixed_on_reading_is_said(tmp_path, capsys):
    file = skinned()
    file.primitive["attributes"]["WEIGHTS_0"] = file.accessor([[0.4, 0.4, 0, 0]] * 3)
    (tmp_path / "bad.gltf").write_bytes(file.json())
    command = ["convert", str(tmp_path / "bad.gltf"), "-o", str(tmp_path / "good.glb"), "--fix"]
    assert run(command) == 0
    (line,) = (one for one in capsys.readouterr().out.splitlines() if "W001" in one)
    assert line.startswith("W001 fixed on reading: ") and "weights of 3 vertices" in line


def test_open_parts_are_reversed_with_closed_ones_if_their_normals_oppose_them():
    """Of two squares with normals that point up, the triangles of the first one face down."""
    closed, corners = inside_out().mesh, np.array([[0, 0, 0], [0, 0, 1], [1, 0, 1], [1, 0, 0]])
    squares = closed.n_vertices + np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    faces = squares.copy()
    faces[:2] = faces[:2, ::-1]
    mesh = Mesh(
        np.concatenate([closed.positions, 5.0 + corners, 8.0 + corners]),
        np.concatenate([closed.normals, np.tile([0.0, 1.0, 0.0], (8, 1))]),
        np.concatenate([closed.triangles, faces]),
    )
    found = {one.code: one for one in meshes.check(Subject(Actor(Figure("a", mesh))))}
    assert "2 parts with 38 triangles are inside out" in found["M003"].message
    assert found["M003"].triangles.tolist() == [*range(38)]
    right = fixed(Figure("a", mesh), meshes)[0].mesh
    np.testing.assert_array_equal(right.triangles[36:], squares)
    np.testing.assert_array_equal(right.normals[-8:], mesh.normals[-8:])
    np.testing.assert_array_equal(right.normals[:-8], -closed.normals)


def test_convert_fixes_and_prints_changes(tmp_path, capsys):
    export(Actor(weighted({5: [(0, 0.9)]})), tmp_path / "bad.skel")
    files = [str(tmp_path / name) for name in ("bad.skel", "bad.skin", "good.skel", "good.skin")]
    assert run(["convert", *files[:2], "-o", files[2], "--fix"]) == 0
    assert "W001 fixed: weights of 1 vertex changed by up to 0.1 " in capsys.readouterr().out
    assert "W001" not in {one.code for one in lint_files(files[2:])[1]}
    assert run(["convert", *files[2:], "-o", str(tmp_path / "again.skel"), "--fix", "W001"]) == 0
    assert "nothing to fix" in capsys.readouterr().out


def test_vertex_without_weights_in_gltf_is_named_and_fixed(tmp_path, capsys):
    """Two triangles: the last corner is beside two that both joints move; its slots name joint 1,
    and a joint that moves nothing else must not count as one with weights.
    """
    file = File()
    attributes = {
        "JOINTS_0": file.accessor([[1, 2, 0, 0]] * 3 + [[0, 0, 0, 0]], "B"),
        "WEIGHTS_0": file.accessor([[1, 0, 0, 0]] + [[0.5, 0.5, 0, 0]] * 2 + [[0, 0, 0, 0]]),
    }
    file.mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], **attributes)
    file.primitive["indices"] = file.accessor([0, 1, 2, 2, 1, 3], "H")
    names = [{"name": name} for name in ("low", "middle", "high")]
    file.root["nodes"] = [{"mesh": 0, "skin": 0}, names[0] | {"children": [2]}]
    file.root["nodes"] += [names[1] | {"children": [3]}, names[2]]
    file.root |= {"skins": [{"joints": [1, 2, 3]}], "scenes": [{"nodes": [0, 1]}], "scene": 0}
    bad, good = tmp_path / "bad.glb", tmp_path / "good.glb"
    bad.write_bytes(file.glb())
    scene, found = lint_files([bad])
    (bare,) = (one for one in found if one.code == "W004")
    assert bare.vertices.tolist() == [3] and bare.pointer.endswith("/attributes/WEIGHTS_0")
    assert "1 vertex has no weights and follows low" in bare.message
    np.testing.assert_allclose(places_of(bare, scene).vertices, [[1.0, 1.0, 0.0]])
    (idle,) = (one for one in found if one.code == "W006")
    assert idle.joints.tolist() == [0]
    assert run(["convert", str(bad), "-o", str(good), "--fix", "W004"]) == 0
    assert "W004 fixed: weights of 1 vertex" in capsys.readouterr().out
    fixed_scene, left = lint_files([good])
    assert "W004" not in {one.code for one in left}
    np.testing.assert_allclose(weights_of(fixed_scene.actors[0].figure)[3], [0.0, 0.5, 0.5])


def test_what_cannot_be_fixed_is_said(tmp_path, capsys):
    export(Actor(moved(6, (100.0, 0.0, 0.0))), tmp_path / "bad.skel")
    command = ["convert", str(tmp_path / "bad.skel"), str(tmp_path / "bad.skin"), "-o"]
    assert run([*command, str(tmp_path / "x.skel"), "--fix"]) == 0
    assert "M010 remains" in capsys.readouterr().out
    assert run([*command, str(tmp_path / "y.skel"), "--fix", "M010"]) == 2
    said = capsys.readouterr().err
    assert "--fix: expected codes that can be fixed" in said and "without codes, --fix" in said
