"""Valid figures without errors or warnings, and the known errors in real files."""

import pytest
from app.tiny import write_rig

import viewer
from viewer.cli import run
from viewer.exporters import export
from viewer.linting import Finding, lint_files
from viewer.loading import bundled_body, bundled_files
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh, vertex_normals
from viewer.rigs.scene import Actor

pytestmark = pytest.mark.slow


def heavy(findings: list[Finding]) -> list[tuple[str, str]]:
    return [(finding.code, finding.message) for finding in findings if finding.severity != "note"]


def notes(findings: list[Finding]) -> set[str]:
    return {finding.code for finding in findings if finding.severity == "note"}


def test_bundled_fox_has_no_findings():
    _, findings = lint_files(bundled_files())
    assert heavy(findings) == []
    assert notes(findings) == {"W007", "W008", "S005"}  # the fox has up to 14 influences and hinges


def test_bundled_body_has_no_findings():
    _, findings = lint_files([bundled_body()])
    assert findings == []


def test_tiny_rig_has_no_findings(tmp_path):
    _, findings = lint_files(write_rig(tmp_path))
    assert [finding for finding in findings if finding.severity == "error"] == []


COURSE = {
    ("wasp.skel", "wasp.skin", "wasp_walk.anim"): set(),
    ("tube.skel", "tube.skin"): set(),
    # The pose of the right knee is -3, 1, 2 and its limits are -2 to 0, 0 and 0, which is a real
    # error.
    ("test.skel",): {"S004"},
}


@pytest.mark.parametrize("names", COURSE)
def test_skel_and_skin_files_have_only_known_findings(shared, names):
    _, findings = lint_files([shared / name for name in names])
    assert {code for code, _ in heavy(findings)} == COURSE[names]
    # The skins are bound where all DOFs are 0, and the wasp 0.95 higher and 0.15 further back.
    assert "B004" not in notes(findings)


def test_pose_outside_its_limits_is_described_in_radians_as_in_the_file(shared):
    _, findings = lint_files([shared / "test.skel"])
    (posed,) = [found for found in findings if found.code == "S004"]
    assert posed.message == (
        "3 DOFs of the pose set to the nearest of their limits "
        "(first: knee_r.x is -3, rotxlimit is -2 0)"
    )


def test_pig_has_two_pairs_of_joints_with_equal_names(shared_data):
    for name in ("PIG_core.pkl", "core_txt_files"):
        _, findings = lint_files([shared_data / "pig" / name])
        assert heavy(findings) == [
            ("S006", '4 joints with duplicate names: "R leg" (2), "L leg" (2)')
        ]
        # The weights are not normalised; their sums have errors of at most 0.002.
        assert "W001" in notes(findings)


@pytest.mark.parametrize("name", ["SMPL_NEUTRAL.npz", "SMPL_NEUTRAL.pkl", "easymocap"])
def test_synthetic_models_and_captures_have_no_findings(shared_data, name):
    _, findings = lint_files([shared_data / "smpl_synthetic" / name])
    # One of the two captured people has an unrelated pose in every frame, some with bent elbows.
    expected = {"C014", "C024"} if name == "easymocap" else set()
    assert {code for code, _ in heavy(findings)} == expected


@pytest.mark.usefixtures("quick_fits")
def test_automatically_rigged_mesh_has_no_findings(tmp_path):
    body = viewer.load(bundled_body()).actors[0]
    moved = 1.3 * viewer.deform(body.figure, body.pose)[0] + [0.2, 0.0, 0.1]
    triangles = body.figure.mesh.triangles
    mesh = Mesh(moved, vertex_normals(moved, triangles), triangles)
    export(Actor(Figure("scan", mesh)), tmp_path / "scan.obj")
    files = [tmp_path / "rigged.skel", tmp_path / "rigged.skin"]
    assert run(["rig", str(tmp_path / "scan.obj"), "-o", str(files[0])]) == 0
    scene, findings = lint_files(files)
    assert len(scene.actors) == 1 and scene.actors[0].figure.is_attached
    assert heavy(findings) == []
