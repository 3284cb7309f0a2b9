"""``viewer.render`` with the settings of the command."""

import dataclasses

import numpy as np
import pytest

import viewer
from viewer.cli import run
from viewer.commands._pictures import display_options
from viewer.errors import RigError, ViewerError
from viewer.formats import Source
from viewer.formats._references import read_picture

SIZE = (120, 90)


def test_settings_draw_what_the_command_draws(tmp_path):
    words = ["--look-at", "head", "--distance", "60", "--scalar", "weight:head", "--azimuth", "20"]
    words += ["--background", "white", "--quality", "normal", "--size", "120x90"]
    assert run(["render", "-o", str(tmp_path / "fox.png"), *words]) == 0
    settings = {"look_at": "head", "distance": 60, "scalar": "weight:head", "azimuth": 20}
    found = viewer.render(viewer.load(), SIZE, **settings, background="white", quality="normal")
    np.testing.assert_array_equal(found, read_picture(Source.open(tmp_path / "fox.png")))


def test_time_poses_a_copy():
    turns = np.zeros((2, 2, 3))
    turns[1, 1, 2] = np.pi / 2
    square = [[0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 2, 0]]
    figure = viewer.figure(
        square,
        [[0, 1, 2, 3]],
        weights=[[1, 0], [1, 0], [0, 1], [0, 1]],
        joints=[[0, 0, 0], [0, 1, 0]],
    )
    actor = viewer.animate(figure, turns, fps=1)
    camera = viewer.Camera(distance=8.0, azimuth=0.0, inclination=0.0)
    later = viewer.render(actor, SIZE, camera, time=1.0)
    assert actor["joint_1"].tolist() == [0, 0, 0]
    np.testing.assert_array_equal(later, viewer.render(actor.at(1.0), SIZE, camera))
    assert (later != viewer.render(actor, SIZE, camera)).any()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"shading": "nonsense"}, "^shading: no value .*phong, pbr"),
        ({"shading": 3}, '^shading: expected "auto" or "phong" or .*, found int'),
        ({"wire": True}, "^render: no option is called wire; did you mean .*allowed: background"),
        ({"sizes": (9, 9)}, "^render: no option is called sizes; did you mean size"),
        ({"setting": 1}, "^render: no option is called setting; (?!did you mean settings)"),
        ({"wireframe": "yes"}, "^wireframe: expected True or False, found str"),
        ({"metallic": 2}, "^metallic: expected 0 to 1, found 2"),
        ({"isolines": 3}, "^isolines: expected True or False or None, found int"),
        (
            {"scalar": "weight:head", "scalar_range": (1, "2")},
            r"^scalar_range\[1\]: expected a number, found str",
        ),
        ({"quality": "best"}, '^quality: no value "best"; there are 3: draft, normal, final'),
        ({"background": "blue"}, '^background: expected "gradient"'),
        ({"scalar": "weight:nobody"}, '^weight:nobody: no joint is called "nobody"'),
        ({"distance": -1}, "^distance: expected more than 0, found -1"),
        ({"camera": viewer.Camera(), "azimuth": 3}, "^camera: expected it or settings of the view"),
    ],
    ids=lambda value: str(value)[:20],
)
def test_values_that_do_not_exist_are_named(settings, message):
    with pytest.raises(ViewerError, match=message):
        viewer.render(viewer.load(), SIZE, **settings)


def test_every_display_option_is_a_keyword_of_the_same_effect():
    scene, options = viewer.load(), viewer.DisplayOptions(quality="normal")
    for each in dataclasses.fields(options):
        value = getattr(options, each.name)
        assert display_options(viewer.render, None, {each.name: value}) in (
            options,
            dataclasses.replace(options, shading="scalar"),
        )
    found = viewer.render(scene, SIZE, shading="normals", wireframe=True)
    options.shading, options.wireframe = "normals", True
    np.testing.assert_array_equal(found, viewer.render(scene, SIZE, options=options))
    assert (found != viewer.render(scene, SIZE)).any()


