"""Messages between a page and the page or the notebook that shows it in a frame, in Chromium."""

import base64
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browser import LOADED, needs_chromium
from builders import family_figure
from numpy.testing import assert_allclose
from rendering.drawn_figures import random_figure, random_pose

import viewer
from viewer.exporters.html.motion import pose_values
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.pose import rest_pose
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skinning import Skinning, deform

anywidget = pytest.importorskip("anywidget")


def posed(seed=3):
    """A named figure of six joints in a random pose."""
    random = np.random.default_rng(seed)
    figure = replace(random_figure(random, 6, n_vertices=60), name="figure")
    return Actor(figure, random_pose(figure.skeleton, random, reach=1.0))


def held(browser, figure, poses, how, center):
    """Return the vertices that a page shows for each pose that it is told."""
    for pose in poses:
        values = pose_values(figure, pose, how, center)
        text = json.dumps({name: array.tolist() for name, array in values.items()})
        browser.run(
            f"viewer.ready.then(page => page.messages.receive({{ poses: {{ 0: {text} }} }}))"
        )
        yield np.array(browser.run("viewer.positions()")), np.array(browser.run("viewer.normals()"))


@needs_chromium
@pytest.mark.parametrize("method", ["lbs", "dqs"])
def test_page_shows_the_pose_that_it_is_told_until_the_time_changes(browser, tmp_path, method):
    """Shapes move the joints, and normals and correctives change with each pose."""
    figure, how = family_figure("smpl", tmp_path), Skinning(method)
    actor, random = Actor(figure, rest_pose(figure.skeleton)), np.random.default_rng(5)
    viewer.export(actor, tmp_path / "a.html", how)
    browser.open(tmp_path / "a.html")
    first = np.array(browser.run("viewer.positions()"))
    poses = [random_pose(figure.skeleton, random, reach=1.0) for _ in range(2)]
    for pose in poses:
        pose.shape_weights = random.normal(size=figure.n_shapes)
        pose.figure_translation[:] = random.normal(size=3)
    center = browser.run("viewer.ready.then(page => page.figures[0].data.mesh.center)")
    size = box_size(bounding_box(figure.mesh.positions))
    shown = held(browser, figure, poses, how, np.array(center))
    for pose, (positions, normals) in zip(poses, shown, strict=True):
        wanted = deform(figure, pose, how)
        assert_allclose(positions, wanted[0], atol=2e-5 * size)
        assert_allclose(normals, wanted[1], atol=5e-3)
    browser.run("viewer.seek(0)")
    assert_allclose(browser.run("viewer.positions()"), first, atol=1e-7)
    assert browser.messages == []


_HARNESS = """<!doctype html><title>harness</title><div id="cell"></div><script>
const decoded = (text) => new DataView(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
const state = STATE, listeners = {};
const decodedPoses = (poses) => {
  for (const { values } of Object.values(poses))
    for (const name of Object.keys(values)) values[name] = decoded(values[name]);
  return poses;
};
decodedPoses(state._poses);
const model = {
  saves: 0,
  get: (name) => state[name],
  set: (name, value) => {
    state[name] = value;
    (listeners["change:" + name] || []).forEach((each) => each());
  },
  on: (name, action) => { (listeners[name] ??= []).push(action); },
  save_changes: () => { model.saves += 1; },
};
const script = new Blob([SCRIPT], { type: "text/javascript" });
const begun = import(URL.createObjectURL(script)).then(({ default: { render } }) =>
  render({ model, el: document.getElementById("cell") }));
const saved = (count) => new Promise((done) => {
  const check = () => (model.saves >= count ? done(null) : setTimeout(check, 20));
  check();
});
</script>"""


def sent_poses(widget) -> dict:
    """Return the poses of a widget as JSON; ``decodedPoses`` of the page reads them."""
    return {
        index: {
            "number": pose["number"],
            "values": {name: base64.b64encode(v).decode() for name, v in pose["values"].items()},
        }
        for index, pose in widget._poses.items()
    }


def harness(path: Path, widget) -> None:
    """Write a page that runs the widget's script with the widget's state, as a notebook does."""
    state = {name: getattr(widget, name) for name in ("height", "time", "camera", "_page")}
    state["_selection"] = list(widget._selection)
    state["_poses"] = sent_poses(widget)
    script = Path(viewer.__file__).with_name("notebook_widget.js").read_text("utf-8")
    parts = {"STATE": state, "SCRIPT": script}
    text = _HARNESS
    for name, value in parts.items():
        text = text.replace(name, json.dumps(value).replace("<", "\\u003c"))
    path.write_text(text, "utf-8")


