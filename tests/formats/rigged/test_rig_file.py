"""The .rig reader, which reads the names of files that belong together."""

from pathlib import Path

import pytest
from faults import fault_of, refusal_of, warnings_of

from viewer.errors import FormatError
from viewer.formats import Source, detect, read
from viewer.formats.rig import NamedFiles

GOOD = "rig wasp {\n\tskeleton wasp.skel\n\tskin wasp.skin\n\tmorphs 0 {\n\t}\n}\n"
FOLDER = Path("figures")


def parse(text):
    source = Source(FOLDER / "a.rig", text.encode())
    named = read(source)
    assert isinstance(named, NamedFiles)
    return named.name, [path.relative_to(FOLDER).as_posix() for path in named.paths], source


@pytest.mark.parametrize(
    "text",
    [GOOD, GOOD.replace("\n", "\r\r\n"), GOOD.replace("\n\t", " "), GOOD.replace(" {", "{")],
    ids=["plain", "cr cr lf", "one line", "glued"],
)
def test_file_names_are_relative_to_the_rig_file(text):
    name, files, source = parse(text)
    assert (name, files) == ("wasp", ["wasp.skel", "wasp.skin"])
    assert source.warnings == [] and detect(source) == "rig"


def test_morphs_are_listed_in_order():
    text = GOOD.replace("0 {", "2 { head1.morph sub/head2.morph")
    assert parse(text)[1] == ["wasp.skel", "wasp.skin", "head1.morph", "sub/head2.morph"]


def test_names_with_spaces_are_quoted_and_a_rig_may_be_empty():
    name, files, _ = parse('rig { skin "my wasp.skin" }')
    assert (name, files) == ("a", ["my wasp.skin"])


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (GOOD.rstrip("}\n") + "\n}", ("F006.closing", None, {})),
        (GOOD + "rig two { }", ("F006.rig-after", 7, {"found": b"rig"})),
    ],
)
def test_missing_or_extra_braces_at_the_end_are_reported(text, fault):
    *_, source = parse(text)
    assert warnings_of(source.diagnostics) == [fault]


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("rig a { }", ("F002.rig-empty", 1, {})),
        (
            GOOD.replace("skin wasp.skin", "mesh wasp.skin"),
            ("F002.rig-item", 3, {"found": b"mesh"}),
        ),
        (GOOD.replace("skin wasp.skin", "skin"), ("F002.rig-item", 4, {"found": b"0"})),
        (GOOD.replace("0 {", "1 {"), ("F002.rig-morphs", 4, {"expected": 1, "found": 0})),
        (GOOD.replace("0 {", "-1 {"), ("F002.count", 4, {"item": "morphs", "found": b"-1"})),
        (GOOD.replace("0 {", "many {"), ("F002.count", 4, {"item": "morphs", "found": b"many"})),
        (GOOD.replace("0 {", "0"), ("F002.rig-word", 5, {"expected": "{", "found": b"}"})),
        ("rig a { skeleton", ("F002.rig-name", 1, {"item": "skeleton", "found": None})),
        (
            "rig a { skin ../a.skin }",
            ("F002.rig-outside", 1, {"item": "skin", "found": b"../a.skin"}),
        ),
        ("rig a { skin {", ("F002.rig-name", 1, {"item": "skin", "found": b"{"})),
    ],
)
def test_malformed_files_are_refused_with_their_line(text, fault):
    with pytest.raises(FormatError) as caught:
        parse(text)
    assert caught.value.path == FOLDER / "a.rig"
    assert fault_of(caught.value.diagnostic) == fault


def test_huge_morph_count_is_refused_without_allocation():
    fault = refusal_of(lambda: parse(GOOD.replace("0 {", "2000000000 {")))
    assert fault == ("F002.rig-morphs", 4, {"expected": 2000000000, "found": 0})
