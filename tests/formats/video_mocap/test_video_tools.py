"""Tools of video motion capture: files as each of them writes them."""

import os
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formats.archive.joblib_bytes import joblib_file
from formats.capture_files import waves
from formats.synthetic_smpl import model
from formats.torch.torch_bytes import torch_zip
from formats.video_mocap.tool_files import (
    AHEAD,
    UPRIGHT,
    assert_drawn,
    body_model,
    drawn,
    gvhmr,
    gvhmr_file,
    matrices,
    phalp,
    phalp_body,
    scene_of,
    single,
    vertices,
    wham,
    wham_file,
)
from numpy.testing import assert_allclose

from viewer.commands.info import describe
from viewer.errors import FormatError
from viewer.formats import Source, detect
from viewer.formats.video_mocap import Options
from viewer.formats.video_mocap import read as open_results
from viewer.formats.video_mocap.tools import TOOLS, module_of
from viewer.loading import MotionSettings, load
from viewer.models import save_model_folder
from viewer.rigs.captures.cameras import view_at

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize("tool", TOOLS)
def test_modules_have_the_functions_of_their_rows(tool):
    module = module_of(tool)
    wanted = ["recognises", "read"] + ["claims_folder", "read_folder"] * TOOLS[tool].has_folders
    assert all(callable(getattr(module, name, None)) for name in wanted)


@pytest.mark.parametrize("page", ["README.md", "viewer/manual/video.md"])
def test_manual_pages_name_every_tool(page):
    text = (ROOT / page).read_text("utf-8")
    for row in TOOLS.values():
        for title in row.title.removesuffix(" of other tools").split(", "):
            assert title in text, title


KEYS = {"world": ("pose_world", "trans_world"), "camera": ("pose", "trans")}


def wham_vertices(space: str, person: int, row: int) -> np.ndarray:
    found = wham()[person]
    pose, trans = (found[key][row] for key in KEYS[space])
    turned = matrices(pose.reshape(24, 3))
    return vertices("smpl", model("smpl"), found["betas"][row], turned, trans)[0]


@pytest.mark.parametrize("space", KEYS)
def test_vertices_follow_the_formula_of_wham(space, tmp_path):
    scene = scene_of(wham_file(tmp_path), "smpl", space)
    assert [actor.person for actor in scene.actors] == [0, 4]
    for person, found in wham().items():
        for row, frame in enumerate(found["frame_ids"]):
            assert_drawn(scene, person, int(frame), wham_vertices(space, person, row))


def test_people_are_absent_outside_their_frames(tmp_path):
    scene = scene_of(wham_file(tmp_path), "smpl")
    seen = {p: [drawn(scene, p, f) is not None for f in range(8)] for p in (0, 4)}
    assert seen[0] == [True] * 4 + [False] * 4
    assert seen[4] == [False] * 3 + [True, True, False, True, True]


def test_shape_varies_unless_it_is_averaged(tmp_path):
    path = wham_file(tmp_path)
    weights = scene_of(path, "smpl").actors[0].clip.shape_weights
    assert_allclose(weights, wham()[0]["betas"], atol=1e-12)
    averaged = scene_of(path, "smpl", average_shape=True).actors[0].clip.shape_weights
    assert_allclose(averaged, wham()[0]["betas"].astype(float).mean(axis=0)[None], atol=1e-12)


@pytest.mark.parametrize(("given", "rate"), [(None, 30.0), (25.0, 25.0)])
def test_frame_rate_is_given_or_assumed(given, rate, tmp_path):
    source = Source.open(wham_file(tmp_path))
    assert detect(source) == "video_mocap"
    body = next(iter(open_results(source, Options(given)).parts())).bodies[4]
    assert (body.timing.frame_rate, body.timing.first_frame) == (rate, 0)
    keys = [found.key for found in source.diagnostics.warnings]
    assert keys == ([] if given else ["F007.no-rate"])


