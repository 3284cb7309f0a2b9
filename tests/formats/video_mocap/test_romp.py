"""ROMP and BEV: dicts in arrays of objects, people by track or order, and the images' numbers."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formats.capture_files import waves
from formats.synthetic_smpl import model
from formats.video_mocap.plain_smpl import vertices
from formats.video_mocap.tool_files import AHEAD, UPRIGHT, assert_drawn, matrices, scene_of, single
from numpy.testing import assert_allclose

from viewer.errors import FormatError
from viewer.formats import Source, detect
from viewer.formats.video_mocap import read as open_results


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


def test_vertices_follow_the_tools_formula(tmp_path: Path) -> None:
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


def test_people_of_bev_are_placed_by_their_hips_and_seen_by_its_camera(tmp_path: Path) -> None:
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


def test_weak_perspective_of_romp_is_not_a_camera(tmp_path: Path) -> None:
    shown = image(2, 1.0)
    joints = aligned(shown)
    cam = np.array([[0.5, 0.1, 0.2], [0.3, -0.2, 0.1]])
    shown["cam_trans"] = single(2.0 * np.c_[cam[:, 1:], np.ones(2)] / cam[:, :1])
    pixels = (cam[:, None, :1] * joints[..., :2] + cam[:, None, 1:] + 1.0) * 640.0 - [0.0, 280.0]
    path = written(tmp_path, shown | {"joints": single(joints), "pj2d_org": single(pixels)})
    assert not open_results(Source.open(path)).views


def test_rows_of_the_same_person_and_image_are_reported(tmp_path: Path) -> None:
    path = written(tmp_path, {"1.jpg": image(3, 0.0, track_ids=np.array([4, 4, 5]))})
    source = Source.open(path)
    found = next(iter(open_results(source).parts())).bodies
    assert sorted(found) == [4, 5]
    notes = [note for note in source.diagnostics.warnings if note.key == "F007.video-same-frame"]
    assert [note.values for note in notes] == [{"n": 1}]


def test_tracked_people_keep_their_ids_and_gaps(tmp_path: Path) -> None:
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


def test_people_without_tracks_are_counted_in_each_image(tmp_path: Path) -> None:
    path = written(tmp_path, {"a.jpg": image(1, 0.0), "b.jpg": image(2, 1.0)})
    source = Source.open(path)
    found = next(iter(open_results(source).parts())).bodies
    assert {person: body.timing.present.tolist() for person, body in found.items()} == {
        0: [True, True],
        1: [False, True],
    }
    assert "F007.video-repeated" in [note.key for note in source.diagnostics.warnings]


def test_infant_coefficient_of_bev_is_reported(tmp_path: Path) -> None:
    path = written(tmp_path, image(1, 0.0, smpl_betas=np.full((1, 11), 0.5)))
    capture = open_results(Source.open(path))
    assert next(iter(capture.parts())).bodies[0].shape.shape == (1, 10)
    assert [heading for heading, _ in capture.facts] == ["capture", "not applied", "not needed"]


class _Hostile:
    def __reduce__(self) -> tuple[Any, ...]:
        return os.system, ("true",)


def test_objects_that_run_code_are_refused_by_name(tmp_path: Path) -> None:
    path = written(tmp_path, {"a.jpg": _Hostile()})
    with pytest.raises(FormatError, match=r"system"):
        open_results(Source.open(path))


def test_objects_that_are_not_needed_are_not_read(tmp_path: Path) -> None:
    path = written(tmp_path, image(1, 0.0), other=np.array([_Hostile()], dtype=object))
    assert sorted(bodies(path)) == [0]
