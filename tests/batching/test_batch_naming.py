"""Output names of a batch, and errors found before anything starts."""

from pathlib import Path

import pytest

from viewer.batching.inputs import Inputs
from viewer.batching.items import Item
from viewer.batching.naming import check_outputs, items_of, template_of
from viewer.errors import ViewerError

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


def test_outputs_that_differ_only_in_case_are_explained() -> None:
    items = [Item(0, ("a",), "out/Walk.bvh", "a"), Item(1, ("b",), "out/walk.bvh", "b")]
    with pytest.raises(ViewerError) as caught:
        check_outputs(items)
    assert str(caught.value) == (
        "1 output would be written twice: out/walk.bvh (a, b); use a template with {index}: names "
        "that differ only in case or Unicode form are the same file on some systems"
    )
