"""Actors drawn as instances, compared with the float64 reference and images of single actors."""

import sys
from collections import Counter
from dataclasses import replace

import moderngl
import numpy as np
import pytest
from rendering.drawn_figures import (
    arm,
    bent,
    checker,
    group_of,
    groups_of,
    random_figure,
    random_pose,
)

import viewer
from viewer.errors import RenderError
from viewer.loading import bundled_body
from viewer.rendering import lineup
from viewer.rendering.camera import Camera
from viewer.rendering.gpu import actor_buffers, context, posed_vertices
from viewer.rendering.gpu.corrective_sums import WAYS, Way
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.posed_vertices import BYTES_PER_VERTEX
from viewer.rendering.gpu.program import Programs
from viewer.rendering.lineup import FEWEST, Group
from viewer.rendering.offscreen import default_camera
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.instance_pass import InstanceBuffers
from viewer.rendering.view import View, view_of
from viewer.rigs.captures.points import PointLayout
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.pose import placement_matrix
from viewer.rigs.scene import Actor, Scene, scene_box
from viewer.rigs.skinning import METHODS, Skinning

TOLERANCE = 1e-5  # relative to the figure's size, as for single actors
VARYINGS = "v_position", "v_normal"


class Instances:
    """Instances with vertices that are read back instead of drawn."""

    def __init__(self, ctx, figure: Figure, way: Way = "cpu") -> None:
        self.context, self.programs = ctx, Programs(ctx)
        self.mesh = MeshBuffers(ctx, figure, [])
        if figure.correctives is not None:
            self.mesh.corrective_sums.way = way
        self.instances = InstanceBuffers(ctx, self.programs, self.mesh)
        self.group: Group | None = None

    def vertices(self, actors, how: Skinning, eye=(0.0, 0.0, 0.0)):
        """Return the output of the drawing pass's vertex shader, relative to the eye."""
        matrix = np.eye(4)
        matrix[:3, 3] = -np.asarray(eye)
        self.instances.vertices.reserve(len(actors))
        self.group = group_of(actors, self.group)
        self.instances.update(self.group, how)
        program = self.programs.feedback("mesh", "", VARYINGS, ("INSTANCED",))
        self.instances.use(program, View(matrix, np.eye(4), Camera()))
        count = self.mesh.n_vertices
        out = self.context.buffer(reserve=24 * count * len(actors))
        array = self.instances.array(program)
        array.transform(out, moderngl.POINTS, vertices=count, instances=len(actors))
        rows = np.frombuffer(out.read(), dtype="f4").reshape(len(actors), count, 6).astype(float)
        out.release()
        rows = rows[:, self.mesh.copies]
        normals = rows[..., 3:]
        return rows[..., :3], normals / np.maximum(np.linalg.norm(normals, axis=-1), 1e-30)[
            ..., None
        ]

    def release(self) -> None:
        for item in (self.instances, self.mesh, self.programs):
            item.release()


def cast(figure: Figure, count: int, seed: int = 0, reach: float = 1.0) -> list[Actor]:
    """Return actors of a figure in random poses."""
    rng = np.random.default_rng(seed)
    return [Actor(figure, random_pose(figure.skeleton, rng, reach)) for _ in range(count)]


def check(instances: Instances, actors, how: Skinning, eye=(0.0, 0.0, 0.0)) -> None:
    positions, normals = instances.vertices(actors, how, eye)
    figure = actors[0].figure
    size = box_size(bounding_box(figure.mesh.positions))
    for actor, found, turned in zip(actors, positions, normals, strict=True):
        wanted, directions = viewer.deform(figure, actor.pose, how)
        assert np.abs(found - (wanted - eye)).max() <= TOLERANCE * size
        lengths = np.linalg.norm(directions, axis=1)
        cosines = np.einsum("va,va->v", turned, directions)
        assert (cosines[lengths > 0] > 1.0 - 1e-5).all()


HOW = [Skinning("lbs"), Skinning("dqs"), Skinning("mix", blend_factor=0.3)]
assert {how.method for how in HOW} == set(METHODS)


@pytest.mark.parametrize("how", HOW, ids=lambda how: how.method)
@pytest.mark.parametrize("n_joints", [1, 40, 257])
def test_every_instance_matches_the_reference(ctx, how, n_joints):
    rng = np.random.default_rng(n_joints)
    figure = random_figure(rng, n_joints, counts=(1, 13), empty=0.1)
    instances = Instances(ctx, figure)
    check(instances, cast(figure, 9), how)
    instances.release()


