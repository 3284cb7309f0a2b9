"""The complete rigging pipeline on targets with a known rig."""

from dataclasses import replace

import numpy as np
import pytest
from autorig.rigged_shapes import arm, mesh_of, turn
from faults import told
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from viewer.autorig.alignment.surface_alignment import AlignmentSettings
from viewer.autorig.checks import check_lines
from viewer.autorig.pipeline import transfer
from viewer.autorig.rigged import clip_for, start_of_clips
from viewer.autorig.settings import METHODS, TransferSettings
from viewer.errors import RigError
from viewer.loading import bundled_body, load
from viewer.progress import Cancelled, receiving
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.geometry.rotation import matrix_to_quaternion
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.pose import rest_pose
from viewer.rigs.scene import Actor, pose_actors
from viewer.rigs.skin import skin_from_entries
from viewer.rigs.skinning import deform, joint_matrices

pytestmark = pytest.mark.slow

# With an eighth of the usual number of points, the search is much faster.
QUICK = TransferSettings(alignment=AlignmentSettings(samples=125))
ROTATION = turn([0.1, 1, 0.2], 2.0)
MOVE = np.array([3.0, -4.0, 5.0])


def bent_arm():
    figure = arm()
    pose = rest_pose(figure.skeleton)
    pose.dofs[6:] = 0.2, -0.1, 0.7
    return figure, pose


def moved(figure, pose, scale=30.0):
    positions = scale * deform(figure, pose)[0] @ ROTATION.T + MOVE
    return mesh_of(positions, figure.mesh.triangles)


def again(rigged):
    return apply_transform(rigged.placement, deform(rigged.figure, rigged.pose)[0])


@pytest.fixture(scope="module")
def transferred():
    figure, pose = bent_arm()
    target = moved(figure, pose)
    return figure, pose, target, transfer(figure, pose, target, QUICK, name="scan")


def test_template_mesh_as_target_gets_the_rig_of_the_template(transferred):
    figure, _, _, rigged = transferred
    size = 30.0 * 2.4
    assert_allclose(rigged.figure.mesh.positions, 30.0 * figure.mesh.positions, atol=1e-6 * size)
    assert_allclose(
        np.linalg.inv(rigged.figure.skin.inverse_bind)[:, :3, 3],
        [[0, 0, 0], [0, 30, 0]],
        atol=1e-6 * size,
    )
    dense = np.zeros((figure.mesh.n_vertices, 2))
    skin = rigged.figure.skin
    np.add.at(dense, (np.repeat(np.arange(len(dense)), np.diff(skin.starts)), skin.joints),
              skin.weights)  # fmt: skip
    fraction = np.clip((figure.mesh.positions[:, 1] - 0.8) / 0.4, 0.0, 1.0)
    assert_allclose(dense[:, 1], fraction, atol=1e-6)


def test_rigged_result_reproduces_the_target_pose(transferred):
    _, _, target, rigged = transferred
    assert_allclose(again(rigged), target.positions, atol=1e-10)
    assert rigged.residual < 1e-12
    assert rigged.weights.matched.all() and not rigged.guarded.any()
    assert rigged.confidence.tolist() == [0] * target.n_vertices


def test_rigged_figure_is_at_rest_in_the_pose_of_the_target(transferred):
    _, _, target, rigged = transferred
    found = figure_pose(rigged.figure)
    assert_allclose(found.dofs[6:], [0.2, -0.1, 0.7], atol=1e-6)
    at_rest = deform(rigged.figure, found)[0]
    # Of the rotation, only what is not from axis to axis is part of the rest pose: a quarter turn
    # about y is nearest to 2 radians.
    quarter = turn([0, 1, 0], np.pi / 2)
    middle = target.positions.mean(axis=0)
    expected = (target.positions - middle) @ quarter
    assert_allclose(at_rest - at_rest.mean(axis=0), expected, atol=1e-10)


def test_pose_beyond_limits_widens_them():
    figure, pose = bent_arm()
    tight = np.where(np.arange(9)[:, None] < 6, [-np.inf, np.inf], [-0.1, 0.1])
    limited = replace(figure, skeleton=replace(figure.skeleton, dof_limits=tight))
    still = AlignmentSettings(matrix=np.eye(4))
    target = mesh_of(deform(figure, pose)[0], figure.mesh.triangles)
    rigged = transfer(limited, pose, target, TransferSettings(alignment=still, fits=False))
    assert_allclose(
        rigged.figure.skeleton.dof_limits[6:], [[-0.1, 0.2], [-0.1, 0.1], [-0.1, 0.7]], atol=1e-6
    )
    assert_allclose(figure_pose(rigged.figure).dofs, rigged.pose.dofs, atol=0)


