"""Body motions on figures, compared with the formula for every centre of rotation."""

import numpy as np
import pytest
from builders import rotation
from exporters.plain_smpl import smpl_forward
from faults import told
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose
from rigs.hand_made import skeleton

from viewer.errors import RigError
from viewer.rigs.bodies.smpl_family import FAMILY, ShapeSpace
from viewer.rigs.figure import Figure
from viewer.rigs.motion.body_motion import BodyMotion, body_clip, root_positions
from viewer.rigs.motion.evaluation import frames_of, pose_of, world_frames
from viewer.rigs.motion.timing import Timing
from viewer.rigs.skinning import deform

ATOL = 1e-12  # metres; a hundred rounding errors of values near 1
TURN, MOVE = np.array([0.7, -1.9, 0.4]), np.array([0.5, 2.0, -1.0])


def waves(*shape, seed=0.0):
    count = int(np.prod(shape))
    return 0.5 * np.sin(seed + 1.7 * np.arange(1, count + 1) ** 1.3).reshape(shape)


def motion(names, vectors, **words):
    """Return a motion of one or several frames."""
    vectors = np.reshape(vectors, (-1, len(names), 3))
    words = {"translations": np.tile(MOVE, (len(vectors), 1)), **words}
    return BodyMotion("a", Timing(30.0, np.arange(len(vectors))), names, vectors, **words)


def posed(figure, given, frame=0):
    """Return the vertices of a figure that a motion poses, and the notes."""
    clip, notes = body_clip(given, figure)
    frames = frames_of(figure, clip, np.array([frame / 30.0]))
    return deform(figure, pose_of(figure, frames, 0))[0], notes


def without_root(kind, vectors, shape=(), columns=None):
    """Return X of the paper: the vertices of the body posed with the root at rest."""
    pose = np.array(vectors)
    pose[0] = 0.0
    return smpl_forward(model(kind), shape, pose, columns)[0]


@pytest.mark.parametrize(("kind", "count"), [("smpl", 24), ("smplh", 52), ("smplx", 55)])
def test_root_rotates_about_the_origin(family, kind, count):
    vectors, shape = waves(count, 3), waves(10, seed=1.0)
    vectors[0] = TURN
    given = motion(FAMILY[count].names, vectors, about_origin=True, shape=shape[None])
    found, notes = posed(family(kind), given)
    expected = without_root(kind, vectors, shape) @ rotation(TURN).T + MOVE
    assert notes == []
    assert_allclose(found, expected, rtol=0, atol=ATOL)


@pytest.mark.parametrize("kind", ["smpl", "smplx"])
def test_root_rotates_about_the_pelvis(family, kind):
    names = FAMILY[24 if kind == "smpl" else 55].names
    vectors, shape = waves(len(names), 3), waves(10, seed=2.0)
    vectors[0] = TURN
    found, _ = posed(family(kind), motion(names, vectors, shape=shape[None]))
    arrays = model(kind)
    rest = arrays["v_template"] + arrays["shapedirs"][:, :, :10] @ shape
    pelvis = (arrays["J_regressor"] @ rest)[0]
    expected = (without_root(kind, vectors, shape) - pelvis) @ rotation(TURN).T + pelvis + MOVE
    assert_allclose(found, expected, rtol=0, atol=ATOL)


def test_world_rotates_the_posed_body_about_the_origin(family):
    vectors, shape, world = waves(24, 3), waves(10, seed=3.0), np.array([[1.5, 0.2, -0.6]])
    given = motion(FAMILY[24].names, vectors, shape=shape[None], world_rotations=world)
    found, _ = posed(family("smpl"), given)
    # Here, X includes the rotation of the root.
    body = smpl_forward(model("smpl"), shape, vectors)[0]
    assert_allclose(found, body @ rotation(world[0]).T + MOVE, rtol=0, atol=ATOL)


def test_every_frame_has_its_own_shape(family):
    vectors = np.stack([waves(24, 3, seed=seed) for seed in (0.0, 1.0)])
    vectors[:, 0] = TURN
    shapes = np.stack([waves(10, seed=4.0), waves(10, seed=5.0)])
    given = motion(FAMILY[24].names, vectors, about_origin=True, shape=shapes)
    for frame in (0, 1):
        found, _ = posed(family("smpl"), given, frame)
        expected = without_root("smpl", vectors[frame], shapes[frame]) @ rotation(TURN).T + MOVE
        assert_allclose(found, expected, rtol=0, atol=ATOL)


def test_expression_moves_face_and_root(family):
    vectors, expression = waves(55, 3), waves(10, seed=6.0)
    vectors[0] = TURN
    given = motion(FAMILY[55].names, vectors, about_origin=True, expression=expression[None])
    found, _ = posed(family("smplx"), given)
    body = without_root("smplx", vectors, expression, range(10, 20))
    assert_allclose(found, body @ rotation(TURN).T + MOVE, rtol=0, atol=ATOL)