def refusal(changes: dict[str, Any]) -> str:
    people = wham()
    people[4] |= changes
    with pytest.raises(FormatError) as caught:
        open_results(Source("a.pkl", joblib_file(people)))
    assert caught.value.diagnostic is not None
    return caught.value.diagnostic.key


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"frame_ids": np.array([1, 2, 3, 1 << 30])}, "F002.video-frames"),
        ({"frame_ids": np.array([-1, 2, 3, 4])}, "F002.video-frames"),
        ({"frame_ids": np.array([0.5, 2, 3, 4])}, "F002.video-frame-numbers"),
        ({"frame_ids": np.array([1, 2, 3])}, "F002.value"),
        ({"pose_world": np.zeros((4, 69))}, "F002.value"),
        ({"trans": np.zeros((4, 2))}, "F002.value"),
        ({"betas": np.array("x")}, "F002.value"),
    ],
)
def test_inconsistent_arrays_of_wham_are_refused(changes, key):
    assert refusal(changes) == key


def test_keys_are_numbers_of_people():
    people: dict[Any, Any] = {**wham(), "x": wham()[0]}
    with pytest.raises(FormatError) as caught:
        open_results(Source("a.pkl", joblib_file(people)))
    assert caught.value.diagnostic.key == "F002.video-person"
    assert caught.value.diagnostic.values["item"] == "x"


def test_results_without_people_are_refused():
    empty = {0: {key: value[:0] for key, value in wham()[0].items()}}
    with pytest.raises(FormatError) as caught:
        open_results(Source("a.pkl", joblib_file(empty)))
    assert caught.value.diagnostic is not None
    assert caught.value.diagnostic.key == "F002.video-people"


SPACES = {"world": "smpl_params_global", "camera": "smpl_params_incam"}


def gvhmr_vertices(space: str, frame: int) -> np.ndarray:
    part = gvhmr()[SPACES[space]]
    turned = matrices(
        np.vstack([part["global_orient"][frame], part["body_pose"][frame].reshape(-1, 3)])
    )
    return vertices("smplx", model("smplx"), part["betas"][frame], turned, part["transl"][frame])[0]


@pytest.mark.parametrize("space", SPACES)
def test_vertices_follow_the_formula_of_gvhmr(space, tmp_path):
    scene = scene_of(gvhmr_file(tmp_path), "smplx", space)
    assert scene.up == "y"
    for frame in range(4):
        assert_drawn(scene, 0, frame, gvhmr_vertices(space, frame))


def test_camera_in_world_space_sees_the_people_as_in_camera_space(tmp_path):
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
def test_genmo_has_the_same_parameters_under_other_names(has_video, tmp_path):
    given = {key.replace("smpl_params", "body_params"): part for key, part in gvhmr().items()}
    if not has_video:
        given |= {"body_params_incam": None, "K_fullimg": None}
    path = tmp_path / "smpl_params.pt"
    path.write_bytes(torch_zip(given))
    scene = scene_of(path, "smplx")
    assert len(scene.views) == has_video
    assert_drawn(scene, 0, 2, gvhmr_vertices("world", 2))
    spaces = "world and camera" if has_video else "world"
    assert scene.facts[0] == ("capture", f"GENMO: 1 person, in {spaces} space")


def test_people_in_camera_space_are_upright_and_the_camera_is_fixed(tmp_path):
    scene = scene_of(gvhmr_file(tmp_path), "smplx", "camera")
    actor, view = scene.actors[0], scene.views[0]
    assert_allclose(actor.placement[:3, :3], np.diag([1.0, -1.0, -1.0]), atol=1e-12)
    assert_allclose(view.rotation @ actor.placement[:3, :3], np.eye(3), atol=1e-12)
    assert view.motion is None


def test_capture_has_the_properties_of_the_file(tmp_path):
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


def test_info_states_the_recognised_tool(tmp_path):
    scene = scene_of(gvhmr_file(tmp_path), "smplx")
    assert describe(scene)["captures"] == [
        ["capture", "GVHMR: 1 person, in world and camera space"],
        ["not needed", "net_outputs"],
    ]


