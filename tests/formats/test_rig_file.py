"""The .rig reader: the names of files that belong together."""

from pathlib import Path

import pytest

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
def test_names_the_files_relative_to_itself(text):
    name, files, source = parse(text)
    assert (name, files) == ("wasp", ["wasp.skel", "wasp.skin"])
    assert source.warnings == [] and detect(source) == "rig"


def test_morphs_follow_in_their_order():
    text = GOOD.replace("0 {", "2 { head1.morph sub/head2.morph")
    assert parse(text)[1] == ["wasp.skel", "wasp.skin", "head1.morph", "sub/head2.morph"]


def test_names_with_blanks_stand_in_quotes_and_a_rig_may_have_none():
    name, files, _ = parse('rig { skin "my wasp.skin" }')
    assert (name, files) == ("a", ["my wasp.skin"])


@pytest.mark.parametrize(
    ("text", "warning"),
    [
        (GOOD.rstrip("}\n") + "\n}", 'the last "}" is missing'),
        (GOOD + "rig two { }", 'ignored what follows the rig, "rig"'),
    ],
)
def test_odd_ends_warn(text, warning):
    *_, source = parse(text)
    assert len(source.warnings) == 1 and source.warnings[0].endswith(warning)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("rig a { }", "1: expected a skeleton or a skin, found no name of a file"),
        (GOOD.replace("skin wasp.skin", "mesh wasp.skin"), "3: expected skeleton, skin or morphs, "
         'found "mesh"'),
        (GOOD.replace("skin wasp.skin", "skin"), '4: expected skeleton, skin or morphs, found "0"'),
        (GOOD.replace("0 {", "1 {"), "4: morphs: expected 1 files, found 0"),
        (GOOD.replace("0 {", "-1 {"), '4: morphs: expected a count, found "-1"'),
        (GOOD.replace("0 {", "many {"), '4: morphs: expected a count, found "many"'),
        (GOOD.replace("0 {", "0"), '5: expected "{", found "}"'),
        ("rig a { skeleton", "1: skeleton: expected the name of a file, found the end of the file"),
        ("rig a { skin {", '1: skin: expected the name of a file, found "{"'),
    ],
)  # fmt: skip
def test_malformed_files_are_refused_with_their_line(text, message):
    with pytest.raises(FormatError) as caught:
        parse(text)
    where = f"{FOLDER / 'a.rig'}:{'' if message[0].isdigit() else ' '}"
    assert str(caught.value) == f"{where}{message}"


def test_endless_count_of_morphs_takes_no_memory():
    with pytest.raises(FormatError, match="expected 2e"):
        parse(GOOD.replace("0 {", "2000000000 {"))
