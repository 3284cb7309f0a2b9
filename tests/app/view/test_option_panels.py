"""The Display, Camera, Lights and Stats panels: every widget changes the option that it names."""

from dataclasses import replace

import numpy as np
import pytest
from formats.filmed_capture import write_filmed
from numpy.testing import assert_allclose
from rendering.moving import moving_camera

from viewer.app.view.camera_panel import look_through
from viewer.app.view.display_panel import JOINT_TOGGLES
from viewer.app.weights.weights_panel import Weights
from viewer.rendering.camera import VIEWS, eye
from viewer.rendering.gpu.program import SHADING_CHOICES
from viewer.rendering.options import BACKGROUNDS, BONES, MATCAPS, SHOWN, Lights
from viewer.rigs.scene import Actor


@pytest.fixture
def tall(drive, rig):
    """A test driver on a window that shows every widget without scrolling."""
    return drive(*rig, size=(1000, 1000))


def _show_lights(hand):
    hand.show_panel("Lights")
    assert "Ambient" in hand.state.item_rects


@pytest.mark.parametrize("shown", SHOWN)
def test_radio_button_chooses_the_shown_parts(tall, shown):
    tall.state.options.show = "skeleton" if shown == "skin" else "skin"
    tall.step(2)
    before = tall.scene_picture()
    tall.click(SHOWN[shown])
    assert tall.state.options.show == shown
    assert (tall.scene_picture() != before).any()


@pytest.mark.parametrize(
    ("label", "option"),
    [
        ("Flat", "flat"),
        ("Wireframe", "wireframe"),
        ("Vertex normals", "normals"),
        ("Cull back faces", "cull"),
        ("grid", "grid"),
    ],
)
def test_check_box_is_one_step(tall, label, option):
    if label == "grid":
        label = next(label for label in tall.state.item_rects if label.startswith("Grid"))
    before = getattr(tall.state.options, option)
    tall.click(label)
    assert getattr(tall.state.options, option) is not before
    assert tall.undo_steps == 1
    tall.click(label)
    assert getattr(tall.state.options, option) is before


def test_opacity_is_a_slider_and_one_step(tall):
    opaque = tall.scene_picture()
    tall.drag("Opacity", 0.25)
    quarter = tall.state.options.opacity
    assert quarter == pytest.approx(0.25, abs=0.02)
    assert (tall.scene_picture() != opaque).any()
    assert tall.undo_steps == 1
    tall.key("z", "ctrl")
    assert tall.state.options.opacity == 1.0
    assert (tall.scene_picture() == opaque).all()
    tall.key("y", "ctrl")
    assert tall.state.options.opacity == quarter


def test_skin_opacity_is_a_slider_while_both_are_shown(tall):
    assert "Skeleton opacity" not in tall.state.item_rects
    tall.click(SHOWN["both"])
    before = tall.scene_picture()
    tall.drag("Skeleton opacity", 1.3)
    assert tall.state.options.skeleton_opacity == pytest.approx(1.0, abs=0.02)
    assert (tall.scene_picture() != before).any()


def test_bones_are_chosen_from_a_list(tall):
    tall.click(SHOWN["skeleton"])
    before = tall.scene_picture()
    tall.pick("Bones", list(BONES).index("octahedra"))
    assert tall.state.options.bones == "octahedra"
    assert (tall.scene_picture() != before).any()
    tall.key("z", "ctrl")
    assert tall.state.options.bones == "auto"


def test_shading_is_chosen_from_a_list(tall):
    for number, name in enumerate(SHADING_CHOICES):
        tall.pick("Shading", number)
        assert tall.state.options.shading == name


def test_shadings_show_the_widgets_they_use(tall):
    tall.pick("Shading", list(SHADING_CHOICES).index("matcap"))
    assert "Roughness" not in tall.state.item_rects
    tall.pick("Matcap", list(MATCAPS).index("chrome"))
    assert tall.state.options.matcap == "chrome"
    tall.pick("Shading", list(SHADING_CHOICES).index("pbr"))
    before = tall.scene_picture()
    tall.drag("Metallic", 1.3)
    assert tall.state.options.metallic == 1.0
    assert (tall.scene_picture() != before).any()
    assert "Matcap" not in tall.state.item_rects


