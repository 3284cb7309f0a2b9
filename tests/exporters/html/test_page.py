"""Pages opened in Chromium: positions of the shaders, controls, and nothing from a network."""

import io
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from browser import needs_chromium
from builders import family_figure, quaternions
from numpy.testing import assert_allclose
from PIL import Image

import viewer
from viewer.cli import run
from viewer.errors import RigError
from viewer.exporters import ExportOptions, Part, Selection, export
from viewer.rigs.blendshapes import BlendShapes
from viewer.rigs.figure import figure_pose
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.motion.evaluation import pose_of
from viewer.rigs.motion.sampled_animation import sample_animation
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.skin import Skin
from viewer.rigs.skinning import Skinning, deform

HOSTILE = "</script><script>document.title='broken'</script>"
EXACT = 1e-5  # of the figure's size, the accuracy that pages promise


def tangle(n_joints=17, n_vertices=90, n_influences=13, far=0.0, seed=1, **parts):
    """A chain of joints with random triangles, each vertex with many influences."""
    random = np.random.default_rng(seed)
    offsets = random.normal(size=(n_joints, 3)) * 0.3 + [0.0, 0.2, 0.0]
    offsets[0] = far
    joints = np.cumsum(offsets, axis=0)
    none = np.zeros(0, dtype=np.int32)
    skeleton = Skeleton(
        names=(HOSTILE, *(f"joint {number}" for number in range(1, n_joints))),
        parents=np.arange(-1, n_joints - 1, dtype=np.int32),
        rest_translations=offsets,
        rest_rotations=np.tile([0.0, 0.0, 0.0, 1.0], (n_joints, 1)),
        rest_scales=np.ones((n_joints, 3)),
        dof_joints=none,
        dof_kinds=none,
        rest_dofs=np.zeros(0),
        dof_limits=np.zeros((0, 2)),
    )
    inverse = np.tile(np.eye(4), (n_joints, 1, 1))
    inverse[:, :3, 3] = -joints
    weights = random.dirichlet(np.ones(n_influences), size=n_vertices)
    chosen = [random.permutation(n_joints)[:n_influences] for _ in range(n_vertices)]
    skin = Skin(
        starts=np.arange(n_vertices + 1, dtype=np.int32) * n_influences,
        joints=np.concatenate(chosen).astype(np.int32),
        weights=weights.reshape(-1),
        inverse_bind=inverse,
    )
    positions = joints[random.integers(n_joints, size=n_vertices)]
    positions = positions + random.normal(size=(n_vertices, 3)) * 0.2
    triangles = random.permutation(n_vertices).reshape(-1, 3)
    normals = random.normal(size=(n_vertices, 3))
    mesh = viewer.Mesh(positions, normals, triangles.astype(np.int32))
    return viewer.Figure(HOSTILE, mesh=mesh, skeleton=skeleton, skin=skin, **parts)


def moving(figure, n_frames=5, rate=10.0, scales=None, shapes=None, missing=(), seed=2):
    """An actor whose joints rotate at random, and whose root moves."""
    random = np.random.default_rng(seed)
    n_joints = figure.skeleton.n_joints
    translations = np.zeros((n_frames, n_joints, 3))
    translations[:, 0] = random.normal(size=(n_frames, 3))
    rows = [-1 if frame in missing else frame for frame in range(n_frames)]
    clip = SampledClip(
        "dance",
        Timing(rate, np.array(rows, dtype=np.int32)),
        quaternions(random.normal(size=(n_frames, n_joints, 3))),
        translations,
        random.normal(size=(n_frames, 3)),
        random.uniform(0.5, 2.0, size=n_frames),
        shape_weights=None if shapes is None else shapes,
        scales=None if scales is None else scales,
    )
    return Actor(figure, figure_pose(figure), clip)


def write(path, *actors, how=None):
    """Write the motions of some actors; return each animation and the notes."""
    animations = [sample_animation(each) for each in actors]
    parts = [Part(actor, None, each) for actor, each in zip(actors, animations, strict=True)]
    scene = Scene([*actors]) if len(actors) > 1 else None
    notes = export(Selection(parts, scene), path, skinning=how)
    return animations, [str(each) for each in notes]