def test_frames_of_a_template_whose_joints_are_displaced_are_transferred():
    figure, pose = bent_arm()
    pose.translations[:] = [0.3, 0.1, 0.0], [0.0, 0.2, 0.1]
    target = mesh_of(deform(figure, pose)[0], figure.mesh.triangles)
    still = AlignmentSettings(matrix=np.eye(4))
    rigged = transfer(figure, pose, target, TransferSettings(alignment=still, fits=False))
    rotations = matrix_to_quaternion(np.stack([turn([1, 0, 0], 0.3), turn([0, 0, 1], 0.6)]))
    for moves in (None, np.array([[[0.1, 0.0, 0.2], [0.0, -0.1, 0.0]]])):
        clip = SampledClip("one", Timing(30.0, np.arange(1)), rotations[None], translations=moves)
        one = Actor(figure, clip=clip)
        other = Actor(rigged.figure, start_of_clips(rigged), clip_for(rigged, clip))
        pose_actors([one, other], 0.0)
        expected = deform(figure, one.pose)[0]
        assert_allclose(deform(rigged.figure, other.pose)[0], expected, atol=1e-4)


def test_target_is_not_modified_and_keeps_its_texture_coordinates(transferred):
    figure, pose, target, _ = transferred
    uvs = np.random.default_rng(2).random((target.n_vertices, 2))
    with_uvs = replace(target, uvs=uvs)
    rigged = transfer(figure, pose, with_uvs, QUICK)
    assert (rigged.figure.mesh.uvs == uvs).all()
    assert (rigged.figure.mesh.triangles == target.triangles).all()


def test_inside_out_target_is_flipped_in_the_result(transferred):
    figure, pose, target, rigged = transferred
    backwards = mesh_of(target.positions, target.triangles[:, ::-1])
    found = transfer(figure, pose, backwards, QUICK)
    assert (found.figure.mesh.triangles == target.triangles).all()
    assert_allclose(found.figure.mesh.normals, rigged.figure.mesh.normals, atol=1e-6)
    assert_allclose(again(found), target.positions, atol=1e-10)
    count = target.n_triangles
    wound = ("R014.wound", {"n": count})
    assert wound in told(found.lines) and wound not in told(rigged.lines)


@pytest.mark.parametrize(
    ("scale", "unit", "line"),
    [
        (1.2, "m", ("R014.unit", {"unit": "metres"})),
        (1000.0, "mm", ("R014.unit", {"unit": "millimetres"})),
        (30.0, "", ("R014.unit-unknown", {})),
    ],
)
def test_unit_is_inferred_from_size(scale, unit, line):
    figure, pose = bent_arm()
    rigged = transfer(replace(figure, unit="m"), pose, moved(figure, pose, scale), QUICK)
    assert rigged.figure.unit == unit
    assert line in told(rigged.lines)


def test_clip_of_the_template_is_transferred(transferred):
    figure, _, _, rigged = transferred
    times = np.array([0.0, 1.0])
    linear = (("linear", "linear"),) * 2
    rows = [(0, 0.5), (4, 0.8), (8, -1.1)]
    channels = tuple(Channel(dof, times, np.array([0.0, value]), linear) for dof, value in rows)
    clip = Clip("wave", channels, 0.0, 1.0)
    one = Actor(figure, clip=clip)
    other = Actor(rigged.figure, start_of_clips(rigged), clip_for(rigged, clip))
    for actor in (one, other):
        pose_actors([actor], 0.6)
    expected = 30.0 * deform(figure, one.pose)[0]
    assert_allclose(deform(rigged.figure, other.pose)[0], expected, atol=1e-4)


def test_scale_and_placement_of_the_template_pose_are_transferred():
    figure, pose = bent_arm()
    pose.figure_scale = 3.0
    pose.figure_translation[:] = 1.0, 2.0, 3.0
    rigged = transfer(figure, pose, moved(figure, pose, scale=1.0), QUICK)
    assert_allclose(rigged.figure.mesh.positions, 3.0 * figure.mesh.positions, atol=1e-5)
    assert (rigged.figure_scale, rigged.length_scale) == (3.0, pytest.approx(1.0))


