"""EasyMocap folders: person ids, gaps, all pose layouts, keypoints, and the timeline."""

import json

import numpy as np
import pytest
from formats.capture_files import body, noticed, opened, points, rows_of, waves, write_frames
from numpy.testing import assert_array_equal

from viewer.diagnostics import Phrase
from viewer.formats import Source, detect, read
from viewer.formats.easymocap.bodies import hold, last_given
from viewer.phrases import one_of
from viewer.rigs.bodies.smpl_family import FAMILY
from viewer.rigs.captures.capture import Capture

BODY = FAMILY[24].names[:22]
FACE = ("jaw", "left_eye", "right_eye")


def only(parts, person=0):
    """Return the motion of a person who is in a single part."""
    found = [part.bodies[person] for part in parts if person in part.bodies]
    assert len(found) == 1
    return found[0]


# Frame folders


@pytest.mark.parametrize("name", ["smpl", "smpl_full", "smplfull", "keypoints3d"])
def test_folders_are_recognised_by_content(tmp_path, name):
    record = points(0) if name == "keypoints3d" else body(0)
    write_frames(tmp_path / "out" / name, {0: [record]})
    for path in (tmp_path / "out", tmp_path / "out" / name):
        source = Source.open(path)
        assert detect(source) == "easymocap"
        capture = read(source)
        assert isinstance(capture, Capture)
        assert (capture.name, capture.n_frames, source.warnings) == ("out", 1, [])


def test_any_folder_of_frames_is_read(tmp_path):
    folder = write_frames(tmp_path / "people", {0: [body(3)], 1: [body(3)]})
    capture, parts, warnings = opened(folder)
    assert (capture.name, capture.model, warnings) == ("people", "SMPL", [])
    assert rows_of(parts, 3) == [0, 1]


@pytest.mark.parametrize("content", [[body(0)], {"K": [1], "annots": [body(0)]}])
def test_single_frame_file_is_read(tmp_path, content):
    path = tmp_path / "000017.json"
    path.write_text(json.dumps(content))
    source = Source.open(path)
    assert detect(source) == "easymocap"
    capture = read(source)
    assert (capture.name, capture.n_frames, capture.first_frame) == ("000017", 1, 17)
    assert (list(next(capture.parts()).bodies), source.warnings) == ([0], [])


def test_json_poses_are_not_captures(tmp_path):
    path = tmp_path / "a.json"
    path.write_text('{"dofs": {"a.x": 1}}')
    source = Source.open(path)
    assert (detect(source), source.warnings) == ("pose", [])


def test_subfolder_with_the_most_frames_is_read(tmp_path):
    write_frames(tmp_path / "smpl", {0: [body(0)]})
    write_frames(tmp_path / "smpl_full", {0: [body(0, 156)]})
    capture, _, warnings = opened(tmp_path)
    assert capture.model == "SMPL+H"
    assert warnings == [("F007.capture-beside", None, {"name": "smpl_full", "others": "smpl"})]


def test_first_of_several_views_is_read(tmp_path):
    for view, person in (("02", 2), ("01", 1), ("03", 3)):
        write_frames(tmp_path / "smpl" / view, {0: [body(person)]})
    for path in (tmp_path, tmp_path / "smpl"):
        _, parts, warnings = opened(path)
        assert list(parts[0].bodies) == [1]
        assert warnings == [
            ("F007.capture-camera", None, {"folder": "smpl", "name": "01", "others": ["02", "03"]})
        ]


def test_images_and_hidden_files_are_ignored(tmp_path):
    folder = write_frames(tmp_path / "smpl", {0: [body(0)], "._000000": "junk"})
    (folder / "000000.jpg").write_bytes(b"picture")
    capture, parts, warnings = opened(tmp_path)
    assert (capture.n_frames, parts[0].warnings, warnings) == (1, (), [])


# The timeline


def test_gaps_in_frame_numbers_are_kept(tmp_path):
    frames = {12: [body(0)], 13: [], 15: [body(0), body(1)], 110: [body(1)]}
    write_frames(tmp_path / "smpl", frames)
    capture, parts, _ = opened(tmp_path, frame_rate=50.0)
    assert (capture.n_frames, capture.first_frame) == (99, 12)
    assert (rows_of(parts, 0), rows_of(parts, 1)) == ([0, 3], [3, 98])
    timing = parts[0].bodies[0].timing
    assert (timing.n_frames, timing.first_frame, timing.frame_rate) == (99, 12, 50.0)
    assert not timing.holds
    assert timing.locate(np.array([-1.0, 0.0, 0.02, 9.0]))[0].tolist() == [-1, 0, -1, -1]


