"""Results of SAM 3D Body with the Momentum Human Rig, compared with the vertices of the file."""

import shutil

import numpy as np
from formats.mhr.mhr_files import N_EXPRESSIONS, N_IDENTITY, N_JOINTS, NAMES, forward, write
from formats.video_mocap.tool_files import wham_file
from formats.vrm.swinging import swinging
from numpy.testing import assert_allclose

from viewer.loading import MotionSettings, load
from viewer.models import save_model_folder
from viewer.rig.retargeting.joint_map import JointMap
from viewer.rig.skinning import deform

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


def files(tmp_path):
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
    scene = load(files(tmp_path), motion=settings)
    assert [actor.figure.name for actor in scene.actors] == ["mhr"]
    assert "F007.own-model" in [note.key for note in scene.diagnostics]


def test_bodies_of_other_files_use_their_model(tmp_path):
    settings = MotionSettings()
    other = wham_file(tmp_path)
    scene = load(files(tmp_path), other, motion=settings)
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
    (actor,) = (scene := load(files(tmp_path), motion=settings)).actors
    assert actor.figure.name == "hero" and actor.drive.motion.figure.skeleton.n_joints == N_JOINTS
    keys = [note.key for note in scene.diagnostics]
    assert "F007.own-carrier" in keys and "F007.model-of-parameters" not in keys


def test_figure_that_parameters_cannot_drive_is_reported(tmp_path):
    hero = tmp_path / "hero.vrm"
    hero.write_bytes(swinging(turn=False).glb())
    photo = files(tmp_path)
    save_model_folder(tmp_path)
    shutil.rmtree(tmp_path / "models")
    scene = load(photo, motion=MotionSettings(model=hero))
    assert [actor.figure.points is not None for actor in scene.actors] == [True]
    assert "F007.model-of-parameters" in [note.key for note in scene.diagnostics]
