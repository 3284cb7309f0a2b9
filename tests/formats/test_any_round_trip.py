"""Any skeleton and any skinned mesh that hypothesis thinks of comes back from its file."""

import numpy as np
import pytest
from formats.round_trips import (
    INF,
    LARGEST,
    again,
    assert_equal_meshes,
    assert_equal_skeletons,
    assert_equal_skins,
    skeleton,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from viewer.formats import skel, skin
from viewer.rig.figure import Figure
from viewer.rig.mesh import Material, Mesh
from viewer.rig.skin import skin_from_lists

pytestmark = pytest.mark.slow


# Any figure

NUMBERS = st.floats(-LARGEST, LARGEST, allow_nan=False)
SMALL = st.floats(-10, 10)
LETTERS = st.characters(exclude_characters="{} \t\n\r\v\f\ud800", exclude_categories=["Cs"])
WORDS = st.text(LETTERS, min_size=1, max_size=6).filter(
    lambda word: word.encode() not in {*skel.KEYWORDS, b"texture"}
)
NAMES = st.lists(WORDS, max_size=3).map(" ".join)


@st.composite
def skeletons(draw):
    n_joints = draw(st.integers(1, 8))
    parents, path = [-1], [0]
    for joint in range(1, n_joints):
        # Depth-first: a parent is the joint before, one of its ancestors, or none.
        parent = draw(st.sampled_from([-1, *path]))
        path = [*path[: path.index(parent) + 1], joint] if parent >= 0 else [joint]
        parents.append(parent)
    bound = st.one_of(st.just(INF), st.floats(-99_999, 99_999))
    limits, dofs = [[-INF, INF]] * 3, [0.0] * 3
    for _ in range(3 * n_joints):
        low, high = -draw(bound), draw(bound)
        low, high = (low, high) if low <= high else (high, low)
        limits, dofs = [*limits, [low, high]], [*dofs, min(max(draw(NUMBERS), low), high)]
    triples = st.lists(NUMBERS, min_size=3, max_size=3)
    corners = st.lists(triples, min_size=2, max_size=2)
    return skeleton(
        parents,
        names=tuple(draw(st.lists(NAMES, min_size=n_joints, max_size=n_joints))),
        rest_translations=draw(st.lists(triples, min_size=n_joints, max_size=n_joints)),
        rest_dofs=dofs,
        dof_limits=limits,
        boxes=np.sort(draw(st.lists(corners, min_size=n_joints, max_size=n_joints)), axis=1),
    )


@st.composite
def skinned_meshes(draw):
    n_vertices, n_joints = draw(st.integers(1, 6)), draw(st.integers(1, 4))
    row = st.lists(NUMBERS, min_size=3, max_size=3)
    rows = st.lists(row, min_size=n_vertices, max_size=n_vertices)
    long_row = row.filter(lambda normal: max(map(abs, normal)) >= 1e-15)
    normals = st.lists(long_row, min_size=n_vertices, max_size=n_vertices)
    corner = st.integers(0, n_vertices - 1)
    triangles = draw(st.lists(st.tuples(corner, corner, corner), min_size=1, max_size=6))
    names = draw(st.lists(NAMES, max_size=3))
    indices = sorted(draw(st.integers(-1, len(names) - 1)) for _ in triangles)
    shape = Mesh(
        positions=draw(rows),
        normals=draw(normals),
        triangles=triangles,
        uvs=draw(st.none() | rows.map(lambda table: [row[:2] for row in table])),
        materials=tuple(Material(name) for name in names),
        triangle_materials=indices,
    )
    pair = st.tuples(st.integers(0, n_joints - 1), NUMBERS)
    influences = draw(
        st.lists(st.lists(pair, max_size=7), min_size=n_vertices, max_size=n_vertices)
    )
    bind = np.tile(np.eye(4), (n_joints, 1, 1))
    for joint in range(n_joints):
        # Far enough from singular for 1e-12: the diagonal dominates.
        tilt = draw(st.lists(st.floats(-0.2, 0.2), min_size=9, max_size=9))
        bind[joint, :3, :3] += np.reshape(tilt, (3, 3))
        bind[joint, :3, 3] = draw(st.lists(SMALL, min_size=3, max_size=3))
    return Figure("any", shape, skin=skin_from_lists(influences, np.linalg.inv(bind)))


@given(skeletons())
@settings(max_examples=150)
def test_any_skeleton_round_trips(wanted):
    found, warnings = again(Figure("any", skeleton=wanted), skel)
    assert warnings == []
    assert_equal_skeletons(found.skeleton, wanted)


@given(skinned_meshes())
@settings(max_examples=150)
def test_any_skin_round_trips(wanted):
    found, _ = again(wanted, skin)
    assert_equal_meshes(found.mesh, wanted.mesh)
    assert_equal_skins(found.skin, wanted.skin)