@pytest.mark.parametrize("name", ["{}", "f{}", "cam01_{:04}", "take2_{}_smpl"])
def test_numbers_in_names_are_frame_numbers(tmp_path, name):
    frames = {name.format(frame): [body(frame)] for frame in (10, 9, 12)}
    capture, parts, warnings = opened(write_frames(tmp_path / "a", frames))
    assert (capture.first_frame, capture.n_frames, warnings) == (9, 4, [])
    assert [rows_of(parts, person) for person in (9, 10, 12)] == [[0], [1], [3]]


def test_names_without_numbers_are_sorted_by_text(tmp_path):
    write_frames(tmp_path / "a", {"b": [body(1)], "a": [body(0)]})
    capture, parts, _ = opened(tmp_path / "a")
    assert (rows_of(parts, 0), rows_of(parts, 1), capture.first_frame) == ([0], [1], 0)


@pytest.mark.parametrize("name", ["summary", "notes_2024", "2024_notes", "zz"])
def test_foreign_files_are_ignored(tmp_path, name):
    frames = {**{frame: [body(0)] for frame in range(3)}, name: {"a": 1}}
    capture, parts, warnings = opened(write_frames(tmp_path / "smpl", frames).parent)
    assert (capture.n_frames, rows_of(parts, 0)) == (3, [0, 1, 2])
    assert warnings == [("F007.capture-foreign", None, {"names": [f"{name}.json"]})]
    assert noticed(parts) == []


def test_foreign_file_beside_a_single_frame_is_ignored(tmp_path):
    write_frames(tmp_path / "smpl", {0: [body(0)], "summary": {"a": 1}})
    assert opened(tmp_path)[0].n_frames == 1


def test_ids_may_be_numbers_as_text(tmp_path):
    write_frames(
        tmp_path / "smpl", {0: [body(0, id="7"), body(0, id="-1")], 1: [body(0, id=" 07")]}
    )
    _, parts, _ = opened(tmp_path)
    assert (rows_of(parts, 7), rows_of(parts, -1)) == ([0, 1], [0])


def test_people_with_names_are_numbered(tmp_path):
    frames = {
        0: [body(0, id="amy")],
        1: [body(0, id="bob"), body(0, id="amy")],
        2: [body(0, id=None, personID="bob")],
    }
    _, parts, _ = opened(write_frames(tmp_path / "smpl", frames).parent)
    assert (rows_of(parts, 0), rows_of(parts, 1)) == ([0, 1], [1, 2])
    assert ("F007.person-names", None, {"names": ["0: amy", "1: bob"]}) in noticed(parts)


def test_number_of_a_person_with_a_name_is_not_used_again(tmp_path):
    write_frames(
        tmp_path / "smpl", {0: [body(0, id="amy"), body(0), body(1)], 1: [body(0, id="bob")]}
    )
    _, parts, _ = opened(tmp_path)
    assert [rows_of(parts, person) for person in (0, 1, 2)] == [[0], [0], [1]]
    assert "F007.record" in [key for key, _, _ in noticed(parts)]


def test_ids_that_are_null_are_missing(tmp_path):
    record = {**body(0), "id": None}
    _, parts, _ = opened(write_frames(tmp_path / "smpl", {0: [record]}).parent)
    assert (rows_of(parts, 0), [key for key, _, _ in noticed(parts)]) == (
        [0],
        ["F007.record-no-id"],
    )


def test_a_single_person_may_lack_the_list(tmp_path):
    write_frames(tmp_path / "smpl", {0: body(4), 1: body(4)})
    _, parts, _ = opened(tmp_path)
    assert rows_of(parts, 4) == [0, 1]


def test_huge_gaps_are_collapsed(tmp_path):
    write_frames(tmp_path / "smpl", {"7": [body(0)], "99999999999": [body(0)]})
    capture, parts, warnings = opened(tmp_path)
    assert (capture.n_frames, capture.first_frame, rows_of(parts, 0)) == (2, 0, [0, 1])
    assert warnings == [("F007.capture-numbers", None, {"n": 2, "first": 7, "last": 99999999999})]


def test_gap_of_a_thousand_frames_is_kept(tmp_path):
    write_frames(tmp_path / "smpl", {0: [body(0)], 1019: [body(0)]})
    assert opened(tmp_path)[0].n_frames == 1020
    write_frames(tmp_path / "far", {0: [body(0)], 1020: [body(0)]})
    assert opened(tmp_path / "far")[0].n_frames == 2


