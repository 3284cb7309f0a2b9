"""GVHMR results: both spaces, the mean hands, and the camera that connects the spaces."""

from pathlib import Path

import numpy as np
import pytest
from formats.synthetic_smpl import model
from formats.torch.torch_bytes import torch_zip
from formats.video_mocap.plain_smpl import vertices
from formats.video_mocap.tool_files import (
    assert_drawn,
    drawn,
    gvhmr,
    gvhmr_file,
    matrices,
    scene_of,
)
from numpy.testing import assert_allclose

from viewer.commands.info import describe
from viewer.errors import FormatError
from viewer.formats import Source, detect
from viewer.formats.video_mocap import Options
from viewer.formats.video_mocap import read as open_results
from viewer.rig.captures.cameras import view_at

SPACES = {"world": "smpl_params_global", "camera": "smpl_params_incam"}


def wanted(space: str, frame: int) -> np.ndarray:
    part = gvhmr()[SPACES[space]]
    turned = matrices(
        np.vstack([part["global_orient"][frame], part["body_pose"][frame].reshape(-1, 3)])
    )
    return vertices("smplx", model("smplx"), part["betas"][frame], turned, part["transl"][frame])[0]


@pytest.mark.parametrize("space", SPACES)
def test_vertices_follow_the_tools_formula(space: str, tmp_path: Path) -> None:
    scene = scene_of(gvhmr_file(tmp_path), "smplx", space)
    assert scene.up == "y"
    for frame in range(4):
        assert_drawn(scene, 0, frame, wanted(space, frame))


def test_camera_in_world_space_sees_the_people_as_in_camera_space(tmp_path: Path) -> None:
    path = gvhmr_file(tmp_path)
    world, camera = scene_of(path, "smplx", "world"), scene_of(path, "smplx", "camera")
    assert [len(scene.views) for scene in (world, camera)] == [1, 1]
    for frame in range(4):
        view = view_at(world.views[0], frame / 30)
        seen = drawn(world, 0, frame) @ view.rotation.T + view.translation
        assert_allclose(seen, drawn(camera, 0, frame), rtol=0, atol=2e-6)
        assert_allclose(view.intrinsic, gvhmr()["K_fullimg"][0])
    assert world.views[0].size == (1280, 720)


@pytest.mark.parametrize("has_video", [True, False])
def test_genmo_has_the_same_parameters_under_other_names(has_video: bool, tmp_path: Path) -> None:
    given = {key.replace("smpl_params", "body_params"): part for key, part in gvhmr().items()}
    if not has_video:
        given |= {"body_params_incam": None, "K_fullimg": None}
    path = tmp_path / "smpl_params.pt"
    path.write_bytes(torch_zip(given))
    scene = scene_of(path, "smplx")
    assert len(scene.views) == has_video
    assert_drawn(scene, 0, 2, wanted("world", 2))
    spaces = "world and camera" if has_video else "world"
    assert scene.facts[0] == ("capture", f"GENMO: 1 person, in {spaces} space")


def test_people_in_camera_space_are_upright_and_the_camera_is_fixed(tmp_path: Path) -> None:
    scene = scene_of(gvhmr_file(tmp_path), "smplx", "camera")
    actor, view = scene.actors[0], scene.views[0]
    assert_allclose(actor.placement[:3, :3], np.diag([1.0, -1.0, -1.0]), atol=1e-12)
    assert_allclose(view.rotation @ actor.placement[:3, :3], np.eye(3), atol=1e-12)
    assert view.motion is None


def test_capture_has_the_properties_of_the_file(tmp_path: Path) -> None:
    source = Source.open(gvhmr_file(tmp_path))
    assert detect(source) == "video_mocap"
    capture = open_results(source)
    assert (capture.name, capture.n_frames, capture.model) == ("hmr4d_results", 4, "SMPL-X")
    assert (capture.space, capture.up) == ("world", "y")
    assert next(iter(capture.parts())).bodies[0].timing.frame_rate == 30.0
    assert source.warnings == []
    assert capture.in_space is not None
    other = capture.in_space("camera")
    assert (other.space, other.up) == ("camera", "-y")


def test_info_states_the_recognised_tool(tmp_path: Path) -> None:
    scene = scene_of(gvhmr_file(tmp_path), "smplx")
    assert describe(scene)["captures"] == [
        ["capture", "GVHMR: 1 person, in world and camera space"],
        ["not needed", "net_outputs"],
    ]


def test_single_space_is_sufficient(tmp_path: Path) -> None:
    given = gvhmr()
    del given["smpl_params_global"], given["K_fullimg"]
    source = Source(tmp_path / "a.pt", torch_zip(given))
    capture = open_results(source)
    assert (capture.space, capture.in_space, capture.views) == ("", None, ())
    with pytest.raises(FormatError) as caught:
        open_results(source, Options(space="world"))
    assert caught.value.diagnostic.key == "F002.video-space"


def test_results_without_frames_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FormatError) as caught:
        open_results(Source("a.pt", torch_zip(gvhmr(0))))
    assert caught.value.diagnostic.key == "F002.video-people"


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"body_pose": np.zeros((4, 69), np.float32)}, "F002.value"),
        ({"transl": np.zeros((3, 3), np.float32)}, "F002.value"),
        ({"betas": np.zeros((3, 10), np.float32)}, "F002.value"),
        ({"transl": np.full((4, 3), np.nan, np.float32)}, "F003.frames-lost"),
        ({"transl": np.full((4, 3), 1e30, np.float32)}, "F003.frames-lost"),
        ({"body_pose": np.zeros((0, 63), np.float32)}, "F002.value"),
        ({"body_pose": 5}, "F002.value"),
    ],
)
def test_inconsistent_arrays_are_refused(change: dict[str, object], key: str) -> None:
    given = gvhmr()
    given["smpl_params_global"] = given["smpl_params_global"] | change
    with pytest.raises(FormatError) as caught:
        open_results(Source("a.pt", torch_zip(given)))
    assert caught.value.diagnostic.key == key
    assert "smpl_params_global." in str(caught.value)
