"""People and frames of SMPL parameters, in every container in which they are found.

Every body is at x = frame, y = person, so its place tells where it belongs.
"""

import json
import pickle
from typing import Any

import numpy as np
import pytest
from formats.archive.joblib_bytes import joblib_file
from formats.capture_files import waves
from formats.npz_bytes import npz

from viewer.errors import FormatError
from viewer.formats import Source, detect
from viewer.formats.video_mocap import read as open_results

Presence = dict[int, list[int]]


def body(frame: int, person: int, /, **more: Any) -> dict[str, Any]:
    """Return the parameters of a person in one frame."""
    pose = waves(72, seed=10.0 * person + frame)
    return {"pose": pose, "trans": np.array([frame, person, 3.0]), **more}


def stacked(rows: list[tuple[int, int]], /, **more: Any) -> dict[str, Any]:
    """Return the parameters of rows, each of a frame and person."""
    bodies = [body(*row) for row in rows]
    return {key: np.array([one[key] for one in bodies]) for key in ("pose", "trans")} | more


def found_in(source: Source) -> tuple[Presence, int, int, float]:
    """Return the frames of each person, first frame, number of frames, and rate.

    Frames and people are checked against the places of the bodies, except a constant offset.
    """
    assert detect(source) == "video_mocap"
    capture = open_results(source)
    people: Presence = {}
    rate = 0.0
    for number, motion in next(iter(capture.parts())).bodies.items():
        rows, rate = motion.timing.rows, motion.timing.frame_rate
        people[number] = (np.flatnonzero(rows >= 0) + capture.first_frame).tolist()
        places = motion.translations[rows[rows >= 0]]
        assert len(set((places[:, 0] - people[number]).tolist())) == 1
        assert len(set(places[:, 1].tolist())) == 1
    return people, capture.first_frame, capture.n_frames, rate


