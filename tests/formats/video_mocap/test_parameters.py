"""SMPL parameters in dicts of any layout: key names, forms of rotations, people and frames."""

from typing import Any

import numpy as np
import pytest
from formats.archive.joblib_bytes import joblib_file
from formats.capture_files import waves
from formats.npz_bytes import npz
from formats.torch.torch_bytes import torch_zip
from formats.video_mocap.tool_files import matrices, six_of
from numpy.testing import assert_allclose

from viewer.errors import FormatError
from viewer.formats import Source, detect
from viewer.formats.video_mocap import read as open_results

VECTORS = waves(4, 24, 3) / 2
PLACES = waves(4, 3, seed=1.0)
TURNED = matrices(VECTORS)
SIX = six_of(TURNED)


def source(given: dict[Any, Any] | list[Any]) -> Source:
    return Source("a.pkl", joblib_file(given))


def bodies(given: Any) -> dict[int, Any]:
    return next(iter(open_results(source(given)).parts())).bodies


@pytest.mark.parametrize(
    "given",
    [
        {"rotmat": TURNED, "trans": PLACES},
        {"pred_rotmat": TURNED, "pred_cam_t": PLACES[:, None]},
        {"poses": TURNED, "transl": PLACES},
        {"pose": TURNED.reshape(4, -1), "trans": PLACES},
        {"pred_pose": SIX.reshape(4, -1), "cam_t": PLACES},
        {"pose": SIX.reshape(4, 24, 6), "cam_trans": PLACES},
        {"thetas": VECTORS, "translation": PLACES},
        {"pred_thetas": TURNED.reshape(4, -1), "transl": PLACES},
        {"pose": TURNED, "global_t": PLACES},
        {"pose": VECTORS + 1.0, "trans": PLACES + 1.0, "pose_world": VECTORS.reshape(4, 72),
         "trans_world": PLACES},
        {"global_orient": TURNED[:, :1], "body_pose": TURNED[:, 1:], "trans": PLACES},
        {"global_orient": TURNED[:, 0], "body_pose": TURNED[:, 1:], "cam_t": PLACES},
        {"root_orient": VECTORS[:, 0], "pose_body": VECTORS[:, 1:].reshape(4, 69),
         "cam_t": PLACES},
        {"pred_global_orient": SIX.reshape(4, 24, 6)[:, 0],
         "pred_body_pose": SIX.reshape(4, 24, 6)[:, 1:], "root_trans": PLACES},
        {"smpl": {"poses": VECTORS.reshape(4, 72), "trans": PLACES}},
        {"result": {"params": {"rotmat": TURNED, "trans": PLACES}}},
        [{"rotmat": TURNED[frame], "trans": PLACES[frame]} for frame in range(4)],
        {f"f{frame}": {"pose": VECTORS[frame].ravel(), "cam_t": PLACES[frame]}
         for frame in range(4)},
    ],
)  # fmt: skip
def test_key_names_and_rotation_forms_are_recognised(given):
    assert detect(source(given)) == "video_mocap"
    ((person, body),) = bodies(given).items()
    assert person == 0
    assert body.timing.n_frames == 4
    assert_allclose(body.vectors, VECTORS, atol=1e-9)
    assert_allclose(body.translations, PLACES, atol=1e-12)


@pytest.mark.parametrize(
    ("place", "up", "space"), [("cam_t", "-y", ""), ("pred_cam_t", "-y", ""), ("trans", "", "")]
)
def test_camera_space_has_y_down_and_world_up_axis_is_estimated(place, up, space):
    capture = open_results(source({"rotmat": TURNED, place: PLACES}))
    assert (capture.up, capture.space) == (up, space)


def test_people_frames_and_shapes_are_read():
    one = {"rotmat": TURNED, "trans": PLACES, "betas": waves(10), "frames": np.array([5, 6, 8, 9])}
    two = {"rotmat": TURNED[:2], "trans": PLACES[:2], "shape": waves(2, 10)}
    found = bodies({7: one, 9: two})
    assert {person: body.timing.present.tolist() for person, body in found.items()} == {
        7: [False] * 5 + [True, True, False, True, True],
        9: [True, True] + [False] * 8,
    }
    assert [body.shape.shape for body in found.values()] == [(1, 10), (2, 10)]


def test_single_frames_are_sorted_by_their_numbers():
    frames = [
        {"rotmat": TURNED[row], "trans": PLACES[row], "frame_ids": np.array([number])}
        for row, number in ((0, 7), (1, 5))
    ]
    (body,) = bodies(frames).values()
    assert (body.timing.first_frame, body.timing.rows.tolist()) == (5, [0, -1, 1])
    assert_allclose(body.translations, PLACES[[1, 0]], atol=1e-12)


