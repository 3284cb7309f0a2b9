"""Repeated checks of an open scene and its files: duplicates, locations, and changed files."""

import os
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from formats import skel_text, skin_text
from linting.sound import column, scene_of
from linting.test_planted_files import LATE_KEYS

import viewer
from viewer.diagnostics import Diagnostic
from viewer.linting import Finding, finding_text, lint_files, recheck
from viewer.linting._files import located_in, of_diagnostic
from viewer.loading import bundled_files
from viewer.progress import Cancelled, receiving
from viewer.rigs.scene import Scene

ZERO_NORMAL = skin_text.GOOD.replace("0 0 1\n  0 1 0", "0 0 0\n  0 1 0", 1)
TEXTS = {
    "a.skel": skel_text.GOOD.replace("rotxlimit -1 1", "rotxlimit 1 -1"),
    "a.skin": ZERO_NORMAL.replace("2 0 0.25", "2 0 0.5", 1),
    "a.anim": LATE_KEYS,
}


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    """A rig and a clip with errors that readers repair, so that the figures do not contain them."""
    for name, text in TEXTS.items():
        (tmp_path / name).write_text(text)
    return [tmp_path / name for name in TEXTS]


def checked(files: list[Path], scene: Scene | None = None) -> list[Finding]:
    return recheck(scene or viewer.load(*files), files).findings


def test_errors_repaired_by_readers_are_found_as_by_the_command(files):
    again = recheck(viewer.load(*files), files)
    assert again.n_files == 3 and again.notes == ()
    texts = [*map(finding_text, again.findings)]
    assert texts == [*map(finding_text, lint_files(files)[1])]
    places = {(f.code, f.file.name, f.line) for f in again.findings if f.file is not None}
    assert {
        ("S003", "a.skel", 5), ("M007", "a.skin", 8), ("W001", "a.skin", 13), ("C001", "a.anim", 12)
    } <= places  # fmt: skip


def test_no_finding_is_reported_twice(files):
    codes = [f.code for f in checked(files)]
    assert [code for code in codes if code in ("W001", "M007", "S003", "C001")] == [
        "S003", "M007", "C001", "W001"
    ]  # fmt: skip


def test_reader_findings_have_the_location_they_state(files):
    found = {f.code: f for f in checked(files)}
    assert (found["M007"].actor, found["M007"].vertices.tolist()) == (0, [1])
    assert (found["S003"].actor, found["S003"].joints.tolist()) == (0, [0])
    # The ninth channel rotates the second joint; the first three translate the root.
    assert (found["C001"].actor, found["C001"].joints.tolist()) == (0, [1])


def test_edited_data_has_no_line(files):
    scene = viewer.load(*files)
    figure = scene.actors[0].figure
    weights = np.array(figure.skin.weights)
    weights[0] = 0.5
    skin = replace(figure.skin, weights=weights)
    scene.actors[0] = replace(scene.actors[0], figure=replace(figure, skin=skin))
    found = {f.code: f for f in checked(files, scene)}
    assert found["W001"].diagnostic.values["n"] == 2 and found["W001"].file is None
    # The skeleton is still that of the file.
    assert found["S003"].file.name == "a.skel" and found["S003"].actor == 0
    # The reader's messages about the skin may not apply to this mesh.
    assert found["M007"].file.name == "a.skin" and found["M007"].actor is None


def test_missing_files_are_reported(files):
    scene = viewer.load(*files)
    files[1].unlink()
    again = recheck(scene, files)
    assert again.notes == ("a.skin is missing: only the open scene was checked",)
    (gone,) = [f for f in again.findings if f.severity == "error" and f.code[0] == "F"]
    assert (gone.code, gone.file) == ("F001", files[1])
    found = {f.code: f for f in again.findings}
    assert (found["W001"].file, found["W001"].line) == (files[1], None)
    assert found["S003"].line == 5


def test_changed_files_are_reported(files):
    scene, opened_at = viewer.load(*files), time.time()
    assert recheck(scene, files, since=opened_at + 60.0).notes == ()
    os.utime(files[0], (opened_at + 100.0,) * 2)
    again = recheck(scene, files, since=opened_at + 60.0)
    assert again.notes == (
        "a.skel was changed after opening: readers' messages are about the new contents",
    )
    for path in files:
        os.utime(path, (opened_at + 100.0,) * 2)
    again = recheck(scene, files, since=opened_at + 60.0)
    assert again.notes[0].startswith("a.skel, a.skin, a.anim were changed")


def test_changed_file_in_a_folder_is_detected(tmp_path):
    from formats import pig_text

    folder = pig_text.write(tmp_path / "pig")
    scene, opened_at = viewer.load(folder), time.time()
    os.utime(folder / "vertices.txt", (opened_at + 100.0,) * 2)
    assert recheck(scene, [folder], since=opened_at + 60.0).notes[0].startswith("pig was")


def test_new_error_in_a_changed_file_is_reported(files):
    scene = viewer.load(*files)
    files[1].write_text(TEXTS["a.skin"].replace("2 0 0", "2 up 0", 1))
    found = checked(files, scene)
    assert ("F002", files[1], 3) in [(f.code, f.file, f.line) for f in found]


def test_scene_knows_its_files():
    bundled = list(bundled_files())
    again = recheck(viewer.load())
    assert again.n_files == 2 and all(f.file in bundled for f in again.findings)
    assert recheck(scene_of(column())).n_files == 0


def test_findings_about_captured_people_refer_to_the_folder(shared_data):
    folder = shared_data / "smpl_synthetic" / "easymocap" / "keypoints3d"
    found = checked([folder])
    assert [(f.code, f.actor, f.file) for f in found if f.code == "C012"] == [
        ("C012", 0, folder), ("C012", 1, folder)
    ]  # fmt: skip


def test_progress_may_cancel_while_frames_are_read(shared_data):
    folder = shared_data / "smpl_synthetic" / "easymocap" / "keypoints3d"
    scene = viewer.load(folder)

    def stop(done: int, total: int, unit: str, what: str) -> None:
        if what == "reading frames":
            raise Cancelled

    with pytest.raises(Cancelled), receiving(stop):
        recheck(scene, [folder])


@pytest.mark.parametrize(
    ("found", "part", "vertices", "joints"),
    [
        (("M007.computed", "positions", [5]), "mesh", [5], []),
        (("B002.skin-matrix", "bindings", [1]), "mesh", [], [1]),
        (("S003.limits", "items", [1]), "skeleton", [], [1]),
        (("F006.unknown", "", None), "skeleton", None, None),
        (("C001.keys", "channels", [4]), "clip", [], [0]),
        (("C001.keys", "channels", [99]), "clip", None, None),
        (("F007.anim-range", "", None), "clip", None, None),
    ],
)
def test_reader_findings_keep_their_locations(found, part, vertices, joints):
    key, data, places = found
    remark = Diagnostic(
        f"{key}: text", Path("a.skin"), 8, data, None if places is None else np.array(places)
    )
    aimed = located_in(of_diagnostic(remark), scene_of(column()).actors[0], part)
    if vertices is None:
        assert aimed is None
    else:
        assert (aimed.vertices.tolist(), aimed.joints.tolist()) == (vertices, joints)


def test_vertex_stated_only_in_a_value_is_found():
    remark = Diagnostic("W010.vertex: vertex {vertex}", Path("a.npz"), values={"vertex": 3})
    aimed = located_in(of_diagnostic(remark), scene_of(column()).actors[0], "mesh")
    assert aimed.vertices.tolist() == [3]
