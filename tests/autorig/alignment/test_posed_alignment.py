"""Alignment with pose and proportions: people with lowered arms, of other sizes, facing away."""

import re
from dataclasses import replace

import numpy as np
import pytest
from autorig.rigged_shapes import arm, mesh_of
from numpy.testing import assert_allclose

from viewer.autorig.alignment import pose_fit, posed_alignment
from viewer.autorig.alignment.anatomy_fit import FADED, start_of_landmarks
from viewer.autorig.alignment.icp import Cloud, Triangles
from viewer.autorig.alignment.pose_fit import Fitted
from viewer.autorig.alignment.posed_alignment import PosedAlignment, align_posed
from viewer.autorig.alignment.proportions import limbs_of, resized
from viewer.autorig.alignment.similarity import Similarity
from viewer.autorig.alignment.surface_alignment import Alignment, AlignmentSettings
from viewer.loading import bundled_body, load
from viewer.progress import Cancelled, receiving
from viewer.rigs.geometry.samples import sample_surface
from viewer.rigs.pose import rest_pose
from viewer.rigs.skinning import deform, joint_matrices

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("quick_fits")]

LANDMARKS = np.array([[[0, 0, 0]] * 2, [[1, 0, 0]] * 2, [[0, 0, 1]] * 2], dtype=float)


def aligned(figure, target, fits=True, **settings):
    pose = rest_pose(figure.skeleton)
    return align_posed(figure, pose, target, AlignmentSettings(**settings), fits), pose


@pytest.fixture(scope="module")
def standing():
    """The bundled body with lowered arms and longer legs, facing -z."""
    figure = load(bundled_body()).actors[0].figure
    pose = rest_pose(figure.skeleton)
    names = figure.skeleton.names
    for side, sign in (("left", -1.0), ("right", 1.0)):
        pose.dofs[3 * names.index(f"{side}_shoulder") + 2] = sign * 0.8
    pose.shape_weights = np.zeros(figure.n_shapes)
    pose.shape_weights[figure.blend_shapes.names.index("leg length")] = 2.0
    half_turn = np.array([-1.0, 1.0, -1.0])
    positions = deform(figure, pose)[0] * half_turn
    return (
        figure,
        mesh_of(positions, figure.mesh.triangles),
        joint_matrices(figure, pose)[:, :3, 3] * half_turn,
    )


def test_person_with_lowered_arms_facing_away_is_aligned(standing):
    figure, target, joints = standing
    found, pose = aligned(figure, target)
    assert found.alignment.how == "fit"
    assert_allclose(found.alignment.similarity.rotation @ [0, 0, 1], [0, 0, -1], atol=0.1)
    size = np.linalg.norm(np.ptp(target.positions, axis=0))
    on_target = found.alignment.similarity.apply(found.positions)
    assert np.linalg.norm(on_target - target.positions, axis=1).mean() < 0.01 * size
    places = found.alignment.similarity.apply(joint_matrices(found.figure, found.pose)[:, :3, 3])
    assert np.linalg.norm(places - joints, axis=1).max() < 0.02 * size
    assert found.figure.mesh is not figure.mesh and found.pose is not pose
    assert len(found.lines) == 2
    assert found.lines[0].key == "R003.pose"


def test_person_with_an_inside_out_mesh_is_aligned(standing):
    figure, target, joints = standing
    found, _ = aligned(figure, mesh_of(target.positions, target.triangles[:, ::-1]))
    assert found.alignment.how == "fit"
    size = np.linalg.norm(np.ptp(target.positions, axis=0))
    places = found.alignment.similarity.apply(joint_matrices(found.figure, found.pose)[:, :3, 3])
    assert np.linalg.norm(places - joints, axis=1).max() < 0.02 * size


def test_given_front_is_kept(standing):
    figure, target, _ = standing
    found, _ = aligned(figure, target, facing="z")
    assert (found.alignment.similarity.rotation @ [0, 0, 1])[2] > 0.9


def test_template_is_not_posed_if_disabled(standing):
    figure, target, _ = standing
    found, pose = aligned(figure, target, fits=False)
    assert found.pose is pose and found.figure is figure and found.lines == ()


def test_template_that_already_fits_is_not_posed():
    figure = arm()
    found, pose = aligned(figure, figure.mesh)
    assert found.pose is pose and found.figure is figure and found.lines == ()
    assert found.alignment.how == "in place"


