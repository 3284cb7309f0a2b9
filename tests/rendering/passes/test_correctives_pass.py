"""Shape and pose correctives on the GPU, summed in or before the shader, and their uploads."""

import moderngl
import numpy as np
import pytest
from family_models import family_figure
from rendering.drawn_figures import random_pose

import viewer
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.posed_mesh import PosedMesh
from viewer.rendering.gpu.program import Programs
from viewer.rendering.gpu.rest_buffers import WAYS
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.scene import figure_pose
from viewer.rig.skinning import Skinning

TOLERANCE = 1e-5  # relative to the figure's size
# For joints rotated by up to a radian and four influences in single precision.
NORMAL_TOLERANCE = 1e-4
PALETTE = 256 * 3 * 4 * 4  # bytes of one row of matrices for up to 256 joints
WEIGHT_LIST = 1024 * 2 * 4  # bytes of one row of pairs for up to 1024 weights


@pytest.fixture(scope="module")
def family(tmp_path_factory):
    """Return a function that creates a new figure of the family on each call."""

    def make(kind, **changes):
        return family_figure(kind, tmp_path_factory.mktemp(kind), **changes)

    return make


@pytest.fixture
def posed(ctx):
    """Return a function that creates a posed mesh; all are released at the end."""
    owned = []

    def make(figure, way="") -> PosedMesh:
        owned.append(PosedMesh(ctx, Programs(ctx), MeshBuffers(ctx, figure, []), way))
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
    second = PosedMesh(ctx, first.programs, first.mesh, way)
    one, two = shaped_pose(figure, 4), shaped_pose(figure, 5)
    check(first, one)
    check(second, two)
    one.dofs[5] += 0.5
    check(first, one)
    wanted = viewer.deform(figure, two)[0]
    np.testing.assert_allclose(second.read()[0], wanted, rtol=0, atol=2e-5)
    second.release()


def test_changed_pose_uploads_only_matrices_and_a_weight_list(family, posed, written):
    figure = family("smplx")
    mesh = posed(figure, "texture")
    pose = shaped_pose(figure, 6)
    check(mesh, pose)
    written.clear()
    pose.dofs[7] += 0.25
    check(mesh, pose)
    assert sorted(written) == [("texture", WEIGHT_LIST), ("texture", PALETTE)]


def test_changed_pose_without_correctives_uploads_only_matrices(family, posed, written):
    figure = family("smplx")
    for way in WAYS:
        mesh = posed(figure, way)
        pose = shaped_pose(figure, 7)
        check(mesh, pose, Skinning(correctives=False))
        written.clear()
        pose.dofs[7] += 0.25
        check(mesh, pose, Skinning(correctives=False))
        assert written == [("texture", PALETTE)]


def test_changed_shape_uploads_positions_and_normals(family, posed, written):
    figure = family("smpl")
    mesh = posed(figure, "texture")
    pose = shaped_pose(figure, 8)
    check(mesh, pose)
    written.clear()
    pose.shape_weights[0] += 1.0
    check(mesh, pose)
    rows = ("buffer", 12 * mesh.mesh.n_vertices)
    wanted = [rows, rows, ("texture", WEIGHT_LIST), ("texture", PALETTE)]
    assert sorted(written) == sorted(wanted)


def test_changed_pose_with_sums_before_the_shader_uploads_positions_once(family, posed, written):
    figure = family("smpl")
    mesh = posed(figure, "product")
    pose = shaped_pose(figure, 9)
    check(mesh, pose)
    written.clear()
    pose.dofs[7] += 0.25
    check(mesh, pose)
    assert sorted(written) == [("buffer", 12 * mesh.mesh.n_vertices), ("texture", PALETTE)]


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
