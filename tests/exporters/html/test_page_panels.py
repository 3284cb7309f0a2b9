"""Controls of pages, driven in Chromium: joints, divider, camera, address and lost contexts."""

import io
import re
from dataclasses import replace

import numpy as np
import pytest
from browser import LOADED, needs_chromium
from numpy.testing import assert_allclose
from PIL import Image
from rendering.drawn_figures import random_figure, random_pose

import viewer
from viewer.cli import run
from viewer.errors import RigError, UnsupportedFormatError
from viewer.exporters import ExportOptions, PageOptions, Part, Selection, export
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skinning import Skinning, deform


def bent(seed, name="", axes=(3, 4, 5)):
    """A figure of six joints in a random pose; each joint rotates about the same axes, in order."""
    random = np.random.default_rng(seed)
    figure = random_figure(random, 6, n_vertices=60)
    skeleton, n_axes = figure.skeleton, len(axes)
    skeleton = replace(
        skeleton,
        dof_joints=np.repeat(np.arange(6, dtype=np.int32), n_axes),
        dof_kinds=np.tile(np.array(axes, dtype=np.int32), 6),
        rest_dofs=np.zeros(6 * n_axes),
        dof_limits=np.tile([-1.25, 1.0], (6 * n_axes, 1)),
    )
    figure = replace(figure, skeleton=skeleton, name=name or figure.name)
    return Actor(figure, random_pose(skeleton, random))


def still(path, *actors, page=None):
    """Write actors in their poses as a page."""
    scene = Scene([*actors])
    options = ExportOptions(page=page or PageOptions())
    return export(Selection([Part(actor) for actor in actors], scene), path, options=options)


def choose(browser, name, value):
    browser.run(
        f"(() => {{ const list = document.getElementById('{name}'); list.value = '{value}';"
        " list.dispatchEvent(new Event('change')); })()"
    )


def picture(browser):
    browser.run("document.getElementById('panels').hidden = true")
    browser.settle()
    return np.asarray(Image.open(io.BytesIO(browser.screenshot())).convert("RGB"), dtype=float)


@needs_chromium
@pytest.mark.parametrize(
    ("method", "axes"), [("lbs", (3, 4, 5)), ("dqs", (4, 3, 5)), ("lbs", (5, 4)), ("lbs", (4,))]
)
def test_sliders_rotate_joints_as_their_degrees_of_freedom(browser, tmp_path, axes, method):
    actor, how, path = bent(3, axes=axes), Skinning(method), tmp_path / "a.html"
    export(Selection([Part(actor)]), path, skinning=how)
    browser.open(path)
    browser.run("document.getElementById('joints').open = true")
    browser.settle()
    read = (
        "[...document.querySelectorAll('#dofs label')].map(each => { const slider ="
        " each.querySelector('input'); return [Number(slider.min), Number(slider.max),"
        " Number(slider.value)]; })"
    )
    wanted = actor.pose.copy()
    for joint, dof in ((1, 0), (4, len(axes) - 1), (0, 0)):
        choose(browser, "bent", joint)
        rows = joint * len(axes) + np.arange(len(axes))
        shown = np.radians(browser.run(read))
        assert_allclose(shown[:, :2], np.tile([-1.25, 1.0], (len(axes), 1)), atol=1e-12)
        assert_allclose(shown[:, 2], wanted.dofs[rows], atol=1e-4)
        wanted.dofs[rows[dof]] = 0.5
        browser.run(
            f"(() => {{ const slider = document.querySelectorAll('#dofs input')[{dof}];"
            f" slider.value = {np.degrees(0.5)}; slider.dispatchEvent(new Event('input')); }})()"
        )
    found = np.array(browser.run("viewer.positions()"))
    size = box_size(bounding_box(actor.figure.mesh.positions))
    assert_allclose(found, deform(actor.figure, wanted, how)[0], atol=2e-5 * size)
    browser.run("document.getElementById('unbend').click()")
    found = np.array(browser.run("viewer.positions()"))
    assert_allclose(found, deform(actor.figure, actor.pose, how)[0], atol=2e-5 * size)
    assert browser.messages == []