def test_uniformly_offset_shell_is_not_fitted():
    figure = arm()
    shell = mesh_of(figure.mesh.positions + 0.03 * figure.mesh.normals, figure.mesh.triangles)
    found, pose = aligned(figure, shell)
    assert found.pose is pose and found.figure is figure
    assert (found.alignment.similarity.matrix == np.eye(4)).all()


def test_axis_scales_keep_the_pose():
    figure = arm()
    pose = rest_pose(figure.skeleton)
    pose.dofs[6:] = 0.0, 0.0, 0.8
    target = mesh_of(deform(figure, pose)[0] * [1.2, 1.0, 0.9], figure.mesh.triangles)
    found, own = aligned(figure, target, scale="axes")
    assert found.pose is own and found.figure is figure


def test_stretched_figure_is_found_without_being_asked_for(standing):
    figure = standing[0]
    factors = np.array([1.3, 1.0, 0.8])
    target = mesh_of(figure.mesh.positions * factors, figure.mesh.triangles)
    found, pose = aligned(figure, target)
    assert found.pose is pose and found.figure is figure and found.alignment.how == "fit"
    assert_allclose(found.alignment.similarity.linear, np.diag(factors), atol=0.003)


def test_known_scales_are_not_searched():
    figure = load(bundled_body()).actors[0].figure
    target = mesh_of(figure.mesh.positions * [1.3, 1.0, 0.8], figure.mesh.triangles)
    asked, _ = aligned(figure, target, fits=False, scale="axes")
    assert asked.lines == ()
    assert_allclose(asked.alignment.similarity.linear, np.diag([1.3, 1.0, 0.8]), atol=0.003)
    known, _ = aligned(figure, target, fits=False, scale="none")
    assert known.lines == ()


def test_long_arms_and_wide_hips_that_were_found_are_kept(monkeypatch):
    monkeypatch.setattr(pose_fit, "_VERTICES", 150)
    monkeypatch.setattr(pose_fit, "_ROUNDS", 18)
    figure, factors = load(bundled_body()).actors[0].figure, np.array([1.2, 1.0, 0.9])
    pose = rest_pose(figure.skeleton)
    posed = deform(figure, pose)[0]
    target, triangles = posed * factors, figure.mesh.triangles
    exact = Triangles(target, triangles, 60)
    cloud = Cloud(exact.samples, sample_surface(target, triangles, 360))
    job = posed_alignment._Job(figure, pose, cloud, exact, True, AlignmentSettings(samples=60))
    joints = joint_matrices(figure, pose)[:, :3, 3]
    known = np.stack([joints, joints * factors], axis=1)
    still = Similarity(1.0, np.eye(3), np.zeros(3), np.ones(3))
    marked, start, marks = start_of_landmarks(figure, pose, posed, known, still)
    # As estimates from the anatomy, they are not known to be exact.
    marks = replace(marks, kept=np.full(len(joints), FADED))
    percents = []
    with receiving(lambda done, *_: percents.append(done)):
        found = posed_alignment._fitted_marks(job, marked, start, marks)
    assert percents == sorted(percents) and percents[-1] > 80
    places = found.alignment.similarity.apply(joint_matrices(found.figure, found.pose)[:, :3, 3])
    # 1.3 % apart if all that the surface does not show is as in the template again.
    size = np.ptp(target, axis=0).max()
    assert np.linalg.norm(places - joints * factors, axis=1).mean() < 0.009 * size


def test_limbs_of_wrong_lengths_do_not_spoil_a_fit_at_the_right_place(standing):
    figure, target, joints = standing
    exact = Triangles(target.positions, target.triangles, 125)
    cloud = Cloud(exact.samples, sample_surface(target.positions, target.triangles, 750))
    pose, names = rest_pose(figure.skeleton), figure.skeleton.names
    job = posed_alignment._Job(figure, pose, cloud, exact, True, AlignmentSettings(samples=125))
    # Facing as the target does, upright and not far away, but with half of its thighs and arms.
    lengths, ones = np.ones(len(names)), np.ones(len(names))
    lengths[[i for i, name in enumerate(names) if name.endswith(("_hip", "_elbow"))]] = 0.5
    short = resized(figure, limbs_of(figure), lengths, ones)
    place = Similarity(1.1, np.diag([-1.0, 1.0, -1.0]), np.array([0.03, -0.1, 0.02]), np.ones(3))
    posed = deform(short, pose)[0]
    alignment = Alignment.of(Triangles(posed, short.mesh.triangles, 125), exact, place, "fit")
    wrong = PosedAlignment(alignment, short, pose, posed, ())
    found = posed_alignment._or_in_given_pose(job, wrong)
    size = np.linalg.norm(np.ptp(target.positions, axis=0))
    places = found.alignment.similarity.apply(joint_matrices(found.figure, found.pose)[:, :3, 3])
    assert np.linalg.norm(places - joints, axis=1).max() < 0.02 * size
    # A close one stays as it is.
    assert posed_alignment._or_in_given_pose(job, found) is found


