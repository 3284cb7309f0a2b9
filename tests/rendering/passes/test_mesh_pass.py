"""Skinned meshes on the GPU: normals, placements, correctives and body models."""

import moderngl
import numpy as np
import pytest
from builders import family_figure
from formats.mhr.mhr_files import write as write_mhr
from formats.skel_body.skel_files import arrays as skel
from formats.smpl.quaternion_files import star, supr
from numpy.testing import assert_allclose
from rendering.drawn_figures import group_of, random_pose, skeleton, sphere
from rendering.front_view import alone, drawn, front_view, grid_figure

import viewer
from viewer.formats import Source, read
from viewer.rendering.camera import Camera
from viewer.rendering.gpu import corrective_sums
from viewer.rendering.gpu.corrective_sums import WAYS
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.posed_mesh import PosedMesh
from viewer.rendering.gpu.program import Programs
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.instance_pass import InstanceBuffers
from viewer.rendering.passes.joint_pass import JointPass, SkeletonBuffers
from viewer.rendering.view import View, normal_matrix
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.scene import Actor
from viewer.rigs.shape import pose_weights
from viewer.rigs.skin import Skin, skin_from_lists
from viewer.rigs.skinning import METHODS, Skinning

HOW = [Skinning("lbs"), Skinning("dqs"), Skinning("mix", blend_factor=0.3)]


assert {how.method for how in HOW} == set(METHODS)


TOLERANCE = 1e-5  # relative to a unit normal
N_JOINTS = 4
SCALES = [(1.0, 4.0, 0.5), (2.0, 2.0, 2.0), (-1.0, 1.0, 1.0), (1e-12, 3e-12, 2e-12)]


def ball() -> Figure:
    """Return a sphere in which each vertex follows two of four joints at the centre."""
    shape = sphere(rings=8)
    rng = np.random.default_rng(0)
    pairs = [
        [(int(first), 0.7), (int(first + 1) % N_JOINTS, 0.3)]
        for first in rng.integers(0, N_JOINTS, shape.n_vertices)
    ]
    joints = skeleton([-1, 0, 1, 0], np.zeros((N_JOINTS, 3)))
    skin: Skin = skin_from_lists(pairs, np.tile(np.eye(4), (N_JOINTS, 1, 1)))
    return Figure("ball", shape, joints, skin)


@pytest.mark.parametrize("how", HOW, ids=lambda how: how.method)
@pytest.mark.parametrize("scales", SCALES, ids=str)
def test_scaled_joints_match_the_reference(ctx, how, scales):
    figure = ball()
    mesh = PosedMesh(ctx, Programs(ctx), MeshBuffers(ctx, figure, []))
    rng = np.random.default_rng(1)
    for joint in range(N_JOINTS):
        pose = random_pose(figure.skeleton, rng, reach=0.6)
        pose.scales[joint] = scales
        mesh.update(pose, how)
        wanted = viewer.deform(figure, pose, how)[1]
        assert np.abs(mesh.read()[1] - wanted).max() <= TOLERANCE
    mesh.release()
    mesh.mesh.release()
    mesh.programs.release()


def test_normals_of_a_scaled_sphere_are_those_of_an_ellipsoid(ctx):
    figure = ball()
    mesh = PosedMesh(ctx, Programs(ctx), MeshBuffers(ctx, figure, []))
    pose = viewer.rest_pose(figure.skeleton)
    pose.scales[0] = 1.0, 3.0, 0.5
    for how in HOW:
        mesh.update(pose, how)
        expected = unit(figure.mesh.positions / [1.0, 3.0, 0.5])
        assert np.abs(mesh.read()[1] - expected).max() <= TOLERANCE
    mesh.release()
    mesh.mesh.release()
    mesh.programs.release()