def positions_at(browser, time, index=0):
    browser.run(f"viewer.seek({time}).then(() => null)")
    return np.array(browser.run(f"viewer.positions({index})"))


def check_frames(browser, animation, how, frames, index=0):
    """Compare the vertices of the shader with the float64 reference."""
    figure = animation.figure
    for frame in frames:
        wanted = deform(figure, pose_of(figure, animation.frames, frame), how)[0]
        found = positions_at(browser, frame / animation.frame_rate, index)
        scale = animation.frames.figure_scales[frame]
        size = box_size(bounding_box(figure.mesh.positions)) * max(scale, 1.0)
        assert np.linalg.norm(found - wanted, axis=1).max() <= EXACT * size, frame


@needs_chromium
def test_vertices_are_those_of_the_pose_in_which_they_were_asked_for(browser, tmp_path):
    write(tmp_path / "a.html", moving(tangle()))
    browser.open(tmp_path / "a.html")
    browser.run("viewer.seek(0.2).then(() => null)")
    asked = "const asked = page.vertices(0); page.seek(0.4); page.pose()"
    found = browser.run(
        f"viewer.ready.then(async page => {{ {asked}; return (await asked).positions; }})"
    )
    assert_allclose(found, positions_at(browser, 0.2), atol=1e-12)


def scales_of(figure, n_frames=5):
    random = np.random.default_rng(8)
    return random.uniform(0.6, 1.5, size=(n_frames, figure.skeleton.n_joints, 3))


@needs_chromium
@pytest.mark.parametrize("method", ["lbs", "dqs", "mix"])
@pytest.mark.parametrize("scaled", [False, True])
def test_thirteen_influences_are_exact(browser, tmp_path, method, scaled):
    figure = tangle(far=40.0)
    scales = scales_of(figure) if scaled else None
    how = Skinning(method, 0.3)
    (animation,), _ = write(tmp_path / "a.html", moving(figure, scales=scales), how=how)
    browser.open(tmp_path / "a.html")
    check_frames(browser, animation, how, [0, 2, 4])
    assert browser.messages == [] and browser.run("document.title") == "a"
    assert all(each.startswith(("file:", "data:")) for each in browser.requests)


@needs_chromium
def test_shapes_and_correctives_move_the_rest_vertices(browser, tmp_path):
    plain = tangle(n_joints=4, n_influences=2)
    random = np.random.default_rng(9)
    shapes = BlendShapes(("a", "b", "c"), random.normal(size=(3, 90, 3)) * 0.1)
    correctives = viewer.rigs.blendshapes.Correctives(random.normal(size=(27, 90, 3)) * 0.05)
    figure = replace(plain, blend_shapes=shapes, correctives=correctives)
    weights = random.normal(size=(5, 3))
    weights[2] = 0.0  # this frame has the normals of the file, the others those of their surface
    (animation,), _ = write(tmp_path / "a.html", moving(figure, shapes=weights))
    browser.open(tmp_path / "a.html")
    check_frames(browser, animation, Skinning(), [0, 1, 4])
    check_normals(browser, animation, [0, 1, 2, 4])
    assert browser.messages == []


@needs_chromium
def test_smooth_correctives_of_a_mesh_are_exact(browser, tmp_path):
    """They are stored as differences from parallelograms of the mesh."""
    places = np.stack(np.divmod(np.arange(1200), 4), axis=1)
    first = np.arange(1200).reshape(300, 4)[:-1, :-1].reshape(-1, 1)
    squares = first + np.array([[0, 1, 5, 4]])
    triangles = np.concatenate([squares[:, [0, 1, 2]], squares[:, [0, 2, 3]]]).astype(np.int32)
    plain, random = tangle(n_joints=4, n_influences=2, n_vertices=1200), np.random.default_rng(11)
    waves = np.sin(np.einsum("va,ka->kv", places, random.normal(size=(81, 2)) * 0.1))
    offsets = waves.reshape(27, 3, 1200).transpose(0, 2, 1) * 0.05
    correctives = viewer.rigs.blendshapes.Correctives(offsets)
    mesh = replace(plain.mesh, triangles=triangles, triangle_materials=None, triangle_parts=None)
    figure = replace(plain, mesh=mesh, correctives=correctives)
    (animation,), _ = write(tmp_path / "a.html", moving(figure, n_frames=30))
    assert '"near":' in (tmp_path / "a.html").read_text("utf-8")
    browser.open(tmp_path / "a.html")
    check_frames(browser, animation, Skinning(), [0, 13, 29])
    assert browser.messages == []


