"""One walk in files with different rest conventions, which must move the bundled body equally."""

from dataclasses import replace

import numpy as np
import pytest
from builders import quaternions
from faults import told
from numpy.testing import assert_allclose
from rigs.retargeting.rest_twins import (
    N_FRAMES,
    NAMES,
    PARENTS,
    POINTS,
    a_pose,
    along_x,
    arbitrary,
    crawl,
    dance,
    lafan1,
    legs_apart,
    rokoko,
    t_pose,
    truth,
    twin,
    written,
)
from rigs.retargeting.two_people import BODY, HIK, figure_of, moving

from viewer.errors import RigError
from viewer.loading import bundled_body, load
from viewer.rigs.geometry.quaternion import multiply
from viewer.rigs.geometry.rotation import matrix_to_quaternion
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix as matrices
from viewer.rigs.motion.evaluation import frames_of, world_frames
from viewer.rigs.retargeting.drive import Drive
from viewer.rigs.retargeting.driven_clip import aligned_rests, driven_clip
from viewer.rigs.retargeting.retarget import retarget
from viewer.rigs.skeleton import FIRST_ROTATION

CONVENTIONS = {
    "a-pose": a_pose,
    "legs-apart": legs_apart,
    "along-x": along_x,
    "arbitrary": arbitrary,
}
SCRAMBLED = ("along-x", "arbitrary")
LIMBS = [
    (f"{side}{mine}", f"{side}{end}", f"{side.lower()}_{joint}", f"{side.lower()}_{tip}")
    for side in ("Left", "Right")
    for mine, end, joint, tip in (
        ("UpLeg", "Leg", "hip", "knee"),
        ("Leg", "Foot", "knee", "ankle"),
        ("Arm", "ForeArm", "shoulder", "elbow"),
        ("ForeArm", "Hand", "elbow", "wrist"),
    )
]


@pytest.fixture(scope="module")
def body():
    return load(bundled_body()).actors[0].figure


def posed(body, motion, rest="auto"):
    """Return world matrices of the driven body, (N, J, 4, 4), and the messages."""
    found = retarget(motion, body, source_rest=rest)
    clip, notes = found.clip, found.notes
    times = np.arange(N_FRAMES) / 30.0
    found = world_frames(body, frames_of(body, clip, times)).copy()
    found[..., :3, 3] += clip.figure_translations[:, None]
    return found, [(key, values) for key, values in told(notes) if ".rest-" in key]


@pytest.fixture(scope="module")
def expected(body):
    return posed(body, twin(t_pose()), "zero")[0]


def degrees(mine, others):
    """Return the angles between rotations in degrees: (N, J)."""
    traces = np.einsum("njab,njab->nj", mine[..., :3, :3], others[..., :3, :3])
    return np.degrees(np.arccos(np.clip((traces - 1.0) / 2.0, -1.0, 1.0)))


def limb_error(body, found, first=0):
    """Return the largest angle between the limbs and those of the ground truth, in degrees."""
    rotations, _ = truth(False)
    names = body.skeleton.names
    worst = 0.0
    for start, end, joint, tip in LIMBS:
        bone = POINTS[NAMES.index(end)] - POINTS[NAMES.index(start)]
        wanted = rotations[first:, NAMES.index(start)] @ (bone / np.linalg.norm(bone))
        mine = found[first:, names.index(tip), :3, 3] - found[first:, names.index(joint), :3, 3]
        mine /= np.linalg.norm(mine, axis=1, keepdims=True)
        sines = np.linalg.norm(np.cross(mine, wanted), axis=1)
        worst = max(worst, float(np.degrees(np.arctan2(sines, (mine * wanted).sum(1))).max()))
    return worst


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_files_with_a_t_pose_result_in_the_same_motion(body, expected, convention):
    found, notes = posed(body, twin(CONVENTIONS[convention]()))
    keys = [("F007.rest-frame", {"motion": "twin", "frame": 0, "pose": "a T-pose"})]
    assert notes == (keys if convention in SCRAMBLED else [])
    assert limb_error(body, found, 1) < 0.5
    # The limbs bend about the same axes; after an A-pose, the arms roll slightly differently.
    assert degrees(found, expected).max() < 5.0
    assert np.abs(found[..., :3, 3] - expected[..., :3, 3]).max() < 0.001  # m


