"""The front of a figure, estimated from names, feet, faces, end joints, soles and travel."""

import math

import numpy as np
import pytest
from rigs.hand_made import matrix, mesh, turn_y, turn_z

import viewer
from viewer.loading import bundled_body
from viewer.rigs.captures.points import PointClip, PointLayout
from viewer.rigs.figure import Figure
from viewer.rigs.inspection.front import front_axes, guess_front, usual_front
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skeleton import ball_skeleton

# A rotation by 90 degrees maps each axis to the next: +z to +x about y, and -y to +x about z.
CYCLES = {"y": ("+z", "+x", "-z", "-x"), "z": ("-y", "+x", "+y", "-x")}
TURNS = {"y": turn_y, "z": turn_z}


def turned(scene: Scene, quarters: int) -> Scene:
    place = matrix(TURNS[scene.up](quarters * math.pi / 2), (3.0, -2.0, 5.0))
    return Scene([_placed(actor, place) for actor in scene.actors], world_up=scene.up)


def _placed(actor: Actor, place) -> Actor:
    moved = actor.copy()
    moved.placement = place @ actor.placement
    return moved


def fronts(scene: Scene) -> list[str]:
    """Return the estimates for a scene and for copies rotated by 90, 180 and 270 degrees."""
    return [guess_front(turned(scene, quarters)) for quarters in range(4)]


def cycle(up: str, front: str) -> list[str]:
    first = CYCLES[up].index(front)
    return [CYCLES[up][(first + quarters) % 4] for quarters in range(4)]


def figure(joints: dict[str, tuple[int, tuple[float, float, float]]], up: str = "y") -> Figure:
    """Build a figure from joint names, each with its parent and position."""
    parents = np.array([parent for parent, _ in joints.values()], dtype=np.int32)
    places = np.array([place for _, place in joints.values()], dtype=float)
    return Figure("made", skeleton=ball_skeleton(tuple(joints), parents, places), up=up)


def scene(*figures: Figure) -> Scene:
    return Scene([Actor(figure) for figure in figures])


BODY = {"hips": (-1, (0, 1, 0)), "LeftUpLeg": (0, (0.1, 1, 0)), "RightUpLeg": (0, (-0.1, 1, 0))}
"""A body that faces +z; its left is +x."""


@pytest.mark.parametrize(("files", "front"), [((), "+z"), ((bundled_body(),), "+z")])
def test_bundled_figures_face_the_default_front_also_when_rotated(files, front):
    assert fronts(viewer.load(*files)) == cycle("y", front)


@pytest.mark.parametrize(
    ("names", "front"),
    [
        (("cse169/wasp.skel", "cse169/wasp.skin"), "-z"),
        (("cse169/test.skel",), "-z"),
        (("pig/core_txt_files",), "+x"),
        (("smpl_synthetic/SMPL_NEUTRAL.npz",), "+z"),
    ],
)
def test_real_figures_have_a_front_also_when_rotated(shared_data, names, front):
    found = viewer.load(*(shared_data / name for name in names))
    assert fronts(found) == cycle(found.up, front)


def test_people_facing_each_other_have_the_default_front(shared_data):
    found = viewer.load(shared_data / "smpl_synthetic" / "easymocap")
    assert guess_front(found) == "-y"


def test_tube_gets_the_default_front(shared):
    tube = viewer.load(shared / "tube.skel", shared / "tube.skin")
    assert fronts(tube) == ["+z"] * 4


def test_left_and_right_joints_determine_the_front():
    assert fronts(scene(figure(BODY))) == cycle("y", "+z")
    # With z up and the left at +y a figure faces +x.
    lying = {name: (p, (0.0, place[0], place[1])) for name, (p, place) in BODY.items()}
    assert fronts(scene(figure(lying, "z"))) == cycle("z", "+x")


@pytest.mark.parametrize("degrees", [-40, 40])
def test_slanted_figure_gets_the_nearest_axis(degrees):
    actor = Actor(figure(BODY), placement=matrix(turn_y(math.radians(degrees))))
    assert guess_front(Scene([actor])) == "+z"


@pytest.mark.parametrize(
    "joints",
    [
        {"a": (-1, (0, 1, 0)), "foot": (0, (0, 0, 0)), "toe": (1, (-0.2, 0, 0))},
        {"a": (-1, (0, 1, 0)), "head": (0, (0, 2, 0)), "jaw": (1, (-0.1, 2, 0))},
        {"a": (-1, (0, 1, 0)), "head": (0, (-1, 1, 0)), "tail_1": (0, (1, 1, 0))},
        {"a": (-1, (0, 1, 0)), "b": (0, (0.2, 1, 0)), "tail_1": (0, (1, 1, 0))},
    ],
    ids=["toe", "jaw", "head", "tail"],
)
def test_feet_faces_and_end_joints_determine_the_front(joints):
    assert fronts(scene(figure(joints))) == cycle("y", "-x")


def test_all_other_evidence_together_outvotes_swapped_side_names():
    joints = {
        **BODY,
        "toe": (1, (0.1, 0.9, -0.2)),
        "head": (0, (0, 1, -1)),
        "eye": (4, (0, 1, -1.1)),
    }
    assert fronts(scene(figure(joints))) == cycle("y", "-z")  # 6 to 3
    del joints["eye"]  # 4 to 3 is inconclusive
    assert fronts(scene(figure(joints))) == ["+z"] * 4
    del joints["head"]  # so is 2 to 3
    assert fronts(scene(figure(joints))) == ["+z"] * 4


