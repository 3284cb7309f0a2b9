"""STAR, SUPR and SMAL, compared with their published equations; animals have known joints."""

import numpy as np
import pytest
from formats.smpl.quaternion_files import N_SHAPES, SMAL_PARENTS, forward, smal, star, supr
from numpy.testing import assert_allclose

import viewer
from viewer.errors import FormatError
from viewer.rig.bodies.smpl_family import animal_of
from viewer.rig.motion.evaluation import rest_translations_of
from viewer.rig.posing.pose_vector import read_vector
from viewer.rig.scene import figure_pose
from viewer.rig.shape import joint_shifts, rest_joints, shaped
from viewer.rig.skinning import deform, joint_matrices

ROUNDING = 1e-11  # metres


def load(tmp_path, arrays):
    path = tmp_path / "model.npz"
    np.savez(path, **arrays)
    return viewer.load(path).actors[0].figure


@pytest.mark.parametrize("make", [star, supr, smal])
def test_vertices_and_joints_match_the_published_equations(tmp_path, make):
    arrays = make()
    figure = load(tmp_path, arrays)
    generator = np.random.default_rng(6)
    for _ in range(3):
        vectors = generator.normal(size=(figure.skeleton.n_joints, 3))
        vectors *= (generator.uniform(0.1, 3.0, len(vectors)) / np.linalg.norm(vectors, axis=1))[
            :, None
        ]
        pose = figure_pose(figure)
        read_vector(figure.pose_layout, figure.skeleton, pose, vectors.ravel())
        pose.shape_weights = generator.normal(size=N_SHAPES)
        pose.figure_translation = generator.normal(size=3)
        wanted = forward(arrays, vectors, pose.shape_weights, pose.figure_translation)
        assert_allclose(deform(figure, pose)[0], wanted[0], atol=ROUNDING)
        assert_allclose(joint_matrices(figure, pose)[:, :3, 3], wanted[1], atol=ROUNDING)


def test_models_are_recognised_by_their_correctives(tmp_path):
    figure = load(tmp_path, star())
    assert dict(figure.facts)["model"] == "STAR"
    assert figure.skeleton.names[0] == "pelvis"
    assert dict(load(tmp_path, supr()).facts)["model"] == "SUPR"


def test_supr_is_read_as_published_in_an_npy_file(tmp_path):
    np.save(tmp_path / "supr_neutral.npy", supr(), allow_pickle=True)
    figure = viewer.load(tmp_path / "supr_neutral.npy").actors[0].figure
    assert dict(figure.facts)["model"] == "SUPR"
    assert_allclose(deform(figure)[0], supr()["v_template"], atol=ROUNDING)


def test_constants_of_the_regressor_do_not_depend_on_the_shape(tmp_path):
    figure = load(tmp_path, supr())
    weights = np.random.default_rng(2).normal(size=(2, N_SHAPES))
    rest = rest_joints(figure)
    for row, shifts in zip(weights, joint_shifts(figure, weights), strict=True):
        assert_allclose(rest + shifts, rest_joints(shaped(figure, row)), atol=ROUNDING)
    wanted = shaped(figure, weights[1]).skeleton.rest_translations
    assert_allclose(rest_translations_of(figure, weights)[1], wanted, atol=ROUNDING)


def test_wrong_number_of_corrective_columns_is_refused(tmp_path):
    arrays = star() | {"posedirs": np.zeros((30, 3, 94))}
    with pytest.raises(FormatError, match="207"):
        load(tmp_path, arrays)


def test_animals_have_their_joint_names_and_z_up(tmp_path):
    arrays = star(SMAL_PARENTS)
    arrays["posedirs"] = np.zeros((30, 3, 9 * 34))
    height = np.zeros(35)
    height[[10, 14, 20, 24]] = -0.5  # the four feet
    arrays["v_template"] = np.zeros((30, 3))
    arrays["v_template"][:24, 2] = height[:24]
    arrays["J_regressor"] = np.zeros((35, 30))
    arrays["J_regressor"][np.arange(35), np.minimum(np.arange(35), 25)] = 1.0
    arrays["J_regressor"][24] = arrays["J_regressor"][20]
    figure = load(tmp_path, arrays)
    names = figure.skeleton.names
    assert (names[10], names[20], names[31], names[34]) == ("LFoot", "LFootBack", "Tail7", "REar")
    assert figure.up == "z" and dict(figure.facts)["model"] == "SMAL with ears"


def test_trees_with_different_limbs_are_not_animals():
    assert animal_of(SMAL_PARENTS[:33]).title == "SMAL"
    assert animal_of((*SMAL_PARENTS[:11], 5, *SMAL_PARENTS[12:])) is None
    assert animal_of([joint - 1 for joint in range(35)]) is None
