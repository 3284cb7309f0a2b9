"""Files that commands write: their targets, and faults on the way."""

import errno
import os
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from exporters.seamed import OTHER_PICTURE, PICTURE, seamed_actor, seamed_mesh
from exporters.small_rigs import clip_text, write_twist
from formats.capture_files import body, write_frames
from formats.synthetic_smpl import model

from viewer.cli import run
from viewer.exporters import export
from viewer.media import saving

REMARKS = ("warning: ", "note: ")
"""Beginnings of lines about a command that goes on."""
FREE = (".mtl", ".png")
"""Suffixes of companion files; those of an ``.obj`` get unused names."""


@dataclass(frozen=True, slots=True)
class Inputs:
    """Input files of the commands: a rig with textures, a rig with a clip, and a capture."""

    roof: tuple[str, ...] = ()
    twist: tuple[str, ...] = ()
    recording: tuple[str, ...] = ()
    of_roof: tuple[Path, ...] = ()
    of_twist: tuple[Path, ...] = ()
    of_take: tuple[Path, ...] = ()

    @property
    def all(self) -> tuple[Path, ...]:
        return self.of_roof + self.of_twist + self.of_take

    def read_by(self, command: list[str]) -> tuple[Path, ...]:
        """Return all files that a command reads, including textures and the frames of a folder."""
        if any(word in command for word in self.recording[:1]):
            return self.of_take
        return self.of_roof if self.roof[1] in command else self.of_twist


def write_inputs(folder: Path) -> Inputs:
    """Write a rig with textures, one with a clip, and a capture of two people with its model.
    Person 0 is in frames 20 to 23, person 7 in all except 22.
    """
    mesh = seamed_mesh(pictures=(PICTURE, OTHER_PICTURE), of_triangle=np.array([0, 0, 1]))
    export(seamed_actor(mesh=mesh), folder / "roof.skel")
    roof = [folder / "roof.skel", folder / "roof.skin", *sorted(folder.glob("cloth*.png"))]
    clip = folder / "walk.anim"
    clip.write_text(clip_text())
    twist = [*map(Path, write_twist(folder)), clip]
    smpl = folder / "SMPL.npz"
    np.savez(smpl, **model("smpl"))
    people = {frame: [body(0), body(7)] if frame != 22 else [body(0)] for frame in range(20, 24)}
    frames = write_frames(folder / "take" / "smpl", people)
    return Inputs(
        (*map(str, roof[:2]),),
        (*map(str, twist),),
        (str(folder / "take"), "--model", str(smpl)),
        (*roof,),
        (*twist,),
        (smpl, *sorted(frames.iterdir())),
    )


def converting(inputs: Inputs) -> dict[str, list[str]]:
    """Return fast commands without OpenGL by their output; ``OUT/`` stands for the folder."""
    poses = {
        f"a pose as {name}": ["convert", *inputs.roof, "-o", f"OUT/{name}"]
        for name in ("p.obj", "p.ply", "p.npz", "p.json", "p.skel", "p.glb", "p.gltf")
    }
    motions = {
        f"a motion as {name}": ["convert", *inputs.twist, "-o", f"OUT/{name}", "--frames", "0:3"]
        for name in ("w_{frame:03}.obj", "w.bvh", "w.anim", "w.glb", "w.gltf", "w.npz")
    }
    people = {
        f"people as {name} {' '.join(more)}": [
            "convert",
            *inputs.recording,
            "-o",
            f"OUT/{name}",
            *more,
        ]
        for name, *more in (
            ("m.bvh",),
            ("m.bvh", "--gaps", "split"),
            ("m.gltf", "--gaps", "split"),
            ("m.npz",),
            ("m.npz", "--gaps", "split"),
            ("m.npz", "--as", "npz"),
            ("m_{frame}.obj", "--frames", "21:23"),
            ("m.ply", "--frame", "20"),
        )
    }
    return poses | motions | people