def test_bodies_and_keypoints_share_the_timeline(tmp_path):
    write_frames(tmp_path / "smpl", {3: [body(0)], 4: [body(0)]})
    write_frames(tmp_path / "keypoints3d", {1: [points(0)], 4: [points(0), points(5)]})
    capture, parts, _ = opened(tmp_path)
    assert (capture.n_frames, capture.first_frame) == (4, 1)
    assert rows_of(parts, 0) == [2, 3]
    seen = [np.flatnonzero(part.points[0][1].timing.present).tolist() for part in parts]
    assert seen == [[0], [3]]
    assert [list(part.points) for part in parts] == [[0], [0, 5]]


def test_part_sizes_grow_and_the_first_part_includes_a_person(tmp_path):
    frames = {0: [], 1: [], 2: [body(0)], **{frame: [body(0)] for frame in range(3, 400)}}
    write_frames(tmp_path / "smpl", frames)
    capture, parts, _ = opened(tmp_path)
    assert [part.stop for part in parts] == [3, 67, 323, 400]
    assert [part.bodies[0].n_rows for part in parts] == [1, 64, 256, 77]
    assert all(part.bodies[0].timing.n_frames == 400 for part in parts)
    assert rows_of(parts, 0) == list(range(2, 400))
    # This reads the files again.
    assert [part.stop for part in capture.parts()] == [3, 67, 323, 400]


# People


def test_untracked_people_are_distinguished_within_a_frame(tmp_path):
    people = [body(-1), body(0), body(-1, seed=1.0), body(-1)]
    folder = write_frames(tmp_path / "smpl", {0: people})
    _, parts, _ = opened(tmp_path)
    assert list(parts[0].bodies) == [-1, 0, -2, -3]
    assert noticed(parts[:1], folder / "000000.json") == [("F007.record-untracked", None, {})]
    assert_array_equal(parts[0].bodies[-2].translations[0], waves(3, seed=3.0))


def test_older_files_use_person_id(tmp_path):
    record = points(0) | {"personID": 4}
    del record["id"]
    write_frames(tmp_path / "keypoints3d", {0: [record]})
    assert list(opened(tmp_path)[1][0].points) == [4]


def test_people_without_id_are_counted(tmp_path):
    folder = write_frames(tmp_path / "smpl", {0: [body(0, id=None), body(0, id=None)]})
    _, parts, _ = opened(tmp_path)
    assert list(parts[0].bodies) == [0, 1]
    assert noticed(parts[:1], folder / "000000.json") == [("F007.record-no-id", None, {})]


# Layouts of poses


def turned(record, start, stop):
    return np.reshape(np.ravel(record["poses"])[start:stop], (-1, 3))


@pytest.mark.parametrize("flat", [False, True])
@pytest.mark.parametrize(
    ("count", "model", "names", "parts", "hands", "is_flat"),
    [
        (72, "SMPL", FAMILY[24].names, [(3, 72)], {}, True),
        (69, "SMPL", FAMILY[24].names, [(0, 69)], {}, True),
        (78, "SMPL+H", BODY, [(3, 66)], {"left": (66, 72), "right": (72, 78)}, False),
        (156, "SMPL+H", FAMILY[52].names, [(3, 156)], {}, True),
        (
            87,
            "SMPL-X",
            (*BODY, *FACE),
            [(3, 66), (78, 87)],
            {"left": (66, 72), "right": (72, 78)},
            True,
        ),
        (165, "SMPL-X", FAMILY[55].names, [(3, 165)], {}, True),
        (9, "MANO", ("wrist",), [], {"": (3, 9)}, True),
        (48, "MANO", FAMILY[16].names, [(3, 48)], {}, True),
    ],
)
def test_number_of_values_determines_the_pose_layout(
    tmp_path, count, model, names, parts, hands, is_flat, flat
):
    record = body(0, count, flat=flat)
    write_frames(tmp_path / "smpl", {0: [record], 1: [record]})
    capture, found, _ = opened(tmp_path)
    motion = found[0].bodies[0]
    assert (capture.model, motion.joint_names) == (model, names)
    assert (motion.about_origin, motion.world_rotations, motion.flat_hands) == (True, None, is_flat)
    vectors = np.concatenate([waves(1, 3, seed=1), *(turned(record, *part) for part in parts)])
    assert_array_equal(motion.vectors, [vectors])
    assert_array_equal(motion.translations, [waves(3, seed=2)])
    assert_array_equal(motion.shape, [waves(10, seed=3)])
    assert motion.hands.keys() == hands.keys()
    for side, (start, stop) in hands.items():
        assert_array_equal(motion.hands[side], [np.ravel(record["poses"])[start:stop]])