@needs_chromium
def test_divider_shows_a_figure_on_each_side_in_one_place(browser, tmp_path):
    """The picture left of the divider is that of the first figure alone, and so on."""
    first, second = bent(5, "<i>"), bent(6, "b")
    second.placement[:3, 3] = 3.0, 0.0, 1.0
    still(tmp_path / "a.html", first, second, page=PageOptions("Before & <after>", wipes=True))
    browser.open(tmp_path / "a.html")
    assert browser.run("document.getElementById('caption').textContent") == "Before & <after>"
    names = "['left', 'right'].map(each => document.getElementById(each).textContent)"
    assert browser.run(names) == ["<i>", "b"]
    box = browser.run("(({ x, width }) => [x, width])(divider.getBoundingClientRect())")
    middle = box[0] + 0.5 * box[1]
    browser.mouse("Pressed", middle, 100, button="left", buttons=1)
    browser.mouse("Moved", 120, 100, button="left", buttons=1)
    browser.mouse("Released", 120, 100, button="left")
    browser.run("for (const each of [divider, caption]) each.style.opacity = 0")
    both = picture(browser)
    part = browser.run("viewer.ready.then(page => page.divider)")
    assert part == pytest.approx(120 / both.shape[1], abs=2e-3)
    places = browser.run("viewer.ready.then(page => page.figures.map(each => each.placement))")
    assert_allclose(places[0], places[1], atol=1e-12)
    alone = {}
    for part, side in ((1, "left"), (0, "right")):
        browser.run(f"viewer.ready.then(page => {{ page.divider = {part}; page.change(); }})")
        alone[side] = picture(browser)
    assert_allclose(both[60:, :110], alone["left"][60:, :110], atol=1)
    assert_allclose(both[60:240, 130:], alone["right"][60:240, 130:], atol=1)
    assert (np.abs(alone["left"] - alone["right"]).max(axis=-1) > 24).mean() > 0.01
    browser.run("document.getElementById('divider').focus()")
    browser.send("Input.dispatchKeyEvent", type="keyDown", key="ArrowRight")
    assert browser.run("viewer.ready.then(page => page.divider)") == pytest.approx(0.02)
    assert browser.messages == []


@needs_chromium
@pytest.mark.parametrize("width", [320, 360, 1000])
def test_angles_stand_beside_their_sliders(browser, tmp_path, width):
    still(tmp_path / "a.html", bent(5, "a"))
    screen = {"width": width, "height": 640, "deviceScaleFactor": 1, "mobile": width < 1000}
    browser.send("Emulation.setDeviceMetricsOverride", **screen)
    browser.open(tmp_path / "a.html")
    browser.run("document.getElementById('joints').open = true")
    rows = browser.run(
        "[...document.querySelectorAll('#dofs label')].map(row => [...row.children].map("
        "each => each.getBoundingClientRect().toJSON()))"
    )
    browser.send("Emulation.clearDeviceMetricsOverride")
    assert len(rows) == 3
    for row in rows:
        slider, angle = row[-2:]
        assert slider["right"] <= angle["left"] < angle["right"] <= width
        assert slider["top"] < 0.5 * (angle["top"] + angle["bottom"]) < slider["bottom"]


@needs_chromium
def test_long_names_stay_within_a_narrow_screen(browser, tmp_path):
    first, second = bent(5, 20 * "first "), bent(6, 20 * "second ")
    still(tmp_path / "a.html", first, second, page=PageOptions(wipes=True))
    screen = {"width": 360, "height": 640, "deviceScaleFactor": 1, "mobile": True}
    browser.send("Emulation.setDeviceMetricsOverride", **screen)
    browser.open(tmp_path / "a.html")
    boxes = "[left, right].map(each => each.getBoundingClientRect().toJSON())"
    for part in (0.5, 0.2):
        browser.run(f"viewer.ready.then(p => {{ p.divider = {part}; p.panels.showDivider(); }})")
        left, right = browser.run(f"(({{ left, right }}) => {boxes})(document.all)")
        assert 0.0 <= left["left"] < left["right"] < 360 * part
        assert 360 * part < right["left"] < right["right"] <= 360.0
    assert browser.run("document.documentElement.scrollWidth") == 360
    browser.send("Emulation.clearDeviceMetricsOverride")


@needs_chromium
def test_camera_follows_the_mean_of_the_joints(browser, tmp_path):
    figure = bent(7).figure
    rotations = np.tile(np.eye(3), (4, 6, 1, 1))
    moves = np.random.default_rng(8).normal(size=(4, 3))
    actor = viewer.animate(figure, rotations, translations=moves, fps=10.0)
    viewer.export(actor, tmp_path / "a.html")
    browser.open(tmp_path / "a.html")
    target = "viewer.ready.then(page => { page.pose(); return page.camera.target; })"
    before = np.array(browser.run(target))
    browser.run("document.getElementById('follow').click(); viewer.seek(0.3)")
    assert_allclose(browser.run(target), before + moves[3] - moves[0], atol=1e-4)
    browser.run("document.getElementById('follow').click(); viewer.seek(0)")
    assert_allclose(browser.run(target), before + moves[3] - moves[0], atol=1e-4)
    browser.open(tmp_path / "a.html", "follow&time=0.3")
    assert_allclose(browser.run(target), before + moves[3] - moves[0], atol=1e-4)
    assert browser.messages == []