@pytest.mark.parametrize("how", HOW, ids=lambda how: how.method)
@pytest.mark.parametrize("way", WAYS)
def test_bundled_body_with_correctives_and_shape_matches_the_reference(ctx, how, way):
    figure = viewer.load(bundled_body()).actors[0].figure
    assert figure.correctives is not None
    instances = Instances(ctx, figure, way)
    actors = cast(figure, 3, reach=0.6)
    for actor in actors:
        actor.pose.shape_weights = np.zeros(figure.n_shapes)
    check(instances, actors, how)
    for actor in actors:
        actor.pose.shape_weights[:2] = 1.5, -1.0
    check(instances, actors, how)
    # Some, then all actors are at rest; old offsets must not remain.
    actors[1].pose = figure_pose(figure)
    actors[1].pose.shape_weights[:2] = 1.5, -1.0
    check(instances, actors, how)
    for actor in actors:
        actor.pose.dofs[:] = 0.0
    check(instances, actors, how)
    actors[2].pose.dofs[5] = 0.4
    check(instances, actors, how)
    instances.release()


@pytest.mark.parametrize("how", HOW, ids=lambda how: how.method)
def test_figures_far_from_the_origin_keep_their_precision(ctx, how):
    origin = (1e4, -2e4, 5e3)
    figure = random_figure(np.random.default_rng(3), 20, origin=origin)
    instances = Instances(ctx, figure)
    actors = [Actor(figure) for _ in range(5)]
    check(instances, actors, how, origin)
    instances.release()


@pytest.mark.parametrize("sums", [(0.5, 0.5), (0.0, 2.0), (-1.0, 1.0)])
def test_weights_are_used_as_stored(ctx, sums):
    figure = random_figure(np.random.default_rng(3), 20, sums=sums)
    instances = Instances(ctx, figure)
    actors = cast(figure, 5)
    positions, _ = instances.vertices(actors, Skinning())
    size = box_size(bounding_box(figure.mesh.positions))
    for actor, found in zip(actors, positions, strict=True):
        assert np.abs(found - viewer.deform(figure, actor.pose)[0]).max() <= TOLERANCE * size
    instances.release()


def test_number_and_method_of_instances_can_change(ctx):
    figure = random_figure(np.random.default_rng(4), 12)
    instances, actors = Instances(ctx, figure), cast(figure, 12)
    for chosen, how in (
        (actors[:5], HOW[1]),
        (actors, HOW[1]),
        (actors[3:9], HOW[2]),
        (actors[2:], HOW[0]),
        (actors[::-1], HOW[1]),
    ):
        check(instances, chosen, how)
    before = instances.instances.n_updates
    check(instances, actors[::-1], HOW[1])
    assert instances.instances.n_updates == before
    actors[4].pose.dofs[2] += 0.5
    check(instances, actors[::-1], HOW[1])
    assert instances.instances.n_updates == before + 1
    instances.release()


def test_placement_and_scale_of_each_actor_are_applied(ctx):
    figure = random_figure(np.random.default_rng(5), 8)
    instances, actors = Instances(ctx, figure), cast(figure, 4)
    for number, actor in enumerate(actors):
        actor.pose.figure_scale = 1.0 + 0.5 * number
        actor.pose.figure_translation[:] = number, 0.0, -number
        actor.placement = np.array([[0, -1, 0, 3], [2, 0, 0, number], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    positions, normals = instances.vertices(actors, Skinning())
    for actor, found, turned in zip(actors, positions, normals, strict=True):
        posed, directions = viewer.deform(figure, actor.pose)
        matrix = actor.placement[:3, :3]
        assert np.allclose(found, posed @ matrix.T + actor.placement[:3, 3], atol=1e-5 * 10)
        # Normals are transformed by the inverse transpose, since the placement doubles the length
        # of x.
        wanted = directions @ np.linalg.inv(matrix)
        wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
        turned = turned / np.linalg.norm(turned, axis=1, keepdims=True)
        assert np.allclose(turned, wanted, atol=1e-4)
    instances.release()


def rows_of_arms(count: int, **parts) -> Scene:
    figure = replace(arm(3, material=checker(8)), **parts)
    rng = np.random.default_rng(6)
    actors = []
    for number in range(count):
        turns = rng.uniform(-0.8, 0.8, 3)
        actor = bent(figure, (1, "z", turns[0]), (2, "z", turns[1]), (1, "y", turns[2]))
        actor.placement[:3, 3] = 0.0, 0.9 * number, 0.4 * (number % 3)
        if number % 3 == 1:
            actor.color = 0.5, 0.1, 0.05
        actors.append(actor)
    return Scene(actors)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"texture": False},
        {"shading": "normals"},
        {"shading": "checker", "cull": True},
        {"show": "both", "flat": True, "skeleton_opacity": 1.0},
        {"show": "both", "bones": "octahedra", "quality": "normal"},
        {"skinning": Skinning("dqs")},
    ],
    ids=str,
)
def test_instances_look_like_their_actors_drawn_one_by_one(offscreen, monkeypatch, changes):
    scene = rows_of_arms(FEWEST)
    options = DisplayOptions(**changes)
    camera, box = default_camera(scene, (200, 150)), scene_box(scene)
    assert len(groups_of(scene.actors, options)) == 1
    together = offscreen.render(scene, (200, 150), camera, options, box)
    monkeypatch.setattr(lineup, "FEWEST", 100)
    assert groups_of(scene.actors, options) == []
    alone = offscreen.render(scene, (200, 150), camera, options, box)
    difference = np.abs(together.astype(int) - alone).max(axis=-1)
    assert (difference > 2).mean() < 0.001


