"""Archives of named arrays: their bytes, progress and cancellation."""

import io
import zipfile

import numpy as np
import pytest

from viewer.media import named_arrays
from viewer.media.named_arrays import save_arrays
from viewer.progress import Cancelled, receiving

ARRAYS = {
    "noise": np.random.default_rng(0).normal(size=(500, 3)),
    "columns": np.asfortranarray(np.arange(600.0).reshape(20, 30)),
    "steps": np.arange(50)[::2],
    "none": np.zeros((0, 3)),
    "name": np.array("walk"),
}


@pytest.fixture(autouse=True)
def _small_blocks(monkeypatch):
    monkeypatch.setattr(named_arrays, "_BLOCK", 1000)


def test_archive_has_the_bytes_of_one_written_at_once(tmp_path):
    expected = io.BytesIO()
    with zipfile.ZipFile(expected, "w") as archive:
        for name, array in ARRAYS.items():
            member = io.BytesIO()
            np.save(member, array)
            entry = zipfile.ZipInfo(f"{name}.npy")
            archive.writestr(entry, member.getvalue(), zipfile.ZIP_DEFLATED)
    save_arrays(tmp_path / "a.npz", ARRAYS)
    assert (tmp_path / "a.npz").read_bytes() == expected.getvalue()
    with np.load(tmp_path / "a.npz") as found:
        assert found.files == [*ARRAYS]
        for name, array in ARRAYS.items():
            np.testing.assert_array_equal(found[name], array)


def test_compression_can_be_cancelled_at_any_block(tmp_path):
    (tmp_path / "a.npz").write_bytes(b"old")
    found = []

    def receive(*step):
        found.append(step)
        if len(found) == 9:
            raise Cancelled

    with receiving(receive), pytest.raises(Cancelled):
        save_arrays(tmp_path / "a.npz", ARRAYS)
    assert {step[2:] for step in found} == {("MB", "compressing a.npz")}
    assert [path.name for path in tmp_path.iterdir()] == ["a.npz"]
    assert (tmp_path / "a.npz").read_bytes() == b"old"