@pytest.mark.parametrize("flat", [True, False])
@pytest.mark.parametrize(("kind", "count"), [("smplh", 52), ("smplx", 55)])
def test_hands_rotate_by_their_components(family, kind, count, flat):
    arrays, names = model(kind), FAMILY[count].names
    body, left, right = waves(22, 3), waves(6, seed=7.0), waves(12, seed=8.0)
    given = motion(
        names[:22], body, about_origin=True, hands={"left": left[None], "right": right[None]},
        flat_hands=flat,
    )  # fmt: skip
    found, notes = posed(family(kind), given)
    vectors = np.zeros((count, 3))
    vectors[:22] = body
    for side, first, numbers in (("l", count - 30, left), ("r", count - 15, right)):
        turned = numbers @ arrays[f"hands_components{side}"][: len(numbers)]
        turned = turned + (0.0 if flat else arrays[f"hands_mean{side}"])
        vectors[first : first + 15] = turned.reshape(15, 3)
    expected = without_root(kind, vectors) @ rotation(body[0]).T + MOVE
    assert notes == []
    assert_allclose(found, expected, rtol=0, atol=ATOL)


def test_mano_has_one_hand_for_any_side(family):
    arrays = model("mano")
    numbers = waves(6)
    given = motion(("wrist",), TURN, about_origin=True, hands={"": numbers[None]}, flat_hands=True)
    found, _ = posed(family("mano"), given)
    vectors = np.zeros((16, 3))
    vectors[1:] = (numbers @ arrays["hands_components"][:6]).reshape(15, 3)
    expected = smpl_forward(arrays, (), vectors)[0] @ rotation(TURN).T + MOVE
    assert_allclose(found, expected, rtol=0, atol=ATOL)


def test_root_positions_follow_the_shape(family):
    arrays, shapes = model("smpl"), np.stack([np.zeros(10), waves(10)])
    expected = [
        (arrays["J_regressor"] @ (arrays["v_template"] + arrays["shapedirs"] @ shape))[0]
        for shape in shapes
    ]
    assert_allclose(root_positions(family("smpl"), shapes), expected, rtol=0, atol=ATOL)


@pytest.mark.parametrize("centre", ["pelvis", "origin", "world"])
@pytest.mark.parametrize(("own", "other"), [("smpl", "SMPL-X"), ("smplx", "SMPL+H")])
def test_pelvis_is_where_the_model_of_the_file_puts_it(family, own, other, centre):
    """The pelvis of SMPL-X is 128 mm further below its origin: others floated by that much."""
    figure = family(own)
    step = np.array([0.005, -0.128, -0.016]) * (1 if other == "SMPL-X" else -1)
    rotates, world = centre != "pelvis", centre == "world"
    given = motion(
        ("pelvis",),
        [[0, 0, 0] if world else TURN],
        about_origin=centre == "origin",
        world_rotations=TURN[None] if world else None,
        shape_space=ShapeSpace(other),
    )
    frames = frames_of(figure, body_clip(given, figure)[0], np.zeros(1))
    found = world_frames(figure, frames)[0, 0, :3, 3]
    root = root_positions(figure, np.zeros((1, figure.blend_shapes.n_shapes)))[0] + step
    expected = MOVE + (rotation(TURN) @ root if rotates else root)
    assert_allclose(found, expected, rtol=0, atol=ATOL)


def test_missing_joints_of_the_figure_are_reported(family):
    vectors = np.zeros((55, 3))
    vectors[[22, 30]] = 0.1
    given = motion(
        FAMILY[55].names, vectors, shape=waves(1, 12), expression=waves(1, 10),
        hands={"left": np.ones((1, 6)), "right": np.zeros((1, 6))},
    )  # fmt: skip
    _, notes = posed(family("smpl"), given)
    shape = {"first": 11, "last": 12, "most": 10, "largest": np.abs(waves(12)[10:]).max()}
    face = {"first": 1, "last": 10, "most": 0, "largest": np.abs(waves(10)).max()}
    assert told(notes) == [
        ("F007.hand-left-out", {"side": "left", "figure": "smpl"}),
        (
            "F007.joints-left-out",
            {"n": 2, "figure": "smpl", "names": ["jaw", "left_middle3"]},
        ),
        ("F007.coefficients-left-out", {"group": "shape", "figure": "smpl", **shape}),
        ("F007.coefficients-left-out", {"group": "expression", "figure": "smpl", **face}),
    ]


def test_motions_of_other_skeletons_are_refused():
    figure = Figure("box", skeleton=skeleton([-1]))
    with pytest.raises(RigError) as caught:
        body_clip(motion(("pelvis",), TURN), figure)
    assert caught.value.diagnostic.key == "F004.body-joint"
    values = {"motion": "a", "joint": "pelvis", "figure": "box"}
    assert caught.value.diagnostic.values == values


def test_array_shapes_must_match():
    with pytest.raises(RigError, match=r"^world_rotations: expected shape 1 x 3, found 2 x 3$"):
        motion(("pelvis",), TURN, world_rotations=np.zeros((2, 3)))
    with pytest.raises(RigError, match=r"^translations: expected shape 1 x 3, found 1 x 2$"):
        motion(("pelvis",), TURN, translations=np.zeros((1, 2)))


def test_only_six_of_many_omitted_joints_are_named(family):
    names = (*FAMILY[55].names,)
    vectors = np.zeros((1, 55, 3))
    vectors[:, 22:] = 0.1
    _, notes = posed(family("smpl"), motion(names, vectors))
    lost = [name for name in names[22:] if name not in family("smpl").skeleton.names]
    assert len(lost) == 33
    values = {"n": 33, "figure": "smpl", "names": lost}
    assert told(notes) == [("F007.joints-left-out", values)]
    vectors[:, 28:] = 0.0
    assert told(posed(family("smpl"), motion(names, vectors))[1]) == [
        ("F007.joints-left-out", {"n": 6, "figure": "smpl", "names": lost[:6]})
    ]
