"""Output of the skinning shader, compared with the float64 reference, and its number of runs."""

from dataclasses import replace

import moderngl
import numpy as np
import pytest
from rendering.drawn_figures import arm, random_figure, random_pose, square

import viewer
from viewer.rendering.camera import Camera, orbit
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.posed_mesh import PosedMesh
from viewer.rendering.gpu.program import Programs
from viewer.rendering.gpu.target import Target
from viewer.rendering.options import DisplayOptions
from viewer.rendering.renderer import Renderer
from viewer.rigs.figure import Figure
from viewer.rigs.kinematics import skinning_matrices, world_matrices
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.pose import rest_pose
from viewer.rigs.scene import Actor, Scene, scene_box
from viewer.rigs.skin import has_influence, skin_from_lists
from viewer.rigs.skinning import Skinning
from viewer.rigs.skinning.lbs import blended_matrices

POSITION_TOLERANCE = 1e-5  # relative to the figure's size
NORMAL_TOLERANCE = 1e-5  # relative to a unit normal, multiplied by its shortening in blending


def posed_mesh(ctx, figure: Figure) -> PosedMesh:
    return PosedMesh(ctx, Programs(ctx), MeshBuffers(ctx, figure, []))


def release(mesh: PosedMesh) -> None:
    mesh.release()
    mesh.mesh.release()
    mesh.programs.release()


def shortening(figure: Figure, pose) -> np.ndarray:
    """Return the cancellation in the blend of each vertex: sum of |w| |M n| over |sum w M n|."""
    skin = figure.skin
    palette = skinning_matrices(world_matrices(figure.skeleton, pose), skin.inverse_bind)
    owners = np.repeat(np.arange(skin.n_vertices), np.diff(skin.starts))
    turned = np.einsum("nab,nb->na", palette[skin.joints, :3, :3], figure.mesh.normals[owners])
    lengths = np.abs(skin.weights) * np.linalg.norm(turned, axis=1)
    whole = np.bincount(owners, lengths, skin.n_vertices)
    blended = blended_matrices(skin, palette)[:, :, :3]
    left = np.linalg.norm(np.einsum("vab,vb->va", blended, figure.mesh.normals), axis=1)
    return np.where(has_influence(skin), whole / np.maximum(left, 1e-30), 1.0)


def check(ctx, figure: Figure, seed: int, n_poses: int = 20, reach: float = np.pi) -> None:
    rng = np.random.default_rng(seed)
    mesh = posed_mesh(ctx, figure)
    poses = [rest_pose(figure.skeleton)]
    poses += [random_pose(figure.skeleton, rng, reach) for _ in range(n_poses)]
    size = box_size(bounding_box(figure.mesh.positions))
    for pose in poses:
        mesh.update(pose)
        positions, normals = mesh.read()
        wanted_positions, wanted_normals = viewer.deform(figure, pose)
        assert np.abs(positions - wanted_positions).max() <= POSITION_TOLERANCE * size
        error = np.linalg.norm(normals - wanted_normals, axis=1)
        assert (error <= NORMAL_TOLERANCE * np.minimum(shortening(figure, pose), 1e5)).all()
        present = np.linalg.norm(wanted_normals, axis=1) > 0
        assert np.abs(np.linalg.norm(normals[present], axis=1) - 1.0).max() < 1e-6
    assert mesh.n_updates == len(poses)
    release(mesh)


def test_gpu_matches_the_reference_for_the_bundled_figure(ctx):
    check(ctx, viewer.load().actors[0].figure, seed=1, n_poses=40)


@pytest.mark.parametrize("name", ["wasp", "tube"])
def test_gpu_matches_the_reference_for_real_figures(ctx, shared, name):
    scene = viewer.load(shared / f"{name}.skel", shared / f"{name}.skin")
    check(ctx, scene.actors[0].figure, seed=2, n_poses=40)


@pytest.mark.parametrize("n_joints", [1, 2, 255, 256, 257, 1_025, 5_000])
def test_gpu_matches_the_reference_for_any_number_of_joints(ctx, n_joints):
    figure = random_figure(np.random.default_rng(n_joints), n_joints, n_vertices=max(600, n_joints))
    check(ctx, figure, seed=3, n_poses=10)


