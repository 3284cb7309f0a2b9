"""``viewer info``: hand-counted values as text and as JSON."""

import json

import pytest
from app.tiny import write_rig
from formats.gltf.files import File, skinned

from viewer.cli import run


@pytest.fixture
def describe(capsys):
    def info(*arguments):
        assert run(["info", *map(str, arguments), "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    return info


def test_tiny_rig_is_described_exactly(describe, tmp_path):
    described = describe(*write_rig(tmp_path))
    (actor,) = described["actors"]
    assert described["warnings"] == [] and actor["name"] == "tiny" and actor["attached"]
    skeleton = actor["skeleton"]
    assert skeleton["joints"] == 2 and skeleton["roots"] == 1
    assert skeleton["dofs"] == 9 and skeleton["limited_dofs"] == 3 and skeleton["locked_dofs"] == 1
    assert [joint["parent"] for joint in skeleton["joint_table"]] == [-1, 0]
    assert skeleton["dof_table"][3:6] == [
        {"name": "root.x", "value": 0.25, "minimum": -1.0, "maximum": 1.0},
        {"name": "root.y", "value": 0.5, "minimum": 0.5, "maximum": 2.0},
        {"name": "root.z", "value": 0.3, "minimum": 0.3, "maximum": 0.3},
    ]
    assert skeleton["dof_table"][6]["minimum"] is None
    mesh = actor["mesh"]
    assert (mesh["vertices"], mesh["triangles"]) == (12, 20)
    assert mesh["degenerate_triangles"] == 0 and mesh["unused_vertices"] == 0
    assert not mesh["has_uvs"] and mesh["materials"] == []
    skin = actor["skin"]
    assert skin["influences"] == 4 + 8 + 4 and skin["bindings"] == 2
    assert skin["influence_histogram"] == {"1": 8, "2": 4}
    assert skin["mean_influences"] == pytest.approx(16 / 12)
    assert skin["weight_sums"] == [1.0, 1.0] and skin["joints_without_vertices"] == []


def test_text_output_matches_json(tmp_path, capsys):
    assert run(["info", *map(str, write_rig(tmp_path))]) == 0
    text = capsys.readouterr().out
    for words in (
        "2 joints, 9 DOFs (3 limited, 1 of them locked)",
        "12 vertices, 20 triangles (0 degenerate), without texture coordinates",
        "2 bindings, 16 influences, mean 1.33 per vertex",
        "1: 8  2: 4",
        "weight sums 1 to 1",
        "locked",
    ):
        assert words in text


def test_size_has_a_unit_if_the_file_states_one(tmp_path, capsys):
    rig = write_rig(tmp_path)
    assert run(["convert", *map(str, rig), "-o", str(tmp_path / "a.glb")]) == 0
    for path, unit in ((tmp_path / "a.glb", "m"), (rig[0], None)):
        capsys.readouterr()
        assert run(["info", str(path)]) == 0
        box = capsys.readouterr().out.splitlines()[1].split(", ")
        assert box[-2].endswith(" m") == (unit == "m") and box[-2].startswith("size ")
        assert run(["info", str(path), "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["actors"][0]["unit"] == unit


def test_skeleton_and_skin_are_described_separately(describe, tmp_path):
    skel, skin = write_rig(tmp_path)
    assert set(describe(skel)["actors"][0]) >= {"skeleton"}
    assert "mesh" not in describe(skel)["actors"][0]
    assert "skeleton" not in describe(skin)["actors"][0]
    # The height of a skeleton without a skin is that of its boxes.
    assert describe(skel)["actors"][0]["size"] > 1.8


def test_given_dofs_are_described(describe, tmp_path):
    described = describe(*write_rig(tmp_path), "--dof", "arm.x=0.5")
    assert described["actors"][0]["skeleton"]["dof_table"][6]["value"] == 0.5


def test_warnings_are_described_and_printed(tmp_path, capsys):
    path = tmp_path / "odd.skel"
    path.write_text("balljoint a { rotxlimit 2 1 }")
    assert run(["info", str(path), "--json"]) == 0
    captured = capsys.readouterr()
    warnings = json.loads(captured.out)["warnings"]
    assert len(warnings) == 1 and captured.err == f"warning: {warnings[0]}\n"


def test_names_are_printed_on_one_line(tmp_path, capsys):
    path = tmp_path / "two\nlines.skel"
    path.write_text("balljoint a { pose 1 0 0 }")
    assert run(["info", str(path)]) == 0
    assert capsys.readouterr().out.splitlines()[0] == "two\\nlines"


def test_joints_and_dofs_of_skel_files_are_counted(describe, shared):
    (actor,) = describe(shared / "test.skel")["actors"]
    skeleton = actor["skeleton"]
    # Six balljoints have 18 rotations and three translations of the root; knee_r has three limits.
    assert (skeleton["joints"], skeleton["dofs"]) == (6, 21)
    assert (skeleton["limited_dofs"], skeleton["locked_dofs"]) == (3, 2)
    values = {dof["name"]: dof["value"] for dof in skeleton["dof_table"]}
    assert values["root.y"] == 0.1
    assert [values[f"knee_r.{axis}"] for axis in "xyz"] == [-2.0, 0.0, 0.0]  # clamped


@pytest.mark.parametrize(
    ("name", "joints", "vertices", "triangles"), [("tube", 2, 240, 456), ("wasp", 23, 694, 1236)]
)
def test_vertices_and_bindings_of_skin_files_are_counted(
    describe, shared, name, joints, vertices, triangles
):
    (actor,) = describe(shared / f"{name}.skel", shared / f"{name}.skin")["actors"]
    # These are the counts declared in the files.
    assert actor["skeleton"]["joints"] == joints == actor["skin"]["bindings"]
    assert (actor["mesh"]["vertices"], actor["mesh"]["triangles"]) == (vertices, triangles)
    assert sum(actor["skin"]["influence_histogram"].values()) == vertices
    assert actor["skin"]["weight_sums"] == pytest.approx([1.0, 1.0], abs=2e-2)


@pytest.mark.parametrize(
    ("joints", "dofs_listed", "summary"),
    [
        (8, 24, "6 more are 0 and unlimited"),
        (9, 0, "33 are unlimited"),
    ],
)
def test_many_unlimited_dofs_are_only_counted(tmp_path, capsys, joints, dofs_listed, summary):
    # A root whose six DOFs are 0, and below it ball joints that are each rotated about x, y and z.
    text = "".join(f"balljoint j{n} {{ pose 0.1 0.2 0.3 }}\n" for n in range(joints))
    path = tmp_path / "hand.skel"
    path.write_text(f"balljoint root {{\n{text}}}\n")
    assert run(["info", str(path)]) == 0
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    assert sum(line.startswith("j") for line in lines) == dofs_listed
    assert f"{summary} (--json lists all)" in lines


def test_triangles_are_degenerate_by_the_criterion_of_lint(tmp_path, capsys):
    # The third corner is 1e-9 from the line through the others: the area is not exactly 0.
    (tmp_path / "flat.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0.3 1e-9 0\nv 0 1 0\nf 1 2 3\nf 1 2 4\n"
    )
    assert run(["info", str(tmp_path / "flat.obj")]) == 0
    assert "2 triangles (1 degenerate)" in capsys.readouterr().out
    run(["lint", str(tmp_path / "flat.obj")])
    assert "M001: 1 of 2 triangles have zero area" in capsys.readouterr().out.replace("has", "have")


@pytest.mark.parametrize(
    ("corner", "box"),
    [
        # Three more digits than the power of ten of the size: 1.732 has thousandths.
        ("1 1 0.9999", "(0, 0, 0) to (1, 1, 1), size 1.732"),
        ("123.456 0 0.00004", "(0, 0, 0) to (123.5, 0, 0), size 123.5"),
        ("0.00123456 0 0", "(0, 0, 0) to (0.001235, 0, 0), size 0.001235"),
    ],
)
def test_boxes_have_the_digits_of_their_size(corner, box, tmp_path, capsys):
    (tmp_path / "a.obj").write_text(f"v 0 0 0\nv {corner}\nv 0 0 0\nf 1 2 3\n")
    assert run(["info", str(tmp_path / "a.obj")]) == 0
    assert f"  box        {box}, y up" in capsys.readouterr().out.splitlines()


@pytest.mark.parametrize(("scale", "height"), [(0.0, "0.000"), (2.5, "2.500")])
def test_height_at_rest_is_that_of_the_scaled_joints(scale, height, tmp_path, capsys):
    # A triangle of height 1 on a joint that the file scales at rest.
    file = skinned()
    file.root["nodes"][1]["scale"] = [scale] * 3
    (tmp_path / "a.glb").write_bytes(file.glb())
    assert run(["info", str(tmp_path / "a.glb")]) == 0
    assert f"rest       {height} m high, " in capsys.readouterr().out


def test_mass_is_that_of_people(tmp_path, capsys):
    # A tetrahedron with three edges of 6 m has 36 cubic metres.
    corners = [[0, 0, 0], [6, 0, 0], [0, 6, 0], [0, 0, 6]]
    file = File(scene=0, scenes=[{"nodes": [0]}])
    mesh = file.mesh(corners)
    file.primitive["indices"] = file.accessor([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3], "H")
    file.add("nodes", {"mesh": mesh})
    (tmp_path / "a.glb").write_bytes(file.glb())
    assert run(["info", str(tmp_path / "a.glb")]) == 0
    line = next(one for one in capsys.readouterr().out.splitlines() if "  rest " in one)
    assert line == "  rest       6.000 m high, 36 m3"