def test_rigid_poses_never_compile_the_program_for_scaled_joints(ctx, monkeypatch):
    compiled = []
    original = Programs.feedback

    def feedback(self, name, chunk, outputs, macros=()):
        compiled.append("AFFINE_PALETTE" in macros)
        return original(self, name, chunk, outputs, macros)

    monkeypatch.setattr(Programs, "feedback", feedback)
    figure = ball()
    mesh = PosedMesh(ctx, Programs(ctx), MeshBuffers(ctx, figure, []))
    rng = np.random.default_rng(2)
    for _ in range(3):
        mesh.update(random_pose(figure.skeleton, rng))
    mesh.update(None)
    assert compiled and not any(compiled)
    pose = viewer.rest_pose(figure.skeleton)
    pose.scales[2] = 1.0, 2.0, 1.0
    mesh.update(pose)
    assert compiled[-1] is True
    mesh.release()
    mesh.mesh.release()
    mesh.programs.release()


@pytest.mark.parametrize("how", HOW, ids=lambda how: how.method)
def test_buffers_distinguish_scaled_instances_from_rigid_ones(ctx, how):
    figure = ball()
    rng = np.random.default_rng(3)
    actors = [Actor(figure, random_pose(figure.skeleton, rng, reach=0.6)) for _ in range(5)]
    # The split of a reflection is unique only if one singular value is the smallest.
    for actor, scales in zip(actors[1:4], [*SCALES[:2], (-0.5, 1.0, 2.0)], strict=True):
        actor.pose.scales[1] = scales
    programs, buffers = Programs(ctx), MeshBuffers(ctx, figure, [])
    instances = InstanceBuffers(ctx, programs, buffers)
    instances.vertices.reserve(len(actors))
    instances.update(group_of(actors), how)
    program = programs.feedback("mesh", "", ("v_normal",), ("INSTANCED",))
    instances.use(program, View(np.eye(4), np.eye(4), Camera()))
    count = buffers.n_vertices
    out = ctx.buffer(reserve=12 * count * len(actors))
    array = instances.array(program)
    array.transform(out, moderngl.POINTS, vertices=count, instances=len(actors))
    normals = np.frombuffer(out.read(), "f4").reshape(len(actors), count, 3).astype(float)
    for actor, found in zip(actors, normals[:, buffers.copies], strict=True):
        wanted = viewer.deform(figure, actor.pose, how)[1]
        assert np.abs(unit(found) - wanted).max() <= TOLERANCE
    for item in (out, instances, buffers, programs):
        item.release()


def test_faces_of_sheared_boxes_have_the_inverse_transposed_normal(ctx):
    joints = skeleton([-1, 0], np.zeros((2, 3)))
    figure = Figure("boxes", skeleton=joints)
    pose = viewer.rest_pose(joints)
    pose.scales[0] = 1.0, 4.0, -0.5
    pose.dofs[5] = 0.7  # about z of the second joint
    joint_pass = JointPass(ctx, Programs(ctx))
    joints_on_gpu = SkeletonBuffers(ctx, figure, joint_pass.cube)
    joints_on_gpu.update(pose, DisplayOptions(bones="boxes"))
    boxes = joints_on_gpu.boxes
    program = joint_pass.programs.feedback("joint", "", ("v_normal",))
    program["u_normal_matrix"].write(np.eye(3, dtype="f4").tobytes())
    out = ctx.buffer(reserve=12 * 36 * 2)
    boxes.world.use(0)
    program["u_world"].value = 0
    boxes.array(program).transform(out, mode=moderngl.TRIANGLES, vertices=36, instances=2)
    found = unit(np.frombuffer(out.read(), "f4").reshape(2, 36, 3).astype(float))
    c, s = np.cos(0.7), np.sin(0.7)
    linear = np.diag([1.0, 4.0, -0.5]) @ [[c, -s, 0], [s, c, 0], [0, 0, 1]]
    faces = np.concatenate([np.eye(3), -np.eye(3)])
    for normals, matrix in zip(found, (np.diag([1.0, 4.0, -0.5]), linear), strict=True):
        expected = unit(faces @ np.linalg.inv(matrix))
        gaps = np.linalg.norm(normals[:, None] - expected, axis=2)
        assert gaps.min(axis=1).max() <= TOLERANCE
        assert gaps.min(axis=0).max() <= TOLERANCE
    for item in (out, boxes, joint_pass, joint_pass.programs):
        item.release()


