"""BVH among other files: common units, driven models, and messages about both."""

import json

import numpy as np
import pytest
from formats.bvh_text import PERSON_JOINTS, PERSON_TURNED, person
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose

import viewer
from viewer.errors import FormatError, RigError
from viewer.loading import MotionSettings, bundled_body, load
from viewer.rigs.scene import pose_actors, scene_box

BESIDE = MotionSettings(drives=False)
GUESS = "centimetres assumed (skeleton 170 high)"


@pytest.fixture
def bvh(tmp_path):
    """Write a BVH file of a person in the given unit and return its path."""

    def write(scale=100.0, name="walk.bvh", text=None):
        path = tmp_path / name
        path.write_text(person(scale) if text is None else text)
        return path

    return write


def places(actor, time=0.1):
    """Return the joint positions at some time, keyed by the names in the file."""
    pose_actors([actor], time)
    found = viewer.joint_matrices(actor.figure, actor.pose)[:, :3, 3]
    return [found[actor.figure.skeleton.names.index(name)] for name in PERSON_JOINTS]


def units(scene):
    return [actor.figure.unit for actor in scene.actors]


def test_single_bvh_keeps_its_file_units(bvh):
    path = bvh()
    scene = load(path)
    assert units(scene) == ["cm"] and scene.warnings == (f"{path}: {GUESS}; --unit overrides it",)
    assert_allclose(places(scene.actors[0]), 100 * np.array(PERSON_TURNED), rtol=0, atol=1e-9)


def test_bvh_with_a_body_is_scaled_to_metres(bvh):
    path = bvh()
    scene = load(path, bundled_body(), motion=BESIDE)
    note = f"{path}: {GUESS}, and scaled to metres to match the others; --unit overrides it"
    assert units(scene) == ["m", "m"] and scene.warnings == (note,)
    skeleton = scene.actors[1]
    assert skeleton.figure.mesh is None
    assert_allclose(places(skeleton), PERSON_TURNED, rtol=0, atol=1e-12)
    facts = dict(skeleton.figure.facts)
    assert facts["unit"] == "cm, estimated from the skeleton's size of 170; scaled to metres"
    # In common units the box is as high as the people, who stand next to each other.
    width, height, _ = np.ptp(scene_box(scene), axis=0)
    assert 1.7 < height < 2.5 and width < 4.0


@pytest.mark.parametrize(("scale", "word"), [(100, "centimetres"), (1000, "millimetres")])
def test_bvh_is_scaled_to_match_figures_of_metre_size(bvh, scale, word):
    fox = viewer.loading.bundled_files()
    scene = load(*fox, bvh(scale))
    assert [actor.figure.name for actor in scene.actors] == ["fox", "walk"]
    assert units(scene) == ["", "m"]
    assert f"{word} assumed" in scene.warnings[-1] and "scaled to metres" in scene.warnings[-1]
    assert_allclose(places(scene.actors[1]), PERSON_TURNED, rtol=0, atol=1e-12)


def test_bvh_with_figures_of_unknown_unit_and_different_size_is_unscaled(bvh, tmp_path):
    giant = tmp_path / "giant.obj.skel"
    giant.write_text("balljoint root { offset 0 0 0 balljoint tip { offset 0 20 0 } }")
    scene = load(giant, bvh())
    assert units(scene) == ["", "cm"]
    assert scene.warnings[-1].endswith(f"{GUESS}; --unit overrides it")


def test_two_bvh_files_are_scaled_only_if_their_units_differ(bvh):
    first, second = bvh(), bvh(name="b.bvh")
    assert units(load(first, second)) == ["cm", "cm"]
    for other in (bvh(1, "m.bvh"), bvh(1000, "mm.bvh")):
        scene = load(first, other)
        assert units(scene) == ["m", "m"]
        for actor in scene.actors:
            assert_allclose(places(actor), PERSON_TURNED, rtol=0, atol=1e-12)


def test_bvh_is_scaled_to_match_captured_keypoints(bvh, tmp_path):
    folder = tmp_path / "out" / "keypoints3d"
    folder.mkdir(parents=True)
    points = [[0.1 * k, 0.0, 0.05 * k, 1.0] for k in range(25)]
    (folder / "000000.json").write_text(json.dumps([{"id": 0, "keypoints3d": points}]))
    scene = load(tmp_path / "out", bvh())
    skeleton = next(actor for actor in scene.actors if actor.figure.skeleton is not None)
    assert skeleton.figure.unit == "m"


def test_unknown_units_are_never_scaled(bvh):
    path = bvh(10)
    scene = load(path, bundled_body(), motion=BESIDE)
    assert units(scene) == ["m", ""]
    assert scene.warnings == (f"{path}: unit unknown (skeleton 17 high); state it with --unit",)


@pytest.mark.parametrize(
    ("unit", "scale"), [("m", 1), ("cm", 100), ("mm", 1000), ("in", 1 / 0.0254)]
)
def test_requested_unit_is_used_without_a_guess(bvh, unit, scale):
    scene = load(bvh(scale), motion=MotionSettings(unit=unit))
    assert units(scene) == ["m"] and scene.warnings == ()
    assert_allclose(
        places(scene.actors[0]), PERSON_TURNED, rtol=0, atol=1e-7
    )  # The file has six decimals.
    fact = dict(scene.actors[0].figure.facts)["unit"]
    assert fact == f"{unit} in the file, as requested" + "; scaled to metres" * (unit != "m")


