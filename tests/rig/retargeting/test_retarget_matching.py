"""Retargeting onto different hierarchies: matched joints and transferred rotations."""

from dataclasses import replace

import numpy as np
import pytest
from faults import told
from rig.retargeting.two_people import BODY, EXACT, HIK, bones, figure_of, moving, places

from viewer.diagnostics import Diagnostic
from viewer.diagnostics.diagnostic import Phrase
from viewer.errors import RigError
from viewer.rig.figure import Figure
from viewer.rig.motion.skeleton_motion import SkeletonMotion
from viewer.rig.motion.timing import Timing
from viewer.rig.retargeting.retarget import retarget, scaled_motion


def test_rotations_of_joints_between_matched_joints_are_included() -> None:
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
    names = ["LeftToeBase", "LeftArmRoll"]
    assert ("F007.joints-without-partner", {"motion": "mocap", "names": names}) in told(notes)


def test_unmapped_joints_stay_at_rest_relative_to_their_parent() -> None:
    table = {**BODY, "jaw": ("head", (0.0, 1.52, 0.08)), "tail": ("pelvis", (0, 0.9, -0.2))}
    source, figure = moving(figure_of(HIK, "mocap")), figure_of(table, "body")
    clip, notes = retarget(source, figure)
    np.testing.assert_array_equal(clip.rotations[:, -2:], np.tile([0.0, 0, 0, 1], (5, 2, 1)))
    assert ("F007.joints-at-rest", {"names": ["spine2", "jaw", "tail"]}) in told(notes)


def test_fingers_rotate_with_the_hand_and_bend_about_the_knuckles() -> None:
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
    # The hand of the figure hangs down, palm to the body; that of the source is stretched out, palm
    # down.
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


def test_equal_hierarchy_with_different_proportions_receives_equal_rotations() -> None:
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
    values = {"motion": "one", "figure": "two", "n": 20, "all": 20, "pairs": []}
    assert told(notes)[0] == ("F007.joints-matched", values)


def test_joint_translations_are_transferred_between_equal_hierarchies() -> None:
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
    values = {"n": 1, "most": pytest.approx(np.sqrt(0.003)), "joint": "left_knee"}
    assert told(notes)[-1] == ("F007.joint-positions-left-out", values)


def test_mapping_matches_names_without_rules() -> None:
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
    names = ("pelvis", "x0"), ("left_shoulder", "x13"), ("left_elbow", "x14"), ("left_wrist", "x15")
    pairs = [
        Phrase("{joint} by {partner}", joint=joint, partner=partner) for joint, partner in names
    ]
    values = {"motion": "strange", "figure": "body", "n": 4, "all": 20, "pairs": pairs}
    (matched, resting, *_) = told(notes)
    assert matched == ("F007.joints-matched-as-follows", values)
    assert resting[0] == "F007.joints-at-rest"
    assert resting[1]["names"][:2] == ["left_hip", "right_hip"]


def test_equal_names_match_without_a_known_meaning() -> None:
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
    values = {"motion": "snake", "figure": "wasp", "n": 3, "all": 4, "pairs": []}
    assert told(notes)[:2] == [
        ("F007.joints-matched", values),
        ("F007.joints-at-rest", {"names": ["sting"]}),
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
        (
            {"tial": "head"},
            "F004.mapping-joint",
            {"joint": "tial", "figure": "snake", "n": 0, "near": "did you mean tail?"},
        ),
        (
            {"tail": "haed"},
            "F004.mapping-joint",
            {"joint": "haed", "figure": "body", "n": 0, "near": "did you mean head?"},
        ),
        (
            {"tail": "head", "base": "head"},
            "F004.mapping-again",
            {"joint": "head", "figure": "body"},
        ),
    ],
)
def test_incompatible_figures_are_refused(
    mapping: dict[str, str] | None, key: str, values: dict[str, object]
) -> None:
    snake = figure_of({"base": ("", (0, 0, 0)), "tail": ("base", (0, 0, 1))}, "snake")
    with pytest.raises(RigError) as caught:
        retarget(moving(snake), figure_of(BODY, "body"), mapping)
    found = caught.value.diagnostic
    assert found is not None and (found.key, found.values) == (key, values)


def test_gaps_are_preserved() -> None:
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


def limb_warnings(motion: SkeletonMotion, figure: Figure, mapping=None) -> list[Diagnostic]:
    return [note for note in retarget(motion, figure, mapping)[1] if note.code == "C018"]


def renamed(table: dict, **names: str) -> dict:
    return {names.get(name, name): (names.get(parent, parent), at)
            for name, (parent, at) in table.items()}  # fmt: skip


def test_limbs_without_a_recognised_joint_of_the_motion_are_a_warning() -> None:
    body = figure_of(BODY, "body")
    assert limb_warnings(moving(figure_of(HIK, "walk")), body) == []
    foreign = renamed(HIK, LeftLeg="Knie_l", RightLeg="Knie_r")
    (found,) = limb_warnings(moving(figure_of(foreign, "walk")), body)
    assert str(found) == (
        "left_knee, right_knee of body stay at rest: nothing in walk is recognised as these joints "
        "(unused: Knie_l, Knie_r); match them in the Joint match panel or with --joint-map"
    )
    pairs = {"Knie_l": "left_knee", "Knie_r": "right_knee"}
    assert limb_warnings(moving(figure_of(foreign, "walk")), body, pairs) == []


def test_limbs_without_a_recognised_joint_of_the_figure_are_a_warning() -> None:
    body = figure_of(renamed(BODY, left_elbow="codo"), "body")
    (found,) = limb_warnings(moving(figure_of(HIK, "walk")), body)
    assert (found.key, found.values["parts"]) == ("C018.limbs-unknown", ["left elbow"])
    assert found.values["idle"] == ["codo"]


def test_knees_that_never_bend_in_a_moving_leg_are_a_warning() -> None:
    motion, body = moving(figure_of(HIK, "walk")), figure_of(BODY, "body")
    names, rotations = motion.figure.skeleton.names, motion.clip.rotations.copy()
    for name in ("LeftLeg", "RightLeg"):
        rotations[:, names.index(name)] = [0, 0, 0, 1]
    (found,) = limb_warnings(replace(motion, clip=replace(motion.clip, rotations=rotations)), body)
    assert (found.key, found.values["names"]) == ("C018.limbs-still", ["left_knee", "right_knee"])
    # A figure that does not move at all is no fault, nor is a single stiff knee.
    still = np.broadcast_to([0.0, 0.0, 0.0, 1.0], rotations.shape)
    assert limb_warnings(replace(motion, clip=replace(motion.clip, rotations=still)), body) == []
    one = motion.clip.rotations.copy()
    one[:, names.index("LeftLeg")] = [0, 0, 0, 1]
    assert limb_warnings(replace(motion, clip=replace(motion.clip, rotations=one)), body) == []
