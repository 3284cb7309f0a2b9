"""``viewer rig --clip``, which transfers motions of the template to the rigged mesh."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import viewer
from viewer.cli import run
from viewer.formats import write
from viewer.rigs.motion.clip_edit import clip_from_frames
from viewer.rigs.scene import pose_actors

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("quick_fits", "transfer_once")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory, scan_folder):
    """The scan of a fox, and a clip in which the fox walks along z."""
    folder = tmp_path_factory.mktemp("clips")
    (folder / "scan.obj").write_bytes((scan_folder / "scan.obj").read_bytes())
    fox = viewer.load().actors[0]
    dofs = np.tile(fox.pose.dofs, (2, 1))
    dofs[1, 2] += 0.6
    dofs[1, fox.figure.skeleton.names.index("jaw") + 3] += 0.1
    write(clip_from_frames("walk", dofs, np.array([0.0, 1.0]), "linear"), folder / "walk.anim")
    return folder


def rig(folder, *options):
    return run(["rig", str(folder / "scan.obj"), "--from", "fox", *map(str, options)])


def test_template_path_is_scaled_with_the_figure(folder, tmp_path, capsys):
    out = tmp_path / "cat.npz"
    assert rig(folder, "-o", out, "--clip", folder / "walk.anim") == 0
    said = capsys.readouterr()
    assert said.err == ""
    written = tmp_path / "cat-walk.anim"
    assert said.out.splitlines()[-1].startswith(f"{written}: 114 channels with ")
    actor = viewer.load(out, written).actors[0]
    fox = viewer.load().actors[0]
    fox.clip = viewer.load(folder / "walk.anim", out).actors[0].clip
    for time in (0.0, 0.5, 1.0):
        pose_actors([actor], time)
        pose_actors([fox], time)
        found = viewer.deform(actor.figure, actor.pose)[0]
        # The rest pose of the new figure has the axes of the template.
        wanted = 100.0 * viewer.deform(fox.figure, fox.pose)[0]
        assert_allclose(found, wanted, atol=1e-5 * 118.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--clip", "walk.anim"], "viewer: --clip: expected -o FILE to write the motion next to, "
                                  "found none"),
        (["-o", "OUT", "--clip", "walk.anim", "--clip", "walk.anim"],
         "viewer: --clip: expected different file names, found out-walk twice"),
        (["-o", "OUT", "--clip", "scan.obj"],
         "viewer: --clip: expected a motion of the template, found none in scan.obj"),
    ],
)  # fmt: skip
def test_clips_that_cannot_be_transferred_are_refused(
    folder, tmp_path, capsys, monkeypatch, options, message
):
    monkeypatch.chdir(folder)
    out = tmp_path / "out.npz"
    assert rig(folder, *(str(out) if option == "OUT" else option for option in options)) == 2
    assert capsys.readouterr().err.splitlines()[-1] == message
    assert not list(tmp_path.iterdir())


def test_existing_clip_is_not_replaced(folder, tmp_path, capsys):
    out = tmp_path / "cat.npz"
    (tmp_path / "cat-walk.anim").write_text("mine")
    assert rig(folder, "-o", out, "--clip", folder / "walk.anim") == 5
    assert "cat-walk.anim: already exists (--force replaces it)" in capsys.readouterr().err
    assert not out.exists()