def test_distant_places_of_single_frames_are_refused():
    far = np.array([1e30, 0.0, 0.0])
    given = [{"pose": VECTORS[row].ravel(), "trans": far, "frame": row} for row in range(2)]
    with pytest.raises(FormatError) as caught:
        bodies(given)
    assert caught.value.diagnostic.key == "F003.frames-lost"
    assert caught.value.diagnostic.values["problem"].key == "F003.motion-reach"


@pytest.mark.parametrize("key", ["", "track_id", "id"])
def test_single_frames_of_two_people_are_read(key):
    # Person 4 is in frames 5 and 6, person 9 in frames 5 and 7; records are in the order of frames.
    listed = [(5, 4), (5, 9), (6, 4), (7, 9)]
    frames = [
        {"rotmat": TURNED[row], "trans": PLACES[row], "frame": number}
        | ({key: np.array(person)} if key else {})
        for row, (number, person) in enumerate(listed)
    ]
    found = bodies(frames)
    if key:
        assert {person: body.timing.rows.tolist() for person, body in found.items()} == {
            4: [0, 1, -1],
            9: [0, -1, 1],
        }
        assert_allclose(found[9].translations, PLACES[[1, 3]], atol=1e-12)
    else:  # the second person of frame 5 is not in other frames
        assert sorted(found) == [0, 1]
        assert_allclose(found[0].translations, PLACES[[0, 2, 3]], atol=1e-12)
        assert_allclose(found[1].translations, PLACES[[1]], atol=1e-12)
        opened = source(frames)
        open_results(opened)
        assert "F007.video-repeated" in [note.key for note in opened.diagnostics.warnings]


@pytest.mark.parametrize("key", ["", "track_ids"])
@pytest.mark.parametrize("form", ["frame_ids", "detection_all"])
def test_rows_of_the_same_frame_are_different_people(form, key):
    # Person 4 is in frames 5 and 6, person 9 in frames 5 and 7.
    frames, persons = np.array([5, 5, 6, 7]), np.array([4, 9, 4, 9])
    numbers = frames if form == "frame_ids" else np.stack([frames, frames + 0.5], axis=1)
    given = {"pose": TURNED, "trans": PLACES, "betas": waves(4, 10), form: numbers}
    opened = source(given | ({key: persons} if key else {}))
    found = next(iter(open_results(opened).parts())).bodies
    rows = {4: [0, 1, -1], 9: [0, -1, 1]} if key else {0: [0, 1, 2], 1: [0, -1, -1]}
    assert {person: body.timing.rows.tolist() for person, body in found.items()} == rows
    chosen = {4: [0, 2], 9: [1, 3]} if key else {0: [0, 2, 3], 1: [1]}
    for person, body in found.items():
        assert_allclose(body.translations, PLACES[chosen[person]], atol=1e-12)
        assert_allclose(body.shape, waves(4, 10)[chosen[person]], atol=1e-12)
    repeated = [note.key for note in opened.diagnostics.warnings].count("F007.video-repeated")
    assert repeated == (0 if key else 1)


def test_rows_that_repeat_a_person_in_a_frame_are_reported():
    frames, persons = np.array([5, 5, 6, 5]), np.array([4, 9, 4, 4])
    opened = source({"pose": TURNED, "trans": PLACES, "frame_ids": frames, "track_ids": persons})
    found = next(iter(open_results(opened).parts())).bodies
    assert_allclose(found[4].translations, PLACES[[0, 2]], atol=1e-12)
    notes = [note for note in opened.diagnostics.warnings if note.key == "F007.video-same-frame"]
    assert [note.values for note in notes] == [{"n": 1}]


@pytest.mark.parametrize(
    "changes", [{"rotmat": TURNED[:1, :22]}, {"betas": np.zeros(5)}], ids=["joints", "shape"]
)
def test_inconsistent_single_frames_are_separate_people(changes):
    one = {"rotmat": TURNED[:1], "trans": PLACES[:1], "betas": np.zeros(10)}
    assert sorted(bodies([one, one | changes])) == [0, 1]


@pytest.mark.parametrize(
    ("keys", "numbers"),
    [(["1", "b"], [1, 2]), ([2, "b", "1"], [1, 2, 3]), (["\u00b2", "-4"], [0, 1])],
)
def test_people_without_numeric_keys_are_numbered(keys, numbers):
    one = {"rotmat": TURNED, "trans": PLACES}
    assert sorted(bodies(dict.fromkeys(keys, one))) == numbers


