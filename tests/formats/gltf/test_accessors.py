"""Accessors: component types, normalised integers, strides, matrices, sparse and missing data."""

import numpy as np
import pytest
from formats.gltf.files import File, source_of

from viewer.errors import FormatError
from viewer.formats.gltf.accessors import Accessors
from viewer.formats.gltf.document import open_document


def accessors(file: File) -> Accessors:
    return open_document(source_of(file)).accessors


@pytest.mark.parametrize(
    ("kind", "values", "fractions"),
    [
        ("b", [-128, -127, 127, 0], [-1.0, -1.0, 1.0, 0.0]),
        ("B", [0, 255, 51, 0], [0.0, 1.0, 0.2, 0.0]),
        ("h", [-32768, -32767, 32767, 0], [-1.0, -1.0, 1.0, 0.0]),
        ("H", [0, 65535, 13107, 0], [0.0, 1.0, 0.2, 0.0]),
    ],
)
def test_normalised_integers_are_read_as_fractions(kind, values, fractions):
    file = File()
    file.accessor([values], kind, normalized=True)
    file.accessor([values], kind)
    found = accessors(file)
    assert found.floats(0, ("VEC4",), "")[0].tolist() == pytest.approx(fractions, abs=1e-15)
    assert found.floats(1, ("VEC4",), "")[0].tolist() == values
    assert found.integers(1, ("VEC4",), "")[0].tolist() == values


def test_large_integers_are_exact():
    file = File()
    file.accessor([0, 2**32 - 1], "I")
    assert accessors(file).integers(0, ("SCALAR",), "")[:, 0].tolist() == [0, 2**32 - 1]


def test_interleaved_attributes_are_read_by_stride():
    file = File()
    rows = np.array([[1, 2, 3, 9, 8], [4, 5, 6, 7, 6]], dtype="<f4")
    view = file.view(rows.tobytes(), byteStride=20)
    common = {"bufferView": view, "componentType": 5126, "count": 2}
    file.add("accessors", {**common, "type": "VEC3"})
    file.add("accessors", {**common, "type": "VEC2", "byteOffset": 12})
    found = accessors(file)
    assert found.floats(0, ("VEC3",), "").tolist() == [[1, 2, 3], [4, 5, 6]]
    assert found.floats(1, ("VEC2",), "").tolist() == [[9, 8], [7, 6]]
    rows = np.array([1], dtype=np.int32)
    assert found.floats(1, ("VEC2",), "", rows).tolist() == [[7, 6]]


def test_columns_of_small_matrices_are_aligned_to_4_bytes():
    file = File()
    data = bytes([1, 2, 0, 0, 3, 4, 0, 0])
    file.add(
        "accessors",
        {"bufferView": file.view(data), "componentType": 5121, "count": 1, "type": "MAT2"},
    )
    data = bytes([1, 2, 3, 0, 4, 5, 6, 0, 7, 8, 9])  # the last row has no padding
    file.add(
        "accessors",
        {"bufferView": file.view(data), "componentType": 5121, "count": 1, "type": "MAT3"},
    )
    found = accessors(file)
    assert found.floats(0, ("MAT2",), "").tolist() == [[1, 2, 3, 4]]
    assert found.floats(1, ("MAT3",), "").tolist() == [[1, 2, 3, 4, 5, 6, 7, 8, 9]]


def test_matrices_are_read_column_by_column():
    file = File()
    file.accessor([[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]])
    [matrix] = accessors(file).matrices(0, "")
    assert matrix[:3, 3].tolist() == [5, 6, 7]


def sparse(file: File, indices: list[int], values: list[float], **members: object) -> None:
    """Append a sparse accessor of four numbers, some of which are replaced."""
    replaced = {
        "count": len(indices),
        "indices": {
            "bufferView": file.view(np.array(indices, "<u2").tobytes()),
            "componentType": 5123,
        },
        "values": {"bufferView": file.view(np.array(values, "<f4").tobytes())},
    }
    base = {"componentType": 5126, "count": 4, "type": "SCALAR"}
    file.add("accessors", {**base, "sparse": replaced, **members})


def test_sparse_values_replace_values_of_the_view_or_zeros():
    file = File()
    sparse(file, [1, 3], [5, 6])
    sparse(file, [0], [7], bufferView=file.view(np.arange(4, dtype="<f4").tobytes()))
    file.add("accessors", {"componentType": 5126, "count": 2, "type": "VEC3"})
    found = accessors(file)
    assert found.floats(0, ("SCALAR",), "")[:, 0].tolist() == [0, 5, 0, 6]
    assert found.floats(1, ("SCALAR",), "")[:, 0].tolist() == [7, 1, 2, 3]
    assert found.floats(2, ("VEC3",), "").tolist() == [[0, 0, 0]] * 2