def plain(value: Any) -> Any:
    """Return arrays as lists."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [*map(plain, value)]
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


TWO = [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)]
BOTH: Presence = {0: [0, 1, 2], 1: [0, 1, 2]}
IDS, NUMBERS = np.array([4, 9] * 3), np.array([1000, 1000, 1001, 1001, 1002, 1002])
LATE: Presence = {4: [1000, 1001, 1002], 9: [1000, 1001, 1002]}
SMPL = {"smpl": stacked(TWO)}
ALONE = [(frame, 0) for frame in range(3)]

CASES: dict[str, tuple[Any, Presence]] = {
    # Keys beside the parameters
    "ids and frames in the same dict": (stacked(TWO, track_id=IDS, frame_id=NUMBERS), LATE),
    "ids and frames around": ({**SMPL, "track_id": IDS, "frame_id": NUMBERS}, LATE),
    "ids and frames two levels above": ({"a": {**SMPL, "fps": 30}, "person_ids": IDS,
                                         "frames": NUMBERS}, LATE),
    "frames around, ids inside": ({"smpl": stacked(TWO, track_id=IDS), "frame_id": NUMBERS}, LATE),
    "frames around without ids": ({**SMPL, "frame_id": NUMBERS},
                                  {0: LATE[4], 1: LATE[9]}),
    "ids around without frames": ({**SMPL, "track_id": IDS}, {4: [0, 1, 2], 9: [0, 1, 2]}),
    "ids as a list of numpy numbers": ({**SMPL, "track_id": [*IDS], "frame_id": [*NUMBERS]}, LATE),
    "ids as floats": ({**SMPL, "track_id": IDS * 1.0, "frame_id": NUMBERS * 1.0}, LATE),
    "ids as text": ({**SMPL, "track_id": IDS.astype(str), "frame_id": NUMBERS}, LATE),
    "people with names": ({**SMPL, "person": ["bob", "amy"] * 3, "frame": NUMBERS},
                          {0: LATE[4], 1: LATE[9]}),
    "one id for all rows": ({"track_id": 7, "smpl": stacked(ALONE), "x": 1}, {7: [0, 1, 2]}),
    "place around": ({"track_id": 3, "p": {"rotmat": np.tile(np.eye(3), (3, 24, 1, 1))},
                      "cam_t": stacked(ALONE)["trans"]}, {3: [0, 1, 2]}),
    # Dicts of people
    "people by number": ({7: stacked(ALONE), 9: stacked([(0, 1)])}, {7: [0, 1, 2], 9: [0]}),
    "people by numbers as text": ({"7": stacked(ALONE), "9": stacked([(0, 1)])},
                                  {7: [0, 1, 2], 9: [0]}),
    "people by words": ({"person_7": stacked(ALONE), "person_9": stacked([(0, 1)])},
                        {7: [0, 1, 2], 9: [0]}),
    "people in a list, ids around": ({"people": [stacked(ALONE), stacked([(0, 1), (1, 1)])],
                                      "track_ids": [4, 9]}, {4: [0, 1, 2], 9: [0, 1]}),
    "people in parts": ([stacked(ALONE, track_id=3, frames=np.arange(3)),
                         stacked([(3, 0), (4, 0)], track_id=3, frames=np.arange(3, 5))],
                        {3: [0, 1, 2, 3, 4]}),
    # Lists of frames
    "frames": ([body(frame, 0) for frame in range(3)], {0: [0, 1, 2]}),
    "a frame is None": ([body(0, 0), None, body(2, 0)], {0: [0, 2]}),
    "a frame is empty": ([body(0, 0), {}, body(2, 0)], {0: [0, 2]}),
    "the first and last frame are None": ([None, body(1, 0), None], {0: [1]}),
    "a frame without poses": ([body(0, 0), {"error": 1}, body(2, 0)], {0: [0, 2]}),
    "frames in a dict": ({"fps": 25, "frames": [body(0, 0), None, body(2, 0)]}, {0: [0, 2]}),
    "frames by number": ({0: body(0, 0), 3: body(3, 0)}, {0: [0, 3]}),
    "frames by file name": ({"a/0005.jpg": body(5, 0), "a/0007.jpg": body(7, 0)}, {0: [5, 7]}),
    "a frame of a dict is None": ({"f0": body(0, 0), "f1": None, "f2": body(2, 0)}, {0: [0, 2]}),
    "frame numbers in the dicts": ([body(1000, 0, frame=1000), body(1002, 0, frame=1002)],
                                   {0: [1000, 1002]}),
    "frame numbers beside the list": ({"frames": [1000, 1002], "results": [body(1000, 0),
                                       body(1002, 0)]}, {0: [1000, 1002]}),
    "lists of people": ([[body(0, 0), body(0, 1)], [], [body(2, 0)]], {0: [0, 2], 1: [0]}),
    "a list of people is None": ([[body(0, 0)], None, [body(2, 0)]], {0: [0, 2]}),
    "the first person is None": ([[body(0, 0), body(0, 1)], [None, body(1, 1)], []],
                                 {0: [0], 1: [0, 1]}),
    "lists of people with ids": ([[body(0, 0, id=4), body(0, 1, id=9)], [body(1, 1, id=9)], []],
                                 {4: [0], 9: [0, 1]}),
    "ids deeper": ([{"people": [{"id": 9, "smpl": body(0, 1)}]},
                    {"people": [{"id": 4, "smpl": body(1, 0)}, {"id": 9, "smpl": body(1, 1)}]}],
                   {4: [1], 9: [0, 1]}),
    "frames of each person": ({7: [body(frame, 0) for frame in range(3)],
                               9: [body(frame, 1) for frame in range(2)]},
                              {7: [0, 1, 2], 9: [0, 1]}),
    "frames of one person": ({7: [body(0, 0), None, body(2, 0)]}, {7: [0, 2]}),
    "people of each file": ({"0005.jpg": {1: body(5, 0), 2: body(5, 1)}, "0007.jpg":
                             {2: body(7, 1)}}, {1: [5], 2: [5, 7]}),
    # Frames with several rows
    "rows with ids": ([stacked([(0, 0), (0, 1)], track_ids=np.array([4, 9])),
                       stacked([(1, 1)], track_ids=np.array([9])), {},
                       stacked([(3, 1), (3, 0)], track_ids=np.array([9, 4]))],
                      {4: [0, 3], 9: [0, 1, 3]}),
    "a frame of no rows": ([stacked([(0, 0), (0, 1)], track_ids=np.array([4, 9])),
                            {"pose": np.zeros((0, 72)), "trans": np.zeros((0, 3)),
                             "track_ids": np.zeros(0)},
                            stacked([(2, 1)], track_ids=np.array([9]))], {4: [0], 9: [0, 2]}),
    "rows with a frame number": ([stacked([(5, 0), (5, 1)], frame=5), stacked([(8, 0)], frame=8)],
                                 {0: [5, 8], 1: [5]}),
    "rows of a longer list": ([stacked([(0, 0), (0, 1)]), stacked([(1, 0)]), stacked([(2, 0)])],
                              {0: [0, 1, 2], 1: [0]}),
    "detections without a track": ([body(0, 0, id=-1), body(1, 1, id=5), body(2, 1, id=5)],
                                   {-1: [0], 5: [1, 2]}),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("container", ["pickle", "json"])
def test_people_keep_their_frames(name, container):
    given, wanted = CASES[name]
    if container == "json":
        source = Source("a.json", json.dumps(plain(given)).encode())
    else:
        source = Source("a.pkl", joblib_file(given))
    assert found_in(source)[0] == wanted


def test_flat_arrays_have_people():
    source = Source("a.npz", npz(**stacked(TWO, track_id=IDS)))
    assert found_in(source)[0] == {4: [0, 1, 2], 9: [0, 1, 2]}


def test_frames_at_the_ends_of_a_list_count():
    source = Source("a.pkl", joblib_file([None, body(1, 0), {}, body(3, 0), []]))
    assert found_in(source)[:3] == ({0: [1, 3]}, 0, 5)
    (note,) = [n.message for n in source.diagnostics.warnings if n.key == "F007.frames-empty"]
    assert note == "3 frames without people: frame 0, frame 2, frame 4"


def test_a_list_of_missing_arrays_is_a_list_of_frames():
    given = {"pose": [body(0, 0)["pose"], None, body(2, 0)["pose"]],
             "cam_t": [body(0, 0)["trans"], [], body(2, 0)["trans"]]}  # fmt: skip
    assert found_in(Source("a.pkl", joblib_file(given)))[0] == {0: [0, 2]}


@pytest.mark.parametrize("key", ["fps", "frame_rate", "frameRate", "framerate", "mocap_framerate",
                                 "mocap_frame_rate"])  # fmt: skip
@pytest.mark.parametrize("value", [25, np.float32(25), np.array([25.0]), "25"])
def test_frame_rates_are_found_around_the_parameters(key, value):
    given = {"info": {"smpl": stacked(ALONE)}, key: value}
    assert found_in(Source("a.pkl", joblib_file(given)))[3] == 25.0


@pytest.mark.parametrize(("rate", "found"), [(0.0, "0"), ("fast", "'fast'"), (float("nan"), "nan")])
def test_other_frame_rates_are_reported(rate, found):
    source = Source("a.pkl", joblib_file({"smpl": stacked(ALONE), "fps": rate}))
    assert found_in(source)[3] == 30.0
    (note,) = [n.message for n in source.diagnostics.warnings if n.key == "F007.rate-ignored"]
    assert note == f"fps: expected 1e-06 to 1,000,000 frames per second, found {found}: ignored"


def test_people_without_numbers_or_names_are_refused():
    given = {**SMPL, "track_id": [0.5] * 6, "frame_id": NUMBERS}
    with pytest.raises(FormatError, match=r"track_id: expected a number or a name .* found 0.5"):
        open_results(Source("a.pkl", joblib_file(given)))


def per_frame(rows: list[list[tuple[int, int]]], /, **more: Any) -> dict[str, Any]:
    """Return a list for each key, with the rows of one frame in each item."""
    frames = [[body(*row) for row in frame] for frame in rows]
    sizes = {"pose": 72, "trans": 3}
    return {
        key: [np.array([one[key] for one in frame]).reshape(-1, size) for frame in frames]
        for key, size in sizes.items()
    } | more


TWO_THEN_ONE = [[(0, 4), (0, 7)], [(1, 7), (1, 4)], [], [(3, 7)]]
OF_FRAMES = [[4, 7], [7, 4], [], [7]]
OF_PEOPLE = {4: [0, 1], 7: [0, 1, 3]}


@pytest.mark.parametrize("key", ["track_ids", "person_ids"])
def test_lists_of_frames_have_as_many_rows_as_people(tmp_path, key):
    content = per_frame(TWO_THEN_ONE, **{key: OF_FRAMES, "fps": 25})
    for data in (pickle.dumps(content), json.dumps(plain(content)).encode()):
        suffix = ".json" if data.startswith(b"{") else ".pkl"
        source = Source(tmp_path / f"people{suffix}", data)
        assert found_in(source) == (OF_PEOPLE, 0, 4, 25.0)


def test_lists_of_frames_have_numbers_beside_them(tmp_path):
    content = per_frame(TWO_THEN_ONE, track_ids=OF_FRAMES, frame_ids=np.array([0, 1, 2, 3]) + 20)
    people, first, n_frames, _ = found_in(Source(tmp_path / "people.pkl", pickle.dumps(content)))
    assert people == {4: [20, 21], 7: [20, 21, 23]}
    assert (first, n_frames) == (20, 4)


def test_arrays_of_frames_and_people_are_rows_of_each_frame(tmp_path):
    content = per_frame(TWO_THEN_ONE[:2])
    stack = {key: np.stack(items) for key, items in content.items()}  # (2, 2, 72) and (2, 2, 3)
    ids = {"track_ids": np.array(OF_FRAMES[:2])}
    source = Source(tmp_path / "people.pkl", pickle.dumps(stack | ids))
    assert found_in(source)[0] == {4: [0, 1], 7: [0, 1]}


def test_arrays_of_objects_are_lists_of_frames(tmp_path):
    content = per_frame([TWO_THEN_ONE[0], TWO_THEN_ONE[3]], track_ids=[OF_FRAMES[0], OF_FRAMES[3]])
    arrays = {}
    for key, items in content.items():
        arrays[key] = np.empty(2, dtype=object)
        arrays[key][:] = items
    assert arrays["pose"][1].shape == (1, 72)
    # The second frame of the file is the fourth of the motion, so x is 3 in it.
    arrays["frame_ids"] = np.array([0, 3])
    source = Source(tmp_path / "people.npz", npz(**arrays))
    assert found_in(source)[0] == {4: [0], 7: [0, 3]}


def facts_of(given: Any) -> tuple[dict[int, str], set[str], set[float], list[str]]:
    """Return the genders of people, models, frame rates, and the keys of warnings."""
    found = []
    for source in (
        Source("a.pkl", joblib_file(given)),
        Source("a.json", json.dumps(plain(given)).encode()),
    ):
        motions = next(iter(open_results(source).parts())).bodies
        genders = {person: motion.shape_space.gender for person, motion in motions.items()}
        titles = {motion.shape_space.model for motion in motions.values()}
        rates = {motion.timing.frame_rate for motion in motions.values()}
        found.append((genders, titles, rates, [note.key for note in source.diagnostics]))
    assert found[0] == found[1]  # pickle and JSON
    return found[0]


MEN = {"a": stacked(ALONE), "b": stacked([(0, 1), (1, 1)])}
FACTS = {"gender": "F", "model_type": "smplx", "fps": 25.0}


@pytest.mark.parametrize(
    "given",
    [
        {**FACTS, "smpl": stacked(ALONE)},
        {**FACTS, "a": {"b": stacked(ALONE)}},
        {**FACTS, "frames": [body(frame, 0) for frame in range(3)]},
        {"meta": FACTS, "smpl": stacked(ALONE)},
        {"meta": FACTS, "people": [stacked(ALONE, id=0)]},
        {"a": {"info": FACTS, "smpl": stacked(ALONE)}, "other": {"gender": 1, "fps": [1, 2]}},
        stacked(ALONE, person_id=[0, 0, 0], gender=["F"] * 3, model="SMPL-X", frame_rate=25),
        {**FACTS, "smpl": {**stacked(ALONE), "x": {"gender": "male"}}},
    ],
)
def test_gender_model_and_rate_are_found_beside_the_parameters(given):
    genders, titles, rates, _ = facts_of(given)
    assert (genders, titles, rates) == ({0: "female"}, {"SMPL-X"}, {25.0})


@pytest.mark.parametrize(
    "given",
    [
        {"genders": ["m", "f"], "people": list(MEN.values())},
        {"genders": {"b": "female", "a": "male"}, "people": MEN},
        {key: {**man, "gender": said} for (key, man), said in zip(MEN.items(), "mf", strict=True)},
        {"a": {"gender": "m", "smpl": MEN["a"]}, "b": {"gender": "f", "smpl": MEN["b"]}},
        stacked(TWO, person_id=[0, 1] * 3, frame=[0, 0, 1, 1, 2, 2], gender=["m", "f"] * 3),
        [stacked(TWO[row : row + 2], person_id=[0, 1], gender=["m", "f"]) for row in (0, 2, 4)],
    ],
)
def test_each_person_has_its_gender(given):
    assert facts_of(given)[0] == {0: "male", 1: "female"}


def test_several_genders_of_one_person_are_reported():
    given = stacked(ALONE, person_id=[0, 0, 0], gender=["m", "f", "m"])
    genders, _, _, notes = facts_of(given)
    assert genders == {0: ""}
    assert notes.count("F007.motion-gender") == 1


def test_number_of_frames_is_not_a_frame_number():
    # As in InterHuman.
    given = {"frames": 3, "person1": stacked(ALONE), "person2": stacked([(f, 1) for f in range(3)])}
    found = found_in(Source("a.pkl", joblib_file(given)))
    assert found[:3] == ({1: [0, 1, 2], 2: [0, 1, 2]}, 0, 3)


def test_places_are_divided_by_the_scale_beside_them():
    given = {"smpl_scaling": np.array([2.0]), "smpl": stacked(ALONE)}
    source = Source("a.pkl", joblib_file(given))
    (motion,) = next(iter(open_results(source).parts())).bodies.values()
    np.testing.assert_allclose(motion.translations, [[0, 0, 1.5], [0.5, 0, 1.5], [1, 0, 1.5]])


def test_poses_under_the_keys_of_emdb_are_read():
    given = stacked(ALONE)
    poses = given.pop("pose")
    given |= {"poses_root": poses[:, :3], "poses_body": poses[:, 3:]}
    source = Source("a.pkl", joblib_file({"gender": "male", "smpl": given}))
    (motion,) = next(iter(open_results(source).parts())).bodies.values()
    np.testing.assert_array_equal(motion.vectors.reshape(3, 72), poses)


@pytest.mark.parametrize(
    ("face", "title"), [({}, "SMPL"), ({"jaw_pose": np.zeros((3, 3))}, "SMPL-X")]
)
def test_parameters_of_a_face_are_those_of_smplx(face, title):
    # As SMPLify-X stores them, with a camera.
    parts = {"global_orient": np.zeros((3, 3)), "body_pose": np.zeros((3, 63)), **face}
    given = {**parts, "betas": np.ones(10), "camera_translation": np.zeros((3, 3))}
    assert facts_of(given)[1] == {title}


def table_of(n_outer: int, n_inner: int, is_outer_frame: bool, **columns: Any) -> list[Any]:
    """Return lists of bodies; ``columns``: functions of frame and person."""
    found = []
    for outer in range(n_outer):
        found.append([])
        for inner in range(n_inner):
            frame, person = (outer, inner) if is_outer_frame else (inner, outer)
            more = {key: of(frame, person) for key, of in columns.items()}
            found[-1].append(body(frame, person, **more))
    return found


@pytest.mark.parametrize("is_outer_frame", [False, True])
@pytest.mark.parametrize("n_outer", [2, 3])
@pytest.mark.parametrize(
    "columns",
    [
        {"id": lambda frame, person: 10 + person},
        {"gender": lambda frame, person: ["female", "male", "neutral"][person]},
        {"betas": lambda frame, person: np.full(10, 0.5 * person)},
        # Shapes that the tool estimates in each frame
        {"betas": lambda frame, person: np.full(10, 0.5 * person + 0.01 * (frame + person))},
    ],
)
def test_axis_of_people_is_told_by_what_stays(columns, n_outer, is_outer_frame):
    given = table_of(n_outer, 5 - n_outer, is_outer_frame, **columns)
    source = Source("a.pkl", joblib_file(given))
    n_frames, n_people = (n_outer, 5 - n_outer) if is_outer_frame else (5 - n_outer, n_outer)
    first = 10 if "id" in columns else 0
    people = {first + person: [*range(n_frames)] for person in range(n_people)}
    assert found_in(source)[0] == people
    assert "F007.video-lists" not in [note.key for note in source.diagnostics]


def test_axis_of_people_is_told_by_ids_of_people_who_come_and_go():
    table = [[body(0, 0, id=4), body(0, 1, id=9), body(0, 2, id=7)],
             [body(1, 1, id=9), body(1, 2, id=7), body(1, 0, id=4)]]  # fmt: skip
    assert found_in(Source("a.pkl", joblib_file(table)))[0] == {4: [0, 1], 7: [0, 1], 9: [0, 1]}


@pytest.mark.parametrize(
    ("step", "people", "frames"), [(0.02, 3, 2), (1.0, 2, 3)], ids=["places", "the longer list"]
)
def test_axis_of_people_that_nothing_states_is_said(step, people, frames):
    # Two frames of three people who are a metre apart; steps as large tell nothing.
    given = table_of(2, 3, True)
    for row in given:
        for one in row:
            one["trans"] = one["trans"] * [step, 1.0, 1.0]
    source = Source("a.pkl", joblib_file(given))
    capture = open_results(source)
    assert (len(next(iter(capture.parts())).bodies), capture.n_frames) == (people, frames)
    (note,) = [note for note in source.diagnostics if note.key == "F007.video-lists"]
    assert note.values == {"people": people, "frames": frames}


@pytest.mark.parametrize(
    ("changes", "line", "item"),
    [
        ({"betas": [1.0, float("nan")]}, 6, "people.0.betas"),
        ({"track_id": [1, {}, 3]}, 6, "people.0.track_id"),
        ({"smpl_scaling": 0.0}, 6, "people.0.smpl_scaling"),
    ],
)
def test_errors_in_json_name_the_line(changes, line, item):
    members = {**plain(stacked(ALONE)), **changes}
    rows = ",\n".join(f"{json.dumps(key)}: {json.dumps(value)}" for key, value in members.items())
    text = '{"fps": 30,\n"people": [\n{\n' + rows + "\n}]}"
    with pytest.raises(FormatError) as caught:
        open_results(Source("a.json", text.encode()))
    assert caught.value.diagnostic is not None
    assert (caught.value.diagnostic.line, caught.value.diagnostic.values["item"]) == (line, item)


def arrays_of(n_people: int, n_frames: int, axis: int, **more: Any) -> dict[str, Any]:
    """Return arrays of all people and frames; ``axis``: that of the people."""
    people = [stacked([(frame, person) for frame in range(n_frames)]) for person in range(n_people)]
    return {key: np.stack([one[key] for one in people], axis) for key in people[0]} | more


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize(("n_people", "n_frames"), [(2, 3), (3, 2)])
@pytest.mark.parametrize("told", ["person_id", "genders", "betas", "frame_ids"])
def test_axis_of_people_in_arrays_is_told_by_other_values(told, n_people, n_frames, axis):
    values = {"person_id": np.arange(n_people), "genders": ["m", "f", "m"][:n_people],
              "betas": np.ones((n_people, 10)), "frame_ids": np.arange(n_frames)}  # fmt: skip
    given = arrays_of(n_people, n_frames, axis, **{told: values[told]})
    source = Source("a.pkl", joblib_file(given))
    assert found_in(source)[0] == {person: [*range(n_frames)] for person in range(n_people)}
    assert "F007.video-axes" not in [note.key for note in source.diagnostics]
    if told == "genders":
        assert facts_of(given)[0] == dict(enumerate(["male", "female", "male"][:n_people]))


def test_axis_of_people_in_arrays_that_nothing_states_is_said():
    source = Source("a.pkl", joblib_file(arrays_of(2, 3, 1)))
    assert found_in(source)[0] == {0: [0, 1, 2], 1: [0, 1, 2]}
    (note,) = [note for note in source.diagnostics if note.key == "F007.video-axes"]
    assert note.values == {"people": 2, "frames": 3}


def test_ids_of_each_person_and_frame_tell_the_axis_of_people():
    for axis in (0, 1):
        given = arrays_of(2, 3, axis)
        ids = np.stack([np.full(3, 4), np.full(3, 7)], axis)
        source = Source("a.pkl", joblib_file(given | {"track_ids": ids}))
        assert found_in(source)[0] == {4: [0, 1, 2], 7: [0, 1, 2]}
        assert "F007.video-axes" not in [note.key for note in source.diagnostics]


def test_one_shape_as_long_as_the_frames_is_that_of_all_people():
    source = Source("a.pkl", joblib_file(arrays_of(2, 10, 1, betas=np.ones(10))))
    assert found_in(source)[0] == {0: [*range(10)], 1: [*range(10)]}


def test_people_in_lists_of_arrays_are_read():
    # As in 3DPW, also if people have different numbers of frames.
    parts = [stacked(ALONE), stacked([(0, 1), (1, 1)])]
    given = {key: [part[key] for part in parts] for key in parts[0]} | {"genders": ["m", "f"]}
    assert found_in(Source("a.pkl", joblib_file(given)))[0] == {0: [0, 1, 2], 1: [0, 1]}
    assert facts_of(given)[0] == {0: "male", 1: "female"}
