"""Submissions: selection of the compared files, and untrusted archives."""

import io
import stat
import struct
import zipfile
from pathlib import Path

import pytest

from viewer.batching import submissions as unpacking
from viewer.batching.submissions import find_submissions, opened
from viewer.errors import FormatError

ALIKE = ("*.skel", "*.skin")


def zipped(path: Path, members: dict[str, bytes | str]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
    return path


def written(folder: Path, *names: str) -> Path:
    for name in names:
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(name)
    return folder


def chosen(path: Path, expected=(), alike=ALIKE) -> list[str]:
    """Return the chosen paths, relative to the submission or its unpacked archive."""
    with opened(path, expected, alike) as found:
        base = path if found.base is None else found.base
        assert all(file.exists() for file in found.files)
        return [file.relative_to(base).as_posix() for file in found.files]


def refusal(path: Path, expected=(), alike=ALIKE) -> str:
    with pytest.raises(FormatError) as caught, opened(path, expected, alike):
        pass
    text = str(caught.value)
    assert text.startswith(str(path))
    return text[len(str(path)) :]


@pytest.mark.parametrize("is_zip", [False, True])
@pytest.mark.parametrize(
    ("names", "result"),
    [
        (["arm.skel", "arm.skin"], ["arm.skel", "arm.skin"]),
        (["Bob/ARM.SKEL", "Bob/arm.skin"], ["Bob/ARM.SKEL", "Bob/arm.skin"]),
        (
            ["a.skel", "a.skin", "old/a.skel", "old/a.skin", "walk.anim", "__MACOSX/._a.skin"],
            ["a.skel", "a.skin"],
        ),
        (["rigs/a.skel", "data/meshes/a.skin", ".DS_Store"], ["rigs/a.skel", "data/meshes/a.skin"]),
        (["made/fox.glb", "made/readme.txt"], ["made"]),
    ],
)
def test_files_with_the_suffixes_of_the_reference_are_found(tmp_path, names, result, is_zip):
    if is_zip:
        path = zipped(tmp_path / "bob.zip", dict.fromkeys(names, "x"))
    else:
        path = written(tmp_path / "bob", *names)
    assert chosen(path) == result


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["a.skel", "b.obj"], ": expected 1 file matching *.skin, found a.skel, b.obj"),
        (
            ["a.skel", "b.skel", "a.skin"],
            ": expected 1 file matching *.skel, found a.skel, b.skel; --expect names the files "
            "to use",
        ),
        ([], ": expected files to compare, found none"),
        (["report.pdf", ".hidden.skel"], ": expected files to compare, found report.pdf"),
        (
            ["1/a.glb", "2/a.glb"],
            ": expected one folder with files to compare, found 1, 2; --expect names the files "
            "to use",
        ),
    ],
)
def test_missing_and_ambiguous_files_are_reported(tmp_path, names, message):
    path = zipped(tmp_path / "bob.zip", dict.fromkeys(names, "x"))
    assert refusal(path) == message


def test_expected_patterns_take_precedence(tmp_path):
    path = written(tmp_path / "bob", "a.skel", "b.skel", "in/b.skin", "in/Student.skin")
    assert chosen(path, ["b.skel", "student.skin"]) == ["b.skel", "in/Student.skin"]
    assert chosen(path, ["in/b*"]) == ["in/b.skin"]
    assert refusal(path, ["c.skel"]).startswith(": expected 1 file matching c.skel, found a.skel")


def test_unpacked_files_are_removed_and_only_the_needed_ones_unpacked(tmp_path):
    members = {"a/f.glb": "1", "a/f.bin": "2", "a/f.exe": "3", "b/x.png": "4"}
    path = zipped(tmp_path / "bob.zip", members)
    with opened(path, ["f.glb"], temporary=tmp_path) as found:
        assert found.base is not None and found.base.parent.parent == tmp_path
        names = sorted(file.name for file in found.base.rglob("*.*"))
        assert names == ["f.bin", "f.glb"]
        assert found.files[0].read_text() == "1"
    assert [one.name for one in tmp_path.iterdir()] == ["bob.zip"]


def test_archives_in_archives_and_folders_are_opened(tmp_path):
    def inner(data: bytes, name: str = "in.zip") -> bytes:
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w") as archive:
            archive.writestr(name, data)
        return buffer.getvalue()

    folder = tmp_path / "Bob_12_file"
    folder.mkdir()
    (folder / "bob.zip").write_bytes(inner(inner(b"x", "bob/a.glb"), "deep.zip"))
    with opened(folder) as found:
        assert found.base is not None
        assert found.files == (found.base / "bob",)
    (folder / "bob.zip").write_bytes(inner(inner(inner(inner(b"x")))))
    with pytest.raises(FormatError, match="found archives nested 3 deep"), opened(folder):
        pass


@pytest.mark.parametrize("name", ["/etc/a.skel", "../a.skel", "x/../../a.skel", "C:\\a.skel",
                                  "\\a.skel", "x\\..\\..\\a.skel", "C:a.skel"])  # fmt: skip