@pytest.mark.parametrize(
    ("members", "key", "pointer"),
    [
        ({"count": 4}, "F002.gltf-accessor", ""),
        ({"count": 2**31}, "F002.gltf-accessor", ""),
        ({"count": 2**62}, "F002.gltf-accessor", ""),
        ({"count": -1}, "F002.gltf-type", "/count"),
        ({"count": 1.5}, "F002.gltf-type", "/count"),
        ({"count": True}, "F002.gltf-type", "/count"),
        ({"byteOffset": 2**63}, "F002.gltf-accessor", ""),
        ({"byteOffset": -4}, "F002.gltf-type", "/byteOffset"),
        ({"bufferView": 9}, "F002.gltf-index", "/bufferView"),
        ({"bufferView": "0"}, "F002.gltf-type", "/bufferView"),
        ({"componentType": 5124}, "F002.gltf-type", "/componentType"),
        ({"componentType": [5126]}, "F002.gltf-type", "/componentType"),
        ({"type": "VEC5"}, "F002.gltf-type", "/type"),
        ({"type": {}}, "F002.gltf-type", "/type"),
        ({"normalized": 1}, "F002.gltf-type", "/normalized"),
        ({"sparse": {"count": 9}}, "F002.gltf-sparse", "/sparse/count"),
        ({"sparse": {"count": 1}}, "F002.gltf-missing", "/sparse"),
    ],
)
def test_invalid_accessors_are_refused(members, key, pointer):
    file = File()
    file.accessor([1.0, 2.0, 3.0])
    file.root["accessors"][0] |= members
    with pytest.raises(FormatError) as caught:
        accessors(file).floats(0, ("SCALAR",), "/here")
    found = caught.value.diagnostic
    assert (found.key, found.pointer) == (key, f"/accessors/0{pointer}")


def test_components_that_are_not_cached_do_not_count_towards_the_decoding_limit():
    file = File()
    # Each reading decodes 36 MB; the limit of a file is 256 MB.
    accessor = {"componentType": 5121, "count": 4_000_000, "type": "SCALAR"}
    indices = {"bufferView": file.view(bytes([3])), "componentType": 5121}
    values = {"bufferView": file.view(bytes([7]))}
    file.add("accessors", accessor | {"sparse": {"count": 1, "indices": indices, "values": values}})
    read = accessors(file)
    for _ in range(9):
        found = read.components(0)
    assert found is not None and found.sum() == 7.0
    assert read.floats(0, ("SCALAR",), "")[3, 0] == 7.0


def test_large_accessor_without_data_is_refused():
    file = File()
    file.add("accessors", {"componentType": 5126, "count": 2**31, "type": "MAT4"})
    with pytest.raises(FormatError) as caught:
        accessors(file).floats(0, ("MAT4",), "")
    assert caught.value.diagnostic.key == "F002.gltf-decoded"


def test_sparse_index_out_of_range_is_refused():
    file = File()
    sparse(file, [1, 4], [5, 6])
    with pytest.raises(FormatError) as caught:
        accessors(file).floats(0, ("SCALAR",), "")
    assert caught.value.diagnostic.pointer == "/accessors/0/sparse/indices"


def test_unexpected_type_is_reported_at_the_referring_member():
    file = File()
    file.accessor([1.0])
    with pytest.raises(FormatError) as caught:
        accessors(file).floats(0, ("VEC2", "VEC3"), "/here")
    assert str(caught.value) == "a.gltf#/here: expected VEC2 or VEC3, found SCALAR in accessor 0"


@pytest.mark.parametrize(
    ("view", "key", "pointer"),
    [
        ({"byteLength": 13}, "F002.gltf-view", "/bufferViews/0"),
        ({"byteOffset": 2**62}, "F002.gltf-view", "/bufferViews/0"),
        ({"buffer": 1}, "F002.gltf-index", "/bufferViews/0/buffer"),
        ({"byteStride": 1}, "F002.gltf-stride", "/accessors/0"),
        ({"byteStride": 8}, "F002.gltf-accessor", "/accessors/0"),
    ],
)
def test_invalid_views_are_refused(view, key, pointer):
    file = File()
    file.accessor([1.0, 2.0, 3.0])
    file.root["bufferViews"][0] |= view
    with pytest.raises(FormatError) as caught:
        accessors(file).floats(0, ("SCALAR",), "")
    found = caught.value.diagnostic
    assert (found.key, found.pointer) == (key, pointer)


def test_misaligned_components_are_read_with_a_warning():
    file = File()
    view = file.view(b"\0" + np.array([2.5], "<f4").tobytes())
    file.add(
        "accessors",
        {"bufferView": view, "byteOffset": 1, "componentType": 5126, "count": 1, "type": "SCALAR"},
    )
    source = source_of(file)
    assert open_document(source).accessors.floats(0, ("SCALAR",), "").tolist() == [[2.5]]
    assert [found.key for found in source.diagnostics] == ["G002.alignment"]
