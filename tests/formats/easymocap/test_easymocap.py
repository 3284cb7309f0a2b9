"""EasyMocap folders: person ids, gaps, all pose layouts, keypoints, and the timeline."""

import json

import numpy as np
import pytest
from formats.capture_files import body, noticed, opened, points, rows_of, waves, write_frames
from numpy.testing import assert_array_equal

from viewer.formats import Source, detect, read
from viewer.rig.bodies.smpl_family import FAMILY
from viewer.rig.captures.capture import Capture

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