def drawing(inputs: Inputs) -> dict[str, list[str]]:
    """Return commands that render."""
    quick = ["--size", "64x48", "--quality", "draft"]
    motion = [*inputs.twist, *quick, "--frames", "0:3"]
    return {
        f"{name} {' '.join(more)}": ["render", *motion, "-o", f"OUT/{name}", *more]
        for name, *more in (
            ("f_{frame}.png",),
            ("v.mp4",),
            ("v.webm",),
            ("v.gif",),
            ("s.png", "--contact-sheet", "2"),
        )
    } | {
        "x.jpg": ["render", *inputs.roof, "-o", "OUT/x.jpg", *quick],
        "d.png": ["diff", "+".join(inputs.roof), *inputs.roof[1:], "-o", "OUT/d.png"],
    }


def into(folder: Path, command: list[str], *more: str) -> list[str]:
    """Return the command with ``OUT/`` replaced by a folder."""
    return [word.replace("OUT/", f"{folder}/") for word in command] + list(more)


def contents(folder: Path) -> dict[str, bytes]:
    """Return the files in a folder and its subfolders."""
    found = (path for path in folder.rglob("*") if path.is_file() or path.is_symlink())
    return {str(path.relative_to(folder)): path.read_bytes() for path in found if path.exists()}


pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("read_once")]
CONVERTING, DRAWING = [*converting(Inputs())], [*drawing(Inputs())]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    return write_inputs(tmp_path_factory.mktemp("inputs"))


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    return folder


@pytest.fixture
def refuse(capsys):
    """Run a command that must refuse its output in one line before any file is written."""

    def run_it(command: list[str], *words: str) -> None:
        capsys.readouterr()
        assert run(command) == 5
        captured = capsys.readouterr()
        lines = [
            one for one in captured.err.splitlines() if not one.startswith(("warning: ", "note: "))
        ]
        assert captured.out == "" and len(lines) == 1, captured
        assert all(word in lines[0] for word in words), lines

    return run_it


def written_by(command: list[str], folder: Path) -> list[str]:
    """Run a command; delete its files and return the names given by the user."""
    assert run(into(folder, command)) == 0
    names = list(contents(folder))
    for name in names:
        (folder / name).unlink()
    has_companions = any(name.endswith((".obj", ".skel")) for name in names)
    named = [name for name in names if not (has_companions and Path(name).suffix in FREE)]
    assert named
    return named


def check_command(command: list[str], inputs: Inputs, folder: Path, refuse) -> None:
    """Check that each file written by a command is protected if it exists."""
    before = {path: path.read_bytes() for path in inputs.all}
    command = into(folder, command)
    for name in written_by(command, folder):
        target = folder / name
        target.write_bytes(b"precious")
        refuse(command, f"{target}: already exists")
        assert contents(folder) == {name: b"precious"}
        target.unlink()
        target.mkdir()
        refuse([*command, "--force"], f"{target}: is a folder")
        assert [path.name for path in folder.iterdir()] == [name]
        target.rmdir()
        for path in inputs.read_by(command):
            target.symlink_to(path)
            refuse([*command, "--force"], f"{target}: input files are never overwritten")
            target.unlink()
        target.hardlink_to(inputs.read_by(command)[0])
        refuse([*command, "--force"], f"{target}: input files are never overwritten")
        target.unlink()
    assert not contents(folder)
    assert {path: path.read_bytes() for path in inputs.all} == before


@pytest.mark.parametrize("case", CONVERTING)
def test_convert_checks_all_of_its_files(inputs, folder, refuse, case):
    check_command(converting(inputs)[case], inputs, folder, refuse)


@pytest.mark.parametrize("case", DRAWING)
def test_images_and_videos_are_checked(inputs, folder, refuse, case):
    if case.startswith("v."):
        pytest.importorskip("av")
    check_command(drawing(inputs)[case], inputs, folder, refuse)


def test_rigged_mesh_files_are_checked(inputs, folder, refuse):
    mesh = folder.parent / "mesh.obj"
    assert run(["convert", *inputs.roof, "-o", str(mesh)]) == 0
    command = ["rig", str(mesh), "--from", inputs.roof[0], "--from", inputs.roof[1]]
    command += ["-o", f"{folder}/r.skel"]
    for suffix in (".skel", ".skin", ".obj", ".json"):
        target = folder / f"r{suffix}"
        target.write_bytes(b"precious")
        refuse(command, f"{target}: already exists")
        assert contents(folder) == {target.name: b"precious"}
        target.unlink()
        # The texture of the mesh is an input, although the command line does not name it.
        for path in (*inputs.of_roof[:2], mesh.with_name("mesh_0.png")):
            target.symlink_to(path)
            refuse([*command, "--force"], f"{target}: input files are never overwritten")
            target.unlink()


