"""Pairing of figures by ``viewer diff``."""

from dataclasses import replace

import numpy as np
import pytest

import viewer
from viewer.cli import run
from viewer.commands.diff import pair_actors
from viewer.rigs.captures.points import PointLayout
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.skin import skin_from_lists


def bones() -> Skeleton:
    """Return one joint with the six DOFs of a .skel-style rig."""
    return Skeleton(
        names=("root",),
        parents=np.array([-1], dtype=np.int32),
        rest_translations=np.zeros((1, 3)),
        rest_rotations=np.array([[0.0, 0.0, 0.0, 1.0]]),
        rest_scales=np.ones((1, 3)),
        dof_joints=np.zeros(6, dtype=np.int32),
        dof_kinds=np.arange(6, dtype=np.int32),
        rest_dofs=np.zeros(6),
        dof_limits=np.tile([-np.inf, np.inf], (6, 1)),
    )


def mesh() -> Mesh:
    triangle = np.array([[0, 1, 2]], dtype=np.int32)
    return Mesh(np.eye(3), np.tile([0.0, 0, 1], (3, 1)), triangle)


def skeleton(name: str, clip: Clip | None = None, person: int | None = None) -> Actor:
    return Actor(Figure(name, skeleton=bones()), clip=clip, person=person)


def rig(name: str, clip: Clip | None = None) -> Actor:
    skin = skin_from_lists([[(0, 1.0)]] * 3, np.eye(4)[None])
    return Actor(Figure(name, mesh(), bones(), skin), clip=clip)


def surface(name: str) -> Actor:
    return Actor(Figure(name, mesh()))


def points(name: str, person: int | None = None) -> Actor:
    return Actor(
        Figure(name, points=PointLayout("dots", ("a",), np.zeros((0, 2)), np.zeros(1))),
        person=person,
    )


def motion(name: str) -> Clip:
    still = (("flat", "flat"),)
    channels = [Channel(dof, np.zeros(1), np.zeros(1), still) for dof in range(6)]
    return Clip(name, tuple(channels), 0.0, 1.0)


def paired(first: list[Actor], second: list[Actor]) -> list[tuple[int, int]]:
    """Return the indices of the paired actors."""
    figures = [[actor.figure for actor in actors] for actors in (first, second)]
    pairs = pair_actors(first, second).pairs
    return [(figures[0].index(a.figure), figures[1].index(b.figure)) for a, b in pairs]


def test_names_take_precedence_over_order():
    assert paired([rig("a"), rig("b")], [rig("b"), rig("c"), rig("a")]) == [(0, 2), (1, 0)]


def test_equal_names_prefer_the_same_format():
    assert paired([rig("a")], [skeleton("a"), surface("a"), rig("a")]) == [(0, 2)]
    assert paired([surface("a")], [rig("a"), skeleton("a")]) == [(0, 0)]


def test_figures_without_common_names_are_paired_by_format_then_by_order():
    assert paired([rig("a"), skeleton("b")], [skeleton("x"), rig("y")]) == [(0, 1), (1, 0)]
    assert paired([rig("a"), rig("b")], [rig("x"), rig("y")]) == [(0, 0), (1, 1)]
    assert paired([rig("a")], [surface("x")]) == [(0, 0)]


def test_exact_name_match_takes_precedence_over_an_earlier_figure():
    assert paired([rig("x"), rig("a")], [rig("a"), rig("b")]) == [(0, 1), (1, 0)]


def test_people_are_paired_by_their_number():
    first = [points("a", person=1), points("a", person=2)]
    second = [points("a", person=2), points("a", person=3)]
    found = pair_actors(first, second)
    assert [(one.person, other.person) for one, other in found.pairs] == [(2, 2)]
    assert found.first == (f"{first[0].name} (captured points)",)
    assert found.second == (f"{second[1].name} (captured points)",)


def test_unpaired_figures_are_reported_with_their_side():
    found = pair_actors([rig("a")], [skeleton("other"), surface("skin"), rig("a"), rig("b")])
    assert found.first == ()
    assert found.second == (
        "other (a skeleton)",
        "skin (a mesh)",
        "b",
    )
    found = pair_actors([rig("a"), rig("b")], [rig("b")])
    assert found.first == ("a",) and found.second == ()


def test_clip_on_an_unpaired_skeleton_is_used_for_the_pair():
    walk, mine = motion("walk"), motion("walk")
    first, second = [rig("a", walk)], [skeleton("stray", mine), rig("a")]
    for turned in (False, True):
        found = pair_actors(second, first) if turned else pair_actors(first, second)
        (one, other) = found.pairs[0][::-1] if turned else found.pairs[0]
        assert one.clip is walk and other.clip is mine and other.figure.name == "a"
        assert (found.first, found.second)[:: -1 if turned else 1] == (
            (),
            ("stray (a skeleton)",),
        )
    assert second[0].clip is mine and second[1].clip is None  # both clips are unchanged


def test_clips_are_paired_by_name_then_by_order():
    run, walk = motion("run"), motion("walk")
    first = [rig("a", motion("walk")), rig("b", motion("run"))]
    pairs = pair_actors(first, [rig("a", run), rig("b", walk)]).pairs
    assert [other.clip for _, other in pairs] == [walk, run]
    pairs = pair_actors([rig("a", motion("one"))], [rig("a", run)]).pairs
    assert pairs[0][1].clip is run


def test_clip_with_a_different_name_is_used_only_if_necessary():
    run = motion("run")
    found = pair_actors([rig("a", motion("walk"))], [skeleton("s", run), rig("a")])
    assert found.pairs[0][1].clip is run
    found = pair_actors([rig("a")], [skeleton("s", run), rig("a")])
    assert found.pairs[0][1].clip is None
    assert found.second == (
        "s (a skeleton)",
        "motion run",
    )


@pytest.mark.parametrize(("up", "expected"), [("z", []), ("y", ["D002.up"])])
def test_up_axes_are_those_in_the_scene_whatever_the_figures_own(up, expected):
    """A motion with z up drives a body with y up, and a file of it states z."""
    driven = Scene([rig("a")], world_up=up)
    read = Scene([replace(rig("a"), figure=replace(rig("a").figure, up="z"))])
    ((_, found),) = viewer.diff(driven, read, poses=0).differences
    assert [note.key for note in found.notes] == expected


def test_option_that_only_one_of_both_files_needs_has_an_effect(tmp_path, capsys):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    mesh, copy = str(tmp_path / "a.obj"), str(tmp_path / "a.glb")
    assert run(["convert", mesh, "-o", copy, "--unit", "cm"]) == 0
    for files, count in (((mesh, copy), 0), ((copy, mesh), 0), ((copy, copy), 2)):
        capsys.readouterr()
        assert run(["diff", *files, "--unit", "cm"]) == 0
        assert capsys.readouterr().err.count("note: --unit cm has no effect") == count