def test_hands_of_newer_smplh_files_have_separate_keys(tmp_path):
    hands = {"handl": [waves(12).tolist()], "handr": [waves(12, seed=1).tolist()]}
    write_frames(tmp_path / "smpl", {0: [body(0, 63, **hands)]})
    motion = only(opened(tmp_path)[1])
    assert motion.joint_names == BODY
    assert_array_equal(motion.vectors[0, 1:], waves(63).reshape(-1, 3))
    assert_array_equal(motion.hands["left"], [waves(12)])
    assert_array_equal(motion.hands["right"], [waves(12, seed=1)])
    assert not motion.flat_hands
    assert only(opened(tmp_path, flat_hands=True)[1]).flat_hands


def test_hand_keys_next_to_full_poses_are_ignored(tmp_path):
    write_frames(tmp_path / "smpl_full", {0: [body(0, 156, handl=[[1] * 6], handr=[[1] * 6])]})
    assert only(opened(tmp_path)[1]).hands == {}


def test_root_rotation_in_poses_is_applied_after_rh(tmp_path):
    poses = waves(72)  # the first three values are not 0
    write_frames(tmp_path / "smpl", {0: [body(0, poses=[poses.tolist()])]})
    motion = only(opened(tmp_path)[1])
    assert not motion.about_origin
    assert_array_equal(motion.world_rotations, [waves(3, seed=1)])
    assert_array_equal(motion.vectors, [poses.reshape(-1, 3)])


def test_shape_is_stored_per_frame_only_if_it_varies(tmp_path):
    same = {frame: [body(0), body(1, shapes=[[frame] * 10])] for frame in range(3)}
    write_frames(tmp_path / "smpl", {**same, 3: [body(0), body(1)]})
    part = opened(tmp_path)[1][1]
    assert (part.bodies[0].shape.shape, part.bodies[1].shape.shape) == ((1, 10), (3, 10))


def test_expression_is_read_and_drives_shapes(tmp_path):
    expression = {"expression": [waves(10, seed=5).tolist()]}
    write_frames(tmp_path / "smpl", {0: [body(0, 87, **expression)]})
    motion = only(opened(tmp_path)[1])
    assert_array_equal(motion.expression, [waves(10, seed=5)])
    legacy = only(opened(tmp_path, legacy_expression=True)[1])
    assert legacy.expression is None
    assert_array_equal(legacy.shape, [[*waves(10, seed=3), *waves(10, seed=5)]])


def test_vertices_are_ignored_with_one_note(tmp_path):
    record = body(0, vertices=[[0, 0, 0]] * 4)
    folder = write_frames(tmp_path / "smpl", {0: [record], 1: [record]})
    _, parts, _ = opened(tmp_path)
    said = [("F007.record-vertices", None, {})]
    assert noticed(parts[:1], folder / "000000.json") == said and noticed(parts[1:]) == []


def test_requested_up_axis_is_used(tmp_path):
    write_frames(tmp_path / "smpl", {0: [body(0)]})
    assert (opened(tmp_path)[0].up, opened(tmp_path, up="-y")[0].up) == ("", "-y")


# Keypoints


def test_keypoints_have_their_confidence(tmp_path):
    record = points(0)
    record["keypoints3d"][4] = [0, 0, 0, 0]
    write_frames(tmp_path / "keypoints3d", {0: [record]})
    capture, parts, _ = opened(tmp_path)
    layout, clip = parts[0].points[0]
    assert (capture.model, layout.title, clip.timing.holds) == ("", "body25", False)
    assert_array_equal(clip.points, [record["keypoints3d"]])


def test_points_without_confidence_are_visible(tmp_path):
    write_frames(tmp_path / "keypoints3d", {0: [points(0, columns=3)]})
    clip = opened(tmp_path)[1][0].points[0][1]
    assert_array_equal(clip.points[0, :, :3], waves(25, 3))
    assert_array_equal(clip.points[0, :, 3], np.ones(25))


def test_layout_of_17_keypoints_can_be_chosen(tmp_path):
    write_frames(tmp_path / "keypoints3d", {0: [points(0, 17)]})
    assert opened(tmp_path)[1][0].points[0][0].title == "coco"
    assert opened(tmp_path, layout="h36m")[1][0].points[0][0].title == "h36m"


def test_hands_and_face_next_to_the_body_are_read_as_points(tmp_path):
    rows = {key: waves(count, 4, seed=count) for key, count in
            (("handl3d", 21), ("handr3d", 21), ("face3d", 70))}  # fmt: skip
    for values in rows.values():
        values[:, 3] = 1.0
    record = points(0, **{key: values.tolist() for key, values in rows.items()})
    write_frames(tmp_path / "keypoints3d", {0: [record]})
    layout, clip = opened(tmp_path)[1][0].points[0]
    assert layout.title == "total"
    assert_array_equal(clip.points[0], np.concatenate([record["keypoints3d"], *rows.values()]))