def test_single_space_is_sufficient(tmp_path):
    given = gvhmr()
    del given["smpl_params_global"], given["K_fullimg"]
    source = Source(tmp_path / "a.pt", torch_zip(given))
    capture = open_results(source)
    assert (capture.space, capture.in_space, capture.views) == ("", None, ())
    with pytest.raises(FormatError) as caught:
        open_results(source, Options(space="world"))
    assert caught.value.diagnostic.key == "F002.video-space"


def test_results_without_frames_are_refused(tmp_path):
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
def test_inconsistent_arrays_of_gvhmr_are_refused(change, key):
    given = gvhmr()
    given["smpl_params_global"] = given["smpl_params_global"] | change
    with pytest.raises(FormatError) as caught:
        open_results(Source("a.pt", torch_zip(given)))
    assert caught.value.diagnostic.key == key
    assert "smpl_params_global." in str(caught.value)


def image(count: int, seed: float, **changes: Any) -> dict[str, Any]:
    """Return the results of one image, as ROMP's program returns them."""
    poses = waves(count, 72, seed=seed) / 2 + np.concatenate([UPRIGHT, np.zeros(69)])
    return {
        "cam": np.zeros((count, 3)),
        "smpl_thetas": single(poses),
        "smpl_betas": single(waves(count, 10, seed=seed + 1)),
        "cam_trans": single(waves(count, 3, seed=seed + 2) + AHEAD),
        "verts": single(np.zeros((count, 6890, 3))),
        **changes,
    }


def written(folder: Path, results: Any, **members: Any) -> Path:
    path = folder / "video_results.npz"
    np.savez(path, results=results, **members)
    return path


def bodies(path: Path) -> dict[int, Any]:
    return next(iter(open_results(Source.open(path)).parts())).bodies


def test_vertices_follow_the_formula_of_romp(tmp_path):
    shown = image(2, 1.0)
    scene = scene_of(written(tmp_path, shown), "smpl")
    assert [actor.person for actor in scene.actors] == [0, 1]
    for person in range(2):
        turned = matrices(shown["smpl_thetas"][person].reshape(24, 3))
        shape, place = shown["smpl_betas"][person], shown["cam_trans"][person]
        wanted = vertices("smpl", model("smpl"), shape, turned, place)[0]
        assert_drawn(scene, person, 0, wanted)


def aligned(shown: dict[str, Any]) -> Any:
    """Return the joints of the people as BEV stores them: relative to a point near the hips."""
    found = []
    for row, pose in enumerate(shown["smpl_thetas"]):
        turned = matrices(pose.reshape(24, 3))
        joints = vertices("smpl", model("smpl"), shown["smpl_betas"][row], turned, 0.0)[1]
        found.append(joints - joints[[1, 2]].mean(axis=0))
    return np.array(found)


def test_people_of_bev_are_placed_by_their_hips_and_seen_by_its_camera(tmp_path):
    width, height = 1280.0, 720.0
    shown = image(2, 1.0)
    joints = aligned(shown)
    points = joints + shown["cam_trans"][:, None]
    # The image is padded to a square, which is scaled to 512 pixels with a focal length of 443.4.
    pixels = points[..., :2] / points[..., 2:] * 443.4 / 512.0 * width + [width / 2.0, height / 2.0]
    path = written(tmp_path, shown | {"joints": single(joints), "pj2d_org": single(pixels)})
    scene = scene_of(path, "smpl")
    for person in range(2):
        turned = matrices(shown["smpl_thetas"][person].reshape(24, 3))
        wanted, own = vertices("smpl", model("smpl"), shown["smpl_betas"][person], turned, 0.0)
        assert_drawn(scene, person, 0, wanted + points[person, 0] - own[0])
    (view,) = open_results(Source.open(path)).views
    focal = 443.4 / 512.0 * width
    camera = [[focal, 0.0, width / 2.0], [0.0, focal, height / 2.0], [0.0, 0.0, 1.0]]
    assert_allclose(view.intrinsic, camera, rtol=0, atol=0.01)  # pixels; single precision
    assert view.size == (1280, 720)


