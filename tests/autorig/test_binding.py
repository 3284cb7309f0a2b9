"""Binding of meshes to given skeletons, on bars whose weights are known."""

from dataclasses import replace

import numpy as np
import pytest
from autorig.rigged_shapes import arm, mesh_of, tube
from numpy.testing import assert_allclose
from scipy import sparse

from viewer.autorig.alignment.surface_alignment import AlignmentSettings
from viewer.autorig.pipeline import transfer
from viewer.autorig.settings import BINDING, TransferSettings
from viewer.autorig.weights.bone_weights import names_control
from viewer.autorig.weights.weight_transfer import WeightSettings
from viewer.errors import RigError
from viewer.progress import Cancelled, receiving
from viewer.rigs.figure import Figure
from viewer.rigs.file_record import FileRecord
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.pose import rest_pose
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skinning import deform


def box(low, high, cells):
    """Return a closed box as a grid of quads, split into triangles: positions, triangles."""
    low, high = np.array(low, dtype=float), np.array(high, dtype=float)
    points, faces, known = [], [], {}
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, 1):
            index = {}
            for i in range(cells[u] + 1):
                for j in range(cells[v] + 1):
                    place = [0, 0, 0]
                    place[axis], place[u], place[v] = side * cells[axis], i, j
                    key = tuple(place)
                    if key not in known:
                        known[key] = len(points)
                        points.append(low + (high - low) * np.array(place) / cells)
                    index[i, j] = known[key]
            for i in range(cells[u]):
                for j in range(cells[v]):
                    corners = [index[i, j], index[i + 1, j], index[i + 1, j + 1], index[i, j + 1]]
                    a, b, c, d = corners if side else corners[::-1]
                    faces += [(a, b, c), (a, c, d)]
    return np.array(points), np.array(faces, dtype=np.int32)


def joined(*parts):
    positions = np.concatenate([part[0] for part in parts])
    starts = np.cumsum([0, *(len(part[0]) for part in parts)])
    triangles = [part[1] + start for part, start in zip(parts, starts, strict=False)]
    return mesh_of(positions, np.concatenate(triangles))


def skeleton_of(joints):
    """Return a figure of joints {name: (parent, position)} without a mesh."""
    names = list(joints)
    parents = np.array([names.index(p) if p else -1 for p, _ in joints.values()], dtype=np.int32)
    places = np.array([place for _, place in joints.values()], dtype=float)
    return Figure("bare", skeleton=ball_skeleton(tuple(names), parents, places))


def bound(figure, mesh, method="heat", **alignment):
    how = TransferSettings(method=method, alignment=AlignmentSettings(**alignment))
    return transfer(figure, rest_pose(figure.skeleton), mesh, how)


def weights_of(rigged):
    skin = rigged.figure.skin
    shape = (skin.n_vertices, skin.n_joints)
    return sparse.csr_array((skin.weights, skin.joints, skin.starts), shape=shape).toarray()


def of(rigged, name):
    return weights_of(rigged)[:, rigged.figure.skeleton.names.index(name)]


BAR = box((-0.1, 0.0, -0.1), (0.1, 2.0, 0.1), (2, 40, 2))
CHAIN = {"base": ("", (0, 0.05, 0)), "middle": ("base", (0, 1, 0)), "end": ("middle", (0, 1.9, 0))}


@pytest.mark.parametrize("method", BINDING)
def test_bound_bar_follows_the_bone_inside_and_shares_at_the_joint(method):
    mesh = joined(BAR)
    figure = skeleton_of(CHAIN)
    rigged = bound(figure, mesh, method)
    assert_allclose(weights_of(rigged).sum(axis=1), 1.0, atol=1e-12)
    height, base = mesh.positions[:, 1], of(rigged, "base")
    assert base[height < 0.6].min() > 0.95 and base[height > 1.4].max() < 0.05
    # Around the joint, both bones are equally near, as the bar is symmetric there.
    assert_allclose(base[np.abs(height - 1.0) < 1e-9], 0.5, atol=0.06)
    # The result is the mesh itself, and the skeleton as it was given.
    assert rigged.figure.skeleton is figure.skeleton
    assert_allclose(deform(rigged.figure, rigged.pose)[0], mesh.positions, atol=1e-12)
    assert str(rigged.lines[0]) == "skeleton: not moved, 2 of 2 joints inside the mesh"


