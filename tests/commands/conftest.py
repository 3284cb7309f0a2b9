"""Fixtures for command tests."""

import pytest
from app.tiny import write_rig
from commands.drawn_motions import anim_text

import viewer
from viewer.cli import run
from viewer.commands import rig
from viewer.exporters import export
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh, vertex_normals
from viewer.rigs.scene import Actor


@pytest.fixture
def walk(tmp_path) -> list[str]:
    """Files of the tiny rig and a clip of 1 s that moves the root by 4 and bends the arm."""
    files = write_rig(tmp_path)
    clip = tmp_path / "walk.anim"
    # The channels are three translations, then x, y, z of the root and of the arm.
    clip.write_text(anim_text(1.0, 9, {0: (0.0, 4.0), 8: (0.0, 1.5)}))
    return [str(path) for path in (*files, clip)]


_DRAFT = ("--quality", "draft")  # the fastest quality


@pytest.fixture
def draw(tmp_path, capsys):
    """Return a function that renders files with options and returns the messages."""

    def command(files, name, *options, size="64x48", code=0):
        out = str(tmp_path / name)
        found = run(["render", *files, "-o", out, "--size", size, *_DRAFT, *options])
        said = capsys.readouterr()
        assert found == code, said.err
        return said

    return command


@pytest.fixture(scope="session")
def scan_folder(tmp_path_factory):
    """A folder with the mesh of a fox in centimetres, rotated by 90 degrees about y, scan.obj."""
    folder = tmp_path_factory.mktemp("scan")
    fox = viewer.load().actors[0]
    positions = 100.0 * viewer.deform(fox.figure, fox.pose)[0][:, [2, 1, 0]] * [1, 1, -1]
    mesh = fox.figure.mesh
    target = Mesh(
        positions,
        vertex_normals(positions, mesh.triangles),
        mesh.triangles,
        uvs=mesh.uvs,
        uv_triangles=mesh.uv_triangles,
    )
    export(Actor(Figure("scan", target)), folder / "scan.obj")
    return folder


@pytest.fixture(scope="session")
def transferred():
    """Results of transfers by their arguments."""
    return {}


@pytest.fixture
def transfer_once(transferred, monkeypatch):
    """Rig a mesh once in the same way: most tests differ only in what becomes of the result."""
    transfer = rig.transfer

    def kept(figure, pose, target, settings, name):
        key = (figure.name, pose.dofs.tobytes(), target.positions.tobytes(), repr(settings), name)
        if key not in transferred:
            transferred[key] = transfer(figure, pose, target, settings, name)
        return transferred[key]

    monkeypatch.setattr(rig, "transfer", kept)
