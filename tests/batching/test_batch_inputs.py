"""Inputs of a batch: search, order, and refused arguments."""

import inspect
import io
import sys
from pathlib import Path

import pytest

from viewer.batching.inputs import Inputs, find_inputs
from viewer.batching.items import Item
from viewer.batching.naming import check_outputs, items_of, template_of
from viewer.errors import ViewerError
from viewer.media.file_names import natural_key


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


INPUTS = Inputs(
    ("d/a/x.npz", "d/b/x.v2.npz", "d/take.1"), str(Path("d").absolute()), frozenset({"d/take.1"})
)


def outputs(output: str, suffix: str = "", inputs: Inputs = INPUTS) -> list[str]:
    return [item.output for item in items_of(inputs, template_of(output, suffix))]


def test_output_folder_mirrors_the_folders_of_the_inputs():
    assert outputs("out", ".bvh") == ["out/a/x.bvh", "out/b/x.v2.bvh", "out/take.1.bvh"]
    assert outputs("out/", "folder") == ["out/a/x", "out/b/x.v2", "out/take.1"]


def test_fields_of_templates_are_replaced():
    names = ["out/a/0000-x.npz.png", "out/b/0001-x.v2.npz.png", "out/0002-take.1.png"]
    assert outputs("out/{parent}/{index:04}-{name}.png") == names
    assert outputs("{folder}/{stem}-{suffix}.bvh")[:2] == ["d/a/x-npz.bvh", "d/b/x.v2-npz.bvh"]
    # Numbered images and meshes, and files of people, keep the field of the command.
    assert outputs("o/{stem}_{frame:05}.obj")[0] == "o/x_{frame:05}.obj"
    assert outputs("o/{stem}-{person}.glb")[0] == "o/x-{person}.glb"


def test_items_are_named_by_their_path_below_the_common_folder():
    assert [item.name for item in items_of(INPUTS)] == ["a/x.npz", "b/x.v2.npz", "take.1"]
    assert [item.index for item in items_of(INPUTS)] == [0, 1, 2]


@pytest.mark.parametrize(
    ("output", "suffix", "part"),
    [
        ("out", "", "expected --to SUFFIX"),
        ("{stem}.bvh", "bvh", "expected a folder"),
        ("{sten}.bvh", "", "did you mean stem"),
        ("{stem:5}.bvh", "", "without a format"),
        ("{index:zz}.bvh", "", r"\{index:05\}, found \{index:zz\}"),
        ("{index:>99999999999999999999}.bvh", "", "expected {index}"),
        ("{stem!r}.bvh", "", r"expected \{stem\}, found \{stem!r\}"),
        ("{stem.bvh", "", "expected '}'"),
    ],
)
def test_invalid_templates_are_refused(output, suffix, part):
    with pytest.raises(ViewerError, match=part):
        template_of(output, suffix)


@pytest.mark.parametrize("names", [("x/A.npz", "y/a.npz"), ("x/Ä.npz", "y/a\u0308.npz")])
def test_outputs_that_differ_only_in_case_or_composition_are_refused(names):
    items = items_of(Inputs(names, str(Path.cwd())), "out/{stem}.bvh")
    with pytest.raises(ViewerError) as problem:
        check_outputs(items)
    assert "1 output " in str(problem.value) and names[0] in str(problem.value)


def test_inputs_are_refused_as_outputs(tmp_path):
    (tmp_path / "a.bvh").touch()
    (tmp_path / "b.bvh").symlink_to(tmp_path / "a.bvh")
    inputs = Inputs((str(tmp_path / "a.bvh"),), str(tmp_path))
    for output, more in (("{folder}/b.bvh", ()), ("{folder}/a.bvh", ()), ("o/m.bvh", ("o/m.bvh",))):
        with pytest.raises(ViewerError, match="is an input"):
            check_outputs(items_of(inputs, output), more)


def test_outputs_that_differ_only_in_case_are_explained():
    items = [Item(0, ("a",), "out/Walk.bvh", "a"), Item(1, ("b",), "out/walk.bvh", "b")]
    with pytest.raises(ViewerError) as caught:
        check_outputs(items)
    assert str(caught.value) == (
        "1 output would be written twice: out/walk.bvh (a, b); use a template with {index}: names "
        "that differ only in case or Unicode form are the same file on some systems"
    )
