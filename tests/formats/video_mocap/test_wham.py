"""WHAM results: people with IDs and gaps, both spaces, shapes per frame, assumed frame rates."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formats.archive.joblib_bytes import joblib_file
from formats.synthetic_smpl import model
from formats.video_mocap.plain_smpl import vertices
from formats.video_mocap.tool_files import (
    assert_drawn,
    drawn,
    matrices,
    scene_of,
    wham,
    wham_file,
)
from numpy.testing import assert_allclose

from viewer.errors import FormatError
from viewer.formats import Source, detect
from viewer.formats.video_mocap import Options
from viewer.formats.video_mocap import read as open_results

KEYS = {"world": ("pose_world", "trans_world"), "camera": ("pose", "trans")}


def wanted(space: str, person: int, row: int) -> np.ndarray:
    found = wham()[person]
    pose, trans = (found[key][row] for key in KEYS[space])
    turned = matrices(pose.reshape(24, 3))
    return vertices("smpl", model("smpl"), found["betas"][row], turned, trans)[0]


@pytest.mark.parametrize("space", KEYS)
def test_vertices_follow_the_tools_formula(space: str, tmp_path: Path) -> None:
    scene = scene_of(wham_file(tmp_path), "smpl", space)
    assert [actor.person for actor in scene.actors] == [0, 4]
    for person, found in wham().items():
        for row, frame in enumerate(found["frame_ids"]):
            assert_drawn(scene, person, int(frame), wanted(space, person, row))


def test_people_are_absent_outside_their_frames(tmp_path: Path) -> None:
    scene = scene_of(wham_file(tmp_path), "smpl")
    seen = {p: [drawn(scene, p, f) is not None for f in range(8)] for p in (0, 4)}
    assert seen[0] == [True] * 4 + [False] * 4
    assert seen[4] == [False] * 3 + [True, True, False, True, True]


def test_shape_varies_unless_it_is_averaged(tmp_path: Path) -> None:
    path = wham_file(tmp_path)
    weights = scene_of(path, "smpl").actors[0].clip.shape_weights
    assert_allclose(weights, wham()[0]["betas"], atol=1e-12)
    averaged = scene_of(path, "smpl", average_shape=True).actors[0].clip.shape_weights
    assert_allclose(averaged, wham()[0]["betas"].astype(float).mean(axis=0)[None], atol=1e-12)


@pytest.mark.parametrize(("given", "rate"), [(None, 30.0), (25.0, 25.0)])
def test_frame_rate_is_given_or_assumed(given: float | None, rate: float, tmp_path: Path) -> None:
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
def test_inconsistent_arrays_are_refused(changes: dict[str, Any], key: str) -> None:
    assert refusal(changes) == key


def test_keys_are_numbers_of_people() -> None:
    people: dict[Any, Any] = {**wham(), "x": wham()[0]}
    with pytest.raises(FormatError) as caught:
        open_results(Source("a.pkl", joblib_file(people)))
    assert caught.value.diagnostic.key == "F002.video-person"
    assert caught.value.diagnostic.values["item"] == "x"


def test_results_without_people_are_refused() -> None:
    empty = {0: {key: value[:0] for key, value in wham()[0].items()}}
    with pytest.raises(FormatError) as caught:
        open_results(Source("a.pkl", joblib_file(empty)))
    assert caught.value.diagnostic is not None
    assert caught.value.diagnostic.key == "F002.video-people"