def test_unknown_joints_and_other_objects_are_refused():
    with pytest.raises(RigError, match='no actor, joint or point is called "nobody"'):
        viewer.render(viewer.load(), SIZE, look_at="nobody")
    with pytest.raises(ViewerError, match=r"^render: expected a scene or an actor, found list"):
        viewer.render([viewer.load()])


def test_times_that_no_motion_reaches_are_refused(tmp_path):
    actor = moving_square()
    with pytest.raises(ViewerError, match=r"^time: expected 0 to 1.5 seconds, found 9"):
        viewer.render(actor, SIZE, time=9.0)
    with pytest.raises(ViewerError, match=r"^time: expected 0 to 1.5 seconds, found -1"):
        viewer.export(actor, tmp_path / "a.obj", time=-1.0)
    with pytest.raises(ViewerError, match=r"^time: expected seconds, found inf"):
        viewer.render(actor, SIZE, time=float("inf"))


def test_given_options_are_not_changed():
    options = viewer.DisplayOptions(samples=1)
    viewer.render(viewer.load(), SIZE, options=options, scalar="weight:head", background="white")
    assert options == viewer.DisplayOptions(samples=1)


def moving_square() -> viewer.Actor:
    turns = np.zeros((4, 1, 3))
    turns[:, 0, 2] = np.linspace(0.0, 1.0, 4)
    square = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
    figure = viewer.figure(square, [[0, 1, 2, 3]], weights=np.ones((4, 1)), joints=[[0, 0, 0]])
    return viewer.animate(figure, turns, fps=2)


def test_numbered_images_are_those_of_each_time(tmp_path):
    actor, settings = moving_square(), {"azimuth": 0.0, "distance": 9.0, "look_at": "joint_0"}
    # The ground of a video lies below its whole motion.
    settings["options"] = viewer.DisplayOptions(grid=False, shadows=False)
    viewer.video(actor, tmp_path / "a_{frame}.png", SIZE, frames=range(1, 4, 2), **settings)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a_1.png", "a_3.png"]
    for frame in (1, 3):
        alone = viewer.render(actor, SIZE, time=0.5 * frame, **settings)
        found = read_picture(Source.open(tmp_path / f"a_{frame}.png"))
        assert (np.abs(found.astype(int) - alone).max(axis=-1) > 2).mean() < 0.02


def test_video_has_the_frames_of_the_motion(tmp_path):
    av = pytest.importorskip("av")
    for name, settings, count in (
        ("motion.mp4", {}, 4),
        ("faster.mp4", {"fps": 4}, 7),
        ("turn.mp4", {"turntable": True}, 4),
    ):
        viewer.video(moving_square(), tmp_path / name, SIZE, **settings)
        with av.open(tmp_path / name) as container:
            assert sum(1 for _ in container.decode(video=0)) == count


@pytest.mark.parametrize(
    ("name", "settings", "message"),
    [
        ("a.png", {}, "^path: expected a video"),
        ("a.mp4", {"frames": range(9, 12)}, "^frames: expected a range within 0:4"),
        ("a.mp4", {"speed": 0.0}, "^speed: expected 0.001 to 1000"),
        ("a.mp4", {"turntable": -1.0}, "^turntable: expected seconds"),
        ("a.mp4", {"quality": "best"}, "^quality: no value"),
    ],
)
def test_videos_that_cannot_be_recorded_are_refused(tmp_path, name, settings, message):
    with pytest.raises(ViewerError, match=message):
        viewer.video(moving_square(), tmp_path / name, SIZE, **settings)
    assert not [*tmp_path.iterdir()]


def test_still_scenes_need_a_turntable(tmp_path):
    with pytest.raises(ViewerError, match=r"^nothing moves: "):
        viewer.video(viewer.load(), tmp_path / "a.mp4", SIZE)