def test_companion_files_avoid_existing_names(inputs, folder):
    for name in ("p.mtl", "p_0.png", "p_1.png"):
        (folder / name).write_bytes(b"precious")
    (folder / "p-2.mtl").symlink_to(folder / "elsewhere.mtl")
    assert run(["convert", *inputs.roof, "-o", f"{folder}/p.obj"]) == 0
    found = contents(folder)
    assert [found[name] for name in ("p.mtl", "p_0.png", "p_1.png")] == [b"precious"] * 3
    assert found["p_0-2.png"].startswith(b"\x89PNG") and "p-3.mtl" in found
    assert not (folder / "elsewhere.mtl").exists()


def test_writing_one_file_twice_in_a_run_is_refused(inputs, folder, refuse):
    command = ["convert", *inputs.recording, "-o", f"{folder}/m.bvh", "--force"]
    (folder / "m-7.bvh").symlink_to("m-0.bvh")
    refuse(command, f"{folder}/m-7.bvh: is the same file as {folder}/m-0.bvh")
    (folder / "m-0.bvh").write_bytes(b"precious")
    refuse(command, f"{folder}/m-7.bvh: is the same file as {folder}/m-0.bvh")
    assert contents(folder) == {"m-0.bvh": b"precious", "m-7.bvh": b"precious"}


def test_missing_folder_is_refused_before_any_work(inputs, folder, refuse):
    for case in ("a motion as w_{frame:03}.obj", "a pose as p.skel", "a motion as w.gltf"):
        command = [word.replace("OUT/", f"{folder}/no/") for word in converting(inputs)[case]]
        refuse(command, f"the folder {folder}/no does not exist")
    assert not contents(folder)


def test_existing_frame_is_refused_before_the_whole_sequence(inputs, folder, refuse):
    (folder / "w_002.obj").write_bytes(b"precious")
    command = into(folder, converting(inputs)["a motion as w_{frame:03}.obj"])
    refuse(command, f"{folder}/w_002.obj: already exists")
    assert contents(folder) == {"w_002.obj": b"precious"}
    assert run([*command, "--force"]) == 0
    assert sorted(contents(folder)) == [f"w_00{frame}.obj" for frame in range(3)]


def test_folder_of_frames_is_an_input(inputs, folder, refuse):
    recording = Path(inputs.recording[0])
    command = ["convert", *inputs.recording, "-o"]
    refuse([*command, str(recording), "--force"], "input folders are never overwritten")
    refuse(
        [
            "convert",
            str(recording / "smpl"),
            *inputs.recording[1:],
            "-o",
            str(recording),
            "--force",
        ],
        "input",
    )
    (folder / "link").symlink_to(recording)
    refuse([*command, f"{folder}/link", "--force"], "input folders are never overwritten")
    (folder / "file").write_bytes(b"precious")
    refuse([*command, f"{folder}/file"], f"{folder}/file: expected a folder")
    assert run([*command, f"{folder}/new"]) == 0
    refuse([*command, f"{folder}/new"], f"{folder}/new/smpl: already exists")


def test_different_textures_of_a_skin_are_not_replaced(inputs, folder, refuse):
    """Texture names in a ``.skin`` are fixed, so a different existing file is an error."""
    (folder / "cloth1.png").write_bytes(b"precious")
    for more in ([], ["--force"]):
        refuse(
            into(folder, converting(inputs)["a pose as p.skel"]) + more, "cloth1.png: a different"
        )
        assert contents(folder) == {"cloth1.png": b"precious"}


CONVERTED = [*converting(Inputs()), "people as a folder"]
PICTURES = [case for case in drawing(Inputs()) if not case.startswith("v.")]
FULL = os.strerror(errno.ENOSPC)


