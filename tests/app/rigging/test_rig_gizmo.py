"""Manual alignment of the template: gizmo, typed values, landmarks."""

import threading
from dataclasses import replace

import numpy as np
import pytest
from app import rig_scene
from app.rig_scene import TRUE
from numpy.testing import assert_allclose

from viewer.app.core.view_frame import view_frame
from viewer.app.rigging.placing import (
    aligned_template,
    as_similarity,
    ghost_place,
    move_by_hand,
    posed_template,
    similarity_now,
)
from viewer.app.rigging.rigging import Rigging, current_template, target_mesh
from viewer.app.rigging.tools import RADIUS
from viewer.app.rigging.work import align_template
from viewer.rigs.geometry.transform import apply_transform, translation_matrix
from viewer.rigs.mesh import bounding_box

pytestmark = pytest.mark.usefixtures("quick_fits")


@pytest.fixture
def hand(drive):
    """A test driver on mesh and template with the panel open and the camera looking along -z."""
    opened = drive(scene=rig_scene.scene(), size=(1000, 1000), samples=1)
    opened.menu("menu Window", "Rig")
    opened.step(2)
    opened.key("_1")
    opened.key("_5")  # orthographic, so that screen distances do not depend on depth
    opened.key("f")
    return opened


def similarity(hand):
    return similarity_now(hand.state, current_template(hand.state))


def middle(hand):
    """Return the position of the gizmo in the scene and on the screen."""
    template = current_template(hand.state)
    box = bounding_box(posed_template(hand.state.of(Rigging), template).positions)
    point = apply_transform(ghost_place(hand.state, template), box.mean(axis=0)[None])[0]
    return point, np.array(view_frame(hand.state).place(point))


def unit_way(hand, axis):
    """Return the screen vector of a unit along an axis of the scene."""
    frame, (point, place) = view_frame(hand.state), middle(hand)
    return np.array(frame.place(point + axis)) - place


def test_template_starts_with_aligned_bounding_boxes(hand):
    hand.click("rig tool move")
    start = similarity(hand)
    boxes = [
        bounding_box(points)
        for points in (
            start.apply(
                posed_template(hand.state.of(Rigging), current_template(hand.state)).positions
            ),
            target_mesh(hand.state).positions,
        )
    ]
    assert_allclose(boxes[0].mean(axis=0), boxes[1].mean(axis=0), atol=1e-9)
    sizes = [np.linalg.norm(np.diff(box, axis=0)) for box in boxes]
    assert sizes[0] == pytest.approx(sizes[1])
    assert hand.app.frame.renderer.ghost.style == "translucent"


def test_arrow_moves_the_template_along_its_axis_and_does_not_orbit(hand):
    hand.click("rig tool move")
    before, camera = similarity(hand), hand.state.camera.azimuth
    _, place = middle(hand)
    way = unit_way(hand, np.array([1.0, 0.0, 0.0]))
    start = place + 45.0 * way / np.linalg.norm(way)
    hand.pull(tuple(start), tuple(start + 2.5 * way))
    hand.step(2)
    after = similarity(hand)
    assert_allclose(after.shift - before.shift, [2.5, 0.0, 0.0], atol=0.02)
    assert_allclose(after.rotation, before.rotation, atol=1e-6)
    assert after.scale == pytest.approx(before.scale, rel=1e-6)
    assert hand.state.camera.azimuth == camera
    hand.finish_job()  # its error is measured after release
    alignment = hand.state.of(Rigging).placing.alignment
    assert alignment.how == "given" and alignment.error > 0.01


def test_ring_rotates_the_template_about_its_middle(hand):
    hand.click("rig tool rotate")
    before, (center, place) = similarity(hand), middle(hand)
    # Rotate by 90 degrees with the ring about z, which points at the eye.
    radius = next(
        r for r in range(30, 200, 2) if hovers(hand, place + r * np.array([1, -1]) / 2**0.5)
    )
    start = place + (radius + 1) * np.array([1, -1]) / 2**0.5
    end = place + (radius + 1) * np.array([-1, -1]) / 2**0.5
    hand.pull(tuple(start), tuple(end), steps=12)
    after = similarity(hand)
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert_allclose(after.rotation, quarter @ before.rotation, atol=0.02)
    assert_allclose(middle(hand)[0], center, atol=1e-3)
    assert after.scale == pytest.approx(before.scale, rel=1e-5)


@pytest.mark.parametrize("kind", ["factors", "own_factors"])
def test_ring_rotates_a_stretched_template_about_its_middle(hand, kind):
    laid = aligned_template(hand.state)
    stretch = np.array([1.3, 1.0, 1.0]) / 1.3 ** (1 / 3)
    straight = replace(similarity(hand), rotation=np.eye(3), **{kind: stretch})
    move_by_hand(hand.state, laid, straight)
    hand.step(2)
    test_ring_rotates_the_template_about_its_middle(hand)
    assert_allclose(similarity(hand).own_factors, stretch, atol=0.01)
    assert (similarity(hand).factors == 1.0).all()


