"""Body models in their published form: pickles with sparse matrices and chumpy objects."""

import pickle

import numpy as np
import pytest
from formats.pickle_bytes import (
    array,
    created,
    fake_class,
    mapping,
    matrix,
    saved,
    shape,
    text,
    whole,
)
from formats.smpl.quaternion_files import N_SHAPES, SMAL_PARENTS, forward, smal, star, supr
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose, assert_array_equal

import viewer
from viewer.errors import FormatError
from viewer.rigs.bodies.smpl_family import animal_of
from viewer.rigs.figure import figure_pose
from viewer.rigs.motion.evaluation import rest_translations_of
from viewer.rigs.pose import rest_pose
from viewer.rigs.posing.pose_vector import read_vector
from viewer.rigs.shape import joint_shifts, rest_joints, shaped
from viewer.rigs.skinning import deform, joint_matrices

SMPL = model("smpl", 32)
MATRICES = ("kintree_table", "v_template", "f", "weights", "posedirs")


def columns(dense):
    """Return a matrix in compressed columns: values, rows, starts."""
    rows = [np.flatnonzero(column) for column in dense.T]
    values = np.concatenate([dense[row, number] for number, row in enumerate(rows)])
    return values, np.concatenate(rows), np.cumsum([0, *map(len, rows)])


def sparse(dense, **options):
    data, indices, indptr = columns(dense)
    return matrix(sides=dense.shape, data=data, indices=indices, indptr=indptr, **options)


def chumpy(values):
    """Return a chumpy value as in the authors' files, which store the shapes in this form."""
    return created("chumpy.ch", "Ch", mapping(x=array(values), _dirty_vars=b"N", _itr=b"N"))


def python_2(**changes):
    """Return the model as pickled by Python 2."""
    given = {key: array(SMPL[key]) for key in MATRICES}
    given |= {"J_regressor": sparse(SMPL["J_regressor"]), "shapedirs": chumpy(SMPL["shapedirs"])}
    given |= {"bs_style": text("lbs"), "bs_type": text("lrotmin")}
    return saved(**{**given, **changes})


@pytest.fixture
def load(tmp_path):
    def loaded(data):
        path = tmp_path / "SMPL.pkl"
        path.write_bytes(data)
        scene = viewer.load(path)
        assert scene.warnings == ()
        return scene.actors[0].figure

    return loaded


def assert_smpl(figure):
    assert_array_equal(figure.mesh.positions, SMPL["v_template"])
    assert_array_equal(figure.mesh.triangles, SMPL["f"])
    assert figure.skeleton.names[23] == "right_hand"
    starts = figure.skeleton.rest_translations[0]
    assert_allclose(starts, SMPL["J"][0], rtol=0, atol=1e-14)
    assert_array_equal(np.moveaxis(figure.blend_shapes.offsets.values(), 0, 2), SMPL["shapedirs"])
    assert_array_equal(np.moveaxis(figure.correctives.values(), 0, 2), SMPL["posedirs"])
    assert_allclose(deform(figure)[0], SMPL["v_template"], rtol=0, atol=1e-14)


def test_pickle_of_python_2_is_read(load):
    assert_smpl(load(python_2()))


def test_regressor_may_be_dense_or_in_compressed_rows(load):
    assert_smpl(load(python_2(J_regressor=array(SMPL["J_regressor"]))))
    # The compressed columns of the transpose are the compressed rows of the matrix.
    turned = SMPL["J_regressor"].T
    data, indices, indptr = columns(turned)
    rows = matrix(
        sides=turned.shape[::-1],
        data=data,
        indices=indices,
        indptr=indptr,
        module="scipy.sparse.csr",
        name="csr_matrix",
    )
    assert_smpl(load(python_2(J_regressor=rows)))


def test_weights_may_be_sparse(load):
    assert_smpl(load(python_2(weights=sparse(SMPL["weights"]))))


def test_shapes_may_be_a_selection(load):
    # Ten of twenty columns are selected, as in MANO.
    wide = np.concatenate([np.zeros((32, 3, 10)), SMPL["shapedirs"]], axis=2)
    picked = np.arange(wide.size).reshape(wide.shape)[:, :, 10:].ravel()
    state = mapping(a=chumpy(wide), idxs=array(picked), preferred_shape=shape(32, 3, 10))
    assert_smpl(load(python_2(shapedirs=created("chumpy.reordering", "Select", state))))


def test_expressions_in_unused_keys_are_skipped(load):
    product = created("chumpy.ch_ops", "dot", mapping(a=chumpy(SMPL["J"]), b=chumpy(SMPL["J"])))
    figure = load(python_2(v_posed=product, pose_training_info=mapping(gender=text("male"))))
    assert_smpl(figure)
    assert "v_posed, pose_training_info" in dict(figure.facts)["keys not needed"]


def test_expression_in_a_used_key_is_refused(load):
    product = created("chumpy.ch_ops", "dot", mapping(a=chumpy(SMPL["J"]), b=chumpy(SMPL["J"])))
    with pytest.raises(FormatError) as caught:
        load(python_2(v_template=product))
    message = str(caught.value)
    assert "SMPL.pkl: v_template: expected V x 3 numbers, found an unsupported value" in message