def test_background_is_chosen_from_a_list(tall):
    for number, name in enumerate(BACKGROUNDS):
        tall.pick("Background", number)
        assert tall.state.options.background == name
    tall.pick("Background", len(BACKGROUNDS))
    assert tall.state.options.background == "#ffffff"
    assert "Colour" in tall.state.item_rects
    tall.click(tall.place("Colour", 0.35), held="ctrl")
    tall.type("0")
    tall.key("enter")
    tall.step(2)
    assert tall.state.options.background == "#ff00ff"
    tall.pick("Background", 0)
    assert tall.state.options.background == "gradient"


@pytest.mark.parametrize(
    ("label", "attribute", "low", "high"),
    [
        ("Azimuth", "azimuth", -180, 180),
        ("Inclination", "inclination", -90, 90),
        ("Field of view", "fov", 5, 120),
    ],
)
def test_camera_slider_sets_its_angle(tall, label, attribute, low, high):
    for fraction in (0.2, 0.7):
        tall.drag(label, fraction)
        wanted = low + fraction * (high - low)
        assert getattr(tall.state.camera, attribute) == pytest.approx(wanted, abs=0.03 * 360)


def test_camera_changes_are_not_undo_steps(tall):
    tall.drag("Azimuth", 0.9)
    tall.wheel(2, tall.middle)
    tall.click("Top")
    assert tall.undo_steps == 0


def test_distance_slider_moves_the_eye(tall):
    tall.drag("Distance", 0.1)
    near = tall.state.camera.distance
    tall.drag("Distance", 0.9)
    assert tall.state.camera.distance > 5 * near
    tall.click("Fit (F)")
    assert near < tall.state.camera.distance < 20


def test_typed_camera_values_leave_a_valid_camera(tall):
    for text in ("0", "-5", "nan", "inf", "1e39", "3e38", "1e-44", ""):
        for label in ("Distance", "Azimuth", "Inclination", "Field of view"):
            tall.enter_value(label, text)
        tall.wheel(2, tall.middle)
        tall.pull(tall.middle, (tall.middle[0] + 30, tall.middle[1] + 30), button=1)
        tall.assert_sane()
        camera = tall.state.camera
        assert -90 <= camera.inclination <= 90 and 5 <= camera.fov <= 120, text
        tall.click("Fit (F)")


@pytest.mark.parametrize("name", VIEWS)
def test_named_view_button_rotates_the_camera(tall, name):
    tall.state.camera.azimuth, tall.state.camera.inclination = 1.0, 2.0
    tall.click(name.capitalize())
    assert (tall.state.camera.azimuth, tall.state.camera.inclination) == VIEWS[name]


def test_orthographic_box_switches_the_projection(tall):
    tall.click("Orthographic")
    assert tall.state.camera.orthographic
    tall.click("Orthographic")
    assert not tall.state.camera.orthographic


@pytest.mark.parametrize("light", ["Key", "Rim"])
@pytest.mark.parametrize("part", ["Strength", "Azimuth", "Elevation"])
def test_light_slider_changes_only_its_light(tall, light, part):
    _show_lights(tall)
    tall.drag(f"{light} {part}", 0.9)
    lights, usual = tall.state.options.lights, Lights()
    changed, other = (lights.key, lights.rim) if light == "Key" else (lights.rim, lights.key)
    was, same = (usual.key, usual.rim) if light == "Key" else (usual.rim, usual.key)
    field = {"Elevation": "inclination"}.get(part, part.lower())
    assert getattr(changed, field) != getattr(was, field)
    assert other == same and tall.undo_steps == 1


@pytest.mark.parametrize("part", ["Ambient", "Specular", "Shininess"])
def test_light_slider_is_one_step_and_can_be_reset(tall, part):
    _show_lights(tall)
    before = tall.scene_picture()
    tall.drag(part, 0.9)
    assert getattr(tall.state.options.lights, part.lower()) != getattr(Lights(), part.lower())
    assert tall.undo_steps == 1
    assert part == "Shininess" or (tall.scene_picture() != before).any()
    tall.click("Reset lights")
    assert tall.state.options.lights == Lights()
    tall.key("z", "ctrl")
    assert tall.state.options.lights != Lights()