def test_drag_is_one_undo_step_including_its_error(hand):
    hand.click("rig tool move")
    before, steps = similarity(hand), hand.undo_steps
    pull_along_x(hand, 2.5)
    hand.finish_job()
    first, error = similarity(hand), hand.state.of(Rigging).placing.alignment.error
    pull_along_x(hand, -1.0)
    hand.finish_job()
    assert hand.undo_steps == steps + 2
    hand.key("z", "ctrl")
    hand.step(2)
    assert_allclose(similarity(hand).matrix, first.matrix)
    assert hand.state.of(Rigging).placing.alignment.error == error  # measured before and cached
    hand.key("z", "ctrl")
    hand.step(2)
    assert hand.state.of(Rigging).placing is None
    assert_allclose(similarity(hand).matrix, before.matrix)
    hand.key("y", "ctrl")
    hand.step(2)
    assert_allclose(similarity(hand).matrix, first.matrix)
    assert hand.state.job is None and hand.undo_steps == steps + 1


def test_moved_template_keeps_its_fitted_pose_but_not_its_residual(hand):
    # The tip of the target is bent further.
    hand.state.scene.actors[1].pose.dofs[6:] = 0.2, -0.1, 0.2
    hand.step(2)
    hand.click("Align")
    hand.finish_job()
    pose, gap = hand.state.of(Rigging).placing.lines
    assert (pose.key, gap.key) == ("R003.pose", "R003.gap")
    laid = aligned_template(hand.state)
    away = translation_matrix(np.array([2.5, 0.0, 0.0])) @ similarity_now(hand.state, laid).matrix
    move_by_hand(hand.state, laid, as_similarity(away))
    assert hand.state.of(Rigging).placing.lines == (pose,)
    assert hand.state.of(Rigging).placing.fitted is laid


def test_drag_undone_while_its_error_is_measured_is_not_restored(hand, monkeypatch):
    gate = threading.Event()

    def late(*given):
        gate.wait(60)
        return align_template(*given)

    monkeypatch.setattr("viewer.app.rigging.work.align_template", late)
    hand.click("rig tool move")
    pull_along_x(hand, 2.5)
    hand.step(2)
    assert hand.state.job is not None
    hand.key("z", "ctrl")
    hand.step(2)
    gate.set()
    hand.finish_job()
    assert hand.state.of(Rigging).placing is None
    hand.key("y", "ctrl")
    hand.step(2)
    assert hand.state.of(Rigging).placing.alignment.error > 0.01


def pull_along_x(hand, way):
    """Drag the arrow along x by a length of the scene."""
    _, place = middle(hand)
    unit = unit_way(hand, np.array([1.0, 0.0, 0.0]))
    start = place + 45.0 * unit / np.linalg.norm(unit)
    hand.pull(tuple(start), tuple(start + way * unit))
    hand.step(2)


def hovers(hand, place):
    hand.move(tuple(place))
    return hand.state.of(Rigging).holds_mouse


def test_ring_scales_the_template_as_a_whole(hand):
    hand.click("rig tool scale")
    before, (center, place) = similarity(hand), middle(hand)
    aslant = np.array([0.6, -0.8])
    camera = hand.state.camera.azimuth
    hand.pull(tuple(place + RADIUS * aslant), tuple(place + 1.5 * RADIUS * aslant), steps=10)
    after = similarity(hand)
    assert after.scale == pytest.approx(1.5 * before.scale, rel=1e-3)
    assert_allclose(after.factors, 1.0)
    assert_allclose(after.rotation, before.rotation, atol=1e-9)
    assert_allclose(middle(hand)[0], center, atol=1e-9)
    assert hand.state.camera.azimuth == camera


def test_drag_outside_the_gizmo_orbits(hand):
    hand.click("rig tool move")
    azimuth = hand.state.camera.azimuth
    x, y, width, height = hand.state.view_rect
    hand.pull((x + 0.9 * width, y + 0.9 * height), (x + 0.8 * width, y + 0.9 * height))
    assert hand.state.camera.azimuth != azimuth


def test_typed_values_place_the_template(hand):
    hand.click("rig tool move")
    x0, y0, x1, y1 = hand.state.item_rects["Translation"]
    hand.enter_value("Scale factor", "30")
    assert similarity(hand).scale == pytest.approx(30.0)
    hand.click((x0 + 5, (y0 + y1) / 2), held="ctrl")
    hand.type("12")
    hand.key("enter")
    hand.step(2)
    assert similarity(hand).shift[0] == pytest.approx(12.0)
    hand.enter_value("Scale factor", "-3")
    assert similarity(hand).scale == pytest.approx(30.0)
    hand.finish_job()
    assert hand.state.of(Rigging).placing.alignment is not None and hand.state.error == ""
    assert x1 > x0


def test_refinement_converges_from_a_nearby_alignment(hand):
    near = TRUE.copy()
    near[:3, 3] += 1.0
    template = current_template(hand.state)
    move_by_hand(hand.state, template, as_similarity(near))
    hand.step(2)
    hand.click("Refine")
    hand.finish_job()
    assert_allclose(similarity(hand).matrix, TRUE, atol=1e-3)
    assert hand.state.of(Rigging).placing.alignment.how == "landmarks"


