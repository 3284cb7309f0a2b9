import numpy as np
import pytest

from viewer.autorig.correspondence.matching import Matches
from viewer.autorig.weights.result import RigidIslands, match_lines, nothing_matched, rigid_lines
from viewer.rig.geometry.closest_point import SurfacePoints

pytest.importorskip("scipy")


def matches(matched, inside_out=()):
    count = len(matched)
    points = SurfacePoints(
        np.zeros(count, int),
        np.tile([1.0, 0, 0], (count, 1)),
        np.zeros((count, 3)),
        np.zeros(count),
    )
    return Matches(points, np.array(matched), np.zeros(count), np.array(inside_out, dtype=np.int32))


def test_match_lines_count():
    found = matches([True, True, True, False])
    assert match_lines(found, ~found.matched, "direct") == (
        "matched 3 of 4 vertices (75.0%), filled in 1",
    )


def test_match_lines_say_what_is_out_of_the_ordinary():
    found = matches([True, False, False, False], [0, 2])
    assert match_lines(found, ~found.matched, "harmonic") == (
        "matched 1 of 4 vertices (25.0%), filled in 3",
        "warning: less than 75% of the target meets the template: check the alignment, or allow "
        "a larger distance",
        "2 parts of the target face the other way than the template: matched as if turned round",
        "the weights that were filled in needed another solver: harmonic",
    )


def test_match_lines_speak_of_one_part_alone():
    found = matches([True, True], [0])
    assert match_lines(found, ~found.matched, "direct")[1:] == (
        "1 part of the target faces the other way than the template: matched as if turned round",
    )


def islands(counts):
    number = np.arange(len(counts), dtype=np.int32)
    return RigidIslands(10 * number, np.array(counts), number, np.zeros(len(counts)))


def test_rigid_lines_name_the_largest_first():
    assert rigid_lines(islands([1, 30])) == (
        "a part of 30 vertices at vertex 10 meets the template nowhere: it moves rigidly, "
        "mostly with joint 1",
        "a part of 1 vertex at vertex 0 meets the template nowhere: it moves rigidly, "
        "mostly with joint 0",
    )
    assert rigid_lines(islands([])) == ()


def test_rigid_lines_count_what_they_do_not_name():
    lines = rigid_lines(islands([9, 8, 7, 6, 5, 4, 3]))
    assert len(lines) == 6
    assert lines[-1] == "and so do 2 smaller parts"
    assert rigid_lines(islands([9, 8, 7, 6, 5, 4]))[-1] == "and so do 1 smaller part"


def test_nothing_matched_says_how_far_it_is():
    assert nothing_matched(np.array([1.0, 3.0, 9.0]), 10.0) == (
        "no vertex of the target meets the template: expected a target aligned with it, found "
        "it at a median distance of 30.0% of the target's size"
    )
