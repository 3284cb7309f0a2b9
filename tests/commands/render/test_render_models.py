"""``viewer render`` of body models, in which each option changes the expected part of the image."""

import math

import numpy as np
import pytest
from app.tiny import write_rig
from exporters.small_rigs import pose_190, write_box
from formats.synthetic_smpl import model
from PIL import Image

from viewer.cli import run
from viewer.rigs.scalars import SCALARS

pytestmark = pytest.mark.slow

PLAIN = ["--background", "transparent", "--no-grid", "--samples", "1", "--size", "96x96"]
QUICK = ["--quality", "draft", "--force"]
SIDE = ["--orthographic", "--inclination", "0"]


@pytest.fixture
def draw(tmp_path):
    """Return a function that renders (H, W, 4) pixels; alpha is the silhouette."""

    def picture(*arguments):
        out = tmp_path / "drawn.png"
        assert run(["render", *map(str, arguments), *PLAIN, "-o", str(out), *QUICK]) == 0
        return np.array(Image.open(out).convert("RGBA")).astype(int)

    return picture


@pytest.fixture
def box(tmp_path):
    """A box of 1 x 2 x 3 with z up; the lower vertices are FEET, the upper BACK."""
    return write_box(tmp_path / "box")


def differing(one, other):
    return (one != other).any(axis=-1)


def covered(picture):
    return picture[..., 3] > 0


def rows(mask):
    """Return the first and last non-empty row."""
    found = np.flatnonzero(mask.any(axis=1))
    return found[0], found[-1]


def hues(pixels):
    """Return colours without their brightness."""
    return pixels[:, :3] / np.maximum(pixels[:, :3].sum(axis=1, keepdims=True), 1)


# Body parts


def test_hiding_one_part_does_not_hide_the_other(draw, tmp_path):
    # Two flags are on one pole, one above the other.
    flags = write_box(
        tmp_path / "flags",
        vertices="0 0 0\n2 0 0\n0 0 1\n0 0 2\n2 0 2\n0 0 3\n0 0 0\n0 0 0\n",
        faces_vert="0 1 2\n3 4 5\n",
        faces_tex="0 1 2\n0 1 2\n",
        body_parts="1\n1\n1\n2\n2\n2\n0\n0\n",
        reduced_faces=None,
    )
    view = [flags, *SIDE, "--azimuth", "0"]
    whole, upper, lower = (
        covered(draw(*view, *(f"--hide-part={name}" for name in hidden)))
        for hidden in ([], ["FEET"], ["BACK"])
    )
    assert upper.any() and lower.any() and ((upper | lower) == whole).all()
    assert rows(upper)[1] < rows(lower)[0]


def test_triangle_with_a_corner_in_a_visible_part_is_drawn(draw, box):
    # Only the lid of the box has all corners in the upper part, so the side view does not change.
    assert not differing(draw(box, *SIDE), draw(box, *SIDE, "--hide-part", "BACK")).any()
    above = ["--orthographic", "--inclination", "60"]
    whole, open_box = draw(box, *above), draw(box, *above, "--hide-part", "BACK")
    changed = differing(whole, open_box)
    assert changed.any() and not changed[-20:].any()
    assert (covered(whole) == covered(open_box)).all()  # the inside is visible instead


def test_hiding_all_parts_draws_an_empty_picture(draw, box):
    picture = draw(box, "--hide-part", "FEET", "--hide-part", "back")
    assert not covered(picture).any()


def test_hidden_part_without_vertices_has_no_effect(draw, box):
    assert not differing(draw(box), draw(box, "--hide-part", "not_body")).any()


def test_parts_have_colours(draw, box):
    picture = draw(box, *SIDE, "--shading", "parts")
    plain = draw(box, *SIDE)
    mask = covered(picture)
    assert (mask == covered(plain)).all()
    top, bottom = rows(mask)
    upper, lower = (hues(picture[row][mask[row]]).mean(axis=0) for row in (top + 2, bottom - 2))
    assert np.abs(upper - lower).max() > 0.1
    assert np.abs(hues(picture[top + 2][mask[top + 2]]) - upper).max() < 0.1


def test_part_shading_without_parts_is_plain(draw, tmp_path):
    picture = draw(*write_rig(tmp_path), "--shading", "parts")
    found = hues(picture[covered(picture)])
    assert len(found) and np.ptp(found, axis=0).max() < 0.02


# Reduced meshes


def test_reduced_mesh_is_a_corner_of_the_box(draw, box):
    view = [box, *SIDE, "--azimuth", "0"]
    whole, reduced = draw(*view), draw(*view, "--reduced")
    assert not (covered(reduced) & ~covered(whole)).any()
    # Along an axis, a triangle between corners of the box covers half of its rectangle.
    assert covered(reduced).sum() / covered(whole).sum() == pytest.approx(0.5, abs=0.03)
    assert rows(covered(reduced))[1] == rows(covered(whole))[1]  # the base is complete


def test_reduced_mesh_option_does_not_affect_other_figures(draw, tmp_path):
    rig = write_rig(tmp_path)
    assert not differing(draw(*rig), draw(*rig, "--reduced")).any()