def test_body_correctives_are_transferred():
    actor = load(bundled_body()).actors[0]
    figure, pose = actor.figure, actor.pose
    names = figure.skeleton.names
    pose.dofs[3 * names.index("right_knee")] = 1.0
    target = mesh_of(2.0 * deform(figure, pose)[0], figure.mesh.triangles)
    still = AlignmentSettings(matrix=np.diag([2.0, 2.0, 2.0, 1.0]))
    how = TransferSettings(alignment=still, fits=False)
    rigged = transfer(figure, pose, target, how)
    assert rigged.residual < 1e-12
    # The rest pose is that of the body, without the bulges of the bent knee.
    assert_allclose(rigged.figure.mesh.positions, 2.0 * figure.mesh.positions, atol=1e-6)
    other = rest_pose(figure.skeleton)
    other.dofs[3 * names.index("left_elbow") + 1] = -1.5
    assert_allclose(deform(rigged.figure, other)[0], 2.0 * deform(figure, other)[0], atol=1e-6)
    plain = transfer(figure, pose, target, replace(how, correctives=False))
    assert plain.figure.correctives is None and plain.residual < 1e-12
    assert ("R013.correctives", {}) in told(plain.lines)
    assert ("R013.shapes", {"n": 10}) in told(plain.lines)


def test_joints_follow_the_surface_and_copied_joints_do_not():
    # Without alignment the target is offset by 0.1. Closest points measure the component normal to
    # the surface, which is about half, because cos^2 around a section has the mean 1 / 2.
    figure, pose = arm(), rest_pose(arm().skeleton)
    target = mesh_of(figure.mesh.positions + np.array([0.1, 0, 0]), figure.mesh.triangles)
    still = AlignmentSettings(matrix=np.eye(4))
    places = {}
    for joints in ("surface", "alignment"):
        how = TransferSettings(alignment=still, joints=joints, fits=False)
        rigged = transfer(figure, pose, target, how)
        bound = np.linalg.inv(rigged.figure.skin.inverse_bind)[1, :3, 3]
        places[joints] = bound + rigged.pose.figure_translation
        assert rigged.residual < 1e-12
    assert 0.02 < places["surface"][0] < 0.08
    assert_allclose(places["alignment"], [0, 1, 0], atol=1e-12)


def test_nearest_method_uses_weights_of_the_nearest_vertex():
    figure, pose = bent_arm()
    stretch, shift = np.array([4.0, 2.0, 3.0]), np.array([1.0, 0, 0])
    posed = deform(figure, pose)[0]
    target = mesh_of(posed * stretch + shift, figure.mesh.triangles)
    rigged = transfer(figure, pose, target, TransferSettings(method="nearest"))
    # Boxes undo the stretch, so vertices match themselves, and inverse skinning returns the
    # template.
    assert_allclose(rigged.figure.mesh.positions, figure.mesh.positions, atol=1e-10)
    assert rigged.figure.skin.weights.tolist() == figure.skin.weights.tolist()
    assert_allclose(np.diag(rigged.placement), [4.0, 2.0, 3.0, 1.0])
    assert_allclose(again(rigged), target.positions, atol=1e-10)
    joints = rigged.figure.skeleton
    assert_allclose(joints.rest_translations, figure.skeleton.rest_translations, atol=0)
    assert_allclose(joints.rest_dofs, pose.dofs, atol=0)
    assert rigged.lines[0].key == "R001.boxes"
    assert rigged.lines[0].values == pytest.approx({"x": 0.25, "y": 0.5, "z": 1.0 / 3.0})


def test_progress_increases_to_1_and_may_cancel():
    figure, pose = bent_arm()
    steps = []
    target = moved(figure, pose)
    with receiving(lambda done, total, unit, what: steps.append((done / total, what))):
        transfer(figure, pose, target, QUICK)
    fractions = [fraction for fraction, _ in steps]
    assert fractions == sorted(fractions) and fractions[0] == 0.0 and steps[-1] == (1.0, "done")

    def stop(done, total, unit, what):
        if what == "placing the joints":
            raise Cancelled

    still = TransferSettings(alignment=AlignmentSettings(matrix=np.eye(4)), fits=False)
    with pytest.raises(Cancelled), receiving(stop):
        transfer(figure, pose, figure.mesh, still)


