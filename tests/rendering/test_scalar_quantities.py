"""Scalar quantities: values on the GPU, their range, and rendered colours."""

from dataclasses import replace

import numpy as np
import pytest
from builders import family_figure
from rendering.drawn_figures import arm, bent, scene_of, skeleton, square
from rendering.front_view import alone, drawn, front_view, grid_figure, pixel

from viewer.rendering.camera import Camera
from viewer.rendering.colors import NOTHING, colormap, count_palette, joint_palette
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.offscreen import Offscreen
from viewer.rendering.options import DisplayOptions
from viewer.rendering.scalar_look import look_of, typical_span
from viewer.rendering.scalar_quantities import ScalarBuffer, name_for
from viewer.rigs import scalars
from viewer.rigs.annotations import BodyParts
from viewer.rigs.blendshapes import Correctives
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.mesh import Mesh
from viewer.rigs.pose import rest_pose
from viewer.rigs.scalars import SCALARS, compute
from viewer.rigs.scene import Actor, Scene, scene_box
from viewer.rigs.skin import skin_from_lists
from viewer.rigs.skinning import Skinning

LUMA = np.array([0.2126, 0.7152, 0.0722])


def rising(largest=1.0):
    """Return a scene in which "correctives" rises from 0 at the left edge to the right edge."""
    figure = grid_figure()
    offsets = np.zeros((9, figure.mesh.n_vertices, 3))
    # A rotation by 180 degrees about z results in a weight of -2 in row 0.
    offsets[0, :, 1] = largest * (figure.mesh.positions[:, 0] + 1.5) / 6.0
    scene = alone(grid_figure(correctives=Correctives(offsets)))
    scene.actors[0].pose.dofs[5] = np.pi
    return scene


def view_of(offscreen, scene, name="correctives"):
    """Draw without applying the correctives, so that the square does not move."""
    how = Skinning(correctives=False)
    return front_view(offscreen, scene, shading="scalar", scalar=name, skinning=how)


@pytest.mark.parametrize("largest", [1.0, 1e-4, 300.0])
def test_colours_of_the_map_run_from_zero_to_the_largest_value(offscreen, largest):
    picture = view_of(offscreen, rising(largest))
    pixels = colormap()[:, :3].astype(int)
    for x in (-1.4, -0.7, 0.0, 0.7, 1.4):
        # Pixel centres are 0.025 from the requested position, or eight rows of 256.
        row = round(255 * (x + 1.5) / 3.0)
        near = pixels[max(row - 8, 0) : row + 9]
        assert np.abs(near - pixel(picture, x, 0.5)[:3]).max(axis=1).min() <= 6


def test_brightest_pixel_is_where_the_value_is_largest(offscreen):
    picture = view_of(offscreen, rising())
    brightness = picture[..., :3] @ LUMA
    row = brightness[40, drawn(picture)[40]]
    assert len(row) == 60
    assert (np.diff(row) > -1.0).all()
    assert row[-1] > row[0] + 150


def test_figure_without_differences_is_dark_all_over(offscreen):
    scene = alone(grid_figure())
    picture = view_of(offscreen, scene, "methods")
    found = picture[drawn(picture)][:, :3].astype(int)
    assert np.abs(found - colormap()[0, :3]).max() <= 3


def test_values_follow_the_pose(offscreen):
    scene = rising()
    before = view_of(offscreen, scene)
    scene.actors[0].pose.dofs[5] = 0.0
    flat = view_of(offscreen, scene)
    assert pixel(before, 1.4, 0)[:3] != pixel(flat, 1.4, 0)[:3]
    assert pixel(flat, 1.4, 0) == pixel(flat, -1.4, 0)


def test_view_of_an_arm_is_brightest_at_its_twisted_elbow(offscreen):
    actor = bent(arm(3), (2, "x", 2.8))
    actor.placement[:3, 3] = -1.5, 0.0, 0.0
    picture = view_of(offscreen, Scene([actor]), "methods")
    brightness = picture[..., :3] @ LUMA * drawn(picture)
    _, column = np.unravel_index(brightness.argmax(), brightness.shape)
    # The elbow between joints 1 and 2 is at x = 2, half a unit to the right of the middle.
    assert abs((column + 0.5) / 20 - 2.0 - 0.5) < 0.3