def command_of(inputs: Inputs, case: str, folder: Path) -> list[str]:
    if case == "people as a folder":
        return ["convert", *inputs.recording, "-o", str(folder / "new"), "--force"]
    return into(folder, (converting(inputs) | drawing(inputs))[case], "--force")


class FullDisk:
    """A disk that is full from the n-th write on, half of which is written."""

    def __init__(self, monkeypatch, number: int) -> None:
        self.calls, self.number = 0, number
        opened, write_text = os.fdopen, Path.write_text
        monkeypatch.setattr(saving.os, "fdopen", lambda *a: _Stream(opened(*a), self))

        def written(path, text, **settings):  # frames in a folder are written without a rename
            self.meet(lambda half: write_text(path, half, **settings), text)
            return write_text(path, text, **settings)

        monkeypatch.setattr(Path, "write_text", written)

    @property
    def has_struck(self) -> bool:
        return self.calls >= self.number

    def meet(self, write, data) -> None:
        self.calls += 1
        if self.has_struck:
            if self.calls == self.number:
                write(data[: len(data) // 2])
            raise OSError(errno.ENOSPC, FULL)


class _Stream:
    def __init__(self, stream, disk: FullDisk) -> None:
        self.stream, self.disk = stream, disk
        self.flush, self.fileno = stream.flush, stream.fileno

    def __enter__(self):
        return self

    def __exit__(self, *problem):
        self.stream.close()

    def write(self, data):
        self.disk.meet(self.stream.write, data)
        return self.stream.write(data)


def refused(code: int, capsys, folder: Path) -> None:
    captured = capsys.readouterr()
    lines = [
        one for one in captured.err.splitlines() if not one.startswith(("warning: ", "note: "))
    ]
    assert code == 5 and len(lines) == 1, captured
    assert lines[0].startswith(f"viewer: {folder}") and lines[0].endswith(f": {FULL}"), lines


@pytest.mark.parametrize("case", CONVERTED + PICTURES)
def test_failure_at_any_write_changes_no_file(inputs, tmp_path, monkeypatch, capsys, case):
    folder = tmp_path / "out"
    folder.mkdir()
    command = command_of(inputs, case, folder)
    assert run(command) == 0
    # The last file exists, the one before it is new, and so on.
    for number, name in enumerate(sorted(contents(folder), reverse=True)):
        if number % 2:
            (folder / name).unlink()
        elif Path(name).suffix not in FREE:  # these names depend on their contents
            (folder / name).write_bytes(f"precious {name}".encode())
    before = contents(folder)
    for number in count(1):
        capsys.readouterr()
        with monkeypatch.context() as patch:
            disk = FullDisk(patch, number)
            code = run(command)
        if not disk.has_struck:
            break
        refused(code, capsys, folder)
        found = contents(folder)
        if case.startswith("f_"):
            # Finished numbered images are kept, and no image is incomplete.
            found = {name: before.get(name, data) for name, data in found.items()}
            assert {name for name in found if name.startswith(".")} == set()
            found = {name: data for name, data in found.items() if name in before}
        assert found == before
    assert code == 0 and number > 1


@pytest.mark.parametrize("case", CONVERTED)
def test_every_disk_fill_level_keeps_existing_files(inputs, tiny_disk, capsys, case):
    folder, codes = tiny_disk / "out", []
    command = command_of(inputs, case, folder)
    for level in (0, 12, 14, 15, 16):  # all files together take a few blocks
        folder.mkdir()
        # tmpfs counts only the blocks of file contents.
        (tiny_disk / "fill").write_bytes(bytes(4096 * level))
        capsys.readouterr()
        codes.append(run(command))
        if codes[-1]:
            refused(codes[-1], capsys, folder)
            assert contents(folder) == {}
        names = [path.name for path in folder.rglob(".*")]
        assert names == []
        for path in sorted(folder.rglob("*"), reverse=True):
            path.rmdir() if path.is_dir() else path.unlink()
        folder.rmdir()
        (tiny_disk / "fill").unlink()
    # No run succeeds with less space than a failed run.
    assert codes == sorted(codes) and codes[-1] == 5
