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
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose, assert_array_equal

import viewer
from viewer.errors import FormatError
from viewer.rig.pose import rest_pose
from viewer.rig.skinning import deform

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