@pytest.mark.parametrize(
    ("changes", "alpha_mode"),
    [({"quality": "normal"}, "opaque"), ({"opacity": 0.7, "xray": True}, "blend")],
    ids=str,
)
def test_translucent_instances_look_like_their_actors_drawn_one_by_one(
    offscreen, monkeypatch, changes, alpha_mode
):
    material = replace(checker(8), alpha_mode=alpha_mode, base_color=(1.0, 0.8, 0.6, 0.9))
    figure, scene, size = arm(3, material=material), rows_of_arms(FEWEST + 2), (80, 60)
    # Some overlap, one is opaque, one invisible, and only some are opaque enough for a shadow.
    for number, actor in enumerate(scene.actors):
        actor.figure, actor.opacity = figure, 0.1 * (number * 7 % 10) if number else 1.0
        actor.placement[0, 3], actor.placement[1, 3] = 0.3 * number, 0.3 * number
    options = DisplayOptions(**changes)
    camera, box = default_camera(scene, size), scene_box(scene)
    translucent = scene.actors if options.opacity < 1.0 else scene.actors[1:]
    falling = sorted(translucent, key=lambda actor: -actor.opacity)
    assert groups_of(scene.actors, options) == [falling]
    together = offscreen.render(scene, size, camera, options, box)
    monkeypatch.setattr(lineup, "FEWEST", 100)
    assert groups_of(scene.actors, options) == []
    alone = offscreen.render(scene, size, camera, options, box)
    difference = np.abs(together.astype(int) - alone).max(axis=-1)
    assert (difference > 2).mean() < 0.001


def test_opacities_of_a_crowd_change_without_skinning(offscreen, work):
    scene, size, options = crowd(FEWEST), (64, 48), DisplayOptions(quality="normal", grid=False)
    camera, box = default_camera(scene, size), scene_box(scene)
    pictures = []
    for opacity in (0.4, 0.8, 0.4):
        work.clear()
        for number, actor in enumerate(scene.actors):
            actor.opacity = opacity - 0.01 * number
        pictures.append(offscreen.render(scene, size, camera, options, box))
        assert work["transform"] == (0 if pictures[1:] else FEWEST)
        assert work["write"] >= 19 * 4 * FEWEST
    np.testing.assert_array_equal(pictures[0], pictures[2])
    assert (pictures[0] != pictures[1]).any()


def test_only_actors_of_one_figure_and_shape_are_drawn_together():
    body = viewer.load(bundled_body()).actors[0].figure
    fox = viewer.load().actors[0].figure
    actors = [Actor(body) for _ in range(2 * FEWEST)] + [Actor(fox) for _ in range(FEWEST - 1)]
    for actor in actors[:FEWEST]:
        actor.pose.shape_weights[0] = 1.0
    groups = groups_of(actors, DisplayOptions())
    assert groups == [actors[:FEWEST], actors[FEWEST : 2 * FEWEST]]
    actors[0].pose.shape_weights[0] = 2.0
    assert groups_of(actors, DisplayOptions()) == [actors[FEWEST : 2 * FEWEST]]


@pytest.mark.parametrize(
    "changes", [{"wireframe": True}, {"normals": True}, {"shading": "scalar"}, {"show": "binding"}]
)
def test_views_of_single_vertices_draw_actors_one_by_one(changes):
    assert groups_of(rows_of_arms(FEWEST).actors, DisplayOptions(**changes)) == []


def test_meshes_without_a_skin_are_not_instanced():
    figure = replace(arm(3), skin=None)
    assert groups_of([Actor(figure) for _ in range(FEWEST)], DisplayOptions()) == []


def test_absent_and_hidden_actors_are_not_drawn(offscreen):
    scene = rows_of_arms(FEWEST + 2)
    camera, box, size = default_camera(scene, (100, 75)), scene_box(scene), (100, 75)
    options = DisplayOptions(background="transparent", grid=False)
    whole = offscreen.render(scene, size, camera, options, box)
    scene.actors[0].is_present = False
    scene.actors[1].visible = False
    fewer = offscreen.render(scene, size, camera, options, box)
    assert (fewer[..., 3] > 0).sum() < 0.9 * (whole[..., 3] > 0).sum()
    for actor in scene.actors:
        actor.visible = False
    assert not offscreen.render(scene, size, camera, options, box)[..., 3].any()


def test_instances_of_a_removed_figure_are_freed(offscreen):
    scene = rows_of_arms(FEWEST)
    camera, box = default_camera(scene, (50, 50)), scene_box(scene)
    offscreen.render(scene, (50, 50), camera, DisplayOptions(), box)
    instances = offscreen.renderer.buffers.instanced(scene.actors[0].figure, 1)[0]
    offscreen.render(rows_of_arms(2), (50, 50), camera, DisplayOptions(), box)
    assert instances.vertices._own is None
    assert len(offscreen.renderer.buffers._instanced) == 0