def test_each_of_5000_joints_is_read_from_its_row(ctx):
    """Each joint has one vertex, so a wrong row of the palette's texture would be detected."""
    rng = np.random.default_rng(0)
    figure = random_figure(rng, 5_000, 5_000)
    skin = skin_from_lists([[(joint, 1.0)] for joint in range(5_000)], figure.skin.inverse_bind)
    check(ctx, replace(figure, skin=skin), seed=4, n_poses=3)


def test_gpu_matches_the_reference_for_a_chain_of_joints(ctx):
    figure = random_figure(np.random.default_rng(5), 300, chain=True)
    check(ctx, figure, seed=5, n_poses=10)


@pytest.mark.parametrize("count", [1, 13, 1_023, 1_024, 1_025, 5_000])
def test_gpu_matches_the_reference_for_any_number_of_influences(ctx, count):
    rng = np.random.default_rng(count)
    figure = random_figure(rng, 40, n_vertices=50)
    pairs = [[(int(rng.integers(40)), 1.0 / 3)] * 3 for _ in range(50)]
    weights = rng.uniform(0.0, 1.0, count)
    weights /= weights.sum()
    pairs[17] = [(int(rng.integers(40)), float(weight)) for weight in weights]
    skin = skin_from_lists(pairs, figure.skin.inverse_bind)
    check(ctx, replace(figure, skin=skin), seed=6, n_poses=10)


@pytest.mark.parametrize("sums", [(0.5, 0.5), (0.0, 2.0), (0.999, 1.001), (-1.0, 1.0)])
def test_weights_are_used_as_stored(ctx, sums):
    figure = random_figure(np.random.default_rng(7), 20, sums=sums)
    check(ctx, figure, seed=7)


def test_weights_of_both_signs_are_used_as_stored(ctx):
    pairs = [[(0, 1.5), (1, -0.5)], [(0, -0.25), (2, 1.25)], [(1, 1.0), (1, -1.0)], [(2, 0.0)]]
    figure = random_figure(np.random.default_rng(8), 3, n_vertices=4)
    figure = replace(figure, skin=skin_from_lists(pairs, figure.skin.inverse_bind))
    mesh = posed_mesh(ctx, figure)
    pose = random_pose(figure.skeleton, np.random.default_rng(8))
    mesh.update(pose)
    wanted = viewer.deform(figure, pose)[0]
    np.testing.assert_allclose(mesh.read()[0], wanted, rtol=0, atol=1e-5)
    release(mesh)


def test_vertices_without_influence_stay_at_their_bind_position(ctx):
    figure = random_figure(np.random.default_rng(9), 20, empty=0.3)
    check(ctx, figure, seed=9)
    mesh = posed_mesh(ctx, figure)
    mesh.update(random_pose(figure.skeleton, np.random.default_rng(10)))
    still = np.diff(figure.skin.starts) == 0
    assert still.any()
    # In float32, a figure of size 1 has an error of 6e-8 per rounding.
    np.testing.assert_allclose(
        mesh.read()[0][still], figure.mesh.positions[still], rtol=0, atol=1e-6
    )
    release(mesh)


FAR = [
    pytest.param(0.017, (1.0, 0.0, 0.0), id="0.017 units high, 1 unit away"),
    pytest.param(0.017, (6_000.0, 0.0, 8_000.0), id="0.017 units high, 10,000 units away"),
    pytest.param(1.7, (0.0, 10_000.0, 0.0), id="1.7 units high, 10,000 units away"),
]


@pytest.mark.parametrize(("size", "origin"), FAR)
def test_figures_far_away_keep_their_precision(ctx, size, origin):
    figure = random_figure(np.random.default_rng(11), 30, size=size, origin=origin)
    check(ctx, figure, seed=11)


@pytest.mark.parametrize(("size", "origin"), FAR)
def test_figures_far_away_keep_their_precision_when_rotated_about_the_world_origin(
    ctx, size, origin
):
    """The root is at the origin, so the whole figure swings around it."""
    figure = random_figure(np.random.default_rng(12), 30, size=size, origin=origin)
    offsets = figure.skeleton.rest_translations
    parents = figure.skeleton.parents
    wide = replace(
        figure.skeleton,
        names=("origin", *figure.skeleton.names),
        parents=np.array([-1, *(parents + 1)], dtype=np.int32),
        rest_translations=np.vstack([np.zeros(3), offsets]),
        rest_rotations=np.tile([0.0, 0.0, 0.0, 1.0], (31, 1)),
        rest_scales=np.ones((31, 3)),
        dof_joints=np.array([0, 0, 0, *(figure.skeleton.dof_joints + 1)], dtype=np.int32),
        dof_kinds=np.array([3, 4, 5, *figure.skeleton.dof_kinds], dtype=np.int32),
        rest_dofs=np.zeros(93),
        dof_limits=np.tile([-np.inf, np.inf], (93, 1)),
    )
    skin = replace(
        figure.skin,
        joints=figure.skin.joints + 1,
        inverse_bind=np.concatenate([np.eye(4)[None], figure.skin.inverse_bind]),
    )
    check(ctx, replace(figure, skeleton=wide, skin=skin), seed=12)