@pytest.fixture
def buffers(ctx, tmp_path):
    mesh = MeshBuffers(ctx, family_figure("smplx", tmp_path), [])
    scalar = ScalarBuffer(ctx, mesh)
    yield scalar
    scalar.release()
    mesh.release()


def values_of(buffer: ScalarBuffer):
    return np.frombuffer(buffer.values.read(), dtype="f4")


def posed(figure, seed=0):
    pose = figure_pose(figure)
    pose.dofs[:] = np.random.default_rng(seed).uniform(-1, 1, len(pose.dofs))
    return pose


@pytest.mark.parametrize("name", ["methods", "correctives", "pruning"])
def test_every_split_vertex_has_the_value_of_its_vertex(buffers, name):
    figure = buffers.mesh.figure
    pose, how = posed(figure), Skinning(max_influences=2)
    buffers.update(name, pose, how)
    numbers = compute(name, figure, pose, how)
    assert numbers.max() > 0.0
    np.testing.assert_allclose(values_of(buffers), numbers[buffers.mesh.sources], rtol=1e-6)
    assert buffers.range == (numbers.min(), numbers.max())


def test_values_are_recomputed_only_after_a_change(buffers, monkeypatch):
    calls = []
    original = scalars.compute

    def counted(*parts):
        calls.append(parts[0])
        return original(*parts)

    monkeypatch.setattr("viewer.rendering.scalar_quantities.compute", counted)
    pose, how = posed(buffers.mesh.figure), Skinning()
    for change in (
        lambda: None,
        lambda: pose.dofs.__setitem__(5, 0.5),
        lambda: setattr(how, "method", "dqs"),
        lambda: pose.shape_weights.__setitem__(0, 1.0),
        lambda: setattr(pose, "figure_scale", 3.0),
    ):
        change()
        before = len(calls)
        buffers.update("pruning", pose, how)
        buffers.update("pruning", pose, how)
        assert len(calls) == before + 1
    buffers.update("methods", pose, how)
    assert calls[-1] == "methods"


def test_weight_values_are_computed_once_for_all_poses(buffers):
    pose, how = posed(buffers.mesh.figure), Skinning()
    versions = []
    for change in (
        lambda: None,
        lambda: pose.dofs.__setitem__(5, 0.5),
        lambda: setattr(pose, "figure_scale", 3.0),
        lambda: setattr(how, "max_influences", 2),
    ):
        change()
        buffers.update("entropy", pose, how)
        versions.append(buffers.version)
    assert versions == [1, 1, 1, 2]


def test_missing_joint_has_a_weight_of_zero(buffers):
    buffers.update("weight:nobody", None, Skinning())
    assert buffers.range == (0.0, 0.0)
    assert not values_of(buffers).any()


def test_values_scale_with_the_figure(buffers):
    pose = posed(buffers.mesh.figure)
    buffers.update("methods", pose, Skinning())
    before = buffers.range[1]
    pose.figure_scale = 2.0
    buffers.update("methods", pose, Skinning())
    assert buffers.range[1] == pytest.approx(2.0 * before)


def test_bind_pose_has_zero_values_and_a_range(buffers):
    buffers.update("pruning", posed(buffers.mesh.figure), Skinning(max_influences=1))
    buffers.update("pruning", None, Skinning(max_influences=1))
    assert not values_of(buffers).any()
    assert buffers.range == (0.0, 0.0)


def test_figure_without_a_skin_can_be_drawn_with_scalars(offscreen):
    picture = view_of(offscreen, scene_of(square()), "pruning")
    assert drawn(picture).sum() == 40 * 40


def test_rest_pose_values_differ_from_posed_ones(buffers):
    rest = rest_pose(buffers.mesh.figure.skeleton)
    buffers.update("methods", rest, Skinning())
    assert buffers.range[1] == pytest.approx(0.0, abs=1e-14)


# Colours, lines and ranges


def two_joints(influences):
    """Return a scene of a square from -1.5 to 1.5 with these influences of its corners."""
    corners = [[-1.5, -1.5, 0], [1.5, -1.5, 0], [1.5, 1.5, 0], [-1.5, 1.5, 0]]
    surface = Mesh(
        np.array(corners), np.tile([0.0, 0, 1], (4, 1)), np.array([[0, 1, 2], [0, 2, 3]])
    )
    skin = skin_from_lists(influences, np.tile(np.eye(4), (3, 1, 1)))
    return alone(Figure("square", surface, skeleton([-1, 0, 1], np.zeros((3, 3))), skin))