def test_paths_outside_the_archive_are_refused(tmp_path, name):
    path = zipped(tmp_path / "bob.zip", {name: "x", "b.skin": "x"})
    assert "expected a path inside the archive, found one that leads outside" in refusal(path)
    assert [one.name for one in tmp_path.iterdir()] == ["bob.zip"]


@pytest.mark.slow
def test_bombs_are_refused_before_anything_is_unpacked(tmp_path, monkeypatch):
    path = zipped(tmp_path / "bob.zip", {"a.skel": bytes(80 << 20), "a.skin": "x"})
    size = path.stat().st_size
    found = (80 << 20) + 1
    assert refusal(path) == (
        f": expected a compression ratio of at most 100, found {found} bytes in {size}"
    )
    monkeypatch.setattr(unpacking, "MOST_BYTES", 1000)
    assert refusal(path) == f": expected at most 1,000 bytes of files, found {found:,}"
    monkeypatch.setattr(unpacking, "MOST_FILES", 1)
    assert refusal(path) == ": expected at most 1 file, found 2"


def test_directory_with_understated_sizes_unpacks_only_the_stated_sizes(tmp_path):
    path = zipped(tmp_path / "bob.zip", {"a.skel": bytes(1 << 20), "a.skin": "x"})
    data = path.read_bytes()
    directory = data.index(b"PK\x01\x02")
    path.write_bytes(data[: directory + 24] + struct.pack("<I", 10) + data[directory + 28 :])
    assert "damaged" in refusal(path)


def test_links_encrypted_repeated_and_damaged_files_are_refused(tmp_path):
    path = tmp_path / "bob.zip"
    link = zipfile.ZipInfo("a.skel")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(link, "/etc/passwd")
        archive.writestr("a.skin", "x")
    assert refusal(path) == ": a.skel: expected a file, found a symbolic link"

    data = bytearray(zipped(path, {"a.skel": "x", "a.skin": "x"}).read_bytes())
    data[data.index(b"PK\x01\x02") + 8] |= 1
    path.write_bytes(data)
    assert refusal(path) == (": a.skel: expected an unencrypted file, found an encrypted one")
    path.write_bytes(data[:-30])
    assert "found a damaged archive (its table of contents at the end is missing" in refusal(path)
    path.write_bytes(b"Rar!\x1a\x07\x01\x00")
    assert "expected a folder or a zip archive, found a damaged archive" in refusal(path)
    assert refusal(path.rename(tmp_path / "bob.rar")) == (
        ": expected a folder or a zip archive, found a .rar file"
    )
    with pytest.warns(UserWarning, match="Duplicate"), zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.skel", "x")
        archive.writestr("a.skel", "y")
    assert refusal(path) == ": a.skel: expected a single file with this path, found 2"


def test_links_out_of_a_folder_are_treated_as_missing(tmp_path):
    (tmp_path / "solution.skin").write_text("x")
    folder = written(tmp_path / "bob", "a.skel", "b.skin")
    (folder / "b.skin").unlink()
    (folder / "b.skin").symlink_to(tmp_path / "solution.skin")
    assert refusal(folder) == ": expected 1 file matching *.skin, found a.skel"


def test_submissions_are_the_folders_and_archives_of_a_folder(tmp_path):
    written(tmp_path, "bob/x/a.skel", "ann/a.skel", "eve.zip", "max.rar", "grades.json", ".x/a")
    found = find_submissions([tmp_path])
    assert [one.name for one in found.submissions] == ["ann", "bob", "eve.zip", "max.rar"]
    assert [one.name for one in found.ignored] == ["grades.json"]
    both = [tmp_path / "ann", tmp_path / "bob"]
    assert find_submissions(both).submissions == tuple(both)
    assert find_submissions([tmp_path / "ann"]).submissions == (tmp_path / "ann",)


@pytest.mark.parametrize("name", ("geoffrey.obj", "overlap.obj", "it's.obj"))
def test_reason_for_damage_does_not_depend_on_names(tmp_path, name):
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(name, b"v 0 0 0\n" * 20)
    data = path.read_bytes()
    path.write_bytes(data.replace(b"v 0 0 0", b"v 1 0 0", 1))
    assert "a file in it differs from its checksum" in refusal(path, alike=("*.obj",))
    path.write_bytes(data.replace(name.encode(), b"crc".ljust(len(name), b"x"), 1))
    assert "the headers of its files differ" in refusal(path, alike=("*.obj",))


def test_end_of_an_archive_within_a_file_is_reported(tmp_path, monkeypatch):
    def ends(*_: object) -> None:
        raise EOFError

    path = zipped(tmp_path / "a.zip", {"a.skel": "balljoint"})
    monkeypatch.setattr(zipfile.ZipFile, "open", ends)
    assert "its data ends too early" in refusal(path, alike=("*.skel",))
