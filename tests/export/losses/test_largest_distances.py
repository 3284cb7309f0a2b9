"""The search for the vertex with the largest difference, compared with brute force."""

from dataclasses import replace

import numpy as np
import pytest

from viewer.export._losses.largest_distances import apart
from viewer.export._losses.posed_bodies import Body, Poses, Side, poses_of
from viewer.rig.geometry.rotation import rotation_vector_to_matrix
from viewer.rig.skin import skin_from_entries

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
