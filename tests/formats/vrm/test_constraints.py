"""Node constraints in glTF files."""

import math
from pathlib import Path
from typing import Any

import pytest
from formats.gltf.files import File, source_of
from numpy.testing import assert_allclose

from viewer.cli import run
from viewer.errors import FormatError
from viewer.formats.gltf import read
from viewer.loading import load
from viewer.rig.constraints.constraint import Constraint
from viewer.rig.motion.evaluation import pose_actors
from viewer.rig.skinning import deform

NAME = "VRMC_node_constraint"
AT = f"/extensions/{NAME}"


def file_of(*constraints: dict[str, Any] | None) -> File:
    """Return a file with a chain of nodes, each with or without a constraint."""
    file = File(extensionsUsed=[NAME])
    for node, constraint in enumerate(constraints):
        item: dict[str, Any] = {"name": f"n{node}"}
        if node + 1 < len(constraints):
            item["children"] = [node + 1]
        if constraint is not None:
            item["extensions"] = {NAME: {"specVersion": "1.0", "constraint": constraint}}
        file.add("nodes", item)
    return file


def test_constraints_are_read_in_the_order_of_evaluation() -> None:
    source = source_of(
        file_of(
            None,
            {"rotation": {"source": 2, "weight": 0.25}},
            {"roll": {"source": 0, "rollAxis": "Y"}},
            {"aim": {"source": 0, "aimAxis": "NegativeX"}},
        )
    )
    skeleton = read(source).figures[0].require_skeleton()
    assert skeleton.constraints == (
        Constraint(2, 0, "roll", (0.0, 1.0, 0.0)),
        Constraint(1, 2, "rotation", weight=0.25),
        # The position of the source depends on its ancestors.
        Constraint(3, 0, "aim", (-1.0, 0.0, 0.0)),
    )
    assert not source.diagnostics
    # Sliders of constrained joints would have no effect.
    assert skeleton.dof_joints[skeleton.locked].tolist() == [1, 1, 1, 2, 2, 2, 3, 3, 3]


@pytest.mark.parametrize(
    "constraints",
    [
        (None, {"rotation": {"source": 2}}, {"rotation": {"source": 1}}),
        # The position of the source depends on the joint that aims at it.
        (None, {"aim": {"source": 2, "aimAxis": "PositiveX"}}, None),
    ],
)
def test_cycles_are_refused(constraints: tuple[dict[str, Any] | None, ...]) -> None:
    with pytest.raises(FormatError) as caught:
        read(source_of(file_of(*constraints)))
    assert caught.value.diagnostic.key == "F002.constraint-cycle"
    assert caught.value.diagnostic.pointer == f"/nodes/1{AT}"


@pytest.mark.parametrize(
    ("constraint", "expected"),
    [
        ({}, "one of roll, aim and rotation"),
        ({"rotation": {"source": 1}}, "the index of another node as source"),
        ({"rotation": {"source": 9}}, "the index of another node as source"),
        ({"roll": {"source": 0, "rollAxis": "W"}}, "rollAxis X, Y, Z"),
        ({"rotation": {"source": 0, "weight": "1"}}, "a weight from 0 to 1"),
        ({"rotation": {"source": 0, "weight": 10**400}}, "a weight from 0 to 1"),
    ],
)
def test_invalid_constraints_are_ignored(constraint: dict[str, Any], expected: str) -> None:
    source = source_of(file_of(None, constraint))
    assert read(source).figures[0].require_skeleton().constraints == ()
    found = next(iter(source.diagnostics))
    assert (found.key, found.pointer) == ("G006.constraint", f"/nodes/1{AT}/constraint")
    assert found.values["expected"] == expected


def test_exported_poses_include_the_effect_of_constraints(tmp_path: Path) -> None:
    file = file_of(None, {"rotation": {"source": 0}}, None)
    file.root["nodes"][2]["mesh"] = file.mesh()
    half = math.sqrt(0.5)
    file.root["nodes"][0]["rotation"] = [0.0, 0.0, half, half]
    still, turned = [0.0, 0.0, half, half], [0.0, 0.0, 1.0, 0.0]
    samplers = [{"input": file.times([0.0, 1.0]), "output": file.accessor([still, turned])}]
    channels = [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}]
    file.add("animations", {"name": "wave", "channels": channels, "samplers": samplers})
    path, again = tmp_path / "hero.glb", tmp_path / "again.glb"
    path.write_bytes(file.glb())
    assert run(["convert", str(path), "-o", str(again)]) == 0
    for name in (path, again):
        (actor,) = load(name).actors
        pose_actors([actor], 1.0)
        corners = deform(actor.figure, actor.require_pose())[0]
        # The parent rotates to 180 degrees, and the joint by its 90 degrees relative to the rest
        # pose.
        assert_allclose(corners, [[0, 0, 0], [0, -1, 0], [1, 0, 0]], atol=1e-6)