def test_weak_perspective_of_romp_is_not_a_camera(tmp_path):
    shown = image(2, 1.0)
    joints = aligned(shown)
    cam = np.array([[0.5, 0.1, 0.2], [0.3, -0.2, 0.1]])
    shown["cam_trans"] = single(2.0 * np.c_[cam[:, 1:], np.ones(2)] / cam[:, :1])
    pixels = (cam[:, None, :1] * joints[..., :2] + cam[:, None, 1:] + 1.0) * 640.0 - [0.0, 280.0]
    path = written(tmp_path, shown | {"joints": single(joints), "pj2d_org": single(pixels)})
    assert not open_results(Source.open(path)).views


def test_rows_of_the_same_person_and_image_are_reported(tmp_path):
    path = written(tmp_path, {"1.jpg": image(3, 0.0, track_ids=np.array([4, 4, 5]))})
    source = Source.open(path)
    found = next(iter(open_results(source).parts())).bodies
    assert sorted(found) == [4, 5]
    notes = [note for note in source.diagnostics.warnings if note.key == "F007.video-same-frame"]
    assert [note.values for note in notes] == [{"n": 1}]


def test_tracked_people_keep_their_ids_and_gaps(tmp_path):
    tracks = {"00000002.jpg": [7], "00000003.jpg": [4, 7], "00000005.jpg": [7]}
    results = {
        name: image(len(ids), row, track_ids=np.array(ids, dtype=np.int32))
        for row, (name, ids) in enumerate(tracks.items())
    }
    path = written(tmp_path, results, sequence_results={})
    found = bodies(path)
    assert detect(Source.open(path)) == "video_mocap"
    assert {person: body.timing.present.tolist() for person, body in found.items()} == {
        4: [False, True, False, False],
        7: [True, True, False, True],
    }
    assert found[7].timing.first_frame == 2
    wanted = results["00000003.jpg"]["cam_trans"][1]
    assert_allclose(found[7].translations[1], wanted, rtol=0, atol=0)


def test_people_without_tracks_are_counted_in_each_image(tmp_path):
    path = written(tmp_path, {"a.jpg": image(1, 0.0), "b.jpg": image(2, 1.0)})
    source = Source.open(path)
    found = next(iter(open_results(source).parts())).bodies
    assert {person: body.timing.present.tolist() for person, body in found.items()} == {
        0: [True, True],
        1: [False, True],
    }
    assert "F007.video-repeated" in [note.key for note in source.diagnostics.warnings]


def test_infant_coefficient_of_bev_is_reported(tmp_path):
    path = written(tmp_path, image(1, 0.0, smpl_betas=np.full((1, 11), 0.5)))
    capture = open_results(Source.open(path))
    assert next(iter(capture.parts())).bodies[0].shape.shape == (1, 10)
    assert [heading for heading, _ in capture.facts] == ["capture", "not applied", "not needed"]


class _Hostile:
    def __reduce__(self) -> tuple[Any, ...]:
        return os.system, ("true",)


def test_objects_that_run_code_are_refused_by_name(tmp_path):
    path = written(tmp_path, {"a.jpg": _Hostile()})
    with pytest.raises(FormatError, match=r"system"):
        open_results(Source.open(path))


def test_objects_that_are_not_needed_are_not_read(tmp_path):
    path = written(tmp_path, image(1, 0.0), other=np.array([_Hostile()], dtype=object))
    assert sorted(bodies(path)) == [0]


def phalp_file(folder: Path) -> Path:
    path = folder / "demo_video.pkl"
    path.write_bytes(zlib.compress(joblib_file(phalp()), 3))
    return path


