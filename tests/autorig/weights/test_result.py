import numpy as np
from faults import told

from viewer.autorig.correspondence import Matches
from viewer.autorig.weights.result import RigidIslands, match_lines, nothing_matched, rigid_lines
from viewer.rig.geometry.closest_point import SurfacePoints


def matches(matched, inside_out=()):
    count = len(matched)
    points = SurfacePoints(
        np.zeros(count, int),
        np.tile([1.0, 0, 0], (count, 1)),
        np.zeros((count, 3)),
        np.zeros(count),
    )
    return Matches(points, np.array(matched), np.zeros(count), np.array(inside_out, dtype=np.int32))


def test_match_report_counts_vertices():
    found = matches([True, True, True, False])
    assert told(match_lines(found, ~found.matched, "direct")) == [
        ("R005.matched", {"n": 3, "all": 4, "ratio": 0.75, "inpainted": 1})
    ]


def test_match_report_mentions_exceptions():
    found = matches([True, False, False, False], [0, 2])
    lines = match_lines(found, ~found.matched, "harmonic")
    assert told(lines) == [
        ("R005.matched", {"n": 1, "all": 4, "ratio": 0.25, "inpainted": 3}),
        ("R006.matched", {"limit": 0.75}),
        ("R005.reversed", {"n": 2}),
        ("R005.solver", {"method": "harmonic"}),
    ]
    assert [line.severity for line in lines] == ["note", "warning", "note", "note"]
    assert lines[1].labelled == (
        "warning: less than 75% of the target matches the template: check the "
        "alignment or allow a larger distance"
    )


def test_match_report_uses_the_singular_for_one_part():
    found = matches([True, True], [0])
    (line,) = match_lines(found, ~found.matched, "direct")[1:]
    assert str(line) == (
        "1 part of the target is wound opposite to the template: matched with reversed normals"
    )


def islands(counts):
    number = np.arange(len(counts), dtype=np.int32)
    return RigidIslands(10 * number, np.array(counts), number, np.zeros(len(counts)))


def test_rigid_part_report_lists_the_largest_first():
    assert told(rigid_lines(islands([1, 30]))) == [
        ("R007.part", {"n": 30, "vertex": 10, "joint": 1}),
        ("R007.part", {"n": 1, "vertex": 0, "joint": 0}),
    ]
    assert rigid_lines(islands([])) == ()


def test_rigid_part_report_counts_unnamed_parts():
    lines = rigid_lines(islands([9, 8, 7, 6, 5, 4, 3]))
    assert len(lines) == 6
    assert told(lines[-1:]) == [("R007.more-parts", {"n": 2})]
    assert told(rigid_lines(islands([9, 8, 7, 6, 5, 4])))[-1] == ("R007.more-parts", {"n": 1})


def test_no_match_reports_the_distance():
    assert nothing_matched(np.array([1.0, 3.0, 9.0]), 10.0) == (
        "no vertex of the target meets the template: expected a target aligned with it, found "
        "it at a median distance of 30.0% of the target's size"
    )