def check_normals(browser, animation, frames):
    """Compare the unit normals of the shader with the float64 reference."""
    for frame in frames:
        pose = pose_of(animation.figure, animation.frames, frame)
        wanted = deform(animation.figure, pose, Skinning())[1]
        browser.run(f"viewer.seek({frame / animation.frame_rate}).then(() => null)")
        found = np.array(browser.run("viewer.normals()"))
        assert_allclose(found, wanted, atol=5e-3, err_msg=str(frame))  # half a degree


@needs_chromium
@pytest.mark.parametrize("attached", [False, True])
def test_offsets_of_normals_are_those_of_the_blend_shapes(browser, tmp_path, attached):
    plain, random = tangle(n_joints=3, n_influences=2), np.random.default_rng(10)
    turns = random.normal(size=(2, 90, 3)) * 0.4
    moves = random.normal(size=(2, 90, 3)) * 0.1
    figure = replace(plain, blend_shapes=BlendShapes(("a", "b"), moves, normal_offsets=turns))
    if not attached:
        figure = replace(figure, skin=None)
    actor = moving(figure, shapes=random.uniform(size=(5, 2)))
    (animation,), _ = write(tmp_path / "a.html", actor)
    browser.open(tmp_path / "a.html")
    check_frames(browser, animation, Skinning(), [0, 3])
    check_normals(browser, animation, [1, 4])


@needs_chromium
@pytest.mark.parametrize("changes", [False, True])
def test_smpl_body_in_motion_with_its_shape(browser, tmp_path, changes):
    """Shapes move the joints, too; in the second motion they change from frame to frame."""
    figure = family_figure("smpl", tmp_path)
    random = np.random.default_rng(4)
    shapes = random.normal(size=(5 if changes else 1, figure.n_shapes)) * 2.0
    actor = moving(figure, shapes=np.broadcast_to(shapes, (5, figure.n_shapes)))
    (animation,), _ = write(tmp_path / "a.html", actor)
    browser.open(tmp_path / "a.html")
    check_frames(browser, animation, Skinning(), [0, 3])


@needs_chromium
def test_weights_that_do_not_sum_to_one_are_exact(browser, tmp_path):
    plain = tangle(far=3.0)
    uneven = np.random.default_rng(3).uniform(0.8, 1.3, size=90).repeat(13)
    figure = replace(plain, skin=replace(plain.skin, weights=plain.skin.weights * uneven))
    (animation,), _ = write(tmp_path / "a.html", moving(figure))
    browser.open(tmp_path / "a.html")
    check_frames(browser, animation, Skinning(), [1, 4])


@needs_chromium
def test_small_figure_far_away_is_exact(browser, tmp_path):
    """Scales of 0.01, and places a thousand times the figure's size away, as in centimetres."""
    figure = tangle(n_joints=6, n_influences=3)
    actor = moving(figure)
    far = actor.clip.translations.copy()
    far[:, 0, 0] += 4000.0
    scales = 0.01 * actor.clip.figure_scales
    actor.clip = replace(actor.clip, translations=far, figure_scales=scales)
    (animation,), _ = write(tmp_path / "a.html", actor)
    browser.open(tmp_path / "a.html")
    size = box_size(bounding_box(figure.mesh.positions))
    for frame in (0, 3):
        wanted = deform(figure, pose_of(figure, animation.frames, frame), Skinning())[0]
        found = positions_at(browser, frame / 10)
        apart = np.linalg.norm(found - wanted, axis=1).max()
        assert apart <= EXACT * size * scales[frame], frame