def test_vertices_follow_the_formula_of_phalp(tmp_path):
    scene = scene_of(phalp_file(tmp_path), "smpl")
    for person, frame in ((2, 0), (2, 1), (2, 2), (5, 0)):
        body, place = phalp_body(person, frame)
        turned = np.concatenate([body["global_orient"], body["body_pose"]])
        wanted = vertices("smpl", model("smpl"), body["betas"], turned, place)[0]
        assert_drawn(scene, person, frame, wanted)


def test_people_out_of_sight_are_omitted_and_counted(tmp_path):
    scene = scene_of(phalp_file(tmp_path), "smpl")
    assert [drawn(scene, 5, frame) is not None for frame in range(3)] == [True, False, False]
    found = {one.key: one.values for one in scene.diagnostics}
    assert found["F007.video-ghosts"] == {"n": 2}


def test_camera_is_that_of_the_network(tmp_path):
    capture = open_results(Source.open(phalp_file(tmp_path)))
    (view,) = capture.views
    assert view.size == (1280, 720)
    assert_allclose(view.intrinsic, [[25000, 0, 640], [0, 25000, 360], [0, 0, 1]])
    assert (capture.space, capture.in_space, capture.up) == ("", None, "-y")


def test_files_are_recognised_by_their_frames(tmp_path):
    assert detect(Source.open(phalp_file(tmp_path))) == "video_mocap"


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"tid": [2]}, "F002.video-lists"),
        ({"camera": []}, "F002.video-lists"),
        ({"tracked_time": [0]}, "F002.video-lists"),
        ({"tid": [2.5, 5]}, "F002.video-whole"),
        ({"tid": "x"}, "F002.video-whole"),
        ({"time": -3}, "F002.video-frames"),
        ({"time": 1 << 40}, "F002.video-frames"),
        ({"smpl": [{}, {}]}, "F002.no-key"),
        ({"smpl": [{"global_orient": np.ones(9)}] * 2}, "F002.no-key"),
        ({"camera": [np.zeros(2)] * 2}, "F002.video-count"),
    ],
)  # fmt: skip
def test_inconsistent_frames_are_refused(changes, key):
    frames = phalp()
    frames["out/img/000001.jpg"] |= changes
    with pytest.raises(FormatError) as caught:
        open_results(Source("a.pkl", joblib_file(frames)))
    assert caught.value.diagnostic is not None
    assert caught.value.diagnostic.key == key


SETTINGS = MotionSettings()


@pytest.fixture
def models(tmp_path: Path) -> Path:
    folder = tmp_path / "models"
    folder.mkdir()
    save_model_folder(folder)
    return folder


def notes_of(path: Path) -> list[str]:
    return [one.key for one in load(path, motion=SETTINGS).diagnostics if "rate" not in one.key]


def test_model_of_the_same_family_member_is_used(models, tmp_path):
    body_model("smpl", models)
    body_model("smplx", models)
    scene = load(wham_file(tmp_path), motion=SETTINGS)
    assert [actor.figure.name for actor in scene.actors] == ["SMPL_NEUTRAL"] * 2
    assert load(gvhmr_file(tmp_path), motion=SETTINGS).actors[0].figure.name == "SMPLX_NEUTRAL"
    assert notes_of(wham_file(tmp_path)) == ["F007.own-model"]


def test_models_of_other_family_members_are_not_used(models, tmp_path):
    body_model("smpl", models)
    assert notes_of(gvhmr_file(tmp_path)) == ["F007.bundled-body-without-shapes"]


def test_model_that_cannot_be_read_is_reported_in_a_note(models, tmp_path):
    (models / "SMPL_NEUTRAL.npz").write_bytes(b"PK\x03\x04")
    wanted = ["F007.own-model-unreadable", "F007.bundled-body-without-shapes"]
    assert notes_of(wham_file(tmp_path)) == wanted


def test_models_among_the_files_take_precedence(models, tmp_path):
    body_model("smpl", models)
    scene = load(wham_file(tmp_path), body_model("smpl", tmp_path), motion=SETTINGS)
    assert "F007.own-model" not in [one.key for one in scene.diagnostics]
