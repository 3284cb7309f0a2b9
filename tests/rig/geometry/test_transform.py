import numpy as np
from rig.hand_made import matrix, turn_z

from viewer.rig.geometry.transform import apply_transform, translation_matrix


def test_translation_matrix_has_the_offset_in_its_last_column():
    assert translation_matrix(np.array([1.0, 2, 3])).tolist() == [
        [1, 0, 0, 1],
        [0, 1, 0, 2],
        [0, 0, 1, 3],
        [0, 0, 0, 1],
    ]


def test_translation_matrices_keep_the_batch_shape():
    batch = translation_matrix(np.arange(12.0).reshape(2, 2, 3))
    assert batch.shape == (2, 2, 4, 4)
    assert batch[1, 0, :, 3].tolist() == [6, 7, 8, 1]


def test_apply_transform_rotates_before_translating():
    quarter = matrix(np.round(turn_z(np.pi / 2)), (10, 0, 0))
    points = np.array([[1.0, 0, 5], [0, 1, 0]])
    assert apply_transform(quarter, points).tolist() == [[10, 1, 5], [9, 0, 0]]


def test_apply_transform_accepts_one_point_and_no_points():
    move = translation_matrix(np.array([1.0, 0, 0]))
    assert apply_transform(move, np.zeros(3)).tolist() == [1, 0, 0]
    assert apply_transform(move, np.zeros((0, 3))).shape == (0, 3)