def test_rounded_weights_do_not_move_figures_far_away(ctx):
    """In float32 three weights of 1/3 do not sum to 1, which must not show 10,000 units away."""
    rng = np.random.default_rng(13)
    figure = random_figure(rng, 30, n_vertices=200, size=0.017, origin=(0.0, 10_000.0, 0.0))
    pairs = [[(int(joint), 1.0 / 7) for joint in rng.integers(0, 30, 7)] for _ in range(200)]
    skin = skin_from_lists(pairs, figure.skin.inverse_bind)
    check(ctx, replace(figure, skin=skin), seed=13)


def test_gpu_matches_the_reference_for_skewed_bindings(ctx):
    figure = random_figure(np.random.default_rng(14), 30, skew=True)
    check(ctx, figure, seed=14)


def test_bind_pose_is_the_stored_mesh(ctx):
    figure = random_figure(np.random.default_rng(15), 8, origin=(10_000.0, 0.0, 0.0), size=0.1)
    mesh = posed_mesh(ctx, figure)
    mesh.update(None)
    positions, normals = mesh.read()
    np.testing.assert_allclose(positions, figure.mesh.positions, rtol=0, atol=1e-5 * 0.1)
    lengths = np.linalg.norm(figure.mesh.normals, axis=1, keepdims=True)
    np.testing.assert_allclose(normals, figure.mesh.normals / lengths, rtol=0, atol=1e-6)
    release(mesh)


def test_mesh_without_a_skin_is_drawn_as_stored(ctx):
    figure = Figure("square", square())
    mesh = posed_mesh(ctx, figure)
    mesh.update(None)
    np.testing.assert_array_equal(mesh.read()[0], figure.mesh.positions)
    release(mesh)


def test_normal_of_length_zero_stays_zero(ctx):
    figure = arm(2)
    normals = figure.mesh.normals.copy()
    normals[5] = 0.0
    figure = replace(figure, mesh=replace(figure.mesh, normals=normals))
    mesh = posed_mesh(ctx, figure)
    mesh.update(rest_pose(figure.skeleton))
    assert mesh.read()[1][5].tolist() == [0.0, 0.0, 0.0]
    release(mesh)


class Drawing:
    """A renderer with target and arguments of a draw, which tests change between draws."""

    def __init__(self, ctx, *figures: Figure) -> None:
        self.scene = Scene([Actor(figure) for figure in figures])
        self.box = scene_box(self.scene)
        self.camera, self.options = Camera(distance=8.0), DisplayOptions()
        self.renderer, self.target = Renderer(Programs(ctx)), Target(ctx, (32, 32), 1)
        self.draw()

    def draw(self) -> int:
        """Draw; return the number of times the first actor has been skinned so far."""
        self.renderer.draw(self.scene, self.camera, self.options, self.target, self.box)
        return self.renderer.buffers.posed_mesh(self.scene.actors[0]).n_updates

    def release(self) -> None:
        self.renderer.release()
        self.renderer.programs.release()
        self.target.release()


@pytest.fixture
def drawing(ctx):
    result = Drawing(ctx, arm(3))
    yield result
    result.release()


def test_moving_the_camera_skins_no_actor(drawing):
    before = drawing.draw()
    for _ in range(5):
        orbit(drawing.camera, 20.0, 3.0)
        assert drawing.draw() == before


def test_changing_display_options_skins_no_actor(drawing):
    before = drawing.draw()
    for change in (
        {"wireframe": True},
        {"normals": True},
        {"flat": True},
        {"shading": "normals"},
        {"shading": "checker"},
        {"show": "both"},
        {"grid": False},
        {"background": "#000000"},
    ):
        drawing.options = DisplayOptions(**change)
        assert drawing.draw() == before


def test_changed_pose_is_skinned_once(drawing):
    before = drawing.draw()
    drawing.scene.actors[0].pose.dofs[4] = 0.5
    assert drawing.draw() == before + 1
    assert drawing.draw() == before + 1