def test_refused_upload_is_tried_again(ctx, monkeypatch):
    figure = random_figure(np.random.default_rng(7), 6)
    instances, actors = Instances(ctx, figure), cast(figure, 3)

    def refuse(*_):
        raise RenderError("no room")

    with monkeypatch.context() as patch, pytest.raises(RenderError):
        patch.setattr(posed_vertices, "write_stacked", refuse)
        instances.instances.vertices.reserve(len(actors))
        instances.instances.update(group_of(actors), Skinning())
    check(instances, actors, Skinning())
    instances.release()


def test_instanced_skeletons_match_single_ones(offscreen):
    scene = rows_of_arms(5)
    scene.actors[3].pose.scales[:] = 1.5
    options = DisplayOptions(show="both")
    camera, box = default_camera(scene, (50, 50)), scene_box(scene)
    offscreen.render(scene, (50, 50), camera, options, box)
    with offscreen.context:
        for actor in scene.actors:
            boxes = offscreen.renderer.buffers.skeleton(actor).boxes
            rows = np.frombuffer(boxes.world.read(), dtype="f4").reshape(-1, 3, 4)[:3]
            wanted = world_matrices(actor.figure.skeleton, actor.pose)[:, :3]
            assert np.allclose(rows[..., :3], wanted[..., :3], atol=1e-6)
            assert np.allclose(rows[..., 3] + boxes.center, wanted[..., 3], atol=1e-6)


def crowd_of_skeletons() -> Scene:
    """Return arms in rows, all at half their size, some coloured, one of them sheared."""
    scene = rows_of_arms(FEWEST + 2)
    for number, actor in enumerate(scene.actors):
        angle = 0.2 * number
        actor.placement[[0, 0, 2, 2], [0, 2, 0, 2]] = [
            *(np.cos(angle), np.sin(angle)),
            *(-np.sin(angle), np.cos(angle)),
        ]
        actor.pose.figure_scale = 0.5
        actor.pose.figure_translation[0] = 0.1 * number
    scene.actors[4].placement[0, 1] = 0.5
    return scene


@pytest.mark.parametrize(
    ("bones", "quality"),
    [("octahedra", "normal"), ("sticks", "draft"), ("axes", "draft"), ("boxes", "draft")],
)
def test_skeletons_of_a_crowd_look_like_single_ones(offscreen, monkeypatch, work, bones, quality):
    scene, size = crowd_of_skeletons(), (200, 150)
    options = DisplayOptions(show="skeleton", bones=bones, quality=quality)
    camera, box = default_camera(scene, size), scene_box(scene)
    how, selected = (scene, camera, options), (5, 1)

    def drawn() -> np.ndarray:
        with offscreen.context:
            target = offscreen.target(size, 1)
            offscreen.renderer.draw(*how, target, box, selected)
            return target.read().astype(int)

    together = drawn()
    drawn()  # the second image of a size stores its background
    work.clear()
    assert (drawn() == together).all() and work["write"] == 0
    n_draws = work["render"]
    scene.actors[3].pose.dofs[3] += 0.5
    scene.actors[6].color = 0.1, 0.6, 0.1
    moved = drawn()
    assert (moved != together).any()
    monkeypatch.setattr(lineup, "FEWEST", 100)
    drawn()
    work.clear()
    alone = drawn()
    assert (np.abs(moved - alone).max(axis=-1) > 2).mean() < 0.001
    # Ten skeletons need as many draws as two: the sheared one is drawn alone.
    parts = {"octahedra": 2, "sticks": 2, "axes": 3, "boxes": 1}[bones]
    assert work["render"] - n_draws == parts * (FEWEST + 2 - 2)


def test_translucent_skeletons_over_skins_differ_only_where_they_overlap(offscreen, monkeypatch):
    """Together they are one layer, of which only the nearest joints are visible."""
    differ = []
    for step in (0.0, 4.0):
        scene, size, options = rows_of_arms(FEWEST), (200, 150), DisplayOptions(show="both")
        for number, actor in enumerate(scene.actors):
            actor.placement[1, 3] += step * number
        camera, box = default_camera(scene, size), scene_box(scene)
        together = offscreen.render(scene, size, camera, options, box)
        with monkeypatch.context() as patch:
            patch.setattr(lineup, "FEWEST", 100)
            alone = offscreen.render(scene, size, camera, options, box)
        differ.append((np.abs(together.astype(int) - alone).max(axis=-1) > 2).mean())
    overlapping, apart = differ
    assert 0.0 < overlapping < 0.01 and apart == 0.0