SHEAR = np.array([[2.0, 1.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, -0.5]])


def test_normals_remain_perpendicular_to_the_surface():
    along, across = np.array([1.0, 2.0, 3.0]), np.array([-2.0, 1.0, 0.5])
    normal = normal_matrix(SHEAR) @ np.cross(along, across)
    assert_allclose([normal @ (SHEAR @ along), normal @ (SHEAR @ across)], 0.0, atol=1e-12)
    assert_allclose(normal_matrix(SHEAR) @ SHEAR.T, np.eye(3), atol=1e-12)


def test_normals_of_a_flattened_surface_are_perpendicular_to_the_plane():
    flat = np.diag([2.0, 0.0, 3.0])
    # Only the plane y = 0 remains; slanted surfaces are projected onto it.
    normals = np.array([[0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, -1.0, 2.0]]) @ normal_matrix(flat).T
    assert_allclose(normals[:, [0, 2]], 0.0)
    assert (np.sign(normals[:, 1]) == [1.0, 1.0, -1.0]).all()


@pytest.mark.parametrize("placed", [True, False])
def test_actor_scaled_to_zero_is_invisible(offscreen, placed):
    scene = alone(grid_figure())
    if placed:
        scene.actors[0].placement = np.diag([0.0, 0.0, 0.0, 1.0])
    else:
        scene.actors[0].pose.figure_scale = 0.0
    assert not drawn(front_view(offscreen, scene)).any()


def test_actor_flattened_along_the_view_direction_looks_the_same(offscreen):
    scene = alone(grid_figure())
    before = front_view(offscreen, scene)
    scene.actors[0].placement = np.diag([1.0, 1.0, 0.0, 1.0])
    np.testing.assert_array_equal(front_view(offscreen, scene), before)


def test_normals_of_almost_flat_meshes_fit_into_single_precision():
    """Their inverse has entries of 1e60; only the direction of a normal matters."""
    found = normal_matrix(np.diag([1.0, 1.0, 1e-60])).astype(np.float32)
    assert_allclose(found @ [1.0, 1.0, 1.0], [0.0, 0.0, 1.0], atol=1e-30)


# For joints rotated by up to a radian and four influences in single precision.
NORMAL_TOLERANCE = 1e-4
MATRIX = 3 * 4 * 4  # bytes of a joint's matrix, and of an actor's centres


@pytest.fixture(scope="module")
def family(tmp_path_factory):
    """Return a function that creates a new figure of the family on each call."""

    def make(kind, **changes):
        return family_figure(kind, tmp_path_factory.mktemp(kind), **changes)

    return make


@pytest.fixture
def posed(ctx, monkeypatch):
    """Return a function that creates a posed mesh; all are released at the end."""
    # On a busy machine, one sum may take so long that both ways are timed.
    monkeypatch.setattr(corrective_sums, "_TRIAL", np.inf)
    owned = []

    def make(figure, way="cpu") -> PosedMesh:
        owned.append(PosedMesh(ctx, Programs(ctx), MeshBuffers(ctx, figure, [])))
        if figure.correctives is not None:
            owned[-1].mesh.corrective_sums.way = way
        return owned[-1]

    yield make
    for mesh in owned:
        mesh.release()
        mesh.mesh.release()
        mesh.programs.release()


@pytest.fixture
def written(monkeypatch):
    """The sizes of writes to buffers and textures in bytes, in their order."""
    sent: list[tuple[str, int]] = []
    for owner, kind in ((moderngl.Buffer, "buffer"), (moderngl.Texture, "texture")):

        def write(self, data, *args, _kind=kind, _original=owner.write, **kwargs):
            sent.append((_kind, memoryview(data).nbytes))
            return _original(self, data, *args, **kwargs)

        monkeypatch.setattr(owner, "write", write)
    return sent


def shaped_pose(figure, seed, reach=1.0):
    rng = np.random.default_rng(seed)
    pose = random_pose(figure.skeleton, rng, reach)
    pose.shape_weights = rng.normal(size=figure.n_shapes)
    return pose