def test_single_hand_is_joined_to_a_coco_body(tmp_path):
    record = points(0, 17, handr3d=points(0, 21)["keypoints3d"])
    write_frames(tmp_path / "keypoints3d", {0: [record]})
    layout, clip = opened(tmp_path)[1][0].points[0]
    assert (layout.title, len(layout.names), clip.points.shape) == (
        "coco + handr3d",
        38,
        (1, 38, 4),
    )
    assert layout.names[17:19] == ("right_hand_wrist", "right_thumb1")
    # The hand is attached to the right wrist of the body, COCO keypoint 10.
    assert [10, 18] in layout.limbs.tolist()


def test_duplicate_keypoints_are_ignored_with_a_note(tmp_path):
    folder = write_frames(tmp_path / "smpl", {0: [body(0) | points(0, seed=1.0)]})
    write_frames(tmp_path / "keypoints3d", {0: [points(0)]})
    _, parts, _ = opened(tmp_path)
    assert_array_equal(parts[0].points[0][1].points, [points(0)["keypoints3d"]])
    assert noticed(parts[:1], folder / "000000.json") == [("F007.record-points", None, {})]


def test_keypoints_in_body_records_are_read(tmp_path):
    record = body(0) | points(0)
    write_frames(tmp_path / "smpl", {0: [record]})
    _, parts, _ = opened(tmp_path)
    assert (list(parts[0].bodies), list(parts[0].points)) == ([0], [0])


# The synthetic recording


def test_synthetic_recording_has_the_published_people(shared_data):
    folder = shared_data / "smpl_synthetic" / "easymocap"
    if not folder.is_dir():
        pytest.skip("no synthetic recording")
    capture, parts, warnings = opened(folder)
    assert (capture.n_frames, capture.model, warnings) == (30, "SMPL", [])
    assert noticed(parts) == []
    assert (rows_of(parts, 0), rows_of(parts, 1)) == (list(range(30)), list(range(20)))
    record = json.loads((folder / "smpl" / "000007.json").read_text())[1]
    motion = parts[1].bodies[1]
    row = motion.timing.rows[7]
    assert_array_equal(motion.vectors[row, 0], record["Rh"][0])
    assert_array_equal(motion.vectors[row, 1:].ravel(), record["poses"][0][3:])


INFINITE = json.loads("1e400")


def fault_in(parts, path):
    """Return the line and text of the only error."""
    ((key, line, values),) = noticed(parts, path)
    assert key == "F007.record"
    return line, values["problem"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"shapes": [[], []]}, ("F002.record", None, {"item": "person 0: shapes",
         "problem": "expected 2 numbers, found an empty list among them"})),
        ({"shapes": [[None]]}, ("F002.record", None, {"item": "person 0: shapes",
         "problem": "expected 1 number, found None among them"})),
        ({"shapes": [[INFINITE]]}, ("F003.record", None, {"item": "person 0: shapes",
         "problem": "expected finite numbers, found inf"})),
        ({"shapes": "x"}, ("F002.record", None, {"item": "person 0: shapes",
         "problem": "expected numbers, found 'x'"})),
        ({"shapes": {}}, ("F002.record", None, {"item": "person 0: shapes",
         "problem": "expected numbers, found an empty dict"})),
        ({"expression": [["a"]]}, ("F002.record", None, {"item": "person 0: expression",
         "problem": "expected 1 number, found 'a' among them"})),
        ({"expression": [[INFINITE] * 3]}, ("F003.record", None, {"item": "person 0: expression",
         "problem": "expected finite numbers, found inf"})),
        ({"poses": [[None] * 69]}, ("F002.record", None, {"item": "person 0: poses",
         "problem": "expected 69 numbers, found None among them"})),
        ({"poses": [[INFINITE] * 165]}, ("F003.record", None, {"item": "person 0: poses",
         "problem": "expected finite numbers, found inf"})),
        ({"Th": [[1.0]], "shapes": [[1.0]]}, ("F002.record", None, {"item": "person 0: Th",
         "problem": "expected 3 numbers, found 1"})),
    ],
)  # fmt: skip
def test_number_of_values_is_that_of_valid_records(tmp_path, changes, message):
    others = {"expression": [[0.5] * 10]} if "expression" in changes else {}
    good = [body(0, **others), body(1, **others)]
    first = json.dumps([{**good[0], **changes}, good[1]], indent=1)
    (key, *_) = changes
    rows = [number for number, row in enumerate(first.splitlines(), 1) if f'"{key}":' in row]
    folder = write_frames(tmp_path / "smpl", {0: first, 1: good, 2: good})
    _, parts, _ = opened(tmp_path)
    assert (rows_of(parts, 0), rows_of(parts, 1)) == ([1, 2], [0, 1, 2])
    assert fault_in(parts, folder / "000000.json") == (rows[0], message)


