"""Animations of opened figures, of which the first or the requested one plays."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formats.mhr.mhr_files import N_EXPRESSIONS, N_IDENTITY, NAMES, forward, write
from numpy.testing import assert_allclose
from rigs.animated import animated_leg, animation, bow, leg

import viewer
from viewer.commands._info_clips import animation_lines, describe_animations
from viewer.diagnostics import Diagnostic
from viewer.errors import FormatError, RigError
from viewer.formats import Source, read
from viewer.loading import Contents, MotionSettings, begin, bundled_body
from viewer.loading.capturing import Builder
from viewer.rigs.captures.capture import Capture, CapturePart
from viewer.rigs.captures.points import PointClip, PointLayout
from viewer.rigs.figure import Figure, FigureGroup, read_from
from viewer.rigs.geometry.rotation import quaternion_to_matrix, rotation_vector_to_matrix
from viewer.rigs.motion.body_motion import ParameterMotion
from viewer.rigs.motion.timing import Timing
from viewer.rigs.motion.transform_clip import Animation
from viewer.rigs.pose import joint_rotations
from viewer.rigs.scene import pose_actors
from viewer.rigs.skinning import deform


def opened(*figures, animation="", files=None):
    paths = files or [Path("hero.glb")] * len(figures)
    read = [read_from(path, figure) for path, figure in zip(paths, figures, strict=True)]
    contents = Contents(figures=list(zip(paths, read, strict=True)))
    return begin(contents, MotionSettings(animation=animation))[0]


def test_first_animation_plays_from_its_start():
    actor = opened(animated_leg()).actors[0]
    assert actor.clip is actor.figure.animations[0].clip() and actor.animation == 0
    assert actor.pose.shape_weights[1] == 0.5  # the value of the first weight key
    assert actor.clip.start == 0.5  # clips keep their times


def test_requested_animation_plays_in_every_figure_of_the_file():
    hero, hat = animated_leg(), replace(leg(name="hat"), animations=(animation(bow()),))
    scene = opened(hero, hat, animation="BOW")
    assert [actor.animation for actor in scene.actors] == [1, 0]
    scene = opened(hero, hat)
    assert [actor.animation for actor in scene.actors] == [0, -1]
    assert scene.actors[1].clip is None
    scene = opened(hero, hat, files=[Path("hero.glb"), Path("hat.glb")])
    assert [actor.animation for actor in scene.actors] == [0, 0]
    assert [actor.clip for actor in opened(hero, hat, animation="none").actors] == [None, None]


def test_characters_without_common_animations_play_their_first_ones():
    hero = animated_leg()
    horse = replace(leg(name="horse"), animations=(animation(replace(bow(), name="trot")),))
    scene = opened(hero, horse)
    assert [actor.animation for actor in scene.actors] == [0, 0]
    assert [actor.clip.name for actor in scene.actors] == ["wave", "trot"]
    # On request, only characters with that animation move.
    assert [actor.animation for actor in opened(hero, horse, animation="trot").actors] == [-1, 0]


def test_skeleton_without_a_mesh_moves_only_figures_of_other_files():
    rig = Figure("rig", skeleton=leg().skeleton, unit="m", animations=(animation(bow()),))
    contents = Contents(figures=[(Path("a.glb"), rig), (Path("a.glb"), leg())])
    contents.groups = [FigureGroup("a", (rig, contents.figures[1][1]))]
    assert [actor.figure.name for actor in begin(contents)[0].actors] == ["rig", "leg"]
    contents.groups = [FigureGroup(name, (figure,)) for name, (_, figure) in
                       zip("ab", contents.figures, strict=True)]  # fmt: skip
    (moved,) = begin(contents)[0].actors
    assert moved.figure.name == "leg" and moved.clip is not None


@pytest.mark.parametrize(
    ("figure", "key"), [(animated_leg(), "F004.animation"), (leg(), "F004.no-animations")]
)
def test_missing_animation_is_refused(figure, key):
    with pytest.raises(RigError) as refused:
        opened(figure, animation="jump")
    assert refused.value.diagnostic.key == key


def test_invalid_keys_are_an_error_only_if_their_animation_is_requested(tmp_path):
    def refuse():
        raise FormatError(Diagnostic("F002.misfit: {message}", tmp_path, values={"message": "bad"}))

    broken = leg(animations=(Animation("bad", 0.0, 1.0, refuse), animation(bow())))
    scene = opened(broken)
    assert scene.actors[0].clip is None
    assert [found.key for found in scene.diagnostics] == ["F002.misfit"]
    with pytest.raises(FormatError):
        opened(broken, animation="bad")
    assert opened(broken, animation="bow").actors[0].animation == 1


def test_info_lists_all_animations_without_reading_their_keys():
    actor = opened(animated_leg(), animation="bow").actors[0]
    found = describe_animations(actor)
    assert [(one["number"], one["name"], one["plays"]) for one in found] == [
        (1, "wave", False),
        (2, "bow", True),
    ]
    assert found[0]["range"] == [0.5, 2.5]
    assert animation_lines(found) == [
        "  animations 1  wave: 0.5 to 2.5 s",
        "             2* bow: 0 to 0.208 s",
    ]


BENT = 0.3 * np.sin(np.arange(69.0)).reshape(23, 3)
ROOT = np.array([0.0, 0.4, 0.0])


def opened_result(folder: Path, **values: Any) -> Any:
    path = folder / "result.npz"
    np.savez(path, **values)
    return viewer.load(path)


@pytest.mark.parametrize("is_whole", [True, False])
def test_pose_of_smpl_is_shown_on_the_bundled_body(tmp_path, is_whole):
    whole = np.concatenate([ROOT, BENT.ravel()])
    parts = {"global_orient": ROOT[None], "body_pose": BENT.reshape(1, 69)}
    scene = opened_result(
        tmp_path, betas=np.zeros((1, 10)), **({"pose": whole} if is_whole else parts)
    )
    (actor,) = scene.actors
    assert actor.figure.name == bundled_body().stem
    turned = joint_rotations(actor.figure.skeleton, actor.pose)
    wanted = rotation_vector_to_matrix(np.concatenate([ROOT[None], BENT]))
    assert_allclose(turned, wanted, rtol=0, atol=1e-9)  # rounding of rotations


def test_fingers_and_face_keep_their_joints(tmp_path):
    hand = np.linspace(-0.2, 0.2, 45)
    scene = opened_result(
        tmp_path,
        body_pose=BENT[:21].ravel(),
        jaw_pose=ROOT,
        left_hand_pose=hand,
        flat_hand_mean=True,
    )
    # The bundled body has neither a jaw nor fingers: both are named as omitted.
    (note,) = [note for note in scene.diagnostics if note.key == "F007.joints-left-out"]
    assert note.values["n"] == 16
    assert note.values["names"][:2] == ["jaw", "left_index1"]


@pytest.mark.parametrize(
    "values",
    [
        {"body_pose": np.zeros(69), "global_orient": np.zeros(4)},
        {"pose": np.zeros(71)},
        {"betas": np.zeros(10)},
        {"body_pose": np.zeros(63), "scale": 2.0},
        {"body_pose": np.zeros(63), "left_hand_pose": np.zeros(45), "flat_hand_mean": False},
    ],
)
def test_other_poses_need_a_figure(tmp_path, values):
    with pytest.raises(RigError) as refused:
        opened_result(tmp_path, **values)
    expected = "F004.shape-alone" if set(values) == {"betas"} else "F004.pose-alone"
    assert refused.value.diagnostic.key == expected


def test_poses_with_a_figure_are_applied_to_it(tmp_path):
    path = tmp_path / "result.npz"
    np.savez(path, pose=np.concatenate([ROOT, BENT.ravel()]))
    (actor,) = viewer.load(bundled_body(), path).actors
    assert actor.clip is None
    turned = quaternion_to_matrix(actor.pose.rotations)
    assert_allclose(turned, np.tile(np.eye(3), (24, 1, 1)), atol=1e-12)  # the DOFs rotate


IDENTITY = np.linspace(-1.0, 1.0, 4 * N_IDENTITY).reshape(4, -1)
PARAMETERS = np.sin(np.arange(4 * len(NAMES))).reshape(4, -1)
EXPRESSION = np.zeros((4, N_EXPRESSIONS))
PLACES = np.arange(12.0).reshape(4, 3)


def parts():
    """Yield two parts of two frames; person 0 has parameters and points, person 1 only points."""
    for start in (0, 2):
        rows = np.full(4, -1, dtype=np.int32)
        rows[start : start + 2] = 0, 1
        timing, chosen = Timing(30.0, rows), slice(start, start + 2)
        layout = PointLayout("spots", ("a", "b"), np.zeros((0, 2)), np.zeros(2))
        clip = PointClip("spots", timing, np.ones((2, 2, 4)))
        motion = ParameterMotion(
            "sam",
            timing,
            PARAMETERS[chosen],
            IDENTITY[chosen],
            EXPRESSION[chosen],
            PLACES[chosen],
        )
        both = {0: (layout, clip), 1: (layout, clip)}
        yield CapturePart(start + 2, points=both, parameters={0: motion})


@pytest.fixture
def build():
    def built(model):
        builder = Builder(Capture("people", 4, 0, parts, up="y"), model)
        while not builder.is_done:
            builder.read_some()
        return builder.actors

    return built


def test_people_with_parameters_are_shown_with_the_model(tmp_path, build):
    model = read(Source.open(write(tmp_path)))
    body, points = build(model)
    assert (body.figure is model, points.figure.points is not None) == (True, True)
    for frame in range(4):
        pose_actors([body], frame / 30.0)
        wanted = 0.01 * forward(IDENTITY[frame], PARAMETERS[frame], EXPRESSION[frame])[0]
        assert_allclose(deform(model, body.pose)[0], wanted + PLACES[frame], atol=1e-9)


def test_other_bodies_show_only_the_points(build):
    actors = build(read(Source.open(bundled_body())))
    assert len(actors) == 2 and all(actor.figure.points is not None for actor in actors)