def check(mesh, pose, how=None):
    """Compare the output of the GPU with the reference, without the figure's placement."""
    how = how or Skinning()
    mesh.update(pose, how)
    positions, normals = mesh.read()
    wanted_positions, wanted_normals = viewer.deform(mesh.mesh.figure, pose, how)
    size = box_size(bounding_box(mesh.mesh.figure.mesh.positions))
    assert np.abs(positions - wanted_positions).max() <= TOLERANCE * size
    assert np.linalg.norm(normals - wanted_normals, axis=1).max() <= NORMAL_TOLERANCE
    return positions


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", ["smpl", "smplh", "smplx", "mano", "flame"])
def test_gpu_matches_the_reference_for_shape_and_pose(family, posed, kind, way):
    figure = family(kind)
    mesh = posed(figure, way)
    for seed in range(4):
        check(mesh, shaped_pose(figure, seed))


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("method", ["dqs", "mix"])
def test_gpu_matches_the_reference_for_other_methods(family, posed, method, way):
    figure = family("smplx")
    mesh = posed(figure, way)
    for seed in range(3):
        check(mesh, shaped_pose(figure, seed), Skinning(method, blend_factor=0.3))


@pytest.mark.parametrize("way", WAYS)
def test_many_vertices_fill_many_rows_of_the_texture(family, posed, way):
    figure = family("smpl", n_vertices=1_000)  # 207,000 offsets are 51 rows of 4096
    check(posed(figure, way), shaped_pose(figure, 0))


@pytest.mark.parametrize("way", WAYS)
def test_correctives_of_one_rotated_joint_affect_only_that_joint(family, posed, way):
    figure = family("smpl")
    mesh = posed(figure, way)
    for joint in (0, 1, 11, 23):
        pose = figure_pose(figure)
        pose.dofs[3 * joint] = 1.0
        check(mesh, pose)


@pytest.mark.parametrize("way", WAYS)
def test_correctives_can_be_switched_off_and_on(family, posed, way):
    figure = family("smplx")
    mesh = posed(figure, way)
    pose = shaped_pose(figure, 1)
    with_them = check(mesh, pose)
    without = check(mesh, pose, Skinning(correctives=False))
    assert np.abs(with_them - without).max() > 1e-3
    assert np.array_equal(check(mesh, pose), with_them)


@pytest.mark.parametrize("way", WAYS)
def test_shape_and_pose_can_be_reset(family, posed, way):
    figure = family("smplx")
    mesh = posed(figure, way)
    rest, pose = figure_pose(figure), shaped_pose(figure, 2)
    before = check(mesh, rest)
    check(mesh, pose)
    pose.shape_weights[:] = 0.0
    check(mesh, pose)  # only the pose
    pose.shape_weights[3] = 2.0
    check(mesh, pose)
    pose.dofs[:] = 0.0
    check(mesh, pose)  # only the shape
    assert np.array_equal(check(mesh, rest), before)
    mesh.update(None)
    wanted = figure.mesh.positions
    np.testing.assert_allclose(mesh.read()[0], wanted, rtol=0, atol=1e-6)


@pytest.mark.parametrize("way", WAYS)
def test_bind_pose_of_a_shaped_actor_is_the_stored_mesh(family, posed, way):
    figure = family("smpl")
    mesh = posed(figure, way)
    check(mesh, shaped_pose(figure, 3))
    mesh.update(None)
    np.testing.assert_allclose(mesh.read()[0], figure.mesh.positions, rtol=0, atol=1e-6)


@pytest.mark.parametrize("way", WAYS)
def test_actors_of_one_figure_may_have_different_shapes(ctx, family, posed, way):
    figure = family("smpl")
    first = posed(figure, way)
    second = PosedMesh(ctx, first.programs, first.mesh)
    one, two = shaped_pose(figure, 4), shaped_pose(figure, 5)
    check(first, one)
    check(second, two)
    one.dofs[5] += 0.5
    check(first, one)
    wanted = viewer.deform(figure, two)[0]
    np.testing.assert_allclose(second.read()[0], wanted, rtol=0, atol=2e-5)
    second.release()


