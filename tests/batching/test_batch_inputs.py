"""Inputs of a batch: search, order, and refused arguments."""

import inspect
import io
import sys

import pytest

from viewer.batching.inputs import find_inputs, natural_key
from viewer.errors import ViewerError


@pytest.fixture
def data(tmp_path, monkeypatch):
    """Return a folder with motions, a note, a hidden file and a recording."""
    for name in ("b/walk10.npz", "b/walk9.npz", "a.bvh", "b/notes.txt", ".old/x.bvh", "b/.x.bvh"):
        (tmp_path / "data" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "data" / name).touch()
    (tmp_path / "data" / "take" / "smpl").mkdir(parents=True)
    (tmp_path / "data" / "take" / "smpl" / "000000.json").touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path / "data"


def test_folder_is_searched_in_natural_order(data):
    found = find_inputs(["data"])
    assert found.paths == ("data/a.bvh", "data/b/walk9.npz", "data/b/walk10.npz", "data/take")
    assert found.folders == {"data/take"}  # a recording is a single input
    assert found.base == str(data)
    assert len(found.notes) == 1 and found.notes[0].startswith("1 file ")


def test_search_is_not_recursive(tmp_path):
    file = tmp_path / "/".join("d" * 200) / "a.skel"
    file.parent.mkdir(parents=True)
    file.touch()
    limit = sys.getrecursionlimit()
    sys.setrecursionlimit(len(inspect.stack()) + 100)
    try:
        assert find_inputs([str(tmp_path)]).paths == (str(file),)
    finally:
        sys.setrecursionlimit(limit)


def test_pattern_finds_files_in_all_folders(data):
    assert find_inputs(["data/**/*.npz"]).paths == ("data/b/walk9.npz", "data/b/walk10.npz")
    assert find_inputs(["data/*"]).paths == ("data/a.bvh", "data/take")
    assert find_inputs(["data/*"], keeps_folders=True).paths == (
        *("data/a.bvh", "data/b", "data/take"),
    )


def test_common_folder_does_not_depend_on_the_matches_of_a_pattern(data):
    assert find_inputs(["data/**/*9.npz"]).base == str(data)
    assert find_inputs(["data/b/walk9.npz"]).base == str(data / "b")
    assert find_inputs(["data/b/walk9.npz", "data/a.bvh"]).base == str(data)


def test_files_of_amass_without_a_motion_are_skipped_and_counted(tmp_path, monkeypatch):
    names = ("a/walk_poses.npz", "a/shape.npz", "b/run_stageii.npz", "b/neutral_stagei.npz")
    for name in (*names, "b/shape.npz"):
        (tmp_path / "amass" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "amass" / name).touch()
    monkeypatch.chdir(tmp_path)
    for words in (["amass"], ["amass/**/*.npz"]):
        found = find_inputs(words)
        assert found.paths == ("amass/a/walk_poses.npz", "amass/b/run_stageii.npz")
        text = "3 files of AMASS without a motion skipped: neutral_stagei.npz, shape.npz"
        assert found.notes == (text,)
    assert find_inputs(["amass/a/shape.npz"]).paths == ("amass/a/shape.npz",)


def test_folder_of_models_is_searched_although_it_has_a_folder_smpl(data):
    (data / "models" / "smpl").mkdir(parents=True)
    (data / "models" / "smpl" / "SMPL_FEMALE.npz").touch()
    found = find_inputs(["data/models"])
    assert found.paths == ("data/models/smpl/SMPL_FEMALE.npz",)


def test_lists_are_read_from_files_and_standard_input(data, monkeypatch):
    (data / "list").write_bytes(b"data/a.bvh\r\n\ndata/b/walk9.npz\n")
    zeros = io.TextIOWrapper(io.BytesIO(b"data/b/walk10.npz\0data/a.bvh\0"))
    monkeypatch.setattr(sys, "stdin", zeros)
    assert find_inputs(["@data/list"]).paths == ("data/a.bvh", "data/b/walk9.npz")
    assert find_inputs([], ["data/list"]).paths == ("data/a.bvh", "data/b/walk9.npz")
    assert find_inputs(["-"]).paths == ("data/a.bvh", "data/b/walk10.npz")


def test_duplicates_are_used_once_and_counted(data):
    (data / "b" / "loop").symlink_to(data)
    found = find_inputs(["data/a.bvh", "./data/a.bvh", "data/b/walk*.npz", "data/**/*.npz"])
    assert found.paths == ("data/a.bvh", "data/b/walk9.npz", "data/b/walk10.npz")
    assert len(found.notes) == 1
    assert find_inputs(["data"]).paths[0] == "data/a.bvh"  # the search ends despite the loop


def test_outputs_of_an_earlier_run_are_not_inputs(data):
    (data / "out" / "b").mkdir(parents=True)
    (data / "out" / "b" / "walk9.bvh").touch()
    for words in (["data"], ["data/**/*.bvh"]):
        found = find_inputs(words, output="data/out")
        assert "data/out/b/walk9.bvh" not in found.paths and "data/a.bvh" in found.paths
        assert any("1 file in the folder of the outputs" in note for note in found.notes)
    assert find_inputs(["data/out"], output="data/out").paths == ("data/out/b/walk9.bvh",)
    assert "data/out/b/walk9.bvh" in find_inputs(["data"], output="data/ou").paths


def test_existing_names_are_not_patterns(data):
    (data / "walk[1].bvh").touch()
    (data / "@x").touch()
    assert find_inputs(["data/walk[1].bvh"]).paths == ("data/walk[1].bvh",)
    assert find_inputs(["data/@x"]).paths == ("data/@x",)


@pytest.mark.parametrize(
    ("words", "part"),
    [
        ([], "found none"),
        (["data/c.bvh"], "data/c.bvh: no such"),
        (["data/*.fbx"], "data/*.fbx: no file matches"),
        (["@data/list"], "data/list: No such file"),
        (["@data/a.bvh"], "data/a.bvh: expected one path per line"),
        (["data/take/smpl", "data/b/*.fbx"], "no file matches"),
    ],
)
def test_missing_inputs_are_refused(data, words, part):
    with pytest.raises(ViewerError, match=part.replace("*", r"\*")):
        find_inputs(words)


def test_folder_without_supported_files_is_refused(data):
    (data / "empty").mkdir()
    with pytest.raises(ViewerError, match="empty: no file"):
        find_inputs(["data/empty"])


def test_numbers_sort_by_value_within_each_folder():
    names = ["x/10", "x/9a", "X/9", "x-y/1", "x/9/2"]
    assert sorted(names, key=natural_key) == ["X/9", "x/9/2", "x/9a", "x/10", "x-y/1"]