def test_joint_outside_the_target_is_reported():
    # The template is closed and solid; the target is two flat shells far from the axis.
    figure, pose = arm(), rest_pose(arm().skeleton)
    still = AlignmentSettings(matrix=np.eye(4))
    side = figure.mesh.positions[figure.mesh.triangles][:, :, 0].mean(axis=1) > 0.1
    target = mesh_of(figure.mesh.positions, figure.mesh.triangles[side])
    rigged = transfer(figure, pose, target, TransferSettings(alignment=still, joints="alignment"))
    assert rigged.outside == (0, 1)
    (outside,) = [line for line in rigged.lines if line.code == "R009"]
    assert outside.places.tolist() == [0, 1] and outside.values == {"names": ["base", "tip"]}
    assert outside.labelled == "warning: joints outside the mesh: base, tip"


def test_weights_that_tear_when_a_joint_rotates_are_reported():
    figure, kept = arm(), np.zeros(arm().mesh.n_vertices, dtype=bool)

    def torn():
        lines = check_lines(figure, rest_pose(figure.skeleton), kept, (), 0.0)
        return [line for line in lines if line.code == "R018"]

    # The joints blend over four rings around the second one, which is at y = 1.
    assert not torn()
    # A step between the rings at 1.7 and 1.8.
    beyond = figure.mesh.positions[:, 1] > 1.75
    every = np.arange(len(beyond))
    skin = skin_from_entries(
        len(beyond), every, beyond.astype(int), np.ones(len(beyond)), figure.skin.inverse_bind
    )
    figure = replace(figure, skin=skin)
    (line,) = torn()
    assert line.labelled.startswith("warning: the mesh may tear when tip rotates: at 60°, vertices")
    assert_allclose(figure.mesh.positions[line.places, 1].min(), 1.7)
    assert_allclose(figure.mesh.positions[line.places, 1].max(), 1.8)
    ends, pulled = [line.values["one"], line.values["other"]], []
    offset = np.diff(figure.mesh.positions[ends], axis=0)
    for angle in np.linspace(0.0, np.pi, 30):
        pose = rest_pose(figure.skeleton)
        # Rotation by 60 degrees about horizontal axes: angles about x, then y, then z.
        axis = [np.cos(angle), 0.0, np.sin(angle)]
        pose.dofs[6:] = Rotation.from_rotvec(np.pi / 3 * np.array(axis)).as_euler("xyz")
        there = deform(figure, pose)[0][ends]
        pulled.append(np.linalg.norm(np.diff(there, axis=0) - offset))
    size = np.linalg.norm(np.ptp(figure.mesh.positions, axis=0))
    # The joint's distance from the middle of the edge stands for that from its ends.
    assert line.values["gap"] == pytest.approx(max(pulled) / size, rel=0.1)


@pytest.mark.parametrize(
    ("part", "found"),
    [("skin", "mesh and skeleton"), ("mesh", "skeleton"), ("skeleton", "mesh and skin")],
)
def test_template_without_a_rig_is_refused(part, found):
    figure, pose = bent_arm()
    lacking = replace(figure, **{part: None, "skin": None if part == "mesh" else figure.skin}
                      if part != "skin" else {"skin": None})  # fmt: skip
    with pytest.raises(RigError) as problem:
        transfer(lacking, pose, figure.mesh)
    assert str(problem.value) == (
        f"arm: expected a template with mesh, skeleton and skin, found {found}"
    )


def test_target_without_triangles_is_refused():
    figure, pose = bent_arm()
    with pytest.raises(RigError) as problem:
        transfer(figure, pose, mesh_of(np.zeros((3, 3)), np.zeros((0, 3))))
    assert str(problem.value) == "expected a target with triangles, found none"


@pytest.mark.parametrize("method", ["robust", "heat"])
def test_target_with_huge_coordinates_is_refused(method):
    figure, pose = bent_arm()
    huge = replace(figure.mesh, positions=1e30 * figure.mesh.positions)
    with pytest.raises(RigError) as problem:
        transfer(figure, pose, huge, TransferSettings(method=method))
    largest = float(np.abs(huge.positions).max())
    assert str(problem.value) == (
        f"expected a target with coordinates up to 1e+09, found {largest:.3g}; scale the mesh, or "
        "delete what is so far away"
    )


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"method": "best"}, f'method: expected {" or ".join(METHODS)}, found "best"'),
        ({"joints": "none"}, 'joints: expected surface or alignment, found "none"'),
    ],
)
def test_unknown_settings_are_refused(settings, message):
    with pytest.raises(RigError) as problem:
        TransferSettings(**settings)
    assert str(problem.value) == message