@pytest.mark.parametrize(
    ("count", "names"), [(22, "SMPL"), (24, "SMPL"), (52, "SMPL+H"), (55, "SMPL-X")]
)
def test_family_members_are_recognised(count, names):
    given = {"rotmat": np.tile(np.eye(3), (3, count, 1, 1)), "trans": np.zeros((3, 3))}
    assert open_results(source(given)).model == names


def test_recognised_and_ignored_keys_are_reported():
    opened = source({"rotmat": TURNED, "cam_t": PLACES, "verts": waves(4, 9, 3), "note": "x"})
    capture = open_results(opened)
    (found,) = [one for one in opened.diagnostics.warnings if one.key == "F007.video-parameters"]
    assert found.values == {
        "n": 1,
        "recognised": ["rotmat (matrices of 24 joints)", "cam_t"],
        "ignored": "verts, note",
    }
    assert dict(capture.facts) == {
        "capture": "SMPL parameters: 1 person, in camera space",
        "recognised": "rotmat (matrices of 24 joints), cam_t",
        "not needed": "note, verts",
    }


def test_people_with_the_keys_of_wham_but_one_shape_are_not_in_camera_space():
    one = {"pose": VECTORS.reshape(4, 72), "trans": PLACES, "betas": waves(10),
           "frame_ids": np.arange(4)}  # fmt: skip
    capture = open_results(source({3: one}))
    assert (capture.up, capture.facts[0][1]) == ("", "SMPL parameters: 1 person, in world space")
    assert next(iter(capture.parts())).bodies[3].shape.shape == (1, 10)


@pytest.mark.parametrize(
    ("key", "value", "rate"),
    [("fps", 24, 24.0), ("frame_rate", np.array(60.0), 60.0), ("fps", -1.0, 30.0)],
)
def test_frame_rate_is_found_under_the_usual_keys(key, value, rate):
    (body,) = bodies({"rotmat": TURNED, "trans": PLACES, key: value}).values()
    assert body.timing.frame_rate == rate


def test_parameters_of_smplcodec_are_read():
    given = {
        "codecVersion": np.array(2), "frameRate": np.array(24.0), "shapeParameters": waves(10),
        "bodyTranslation": PLACES, "bodyPose": VECTORS[:, :22],
    }  # fmt: skip
    ((_, body),) = next(iter(open_results(Source("a.smpl", npz(**given))).parts())).bodies.items()
    assert_allclose(body.vectors, VECTORS[:, :22], atol=1e-12)
    assert_allclose(body.translations, PLACES, atol=1e-12)
    assert (body.timing.frame_rate, body.shape.shape) == (24.0, (1, 10))


def test_missing_translations_are_reported_in_a_note():
    opened = source({"rotmat": TURNED})
    open_results(opened)
    assert "F007.motion-place" in [one.key for one in opened.diagnostics.warnings]


@pytest.mark.parametrize(
    ("given", "kind"),
    [
        ({"poses": VECTORS.reshape(4, 72), "trans": PLACES, "betas": waves(10)}, "amass"),
        ({"global_orient": VECTORS[:, 0], "body_pose": VECTORS[:, 1:].reshape(4, 69)}, "amass"),
        ({"pose": VECTORS[0].ravel(), "betas": waves(10)}, "pose"),
        ({"poses": TURNED, "trans": PLACES}, "video_mocap"),
        ({"poses": VECTORS.reshape(4, 72), "cam_t": PLACES}, "video_mocap"),
    ],
)
def test_layouts_of_amass_are_left_to_its_reader(given, kind):
    assert detect(Source("a.npz", npz(**given))) == kind
    single = {key: np.asarray(value, dtype=np.float32) for key, value in given.items()}
    assert detect(Source("a.pt", torch_zip(single))) == kind


@pytest.mark.parametrize(
    "given",
    [
        {"rotmat": np.zeros((4, 23, 3, 3))},
        {"global_orient": VECTORS[:3, 0], "body_pose": VECTORS[:, 1:]},
        {"body_pose": TURNED[:, 1:]},
        {"a": {"b": {"c": {"d": {"rotmat": TURNED}}}}},
        {"rotmat": "x"},
    ],
)
def test_other_dicts_are_not_recognised(given):
    from viewer.formats._archive.checking import archive_of
    from viewer.formats.video_mocap.tools import tool_of

    assert tool_of(archive_of(source(given))) is None