@needs_chromium
def test_people_come_and_go(browser, tmp_path):
    first = moving(tangle(n_joints=5, n_influences=3))
    second = moving(tangle(n_joints=6, n_influences=2, seed=4), missing=(1, 2), seed=5)
    second.placement[:3, 3] = 2.0, 0.0, 1.0
    (_, animation), _ = write(tmp_path / "a.html", first, second)
    browser.open(tmp_path / "a.html")
    check_frames(browser, animation, Skinning(), [0, 3, 4], index=1)
    drawn = "viewer.ready.then(page => page.figures.map(each => each.isDrawn))"
    seen = []
    for frame in range(5):
        positions_at(browser, frame / 10)
        seen.append(browser.run(drawn))
    assert seen == [[True, there] for there in (True, False, False, True, True)]
    assert browser.run("[...document.getElementById('figure').options].length") == 2
    assert browser.messages == []


@needs_chromium
def test_controls_play_orbit_and_show_weights(browser, tmp_path):
    write(tmp_path / "a.html", moving(tangle(n_joints=4, n_influences=2)))
    browser.open(tmp_path / "a.html")
    camera = "viewer.ready.then(page => [page.camera.azimuth, page.camera.distance])"
    azimuth, distance = browser.run(camera)
    browser.mouse("Pressed", 200, 120, button="left", buttons=1)
    browser.mouse("Moved", 250, 120, button="left", buttons=1)
    browser.mouse("Released", 250, 120, button="left")
    browser.mouse("Wheel", 200, 120, deltaX=0, deltaY=-100)
    browser.settle()
    turned, nearer = browser.run(camera)
    assert turned == pytest.approx(azimuth - 20.0) and nearer < 0.9 * distance
    touches = [{"x": 150, "y": 120, "id": 0}, {"x": 200, "y": 120, "id": 1}]
    browser.send("Input.dispatchTouchEvent", type="touchStart", touchPoints=touches)
    touches[1]["x"] = 300
    browser.send("Input.dispatchTouchEvent", type="touchMove", touchPoints=touches)
    browser.send("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
    browser.settle()
    assert browser.run(camera)[1] < 0.5 * nearer
    for key in ("End", "s", "w"):
        browser.send("Input.dispatchKeyEvent", type="keyDown", key=key, text=key[:1])
    browser.settle()
    assert browser.run("viewer.ready.then(page => page.time)") == pytest.approx(0.4)
    browser.run("document.getElementById('loop').checked = false; viewer.play()")
    browser.run(
        "viewer.ready.then(page => new Promise(done => {"
        " const check = () => page.isPlaying ? requestAnimationFrame(check) : done();"
        " check(); }))"
    )
    state = "viewer.ready.then(page => [page.time, page.isPlaying])"
    assert browser.run(state) == [pytest.approx(0.4), False]
    names = "[...document.getElementById('joint').options].map(each => each.text)"
    assert browser.run(names)[:3] == ["no joint", HOSTILE, "joint 1"]
    before = browser.screenshot()
    browser.run(
        "const list = document.getElementById('joint'); list.value = 1; "
        "list.dispatchEvent(new Event('change'))"
    )
    browser.settle()
    assert browser.screenshot() != before
    assert browser.messages == []


@needs_chromium
def test_an_image_is_written_once_and_sampled_as_each_material_asks(browser, tmp_path):
    plain, image = tangle(n_joints=4, n_influences=2), np.full((4, 4, 4), 200, dtype=np.uint8)
    looks = [
        {"wrap": ("repeat", "clamp")},
        {"wrap": ("repeat", "clamp"), "minification": "linear"},
        {"wrap": ("clamp", "clamp"), "is_smooth": False},
        {"wrap": ("repeat", "clamp")},
    ]
    textures = [viewer.rigs.material.Texture("a.png", image, **look) for look in looks]
    mesh = replace(
        plain.mesh,
        uvs=np.random.default_rng(3).random((90, 2)),
        materials=tuple(viewer.rigs.material.Material(base_texture=each) for each in textures),
        triangle_materials=np.arange(plain.mesh.n_triangles, dtype=np.int32) % len(looks),
    )
    write(tmp_path / "a.html", moving(replace(plain, mesh=mesh)))
    pictures = [each for each in header_of(tmp_path / "a.html")["items"] if "type" in each]
    assert len(pictures) == 1
    browser.open(tmp_path / "a.html")
    filters = browser.run(
        "viewer.ready.then(({ gl, figures: [figure] }) => figure.surfaces.map((surface) => {"
        " gl.bindTexture(gl.TEXTURE_2D, surface.textures[0].texture);"
        " return ['MIN_FILTER', 'MAG_FILTER', 'WRAP_S', 'WRAP_T'].map((name) =>"
        " gl.getTexParameter(gl.TEXTURE_2D, gl['TEXTURE_' + name])); }))"
    )
    mipmapped, linear, sharp, nearest = 0x2703, 0x2601, 0x2702, 0x2600
    repeat, clamp = 0x2901, 0x812F
    assert filters == [
        [mipmapped, linear, repeat, clamp],
        [linear, linear, repeat, clamp],
        [sharp, nearest, clamp, clamp],
        [mipmapped, linear, repeat, clamp],
    ]
    assert browser.messages == []


@needs_chromium
def test_picture_matches_the_desktop(browser, tmp_path):
    """The same fox from the same camera: only edges and the contact shadow differ."""
    assert run(["convert", "-o", str(tmp_path / "fox.html")]) == 0
    browser.open(tmp_path / "fox.html")
    browser.run("document.getElementById('panels').hidden = true")
    browser.settle()
    found = np.asarray(Image.open(io.BytesIO(browser.screenshot())).convert("RGB"), dtype=float)
    height, width = found.shape[:2]
    size = f"{width}x{height}"
    picture = tmp_path / "fox.png"
    assert run(["render", "-o", str(picture), "--size", size, "--quality", "normal"]) == 0
    own = np.asarray(Image.open(picture).convert("RGB"), dtype=float)
    apart = np.abs(found - own).max(axis=-1)
    assert np.median(apart) <= 2.0 and (apart > 24.0).mean() < 0.02


def test_page_permits_only_its_own_scripts_and_escapes_names(tmp_path):
    write(tmp_path / "<b>&.html", moving(tangle(n_joints=4, n_influences=2)))
    text = (tmp_path / "<b>&.html").read_text("utf-8")
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', text)[1]
    assert policy.startswith("default-src 'none'; img-src data:; script-src 'sha256-")
    assert "unsafe" not in policy and "http" not in policy
    assert "<title>&lt;b&gt;&amp;</title>" in text
    assert HOSTILE not in text and text.count("</script>") == 3
    header = header_of(tmp_path / "<b>&.html")
    assert header["figures"][0]["name"] == HOSTILE
    assert not re.search(r"https?://", re.sub(r'id="data">.*?<', "", text))


def test_undecodable_characters_of_names_become_question_marks(tmp_path):
    path = tmp_path / "a.html"
    viewer.export(viewer.Actor(viewer.figure(np.eye(3), [[0, 1, 2]], name="caf\udce9")), path)
    assert 'aria-label="caf?: 3D view"' in path.read_text("utf-8")
    assert header_of(path)["figures"][0]["name"] == "caf\udce9"


def header_of(path):
    """Return the page's header, which states everything but the numbers."""
    text = path.read_text("utf-8")
    return json.loads(re.search(r'id="header">(.*?)</script>', text, re.DOTALL)[1])


def test_timeline_begins_with_the_motion_beside_a_still_figure(tmp_path):
    actor, still = moving(tangle(n_joints=4, n_influences=2)), tangle(n_joints=3, n_influences=2)
    late = Part(actor, None, sample_animation(actor, frames=(2, 5)))
    beside = Part(Actor(still, figure_pose(still)))
    export(Selection([late, beside]), tmp_path / "a.html")
    motions = [each["motion"] for each in header_of(tmp_path / "a.html")["figures"]]
    assert [(each["start"], each["n"]) for each in motions] == [(0.0, 3), (0.0, 1)]


def test_notes_state_errors_of_the_written_numbers(tmp_path):
    (animation,), notes = write(tmp_path / "a.html", moving(tangle()))
    assert animation.frames.n_frames == 5
    assert any("5 frames, 0.4 s" in each for each in notes)
    assert_allclose([each.count("; vertices by up to") for each in notes[1:2]], [1])
    percents = [float(each) for each in re.findall(r"up to ([\d.]+) %", " ".join(notes))]
    assert len(percents) == 2 and all(0.0 < each <= 100.0 * EXACT for each in percents)


def test_notes_state_errors_of_all_joints_and_of_some_vertices(tmp_path):
    """One frame far away makes the steps of all places coarse, and is not among the 64 skinned."""
    actor = moving(tangle(n_joints=4, n_influences=2), n_frames=120)
    far = actor.clip.translations.copy()
    far[33, 0] = 1e7, 0.0, 0.0
    actor.clip = replace(actor.clip, translations=far)
    _, notes = write(tmp_path / "a.html", actor)
    (said,) = [each for each in notes if "differ" in each]
    percents = [float(each) for each in re.findall(r"up to ([\d.]+) %", said)]
    assert "joints differ" in said and "(vertices compared in 64 of 120 frames)" in said
    assert len(percents) == 2 and all(0.05 < each < 1.0 for each in percents), said
    bare = replace(actor, figure=replace(actor.figure, mesh=None, skin=None))
    _, notes = write(tmp_path / "b.html", bare)
    assert [each.count("joints differ") for each in notes if "differ" in each] == [1]


def test_notes_name_the_figure_and_the_missing_frames(tmp_path):
    figure = tangle(n_joints=4, n_influences=2)
    first, second = moving(figure), moving(replace(figure, name="b"), missing=(1, 3), seed=3)
    animations = [sample_animation(each, frames=(1, 5)) for each in (first, second)]
    pairs = zip((first, second), animations, strict=True)
    found = export(
        Selection([Part(actor, None, each) for actor, each in pairs]), tmp_path / "a.html"
    )
    notes = [str(each) for each in found]
    assert "b: frames 1, 3 missing, as in the original motion" in notes, notes
    assert sum("; vertices by up to" in each for each in notes) == 2
    numbers = [int(re.search(r"frame (\d)", each)[1]) for each in notes if "; vertices" in each]
    assert numbers[1] in (2, 4), numbers  # as in the motion, where b is present


@pytest.mark.parametrize("moves", [False, True])
def test_hidden_parts_are_left_out_and_reported(tmp_path, moves):
    actor = moving(tangle(n_joints=4, n_influences=2))
    mesh = actor.figure.mesh
    parts = np.arange(mesh.n_triangles, dtype=np.int32) % 3
    mesh = replace(mesh, parts=("a", "b", "c"), triangle_parts=parts)
    actor.figure, actor.hidden_parts = replace(actor.figure, mesh=mesh), frozenset({1})
    part = Part(actor, None, sample_animation(actor) if moves else None)
    notes = export(Selection([part]), tmp_path / "a.html")
    said = [str(each) for each in notes if each.key == "X003.hidden-parts"]
    assert said == ["1 hidden part is not written"]
    (figure,) = header_of(tmp_path / "a.html")["figures"]
    assert figure["mesh"]["runs"] == [[-1, 0, 3 * int((parts != 1).sum())]]


def test_units_and_axes_of_pages_are_those_of_the_scene(tmp_path):
    actor = moving(tangle(n_joints=4, n_influences=2))
    part = Part(actor, None, sample_animation(actor))
    with pytest.raises(RigError, match="unit of pages: expected none"):
        export(Selection([part]), tmp_path / "a.html", options=ExportOptions(unit="cm"))
    assert not [*tmp_path.iterdir()]
