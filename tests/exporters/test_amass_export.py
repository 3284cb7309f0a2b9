"""AMASS export, from which smplx must reproduce the motion of the figure."""

import faults
import numpy as np
import pytest
from builders import rotation
from exporting import export_frames
from family_animations import (
    clip_animation,
    family_animation,
    family_motion,
    vertices_about_origin,
    vertices_about_pelvis,
    waves,
)
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose, assert_array_equal

import viewer
from viewer.errors import OutputError, RigError
from viewer.exporters import ExportOptions, exporters_of
from viewer.formats import Source, read
from viewer.rigs.motion.body_motion import BodyMotion, body_clip
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing

# In metres and radians, for angles recovered by an arctangent of values near 1.
ATOL = 1e-13
COUNTS = {"smpl": 24, "smplh": 52, "smplx": 55}
GAPS = np.array([-1, 0, 1, -1, -1, 2, 3])  # frames 0, 3 and 4 are missing


def written(animation, path, **options):
    """Export an animation; return the arrays in the file and the warnings."""
    notes = faults.lines(export_frames(animation, path, "amass", ExportOptions(**options)))
    with np.load(path) as arrays:
        return dict(arrays), notes


def test_suffix_finds_the_exporter():
    assert "amass" in exporters_of("walk.npz", "frames")


@pytest.mark.parametrize("kind", COUNTS)
def test_file_reproduces_the_poses_of_the_model(family, tmp_path, kind):
    motion = family_motion(COUNTS[kind])
    path = tmp_path / "walk.npz"
    arrays, notes = written(family_animation(family(kind), motion), path, world_up="z")
    title = {"smpl": "SMPL", "smplh": "SMPL+H", "smplx": "SMPL-X"}[kind]
    assert notes == [f"{path}: 4 frames of {title} at 50 fps, z up"]
    assert (arrays["poses"].shape, arrays["betas"].shape) == ((4, 3 * COUNTS[kind]), (16,))
    assert_array_equal(arrays["betas"], [*waves(10, seed=2.0), *[0.0] * 6])
    assert (arrays["mocap_framerate"], arrays["mocap_frame_rate"]) == (50.0, 50.0)
    texts = [str(arrays[key]) for key in ("gender", "surface_model_type", "up")]
    assert texts == ["neutral", kind, "z"]
    assert "expressions" not in arrays and "present" not in arrays
    for frame in range(4):
        found = vertices_about_pelvis(
            model(kind), arrays["poses"][frame], arrays["trans"][frame], arrays["betas"][:10]
        )
        expected = vertices_about_origin(
            model(kind),
            motion.vectors[frame],
            motion.vectors[frame, 0],
            motion.translations[frame],
            motion.shape[0],
        )
        assert_allclose(found, expected, rtol=0, atol=ATOL)


def test_transl_follows_the_formula_of_the_specification(family, tmp_path):
    motion = family_motion(24)
    arrays, _ = written(family_animation(family("smpl"), motion), tmp_path / "a.npz")
    numbers = model("smpl")
    shape = numbers["v_template"] + numbers["shapedirs"] @ motion.shape[0]
    pelvis = (numbers["J_regressor"] @ shape)[0]
    for frame in range(4):
        turned = rotation(motion.vectors[frame, 0]) @ pelvis
        expected = motion.translations[frame] + turned - pelvis
        assert_allclose(arrays["trans"][frame], expected, rtol=0, atol=ATOL)
        # Angles below pi round-trip.
        assert_allclose(arrays["poses"][frame], motion.vectors[frame].ravel(), rtol=0, atol=ATOL)


def test_file_is_read_back(family, tmp_path):
    motion = family_motion(55, expression=waves(4, 10, seed=5.0))
    path = tmp_path / "walk.npz"
    arrays, _ = written(family_animation(family("smplx"), motion), path)
    assert_array_equal(arrays["expressions"], waves(4, 10, seed=5.0))
    source = Source.open(path)
    back = read(source)
    assert isinstance(back, BodyMotion)
    assert (source.warnings, back.up, back.timing.frame_rate) == ([], "y", 50.0)
    first, second = (body_clip(given, family("smplx"))[0] for given in (motion, back))
    for name in ("rotations", "figure_translations", "shape_weights"):
        found, wanted = (getattr(clip, name) for clip in (second, first))
        assert_allclose(found, np.broadcast_to(wanted, found.shape), rtol=0, atol=ATOL)