@pytest.mark.parametrize("show", ["skeleton", "both"])
def test_picked_joints_of_a_crowd_are_those_of_their_actors(offscreen, show):
    scene, size = crowd_of_skeletons(), (200, 150)
    options = DisplayOptions(show=show, bones="boxes")
    camera, box = default_camera(scene, size), scene_box(scene)
    view = view_of(camera, size, box)
    for number in (0, 4, 7):
        actor = scene.actors[number]
        place = actor.placement @ placement_matrix(actor.pose)
        point = place @ world_matrices(actor.figure.skeleton, actor.pose)[1, :, 3]
        clip = view.projection @ view.matrix @ point
        x, y = (0.5 + 0.5 * clip[:2] / clip[3] * (1.0, -1.0)) * size
        with offscreen.context:
            found = offscreen.renderer.pick(scene, camera, options, size, x, y, box)
        assert (found.actor, found.joint) == (number, 1)


def test_point_figures_are_drawn_with_all_options(offscreen):
    layout = PointLayout("one", ("a", "b"), [[0, 1]], [0, 0])
    actors = [Actor(Figure("points", points=layout)) for _ in range(FEWEST)]
    for number, actor in enumerate(actors[1:]):
        actor.points = np.array([[number, 0, 0, 1.0], [number, 1, 0, 1.0]])
    scene = Scene(actors)
    offscreen.renderer.buffers.keep_only([])
    with offscreen.context:
        offscreen.renderer.prepare(scene)
    for changes in (
        {},
        {"show": "both"},
        {"show": "skeleton"},
        {"show": "binding"},
        {"shading": "scalar"},
        {"wireframe": True, "normals": True, "keypoints": True},
    ):
        options = DisplayOptions(**changes)
        camera = default_camera(scene, (60, 60))
        assert offscreen.render(scene, (60, 60), camera, options, scene_box(scene)).any()


@pytest.fixture
def work(monkeypatch):
    """The driver's work since the last ``clear``: draws, skinned actors and uploaded bytes."""
    done = Counter()

    def count(owner, name, measure) -> None:
        original = getattr(owner, name)

        def counted(self, *args, **keywords):
            done[name] += measure(*args, **keywords)
            return original(self, *args, **keywords)

        monkeypatch.setattr(owner, name, counted)

    count(moderngl.VertexArray, "render", lambda *_, **__: 1)
    count(moderngl.VertexArray, "transform", lambda *_, instances, **__: instances)
    for owner in (moderngl.Buffer, moderngl.Texture):
        count(owner, "write", lambda data, *_, **__: memoryview(data).nbytes)
    return done


COARSE = {"sides": 8, "rings": 16}  # skinned in software by the hundred