@pytest.mark.parametrize("method", BINDING)
def test_binding_again_after_an_edit_gives_what_a_first_binding_gives(method):
    mesh = joined(box([-2, -0.3, -0.3], [2, 0.3, 0.3], (16, 3, 3)))
    ends = {"a": ("", [-1.8, 0, 0]), "b": ("a", [0, 0, 0]), "c": ("b", [1.5, 0, 0])}
    bound(skeleton_of(ends), mesh, method)
    moved = skeleton_of({**ends, "b": ("a", [0.7, 0.1, 0])})
    again = weights_of(bound(moved, mesh, method))
    first = weights_of(bound(moved, replace(mesh), method))
    assert_allclose(again, first, atol=1e-12)


def test_geodesic_weights_fall_off_with_the_eighth_power_of_the_distance():
    mesh = joined(BAR)
    figure = skeleton_of(CHAIN)
    base = of(bound(figure, mesh, "voxel"), "base")
    rows = np.flatnonzero(
        (np.abs(mesh.positions[:, 1] - 1.1) < 1e-9) & (np.abs(mesh.positions[:, 0]) < 1e-9)
    )
    # Straight ways: 0.1 to the bone beside it, sqrt(0.1^2 + 0.1^2) to the end of the other. Paths
    # over voxels are up to 8 % longer, which the eighth power nearly doubles.
    expected = (0.1 / np.hypot(0.1, 0.1)) ** 8
    assert ((0.4 * expected < base[rows]) & (base[rows] < 2.5 * expected)).all()


def test_heat_does_not_cross_the_gap_between_two_legs():
    left = box((-0.26, 0.0, -0.1), (-0.06, 1.0, 0.1), (3, 20, 3))
    right = box((0.06, 0.0, -0.1), (0.26, 1.0, 0.1), (3, 20, 3))
    hip = box((-0.3, 1.0, -0.12), (0.3, 1.6, 0.12), (8, 8, 3))
    joints = {"root": ("", (0, 1.4, 0))}
    for side, x in (("left", -0.16), ("right", 0.16)):
        joints[f"{side}_hip"] = "root", (x, 1.05, 0)
        joints[f"{side}_knee"] = f"{side}_hip", (x, 0.5, 0)
        joints[f"{side}_foot"] = f"{side}_knee", (x, 0.05, 0)
    mesh = joined(left, right, hip)
    rigged = bound(skeleton_of(joints), mesh)
    leg = (mesh.positions[:, 0] < 0) & (mesh.positions[:, 1] < 0.9)
    for name in ("right_hip", "right_knee", "right_foot"):
        assert of(rigged, name)[leg].max() == 0.0
    shin = leg & (np.abs(mesh.positions[:, 1] - 0.25) < 0.1)
    assert of(rigged, "left_knee")[shin].min() > 0.8


def test_small_separate_part_moves_rigidly_and_is_named():
    button = box((-0.02, 1.4, 0.11), (0.02, 1.44, 0.13), (1, 1, 1))
    mesh = joined(BAR, button)
    for method in BINDING:
        rigged = bound(skeleton_of(CHAIN), mesh, method)
        assert (of(rigged, "middle")[-8:] == 1.0).all()
        (line,) = (str(line) for line in rigged.lines if line.code == "R007")
        assert line == (
            f"the part of 8 vertices at vertex {len(BAR[0])} moves rigidly with joint middle, as "
            "it is nearest to one bone or cannot bend"
        )