def shown(offscreen, scene, name, **options):
    options = {"shading": "scalar", "scalar": name, "isolines": False, **options}
    return front_view(offscreen, scene, **options)


LEFT_TO_RIGHT = [[(0, 1.0)], [(1, 1.0)], [(1, 1.0)], [(0, 1.0)]]


def near(found, wanted, by=6):
    return np.abs(np.array(found[:3], int) - np.array(wanted[:3], int)).max() <= by


def test_weight_is_dark_grey_only_on_triangles_without_weight(offscreen):
    # Only the lower right corner is influenced by joint 2: the upper left triangle is not.
    rows = [[(0, 1.0)], [(2, 1.0)], [(0, 1.0)], [(0, 1.0)]]
    picture = shown(offscreen, two_joints(rows), "weight:j2")
    assert near(pixel(picture, -0.8, 0.8), NOTHING, 1)
    low, high = pixel(picture, 0.0, -0.1), pixel(picture, 1.4, -1.4)
    assert not near(low, NOTHING) and high[0] > 200


def test_fixed_range_shifts_and_clamps_the_colours(offscreen):
    scene = two_joints(LEFT_TO_RIGHT)
    pixels = colormap()[:, :3].astype(int)
    picture = shown(offscreen, scene, "weight:j1", scalar_range=(0.25, 0.5))
    # The weight is (x + 1.5) / 3: 0.25 at -0.75, 0.5 at 0.
    for x, row in ((-1.2, 0), (-0.8, 0), (-0.375, 127), (0.1, 255), (1.3, 255)):
        close = pixels[max(row - 10, 0) : row + 11]
        assert np.abs(close - pixel(picture, x, 0.3)[:3]).max(axis=1).min() <= 6


def test_fixed_range_is_in_the_unit_of_the_legend(offscreen):
    scene = rising(0.002)
    scene.actors[0] = Actor(replace(scene.actors[0].figure, unit="m"), scene.actors[0].pose)
    whole = view_of(offscreen, scene)
    # 2 mm at the right edge.
    same = shown(offscreen, scene, "correctives", scalar_range=(0.0, 2.0),
                 skinning=Skinning(correctives=False))  # fmt: skip
    np.testing.assert_array_equal(same, whole)
    assert offscreen.renderer.scalars.legend.unit == "mm"


def test_isolines_are_at_tenths_of_the_range(offscreen):
    scene = two_joints(LEFT_TO_RIGHT)
    plain = shown(offscreen, scene, "weight:j1")
    lined = shown(offscreen, scene, "weight:j1", isolines=True)
    changed = (np.abs(plain.astype(int) - lined).sum(axis=2) > 12).any(axis=0)
    columns = np.flatnonzero(changed)
    # A tenth is 0.3 units or six pixels; there is no line at the edges, where the weight is 0 or 1.
    lines = (columns + 0.5) / 20 - 2.0
    tenths = (lines + 1.5) / 0.3
    assert set(np.round(tenths)) == set(range(1, 10))
    assert np.abs(tenths - np.round(tenths)).max() <= 0.27


def test_isolines_are_on_by_default_for_weights_only(offscreen):
    scene = two_joints(LEFT_TO_RIGHT)
    usual = shown(offscreen, scene, "weight:j1", isolines=None)
    np.testing.assert_array_equal(usual, shown(offscreen, scene, "weight:j1", isolines=True))
    usual = shown(offscreen, scene, "entropy", isolines=None)
    np.testing.assert_array_equal(usual, shown(offscreen, scene, "entropy"))


def test_area_with_one_value_has_no_isoline(offscreen):
    rows = [[(0, 0.5), (1, 0.5)]] * 4
    picture = shown(offscreen, two_joints(rows), "weight:j1", isolines=True)
    found = picture[drawn(picture)]
    assert (found == found[0]).all()


def test_dominant_joints_meet_in_a_sharp_border(offscreen):
    picture = shown(offscreen, two_joints(LEFT_TO_RIGHT), "dominant")
    colors = joint_palette(np.array([-1, 0, 1]))
    row = picture[40, drawn(picture)[40]]
    is_first = np.array([near(found, colors[0]) for found in row])
    is_second = np.array([near(found, colors[1]) for found in row])
    # The border is in the middle, and at most two pixels have neither colour.
    assert is_first[:29].all() and is_second[31:].all()
    assert (is_first | is_second).sum() >= 58