def test_large_angles_keep_their_rotation(family, tmp_path):
    vectors = np.zeros((3, 24, 3))
    vectors[:, 0] = [[0, 4.0, 0], [0, np.pi, 0], [0, 0, 1e-9]]
    motion = family_motion(24, frames=3)
    motion = BodyMotion("a", motion.timing, motion.joint_names, vectors, motion.translations)
    arrays, _ = written(family_animation(family("smpl"), motion), tmp_path / "a.npz")
    found = arrays["poses"][:, :3]
    assert_allclose(found[0], [0, 4.0 - 2 * np.pi, 0], rtol=0, atol=ATOL)
    assert_allclose(found[1], [0, np.pi, 0], rtol=0, atol=ATOL)
    assert_allclose(found[2], [0, 0, 1e-9], rtol=1e-12, atol=0)


def test_different_up_axis_rotates_the_world(family, tmp_path):
    motion = family_motion(24)
    animation = family_animation(family("smpl"), motion)
    plain, _ = written(animation, tmp_path / "y.npz", world_up="y")
    turned, notes = written(animation, tmp_path / "z.npz", world_up="y", up="z")
    assert notes[0].endswith("z up") and str(turned["up"]) == "z"
    for frame in range(4):
        before, after = (
            vertices_about_pelvis(
                model("smpl"), arrays["poses"][frame], arrays["trans"][frame], arrays["betas"][:10]
            )
            for arrays in (plain, turned)
        )
        # (x, y, z) -> (x, -z, y) converts from y up to z up.
        expected = np.stack([before[:, 0], -before[:, 2], before[:, 1]], axis=1)
        assert_allclose(after, expected, rtol=0, atol=ATOL)


def test_changing_shapes_have_a_row_per_frame(family, tmp_path):
    shapes = waves(4, 10, seed=7.0)
    motion = family_motion(24, shape=shapes)
    arrays, notes = written(family_animation(family("smpl"), motion), tmp_path / "a.npz")
    assert_array_equal(arrays["betas"][:, :10], shapes)
    assert notes[1:] == [
        "the shape changes: betas has one row per frame, which few programs support"
    ]
    for frame in (0, 3):
        found = vertices_about_pelvis(
            model("smpl"), arrays["poses"][frame], arrays["trans"][frame], shapes[frame]
        )
        vectors, move = motion.vectors[frame], motion.translations[frame]
        expected = vertices_about_origin(model("smpl"), vectors, vectors[0], move, shapes[frame])
        assert_allclose(found, expected, rtol=0, atol=ATOL)


# Gaps


def test_pose_is_held_in_gaps_and_marked(family, tmp_path):
    motion = family_motion(24, rows=GAPS, first_frame=10)
    arrays, notes = written(family_animation(family("smpl"), motion), tmp_path / "a.npz")
    assert arrays["present"].tolist() == [False, True, True, False, False, True, True]
    rows = np.array([0, 0, 1, 1, 1, 2, 3])
    expected = motion.vectors.reshape(4, 72)[rows]
    assert_allclose(arrays["poses"], expected, rtol=0, atol=ATOL)
    assert notes[1:] == [
        "missing frames 10, 13 to 14: the last pose is held, or the first one at the start, and "
        "the frames are marked in present"
    ]
    back = read(Source.open(tmp_path / "a.npz"))
    assert (back.timing.rows >= 0).tolist() == arrays["present"].tolist()


def test_gaps_are_interpolated(family, tmp_path):
    vectors = np.zeros((2, 24, 3))
    vectors[:, 0, 1] = 0.0, 0.9
    moves = np.array([[0.0, 0, 0], [3.0, 0, 0]])
    motion = BodyMotion("a", Timing(30.0, np.array([0, -1, -1, 1])),
                        family_motion(24).joint_names, vectors, moves)  # fmt: skip
    arrays, notes = written(
        family_animation(family("smpl"), motion), tmp_path / "a.npz", gaps="interpolate"
    )
    assert_allclose(arrays["poses"][:, 1], [0, 0.3, 0.6, 0.9], rtol=0, atol=ATOL)
    assert_allclose(arrays["trans"][:, 0], [0, 1, 2, 3], rtol=0, atol=ATOL)
    assert notes[1].endswith("interpolated along the shorter arc, and marked in present")