@pytest.mark.parametrize("convention", SCRAMBLED)
def test_rest_pose_of_files_without_a_t_pose_is_estimated_from_anatomy(body, convention):
    expected, _ = posed(body, twin(t_pose(), starts_in_t_pose=False), "zero")
    found, notes = posed(body, twin(CONVENTIONS[convention](), starts_in_t_pose=False))
    assert notes == [("F007.rest-anatomy", {"motion": "twin"})]
    assert limb_error(body, found) < 0.5
    assert degrees(found, expected).max() < 5.0
    assert np.abs(found[..., :3, 3] - expected[..., :3, 3]).max() < 0.001  # m


@pytest.mark.parametrize("convention", [lafan1, rokoko])
@pytest.mark.parametrize("moves", [lambda: truth(True), lambda: truth(False), dance, crawl])
def test_axes_parallel_to_the_body_determine_the_rest_pose(body, convention, moves):
    expected, _ = posed(body, written(t_pose(), *moves()), "zero")
    found, notes = posed(body, written(convention(), *moves()))
    assert notes == [("F007.rest-axes", {"motion": "twin"})]
    assert degrees(found, expected).max() < 0.01  # rounding of arc cosines near 1
    assert np.abs(found[..., :3, 3] - expected[..., :3, 3]).max() < 0.001  # m


def test_slope_of_feet_with_moving_toes_is_found_from_the_soles(body):
    rotations, path = truth(starts_in_t_pose=False)
    for side in ("Left", "Right"):
        toes = NAMES.index(f"{side}ToeBase")
        lifts = 0.2 * np.sin(np.arange(N_FRAMES))[:, None] * [1.0, 0.0, 0.0]
        rotations[:, toes] = rotations[:, toes] @ matrices(lifts)
    expected, _ = posed(body, written(t_pose(), rotations, path), "zero")
    found, notes = posed(body, written(lafan1(), rotations, path))
    assert notes == [("F007.rest-axes", {"motion": "twin"})]
    assert degrees(found, expected).max() < 5.0


def test_bend_of_the_hands_that_never_changes_is_found_in_files_with_bones_along_x(body):
    # The hands are bent by 1 radian, as in crawling.
    rotations, path = truth(starts_in_t_pose=False)
    axes = along_x()
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        hand, forearm = NAMES.index(f"{side}Hand"), NAMES.index(f"{side}ForeArm")
        rotations[:, hand] = rotations[:, forearm] @ matrices(np.array([[0.0, 0.0, sign]]))[0]
        axes[hand] = axes[forearm]
    expected, _ = posed(body, written(t_pose(), rotations, path), "zero")
    found, _ = posed(body, written(axes, rotations, path))
    wrists = [body.skeleton.names.index(f"{side}_wrist") for side in ("left", "right")]
    assert degrees(found[:, wrists], expected[:, wrists]).max() < 5.0


def test_zero_pose_of_scrambled_axes_results_in_a_different_motion(body, expected):
    found, notes = posed(body, twin(along_x()), "zero")
    assert not notes
    assert degrees(found, expected).max() > 90.0


def test_frame_can_be_chosen_as_the_rest_pose(body, expected):
    found, notes = posed(body, twin(arbitrary()), 0)
    assert notes == [("F007.rest-asked", {"motion": "twin", "frame": 0})]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)  # rounding of rotations


def test_missing_rest_frame_is_refused(body):
    with pytest.raises(RigError) as problem:
        retarget(twin(t_pose()), body, source_rest=N_FRAMES)
    values = {"first": 0, "last": N_FRAMES - 1, "found": N_FRAMES}
    assert told([problem.value.diagnostic]) == [("F004.rest-frame", values)]