def _walk(way, n_frames=11):
    chain = {"a": (-1, (0, 0, 0)), "b": (0, (0, 1, 0))}
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (n_frames, 2, 1))
    places = np.outer(np.linspace(0.0, 1.0, n_frames), way)
    timing = Timing(30.0, np.arange(n_frames))
    return Actor(figure(chain), clip=SampledClip("walk", timing, turns, figure_translations=places))


def test_travel_direction_determines_the_front_without_other_evidence():
    assert fronts(Scene([_walk((-3.0, 0.0, 0.2))])) == cycle("y", "-x")
    assert guess_front(Scene([_walk((0.0, 5.0, 0.0))])) == "+z"  # upward motion is not evidence
    assert guess_front(Scene([_walk((-0.1, 0.0, 0.0))])) == "+z"  # swaying is not evidence either


def test_travel_does_not_outvote_names():
    actor = _walk((-3.0, 0.0, 0.0))
    sided = {"hips": BODY["hips"], "LeftUpLeg": BODY["LeftUpLeg"], "RightUpLeg": BODY["RightUpLeg"]}
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (actor.clip.n_rows, 3, 1))
    clip = SampledClip(
        "walk", actor.clip.timing, turns, figure_translations=actor.clip.figure_translations
    )
    assert guess_front(Scene([Actor(figure(sided), clip=clip)])) == "+z"


def test_sides_of_captured_points_determine_the_front():
    layout = PointLayout("two", ("left_hip", "right_hip"), np.zeros((0, 2)), np.array([1, -1]))
    points = np.array([[0.0, -0.1, 1.0, 0.9], [0.0, 0.1, 1.0, 0.9]])  # the left is -y
    actor = Actor(Figure("points", points=layout, up="z"), points=points)
    assert guess_front(Scene([actor], world_up="z")) == "-x"
    points[0, 3] = 0.0  # not detected
    assert guess_front(Scene([actor], world_up="z")) == "-y"


def test_travel_counts_only_frames_in_which_the_person_is_present():
    walk = _walk((-3.0, 0.0, 0.2))
    rows = np.array([-1, -1, *range(11), -1])
    timing = Timing(30.0, rows, holds=False)
    turns, places = walk.clip.rotations.copy(), walk.clip.figure_translations
    clip = SampledClip("walk", timing, turns, figure_translations=places)
    assert guess_front(Scene([Actor(walk.figure, clip=clip)])) == "-x"


def test_travel_of_captured_points_determines_the_front():
    layout = PointLayout("two", ("nose", "neck"), np.zeros((0, 2)), np.zeros(2))
    points = np.zeros((11, 2, 4))
    points[:, :, 1], points[:, :, 3] = np.linspace(0.0, 5.0, 11)[:, None], 0.9
    points[4, 0] = 0.0, 99.0, 0.0, 0.0  # not detected
    clip = PointClip("walk", Timing(30.0, np.arange(11)), points)
    actor = Actor(Figure("points", points=layout, up="z"), clip=clip, points=points[0])
    actor.points[1, 2] = 1.0
    assert guess_front(Scene([actor], world_up="z")) == "+y"


def _grid(x, y, z):
    return np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)


def _boots():
    """Two legs up to height 1, whose soles extend to z = 0.3 in front, and a trunk."""
    leg = _grid(np.linspace(0.1, 0.2, 3), np.linspace(0.0, 1.0, 51), np.linspace(-0.05, 0.05, 3))
    sole = _grid(np.linspace(0.1, 0.2, 3), [0.0, 0.02], np.linspace(0.05, 0.3, 11))
    trunk = _grid(np.linspace(0.0, 0.3, 7), np.linspace(1.0, 2.0, 11), np.linspace(-0.1, 0.1, 5))
    half = np.concatenate([leg, sole, trunk])
    return np.concatenate([half, half * (-1, 1, 1)])


def test_feet_of_a_mesh_determine_the_front():
    assert fronts(scene(Figure("boots", mesh=mesh(_boots())))) == cycle("y", "+z")


@pytest.mark.parametrize(
    "positions",
    [
        _grid([0.0, 1.0], [0.0, 1.0], [0.0, 1.0]),
        _grid([0.0, 3.0], [0.0, 1.0], [0.0, 1.0]),
        np.zeros((1, 3)),
        _boots() * (1, 0, 1),
    ],
    ids=["cube", "box", "point", "flat"],
)
def test_shapes_without_a_front_get_the_default_front(positions):
    assert fronts(scene(Figure("shape", mesh=mesh(positions)))) == ["+z"] * 4


def test_only_agreeing_actors_override_the_default_front():
    place = matrix(turn_y(math.pi / 2))
    one, other = Actor(figure(BODY), placement=place), Actor(figure(BODY), placement=place)
    assert guess_front(Scene([one, other])) == "+x"
    other.placement = matrix(turn_y(-math.pi / 2))
    assert guess_front(Scene([one, other])) == "+z"
    other.visible = False
    assert guess_front(Scene([one, other])) == "+x"
    assert guess_front(Scene([])) == "+z"


def test_estimating_the_front_does_not_change_poses():
    actor = _walk((-3.0, 0.0, 0.0))
    before = actor.pose.figure_translation.copy()
    guess_front(Scene([actor]))
    assert (actor.pose.figure_translation == before).all()


def test_possible_fronts_are_the_horizontal_axes():
    assert front_axes("y") == ("+x", "-x", "+z", "-z")
    assert front_axes("z") == ("+x", "-x", "+y", "-y")
    assert usual_front("y") == "+z" and usual_front("z") == "-y"
