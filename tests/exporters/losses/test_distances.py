"""Distances between exported and original vertices, at keys and between them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exporting import export_frames
from rigs import hand_made

from viewer.diagnostics import Diagnostic
from viewer.exporters import ExportOptions
from viewer.exporters._losses.largest_distances import apart
from viewer.exporters._losses.posed_bodies import Body, Poses, Side, poses_of
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix
from viewer.rigs.mesh import Mesh
from viewer.rigs.motion.clip import Channel, Clip, evaluate
from viewer.rigs.motion.sampled_animation import SampledAnimation, sample_animation
from viewer.rigs.scene import Actor
from viewer.rigs.skin import skin_from_entries, skin_from_lists

TOLD = 5e-3  # messages have three digits


def write(animation: SampledAnimation, folder: Path, kind: str, name: str) -> list[Diagnostic]:
    return export_frames(animation, folder / name, kind, ExportOptions())


def swinging(extrapolation=("constant", "constant"), end=4.0, times=(0.0, 1, 2, 3, 4)) -> Actor:
    """Return an arm of a metre that swings about z by 2 radians, with one key per second."""
    rows = [(0, kind, 0.0) for kind in ("tx", "ty", "tz", "x", "y", "z")]
    rows += [(1, kind, 0.0) for kind in ("x", "y", "z")]
    skeleton = hand_made.skeleton([-1, 0], rows, None, [[0.0] * 3, [1.0, 0, 0]])
    values = np.array([0.0, 2, 0, -2, 0])[: len(times)]
    pairs = (("smooth", "smooth"),) * len(times)
    turn = Channel(5, np.array(times, dtype=float), values, pairs, extrapolation)
    others = [Channel(dof, np.zeros(0), np.zeros(0), ()) for dof in (0, 1, 2, 3, 4, 6, 7, 8)]
    channels = (*others[:5], turn, *others[5:])
    return Actor(Figure("arm", skeleton=skeleton), clip=Clip("swing", channels, 0.0, end))


def densest(actor: Actor, rate: float) -> float:
    """Return the distance of the arm tip from linear interpolation of angles, sampled at 20 kHz."""
    times = np.linspace(0.0, actor.clip.end, int(actor.clip.end * 20000) + 1)
    frames = np.arange(int(np.floor(actor.clip.end * rate + 1e-9)) + 1) / rate
    times = times[times <= frames[-1]]
    turn = actor.clip.channels[5]
    straight = np.interp(times, frames, evaluate(turn, frames))
    return float(np.max(2.0 * np.abs(np.sin(0.5 * (evaluate(turn, times) - straight)))))


def error_between(notes: list[Diagnostic]) -> Diagnostic:
    """Return the only error between frames."""
    between_frames = "the motion between frames"
    (note,) = [note for note in notes if note.values.get("original") == between_frames]
    return note


def between(notes: list[Diagnostic]) -> float:
    """Return the difference of joints between frames, in units."""
    note = error_between(notes)
    assert note.values["estimate"] == ""
    return note.values["joint"].values["distance"]


@pytest.mark.parametrize(("kind", "name"), [("bvh", "a.bvh"), ("gltf", "a.glb")])
def test_loss_between_keys_on_frames_is_reported(tmp_path, kind, name):
    """From 0 to 2 with slopes 2 and 0, the curve is 2 u^2 (1 - u) above the line: 8/27 at 2/3."""
    notes = write(sample_animation(swinging(), 1.0), tmp_path, kind, name)
    assert between(notes) == pytest.approx(2.0 * np.sin(4.0 / 27.0), rel=TOLD)


@pytest.mark.parametrize("rate", [0.99, 2.0, 2.7, 30.0])
def test_loss_between_frames_matches_dense_sampling(tmp_path, rate):
    actor = swinging()
    size = pytest.approx(densest(actor, rate), rel=TOLD)
    assert between(write(sample_animation(actor, rate), tmp_path, "bvh", "a.bvh")) == size


@pytest.mark.parametrize("mode", ["cycle", "cycle_offset", "bounce"])
def test_loss_of_repeating_curves_is_reported(tmp_path, mode):
    """A clip of 40 s repeats three keys within 1.9 s, with kinks and jumps."""
    actor = swinging((mode, mode), 40.0, (0.0, 0.3, 1.9))
    size = pytest.approx(densest(actor, 1.0), rel=TOLD)
    assert between(write(sample_animation(actor, 1.0), tmp_path, "bvh", "a.bvh")) == size


def test_curve_that_repeats_too_often_is_an_estimate(tmp_path):
    """Of 20,000 repetitions in 40 s, whose keys are 1 ms apart, only some can be compared."""
    actor = swinging(("constant", "cycle"), 40.0, (0.0, 0.001, 0.002))
    note = error_between(write(sample_animation(actor, 1.0), tmp_path, "bvh", "a.bvh"))
    assert note.values["estimate"].sentence == "an estimate from {n}"


def test_peak_at_the_end_of_a_likely_span_is_refined(tmp_path, monkeypatch):
    """A curve from 0 to 1 in half a second, slopes 4 and -0.2, is 2 u - 0.9 u^2 - 0.1 u^3.

    Its maximum, where 2 - 1.8 u - 0.3 u^2 = 0, is just before the key. The next likely span is ten
    seconds later.
    """
    errors = "viewer.exporters._losses.motion_errors"
    monkeypatch.setattr(f"{errors}._MOST", 14)  # as many as spans: 7 steps for each likely one
    monkeypatch.setattr(f"{errors}._LIKELY", 2)
    actor = swinging(end=12.0)
    times = np.array([0.0, 0.5, 1.0, 10.0, 10.5, 11.0])
    values = np.array([0.0, 1.0, 0.0, 0.0, 0.9, 0.0])
    slopes = ((0.0, 4.0), (-0.2, -0.2), (0.0, 0.0), (0.0, 3.6), (-0.18, -0.18), (0.0, 0.0))
    channels = list(actor.clip.channels)
    channels[5] = Channel(5, times, values, slopes)
    actor = Actor(actor.figure, clip=replace(actor.clip, channels=tuple(channels)))
    note = error_between(write(sample_animation(actor, 1.0), tmp_path, "bvh", "a.bvh"))
    u = (np.sqrt(1.8**2 + 4.0 * 0.3 * 2.0) - 1.8) / 0.6
    largest = 2.0 * u - 0.9 * u**2 - 0.1 * u**3
    assert note.values["estimate"] != ""
    found = note.values["joint"].values["distance"]
    assert found == pytest.approx(2.0 * np.sin(0.5 * largest), rel=1e-6)


def test_vertex_loss_between_frames_is_reported(tmp_path):
    """The vertex is three metres away from the rotating joint that it follows."""
    actor = swinging()
    mesh = Mesh(np.diag([3.0, 1, 1]), np.eye(3), np.array([[0, 1, 2]]))
    skin = skin_from_lists([[(0, 1.0)]] * 3, np.tile(np.eye(4), (2, 1, 1)))
    figure = replace(actor.figure, mesh=mesh, skin=skin, unit="m")
    notes = write(sample_animation(Actor(figure, clip=actor.clip), 1.0), tmp_path, "gltf", "a.glb")
    note = error_between(notes)
    joint, vertex = note.values["joint"].values, note.values["vertex"].values
    size = 2.0 * np.sin(4.0 / 27.0)
    assert (joint["joint"], vertex["vertex"]) == ("j1", 0)
    found = [joint["distance"], vertex["distance"]]
    assert found == pytest.approx([size, 3.0 * size], rel=TOLD)


@pytest.mark.slow
def test_motions_too_long_to_check_are_reported(tmp_path):
    """Two minutes at 20 fps have too many frame intervals to sample all."""
    actor = swinging(end=120.0)
    notes = write(sample_animation(actor, 20.0), tmp_path, "bvh", "a.bvh")
    note = error_between(notes)
    assert note.values["estimate"].sentence == "an estimate from {n}"
    assert note.values["joint"].values["distance"] == pytest.approx(densest(actor, 20.0), rel=TOLD)


JOINTS, VERTICES, FRAMES = 5, 700, 60  # more vertices than a block, all vertices in all frames


def body(rng, shapes: int = 0, corrected: bool = False, raw: float = 0.0) -> Body:
    owners = np.repeat(np.arange(VERTICES), 3)
    joints = rng.integers(0, JOINTS + 1, len(owners))
    weights = rng.uniform(0.1, 1.0, (VERTICES, 3))
    weights *= rng.uniform(1 - raw, 1 + raw, (VERTICES, 1)) / weights.sum(axis=1, keepdims=True)
    bound = np.tile(np.eye(4), (JOINTS + 1, 1, 1))
    return Body(
        rng.normal(size=(VERTICES, 3)),
        skin_from_entries(VERTICES, owners, joints, weights.ravel(), bound),
        rng.normal(size=(shapes, VERTICES, 3)) if shapes else None,
        rng.normal(0, 0.02, (9 * (JOINTS - 1), VERTICES, 3)) if corrected else None,
    )


def poses(rng, of: Body, far: float = 0.0) -> Poses:
    palette = np.zeros((FRAMES, JOINTS + 1, 4, 4))
    palette[..., :3, :3] = 1.25 * rotation_vector_to_matrix(
        rng.normal(0, 0.7, (FRAMES, JOINTS + 1, 3))
    )
    palette[..., :3, 3] = rng.normal(far, 0.5, (FRAMES, JOINTS + 1, 3))
    palette[..., 3, 3] = 1.0
    shapes = 0 if of.shapes is None else len(of.shapes)
    turns = 0 if of.correctives is None else len(of.correctives)
    return Poses(
        palette[:, :JOINTS, :3, 3],
        palette,
        rng.normal(far, 1.0, (FRAMES, 3)),
        rng.normal(0, 0.1, (FRAMES, shapes)),
        rng.normal(0, 0.5, (FRAMES, turns)),
    )


def moved(of: Body, by: Poses) -> np.ndarray:
    """Return the vertices by the formula with a dense weight matrix, (F, V, 3)."""
    dense = np.zeros((VERTICES, JOINTS + 1))
    owners = np.repeat(np.arange(VERTICES), np.diff(of.skin.starts))
    np.add.at(dense, (owners, of.skin.joints), of.skin.weights)
    rest = np.broadcast_to(of.positions, (FRAMES, VERTICES, 3)).copy()
    for directions, weights in ((of.shapes, by.weights), (of.correctives, by.corrective_weights)):
        if directions is not None and weights.shape[1]:
            rest += np.einsum("fs,sva->fva", weights, directions)
    points = np.concatenate([rest, np.ones((FRAMES, VERTICES, 1))], axis=2)
    return np.einsum("vj,fjab,fvb->fva", dense, by.palette[..., :3, :], points) + by.shifts[:, None]


def changed(rng, by: Poses, amount: float) -> Poses:
    palette = by.palette.copy()
    palette[..., :3, :] += rng.normal(0, amount, palette[..., :3, :].shape)
    return replace(by, palette=palette, places=by.places + rng.normal(0, amount, by.places.shape))


def pairs():
    """Yield pairs as in exporters, with different joints, weights, shapes or correctives."""
    rng = np.random.default_rng(3)
    plain = body(rng)
    own = poses(rng, plain)
    yield "joints", plain, own, plain, changed(rng, own, 1e-3)
    raw = body(rng, raw=0.01)
    single = raw.skin.weights.astype(np.float32).astype(float)
    scaled = replace(raw, skin=replace(raw.skin, weights=single * 0.99))
    yield "weights", raw, own, scaled, own
    yield "far away", raw, poses(rng, raw, 300.0), scaled, poses(rng, raw, 300.0)
    full = body(rng, shapes=2, corrected=True)
    all_of_it = poses(rng, full)
    bare = Body(full.positions, full.skin)
    still = replace(all_of_it, weights=np.zeros((1, 0)), corrective_weights=np.zeros((FRAMES, 0)))
    yield "rest", full, all_of_it, bare, still
    other = replace(
        all_of_it,
        corrective_weights=all_of_it.corrective_weights + 1e-3,
        weights=all_of_it.weights * 0.9,
    )
    yield "less", full, all_of_it, full, changed(rng, other, 0.02)
    strayed = replace(full, shapes=full.shapes * 1.01, positions=full.positions + 1e-3)
    yield "strayed", full, all_of_it, strayed, changed(rng, all_of_it, 1e-6)


CASES = list(pairs())


@pytest.mark.parametrize("case", CASES, ids=lambda case: case[0])
@pytest.mark.parametrize("least", [0.0, 1e-4])
def test_the_maximum_is_over_all_frames_and_vertices(case, least):
    _, first, one, second, other = case
    sides = [
        Side(of, lambda rows, by=by: poses_of(by, rows))
        for of, by in ((first, one), (second, other))
    ]
    found = apart(*sides, np.arange(FRAMES), least)
    off = np.linalg.norm(moved(first, one) - moved(second, other), axis=2)
    frame, vertex = np.unravel_index(off.argmax(), off.shape)
    assert (found.vertices.frame, found.vertices.index) == (frame, vertex)
    assert found.vertices.distance == pytest.approx(off.max(), rel=1e-9)
    gaps = np.linalg.norm(one.places - other.places, axis=2)
    if gaps.max() <= least:
        assert found.joints is None
    else:
        assert found.joints.distance == pytest.approx(gaps.max(), rel=1e-12)
    assert (found.looked, found.frames) == (FRAMES, FRAMES)


def test_differences_below_rounding_are_zero():
    rng = np.random.default_rng(1)
    plain = body(rng)
    own = poses(rng, plain)
    near = changed(rng, own, 1e-9)
    sides = [Side(plain, lambda rows, by=by: poses_of(by, rows)) for by in (own, near)]
    found = apart(*sides, np.arange(FRAMES), 1e-6)
    assert found.joints is None and found.vertices is None


def test_a_peak_between_the_regular_frames_is_found():
    """Of 2,000 frames, the joints move by up to 1 for 20 frames: the largest error is in one."""
    count, peak = 2000, 1234
    rng = np.random.default_rng(2)
    plain = body(rng)
    bump = np.exp(-0.5 * ((np.arange(count) - peak) / 5.0) ** 2)
    own = np.tile(np.eye(4), (count, JOINTS + 1, 1, 1))
    off = own.copy()
    off[:, 2, 0, 3] = bump
    none = np.zeros((count, 0))
    shifts = np.zeros((count, 3))
    sides = [
        Side(
            plain,
            lambda rows, m=m: poses_of(Poses(m[:, :JOINTS, :3, 3], m, shifts, none, none), rows),
        )
        for m in (own, off)
    ]
    found = apart(*sides, np.arange(count), 1e-6)
    assert (found.joints.frame, found.joints.index) == (peak, 2)
    assert found.joints.distance == pytest.approx(1.0)
    # The vertex with the largest weight of the joint moves farthest.
    weights = np.zeros(VERTICES)
    owners = np.repeat(np.arange(VERTICES), np.diff(plain.skin.starts))
    np.add.at(weights, owners, np.where(plain.skin.joints == 2, plain.skin.weights, 0.0))
    assert (found.vertices.frame, found.vertices.index) == (peak, weights.argmax())
    assert found.vertices.distance == pytest.approx(weights.max())


def test_a_bend_of_the_skin_between_the_regular_frames_is_found():
    """Joints agree; a blend shape moves one vertex by up to 1, at most in one frame of 2,000."""
    count, peak = 2000, 777
    plain = body(np.random.default_rng(4))
    shape = np.zeros((1, VERTICES, 3))
    shape[0, 33, 1], shape[0, 34, 1] = 1.0, 0.5
    rows = 0.5 * (1.0 + np.cos((np.arange(count) - peak) * 2.0 * np.pi / count))
    palette = np.tile(np.eye(4), (count, JOINTS + 1, 1, 1))
    places, shifts, none = palette[:, :JOINTS, :3, 3], np.zeros((count, 3)), np.zeros((count, 0))
    moved_by = Poses(places, palette, shifts, rows[:, None], none)
    still = Poses(places, palette, shifts, np.zeros((1, 0)), none)
    shaped = replace(plain, shapes=shape)
    sides = [
        Side(of, lambda at, by=by: poses_of(by, at))
        for of, by in ((shaped, moved_by), (plain, still))
    ]
    found = apart(*sides, np.arange(count), 1e-6)
    assert found.joints is None
    assert (found.vertices.frame, found.vertices.index) == (peak, 33)
    assert found.vertices.distance == pytest.approx(1.0)