@pytest.mark.parametrize("protocol", range(2, 6))
@pytest.mark.parametrize("module", ["scipy.sparse.csc", "scipy.sparse._csc"])
def test_pickle_of_python_3_is_read(load, monkeypatch, protocol, module):
    regressor = fake_class(monkeypatch, module, "csc_matrix")()
    data, indices, indptr = columns(SMPL["J_regressor"])
    regressor.__dict__.update(
        data=data, indices=indices, indptr=indptr, _shape=(24, 32), maxprint=50
    )
    shapes = fake_class(monkeypatch, "chumpy.ch", "Ch")()
    shapes.__dict__.update(x=SMPL["shapedirs"], _dirty_vars=set(), _itr=None)
    given = {**SMPL, "J_regressor": regressor, "shapedirs": shapes, "bs_style": "lbs"}
    assert_smpl(load(pickle.dumps(given, protocol)))


@pytest.mark.parametrize("protocol", [0, 1])
def test_pickle_with_text_protocol_is_read(load, protocol):
    assert_smpl(load(pickle.dumps(SMPL, protocol)))


def test_regressor_of_wrong_size_is_refused_before_allocation(load):
    huge = matrix(
        sides=(24, 1 << 26),
        data=[1.0],
        indices=[0],
        indptr=[0, 1],
    )
    with pytest.raises(FormatError, match="J_regressor: expected"):
        load(python_2(J_regressor=huge))
    wide = sparse(SMPL["J_regressor"][:, :31])
    with pytest.raises(FormatError) as caught:
        load(python_2(J_regressor=wide))
    assert str(caught.value).endswith(
        "SMPL.pkl: J_regressor: expected 24 x 32 numbers, found a sparse 24 x 31 matrix"
    )


def test_lists_of_numbers_are_read_as_arrays(load):
    figure = load(pickle.dumps({**SMPL, "f": SMPL["f"].tolist()}, 2))
    assert_smpl(figure)


def test_shapes_in_a_pickle_are_read_lazily(load):
    figure = load(python_2())
    assert not figure.blend_shapes.offsets.is_loaded
    pose = rest_pose(figure.skeleton)
    pose.shape_weights = np.array([0.0, 2.0])
    expected = SMPL["v_template"] + 2.0 * SMPL["shapedirs"][:, :, 1]
    assert_allclose(deform(figure, pose)[0], expected, rtol=0, atol=1e-14)
    assert figure.blend_shapes.offsets.is_loaded


def test_unknown_integers_next_to_arrays_are_ignored(load):
    assert_smpl(load(python_2(version=whole(3))))


ROUNDING = 1e-11  # metres


def load_arrays(tmp_path, arrays):
    path = tmp_path / "model.npz"
    np.savez(path, **arrays)
    return viewer.load(path).actors[0].figure


@pytest.mark.parametrize("make", [star, supr, smal])
def test_vertices_and_joints_match_the_published_equations(tmp_path, make):
    arrays = make()
    figure = load_arrays(tmp_path, arrays)
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
    figure = load_arrays(tmp_path, star())
    assert dict(figure.facts)["model"] == "STAR"
    assert figure.skeleton.names[0] == "pelvis"
    assert dict(load_arrays(tmp_path, supr()).facts)["model"] == "SUPR"


def test_supr_is_read_as_published_in_an_npy_file(tmp_path):
    np.save(tmp_path / "supr_neutral.npy", supr(), allow_pickle=True)
    figure = viewer.load(tmp_path / "supr_neutral.npy").actors[0].figure
    assert dict(figure.facts)["model"] == "SUPR"
    assert_allclose(deform(figure)[0], supr()["v_template"], atol=ROUNDING)


def test_constants_of_the_regressor_do_not_depend_on_the_shape(tmp_path):
    figure = load_arrays(tmp_path, supr())
    weights = np.random.default_rng(2).normal(size=(2, N_SHAPES))
    rest = rest_joints(figure)
    for row, shifts in zip(weights, joint_shifts(figure, weights), strict=True):
        assert_allclose(rest + shifts, rest_joints(shaped(figure, row)), atol=ROUNDING)
    wanted = shaped(figure, weights[1]).skeleton.rest_translations
    assert_allclose(rest_translations_of(figure, weights)[1], wanted, atol=ROUNDING)


def test_wrong_number_of_corrective_columns_is_refused(tmp_path):
    arrays = star() | {"posedirs": np.zeros((30, 3, 94))}
    with pytest.raises(FormatError, match="207"):
        load_arrays(tmp_path, arrays)


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
    figure = load_arrays(tmp_path, arrays)
    names = figure.skeleton.names
    assert (names[10], names[20], names[31], names[34]) == ("LFoot", "LFootBack", "Tail7", "REar")
    assert figure.up == "z" and dict(figure.facts)["model"] == "SMAL with ears"


def test_trees_with_different_limbs_are_not_animals():
    assert animal_of(SMAL_PARENTS[:33]).title == "SMAL"
    assert animal_of((*SMAL_PARENTS[:11], 5, *SMAL_PARENTS[12:])) is None
    assert animal_of([joint - 1 for joint in range(35)]) is None