def crowd(count: int, **sides) -> Scene:
    """Return bent arms of one figure in rows."""
    figure = arm(3, **sides)
    actors = [bent(figure, (1, "z", 0.001 * number)) for number in range(count)]
    for number, actor in enumerate(actors):
        actor.placement[:3, 3] = 4.0 * (number % 32), 0.0, 4.0 * (number // 32)
    return Scene(actors)


@pytest.mark.parametrize(
    "changes",
    [{}, {"quality": "normal"}, {"opacity": 0.6}, {"show": "both", "quality": "normal"}],
    ids=str,
)
def test_orbit_around_still_actors_skins_and_uploads_nothing(offscreen, work, changes):
    size, draws = (64, 48), {}
    options = DisplayOptions(**{"quality": "draft", **changes})
    for count in (10, 100):
        scene = crowd(count, **COARSE)
        box, camera = scene_box(scene), default_camera(scene, size)
        for _ in range(3):  # the second image of a size stores its background
            work.clear()
            camera.azimuth += 10.0
            offscreen.render(scene, size, camera, options, box)
        assert work["transform"] == work["write"] == 0
        draws[count] = work["render"]
    assert draws[10] == draws[100]


def test_only_changed_actors_are_skinned_and_uploaded(offscreen, work):
    scene, size = crowd(100, **COARSE), (64, 48)
    camera, box = default_camera(scene, size), scene_box(scene)

    def draw(quality) -> dict[str, int]:
        work.clear()
        offscreen.render(scene, size, camera, DisplayOptions(quality=quality), box)
        return dict(work)

    assert draw("normal")["transform"] == 100
    for number in (3, 4, 50):
        scene.actors[number].pose.dofs[3] += 0.1
    done = draw("normal")  # once for all passes
    assert done["transform"] == 3
    # Of each, 3 matrices and its centres, three rows of four floats each; then the placements and
    # colours of all actors, 19 floats each, as posed centres are part of the placements.
    assert done["write"] == 3 * 4 * 48 + 100 * 19 * 4
    scene.actors[7].placement[0, 3] += 0.5
    done = draw("normal")
    assert (done.get("transform", 0), done["write"]) == (0, 100 * 19 * 4)
    assert draw("final").get("write", 0) == 0


def _held(array):
    """Return a function that writes an array held from now on, and lets go of it."""
    held = [array]

    def write() -> None:
        held.pop()[..., 0] += 0.5

    return write


def _replaced(scene, number: int) -> None:
    one = scene.actors[number]
    scene.actors[number] = replace(one, own_pose=one.pose.copy(), placement=one.placement + 1.0)


def _set(owner, name: str, value) -> None:
    setattr(owner, name, value)


CHANGES = {
    "dofs": lambda scene: scene.actors[3].pose.dofs.__setitem__(3, 0.7),
    "rotations": lambda scene: scene.actors[3].pose.rotations.__setitem__(1, (1, 0, 0, 0)),
    "figure_translation": lambda scene: scene.actors[3].pose.figure_translation.fill(2.0),
    "figure_scale": lambda scene: _set(scene.actors[3].pose, "figure_scale", 2.0),
    "all values": lambda scene: _set(scene.actors[3].pose, "values", scene.actors[4].pose.values),
    "pose": lambda scene: _set(scene.actors[3], "pose", scene.actors[4].pose.copy()),
    "placement in place": lambda scene: scene.actors[3].placement.__setitem__((0, 3), 9.0),
    "placement": lambda scene: _set(scene.actors[3], "placement", 3.0 * np.eye(4)),
    "color": lambda scene: _set(scene.actors[3], "color", (0.1, 0.2, 0.3)),
    "opacity": lambda scene: _set(scene.actors[3], "opacity", 0.5),
    "visibility": lambda scene: _set(scene.actors[3], "visible", False),
    "presence": lambda scene: _set(scene.actors[3], "is_present", False),
    "order": lambda scene: scene.actors.reverse(),
    "removal": lambda scene: scene.actors.pop(3),
    "addition": lambda scene: scene.actors.append(scene.actors[3].copy()),
    "replacement": lambda scene: _replaced(scene, 3),
}


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("n_frames", [0, 1, 3])
def test_crowds_see_every_change_of_a_scene_that_was_still(change, n_frames):
    scene, options, drawn = crowd(12, **COARSE), DisplayOptions(), lineup.Lineup()
    # An actor may be written by others at all times, or the scene is as still as can be.
    writes = [_held(scene.actors[5].placement), _held(scene.actors[6].pose.dofs)]
    for step in range(4):
        for _ in range(n_frames):
            drawn = lineup.lineup(scene.actors, options, drawn)
        if step < len(writes):
            writes[step]()
        elif step == 2:
            CHANGES[change](scene)
        drawn = lineup.lineup(scene.actors, options, drawn)
        one = max(drawn.crowds.values(), key=lambda one: len(one.actors))
        shown = [actor for actor in scene.actors if actor.is_drawn and actor.opacity == 1.0]
        assert one.actors == shown
        models = [actor.placement @ placement_matrix(actor.pose) for actor in shown]
        assert np.array_equal(one.models, models)
        assert np.array_equal(one.arrays.dofs, [actor.pose.dofs for actor in shown])
        assert np.array_equal(one.arrays.rotations, [actor.pose.rotations for actor in shown])
        assert one.colors == [actor.color for actor in shown]


def test_crowds_see_what_changed_in_a_frame_that_failed(monkeypatch):
    def no_memory(*_):
        raise MemoryError

    scene, options, drawn = crowd(12, **COARSE), DisplayOptions(), lineup.Lineup()
    drawn = lineup.lineup(scene.actors, options, drawn)
    scene.actors[2].pose.figure_translation[0] = 5.0
    with monkeypatch.context() as broken, pytest.raises(MemoryError):
        broken.setattr(lineup.Crowd, "_place", no_memory)  # after poses were compared
        lineup.lineup(scene.actors, options, drawn)
    drawn = lineup.lineup(scene.actors, options, drawn)
    (one,) = drawn.crowds.values()
    models = [actor.placement @ placement_matrix(actor.pose) for actor in scene.actors]
    assert np.array_equal(one.models, models)
    scene.actors[4].placement[0, 3] = 7.0
    with monkeypatch.context() as broken, pytest.raises(MemoryError):
        broken.setattr(lineup, "placements", no_memory)  # after placements were compared
        lineup.lineup(scene.actors, options, drawn)
    lineup.lineup(scene.actors, options, drawn)
    models = [actor.placement @ placement_matrix(actor.pose) for actor in scene.actors]
    assert np.array_equal(one.models, models)


def test_nothing_of_a_still_crowd_is_compared(monkeypatch):
    scene, options, drawn = crowd(20, **COARSE), DisplayOptions(show="both"), lineup.Lineup()
    compare, compared = lineup.ArrayTable.update, []

    def counted(self, arrays):
        compared.append(len(arrays))
        return compare(self, arrays)

    monkeypatch.setattr(lineup.ArrayTable, "update", counted)
    for _ in range(2):  # a new crowd asks its poses for their shape and place
        drawn = lineup.lineup(scene.actors, options, drawn)
    compared.clear()
    for _ in range(3):
        drawn = lineup.lineup(scene.actors, options, drawn)
    assert not compared
    scene.actors[7].placement[0, 3] += 1.0
    lineup.lineup(scene.actors, options, drawn)
    assert compared == [20] * 4  # poses and placements, as meshes and as joints


def test_frames_of_200_actors_call_no_more_functions_than_those_of_20(offscreen):
    size, options, calls = (16, 12), DisplayOptions(quality="normal"), {}

    def count(_frame, event, _value) -> None:
        done[event] += 1

    for number in (20, 200):
        scene = crowd(number, **COARSE)
        camera, box = default_camera(scene, size), scene_box(scene)
        for angle in (0.0, 0.1, 0.1, 0.2):  # programs, caches and the background are made at first
            for actor in scene.actors:
                actor.pose.dofs[3] = angle
            camera.azimuth += 10.0
            done = Counter()
            with offscreen.context:
                target = offscreen.target(size, 1)
                sys.setprofile(count)
                try:
                    offscreen.renderer.draw(scene, camera, options, target, box)
                finally:
                    sys.setprofile(None)
            calls.setdefault(number, []).append((done["call"], done["c_call"]))
    *_, still, moving = (np.subtract(*pair) for pair in zip(calls[200], calls[20], strict=True))
    # One call per actor would be 180 more; whether values are skipped may make one or two.
    assert still.tolist() == [0, 0] and (moving < 10).all()


@pytest.mark.parametrize("how", HOW, ids=lambda how: how.method)
def test_large_crowds_are_skinned_in_parts(ctx, monkeypatch, how):
    monkeypatch.setattr(posed_vertices, "_MOST_TOGETHER", 4)
    figure = random_figure(np.random.default_rng(8), 12)
    instances, actors = Instances(ctx, figure), cast(figure, 9)
    check(instances, actors, how)
    for number in (0, 3, 4, 7, 8, 1):
        actors[number].pose.rotations[2] = 0.6, 0.0, 0.0, 0.8
    check(instances, actors, how)
    instances.release()


def crowd_and_one() -> Scene:
    """Return a crowd, and an actor of another figure behind it."""
    scene, one = crowd(FEWEST), bent(arm(4), (1, "z", 0.3))
    one.placement[:3, 3] = 4.0, 0.0, -4.0
    scene.actors.append(one)
    return scene


def test_shadows_of_still_actors_are_not_drawn_again(offscreen, work):
    scene, size, options = crowd_and_one(), (64, 48), DisplayOptions(quality="normal")
    camera, box = default_camera(scene, size), scene_box(scene)

    def draws() -> int:
        work.clear()
        offscreen.render(scene, size, camera, options, box)
        return work["render"]

    for _ in range(3):  # the second image of a size stores its background
        draws()
    scene.actors[0].pose.dofs[3] += 0.1
    moved = draws()
    # The shadow map has one draw for the crowd and one for the other actor; the contact shadows
    # have two more, which blur them.
    assert draws() == moved - 2 - 4
    camera.azimuth += 10.0  # the light follows the camera
    assert draws() == moved - 4
    options.lights.follow_camera = False
    draws()
    camera.azimuth += 10.0
    assert draws() == moved - 2 - 4


def test_shadows_follow_every_change(offscreen):
    scene, size, options = crowd_and_one(), (64, 48), DisplayOptions(quality="normal")
    other, camera, box = rows_of_arms(2), default_camera(scene, size), scene_box(scene)
    member, one = scene.actors[2], scene.actors[-1]

    def drawn(of: Scene) -> np.ndarray:
        return offscreen.render(of, size, camera, options, box)

    before = drawn(scene)
    for actor in (member, one):
        for change in (
            lambda pose: pose.dofs.__setitem__(3, pose.dofs[3] + 0.7),
            lambda pose: pose.figure_translation.__setitem__(0, 1.0),
            lambda pose: setattr(pose, "figure_scale", 1.5),
        ):
            change(actor.pose)
            after = drawn(scene)
            drawn(other)  # nothing is left of the first scene
            np.testing.assert_array_equal(after, drawn(scene))
            assert (after != before).any()
            before = after
    for actor in (member, one):
        actor.placement[1, 3] += 1.0
        after = drawn(scene)
        drawn(other)
        np.testing.assert_array_equal(after, drawn(scene))
        assert (after != before).any()
        before = after


def test_groups_that_exceed_a_storage_buffer_are_split(offscreen, monkeypatch):
    scene = crowd(40)
    camera, box, options = default_camera(scene, (64, 48)), scene_box(scene), DisplayOptions()
    whole = offscreen.render(scene, (64, 48), camera, options, box)
    mesh = offscreen.renderer.buffers.mesh(scene.actors[0].figure)
    limit = 10 * BYTES_PER_VERTEX * mesh.n_vertices
    limits = {**offscreen.context.info, "GL_MAX_SHADER_STORAGE_BLOCK_SIZE": limit + 1}
    monkeypatch.setattr(moderngl.Context, "info", property(lambda self: limits))
    buffers = offscreen.renderer.buffers
    groups = buffers.groups(buffers.line_up(scene.actors, options), options)
    assert [len(group.rows) for group in groups] == [10, 10, 10, 10]
    split = offscreen.render(scene, (64, 48), camera, options, box)
    np.testing.assert_array_equal(split, whole)


def test_drivers_without_storage_buffers_draw_actors_one_by_one(offscreen, monkeypatch):
    scene, size = rows_of_arms(FEWEST), (100, 75)
    camera, box = default_camera(scene, size), scene_box(scene)
    together = offscreen.render(scene, size, camera, DisplayOptions(), box)
    monkeypatch.setattr(context, "STORAGE_VERSION", 10_000)
    buffers, options = offscreen.renderer.buffers, DisplayOptions()
    assert buffers.groups(buffers.line_up(scene.actors, options), options) == []
    alone = offscreen.render(scene, size, camera, DisplayOptions(), box)
    assert (np.abs(together.astype(int) - alone).max(axis=-1) > 2).mean() < 0.001


def test_crowd_far_from_the_origin_looks_as_near_it(offscreen):
    pictures = []
    for far in (0.0, 1e6):
        scene = crowd(FEWEST)
        for actor in scene.actors:
            actor.placement[:3, 3] += far
        camera = default_camera(scene, (120, 90))
        options, box = DisplayOptions(grid=False), scene_box(scene)
        pictures.append(offscreen.render(scene, (120, 90), camera, options, box))
    near, far = (picture.astype(int) for picture in pictures)
    # float64 itself resolves 1e-10 there; float32 would be off by 0.06.
    assert (np.abs(near - far).max(axis=-1) > 2).mean() < 0.002


def test_posed_vertices_of_all_crowds_are_bounded(offscreen, work, monkeypatch):
    scene, size = crowd(40), (64, 48)
    camera, box, options = default_camera(scene, size), scene_box(scene), DisplayOptions()
    whole = offscreen.render(scene, size, camera, options, box)
    with offscreen.context:
        offscreen.renderer.buffers.keep_only([])
        mesh = offscreen.renderer.buffers.mesh(scene.actors[0].figure)
    # Groups of a quarter of the bound, 8 actors, of which only four fit.
    monkeypatch.setattr(actor_buffers, "MOST_POSED", 4 * 8 * BYTES_PER_VERTEX * mesh.n_vertices)
    offscreen.renderer.notes.clear()
    for _ in range(3):
        work.clear()
        bounded = offscreen.render(scene, size, camera, options, box)
        np.testing.assert_array_equal(bounded, whole)
        groups = offscreen.renderer.buffers.instanced(scene.actors[0].figure, 5)
        assert [group.vertices.are_lost for group in groups] == 5 * [False]
    assert work["transform"] == 0  # the only group that shares the buffer still holds it
    # With two such groups, each draw skins one again.
    more = crowd(48)
    camera, box = default_camera(more, size), scene_box(more)
    first = offscreen.render(more, size, camera, options, box)
    work.clear()
    assert (offscreen.render(more, size, camera, options, box) == first).all()
    assert work["transform"] == 16
    (note,) = offscreen.renderer.notes
    assert note.startswith("posed vertices of this crowd need more than 0 MiB")
    offscreen.renderer.notes.clear()
    monkeypatch.undo()
    with offscreen.context:
        offscreen.renderer.buffers.keep_only([])
    assert (offscreen.render(more, size, camera, options, box) == first).all()


def test_room_for_more_actors_stays_within_a_storage_buffer(ctx, monkeypatch):
    figure = random_figure(np.random.default_rng(8), 4)
    instances = Instances(ctx, figure)
    vertices = instances.instances.vertices
    limits = {**ctx.info, "GL_MAX_SHADER_STORAGE_BLOCK_SIZE": 13 * vertices.size + 1}
    monkeypatch.setattr(moderngl.Context, "info", property(lambda self: limits))
    sizes = []
    for count in (8, 9, 13):
        vertices.reserve(count)
        sizes.append(vertices.posed.size // vertices.size)
    assert sizes == [8, 12, 13]
    instances.release()


def test_back_faces_of_closed_crowds_are_hidden_also_when_joints_scale(ctx):
    figure = viewer.load(bundled_body()).actors[0].figure
    instances, actors = Instances(ctx, figure), cast(figure, 3, reach=0.2)
    view = view_of(default_camera(Scene(actors), (64, 48)), (64, 48), scene_box(Scene(actors)))

    def hides_backs() -> bool:
        instances.instances.vertices.reserve(len(actors))
        instances.instances.update(group_of(actors), Skinning())
        return instances.instances.hides_backs(view, Skinning())

    assert hides_backs()
    actors[1].pose.scales[3] = 1.0, 1.2, 0.9
    assert hides_backs()
    actors[1].pose.scales[3] = -1.0, 1.2, 0.9  # a part of the surface is turned inside out
    assert not hides_backs()
    instances.release()