def test_gaps_split_the_file(family, tmp_path):
    motion = family_motion(24, rows=GAPS)
    notes = faults.lines(export_frames(
        family_animation(family("smpl"), motion), tmp_path / "a.npz", "amass",
        ExportOptions(gaps="split"),
    ))  # fmt: skip
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a-1.npz", "a-2.npz"]
    assert notes == [
        f"{tmp_path}/a-1.npz: 2 frames of SMPL at 50 fps, y up",
        f"{tmp_path}/a-2.npz: 2 frames of SMPL at 50 fps, y up",
        "missing frames 0, 3 to 4: omitted between the files",
    ]
    with np.load(tmp_path / "a-2.npz") as arrays:
        assert_allclose(arrays["poses"], motion.vectors[2:].reshape(2, 72), rtol=0, atol=ATOL)
        assert "present" not in arrays


# Data that the format cannot represent


def test_losses_are_reported(family, tmp_path):
    figure = family("smpl")
    rotations = np.tile([0.0, 0, 0, 1], (2, 24, 1))
    moved = np.zeros((2, 24, 3))
    moved[:, 0], moved[1, 5] = [1.0, 2.0, 3.0], [0.15, 0.2, 0.0]
    clip = SampledClip("a", Timing(30.0, np.arange(2)), rotations, moved,
                       np.array([[0.5, 0, 0]] * 2), np.array([1.0, 1.5]))  # fmt: skip
    arrays, notes = written(clip_animation(figure, clip), tmp_path / "a.npz")
    # A root that moves relative to the figure moves the whole body.
    assert_array_equal(arrays["trans"], [[1.5, 2.0, 3.0]] * 2)
    assert notes[1].startswith(f"{tmp_path}/a.npz: joints differ from the motion by up to ")
    assert notes[2:] == [
        "translations of joints are omitted (up to 0.25 m)",
        "the figure's scale is omitted (1 to 1.5)",
    ]


def test_export_of_the_bundled_body_states_the_model_of_its_shape(tmp_path):
    from viewer.loading import bundled_body

    figure = viewer.load(bundled_body()).actors[0].figure
    motion = family_motion(24, shape=None)
    _, notes = written(family_animation(figure, motion), tmp_path / "a.npz")
    assert notes[1].startswith(f"shape and translation are those of {figure.name}, which is no")


def test_figures_of_other_families_are_refused(family, tmp_path):
    rotations = np.tile([0.0, 0, 0, 1], (1, 16, 1))
    hand = SampledClip("a", Timing(30.0, np.arange(1)), rotations)
    with pytest.raises(RigError) as caught:
        written(clip_animation(family("mano"), hand), tmp_path / "a.npz")
    assert str(caught.value) == (
        "mano cannot be written as an AMASS motion: expected the joints of SMPL, SMPL+H or "
        "SMPL-X, found different ones"
    )
    assert not list(tmp_path.iterdir())


def test_unknown_options_and_empty_motions_are_refused(family, tmp_path):
    animation = family_animation(family("smpl"), family_motion(24, rows=np.array([0, -1, 1])))
    for words, message in (
        (
            {"gaps": "close"},
            'handling of gaps: expected one of hold, interpolate, split, found "close"',
        ),
        ({"up": "x"}, 'up axis: expected y or z, found "x"'),
    ):
        with pytest.raises(RigError) as caught:
            written(animation, tmp_path / "a.npz", **words)
        assert str(caught.value) == message
    from dataclasses import replace

    nobody = replace(animation, frames=replace(animation.frames, present=np.zeros(3, dtype=bool)))
    with pytest.raises(RigError, match="no person is present in frame"):
        written(nobody, tmp_path / "a.npz")
    assert not list(tmp_path.iterdir())


def test_missing_folder_is_refused(family, tmp_path):
    animation = family_animation(family("smpl"), family_motion(24))
    with pytest.raises(OutputError):
        written(animation, tmp_path / "none" / "a.npz")