def test_light_beyond_its_sliders_is_kept(tall):
    key = tall.state.options.lights.key
    key.azimuth, key.strength = 200.0, 6.0
    _show_lights(tall)
    tall.drag("Rim Azimuth", 0.9)
    assert (key.azimuth, key.strength) == (200.0, 6.0)
    tall.drag("Key Azimuth", 0.9)
    assert -180.0 <= key.azimuth <= 180.0 and key.strength == 6.0


def test_lights_can_be_fixed_to_the_scene(tall):
    _show_lights(tall)
    tall.click("Follow the camera")
    assert not tall.state.options.lights.follow_camera


def test_light_colour_is_picked(tall):
    _show_lights(tall)
    before = tall.state.options.lights.key.color
    x0, y0, _x1, y1 = tall.state.item_rects["Key light"]
    tall.click((x0 + 5, (y0 + y1) / 2))
    tall.step(3)
    x, y = x0 + 60, y1 + 60  # in the square of the colour picker below
    tall.pull((x, y), (x + 30, y + 20))
    assert tall.state.options.lights.key.color != before
    assert tall.state.options.lights.rim == Lights().rim
    assert all(0 <= value <= 1 for value in tall.state.options.lights.key.color)


def test_stats_follow_added_removed_and_changed_actors(tall, texts):
    def vertices():
        texts.clear()
        tall.step()
        return texts[texts.index("Vertices") + 1]

    assert vertices() == "12"
    tall.state.scene.actors.append(Actor(tall.state.actor.figure))
    tall.step(2)
    assert vertices() == "24"
    tall.key("z", "ctrl")
    assert vertices() == "12"
    tall.key("y", "ctrl")
    assert vertices() == "24"
    # One figure replaced by another.
    bare = replace(tall.state.actor.figure, mesh=None, skin=None)
    tall.state.scene.actors[1] = Actor(bare)
    tall.step(2)
    assert vertices() == "12"


def test_stats_list_the_facts_in_the_file_of_the_chosen_figure(tall, texts):
    tall.step()
    assert "Licence" not in texts
    facts = ("generator", "by hand"), ("licence", "CC-BY 4.0\n"), ("violent use", "not allowed")
    told = replace(tall.state.actor.figure, facts=facts)
    tall.state.scene.actors.append(Actor(told))
    tall.state.choose_actor(1)
    texts.clear()
    tall.step()
    found = texts[texts.index("Generator") :][:6]
    assert found == [
        "Generator",
        "by hand",
        "Licence",
        "CC-BY 4.0\\n",
        "Violent use",
        "not allowed",
    ]


def test_check_box_of_vertex_colours_is_shown_with_vertex_colours(drive, tmp_path):
    rows = "0 0 0 255 0 0\n1 0 0 255 0 0\n0 1 0 255 0 0\n3 0 1 2\n"
    names = [f"float {name}" for name in "xyz"] + [
        f"uchar {name}" for name in ("red", "green", "blue")
    ]
    path = tmp_path / "red.ply"
    path.write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\n"
        + "".join(f"property {name}\n" for name in names)
        + f"element face 1\nproperty list uchar int vertex_indices\nend_header\n{rows}"
    )
    hand = drive(path, size=(1000, 1000))
    before = hand.scene_picture()
    hand.click("Vertex colours")
    assert not hand.state.options.vertex_colors and hand.undo_steps == 1
    assert (hand.scene_picture() != before).any()


def test_check_box_of_vertex_colours_is_hidden_without_vertex_colours(tall):
    assert "Vertex colours" not in tall.state.item_rects


@pytest.fixture
def filmed(drive, tmp_path):
    """A driver on the Camera panel of a capture with one camera and images of grey 100 / 255."""
    driver = drive(write_filmed(tmp_path / "take"), size=(1000, 900), pixels_per_point=1.0)
    driver.state.options.grid = False
    driver.state.options.background = "white"
    driver.show_panel("Camera")
    return driver


def picture(driver) -> np.ndarray:
    driver.step(3)
    return np.array(driver.scene_picture())[..., :3].astype(int)