def test_frame_in_an_a_pose_is_found(body, expected):
    motion = twin(arbitrary())
    lowered = motion.clip.rotations.copy()
    arms = [NAMES.index(f"{side}Arm") for side in ("Left", "Right")]
    # World rotations of the T-pose are the axes C; those of the arms are lowered by 45 degrees.
    axes, down = arbitrary(), np.swapaxes(a_pose(), 1, 2)
    for arm in arms:
        above = axes[PARENTS[arm]]
        lowered[0, arm] = matrix_to_quaternion(above.T @ down[arm] @ axes[arm])
    motion = replace(motion, clip=replace(motion.clip, rotations=lowered))
    found, notes = posed(body, motion)
    assert notes == [("F007.rest-frame", {"motion": "twin", "frame": 0, "pose": "an A-pose"})]
    assert degrees(found[1:], expected[1:]).max() < 5.0


@pytest.mark.parametrize("axes", [along_x(), arbitrary()])
def test_rest_pose_of_a_person_who_never_stands_is_estimated_from_the_trunk(body, axes):
    motions = [twin(each, starts_in_t_pose=False) for each in (t_pose(), axes)]
    lying = [replace(each, figure=replace(each.figure, up="z")) for each in motions]
    (wanted, _), (found, notes) = (posed(body, each) for each in lying)
    assert notes == [("F007.rest-lying", {"motion": "twin"})]
    away = degrees(found, wanted).max(axis=0)
    feet = [name.endswith(("ankle", "foot")) for name in body.skeleton.names]
    assert away[np.logical_not(feet)].max() < 5.0
    # The slope of the feet is 26.6 degrees, while the estimate assumes 30.
    assert away[feet].max() < 15.0


def test_limbs_that_never_bend_are_reported(body):
    motion = twin(arbitrary(), starts_in_t_pose=False)
    stiff = motion.clip.rotations.copy()
    axes, joint = arbitrary(), NAMES.index("LeftForeArm")
    stiff[:, joint] = matrix_to_quaternion(axes[PARENTS[joint]].T @ axes[joint])
    motion = replace(motion, clip=replace(motion.clip, rotations=stiff))
    _, notes = posed(body, motion)
    assert notes[1:] == [("F007.rest-straight", {"motion": "twin", "names": ["LeftForeArm"]})]


def test_motion_of_the_same_skeleton_keeps_its_rest_pose():
    motion = twin(along_x())
    found = retarget(motion, motion.figure, source_rest="auto")
    clip, notes = found.clip, found.notes
    assert not [key for key, _ in told(notes) if ".rest-" in key]
    same = np.abs(np.einsum("nja,nja->nj", clip.rotations, motion.clip.rotations))
    np.testing.assert_allclose(same, 1.0, atol=1e-12)


def test_rest_pose_of_an_upside_down_file_is_estimated(body):
    # The same person in a file whose up axis points down: z-up axes, standing along -z.
    motion = twin(along_x(), starts_in_t_pose=False)
    over = matrix_to_quaternion(matrices(np.array([[-np.pi / 2.0, 0.0, 0.0]])))[0]
    rotations = motion.clip.rotations.copy()
    rotations[:, 0] = multiply(np.tile(over, (N_FRAMES, 1)), rotations[:, 0])
    clip = replace(motion.clip, rotations=rotations, translations=None)
    turned = replace(motion, clip=clip, figure=replace(motion.figure, up="z"))
    found, notes = posed(body, turned)
    assert [key for key, _ in notes] == ["F007.rest-anatomy"]
    # In the common y-up axes, the person hangs upside down and faces the other way.
    expected, _ = posed(body, twin(t_pose(), starts_in_t_pose=False), "zero")
    flip = np.diag([1.0, -1.0, -1.0])
    assert degrees(found, flip @ expected[..., :3, :3]).max() < 5.0


