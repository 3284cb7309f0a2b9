"""Sources whose data is released and read again."""

from viewer.formats import Source


def test_released_files_are_read_again(tmp_path):
    path = tmp_path / "a.obj"
    path.write_bytes(b"\xef\xbb\xbfv 0\nv 1\n")
    source = Source(path)
    assert source.data == b"v 0\nv 1\n"
    source.release()
    path.write_bytes(b"v 0\n\nv 2\n")
    assert source.line(5) == 3


def test_data_without_a_file_is_kept():
    source = Source("a.obj", b"v 0\n")
    source.release()
    assert source.data == b"v 0\n"
