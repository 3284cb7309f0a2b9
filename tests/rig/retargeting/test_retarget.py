"""Retargeting of motions between skeletons with other rest poses, axes, units and names."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from faults import lines

from viewer.errors import RigError
from viewer.rig.figure import Figure
from viewer.rig.mesh import Mesh
from viewer.rig.motion.evaluation import frames_of, world_frames
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.skeleton_motion import SkeletonMotion
from viewer.rig.motion.timing import Timing
from viewer.rig.retargeting.retarget import retarget, scaled_motion
from viewer.rig.skeleton import ball_skeleton

# A T-pose in centimetres with the names of capture software: name, parent, position.
HIK = {
    "Hips": ("", (0, 100, 0)),
    "LeftUpLeg": ("Hips", (10, 95, 0)),
    "LeftLeg": ("LeftUpLeg", (10, 50, 0)),
    "LeftFoot": ("LeftLeg", (10, 8, -2)),
    "LeftToeBase": ("LeftFoot", (10, 1, 12)),
    "RightUpLeg": ("Hips", (-10, 95, 0)),
    "RightLeg": ("RightUpLeg", (-10, 50, 0)),
    "RightFoot": ("RightLeg", (-10, 8, -2)),
    "Spine": ("Hips", (0, 110, 0)),
    "Spine1": ("Spine", (0, 125, 0)),
    "Neck": ("Spine1", (0, 150, 0)),
    "Head": ("Neck", (0, 160, 2)),
    "LeftShoulder": ("Spine1", (4, 145, 0)),
    "LeftArm": ("LeftShoulder", (18, 145, 0)),
    "LeftForeArm": ("LeftArm", (46, 145, 0)),
    "LeftHand": ("LeftForeArm", (72, 145, 0)),
    "RightShoulder": ("Spine1", (-4, 145, 0)),
    "RightArm": ("RightShoulder", (-18, 145, 0)),
    "RightForeArm": ("RightArm", (-46, 145, 0)),
    "RightHand": ("RightForeArm", (-72, 145, 0)),
}
# Metres, arms and legs spread at odd angles (an A-pose), the spine bent, other proportions.
BODY = {
    "pelvis": ("", (0.0, 0.9, 0.02)),
    "left_hip": ("pelvis", (0.07, 0.82, 0.02)),
    "right_hip": ("pelvis", (-0.07, 0.82, 0.02)),
    "spine1": ("pelvis", (0.0, 1.0, 0.0)),
    "left_knee": ("left_hip", (0.15, 0.42, 0.04)),
    "right_knee": ("right_hip", (-0.15, 0.42, 0.04)),
    "spine2": ("spine1", (0.0, 1.12, 0.01)),
    "left_ankle": ("left_knee", (0.2, 0.06, 0.0)),
    "right_ankle": ("right_knee", (-0.2, 0.06, 0.0)),
    "spine3": ("spine2", (0.0, 1.18, 0.03)),
    "neck": ("spine3", (0.0, 1.4, 0.0)),
    "left_collar": ("spine3", (0.05, 1.33, 0.0)),
    "right_collar": ("spine3", (-0.05, 1.33, 0.0)),
    "head": ("neck", (0.0, 1.5, 0.03)),
    "left_shoulder": ("left_collar", (0.16, 1.33, 0.0)),
    "right_shoulder": ("right_collar", (-0.16, 1.33, 0.0)),
    "left_elbow": ("left_shoulder", (0.3, 1.12, -0.04)),
    "right_elbow": ("right_shoulder", (-0.3, 1.12, -0.04)),
    "left_wrist": ("left_elbow", (0.42, 0.9, 0.02)),
    "right_wrist": ("right_elbow", (-0.42, 0.9, 0.02)),
}
LIMBS = [
    (("LeftUpLeg", "LeftLeg"), ("left_hip", "left_knee")),
    (("LeftLeg", "LeftFoot"), ("left_knee", "left_ankle")),
    (("RightUpLeg", "RightLeg"), ("right_hip", "right_knee")),
    (("RightLeg", "RightFoot"), ("right_knee", "right_ankle")),
    (("LeftArm", "LeftForeArm"), ("left_shoulder", "left_elbow")),
    (("LeftForeArm", "LeftHand"), ("left_elbow", "left_wrist")),
    (("RightArm", "RightForeArm"), ("right_shoulder", "right_elbow")),
    (("RightForeArm", "RightHand"), ("right_elbow", "right_wrist")),
]
EXACT = 1e-12  # rounding errors of directions and rotations


def figure_of(table: dict, name: str, turn: np.ndarray | None = None, up: str = "y") -> Figure:
    names = tuple(table)
    parents = np.array([names.index(p) if p else -1 for p, _ in table.values()], dtype=np.int32)
    places = np.array([place for _, place in table.values()], dtype=float)
    places = places if turn is None else places @ turn.T
    return Figure(name, skeleton=ball_skeleton(names, parents, places), up=up)


def moving(figure: Figure, count: int = 5, seed: int = 0, angle: float = 2.0) -> SkeletonMotion:
    """Return a motion with large random rotations and a path; frame 0 is the rest pose."""
    rng = np.random.default_rng(seed)
    joints = figure.skeleton.n_joints
    vectors = rng.uniform(-angle, angle, (count, joints, 3))
    vectors[0] = 0.0
    size = np.ptp(figure.skeleton.rest_translations[0]) + 1.0
    shifts = np.zeros((count, joints, 3))
    shifts[1:, 0] = rng.uniform(-size, size, (count - 1, 3))
    clip = SampledClip("walk", Timing(30.0, np.arange(count)), quaternions(vectors), shifts)
    return SkeletonMotion(figure, clip)


def quaternions(vectors: np.ndarray) -> np.ndarray:
    angles = np.linalg.norm(vectors, axis=-1, keepdims=True)
    axes = vectors / np.where(angles > 0, angles, 1.0)
    return np.concatenate([axes * np.sin(angles / 2), np.cos(angles / 2)], axis=-1)


def places(figure: Figure, clip: SampledClip) -> dict[str, np.ndarray]:
    """Return the positions of joints by name, (N, 3) each."""
    times = np.arange(clip.n_rows) / clip.timing.frame_rate
    worlds = world_frames(figure, frames_of(figure, clip, times))[..., :3, 3]
    return dict(zip(figure.skeleton.names, np.swapaxes(worlds, 0, 1), strict=True))


def bones(where: dict[str, np.ndarray], pair: tuple[str, str]) -> np.ndarray:
    way = where[pair[1]] - where[pair[0]]
    return way / np.linalg.norm(way, axis=1, keepdims=True)


def assert_same_limbs(source: SkeletonMotion, figure: Figure, clip: SampledClip, turn=None) -> None:
    theirs, mine = places(source.figure, source.clip), places(figure, clip)
    for pair, own in LIMBS:
        wanted = bones(theirs, pair)
        wanted = wanted if turn is None else wanted @ turn.T
        np.testing.assert_allclose(bones(mine, own), wanted, atol=EXACT, err_msg=own[0])


def test_onto_itself_is_the_identity() -> None:
    motion = moving(figure_of(HIK, "mocap"))
    clip, notes = retarget(motion, motion.figure)
    same = np.abs(np.einsum("nja,nja->nj", clip.rotations, motion.clip.rotations))
    np.testing.assert_allclose(same, 1.0, atol=EXACT)
    np.testing.assert_allclose(clip.translations, motion.clip.translations, atol=1e-12 * 100)
    assert lines(notes) == [
        "mocap drives 20 of 20 joints of mocap",
        "root path scaled by 1, the ratio of leg lengths",
    ]


def test_joints_with_repeated_names_come_back_by_hierarchy() -> None:
    table = {"a": ("", (0, 0, 0)), "b": ("a", (1, 0, 0)), "c": ("b", (2, 0, 0))}
    figure = figure_of(table, "snake")
    figure = replace(figure, skeleton=replace(figure.skeleton, names=("tail", "tail", "")))
    motion = moving(figure)
    clip, _ = retarget(motion, figure)
    same = np.abs(np.einsum("nja,nja->nj", clip.rotations, motion.clip.rotations))
    np.testing.assert_allclose(same, 1.0, atol=EXACT)


def test_limbs_point_as_the_source_s_do_from_t_pose_to_a_pose() -> None:
    source, figure = moving(figure_of(HIK, "mocap")), figure_of(BODY, "body")
    clip, notes = retarget(source, figure)
    assert_same_limbs(source, figure, clip)
    assert lines(notes)[0].startswith(
        "mocap drives 19 of 20 joints of body: pelvis by Hips, left_hip by "
    )
    assert lines(notes)[0].endswith("left_wrist by LeftHand, right_wrist by RightHand")
    assert lines(notes)[1:3] == [
        "joints kept at rest: spine2",
        "unmatched joints of mocap: LeftToeBase",
    ]


def test_a_trunk_at_rest_in_quite_another_way_is_aligned_too() -> None:
    bowed = {**HIK, "Head": ("Neck", (0, 145, 12)), "Spine1": ("Spine", (0, 112, 14))}
    source, figure = moving(figure_of(bowed, "mocap")), figure_of(BODY, "body")
    clip, _ = retarget(source, figure)
    theirs, mine = places(source.figure, source.clip), places(figure, clip)
    for pair, own in (
        (("Neck", "Head"), ("neck", "head")),
        (("Spine", "Spine1"), ("spine1", "spine3")),
    ):
        np.testing.assert_allclose(bones(mine, own), bones(theirs, pair), atol=EXACT)


def test_limbs_point_as_the_source_s_do_from_a_pose_to_t_pose() -> None:
    source, figure = moving(figure_of(BODY, "body")), figure_of(HIK, "mocap")
    clip, _ = retarget(source, figure)
    theirs, mine = places(source.figure, source.clip), places(figure, clip)
    for own, pair in LIMBS:
        np.testing.assert_allclose(bones(mine, own), bones(theirs, pair), atol=EXACT)


def test_trunk_and_feet_keep_their_own_bend() -> None:
    source, figure = moving(figure_of(HIK, "mocap")), figure_of(BODY, "body")
    clip, _ = retarget(source, figure)
    # In the source's rest pose the slightly bent spine of the figure keeps its own shape.
    still = {"pelvis": 0, "spine1": 3, "spine3": 9, "neck": 10, "head": 13, "left_collar": 11}
    for name, joint in still.items():
        np.testing.assert_allclose(
            np.abs(clip.rotations[0, joint, 3]), 1.0, atol=EXACT, err_msg=name
        )


def test_axes_of_the_figure_s_joints_do_not_matter() -> None:
    source, plain = moving(figure_of(HIK, "mocap")), figure_of(BODY, "body")
    rng = np.random.default_rng(1)
    skeleton = plain.skeleton
    turns = quaternions(rng.uniform(-2, 2, (skeleton.n_joints, 3)))
    # The same positions with rotated joints: offsets are relative to the parent's axes.
    worlds, offsets = [], []
    for joint, parent in enumerate(skeleton.parents):
        above = np.eye(3) if parent < 0 else worlds[parent]
        offsets.append(above.T @ skeleton.rest_translations[joint])
        worlds.append(above @ matrix(turns[joint]))
    turned = replace(skeleton, rest_rotations=turns, rest_translations=np.array(offsets))
    figure = replace(plain, skeleton=turned)
    expected = places(plain, retarget(source, plain)[0])
    found = places(figure, retarget(source, figure)[0])
    for name, place in expected.items():
        np.testing.assert_allclose(found[name], place, atol=1e-12)


def matrix(quaternion: np.ndarray) -> np.ndarray:
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


TO_Y = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # z up to y up: (x, y, z) -> (x, z, -y)


def test_a_source_with_z_up_is_turned_upright() -> None:
    source = moving(figure_of(HIK, "mocap", TO_Y.T, "z"))
    figure = figure_of(BODY, "body")
    clip, _ = retarget(source, figure)
    assert_same_limbs(source, figure, clip, TO_Y)
    path = places(source.figure, source.clip)["Hips"] @ TO_Y.T
    scale = path_scale()
    np.testing.assert_allclose(places(figure, clip)["pelvis"], scale * path, atol=1e-12)


def path_scale() -> float:
    """Return the ratio of the leg lengths of BODY and HIK, which are equal on both sides."""
    mine = [np.array(BODY[name][1]) for name in ("left_hip", "left_knee", "left_ankle")]
    theirs = [np.array(HIK[name][1]) for name in ("LeftUpLeg", "LeftLeg", "LeftFoot")]
    lengths = [
        np.linalg.norm(leg[1] - leg[0]) + np.linalg.norm(leg[2] - leg[1]) for leg in (mine, theirs)
    ]
    return lengths[0] / lengths[1]


def test_the_path_is_scaled_by_the_legs() -> None:
    source, figure = moving(figure_of(HIK, "mocap")), figure_of(BODY, "body")
    clip, notes = retarget(source, figure)
    theirs = places(source.figure, source.clip)["Hips"]
    np.testing.assert_allclose(places(figure, clip)["pelvis"], path_scale() * theirs, atol=1e-12)
    assert lines(notes)[-1] == f"root path scaled by {path_scale():.4g}, the ratio of leg lengths"
    assert clip.figure_translations is None


def test_a_skinned_figure_moves_as_a_whole() -> None:
    source, bare = moving(figure_of(HIK, "mocap")), figure_of(BODY, "body")
    corners = np.eye(3)
    figure = replace(bare, mesh=Mesh(corners, corners, np.array([[0, 1, 2]], dtype=np.int32)))
    clip, _ = retarget(source, figure)
    assert clip.translations is None
    expected = places(bare, retarget(source, bare)[0])
    for name, place in places(figure, clip).items():
        np.testing.assert_allclose(place, expected[name], atol=1e-12)


def test_a_source_that_looks_elsewhere_at_rest_turns_the_figure() -> None:
    quarter = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])  # z, its front, is now x
    source = moving(figure_of(HIK, "mocap", quarter))
    figure = figure_of(BODY, "body")
    clip, _ = retarget(source, figure)
    assert_same_limbs(source, figure, clip)
    where = places(figure, clip)
    # The line between the figure's hips, along x at rest, is aligned with the source's: along -z.
    np.testing.assert_allclose(bones(where, ("right_hip", "left_hip"))[0], [0, 0, -1], atol=EXACT)


def test_a_source_whose_rest_pose_lies_down_stands_up_in_its_frames() -> None:
    down = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    source = moving(figure_of(HIK, "mocap", down))  # y is up, yet the body lies along z
    figure = figure_of(BODY, "body")
    clip, _ = retarget(source, figure)
    assert_same_limbs(source, figure, clip)


def test_joints_between_two_that_match_are_folded_in() -> None:
    table = dict(HIK)
    table["LeftArmRoll"] = ("LeftArm", (30, 145, 0))
    table["LeftForeArm"] = ("LeftArmRoll", HIK["LeftForeArm"][1])
    order = [*list(HIK)[:14], "LeftArmRoll", *list(HIK)[14:]]
    source = moving(figure_of({name: table[name] for name in order}, "mocap"))
    figure = figure_of(BODY, "body")
    clip, notes = retarget(source, figure)
    theirs, mine = places(source.figure, source.clip), places(figure, clip)
    np.testing.assert_allclose(
        bones(mine, ("left_elbow", "left_wrist")),
        bones(theirs, ("LeftForeArm", "LeftHand")),
        atol=EXACT,
    )
    assert "unmatched joints of mocap: LeftToeBase, LeftArmRoll" in lines(notes)


def test_joints_that_nothing_moves_stay_at_rest_in_their_parent() -> None:
    table = {**BODY, "jaw": ("head", (0.0, 1.52, 0.08)), "tail": ("pelvis", (0, 0.9, -0.2))}
    source, figure = moving(figure_of(HIK, "mocap")), figure_of(table, "body")
    clip, notes = retarget(source, figure)
    np.testing.assert_array_equal(clip.rotations[:, -2:], np.tile([0.0, 0, 0, 1], (5, 2, 1)))
    assert "joints kept at rest: spine2, jaw, tail" in lines(notes)


def test_fingers_turn_with_the_hand_and_bend_about_the_knuckles() -> None:
    def with_fingers(table: dict, wrist: str, names: list[str], turn: np.ndarray) -> dict:
        base = np.array(table[wrist][1], dtype=float)
        size = 0.01 if base[1] > 10 else 0.0001
        places = [(8, 0, 3), (12, 0, 3), (8, 0, -3), (12, 0, -3)]
        tips = [tuple(base + size * 100 * (turn @ np.array(p))) for p in places]
        return {
            **table,
            names[0]: (wrist, tips[0]),
            names[1]: (names[0], tips[1]),
            names[2]: (wrist, tips[2]),
            names[3]: (names[2], tips[3]),
        }

    hik = ["LeftHandIndex1", "LeftHandIndex2", "LeftHandPinky1", "LeftHandPinky2"]
    own = ["left_index1", "left_index2", "left_pinky1", "left_pinky2"]
    # The figure's hand hangs down, palm to the body; the source's is stretched out, palm down.
    hang = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    source = moving(figure_of(with_fingers(HIK, "LeftHand", hik, np.eye(3)), "mocap"))
    figure = figure_of(with_fingers(BODY, "left_wrist", own, hang), "body")
    clip, _ = retarget(source, figure)
    theirs, mine = places(source.figure, source.clip), places(figure, clip)
    pairs = [
        ((hik[0], hik[2]), (own[0], own[2])),
        ((hik[0], hik[1]), (own[0], own[1])),
        ((hik[2], hik[3]), (own[2], own[3])),
        (("LeftHand", hik[0]), ("left_wrist", own[0])),
    ]
    for pair, ours in pairs:
        np.testing.assert_allclose(bones(mine, ours), bones(theirs, pair), atol=EXACT)


def test_same_hierarchy_with_other_proportions_takes_rotations_over() -> None:
    source = moving(figure_of(BODY, "one"))
    names = list(BODY)
    # Depth-first instead of breadth-first, with 0.9 times the width and 1.1 times the height.
    order = [
        "pelvis",
        "spine1",
        "spine2",
        "spine3",
        "neck",
        "head",
        *[n for n in names if "_" in n],
    ]
    table = {n: (BODY[n][0], tuple(np.array(BODY[n][1]) * [0.9, 1.1, 1.0])) for n in order}
    figure = figure_of(table, "two")
    clip, notes = retarget(source, figure)
    for joint, name in enumerate(order):
        same = np.einsum(
            "na,na->n", clip.rotations[:, joint], source.clip.rotations[:, names.index(name)]
        )
        np.testing.assert_allclose(np.abs(same), 1.0, atol=EXACT)
    assert lines(notes)[0] == "one drives 20 of 20 joints of two"


def test_moves_of_inner_joints_are_carried_where_the_hierarchy_is_the_same() -> None:
    figure = figure_of(BODY, "one")
    motion = moving(figure)
    shifts = motion.clip.translations.copy()
    shifts[2:, 4] = 0.05, -0.01, 0.02
    motion = SkeletonMotion(figure, replace(motion.clip, translations=shifts))
    clip, _ = retarget(motion, figure)
    np.testing.assert_allclose(clip.translations, shifts, atol=EXACT)
    bigger = scaled_motion(motion, 2.0).figure
    clip, _ = retarget(motion, bigger)
    np.testing.assert_allclose(clip.translations[:, 4], 2 * shifts[:, 4], atol=EXACT)
    _, notes = retarget(motion, figure_of(HIK, "mocap"))
    assert lines(notes)[-1] == (
        "translations of 1 joint relative to its parent omitted (largest: 0.0548 at left_knee)"
    )


def test_mapping_names_what_rules_do_not_know() -> None:
    strange = {
        f"x{i}": (f"x{list(HIK).index(p)}" if p else "", at)
        for i, (p, at) in enumerate(HIK.values())
    }
    source, figure = moving(figure_of(strange, "strange")), figure_of(BODY, "body")
    with pytest.raises(RigError):
        retarget(source, figure)
    arm = {"x0": "pelvis", "x13": "left_shoulder", "x14": "left_elbow", "x15": "left_wrist"}
    clip, notes = retarget(source, figure, arm)
    theirs, mine = places(source.figure, source.clip), places(figure, clip)
    np.testing.assert_allclose(
        bones(mine, ("left_elbow", "left_wrist")), bones(theirs, ("x14", "x15")), atol=EXACT
    )
    assert lines(notes)[0] == (
        "strange drives 4 of 20 joints of body: pelvis by x0, left_shoulder by x13, "
        "left_elbow by x14, left_wrist by x15"
    )
    assert "joints kept at rest: left_hip, right_hip" in lines(notes)[1]


def test_equal_names_match_whatever_they_mean() -> None:
    table = {
        "base": ("", (0, 0, 0)),
        "tail_01": ("base", (0, 0, 1)),
        "tail_02": ("tail_01", (0, 0, 2)),
    }
    more = {**table, "sting": ("tail_02", (0, 0, 3))}
    source, figure = moving(figure_of(table, "snake")), figure_of(more, "wasp")
    clip, notes = retarget(source, figure)
    theirs, mine = places(source.figure, source.clip), places(figure, clip)
    np.testing.assert_allclose(mine["tail_02"], theirs["tail_02"], atol=EXACT)
    assert lines(notes)[:2] == [
        "snake drives 3 of 4 joints of wasp",
        "joints kept at rest: sting",
    ]


@pytest.mark.parametrize(
    ("mapping", "key", "values"),
    [
        (
            None,
            "F004.joints-unmatched",
            {
                "motion": "snake",
                "figure": "body",
                "n": 0,
                "unused": ["base", "tail"],
                "idle": list(BODY),
            },
        ),
        ({"tial": "head"}, "F004.mapping-joint", {"joint": "tial", "figure": "snake", "n": 0}),
        ({"tail": "haed"}, "F004.mapping-joint", {"joint": "haed", "figure": "body", "n": 0}),
    ],
)
def test_what_does_not_fit_is_refused(
    mapping: dict[str, str] | None, key: str, values: dict[str, object]
) -> None:
    snake = figure_of({"base": ("", (0, 0, 0)), "tail": ("base", (0, 0, 1))}, "snake")
    with pytest.raises(RigError) as caught:
        retarget(moving(snake), figure_of(BODY, "body"), mapping)
    found = caught.value.diagnostic
    assert found is not None and (found.key, found.values) == (key, values)


def test_gaps_stay_where_they_are() -> None:
    motion = moving(figure_of(HIK, "mocap"))
    timing = Timing(25.0, np.array([0, 1, -1, -1, 2, 3, 4]), first_frame=7)
    clip, _ = retarget(
        SkeletonMotion(motion.figure, replace(motion.clip, timing=timing)), figure_of(BODY, "b")
    )
    assert clip.timing is timing and clip.n_rows == 5


def test_scaled_motion_scales_all_lengths() -> None:
    motion = moving(figure_of(HIK, "mocap"))
    boxes = np.tile([[-1.0, -1, -1], [1, 1, 2]], (20, 1, 1))
    figure = replace(motion.figure, skeleton=replace(motion.figure.skeleton, boxes=boxes))
    small = scaled_motion(SkeletonMotion(figure, motion.clip), 0.01, "m")
    assert small.figure.unit == "m"
    np.testing.assert_allclose(small.figure.skeleton.boxes, 0.01 * boxes)
    before, after = places(motion.figure, motion.clip), places(small.figure, small.clip)
    for name, place in before.items():
        np.testing.assert_allclose(after[name], 0.01 * place, atol=1e-14)
    with pytest.raises(RigError, match="expected a factor above 0, found 0"):
        scaled_motion(motion, 0.0)