def test_each_corner_of_a_triangle_shows_its_category(offscreen):
    rows = [[(0, 1.0)], [(1, 1.0)], [(2, 1.0)], [(0, 1.0)]]
    picture = shown(offscreen, two_joints(rows), "dominant")
    colors = joint_palette(np.array([-1, 0, 1]))
    for x, y, joint in ((-1.3, -1.3, 0), (1.4, -1.3, 1), (1.4, 1.3, 2), (1.4, -0.2, 1)):
        assert near(pixel(picture, x, y), colors[joint]), (x, y)


def test_interpolated_counts_are_not_shown(offscreen):
    one, three = [(0, 1.0)], [(0, 0.4), (1, 0.3), (2, 0.3)]
    picture = shown(offscreen, two_joints([one, three, three, one]), "influences")
    colors = count_palette(3)
    row = picture[40, drawn(picture)[40]]
    assert not any(near(found, colors[2]) for found in row)
    assert near(row[5], colors[1]) and near(row[-5], colors[3])


def test_vertex_without_influence_is_grey_in_the_dominant_joint_view(offscreen):
    picture = shown(offscreen, two_joints([[], [], [], []]), "dominant")
    assert near(pixel(picture, 0.2, 0.1), NOTHING, 1)


def test_parts_have_the_colours_of_the_part_shading(offscreen):
    scene = two_joints(LEFT_TO_RIGHT)
    parts = BodyParts(("a", "b"), np.array([0, 1, 1, 0]))
    scene = alone(replace(scene.actors[0].figure, body_parts=parts))
    one = shown(offscreen, scene, "parts")
    other = front_view(offscreen, scene, shading="parts")
    for x in (-1.4, 1.4):
        assert near(pixel(one, x, 0.1), pixel(other, x, 0.1), 12)


def test_view_without_a_joint_shows_the_selected_joint(offscreen):
    scene = two_joints(LEFT_TO_RIGHT)
    wanted = shown(offscreen, scene, "weight:j1")
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)
    options = DisplayOptions(background="transparent", grid=False, samples=1, shading="scalar",
                             scalar="weight", isolines=False)  # fmt: skip
    with offscreen.context:
        target = offscreen.target((80, 80), 1)
        offscreen.renderer.draw(scene, camera, options, target, scene_box(scene), (0, 1))
        found = target.read()
        assert offscreen.renderer.scalars.legend.title == "Weight of j1"
        offscreen.renderer.draw(scene, camera, options, target, scene_box(scene), (0, -1))
        assert offscreen.renderer.scalars.legend.note == "no joint is selected"
    np.testing.assert_array_equal(found, wanted)


def test_name_of_the_selected_joint_is_reserved():
    actor = two_joints(LEFT_TO_RIGHT).actors[0]
    assert name_for("weight", actor, 2) == "weight:j2"
    assert name_for("weight:j0", actor, 2) == "weight:j0"
    assert name_for("pruning", actor, 2) == "pruning"
    assert name_for("weight", actor, -1) == name_for("weight", None, 1) == "weight"
    assert name_for("weight", alone(grid_figure()).actors[0], 7) == "weight"


def test_same_colour_means_same_value_on_all_figures(offscreen):
    small, large = rising(0.5).actors[0], rising(1.0).actors[0]
    both = Scene([small, large])
    how = Skinning(correctives=False)
    options = {"shading": "scalar", "scalar": "correctives", "skinning": how}
    front_view(offscreen, both, **options)
    ends = [offscreen.renderer.buffers.posed_mesh(actor).scalars.look.ends for actor in both.actors]
    assert ends == [(0.0, 1.0), (0.0, 1.0)]
    assert offscreen.renderer.scalars.range == (0.0, 1.0)