def test_changed_pose_on_a_card_uploads_only_matrices_and_weights(family, posed, written):
    figure = family("smplx")
    mesh = posed(figure, "gpu")
    pose = shaped_pose(figure, 6)
    check(mesh, pose)
    written.clear()
    pose.dofs[7] += 0.25
    check(mesh, pose)
    # An index and a weight of each corrective that is not 0, and the weights of seven actors that
    # fill the work group.
    weights = (
        "buffer",
        9 * 4 * np.count_nonzero(pose_weights(figure.correctives, figure.skeleton, pose)),
    )
    assert sorted(written) == sorted(
        [weights, ("texture", MATRIX), ("texture", MATRIX * figure.skeleton.n_joints)]
    )


def test_changed_pose_without_correctives_uploads_only_matrices(family, posed, written):
    figure = family("smplx")
    for way in WAYS:
        mesh = posed(figure, way)
        pose = shaped_pose(figure, 7)
        check(mesh, pose, Skinning(correctives=False))
        written.clear()
        pose.dofs[7] += 0.25
        check(mesh, pose, Skinning(correctives=False))
        assert written == [("texture", MATRIX * figure.skeleton.n_joints), ("texture", MATRIX)]


def test_changed_shape_uploads_positions_and_normals(family, posed, written):
    figure = family("smpl")
    mesh = posed(figure)
    pose = shaped_pose(figure, 8)
    how = Skinning(correctives=False)
    check(mesh, pose, how)
    written.clear()
    pose.shape_weights[0] += 1.0
    check(mesh, pose, how)
    rows = ("buffer", 12 * mesh.mesh.n_vertices)
    assert sorted(written) == sorted(
        [rows, rows, ("texture", MATRIX * figure.skeleton.n_joints), ("texture", MATRIX)]
    )


def test_changed_pose_with_sums_of_the_processor_uploads_positions_once(family, posed, written):
    figure = family("smpl")
    mesh = posed(figure, "cpu")
    pose = shaped_pose(figure, 9)
    check(mesh, pose)
    written.clear()
    pose.dofs[7] += 0.25
    check(mesh, pose)
    rows = ("buffer", 12 * mesh.mesh.n_vertices)
    assert sorted(written) == sorted(
        [rows, ("texture", MATRIX * figure.skeleton.n_joints), ("texture", MATRIX)]
    )


def test_unchanged_pose_uploads_no_data(family, posed, written):
    figure = family("smpl")
    for way in WAYS:
        mesh = posed(figure, way)
        pose = shaped_pose(figure, 10)
        check(mesh, pose)
        written.clear()
        check(mesh, pose)
        pose.figure_translation[0], pose.figure_scale = 5.0, 2.0
        mesh.update(pose)
        assert written == []


@pytest.mark.parametrize("way", WAYS)
def test_figure_at_rest_reads_no_offsets_from_its_file(family, posed, way):
    figure = family("smplx")
    mesh = posed(figure, way)
    mesh.update(figure_pose(figure))
    assert not figure.blend_shapes.offsets.is_loaded
    assert not figure.correctives.offsets.is_loaded
    check(mesh, shaped_pose(figure, 11))
    assert figure.correctives.offsets.is_loaded


# Relative to the figure's size; the synthetic correctives are larger than the figure.
BODY_TOLERANCE = 2e-5