@pytest.mark.parametrize("starts_in_t_pose", [True, False])
def test_rest_pose_of_files_with_z_up_is_estimated(body, starts_in_t_pose):
    motion = twin(along_x(), starts_in_t_pose)
    raised = matrix_to_quaternion(matrices(np.array([[np.pi / 2.0, 0.0, 0.0]])))
    rotations = motion.clip.rotations.copy()
    rotations[:, 0] = multiply(np.tile(raised, (N_FRAMES, 1)), rotations[:, 0])
    clip = replace(motion.clip, rotations=rotations, translations=None)
    turned = replace(motion, clip=clip, figure=replace(motion.figure, up="z"))
    found, _ = posed(body, turned)
    expected, _ = posed(body, twin(t_pose(), starts_in_t_pose), "zero")
    assert degrees(found, expected).max() < 5.0


@pytest.mark.parametrize("stands", [False, True])
def test_figures_bound_in_another_pose_are_driven_from_their_t_or_a_pose(stands):
    source, figure = moving(figure_of(HIK, "mocap")), figure_of(BODY, "body")
    vectors = np.zeros((len(BODY), 3))
    # A runner who looks down: the right arm and the left leg are ahead, and the head is bowed.
    for name, angle in (("right_shoulder", -1.2), ("left_hip", -0.9), ("head", 0.6)):
        vectors[list(BODY).index(name), 0] = 0.0 if stands else angle
    vectors[list(BODY).index("neck"), 0] = 0.3
    bound = replace(figure.skeleton, rest_rotations=quaternions(vectors))
    posed = replace(figure, skeleton=bound)
    drive = Drive(source, plants_feet=False, keeps_hands=False)
    (straight_clip, _), (clip, notes) = (driven_clip(drive, each) for each in (figure, posed))
    wanted, found = straight_clip.rotations, clip.rotations
    assert ("F007.rest-figure" in {note.key for note in notes}) == (not stands)
    same = np.abs(np.einsum("nja,nja->nj", found, wanted))
    straight, shown = (aligned_rests(drive, each)[1] for each in (figure, posed))
    assert np.allclose(shown, straight, rtol=0, atol=1e-9) == (not stands)
    if stands:
        # The neck is bound as the mesh has it, and so it stays.
        assert same[0].min() == pytest.approx(np.cos(0.15), abs=1e-12)
    else:
        assert_allclose(same, 1.0, atol=1e-12)


@pytest.mark.parametrize("stands", [True, False])
def test_angles_of_a_rest_pose_that_stands_are_part_of_it(stands):
    # A skeleton may state its rest pose by quaternions, as in glTF, or by DOFs, as in .skel.
    source, figure = moving(figure_of(HIK, "mocap")), figure_of(BODY, "body")
    skeleton, names = figure.skeleton, list(BODY)
    dofs, vectors = np.zeros(skeleton.n_dofs), np.zeros((len(names), 3))
    for name, axis, angle in (("neck", 0, 0.7), ("left_elbow", 1, -0.5), ("right_hip", 0, -0.2)):
        joint = names.index(name)
        angle *= 1.0 if stands or name != "right_hip" else 6.0
        vectors[joint, axis] = angle if stands else 0.0
        rows = (skeleton.dof_joints == joint) & (skeleton.dof_kinds == FIRST_ROTATION + axis)
        dofs[rows] = angle
    drive = Drive(source, plants_feet=False, keeps_hands=False)
    wanted, found = (
        driven_clip(drive, replace(figure, skeleton=replace(skeleton, **rest)))[0]
        for rest in ({"rest_rotations": quaternions(vectors)}, {"rest_dofs": dofs})
    )
    assert_allclose(np.abs((found.rotations * wanted.rotations).sum(axis=2)), 1.0, atol=1e-12)
    assert_allclose(found.translations, wanted.translations, atol=1e-12)