@needs_chromium
def test_address_selects_what_a_frame_shows(browser, tmp_path):
    figure = bent(7).figure
    actor = viewer.animate(figure, np.tile(np.eye(3), (4, 6, 1, 1)), fps=10.0)
    viewer.export(actor, tmp_path / "a.html")
    frame = '<iframe src="a.html#bare&time=0.2&skeleton" width="300" height="200"></iframe>'
    (tmp_path / "b.html").write_text(frame, "utf-8")
    browser.open(tmp_path / "a.html", "bare&time=0.2&skeleton")
    assert browser.run("viewer.ready.then(page => page.time)") == pytest.approx(0.2)
    shown = "[...document.querySelectorAll('#panels, #timeline')].map(each => each.offsetHeight)"
    assert browser.run(shown) == [0, 0]
    assert browser.run("document.getElementById('skeleton').checked") is True


@needs_chromium
def test_view_returns_after_a_lost_context_and_follows_the_window(browser, tmp_path):
    still(tmp_path / "a.html", bent(9))
    browser.open(tmp_path / "a.html")
    choose(browser, "joint", 2)
    before = picture(browser)
    browser.run(
        "viewer.ready.then(page => { window.lost = page.gl.getExtension('WEBGL_lose_context');"
        " const gone = new Promise(done => page.canvas.addEventListener('webglcontextlost',"
        " () => setTimeout(done))); lost.loseContext(); return gone; })"
    )
    message = "document.getElementById('message').textContent"
    assert "reset" in browser.run(message)
    browser.run(
        "viewer.ready.then(page => { const back = new Promise(done => page.canvas"
        ".addEventListener('webglcontextrestored', () => setTimeout(done)));"
        " lost.restoreContext(); return back; })"
    )
    assert browser.run(message) == ""
    assert_allclose(picture(browser), before, atol=1)  # the colours of the weights are back, too
    for size in ((300, 500), (480, 320)):
        browser.send(
            "Emulation.setDeviceMetricsOverride",
            width=size[0],
            height=size[1],
            deviceScaleFactor=2,
            mobile=False,
        )
        browser.settle()
        drawn = browser.run("(({ width, height }) => [width, height])(view)")
        assert drawn[0] == 2 * size[0] and drawn[1] <= 2 * size[1]
    browser.send("Emulation.clearDeviceMetricsOverride")


@needs_chromium
def test_colours_of_controls_follow_the_system(browser, tmp_path):
    still(tmp_path / "a.html", bent(9))
    browser.open(tmp_path / "a.html")
    bars = []
    for scheme in ("light", "dark"):
        feature = {"name": "prefers-color-scheme", "value": scheme}
        browser.send("Emulation.setEmulatedMedia", features=[feature])
        color = browser.run("getComputedStyle(document.getElementById('display')).backgroundColor")
        bars.append(sum(map(int, re.findall(r"\d+", color))))
    browser.send("Emulation.setEmulatedMedia", features=[])
    assert bars[0] > 600 > 300 > bars[1]


def test_divider_needs_two_figures_and_pages(tmp_path, capsys):
    with pytest.raises(RigError, match="expected at least 2 figures, found 1"):
        still(tmp_path / "a.html", bent(3), page=PageOptions(wipes=True))
    with pytest.raises(UnsupportedFormatError, match="only pages have a caption"):
        still(tmp_path / "a.glb", bent(3), page=PageOptions("a"))
    assert run(["convert", "-o", str(tmp_path / "a.glb"), "--caption", "a"]) == 2
    assert "--caption: expected an output with .html, found .glb" in capsys.readouterr().err
    assert not [*tmp_path.iterdir()]


@needs_chromium
def test_poster_is_shown_until_the_view_has_started(browser, tmp_path, poster):
    """The page's script never starts: its picture, with a text, is all that is seen."""
    still(tmp_path / "a.html", bent(9, "name"))
    text = (tmp_path / "a.html").read_text("utf-8")
    (tmp_path / "b.html").write_text(text.replace("<script>", "<script>// "), "utf-8")
    browser.send("Page.navigate", url=(tmp_path / "b.html").as_uri())
    browser.run(LOADED)
    alt = "[document.querySelector('#poster').alt, document.querySelector('#poster').naturalWidth]"
    assert browser.run(alt) == ["name: 3D view", poster[0]]


@needs_chromium
def test_page_without_webgl_shows_its_picture_and_no_controls_that_do_nothing(browser, tmp_path):
    figure = random_figure(np.random.default_rng(1), 4)
    export(Selection([Part(Actor(figure))]), tmp_path / "a.html")
    without = "HTMLCanvasElement.prototype.getContext = () => null"
    script = browser.send("Page.addScriptToEvaluateOnNewDocument", source=without)
    try:
        browser.send("Page.navigate", url=(tmp_path / "a.html").as_uri())
        browser.run(LOADED)
        browser.run("viewer.ready.catch(() => null)")
        hidden = "['panels', 'timeline'].map(id => document.getElementById(id).hidden)"
        assert browser.run(hidden) == [True, True]
        assert "has no WebGL 2" in browser.run("document.getElementById('message').textContent")
        assert browser.run("document.getElementById('poster').naturalWidth") == 64
    finally:
        browser.send("Page.removeScriptToEvaluateOnNewDocument", **script)