@needs_chromium
def test_widget_and_page_keep_camera_selection_and_joints_equal(browser, tmp_path):
    actor = posed()
    widget = viewer.widget(Scene([actor]))
    shown = widget["figure"]
    pose = actor.pose.copy()
    pose.dofs[4] = 0.25
    shown.pose = pose
    assert shown.pose is pose and actor.pose is pose
    widget.camera = {"azimuth": 33.0, "distance": 7.0}
    widget.selection = "figure", actor.figure.skeleton.names[2]
    harness(tmp_path / "a.html", widget)
    browser.messages.clear()
    browser.send("Page.navigate", url=(tmp_path / "a.html").as_uri())
    browser.run(LOADED)
    browser.run("begun.then(() => saved(1))")
    browser.settle()
    camera = browser.run("state.camera")
    assert camera["azimuth"] == 33.0 and camera["distance"] == pytest.approx(7.0)
    assert browser.run("state._selection") == [0, 2]
    # The slider of the page rotates a joint, and the kernel's pose follows.
    browser.run("document.querySelector('iframe').focus()")
    count = browser.run("model.saves")
    browser.run("model.set('camera', { azimuth: -20 })")
    browser.run(f"saved({count + 1})")
    assert browser.run("state.camera.azimuth") == -20.0
    widget.set_trait("_angles", [[[4, 0.75]]])
    assert actor.pose.dofs[4] == 0.75
    # "Reset joints" in the page resets the kernel's pose, too.
    widget.set_trait("_angles", [[]])
    assert actor.pose.dofs[4] == 0.25
    assert browser.messages == []


@needs_chromium
def test_live_loop_ends_with_its_last_pose_and_an_equal_pose_is_shown_again(browser, tmp_path):
    actor = posed()
    widget, turned = viewer.widget(actor), actor.pose.copy()
    turned.dofs[3:6] += 0.6
    sent = []
    for pose in (actor.pose.copy(), turned, turned):
        widget["figure"].pose = pose
        sent.append(json.dumps(sent_poses(widget)))
    assert len({*sent}) == 3  # traits that are set to equal values are not sent
    widget.camera = {"azimuth": 20.0}  # the page answers
    harness(tmp_path / "a.html", widget)
    browser.messages.clear()
    browser.send("Page.navigate", url=(tmp_path / "a.html").as_uri())
    browser.run(LOADED)
    browser.run("begun.then(() => saved(1))")

    def shown(script, is_right=lambda picture: True):
        """Run a script; return the picture once it is right and has stood still."""
        browser.run(script)
        seen, deadline = [], time.monotonic() + 60.0
        while len(seen) < 3 or len({*seen[-3:]}) > 1 or not is_right(seen[-1]):
            assert time.monotonic() < deadline, "another picture is shown"
            browser.run("new Promise(done => setTimeout(done, 250))")
            seen.append(browser.screenshot())
        return seen[-1]

    live = """new Promise(done => { let n = 0; const next = () => {
        const { values } = decodedPoses(n % 2 ? LAST : FIRST)[0];
        model.set("_poses", { 0: { number: 10 + n, values } });
        n += 1;
        if (n < 16) setTimeout(next, 33); else done();
      }; next(); })"""
    end = shown(live.replace("LAST", sent[2]).replace("FIRST", sent[0]))
    shown("model.set('time', 1)", lambda picture: picture != end)
    again = f"model.set('_poses', {{ 0: {{ ...decodedPoses({sent[2]})[0], number: 99 }} }})"
    shown(again, lambda picture: picture == end)
    assert browser.messages == []


def test_slider_of_a_pose_that_is_replaced_is_forgotten():
    actor = posed()
    widget, other = viewer.widget(actor), actor.pose.copy()
    widget.set_trait("_angles", [[[4, 0.75]]])
    other.dofs[4] = 0.5
    widget["figure"].pose = other
    widget.set_trait("_angles", [[]])
    assert actor.pose is other and other.dofs[4] == 0.5


def test_widget_reads_back_what_the_page_has_chosen():
    actor = posed()
    widget = viewer.widget(actor)
    assert widget.selection == ()
    widget._selection = [0, -1]
    assert widget.selection == ("figure",)
    widget._selection = [0, 1]
    assert widget.selection == ("figure", actor.figure.skeleton.names[1])
    with pytest.raises(viewer.ViewerError, match="no such joint"):
        widget.selection = "figure", "no such joint"
    with pytest.raises(viewer.ViewerError, match=r"an actor \(figure\), .* found 0 names"):
        widget.selection = ()
    widget.selection = "figure"
    assert widget.selection == ("figure",)
    widget["figure"][actor.figure.skeleton.names[1]] = [0.0, 0.5, 0.0]
    for shown in (actor, widget["figure"]):
        assert_allclose(shown[actor.figure.skeleton.names[1]], [0.0, 0.5, 0.0], atol=1e-12)
    rotations = np.frombuffer(widget._poses["0"]["values"]["rotations"])
    assert rotations.shape == (24,) and np.isfinite(rotations).all()
    data, _ = widget._repr_mimebundle_()
    assert data["image/png"].startswith(b"\x89PNG")


def test_saved_outputs_of_a_widget_fall_back_to_a_picture():
    """A saved notebook has both: GitHub and VS Code without widgets show the picture."""
    data, _ = viewer.widget(posed())._repr_mimebundle_()
    assert {"application/vnd.jupyter.widget-view+json", "image/png"} <= {*data}