def test_requested_up_axis_is_used_without_a_guess(bvh):
    text = person(1.0).replace("0.000000 -0.050000 0.000000", "0.000000 0.000000 -0.050000")
    for number in ("-0.400000", "-0.450000", "0.600000", "0.200000"):
        text = text.replace(f"0.000000 {number} 0.000000", f"0.000000 0.000000 {number}")
    path = bvh(text=text)
    note = "z up assumed: the head is above the feet along z"
    assert f"{path}: {note}; --up overrides it" in load(path).warnings
    asked = load(path, motion=MotionSettings(up="z"))
    assert asked.up == "z" and asked.warnings == ()


def test_bvh_drives_the_body_model(bvh):
    path = bvh()
    named = load(path, motion=MotionSettings(model=bundled_body()))
    among = load(path, bundled_body())
    assert [actor.figure.name for actor in named.actors] == ["body"]
    assert named.warnings == among.warnings
    # With the End Sites of the shins as ankles.
    assert any("walk drives 8 of 24 joints of body" in text for text in named.warnings)
    assert not any("assumed (skeleton" in text for text in named.warnings)
    one, other = named.actors[0].clip, among.actors[0].clip
    assert np.array_equal(one.rotations, other.rotations)
    assert np.array_equal(one.figure_translations, other.figure_translations)
    # In the second frame the body lies on its side, with one hip above the other.
    hips = places(named.actors[0])[1], places(named.actors[0])[3]
    along = (hips[0] - hips[1]) / np.linalg.norm(hips[0] - hips[1])
    assert along[1] > 0.99


def test_every_motion_drives_a_separate_model(bvh):
    scene = load(bvh(), bvh(1, "b.bvh"), motion=MotionSettings(model=bundled_body()))
    first, second = scene.actors
    assert first.figure is second.figure and (first.clip.name, second.clip.name) == ("walk", "b")


def test_model_opens_together_with_other_figures(bvh):
    scene = load(
        *viewer.loading.bundled_files(), bvh(), motion=MotionSettings(model=bundled_body())
    )
    assert [actor.figure.name for actor in scene.actors] == ["fox", "body"]
    assert scene.actors[0].clip is None and scene.actors[1].clip is not None


def test_model_without_matching_joints_is_refused(bvh, tmp_path):
    snake = "HIERARCHY ROOT a { OFFSET 0 0 0 CHANNELS 1 Xrotation End Site { OFFSET 0 1.7 0 } }"
    path = bvh(text=f"{snake} MOTION Frames: 1 Frame Time: 0.1\n0\n")
    with pytest.raises(RigError) as caught:
        load(path, motion=MotionSettings(model=bundled_body()))
    message = str(caught.value)
    assert message.startswith(f"{path}: walk does not match body: expected hips and a leg or")
    assert message.endswith("(--model selects the model)")
    with pytest.raises(FormatError) as wrong:
        load(path, motion=MotionSettings(model=path))
    assert str(wrong.value) == f"{path}: --model: not a body model"


def test_option_beside_ignores_the_model_with_a_note(bvh):
    path = bvh()
    scene = load(path, motion=MotionSettings(model=bundled_body(), drives=False))
    assert units(scene) == ["cm"]
    assert (
        scene.warnings[0] == f"--model {bundled_body()}: no motion is applied to it with --beside"
    )


@pytest.mark.parametrize("named", [False, True])
def test_figures_driven_by_an_upside_down_world_are_upright(bvh, named):
    down = person(1.0)
    for number in ("-0.050000", "-0.400000", "-0.450000", "0.600000", "0.200000"):
        other = number.removeprefix("-") if number.startswith("-") else f"-{number}"
        down = down.replace(f" {number} 0.000000", f" {other} 0.000000")
    path = bvh(text=down)
    settings = MotionSettings(up="-y", model=bundled_body() if named else None)
    scene = load(path, *([] if named else [bundled_body()]), motion=settings)
    (actor,) = scene.actors
    pose_actors([actor], 0.0)
    joints = viewer.joint_matrices(actor.figure, actor.pose)[:, :3, 3]
    joints = joints @ actor.placement[:3, :3].T
    names = actor.figure.skeleton.names
    assert joints[names.index("head"), 1] > joints[names.index("left_knee"), 1] + 0.5


def test_body_written_as_bvh_round_trips_on_its_model(tmp_path):
    from viewer.cli import run

    smpl = tmp_path / "SMPL.npz"
    np.savez(smpl, **model("smpl"))
    rng = np.random.default_rng(4)
    arrays = {
        "poses": rng.uniform(-0.9, 0.9, (3, 72)), "trans": rng.normal(0, 1, (3, 3)),
        "betas": np.zeros(16), "mocap_framerate": 30.0, "gender": "neutral",
    }  # fmt: skip
    np.savez(tmp_path / "a.npz", **arrays)
    for source, target in (("a.npz", "a.bvh"), ("a.bvh", "b.npz")):
        files = [str(tmp_path / source), "--model", str(smpl), "-o", str(tmp_path / target)]
        assert run(["convert", *files, "--up", "y", "--digits", "9"]) == 0
    with np.load(tmp_path / "b.npz") as back:
        assert_allclose(back["trans"], arrays["trans"], rtol=0, atol=1e-6)
        assert_allclose(back["poses"], arrays["poses"], rtol=0, atol=1e-6)