def test_rigged_figure_is_complete(transferred):
    *_, rigged = transferred
    assert isinstance(rigged.figure, Figure) and rigged.figure.name == "scan"
    assert rigged.figure.is_attached and rigged.figure.up == "y"
    assert rigged.figure.facts == (("rig", "transferred from arm"),)


def test_joints_are_where_their_landmarks_are_in_the_target():
    # The closest points of the bent arm place the joints elsewhere: the landmarks decide.
    figure, pose = bent_arm()
    target = moved(figure, pose)
    rest = rest_pose(figure.skeleton)
    own = joint_matrices(figure, rest)[:, :3, 3]
    wanted = 30.0 * joint_matrices(figure, pose)[:, :3, 3] @ ROTATION.T + MOVE + [0.0, 0.4, -0.3]
    end = figure.mesh.positions[-1]
    placed = 30.0 * deform(figure, pose)[0][-1] @ ROTATION.T + MOVE
    pairs = np.stack([np.stack([*own, end]), np.stack([*wanted, placed])], axis=1)
    how = TransferSettings(alignment=AlignmentSettings(landmarks=pairs, samples=100))
    rigged = transfer(figure, rest, target, how)
    found = joint_matrices(rigged.figure, rigged.pose)[:, :3, 3]
    assert_allclose(found, wanted, atol=1e-6 * 72.0)
    # The rig still reproduces the mesh.
    assert_allclose(again(rigged), target.positions, atol=1e-6 * 72.0)
    with pytest.raises(RigError, match="expected 3 or more pairs, as no limbs were found, found 2"):
        few = AlignmentSettings(landmarks=pairs[:2], samples=100)
        transfer(figure, rest, target, TransferSettings(alignment=few))


def test_joint_that_a_landmark_places_outside_the_target_is_reported():
    # Nothing of the target is around the joint, so its surface says nothing about the joint.
    figure, rest = arm(), rest_pose(arm().skeleton)
    own = joint_matrices(figure, rest)[:, :3, 3]
    ends = figure.mesh.positions[[0, 1, 2, -1]]
    pairs = np.stack([np.stack([*own, *ends])] * 2, axis=1)
    for away, expected in ((0.0, ()), (1.5, (1,))):
        pairs[1, 1] = own[1] + [away, 0.0, 0.0]
        how = TransferSettings(alignment=AlignmentSettings(landmarks=pairs, samples=100))
        assert transfer(figure, rest, figure.mesh, how).outside == expected


def test_mesh_with_z_up_gets_the_same_figure_and_a_placement():
    figure, pose = bent_arm()
    positions = deform(figure, pose)[0] + MOVE
    # (x, y, z) with y up is (x, -z, y) with z up.
    to_z = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    place = np.eye(4)
    place[:3, 3] = MOVE
    turned = np.eye(4)
    turned[:3, :3] = to_z
    results = []
    for up, matrix in (("y", place), ("z", turned @ place)):
        target = mesh_of(positions @ matrix[:3, :3].T, figure.mesh.triangles)
        how = TransferSettings(alignment=AlignmentSettings(matrix=matrix, up=up))
        rigged = transfer(figure, pose, target, how, name="scan")
        assert_allclose(again(rigged), target.positions, atol=1e-9)  # rounding
        results.append(rigged)
    standing, other = results
    assert other.figure.up == "y"
    assert_allclose(standing.placement, np.eye(4))
    assert_allclose(other.placement, turned)
    for chosen in (lambda rigged: rigged.pose, start_of_clips):
        expected = deform(standing.figure, chosen(standing))[0]
        assert_allclose(deform(other.figure, chosen(other))[0], expected, atol=1e-6)


def test_figure_that_lies_in_its_mesh_is_reported():
    figure, pose = bent_arm()
    positions = deform(figure, pose)[0] @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]).T
    marks = np.stack([deform(figure, pose)[0], positions], axis=1)[::7]
    how = TransferSettings(alignment=AlignmentSettings(landmarks=marks))
    rigged = transfer(figure, pose, mesh_of(positions, figure.mesh.triangles), how)
    (said,) = [line for line in rigged.lines if line.key.startswith("R002.lying")]
    assert said.values["up"] == "z"
    assert_allclose(again(rigged), positions, atol=1e-6)
    stated = TransferSettings(alignment=AlignmentSettings(landmarks=marks, up="z"))
    rigged = transfer(figure, pose, mesh_of(positions, figure.mesh.triangles), stated)
    assert not [line for line in rigged.lines if line.key.startswith("R002.lying")]
