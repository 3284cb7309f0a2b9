"""Scalar quantities on the command line: rendering, messages, and refusals."""

import numpy as np
import pytest
from PIL import Image
from rigs.hand_made import mesh

from viewer.cli import run
from viewer.commands._scalar import scalar_notes
from viewer.errors import ViewerError
from viewer.rendering.options import DisplayOptions
from viewer.resources import resource
from viewer.rigs.annotations import VertexField
from viewer.rigs.figure import Figure
from viewer.rigs.scene import Actor, Scene

pytestmark = pytest.mark.slow

_SMALL = ("--size", "160x120", "--quality", "draft")


@pytest.fixture(scope="module")
def body():
    return str(resource("assets", "samples", "body.npz"))


@pytest.fixture
def render(tmp_path, capsys):
    """Render a small image; return its pixels or None, and the messages."""

    def drawn(*arguments):
        path = tmp_path / "x.png"
        path.unlink(missing_ok=True)
        code = run(["render", *arguments, *_SMALL, "-o", str(path)])
        said = capsys.readouterr()
        if code:
            assert not path.exists()
            return code, said.err
        return np.array(Image.open(path)), said.out.partition(": 160 x 120")[2] + said.err

    return drawn


def test_summary_line_describes_the_values(render, body):
    for name, text in (
        ("weight:LEFT_KNEE", "Weight of left_knee: 0 to 1"),
        ("influences", "Number of influences: 0 to 4"),
        ("dominant", "Dominant joint: 24 of 24"),
        ("sums", "|sum of weights - 1|: 0 to 0"),
        ("stretch", "Edge stretch, largest: 0 to 0 %"),
        ("pruning", "Distance to 4 influences: 0 to 0 mm"),
    ):
        assert render(body, "--scalar", name, "--no-grid")[1] == f", {text}\n"


@pytest.mark.parametrize("arguments", [["--scalar", "weight"], ["--shading", "scalar"]])
def test_view_without_a_joint_shows_the_joint_with_the_most_influence(render, rig, arguments):
    # The lowest and the highest square follow one joint each, the middle square both equally.
    skin = rig[1].read_text().replace("2 0 0.5 1 0.5", "2 0 0.25 1 0.75")
    rig[1].write_text(skin)
    files = [str(path) for path in rig]
    pixels, said = render(*files, *arguments)
    assert "Weight of arm: 0 to 1" in said and "weight: shows arm" in said
    np.testing.assert_array_equal(pixels, render(*files, "--scalar", "weight:arm")[0])


def test_joint_by_index_equals_joint_by_name(render, body):
    by_name, by_index, by_number = (
        render(body, "--scalar", f"weight:{joint}")[0] for joint in ("left_knee", "#4", "4")
    )
    np.testing.assert_array_equal(by_name, by_index)
    np.testing.assert_array_equal(by_name, by_number)
    assert (by_name != render(body, "--scalar", "weight:right_knee")[0]).any()


def test_legend_isolines_and_range_change_the_image(render, body):
    view = [body, "--scalar", "weight:left_knee"]
    plain = render(*view)[0]
    for option in ("--legend", "--no-isolines", "--scalar-range=0:0.5"):
        assert (render(*view, option)[0] != plain).any(), option
    np.testing.assert_array_equal(render(*view, "--isolines")[0], plain)