@pytest.mark.parametrize("method", BINDING)
def test_small_part_follows_the_surface_beneath_where_another_bone_is_nearest(method):
    # The bar has vertices at y = 2/3 and 4/3, so that its surface at 1.05 moves mostly with the
    # upper joint, which is at 1.1: the nearest bone is the lower one.
    bar = box((-0.1, 0.0, -0.1), (0.1, 2.0, 0.1), (2, 3, 2))
    button = box((-0.02, 1.03, 0.11), (0.02, 1.07, 0.13), (1, 1, 1))
    chain = {**CHAIN, "middle": ("base", (0, 1.1, 0))}
    rigged = bound(skeleton_of(chain), joined(bar, button), method)
    found = of(rigged, "middle")
    is_front = (np.abs(bar[0][:, 0]) < 1e-9) & (bar[0][:, 2] > 0.0)
    low, high = (found[:-8][is_front & (np.abs(bar[0][:, 1] - y) < 1e-9)] for y in (2 / 3, 4 / 3))
    # Linear between the rings, of which the one on the other side of the face adds a little.
    expected = low + (high - low) * (1.05 - 2 / 3) / (2 / 3)
    assert expected > 0.5
    assert_allclose(found[-8:], expected[0], atol=0.02)
    assert np.ptp(weights_of(rigged)[-8:], axis=0).max() < 1e-12
    (line,) = (str(line) for line in rigged.lines if line.code == "R007")
    assert line.startswith("1 small part moves with the surface beneath, ")


@pytest.mark.parametrize("method", BINDING)
def test_part_that_two_sides_share_moves_with_the_joint_above_both(method):
    # A beam rests on two posts: without a vertex between its ends, it cannot bend. About a quarter
    # is nearest to the joint in its middle, and more to each side.
    posts = [box((x - 0.1, 0, -0.1), (x + 0.1, 1.0, 0.1), (2, 10, 2)) for x in (-0.9, 0.9)]
    beam = box((-1.0, 0.98, -0.08), (1.0, 1.18, 0.08), (1, 1, 1))
    joints = {"middle": ("", (0, 1.08, 0))}
    for name, x in (("left", -1.0), ("right", 1.0)):
        joints |= {name: ("middle", (0.25 * x, 1.08, 0)), name + "_2": (name, (0.9 * x, 1.08, 0)),
                   name + "_end": (name + "_2", (0.9 * x, 0.1, 0))}  # fmt: skip
    rigged = bound(skeleton_of(joints), joined(*posts, beam), method)
    assert (of(rigged, "middle")[-8:] == 1.0).all()
    idle = [name for name in ("middle", "left", "left_2", "right", "right_2")
            if not of(rigged, name).any()]  # fmt: skip
    assert "right" in idle and "middle" not in idle
    (line,) = [str(line) for line in rigged.lines if "no weights" in str(line)]
    assert line.startswith(f"no weights: {', '.join(idle)}; the parts of the mesh around ")
    # Of one line of joints, none is above branches: the part keeps its weights.
    line = box((-0.1, 0.0, -0.1), (0.1, 2.0, 0.1), (1, 1, 1))
    shared = bound(skeleton_of(CHAIN), joined(line, box((3, 0, 0), (3.1, 0.1, 0.1), (1, 1, 1))))
    assert (of(shared, "base")[:8] < 1.0).any()


def test_skeleton_at_one_point_or_far_smaller_than_the_mesh_is_named_so():
    mesh = joined(BAR)
    tiny = {name: (above, np.multiply(place, 1e-5) + 7) for name, (above, place) in CHAIN.items()}
    point = {name: (above, (7.0, 7, 7)) for name, (above, _) in CHAIN.items()}
    for joints, said in ((tiny, "over 1000 times smaller than the mesh"), (point, "at one point")):
        with pytest.raises(RigError, match=f"found 0 of 2 there and a skeleton {said}"):
            bound(skeleton_of(joints), mesh, scale="none")


def test_mesh_with_both_sides_of_each_triangle_is_bound_like_one_with_one():
    positions, triangles = BAR
    both = mesh_of(positions, np.concatenate([triangles, triangles[:, ::-1]]))
    expected = weights_of(bound(skeleton_of(CHAIN), joined(BAR)))
    assert_allclose(weights_of(bound(skeleton_of(CHAIN), both)), expected, atol=1e-12)