# Values as colours


def test_influence_limit_error_is_shown_at_vertices_with_many_influences(draw, box):
    # Joint 4 rotates the corner (1, 2, 3), the only one with more than four influences.
    posed = [box, *SIDE, "--pose", pose_190(6, n17=math.pi)]
    changed = []
    for azimuth in (135, 315):
        view = [*posed, "--azimuth", azimuth]
        cut = draw(*view, "--scalar", "pruning")
        nothing = draw(*view, "--scalar", "pruning", "--scalar-range=0:1e9")
        assert (covered(cut) == covered(nothing)).all()
        changed.append(differing(cut, nothing).sum() / covered(cut).sum())
    # Two faces with this vertex are visible from one corner of the box, and none from the opposite
    # one.
    assert min(changed) == 0 and max(changed) > 0.5


# Figures without correctives or a symmetry map are drawn normally.
LACKED = ("correctives", "asymmetry")
MOVING = [name for name, view in SCALARS.items() if view.moves and name not in LACKED]


@pytest.mark.parametrize("name", MOVING)
def test_all_errors_of_a_figure_at_rest_are_0(draw, tmp_path, name):
    rig = [*write_rig(tmp_path), "--dof", "arm.x=0", "--dof", "arm.z=0"]
    picture = draw(*rig, "--scalar", name, "--flat")
    found = hues(picture[covered(picture)])
    # There is one colour with varying brightness; dark pixels are rounded to 1/255.
    assert len(found) and np.ptp(found, axis=0).max() < 0.04


def test_scalar_view_overrides_the_shading(draw, box):
    one = draw(box, "--scalar", "asymmetry")
    assert not differing(one, draw(box, "--scalar", "asymmetry", "--shading", "parts")).any()
    assert differing(one, draw(box, "--shading", "parts")).any()


def test_normalising_changes_values_and_mesh(draw, tmp_path):
    rows_of = [f"0 {vertex} 1" for vertex in range(7)]
    box = write_box(tmp_path / "box", skinning_weights="\n".join([*rows_of, "0 7 0.5"]))
    raw, normal = (draw(box, *SIDE, *o, "--distance", "9") for o in ([], ["--normalize"]))
    assert covered(normal).sum() > covered(raw).sum()
    view = [box, *SIDE, "--azimuth", "135"]
    shown, nothing = (draw(*view, "--scalar", name) for name in ("normalized", "correctives"))
    assert differing(shown, nothing).any()


# Keypoints


def test_keypoints_are_drawn_as_small_markers(draw, tmp_path):
    np.savez(tmp_path / "body.npz", **model("smplx", 96))
    plain, marked = draw(tmp_path / "body.npz"), draw(tmp_path / "body.npz", "--keypoints")
    changed = differing(plain, marked)
    # All 51 are visible through the surface.
    assert 51 < changed.sum() < 0.5 * covered(plain).sum()
    assert changed[covered(plain)].any()


def test_keypoints_follow_the_pose(draw, tmp_path):
    np.savez(tmp_path / "body.npz", **model("smplx", 96))
    turned = ["--pose", ",".join(["0", "0", "3.14159265"] + ["0"] * 162), "--distance", "5"]
    plain = draw(tmp_path / "body.npz", *turned)
    marked = draw(tmp_path / "body.npz", *turned, "--keypoints")
    still = draw(tmp_path / "body.npz", "--distance", "5")
    assert differing(plain, still).any()
    changed = differing(plain, marked)
    assert changed.any() and (changed & covered(plain)).sum() > 0.7 * changed.sum()


def test_keypoint_option_does_not_affect_other_figures(draw, box):
    assert not differing(draw(box), draw(box, "--keypoints")).any()


# Shape and pose


@pytest.mark.parametrize(
    "options",
    [
        ["--shape", "3"],
        ["--pose", ",".join(["0", "0", "1"] + ["0"] * 69)],
        ["--dof", "figure.scale=0.5", "--distance", "4"],
        ["--dof", "left_shoulder.z=60deg", "--no-correctives"],
    ],
)
def test_shape_and_pose_change_the_silhouette(draw, tmp_path, options):
    np.savez(tmp_path / "body.npz", **model("smpl", 96))
    rest = ["--distance", "4"] if "--distance" in options else []
    plain, changed = draw(tmp_path / "body.npz", *rest), draw(tmp_path / "body.npz", *options)
    assert (covered(plain) != covered(changed)).sum() > 50


def test_method_changes_the_image(draw, tmp_path):
    twisted = [*write_rig(tmp_path), "--dof", "arm.y=150deg"]
    lbs, dqs, mix = (draw(*twisted, "--method", name) for name in ("lbs", "dqs", "mix"))
    assert differing(lbs, dqs).any() and differing(lbs, mix).any() and differing(mix, dqs).any()


def test_bundled_body_is_drawn(draw):
    plain, heavy = draw("--body"), draw("--body", "--shape", "0,3")
    assert 0.05 < covered(plain).mean() < 0.6
    assert (covered(plain) != covered(heavy)).sum() > 20
