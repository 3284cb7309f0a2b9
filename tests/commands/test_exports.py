"""``viewer.export``: what the command ``convert`` writes, from Python."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import viewer
from viewer.cli import run
from viewer.errors import OutputError, UnsupportedFormatError, ViewerError
from viewer.exporters import ExportOptions


@pytest.fixture
def turning() -> viewer.Actor:
    """A square that turns by 1 radian in four frames, about z."""
    figure = viewer.figure(
        [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]],
        [[0, 1, 2, 3]],
        weights=np.ones((4, 1)),
        joints=[[0, 0, 0]],
        unit="m",
    )
    rotations = np.zeros((4, 1, 3))
    rotations[:, 0, 2] = np.linspace(0.0, 1.0, 4)
    return viewer.animate(figure, rotations, fps=2, name="turning")


def test_motion_is_written_where_the_format_stores_it(turning, tmp_path):
    viewer.export(turning, tmp_path / "own.glb")
    read = viewer.load(tmp_path / "own.glb")[0]
    for time in (0.0, 0.5, 1.5):
        assert_allclose(read.vertices(time), turning.vertices(time), atol=1e-6)


def test_time_writes_one_pose_and_leaves_the_actor(turning, tmp_path):
    viewer.export(turning, tmp_path / "own.obj", time=1.5)
    corner = np.sqrt(2.0) * np.array([np.cos(np.pi / 4 + 1.0), np.sin(np.pi / 4 + 1.0), 0.0])
    read = viewer.load(tmp_path / "own.obj")[0]
    assert_allclose(read.vertices()[0, 2], corner, atol=1e-6)
    assert turning["joint_0"].tolist() == [0, 0, 0]


def test_frames_and_rate_are_those_of_the_command(turning, tmp_path):
    viewer.export(turning, tmp_path / "own.glb")
    words = ["--frames", "1:3", "--fps", "2"]
    assert run(["convert", str(tmp_path / "own.glb"), "-o", str(tmp_path / "a.bvh"), *words]) == 0
    scene = viewer.load(tmp_path / "own.glb")
    viewer.export(scene, tmp_path / "b.bvh", frames=range(1, 3), fps=2)
    assert (tmp_path / "a.bvh").read_text() == (tmp_path / "b.bvh").read_text()


@pytest.mark.parametrize(
    ("settings", "error", "message"),
    [
        ({"path": "own.xyz"}, UnsupportedFormatError, "no motion exporter|no exporter"),
        (
            {"path": "own.glb", "options": ExportOptions(kind="bvh")},
            UnsupportedFormatError,
            r"^as bvh: expected a name with \.bvh, found .*own\.glb$",
        ),
        (
            {"options": ExportOptions(kind="bhv")},
            UnsupportedFormatError,
            '^no exporter is called "bhv"; did you mean ',
        ),
        ({"frames": range(0, 4, 2)}, ViewerError, "^frames: expected a step of 1, found 2"),
        ({"frames": range(9)}, ViewerError, "^frames: expected a range within 0:4"),
        ({"frames": range(2), "time": 1.0}, ViewerError, "^frames and time: expected one"),
    ],
)
def test_requests_that_cannot_be_met_are_refused(turning, tmp_path, settings, error, message):
    path = tmp_path / settings.pop("path", "own.bvh")
    with pytest.raises(error, match=message):
        viewer.export(turning, path, **settings)
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize(
    ("speed", "up", "unit"),
    [(0.0, "y", "m"), (0.5, "y", "m"), (0.0, "z", "m"), (0.5, "z", "cm"), (0.5, "y", "in")],
)
def test_moved_figure_is_read_back_with_its_joints_and_path(tmp_path, speed, up, unit):
    figure = viewer.figure(
        [[0, 0, 0], [1, 0, 0], [0, 2, 0]],
        [[0, 1, 2]],
        weights=[[1, 0], [1, 0], [0.25, 0.75]],
        joints=[[0, 0.5, 0], [0, 1, 0]],
        parents=[-1, 0],
        names=["base", "tip"],
        unit=unit,
        up=up,
    )
    rotations = np.zeros((5, 2, 3))
    rotations[:, :, 2] = np.linspace(0.0, 1.0, 5)[:, None]
    path = np.array([3.0, 0, 1]) + speed * np.arange(5)[:, None] * [1, 0.25, 0]
    actor = viewer.animate(figure, rotations, translations=path, fps=30)
    viewer.export(actor, tmp_path / "own.glb")
    read = viewer.load(tmp_path / "own.glb")[0]
    assert read.figure.skeleton.names == ("base", "tip")
    assert (read.figure.up, read.figure.unit) == (up, unit)
    # A root that never moves is at rest where it stays.
    moved = viewer.motion(read).translations
    assert_allclose(moved - moved[0], path - path[0], atol=1e-6)
    assert_allclose(read.joints()[:, 0], path + np.array([0, 0.5, 0]), atol=1e-6)
    assert viewer.diff(actor, read).mpjpe < 1e-3  # mm
    viewer.export(viewer.Scene([actor, actor]), tmp_path / "both.glb")
    for each in viewer.load(tmp_path / "both.glb").actors:
        assert each.figure.skeleton.names == ("base", "tip")


def test_other_objects_are_refused(tmp_path):
    with pytest.raises(ViewerError, match=r"^export: expected a scene .*, found str; viewer.load"):
        viewer.export("fox", tmp_path / "own.glb")


def test_function_stays_a_function_when_exporters_are_imported():
    import viewer.exporters.gltf

    assert callable(viewer.export) and not hasattr(viewer.export, "EXPORTERS")


def test_opened_files_are_not_replaced(turning, tmp_path):
    path = tmp_path / "own.glb"
    viewer.export(turning, path)
    before, scene = path.read_bytes(), viewer.load(path)
    for what in (scene, scene[0]):
        with pytest.raises(OutputError, match=r"own\.glb: .*input"):
            viewer.export(what, path)
    assert path.read_bytes() == before
    viewer.export(scene, tmp_path / "other.glb")
    viewer.export(scene, tmp_path / "other.glb")  # other files are
