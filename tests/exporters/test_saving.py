"""Exporters with a full disk, a locked folder or an unusual target, which must not lose files."""

import errno
import os
import shutil
import stat
import tempfile
from dataclasses import replace
from itertools import count
from pathlib import Path

import faults
import numpy as np
import pytest
from autorig.rigged_shapes import arm
from exporters.plain_readers import read_obj
from exporters.stretched import chain
from numpy.testing import assert_allclose
from seamed import OTHER_PICTURE, PICTURE, seamed_actor, seamed_mesh

import viewer
from viewer import formats
from viewer.autorig.alignment.surface_alignment import AlignmentSettings
from viewer.autorig.pipeline import transfer
from viewer.autorig.settings import TransferSettings
from viewer.cli import run
from viewer.errors import OutputError, RigError, UnsupportedFormatError
from viewer.exporters import (
    EXPORTERS,
    ExportOptions,
    Part,
    Selection,
    VrmMeta,
    export,
    output_files,
)
from viewer.exporters._rigged_files import files_of, without_correctives, write_rigged
from viewer.formats import all_or_none, save_text
from viewer.media import saving
from viewer.rigs.blendshapes import Correctives
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.motion.sampled_animation import sample_animation
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.pose import rest_pose
from viewer.rigs.posing.pose_record import apply_record
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skinning import deform

# VRM files need a humanoid and are saved like glTF files.
WRITERS = [kind for key, kind in EXPORTERS.items() if key != "vrm"]
SUFFIXES = [kind.suffixes[0] for kind in WRITERS if "pose" in kind.stores]
# The files that each exporter writes for the figure below, which has two textures.
SAVES = {".obj": 4, ".ply": 1, ".npz": 1, ".json": 1, ".skel": 4, ".glb": 1, ".html": 1}
# The template is where the target is.
IN_PLACE = TransferSettings(alignment=AlignmentSettings(matrix=np.eye(4)), fits=False)
# Existing files by the suffix of the output.
BESIDE = {".skel": (".skin",)}


pytestmark = pytest.mark.usefixtures("read_once")


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """A figure with two textures as files."""
    folder = tmp_path_factory.mktemp("in")
    of_triangle = np.array([0, 0, 1])
    mesh = seamed_mesh(pictures=(PICTURE, OTHER_PICTURE), of_triangle=of_triangle)
    export(seamed_actor(mesh=mesh), folder / "roof.skel")
    return [str(folder / "roof.skel"), str(folder / "roof.skin")]


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


class Fault:
    """A step that fails at its n-th call, and at all later calls if the disk stays full."""

    def __init__(self, monkeypatch, step: str, number: int) -> None:
        self.calls, self.number, self.step = 0, number, step
        self.stays = step in ("open", "write", "flush")
        wrapped = {
            "open": (tempfile, "mkstemp"),
            "flush": (saving.os, "fsync"),
            "rights": (Path, "chmod"),
            "rename": (Path, "replace"),
        }
        if step == "write":
            monkeypatch.setattr(saving.os, "fdopen", self._stream(os.fdopen))
        else:
            owner, name = wrapped[step]
            original = getattr(owner, name)
            monkeypatch.setattr(owner, name, lambda *a, **k: self._meet() or original(*a, **k))

    @property
    def has_struck(self) -> bool:
        return self.calls >= self.number

    def _meet(self) -> None:
        self.calls += 1
        if self.calls == self.number or (self.stays and self.has_struck):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def _stream(self, original):
        def opened(*arguments):
            stream = original(*arguments)
            return HalfWay(stream, self._meet)

        return opened