def test_legend_stays_in_its_corner(render, body):
    view = [body, "--scalar", "dominant"]
    changed = (render(*view)[0] != render(*view, "--legend")[0]).any(axis=2)
    rows, columns = np.nonzero(changed)
    assert rows.min() == columns.min() == 2
    assert columns.max() < 0.6 * 160


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["--scalar", "weight:left_kneee"],
            '--scalar weight:left_kneee: no joint is called "left_kneee"; did you mean left_knee?',
        ),
        (
            ["--scalar", "strech"],
            'argument --scalar: no scalar quantity "strech"; did you mean stretch?',
        ),
        (
            ["--scalar", "stretch:pelvis"],
            'argument --scalar: scalar quantity "stretch": expected no joint, found "pelvis"',
        ),
        (["--legend"], "--legend: expected --scalar NAME, to which it applies"),
        (["--no-isolines", "--shading", "parts"], None),
        (
            ["--scalar-range", "0:1"],
            "--scalar-range: expected --scalar NAME, to which it applies",
        ),
        (
            ["--scalar", "pruning", "--scalar-range", "5:1"],
            '--scalar-range: expected A:B, two numbers with A below B, found "5:1"',
        ),
        (
            ["--scalar", "pruning", "--scalar-range", "nan:inf"],
            '--scalar-range: expected A:B, two numbers with A below B, found "nan:inf"',
        ),
        (
            ["--scalar", "pruning", "--scalar-range", "7"],
            '--scalar-range: expected A:B, two numbers with A below B, found "7"',
        ),
        (
            ["--scalar", "dominant", "--scalar-range", "0:3"],
            "--scalar-range: dominant has one colour per integer",
        ),
    ],
)  # fmt: skip
def test_invalid_combinations_are_refused_in_one_line(render, body, arguments, message):
    if message is None:
        assert render(body, *arguments)[0].shape == (120, 160, 3)
        return
    code, said = render(body, *arguments)
    assert code == 2
    lines = said.splitlines()
    assert lines[0].startswith(f"viewer: {message}") and len(lines) == 1


@pytest.mark.parametrize(
    ("name", "note"),
    [
        ("parts", "--scalar parts: Body parts: no figure has body parts"),
        ("asymmetry", "--scalar asymmetry: Asymmetry: no figure has a symmetry map"),
        ("correctives", "--scalar correctives: Effect of pose correctives: no figure has pose "
                        "correctives"),
    ],
)  # fmt: skip
def test_figure_without_the_requested_data_is_drawn_with_a_note(render, name, note):
    picture, said = render("--scalar", name, "--legend")
    assert picture.shape[:2] == (120, 160)
    assert said.splitlines()[-1] == f"warning: {note}"


def test_skeleton_without_a_skin_has_no_weights(render, tmp_path):
    from viewer.resources import resource

    skel = str(resource("assets", "samples", "fox.skel"))
    _, said = render(skel, "--scalar", "weight:head", "--legend")
    note = "--scalar weight:head: Weight of a joint: no figure has weights"
    assert said.splitlines()[-1] == f"warning: {note}"


def test_scalar_values_of_a_sequence_are_drawn_with_a_legend(body, tmp_path):
    sheets = []
    for option in ("--legend", "--samples=4"):
        path = tmp_path / "sheet.png"
        arguments = ["--scalar", "dominant", "--turntable", "180deg", "--contact-sheet", "2"]
        more = ["--size", "480x180", "--quality", "draft", "--force", "-o", str(path)]
        assert run(["render", body, *arguments, option, *more]) == 0
        sheets.append(np.array(Image.open(path)).astype(int))
    changed = np.abs(sheets[0] - sheets[1]).sum(axis=2) > 0
    half = changed.shape[1] // 2
    for cell in (changed[:, :half], changed[:, half:]):
        rows, columns = np.nonzero(cell)
        # The second half starts with part of the gutter.
        assert rows.min() <= 3 and columns.min() <= 6 and columns.max() < 0.7 * half


def test_unknown_field_suggests_the_nearest_name():
    far = VertexField("distance", "Distance", np.zeros(3), "length")
    matched = VertexField("match", "Match", np.zeros(3), names=("matched",))
    scene = Scene([Actor(Figure("scan", mesh(np.eye(3)), fields=(far, matched)))])
    for name, hint in (
        ("field:distanc", 'no field is called "distanc"; did you mean distance?'),
        ("class:distance", 'no field is called "distance"; there is 1: match'),
    ):
        with pytest.raises(ViewerError) as caught:
            scalar_notes(scene, DisplayOptions(shading="scalar", scalar=name))
        assert str(caught.value) == f"--scalar {name}: {hint}"


def test_unknown_joint_is_searched_for_in_every_figure(render, body):
    fox = [str(resource("assets", "samples", name)) for name in ("fox.skel", "fox.skin")]
    _, said = render(*fox, body, "--scalar", "weight:left_kne")
    assert "did you mean left_knee?" in said