@pytest.mark.parametrize("key", ["handl", "handr"])
def test_number_of_hand_values_is_that_of_valid_records(tmp_path, key):
    good = body(0, 63, handl=[[0.5] * 6], handr=[[0.5] * 6])
    folder = write_frames(tmp_path / "smpl", {0: [{**good, key: [[None]]}], 1: [good]})
    _, parts, _ = opened(tmp_path)
    assert rows_of(parts, 0) == [1]
    line, (_, _, values) = fault_in(parts, folder / "000000.json")
    problem = "expected 1 number, found None among them"
    assert (line, values) == (1, {"item": f"person 0: {key}", "problem": problem})


def test_later_invalid_coefficients_do_not_determine_their_number(tmp_path):
    bare, bad, good = body(0, shapes=None), body(0, shapes=[[None]]), body(0)
    folder = write_frames(tmp_path / "smpl", {0: [bare], 1: [bad], 2: [good], 3: [good]})
    _, parts, _ = opened(tmp_path)
    assert rows_of(parts, 0) == [0, 2, 3]
    first = next(found for part in parts for found in part.warnings)
    assert (first.path, first.line) == (folder / "000001.json", 1)
    assert first.values["problem"].values["item"] == "person 0: shapes"


@pytest.mark.parametrize(
    "rows", [[[]], [[None] * 4], [[INFINITE, 0.0, 0.0, 1.0]], [[1.0, 2.0]], [["a", 1, 2]], [[[]]]]
)
def test_number_of_keypoints_is_that_of_valid_records(tmp_path, rows):
    good, bad = [points(0), points(1)], points(0) | {"keypoints3d": rows}
    folder = write_frames(tmp_path / "keypoints3d", {0: [bad, good[1]], 1: good})
    _, parts, _ = opened(tmp_path)
    seen = [sorted(person for part in parts if person in part.points) for person in (0, 1)]
    assert seen == [[0] * len(seen[0]), [1] * len(parts)]
    counts = [part.points[0][1].points.shape[:2] for part in parts if 0 in part.points]
    assert sum(rows for rows, _ in counts) == 1 and {count for _, count in counts} == {25}
    line, (_, _, values) = fault_in(parts, folder / "000000.json")
    assert (line, values["item"]) == (1, "person 0: keypoints3d")
    assert values["problem"].sentence in (
        "expected rows of 3 or 4 numbers, found {found}",
        "expected rows of 3 or 4 numbers, found rows of different lengths",
        "expected rows of 3 or 4 finite numbers, found none",
    )


def test_undetected_keypoints_determine_the_number_of_keypoints(tmp_path):
    unseen = {"keypoints3d": [[0.0] * 4] * 25}
    write_frames(tmp_path / "keypoints3d", {0: [points(0) | unseen], 1: [points(0)]})
    _, parts, _ = opened(tmp_path)
    assert sum(len(part.points[0][1].points) for part in parts) == 2


def test_accepted_pose_lengths_are_listed(tmp_path):
    folder = write_frames(tmp_path / "smpl", {0: [body(0, poses=[[0.0] * 7])], 1: [body(0)]})
    _, parts, _ = opened(tmp_path)
    _, (_, _, values) = fault_in(parts, folder / "000000.json")
    lengths = [9, 48, 63, 69, 72, 78, 87, 156, 165]
    problem = Phrase(
        "expected {expected} numbers, found {found}", expected=one_of(lengths), found=7
    )
    assert values == {"item": "person 0: poses", "problem": problem}


def test_empty_record_is_reported_without_keys(tmp_path):
    write_frames(tmp_path / "smpl", {0: [{}], 1: [body(0)]})
    _, parts, _ = opened(tmp_path)
    problem = "expected poses or keypoints3d, found no keys"
    faults = [values.get("problem") for _, _, values in noticed(parts)]
    assert ("F002.record", None, {"item": "person 0", "problem": problem}) in faults