def test_run_keeps_the_manual_alignment(hand):
    template = current_template(hand.state)
    move_by_hand(hand.state, template, as_similarity(TRUE))
    hand.step(2)
    hand.click("Run")
    hand.finish_job()
    rigged = hand.state.of(Rigging).results["robust"].rigged
    assert rigged.alignment.how == "given"
    assert_allclose(rigged.alignment.similarity.matrix, TRUE, atol=1e-9)


def middles(mesh, matrix):
    """Return the middles of a mesh's triangles in the scene: (T, 3)."""
    return apply_transform(matrix, mesh.positions)[mesh.triangles].mean(axis=1)


def click_pair(hand, triangle):
    """Click the middle of the same triangle on the template and on the target."""
    state, template = hand.state, current_template(hand.state)
    posed = posed_template(state.of(Rigging), template)
    hand.click(view_frame(state).place(middles(posed, ghost_place(state, template))[triangle]))
    hand.click(view_frame(state).place(middles(target_mesh(state), np.eye(4))[triangle]))


def faces_eye(hand, mesh, matrix, triangle):
    """Return whether a triangle is visible: facing the eye and not occluded."""
    frame = view_frame(hand.state)
    corners = apply_transform(matrix, mesh.positions)[mesh.triangles]
    middle = corners[triangle].mean(axis=0)
    origin, direction = frame.ray(frame.place(middle))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    if normals[triangle] @ direction > -0.3:
        return False
    # Each triangle near the line is represented by its centre.
    ways = corners.mean(axis=1) - origin
    depths = ways @ direction
    beside = np.linalg.norm(ways - depths[:, None] * direction, axis=1)
    size = np.linalg.norm(corners[triangle, 1] - corners[triangle, 0])
    return depths[beside < size].min() > depths[triangle] - size


def test_landmarks_can_be_clicked_listed_deleted_and_fitted(hand, texts):
    hand.click("rig tool landmarks")
    hand.step(2)
    state, template = hand.state, current_template(hand.state)
    ghost, posed = ghost_place(state, template), posed_template(state.of(Rigging), template)
    wanted = [
        triangle
        for triangle in range(0, 640, 3)
        if faces_eye(hand, posed, ghost, triangle)
        and faces_eye(hand, target_mesh(state), np.eye(4), triangle)
    ]
    assert len(wanted) >= 4  # visible from the front on both meshes
    chosen = [wanted[0], wanted[len(wanted) // 3], wanted[2 * len(wanted) // 3], wanted[-1]]
    orbit = state.camera.azimuth
    for number, triangle in enumerate(chosen, start=1):
        if number == 3:
            hand.click("Align by landmarks")  # greyed, because one more landmark is needed
            assert state.job is None
        click_pair(hand, triangle)
        assert len(state.of(Rigging).landmarks) == number and state.of(Rigging).pending is None
    assert state.camera.azimuth == orbit and state.chosen_actor == 0
    hand.click("Refine by closest points")
    hand.click("Align by landmarks")
    hand.finish_job()
    assert state.error == "" and state.of(Rigging).placing.alignment.how == "landmarks"
    # A click is accurate to half a pixel; 15 pixels are a unit of the mesh, which is 60 units long.
    assert similarity(hand).scale == pytest.approx(30.0, rel=0.03)
    assert_allclose(similarity(hand).rotation, TRUE[:3, :3] / 30.0, atol=0.05)
    hand.click("delete landmark 1")
    hand.step(2)
    assert len(state.of(Rigging).landmarks) == 3
    hand.click("Delete all")
    assert state.of(Rigging).landmarks == []


def test_clicks_outside_the_meshes_and_escape_add_no_landmark(hand):
    hand.click("rig tool landmarks")
    x, y, _, height = hand.state.view_rect
    hand.click((x + 5, y + height - 5))
    assert hand.says("Landmarks: click on the template") and hand.state.of(Rigging).pending is None
    template = current_template(hand.state)
    place = ghost_place(hand.state, template)
    mesh = posed_template(hand.state.of(Rigging), template)
    center = apply_transform(place, mesh.positions.mean(axis=0)[None])[0]
    hand.click(view_frame(hand.state).place(center))
    assert hand.state.of(Rigging).pending is not None
    hand.click((x + 5, y + height - 5))
    assert hand.says("Landmarks: click on the target")
    hand.key("escape")
    assert hand.state.of(Rigging).pending is None and hand.state.of(Rigging).tool == "landmarks"
    hand.key("escape")
    assert hand.state.of(Rigging).tool == ""


def test_matrices_are_projected_onto_similarities():
    turned = rig_scene.ROTATION
    matrix = translation_matrix(np.array([1.0, 2.0, 3.0]))
    matrix[:3, :3] = 2.0 * turned + 1e-5
    found = as_similarity(matrix)
    assert_allclose(found.rotation @ found.rotation.T, np.eye(3), atol=1e-14)
    assert_allclose(found.rotation, turned, atol=1e-4)
    assert found.scale == pytest.approx(2.0, rel=1e-4)
    assert_allclose(found.shift, [1.0, 2.0, 3.0])