def test_roots_on_the_ground_and_controls_get_no_weights():
    high = BAR[0] + [0.0, 1.0, 0.0], BAR[1]
    joints = {"Root": ("", (0.0, 0, 0)), **{k: (p or "Root", np.add(at, [0, 1, 0]))
              for k, (p, at) in CHAIN.items()},
              "IK-middle": ("Root", (0, 2.0, 0)), "PoleTarget": ("Root", (0, 2, 3.0))}  # fmt: skip
    rigged = bound(skeleton_of(joints), joined(high))
    for name in ("Root", "IK-middle", "PoleTarget"):
        assert of(rigged, name).max() == 0.0
    assert not [line for line in rigged.lines if line.code == "R009"]
    line = next(str(line) for line in rigged.lines if line.code == "R008")
    assert line == (
        "3 joints bound; no bone in the mesh, so no weights: Root, IK-middle, PoleTarget"
    )


@pytest.mark.parametrize("name", ["左足ＩＫ", "rig:IK_foot.L", "mchSpine", "PoleTarget.001"])
def test_names_of_controls_are_known_in_any_script_and_namespace(name):
    skeleton = ball_skeleton(("左足", name), np.array([-1, 0], dtype=np.int32), np.eye(3)[:2])
    assert names_control(skeleton).tolist() == [False, True]


def test_joint_named_like_a_control_without_a_counterpart_is_bound():
    joints = {**CHAIN, "IKend": ("base", (0, 1.9, 0))}
    del joints["end"]
    rigged = bound(skeleton_of(joints), joined(BAR))
    top = rigged.figure.mesh.positions[:, 1] > 1.95
    assert of(rigged, "IKend")[top].min() > 0.2


@pytest.mark.parametrize(("factor", "said"), [(100.0, "scale 100,"), (0.0254, "scale 0.0254,")])
def test_skeleton_in_another_unit_is_scaled_to_the_mesh(factor, said):
    mesh = joined((factor * BAR[0], BAR[1]))
    rigged = bound(skeleton_of(CHAIN), mesh)
    assert said in str(rigged.lines[0])
    assert "2 of 2 joints inside the mesh" in str(rigged.lines[0])
    assert_allclose(rigged.figure.skeleton.rest_translations[1], [0, 0.95 * factor, 0])
    assert_allclose(deform(rigged.figure, rigged.pose)[0], mesh.positions, atol=1e-9 * factor)
    if factor < 1.0:
        with pytest.raises(RigError, match="0 of 2 there and a skeleton 18 times as large"):
            bound(skeleton_of(CHAIN), mesh, scale="none")


