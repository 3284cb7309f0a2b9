"""Invalid numbers in ``.fbx``: one line with the file and the place."""

from importlib.util import find_spec

import pytest
from formats.fbx.tiny_fbx import write_strip

import viewer
from viewer.errors import FormatError

pytestmark = pytest.mark.skipif(find_spec("ufbx") is None, reason="ufbx is not installed")

MOVED = 'P: "Lcl Translation", "Lcl Translation", "", "A",0,1,0'
RED = '"A",1,0,0'


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("a: 0,0,0, 1,0,0", "a: 0,0,0, inf,0,0", 'mesh "Strip": position 1: expected finite'),
        ("a: 0,0,0, 1,0,0", "a: 0,0,0, 1e40,0,0", 'mesh "Strip": position 1: expected numbers'),
        (MOVED, MOVED.replace(",1,0", ",nan,0"), 'node "high" (3): transform: expected finite'),
        (MOVED, MOVED + '\nP: "Lcl Scaling", "Lcl Scaling", "", "A",1e39,1,1', 'node "high" (3)'),
        (RED, '"A",1e39,0,0', "materials Red base_color value: expected numbers within"),
        ("a: 1,1,0.5,0.5 }", "a: 1,nan,0.5,0.5 }", 'mesh "Strip": weight 1: expected finite'),
        ("Indexes: *4 { a: 0,1,2,3 }", "Indexes: *4 { a: 0,-1,2,3 }", "expected a vertex index"),
        ("Indexes: *2 { a: 1,2 }", "Indexes: *2 { a: 1,9 }", "from 0 to 5, found 9"),
    ],
)
def test_invalid_numbers_are_refused_with_their_place(tmp_path, old, new, message):
    path = write_strip(tmp_path, edits={old: new})
    with pytest.raises(FormatError) as caught:
        viewer.load(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_products_of_valid_transforms_are_refused_when_they_are_out_of_reach(tmp_path):
    scaled = '\nP: "Lcl Scaling", "Lcl Scaling", "", "A",1e17,1e17,1e17'
    low = 'Model: 21, "Model::low", "LimbNode" { Version: 232 }'
    edits = {MOVED: MOVED + scaled, low: low.replace(" }", f" Properties70:  {{ {scaled} }}\n}}")}
    with pytest.raises(FormatError, match='joint "high": expected a rest transform within'):
        viewer.load(write_strip(tmp_path, edits=edits))


def test_invalid_keys_are_refused_when_they_are_played(tmp_path):
    path = write_strip(
        tmp_path, edits={"KeyValueFloat: *2 { a: 0,90 }": "KeyValueFloat: *2 { a: 0,nan }"}
    )
    (actor,) = viewer.load(path).actors
    with pytest.raises(FormatError, match='keys of "high": rotation: expected finite'):
        actor.figure.animations[0].clip()


@pytest.mark.parametrize(
    ("end", "message"),
    [
        # ufbx reads what is left of each: without curves, without connections, without meshes.
        ('    C: "OP",53,52', "expected the end of 1 open section, found the end of the file"),
        ("Connections:", "expected a section Connections, found the end of the file"),
        ("    AnimationStack: 50", "expected the end of 1 open section"),
    ],
)
def test_text_that_is_cut_short_is_refused_at_its_end(tmp_path, end, message):
    path = write_strip(tmp_path)
    text = path.read_text()
    left = text[: text.index(end)]
    path.write_text(left)
    with pytest.raises(FormatError) as caught:
        viewer.load(path)
    assert message in str(caught.value)
    assert str(caught.value).startswith(f"{path}:{len(left.rstrip().splitlines())}: ")