def test_unusual_number_of_pose_values_in_the_first_record_makes_it_a_gap(tmp_path):
    frames = {0: [body(0, 78)], **{frame: [body(0)] for frame in range(1, 12)}}
    folder = write_frames(tmp_path / "smpl", frames)
    capture, parts, _ = opened(tmp_path)
    assert (capture.model, rows_of(parts, 0)) == ("SMPL", [*range(1, 12)])
    problem = "expected 72 numbers, found 78"
    values = {"item": "person 0: poses", "problem": problem}
    assert fault_in(parts, folder / "000000.json") == (1, ("F002.record", None, values))


def test_omitted_coefficients_are_zero(tmp_path):
    short, long = [0.25, 0.5], [0.25, 0.5, 0.75, 1.0]
    people = {0: (short, long), 1: (long, short), 2: ([long], [short])}
    frames = {
        frame: [body(person, shapes=shapes[frame]) for person, shapes in people.items()]
        for frame in range(2)
    }
    write_frames(tmp_path / "smpl", frames)
    _, parts, _ = opened(tmp_path)
    assert not noticed(parts)
    padded = [*short, 0.0, 0.0]
    for person, wanted in {0: [padded, long], 1: [long, padded], 2: [long, padded]}.items():
        rows = [row for part in parts for row in part.bodies[person].shape.tolist()]
        assert rows == wanted


ROWS = np.array([[9.0, 9.0], [1.0, 2.0], [9.0, 9.0], [np.nan, 3.0], [9.0, 9.0]])
GIVEN = np.array([False, True, False, True, False])


def test_missing_rows_repeat_the_last_valid_row():
    expected = [[0.0, 0.0], [1.0, 2.0], [1.0, 2.0], [np.nan, 3.0], [1.0, 2.0]]
    assert_array_equal(hold(ROWS, GIVEN, None), expected)


def test_first_rows_use_the_previously_known_shape():
    assert_array_equal(hold(ROWS, GIVEN, np.array([7.0, 8.0]))[0], [7.0, 8.0])


def test_complete_rows_are_unchanged():
    assert hold(ROWS, np.ones(5, dtype=bool), None) is ROWS


def test_last_valid_row_is_remembered():
    assert_array_equal(last_given(ROWS, GIVEN), [1.0, 2.0])
    assert last_given(ROWS, np.zeros(5, dtype=bool)) is None
    assert last_given(np.zeros((0, 2)), np.zeros(0, dtype=bool)) is None


# Recordings with missing coefficients


def shapes_of(parts, person):
    """Return the shape of every row of a person, as stored in the records."""
    motions = [part.bodies[person] for part in parts if person in part.bodies]
    rows = [np.broadcast_to(motion.shape, (motion.n_rows, 10)) for motion in motions]
    return np.concatenate(rows)[:, 0].tolist()


def test_shapes_of_the_first_record_apply_to_all_records(tmp_path):
    bare = [body(0, shapes=None), body(1, shapes=None)]
    first = [body(0, shapes=[[2.0] * 10]), body(1, shapes=[[3.0] * 10])]
    folder = write_frames(tmp_path / "smpl", {0: first, **dict.fromkeys(range(1, 100), bare)})
    _, parts, _ = opened(tmp_path)
    assert len(parts) == 3 and rows_of(parts, 1) == list(range(100))
    assert shapes_of(parts, 0) == [2.0] * 100 and shapes_of(parts, 1) == [3.0] * 100
    assert all(part.bodies[0].shape.shape == (1, 10) for part in parts)
    assert noticed(parts, folder / "000001.json") == [
        ("F007.record-last", None, {"item": "shapes"})
    ]


def test_last_valid_shapes_are_repeated(tmp_path):
    def record(value):
        return [body(0, shapes=None if value is None else [[value] * 10])]

    values = [None, 1.0, None, 2.0, float("nan"), None, None, 4.0]
    write_frames(tmp_path / "smpl", {frame: record(value) for frame, value in enumerate(values)})
    _, parts, _ = opened(tmp_path)
    # The record with an invalid value is a gap, and its shape is not repeated.
    assert rows_of(parts, 0) == [0, 1, 2, 3, 5, 6, 7]
    found = [0.0, 1.0, 1.0, 2.0, 2.0, 2.0, 4.0]
    rows = [part.bodies[0] for part in parts]
    assert rows[0].shape is None  # no earlier record has a shape
    assert shapes_of(parts[1:], 0) == found[1:]
    names = [found.path.name for part in parts for found in part.warnings]
    assert names == ["000001.json", "000004.json", "000002.json"]
    assert noticed(parts) == [
        ("F007.record-first", None, {"keys": ("shapes",)}),
        (
            "F007.record",
            1,
            {
                "problem": (
                    "F003.record",
                    None,
                    {
                        "item": "person 0: shapes",
                        "problem": "expected finite numbers, found nan",
                    },
                )
            },
        ),
        ("F007.record-last", None, {"item": "shapes"}),
    ]