def test_show_cameras_draws_frusta_with_their_images(filmed):
    # The camera stands 5 m from the keypoints.
    filmed.state.camera.distance, filmed.state.camera.azimuth = 25.0, 40.0
    plain = picture(filmed)
    filmed.click("Show cameras")
    assert filmed.state.options.cameras
    shown = picture(filmed)
    changed = np.abs(shown - plain).max(axis=2) > 20
    image = (np.abs(shown - 100) <= 2).all(axis=2) & changed
    lines = changed & ~image
    assert image.sum() > 20 and lines.sum() > 20
    filmed.click("Show cameras")
    assert not filmed.state.options.cameras
    assert np.array_equal(picture(filmed), plain)


def test_image_brightness_dims_the_image_of_the_camera(filmed):
    assert "Image brightness" not in filmed.state.item_rects
    filmed.pick("Calibrated camera", 1)
    assert filmed.state.camera.fixed is filmed.state.scene.views[0]
    grey = []
    for value in ("", "1", "0.25", "0"):
        if value:
            filmed.enter_value("Image brightness", value)
        # The border of the image contains no points.
        shown = picture(filmed)
        grey.append(np.median(shown[:, shown.shape[1] // 2 - 60]))
    # 100 of 255 in the file, dimmed to 60 % at first; without an image the background is white.
    assert grey == [60, 100, 25, 255]


def test_view_follows_a_moving_camera_during_playback(filmed):
    state = filmed.state
    view = moving_camera()
    state.scene.views = (view,)
    look_through(state, 0)
    state.clock.seek(1 / 30)
    filmed.step(2)
    # A third of the way from its first to its second frame.
    assert_allclose(eye(state.camera)[0], 0.2 / 3.0, atol=1e-9)
    assert state.camera.fixed is view


KEYS = {"xray": ("b", ""), "joint_names": ("j", ""), "joint_axes": ("j", "shift")}


@pytest.mark.parametrize("name", JOINT_TOGGLES)
def test_menu_and_key_toggle_joint_display(hand, name):
    text, _ = JOINT_TOGGLES[name]
    before = hand.scene_picture()
    hand.menu("menu View", text)
    assert getattr(hand.state.options, name) and hand.says(f"{text} on")
    hand.step(2)
    assert (hand.scene_picture() != before).any()
    assert hand.undo_steps == 1
    key, held = KEYS[name]
    hand.key(key, held)
    hand.step(2)
    assert not getattr(hand.state.options, name) and hand.says(f"{text} off")
    assert (hand.scene_picture() == before).all()


def test_display_panel_has_the_same_check_boxes(drive, rig):
    hand = drive(*rig, size=(1000, 1000), samples=1)
    for short, name in (("X-ray", "xray"), ("Names", "joint_names"), ("Axes", "joint_axes")):
        hand.click(f"{short}###{name}")
        assert getattr(hand.state.options, name)


def test_menu_turns_the_heat_map_on_and_off(hand):
    hand.click(hand.place("joint arm", 0.5))
    hand.menu("menu View", "Weights of the selected joint")
    assert (hand.state.options.shading, hand.state.options.scalar) == ("scalar", "weight")
    assert hand.says("Weights of arm")
    hand.menu("menu View", "Weights of the selected joint")
    assert hand.state.options.shading == "auto"


def test_menu_toggles_picking_of_vertices(hand):
    hand.menu("menu View", "Pick vertices")
    assert hand.state.of(Weights).picks_vertices and hand.says("Clicks pin vertices")
    hand.menu("menu View", "Pick vertices")
    assert not hand.state.of(Weights).picks_vertices


def test_joint_display_is_greyed_without_a_skeleton(drive, rig):
    hand = drive(rig[1])
    for text in ("X-ray", "Joint names", "Joint axes", "Unpin vertex"):
        hand.menu("menu View", text)
        hand.key("escape")
    assert not hand.state.options.xray and not hand.state.options.joint_names


def test_vertex_display_is_greyed_without_a_skin(drive, rig):
    lone = drive(rig[0])
    for text in ("Weights of the selected joint", "Pick vertices", "Inspect vertex under cursor"):
        lone.menu("menu View", text)
        lone.key("escape")
    assert lone.state.options.shading == "auto" and not lone.state.of(Weights).picks_vertices