@pytest.mark.parametrize(
    ("gap", "bend", "is_better"),
    [
        (0.019, 0.2, True),  # 0.95 of the gap, 2/3 of the bend: 0.63 together
        (0.019, 0.21, False),  # 0.665, which is more than 0.65
        (0.019, 0.3, False),
        (0.012, 0.4, True),  # 0.6 of the gap
        (0.021, 0.1, False),  # not closer
    ],
)
def test_fit_in_the_given_pose_is_better_if_it_is_much_closer_or_straighter(
    monkeypatch, gap, bend, is_better
):
    def fit(gap, bend):
        return PosedAlignment(gap, None, None, None, (), bend=bend)

    found, plain = fit(0.02, 0.3), fit(gap, bend)
    monkeypatch.setattr(posed_alignment, "misfit", lambda alignment, is_part: alignment)
    monkeypatch.setattr(posed_alignment, "_in_given_pose", lambda job, fit: fit)
    monkeypatch.setattr(posed_alignment, "_fitted", lambda job, start: plain)
    expected = plain if is_better else found
    assert posed_alignment._or_in_given_pose(None, found) is expected


def bent(angle):
    figure = arm()
    pose = rest_pose(figure.skeleton)
    pose.dofs[8] = angle
    return figure, pose, mesh_of(deform(figure, pose)[0], figure.mesh.triangles)


def fit_of(figure, pose, angle):
    """Return the result of a fit that stopped after rotating the tip by an angle."""
    rotated = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, angle]])
    similarity = Similarity(1.0, np.eye(3), np.zeros(3), np.ones(3))
    return Fitted(figure, pose, similarity, rotated, np.zeros((2, 2)))


@pytest.mark.parametrize(
    ("target", "reached", "lines"),
    [
        (1.5, 1.38, ("warning: pose: not fitted, because tip would rotate by 79 degrees and a gap "
                     "of G % of the size (G % before) would remain; use a template "
                     "of the same kind as the target",)),
        (0.9, 0.7, ("pose: template joints rotated to fit, by up to 40 degrees (tip); limb lengths "
                    "changed by up to +0 % (base)",
                    "warning: poor fit: a gap of G % of the size (G % before); use a "
                    "template of "
                    "the same kind as the target")),
        (1.5, 1.5, ("pose: template joints rotated to fit, by up to 86 degrees (tip); limb lengths "
                    "changed by up to +0 % (base)",
                    "result: a gap of G % of the size (G % before)")),
        (1.5, 0.1, ("pose: not fitted, because a gap of G % of the size (G % before) would "
                    "remain",)),
    ],
)  # fmt: skip
def test_poor_fit_is_flagged_or_rejected(monkeypatch, target, reached, lines):
    figure, _, mesh = bent(target)
    half = bent(reached)[1]
    monkeypatch.setattr(posed_alignment, "fit_pose", lambda *_, **__: fit_of(figure, half, reached))
    how = {"landmarks": LANDMARKS, "keeps_landmarks": False, "refines": False, "samples": 250}
    found, own = aligned(figure, mesh, **how)
    assert tuple(re.sub(r"\d+\.\d+", "G", line.labelled) for line in found.lines) == lines
    assert (found.pose is own) == ("not fitted" in lines[0])


def test_progress_increases_and_cancels():
    figure, _, target = bent(1.5)

    fractions = []

    def receive(done, total, unit, what):
        fractions.append(done / total)
        if what == "fitting pose and proportions" and done > 45:
            raise Cancelled

    with pytest.raises(Cancelled), receiving(receive):
        aligned(figure, target)
    assert fractions == sorted(fractions) and fractions[0] == 0.0