def test_mesh_with_another_up_axis_is_rotated_to_the_skeleton():
    turned = BAR[0][:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    mesh = joined((turned, BAR[1]))
    for options in ({}, {"up": "z"}):
        rigged = bound(skeleton_of(CHAIN), mesh, **options)
        assert "rotation 90.00 degrees" in str(rigged.lines[0])
        again = apply_transform(rigged.placement, deform(rigged.figure, rigged.pose)[0])
        assert_allclose(again, turned, atol=1e-12)
        # The skeleton keeps its own axes, in which its motions and limits are.
        assert_allclose(rigged.figure.skeleton.rest_translations[1], [0, 0.95, 0], atol=1e-12)


def test_skeleton_with_its_root_at_the_origin_is_moved_into_the_mesh():
    # As in many .bvh files: the root belongs at a height of 1, with bones in both directions.
    joints = {"hips": ("", (0, 0, 0)), "chest": ("hips", (0, 0.5, 0)),
              "head": ("chest", (0, 0.9, 0)), "knee": ("hips", (0, -0.5, 0)),
              "foot": ("knee", (0, -0.9, 0))}  # fmt: skip
    mesh = joined((BAR[0] + [3.0, 5.0, 0.0], BAR[1]))
    rigged = bound(skeleton_of(joints), mesh)
    assert str(rigged.lines[0]).endswith("4 of 4 joints inside the mesh, 0 where it was")
    # The middle of the bar, to within a voxel, a 96th of its length.
    assert_allclose(rigged.figure.skeleton.rest_translations[0], [3, 6, 0], atol=2.0 / 96)


@pytest.mark.parametrize(
    ("unit", "half", "warned"),
    [("", 1.0, False), ("", 0.9, True), ("cm", 100.0, False), ("cm", 90.0, True)],
)
def test_skeleton_with_a_margin_is_said_to_be_too_small(unit, half, warned):
    # As of a network that scales the mesh to 2, or to 1.8: joints at 5 % and 97.5 % of a bar. In a
    # .fbx file of Blender, these are metres, stored as centimetres.
    bar = mesh_of(*box((20, -1, -1), (40, 1, 1), (20, 2, 2)))
    root, middle, tip = ((half * x, 0.0, 0.0) for x in (-0.9, 0.0, 0.95))
    bare = skeleton_of({"a": ("", root), "b": ("a", middle), "c": ("b", tip)})
    rigged = bound(replace(bare, unit=unit), bar)
    assert f"scale {0.1 if unit else 10}," in str(rigged.lines[0])
    said = [line for line in rigged.lines if "may be too small" in str(line)]
    assert [line.code for line in said] == ["R002"] * warned


def test_skeleton_elsewhere_is_refused_and_placed_by_landmarks():
    moved = {name: (above, np.add(place, [7.0, 0, 0])) for name, (above, place) in CHAIN.items()}
    moved["side"] = ("base", (7.6, 0.5, 0.05))
    moved["other"] = ("base", (6.1, 0.5, 0.05))
    figure, mesh = skeleton_of(moved), joined(BAR)
    with pytest.raises(RigError, match="found 0 of 4 there and a skeleton"):
        bound(figure, mesh)
    points = figure.skeleton.rest_translations
    worlds = np.array([points[0], points[0] + points[1], points[0] + points[3]])
    pairs = np.stack([worlds, worlds - [7.0, 0, 0]], axis=1)
    rigged = bound(figure, mesh, landmarks=pairs)
    assert "translation (-7, 0, 0); 2 of 4 joints" in str(rigged.lines[0])
    assert_allclose(rigged.figure.skeleton.rest_translations[0], [0, 0.05, 0], atol=1e-9)


def test_figure_binds_only_the_joints_that_have_weights_in_its_own_mesh():
    figure = arm()
    positions, triangles = tube()
    mesh = mesh_of(positions, triangles)
    every = bound(replace(figure, mesh=None, skin=None), mesh)
    assert (weights_of(every) > 0.5).any(axis=0).all()
    skin = figure.skin
    only = replace(skin, weights=np.where(skin.joints == 1, 0.0, skin.weights))
    assert of(bound(replace(figure, skin=only), mesh), "tip").max() == 0.0


def test_nodes_of_rigid_parts_are_no_bones():
    joints = {**CHAIN, "cape": ("base", (0.05, 1.3, 0))}
    mesh = joined(BAR)
    figure = bound(skeleton_of(joints), mesh).figure
    assert of(bound(figure, mesh), "cape").max() > 0.9
    parts = replace(mesh, parts=("cape",), triangle_parts=np.zeros(mesh.n_triangles))
    skinned = replace(figure, mesh=parts, record=FileRecord())
    rigged = bound(skinned, mesh)
    assert of(rigged, "cape").max() == 0.0
    assert_allclose(weights_of(rigged)[:, :3], weights_of(bound(skeleton_of(CHAIN), mesh)))


def test_limits_influences_and_posed_skeletons_are_kept():
    figure = replace(arm(limit=1.0), mesh=None, skin=None)
    pose = rest_pose(figure.skeleton)
    pose.dofs[8] = 0.3
    pose.dofs[5] = 0.1
    mesh = mesh_of(*tube())
    how = TransferSettings(method="heat", weights=WeightSettings(max_influences=1))
    rigged = transfer(figure, pose, mesh, how)
    assert (np.diff(rigged.figure.skin.starts) == 1).all()
    assert_allclose(rigged.figure.skeleton.dof_limits, figure.skeleton.dof_limits)
    assert_allclose(rigged.pose.dofs, pose.dofs)
    assert_allclose(deform(rigged.figure, pose)[0], mesh.positions, atol=1e-12)


def test_binding_can_be_cancelled():
    def cancel(done, total, unit, what):
        if "voxel" not in what:
            raise Cancelled

    with pytest.raises(Cancelled), receiving(cancel):
        bound(skeleton_of(CHAIN), joined(BAR), "voxel")