def test_change_of_any_part_of_a_pose_is_skinned(drawing):
    pose = drawing.scene.actors[0].pose
    before = drawing.draw()
    for array, value in (
        (pose.dofs, 0.1),
        (pose.translations, 0.2),
        (pose.rotations, 0.3),
        (pose.scales, 1.1),
    ):
        array[1] = value
        before += 1
        assert drawing.draw() == before


def test_changing_the_placement_skins_no_actor(drawing):
    before = drawing.draw()
    drawing.scene.actors[0].placement[0, 3] = 1.0
    assert drawing.draw() == before


def test_bind_pose_is_skinned_once_and_can_be_left(drawing):
    before = drawing.draw()
    drawing.options = DisplayOptions(show="binding")
    assert drawing.draw() == before + 1
    drawing.scene.actors[0].pose.dofs[4] = 0.5
    assert drawing.draw() == before + 1
    drawing.options = DisplayOptions()
    assert drawing.draw() == before + 2


@pytest.fixture
def uploads(monkeypatch):
    """The number of bytes uploaded to the GPU, by kind."""
    sent: list[tuple[str, int]] = []

    def count(owner, name, kind):
        original = getattr(owner, name)

        def counted(self, *args, **kwargs):
            data = args[0] if args else kwargs.get("data", b"")
            sent.append((kind, memoryview(data).nbytes if data is not None else 0))
            return original(self, *args, **kwargs)

        monkeypatch.setattr(owner, name, counted)

    count(moderngl.Buffer, "write", "buffer")
    count(moderngl.Texture, "write", "texture")
    for name in ("buffer", "texture", "vertex_array", "program", "framebuffer"):
        original = getattr(moderngl.Context, name)

        def made(self, *args, _name=name, _original=original, **kwargs):
            sent.append((f"new {_name}", 0))
            return _original(self, *args, **kwargs)

        monkeypatch.setattr(moderngl.Context, name, made)
    return sent


def test_changed_pose_uploads_one_palette_and_no_vertices(drawing, uploads):
    drawing.draw()
    uploads.clear()
    drawing.scene.actors[0].pose.dofs[4] = 0.5
    drawing.draw()
    # The matrices of 3 joints and the centres, each three texels with four floats.
    assert uploads == [("texture", 3 * 3 * 4 * 4), ("texture", 3 * 4 * 4)]


def test_moving_the_camera_uploads_no_data(drawing, uploads):
    drawing.draw()  # the second image of a size stores its background
    uploads.clear()
    orbit(drawing.camera, 30.0, 5.0)
    drawing.draw()
    assert uploads == []


def test_actors_of_one_figure_share_its_mesh_but_not_their_poses(ctx):
    figure = arm(3)
    drawing = Drawing(ctx, figure, figure)
    first, second = (drawing.renderer.buffers.posed_mesh(actor) for actor in drawing.scene.actors)
    assert first.mesh is second.mesh
    drawing.scene.actors[1].pose.dofs[4] = 0.7
    drawing.draw()
    assert (first.n_updates, second.n_updates) == (1, 2)
    assert np.abs(first.read()[0] - second.read()[0]).max() > 0.1
    drawing.release()


def test_removed_actors_are_freed(ctx, monkeypatch):
    released = []
    original = PosedMesh.release
    monkeypatch.setattr(PosedMesh, "release", lambda s: (released.append(s), original(s)))
    drawing = Drawing(ctx, arm(2), arm(3))
    gone = drawing.renderer.buffers.posed_mesh(drawing.scene.actors[1])
    del drawing.scene.actors[1]
    drawing.draw()
    assert released == [gone]
    drawing.release()


def test_methods_blended_per_vertex_match_the_reference(ctx):
    rng = np.random.default_rng(5)
    figure = random_figure(rng, 12)
    fractions = rng.uniform(size=figure.skin.n_vertices)
    figure = replace(figure, skin=replace(figure.skin, dqs_fractions=fractions))
    mesh, how = posed_mesh(ctx, figure), Skinning("mix", blend_factor=None)
    pose = random_pose(figure.skeleton, rng)
    mesh.update(pose, how)
    size = box_size(bounding_box(figure.mesh.positions))
    wanted, _ = viewer.deform(figure, pose, how)
    assert np.abs(mesh.read()[0] - wanted).max() <= POSITION_TOLERANCE * size
    release(mesh)
