"""Figures in different units in one scene."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from formats.capture_files import body, points, write_frames
from formats.easymocap.test_camera_files import cameras
from numpy.testing import assert_allclose
from rig.animated import leg

from viewer.export.rig import scaled
from viewer.formats.rigged import save
from viewer.loading import Contents, begin, bundled_body, load
from viewer.loading.placing import placed_views, stand_up
from viewer.loading.scene_draft import SceneDraft
from viewer.rig.captures.cameras import CameraView
from viewer.rig.scene import scene_unit


def opened(*units):
    figures = [(Path(f"{unit}.glb"), replace(leg(name=unit), unit=unit)) for unit in units]
    return begin(Contents(figures=figures))[0]


@pytest.mark.parametrize(
    ("units", "factors", "unit"),
    [
        (("m", "cm"), (1.0, 0.01), "m"),
        (("cm", "m", "in"), (1.0, 100.0, 2.54), "cm"),
        (("", "mm", "m"), (1.0, 1.0, 1000.0), "mm"),  # unknown units are not scaled
        (("cm", "cm"), (1.0, 1.0), "cm"),
    ],
)
def test_figures_are_scaled_to_the_unit_of_the_first(units, factors, unit):
    scene = opened(*units)
    linear = [actor.placement[:3, :3] for actor in scene.actors]
    assert_allclose(linear, [factor * np.eye(3) for factor in factors], atol=1e-12)
    assert scene_unit(scene) == unit
    notes = [found for found in scene.diagnostics if found.key == "F007.unit-matched"]
    assert [note.values["factor"] for note in notes] == pytest.approx(
        [factor for factor in factors if factor != 1.0]
    )
    assert all(note.severity == "note" for note in notes)


def test_scaled_figures_stand_side_by_side():
    scene = opened("m", "cm")
    sides = [actor.placement[0, 3] for actor in scene.actors]
    # The second is 0.01 times as wide as the first.
    assert 0.0 < sides[1] - sides[0] < 3.0


def test_later_people_and_cameras_of_a_capture_are_scaled(tmp_path):
    known = load(bundled_body()).actors[0].figure
    skeleton = scaled(known, 100.0).skeleton
    names = ("Hips", *skeleton.names[1:])  # another name, so that the capture drives the figure
    save(
        replace(scaled(known, 100.0), unit="cm", skeleton=replace(skeleton, names=names)),
        tmp_path / "large.npz",
    )
    folder = tmp_path / "capture"
    first, both = (0,), (0, 1)
    for name, record in {"smpl": body, "keypoints3d": points}.items():
        frames = {
            n: [record(person) for person in people] for n, people in enumerate([first, both])
        }
        write_frames(folder / name, frames)
    cameras(folder)
    scene = load(tmp_path / "large.npz", folder)
    assert scene_unit(scene) == "cm"
    scales = [np.linalg.norm(a.placement[:3, 0]) for a in scene.actors if a.figure.points]
    assert scales == pytest.approx([100.0, 100.0])
    assert_allclose(scene.views[0].translation, [50.0, -100.0, 300.0])
    notes = [found for found in scene.diagnostics if found.key == "F007.unit-matched"]
    assert len(notes) == 1  # of the first person only


def test_later_people_and_cameras_are_upright():
    late, draft = SimpleNamespace(placement=np.eye(4), up="y", views=(), unit=""), SceneDraft([])
    late.views = (CameraView("1", np.eye(3), np.eye(3), np.array([0.0, 1.0, 0.0])),)
    draft.builders = [late]
    stand_up(draft, "z")
    assert_allclose(late.placement[:3, :3] @ [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], atol=1e-12)
    view = placed_views(draft)[0]
    assert_allclose(-view.rotation.T @ view.translation, [0.0, 0.0, -1.0], atol=1e-12)