@pytest.fixture(scope="module")
def figures(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bodies")
    found = {"mhr": read(Source.open(write_mhr(folder / "mhr")))}
    for name, content in (("star", star()), ("supr", supr()), ("skel", skel())):
        np.savez(folder / f"{name}.npz", **content)
        found[name] = read(Source.open(folder / f"{name}.npz"))
    return found


def random_body_pose(figure, seed):
    generator = np.random.default_rng(seed)
    pose = figure_pose(figure)
    pose.dofs[:] = generator.uniform(-0.8, 0.8, len(pose.dofs))
    pose.shape_weights = 0.3 * generator.normal(size=figure.n_shapes)
    return pose


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", ["star", "supr", "skel", "mhr"])
def test_gpu_matches_the_reference(ctx, figures, name, way):
    figure = figures[name]
    programs = Programs(ctx)
    mesh = PosedMesh(ctx, programs, MeshBuffers(ctx, figure, []))
    mesh.mesh.corrective_sums.way = way
    if way == "gpu" and not mesh.mesh.corrective_sums.can_use_gpu:
        pytest.skip("sparse offsets are summed on the processor")
    for seed in range(2):
        pose = random_body_pose(figure, seed)
        mesh.update(pose, Skinning())
        wanted = viewer.deform(figure, pose)[0]
        size = box_size(bounding_box(wanted))
        assert np.abs(mesh.read()[0] - wanted).max() <= BODY_TOLERANCE * size
    mesh.release()
    mesh.mesh.release()
    programs.release()


def test_weights_of_instances_are_those_of_each_pose(figures):
    from viewer.rendering.passes.instance_pass import _pose_weights

    figure = figures["star"]
    poses = [random_body_pose(figure, seed) for seed in range(3)]
    found = _pose_weights(figure, poses, np.zeros((3, 24, 3, 3)))
    for pose, row in zip(poses, found, strict=True):
        assert row.tolist() == pose_weights(figure.correctives, figure.skeleton, pose).tolist()


def test_large_numbers_of_offsets_are_summed_on_the_processor(ctx, figures, monkeypatch):
    mesh = MeshBuffers(ctx, figures["star"], [])
    sums = mesh.corrective_sums
    assert sums.can_use_gpu and sums.way == "cpu"
    limits = {**ctx.info, "GL_MAX_SHADER_STORAGE_BLOCK_SIZE": 12 * 30 * 93 - 1}
    monkeypatch.setattr(type(ctx), "info", property(lambda self: limits))
    assert not sums.can_use_gpu
    mesh.release()


def test_both_ways_are_timed_after_some_use(ctx, figures, monkeypatch):
    figure, programs = figures["star"], Programs(ctx)
    mesh = PosedMesh(ctx, programs, MeshBuffers(ctx, figure, []))
    sums, timed = mesh.mesh.corrective_sums, []
    original = sums.times
    monkeypatch.setattr(sums, "times", lambda *work: timed.append(original(*work)) or timed[-1])
    monkeypatch.setattr(corrective_sums, "_TRIAL", 0.0)
    monkeypatch.setattr(corrective_sums, "_TRIED", 2)
    for seed in range(3):
        pose = random_body_pose(figure, seed)
        mesh.update(pose)
        wanted = viewer.deform(figure, pose)[0]
        size = box_size(bounding_box(wanted))
        assert np.abs(mesh.read()[0] - wanted).max() <= BODY_TOLERANCE * size
    (times,) = timed
    assert set(times) == set(WAYS) and sums.way == min(times, key=times.get)
    mesh.release()
    mesh.mesh.release()
    programs.release()


def test_way_that_was_faster_when_both_were_timed_is_kept(ctx, figures, monkeypatch):
    figure, programs = figures["star"], Programs(ctx)
    for faster in WAYS:
        mesh = PosedMesh(ctx, programs, MeshBuffers(ctx, figure, []))
        sums = mesh.mesh.corrective_sums
        spent = {way: 0.5 if way == faster else 1.0 for way in WAYS}
        monkeypatch.setattr(sums, "times", lambda *_, spent=spent: spent)
        monkeypatch.setattr(corrective_sums, "_TRIAL", 0.0)
        for seed in range(3):
            pose = random_body_pose(figure, seed)
            mesh.update(pose)
            assert sums.way == (faster if seed else "cpu")
            wanted = viewer.deform(figure, pose)[0]
            size = box_size(bounding_box(wanted))
            assert np.abs(mesh.read()[0] - wanted).max() <= BODY_TOLERANCE * size
        mesh.release()
        mesh.mesh.release()
    programs.release()