class HalfWay:
    """A stream that calls a function after half of the bytes are written."""

    def __init__(self, stream, meet) -> None:
        self.stream, self.meet = stream, meet
        self.flush, self.fileno = stream.flush, stream.fileno

    def __enter__(self):
        return self

    def __exit__(self, *problem):
        self.stream.close()

    def write(self, data):
        self.stream.write(data[: len(data) // 2])
        self.meet()
        self.stream.write(data[len(data) // 2 :])


@pytest.mark.slow
@pytest.mark.parametrize("step", ["open", "write", "flush", "rights", "rename"])
@pytest.mark.parametrize("is_there", [False, True], ids=["new", "replaced"])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_full_disk_at_every_step_changes_no_file(
    rig, tmp_path, monkeypatch, capsys, suffix, is_there, step
):
    folder = tmp_path / "out"
    folder.mkdir()
    for name in (suffix, *BESIDE.get(suffix, ())) if is_there else ():
        (folder / f"person{name}").write_text(f"precious {name}")
    before = contents(folder)
    for number in count(1):
        with monkeypatch.context() as patch:
            fault = Fault(patch, step, number)
            code = run(["convert", *rig, "-o", str(folder / f"person{suffix}"), "--force"])
        captured = capsys.readouterr()
        if not fault.has_struck:
            break
        assert code == 5 and captured.out == ""
        assert captured.err.startswith(f"viewer: {folder}{os.sep}")
        assert captured.err.endswith(": No space left on device\n")
        assert captured.err.count("\n") == 1
        assert contents(folder) == before
    assert code == 0 and captured.err == ""
    assert number > SAVES[suffix]  # every step has failed once
    written = contents(folder)
    assert len(written) == SAVES[suffix] and b"precious" not in b"".join(written.values())
    assert not [name for name in written if name.startswith(".")]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_interrupt_keeps_existing_files(rig, tmp_path, monkeypatch, capsys, suffix):
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / f"person{suffix}").write_text("precious")
    before, calls = contents(folder), []

    def interrupt(*_):
        calls.append(1)
        if len(calls) == SAVES[suffix]:
            raise KeyboardInterrupt

    monkeypatch.setattr(saving.os, "fsync", interrupt)
    assert run(["convert", *rig, "-o", str(folder / f"person{suffix}"), "--force"]) == 130
    assert capsys.readouterr().err == "viewer: interrupted\n"
    assert contents(folder) == before


# Unusual targets


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_target_that_is_a_folder_is_refused(rig, tmp_path, capsys, suffix):
    target = tmp_path / f"person{suffix}"
    target.mkdir()
    assert run(["convert", *rig, "-o", str(target), "--force"]) == 5
    assert capsys.readouterr().err == f"viewer: {target}: is a folder\n"
    assert sorted(path.name for path in tmp_path.iterdir()) == [target.name]


def test_second_file_of_a_rig_that_is_a_folder_is_refused(rig, tmp_path, capsys):
    (tmp_path / "person.skin").mkdir()
    assert run(["convert", *rig, "-o", str(tmp_path / "person.skel")]) == 5
    assert capsys.readouterr().err == f"viewer: {tmp_path / 'person.skin'}: is a folder\n"
    assert not (tmp_path / "person.skel").exists()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_folder_that_cannot_be_written_is_refused(rig, tmp_path, capsys, suffix):
    folder = tmp_path / "locked"
    folder.mkdir()
    folder.chmod(0o555)
    if os.access(folder, os.W_OK):
        folder = Path("/proc")  # only kernel file systems are not writable for root
    assert run(["convert", *rig, "-o", str(folder / f"person{suffix}")]) == 5
    error = capsys.readouterr().err
    assert error.startswith(f"viewer: {folder}/") and error.count("\n") == 1
    assert not list(folder.glob("*person*"))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_link_is_followed_and_kept(rig, tmp_path, suffix):
    kept = tmp_path / "kept"
    kept.mkdir()
    target = kept / f"real{suffix}"
    target.write_text("old")
    target.chmod(0o640)
    link = tmp_path / f"person{suffix}"
    link.symlink_to(f"kept/real{suffix}")
    assert run(["convert", *rig, "-o", str(link), "--force"]) == 0
    assert link.is_symlink() and len(target.read_bytes()) > 100
    assert stat.S_IMODE(target.stat().st_mode) == 0o640
    assert [path.name for path in kept.iterdir()] == [target.name]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has /dev/full")
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_full_device_is_reported_and_other_files_survive(rig, tmp_path, capsys, suffix):
    folder = tmp_path / "out"
    folder.mkdir()
    link = folder / f"person{suffix}"
    link.symlink_to("/dev/full")
    assert run(["convert", *rig, "-o", str(link)]) == 5
    assert capsys.readouterr().err == f"viewer: {link}: No space left on device\n"
    assert [path.name for path in folder.iterdir()] == [link.name]
    assert link.is_symlink() and stat.S_ISCHR(Path("/dev/full").stat().st_mode)


def test_dangling_link_creates_its_target(rig, tmp_path):
    link = tmp_path / "person.obj"
    link.symlink_to("real.obj")
    assert run(["convert", *rig, "-o", str(link)]) == 0
    assert link.is_symlink() and len(read_obj(tmp_path / "real.obj").v) == 7


# Several files together


def test_all_or_none_accepts_an_empty_list():
    with all_or_none([]):
        pass


def test_all_or_none_restores_previous_files(tmp_path):
    old, new, link = tmp_path / "old", tmp_path / "new", tmp_path / "link"
    old.write_text("old")
    link.symlink_to("new")
    with pytest.raises(OutputError, match="full"), all_or_none([old, new, link]):
        save_text(old, "changed")
        save_text(link, "written")
        raise OutputError("full")
    assert old.read_text() == "old" and not new.exists() and link.is_symlink()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link", "old"]


def test_all_or_none_leaves_no_copies(tmp_path):
    old = tmp_path / "old"
    old.write_text("old")
    with all_or_none([old]):
        save_text(old, "changed")
    assert contents(tmp_path) == {"old": b"changed"}


def test_failing_outer_block_reverts_inner_writes(tmp_path):
    old, new, twice = tmp_path / "old", tmp_path / "new", tmp_path / "twice"
    old.write_text("old")
    twice.write_text("twice")
    with pytest.raises(OutputError, match="full"), all_or_none([twice]):
        save_text(twice, "once")
        with all_or_none([old, new, twice]):
            save_text(old, "changed")
            save_text(new, "written")
            save_text(twice, "again")
        raise OutputError("full")
    assert contents(tmp_path) == {"old": b"old", "twice": b"twice"}
    with all_or_none([twice]), all_or_none([old, new, twice]):
        save_text(old, "changed")
        save_text(new, "written")
    assert contents(tmp_path) == {"old": b"changed", "new": b"written", "twice": b"twice"}


def test_all_or_none_refuses_before_any_change(tmp_path, monkeypatch):
    old = tmp_path / "old"
    old.write_text("old")

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(shutil, "copy2", full)
    with pytest.raises(OutputError) as caught, all_or_none([tmp_path / "new", old]):
        pytest.fail("the block must not run")
    assert str(caught.value) == f"{old}: No space left on device"
    assert contents(tmp_path) == {"old": b"old"}


def person(number: int, present: bool = True) -> Actor:
    """Return a chain that stands still for three frames, as a person of a capture."""
    figure = chain()
    still = np.tile([0.0, 0.0, 0.0, 1.0], (3, figure.require_skeleton().n_joints, 1))
    rows = np.arange(3, dtype=np.int32) if present else np.full(3, -1, dtype=np.int32)
    clip = SampledClip("stand", Timing(10.0, rows), still)
    return Actor(figure, figure_pose(figure), clip, person=number, is_present=present)


def part(actor: Actor) -> Part:
    return Part(actor, None, sample_animation(actor))


def test_people_who_are_absent_are_left_out_but_keep_their_numbers(tmp_path):
    parts = [part(person(number, number != 1)) for number in range(3)]
    notes = export(Selection(parts), tmp_path / "a.bvh")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a-0.bvh", "a-2.bvh"]
    assert [note.key.partition(":")[0] for note in notes][-1] == "X003.absent"
    with pytest.raises(RigError, match="no person is present in frames 0 to 2"):
        export(Selection(parts[1:2]), tmp_path / "b.bvh")


def test_actors_left_out_before_count_in_the_names(tmp_path):
    actors = [person(number) for number in range(2)]
    chosen = Selection([part(actors[1])], among=actors)
    options = ExportOptions()
    assert output_files(chosen, tmp_path / "a.bvh", options) == [tmp_path / "a-1.bvh"]
    # A file that holds several has the name that was asked for.
    files = output_files(chosen, tmp_path / "a.gltf", options)
    assert files == [tmp_path / "a.gltf", tmp_path / "a.bin"]


def test_a_chosen_actor_is_written_although_absent(tmp_path):
    export(person(4, present=False), tmp_path / "a.glb")
    absent = Selection([Part(person(4, present=False))], Scene([]))
    with pytest.raises(RigError, match="no person is present at that time"):
        export(absent, tmp_path / "b.glb")


def test_contents_that_a_format_cannot_store_are_refused(tmp_path):
    motion = Selection([part(person(0))])
    with pytest.raises(UnsupportedFormatError, match=r'no motion exporter for "\.ply"'):
        export(motion, tmp_path / "a.ply")
    with pytest.raises(UnsupportedFormatError, match=r"a\.ply: ply files cannot store frames"):
        export(motion, tmp_path / "a.ply", options=ExportOptions(kind="ply"))
    with pytest.raises(RigError, match="expected at least one actor"):
        export(Selection([]), tmp_path / "a.glb")
    assert not [*tmp_path.iterdir()]


def test_every_exporter_stores_something_and_knows_its_files():
    for kind in EXPORTERS.values():
        assert kind.stores and set(kind.written) <= set(kind.suffixes)
        assert bool(kind.folder) == (kind.suffixes == ("/",))


@pytest.fixture(scope="module")
def rigged():
    """A bent arm with correctives, rigged to its own mesh."""
    plain = arm()
    offsets = np.random.default_rng(4).normal(scale=0.02, size=(9, plain.mesh.n_vertices, 3))
    template = Figure(
        "arm", plain.mesh, plain.skeleton, plain.skin, correctives=Correctives(offsets)
    )
    pose = rest_pose(template.skeleton)
    pose.dofs[6:] = 0.2, -0.1, 0.7
    target = viewer.Mesh(*deform(template, pose), plain.mesh.triangles)
    return target, transfer(template, pose, target, IN_PLACE)


def test_pose_file_fits_a_skeleton_whose_rest_rotations_became_angles(tmp_path):
    """The .skel has no rest rotations: angles of the pose file are those of its joints."""
    plain = arm()
    turned = np.random.default_rng(7).normal(size=(plain.skeleton.n_joints, 4))
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    joints = replace(plain.skeleton, rest_rotations=turned)
    bound = np.linalg.inv(world_matrices(joints, rest_pose(joints)))
    template = Figure("arm", plain.mesh, joints, replace(plain.skin, inverse_bind=bound))
    pose = rest_pose(joints)
    pose.dofs[-3:] = 0.2, -0.1, 0.7
    target = viewer.Mesh(*deform(template, pose), plain.mesh.triangles)
    write_rigged(transfer(template, pose, target, IN_PLACE), tmp_path / "arm.skel")
    again = viewer.load(tmp_path / "arm.skel", tmp_path / "arm.skin").actors[0]
    record = formats.read(formats.Source.open(tmp_path / "arm.json"))
    assert apply_record(record, again.figure, again.pose) == []
    assert_allclose(deform(again.figure, again.pose)[0], target.positions, atol=1e-9)


def test_file_names_of_rigged_meshes_depend_on_the_format():
    assert files_of(Path("a/b.npz")) == [Path("a/b.npz")]
    assert [path.name for path in files_of(Path("b.skin"))] == [
        "b.skel", "b.skin", "b.obj", "b.json",
    ]  # fmt: skip
    with pytest.raises(UnsupportedFormatError) as caught:
        files_of(Path("b.fbx"))
    assert str(caught.value) == (
        'a rigged mesh cannot be written as ".fbx"; supported: .skel (with .skin, .obj and '
        "the target's pose as .json), .npz, .glb, .gltf, .vrm"
    )


def test_pose_matches_the_target_without_correctives(rigged):
    target, found = rigged
    assert found.figure.correctives is not None
    plain = without_correctives(found)
    assert plain.correctives is None
    assert_allclose(deform(plain, found.pose)[0], target.positions, atol=1e-9)
    assert_allclose(deform(found.figure, found.pose)[0], target.positions, atol=1e-9)
    assert np.abs(plain.mesh.positions - found.figure.mesh.positions).max() > 1e-3


def test_skel_rig_matches_the_target_and_reports_losses(rigged, tmp_path):
    target, found = rigged
    found = replace(found, figure=replace(found.figure, up="z", unit="cm"))
    lines = faults.lines(write_rigged(found, tmp_path / "arm.skel"))
    assert lines[-1].startswith("pose correctives are not stored: ")
    assert lines[-2].endswith(", the target's pose") and "arm.json" in lines[-2]
    files = [tmp_path / f"arm.{suffix}" for suffix in ("skel", "skin", "obj", "json")]
    (actor,) = viewer.load(*files).actors
    # Only the .obj states them.
    assert (actor.figure.up, actor.figure.unit) == ("z", "cm")
    # The text formats have six or more decimals.
    assert_allclose(deform(actor.figure, actor.pose)[0], target.positions, atol=1e-5)


def test_npz_keeps_correctives(rigged, tmp_path):
    _, found = rigged
    lines = faults.lines(write_rigged(found, tmp_path / "arm.npz"))
    assert lines == [
        f"{tmp_path / 'arm.npz'}: the figure with its rig, the target's pose and the confidence"
    ]
    again = viewer.load(tmp_path / "arm.npz").actors[0].figure
    assert again.correctives is not None and len(again.fields) == 3


def test_vrm_contains_the_figure_at_the_origin_wherever_the_mesh_is(rigged, tmp_path):
    body = viewer.load("body").actors[0].figure
    pose = figure_pose(body)
    pose.figure_translation = 3.0, 2.0, -1.0
    meta = VrmMeta(authors=("Ada",), licence="https://vrm.dev/licenses/1.0/")
    found = replace(rigged[1], figure=body, pose=pose)
    lines = faults.lines(write_rigged(found, tmp_path / "body.vrm", meta))
    assert any("at the origin, not where the mesh is" in line for line in lines)
    positions = viewer.load(tmp_path / "body.vrm").actors[0].vertices()[0]
    middle = 0.5 * (positions.min(axis=0) + positions.max(axis=0))
    assert np.abs(middle[[0, 2]]).max() < 0.2 and abs(positions[:, 1].min()) < 0.04


def test_gltf_contains_the_figure_as_the_mesh_is(rigged, tmp_path):
    _, found = rigged
    pose = found.pose.copy()
    pose.dofs[:6] += 0.5
    pose.figure_translation = 0.3, 0.2, -0.1
    lines = faults.lines(write_rigged(replace(found, pose=pose), tmp_path / "arm.glb"))
    assert not any("rest pose" in line for line in lines)
    actor = viewer.load(tmp_path / "arm.glb").actors[0]
    plain = without_correctives(replace(found, pose=pose))
    skeleton = actor.figure.require_skeleton()
    assert skeleton.n_joints == plain.skeleton.n_joints
    # The file has single precision.
    target = deform(plain, pose)[0]
    assert np.abs(target - deform(plain)[0]).max() > 0.1
    assert_allclose(deform(actor.figure, actor.pose)[0], target, rtol=0, atol=1e-6)
    # The mesh is bound there: nothing moves it at rest.
    assert_allclose(actor.figure.mesh.positions, target, rtol=0, atol=1e-6)
    joints = world_matrices(skeleton, rest_pose(skeleton))
    places = world_matrices(plain.skeleton, pose)[:, :3, 3] + pose.figure_translation
    assert_allclose(joints[:, :3, 3], places, rtol=0, atol=1e-6)
    unmoved = np.tile(np.eye(4), (len(joints), 1, 1))
    assert_allclose(joints @ actor.figure.skin.inverse_bind, unmoved, rtol=0, atol=1e-6)
    assert files_of(tmp_path / "arm.gltf") == [tmp_path / "arm.gltf", tmp_path / "arm.bin"]