def test_figure_without_the_quantity_is_drawn_normally(offscreen):
    having = rising().actors[0]
    lacking = alone(grid_figure()).actors[0]
    having.placement[0, 3], lacking.placement[0, 3] = -2.0, 2.0
    colors = {"shading": "scalar", "skinning": Skinning(correctives=False)}
    together = front_view(offscreen, Scene([having, lacking]), scalar="correctives", **colors)
    legend = offscreen.renderer.scalars.legend
    assert legend.title == "Effect of pose correctives" and len(legend.colors)
    apart = [front_view(offscreen, Scene([having]), scalar="correctives", **colors),
             front_view(offscreen, Scene([lacking]))]  # fmt: skip
    half = together.shape[1] // 2
    np.testing.assert_array_equal(together[:, :half], apart[0][:, :half])
    np.testing.assert_array_equal(together[:, half:], apart[1][:, half:])
    # If the figure with correctives is hidden, the other is unchanged and the legend keeps its
    # title.
    having.visible = False
    alone_now = front_view(offscreen, Scene([having, lacking]), scalar="correctives", **colors)
    np.testing.assert_array_equal(alone_now[:, half:], apart[1][:, half:])
    legend = offscreen.renderer.scalars.legend
    assert legend.title == "Effect of pose correctives"
    assert legend.note == "not available for the visible figures"
    assert offscreen.renderer.scalars.range == (0.0, 0.0)


def test_largest_one_percent_of_values_is_ignored():
    # The 99th percentile of 1 to 1000 is 990 or slightly more; the sign does not matter.
    numbers = np.arange(1.0, 1001.0)
    low, high = typical_span(numbers)
    assert low == 1.0 and 990 <= high <= 991
    assert typical_span(-numbers) == (-high, -1.0)
    numbers[:500] *= -1.0
    assert typical_span(numbers) == (-500.0, high)


def test_zero_values_are_ignored():
    # Only 50 of 10,000 vertices move, so nearly all values are 0; the range is that of the 50.
    numbers = np.zeros(10_000)
    numbers[:50] = np.linspace(-20, 30, 50)
    assert typical_span(numbers) == (-20.0, 30.0)


def test_all_values_of_small_samples_are_typical():
    assert typical_span(np.array([0.0, -3.0, 7.0])) == (-3.0, 7.0)
    assert typical_span(np.zeros(5)) == (0.0, 0.0)
    assert typical_span(np.arange(100.0)) == (0.0, 99.0)


@pytest.mark.parametrize("name", SCALARS)
def test_only_automatic_strain_ranges_are_robust(name):
    figure = grid_figure()
    is_robust = name in ("stretch", "stretch-mean", "area")
    assert SCALARS[name].robust == is_robust
    assert look_of(name, figure, (-1.0, 1.0), DisplayOptions()).is_typical == is_robust
    fixed = DisplayOptions(scalar_range=(-1.0, 1.0))
    assert not look_of(name, figure, (-1.0, 1.0), fixed).is_typical


def test_one_outlier_does_not_flatten_the_other_colours():
    # The weights of joint 1 increase to the right; a single vertex has weight 1.
    figure = grid_figure(40)
    x = (figure.mesh.positions[:, 0] + 1.5) / 3.0
    weights = 0.5 * x**2
    weights[820] = 1.0
    rows = [[(0, 1.0 - w), (1, w)] for w in weights.tolist()]
    skin = skin_from_lists(rows, np.tile(np.eye(4), (2, 1, 1)))
    scene = alone(type(figure)("grid", figure.mesh, figure.skeleton, skin))
    actor = scene.actors[0]
    actor.pose.translations[1] = 0.3, 0.0, 0.0
    with Offscreen() as offscreen:
        front_view(offscreen, scene, shading="scalar", scalar="stretch")
        scalars = offscreen.renderer.scalars
        legend = scalars.legend
        front_view(offscreen, scene, shading="scalar", scalar="stretch", scalar_range=(-10.0, 10.0))
        fixed = scalars.ends, offscreen.renderer.scalars.legend.note
        numbers = compute("stretch", actor.figure, actor.pose, DisplayOptions().skinning)
        front_view(offscreen, scene, shading="scalar", scalar="stretch")
    amounts = np.sort(np.abs(numbers[numbers != 0.0]))
    most = amounts[int(np.ceil(0.99 * (len(amounts) - 1)))]
    assert amounts[-1] > 3.0 * most  # the outlier
    assert scalars.ends == pytest.approx((-most, most))
    assert scalars.range == pytest.approx((numbers.min(), numbers.max()))
    low, high = numbers.min(), numbers.max()
    span = f"from {low:+.3g} to {high:+.3g}"
    assert legend.note == f"99 %: up to ±{most:.3g}; {span}"
    assert fixed == ((-10.0, 10.0), span)
