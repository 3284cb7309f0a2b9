"""Linear growth of the work with the number of joints in a file. Function calls are counted for a
number of joints and for four times as many; no time is measured.
"""

import sys
from functools import partial

import numpy as np
import pytest

from viewer.diagnostics import Collector
from viewer.errors import ViewerError
from viewer.formats import Source, read
from viewer.rigs.comparison.pairs import pair_names
from viewer.rigs.figure import Figure
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.pose import rest_pose
from viewer.rigs.posing.pose_record import record_of
from viewer.rigs.skeleton import ball_skeleton, dof_label, dof_labels, joint_labels

FEW, MANY = 200, 800
LINEAR = 4.4  # ratio of the work for four times the joints; below 4 if part of it is constant
SKEL = "balljoint j{} {{\n offset 0 1 0\n rotxlimit -1 1\n pose 0.5 0 0\n"
BVH = "j{}\n{{\nOFFSET 0 1 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n"


def skel(count, item=SKEL):
    return "".join(item.format(j) for j in range(count)) + "}\n" * count


def wide_skel(count):
    return "balljoint root {\n" + "".join(SKEL.format(j) + "}\n" for j in range(count - 1)) + "}\n"


def bvh(count, item=BVH):
    joints = "JOINT ".join(item.format(j) for j in range(count))
    numbers = "0 " * (3 * count)
    return f"HIERARCHY ROOT {joints}{'}' * count}\nMOTION\nFrames: 1\nFrame Time: 0.1\n{numbers}\n"


def wide_bvh(count):
    joints = "JOINT ".join([BVH.format(0), *(BVH.format(j) + "}\n" for j in range(1, count))])
    numbers = "0 " * (3 * count)
    return f"HIERARCHY ROOT {joints}}}\nMOTION\nFrames: 1\nFrame Time: 0.1\n{numbers}\n"


FILES = {
    "nested.skel": skel,
    "wide.skel": wide_skel,
    "unclosed.skel": lambda count: skel(count).rstrip("}\n"),
    "odd.skel": lambda count: skel(count, "balljoint {{\n colour red\n rotxlimit 1 -1\n"),
    "blocks.skel": lambda count: "balljoint a {" + "foo { " * count + "} " * count + "}",
    "broken.skel": lambda count: skel(count, "balljoint j{} {{\n offset 0 x 0\n"),
    "nested.bvh": bvh,
    "wide.bvh": wide_bvh,
    "unclosed.bvh": lambda count: bvh(count).partition("}")[0],
    "broken.bvh": lambda count: bvh(count, "j{}\n{{\nOFFSET 0 x 0\n"),
    "ends.bvh": lambda count: "HIERARCHY ROOT a {" + "End Site { } " * count + "}",
}


def calls(work):
    """Return the number of function calls, including those of built-in functions."""
    count = 0

    def note(frame, event, argument):
        nonlocal count
        count += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        work()
    finally:
        sys.setprofile(before)
    return count


def read_it(name, text, takes_faults):
    source = Source(name, text.encode(), diagnostics=Collector(keeps_errors=takes_faults))
    try:
        return read(source)
    except ViewerError as problem:
        return problem


@pytest.mark.slow
@pytest.mark.parametrize("takes_faults", [False, True], ids=["reading", "lint"])
@pytest.mark.parametrize("name", FILES)
def test_work_of_readers_is_linear_in_the_number_of_joints(name, takes_faults):
    read_it(name, FILES[name](2), takes_faults)  # load modules before counting
    texts = [FILES[name](count) for count in (FEW, MANY)]
    few, many = (calls(partial(read_it, name, text, takes_faults)) for text in texts)
    assert many < LINEAR * few


class Names(tuple):
    """A list of names that counts how often they are accessed."""

    __slots__ = ()
    looked = 0

    def __iter__(self):
        Names.looked += len(self)
        return super().__iter__()

    def count(self, name):
        Names.looked += len(self)
        return super().count(name)

    def index(self, *arguments):
        Names.looked += len(self)
        return super().index(*arguments)


def chain(count):
    names = Names(f"j{j % 7}" if j % 3 else f"own{j}" for j in range(count))
    heights = np.arange(count)[:, None] * [0.0, 1.0, 0.0]
    return ball_skeleton(names, np.arange(-1, count - 1, dtype=np.int32), heights)


def record(skeleton):
    return record_of(Figure("a", skeleton=skeleton), rest_pose(skeleton))


def pair(skeleton):
    return pair_names(skeleton.names, Names([f"{name}'" for name in skeleton.names[1:]]), "joint")


@pytest.mark.parametrize("work", [joint_labels, dof_labels, record, pair])
def test_names_are_accessed_only_a_few_times(work):
    Names.looked = 0
    skeleton = chain(MANY)
    work(skeleton)
    assert 0 < Names.looked <= 20 * MANY


def test_all_dof_labels_match_single_labels():
    skeleton = chain(20)
    assert dof_labels(skeleton) == [dof_label(skeleton, dof) for dof in range(skeleton.n_dofs)]
    assert dof_labels(skeleton)[:4] == ["own0.x", "own0.y", "own0.z", "j1#1.x"]


@pytest.mark.parametrize("name", ["nested.skel", "wide.skel"])
def test_many_joints_have_the_positions_of_the_file(name):
    skeleton = read_it(name, FILES[name](MANY).replace("0.5 0 0", "0 0 0"), False).skeleton
    heights = world_matrices(skeleton, rest_pose(skeleton))[:, 1, 3]
    wanted = np.arange(1, MANY + 1) if name == "nested.skel" else np.arange(MANY).clip(0, 1)
    assert heights.tolist() == wanted.tolist()