def test_person_without_shapes_gets_the_mean_body(tmp_path):
    folder = write_frames(tmp_path / "smpl", {0: [body(0), body(1, shapes=None)]})
    _, parts, _ = opened(tmp_path)
    assert_array_equal(parts[0].bodies[1].shape, np.zeros((1, 10)))
    assert_array_equal(parts[0].bodies[0].shape, [waves(10, seed=3)])
    assert tuple(noticed(parts[:1], folder / "000000.json")) == (
        ("F007.record-no-last", None, {"item": "shapes"}),
    )


def test_untracked_people_do_not_inherit_shapes(tmp_path):
    frames = {0: [body(-1, shapes=[[5.0] * 10])], 1: [body(-1, shapes=None)], 2: [body(-1)]}
    write_frames(tmp_path / "smpl", frames)
    _, parts, _ = opened(tmp_path)
    assert shapes_of(parts, -1) == [5.0, 0.0, waves(10, seed=2)[0]]


def test_expression_is_repeated(tmp_path):
    said = {"expression": [[0.5] * 10]}
    frames = {0: [body(0, 87)], 1: [body(0, 87, **said)], 2: [body(0, 87)]}
    write_frames(tmp_path / "smpl", frames)
    _, parts, _ = opened(tmp_path)
    assert parts[0].bodies[0].expression is None
    assert_array_equal(parts[1].bodies[0].expression, np.full((1, 10), 0.5))
    assert parts[1].bodies[0].n_rows == 2


def test_expression_may_start_within_a_part(tmp_path):
    frames = {frame: [body(0, 87), body(1, 87)] for frame in range(5)}
    frames[3] = [body(0, 87), body(1, 87, expression=[[0.5] * 10])]
    write_frames(tmp_path / "smpl", frames)
    _, parts, _ = opened(tmp_path)
    assert_array_equal(parts[1].bodies[0].expression, np.zeros((1, 10)))
    assert parts[1].bodies[1].expression[:, 0].tolist() == [0.0, 0.0, 0.5, 0.5]


def test_record_without_poses_is_a_gap(tmp_path):
    write_frames(tmp_path / "smpl", {0: [body(0)], 1: [body(0, poses=None)], 2: [body(0)]})
    _, parts, _ = opened(tmp_path)
    assert rows_of(parts, 0) == [0, 2]


def test_invalid_record_without_shapes_does_not_affect_others(tmp_path):
    bare = body(0, shapes=None)
    frames = {0: [body(0, shapes=[[2.0] * 10])], 1: [bare], 2: [bare | {"Th": [[1, "x", 3]]}]}
    write_frames(tmp_path / "smpl", {**frames, 3: [bare]})
    _, parts, _ = opened(tmp_path)
    assert rows_of(parts, 0) == [0, 1, 3] and shapes_of(parts, 0) == [2.0] * 3


@pytest.mark.parametrize("key", ["shapes", "expression"])
@pytest.mark.parametrize("empty", [[], [[]]], ids=["list", "matrix"])
def test_empty_coefficients_are_treated_as_missing(tmp_path, key, empty):
    missing = write_frames(tmp_path / "a", {0: [body(0, **{key: None})], 1: [body(0)]})
    written = write_frames(tmp_path / "b", {0: [body(0, **{key: empty})], 1: [body(0)]})
    expected, found = (opened(folder)[1] for folder in (missing, written))
    assert rows_of(found, 0) == [0, 1]
    for part, other in zip(found, expected, strict=True):
        assert noticed([part]) == noticed([other])
        motion, wanted = part.bodies[0], other.bodies[0]
        assert (motion.expression is None) == (wanted.expression is None)
        if key == "shapes":
            assert_array_equal(motion.shape, wanted.shape)


def test_empty_shapes_repeat_the_last_value(tmp_path):
    frames = {0: [body(0, shapes=[[2.0] * 10])], 1: [body(0, shapes=[])], 2: [body(0, shapes=[[]])]}
    write_frames(tmp_path / "smpl", frames)
    _, parts, _ = opened(tmp_path)
    assert rows_of(parts, 0) == [0, 1, 2] and shapes_of(parts, 0) == [2.0] * 3


@pytest.mark.parametrize("empty", [[], [[]]])
def test_hands_without_components_are_ignored(tmp_path, empty):
    write_frames(tmp_path / "smpl", {0: [body(0, 63, handl=empty, handr=[[0.5] * 6])]})
    _, parts, _ = opened(tmp_path)
    assert list(parts[0].bodies[0].hands) == ["right"]
