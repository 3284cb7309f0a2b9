"""Actors and scenes are named uniquely after the opened files."""

import shutil

import numpy as np
import pytest
from app.tiny import write_rig
from formats.capture_files import body, points, write_frames
from formats.pig_text import CORE
from formats.pig_text import write as write_pig

from viewer.cli import run
from viewer.formats import file_stem
from viewer.loading import MotionSettings, bundled_files, load
from viewer.media.file_names import folder_name, opened_text
from viewer.rigs.scene import Actor, free_title

BVH = """HIERARCHY
ROOT pelvis
{
 OFFSET 0 0 0
 CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
 JOINT left_hip
 {
  OFFSET 0.1 -0.1 0
  CHANNELS 3 Zrotation Yrotation Xrotation
  End Site
  {
   OFFSET 0 -0.4 0
  }
 }
}
MOTION
Frames: 2
Frame Time: 0.1
0 0.9 0  0 0 0  0 0 0
0 0.9 0  0 0 0  10 0 0
"""


def names(*paths, **settings):
    """Return the names of the actors of files and the name of their scene."""
    scene = load(*paths, motion=MotionSettings(**settings))
    return [actor.name for actor in scene.actors], scene.title


@pytest.fixture
def seq(tmp_path):
    """An EasyMocap recording of two people, one of them with keypoints."""
    folder = tmp_path / "seq_smpl"
    write_frames(folder / "smpl", {0: [body(0), body(7)], 1: [body(0)]})
    write_frames(folder / "keypoints3d", {0: [points(0)], 1: [points(0)]})
    return folder


@pytest.fixture
def walk(tmp_path):
    """An AMASS file."""
    path = tmp_path / "walk.npz"
    np.savez(
        path, poses=np.zeros((3, 156)), trans=np.zeros((3, 3)), betas=np.zeros(16),
        gender="neutral", mocap_framerate=30.0,
    )  # fmt: skip
    return path


def test_bundled_figure_is_the_fox():
    assert names() == (["fox"], "fox")
    assert names(*bundled_files()) == (["fox"], "fox")


def test_people_in_a_recording_are_named_after_it(seq):
    people = ["seq_smpl 0", "seq_smpl 7", "seq_smpl body25 0"]
    assert names(seq) == (people, "seq_smpl")
    assert names(seq / "smpl") == (people[:2], "seq_smpl")
    assert names(seq / "keypoints3d") == (people[2:], "seq_smpl")


def test_generic_folder_name_is_replaced_by_the_parent_folder(seq, monkeypatch):
    monkeypatch.chdir(seq / "smpl")
    assert names(".")[1] == names("../smpl")[1] == names("..")[1] == "seq_smpl"


def test_dot_in_a_folder_name_is_not_a_suffix(tmp_path):
    write_frames(tmp_path / "dance.v2", {0: [body(0)]})
    assert names(tmp_path / "dance.v2")[1] == "dance.v2"


def test_body_motions_are_named_after_their_file_for_any_model(walk, tmp_path):
    assert names(walk) == (["walk"], "walk")
    (tmp_path / "jump.bvh").write_text(BVH)
    driven = load(bundled_body_path(), tmp_path / "jump.bvh")
    assert [actor.name for actor in driven.actors] == ["body"]  # the body itself was opened
    named = names(tmp_path / "jump.bvh", model=bundled_body_path())
    assert named == (["jump"], "jump")
    assert names(tmp_path / "jump.bvh") == (["jump"], "jump")


def bundled_body_path():
    from viewer.loading import bundled_body

    return bundled_body()


def test_pig_is_named_after_the_given_file_or_folder(tmp_path, monkeypatch):
    write_pig(tmp_path / "core_txt_files", CORE)
    (tmp_path / "piglet").mkdir()
    shutil.move(tmp_path / "core_txt_files", tmp_path / "piglet")
    assert names(tmp_path / "piglet" / "core_txt_files")[0] == ["piglet"]
    monkeypatch.chdir(tmp_path / "piglet" / "core_txt_files")
    assert names(".")[0] == ["piglet"]
    write_pig(tmp_path / "hog", CORE)
    assert names(tmp_path / "hog")[0] == ["hog"]


def test_figure_of_a_rig_file_is_named_after_it(tmp_path):
    write_rig(tmp_path, "tiny")
    (tmp_path / "hero.rig").write_text("rig Someone { skeleton tiny.skel skin tiny.skin }")
    assert names(tmp_path / "hero.rig") == (["hero"], "hero")


def test_duplicate_names_are_made_unique(tmp_path, walk, seq):
    rig = write_rig(tmp_path)
    assert names(*rig, *rig)[0] == ["tiny", "tiny-2"]
    (tmp_path / "other").mkdir()
    again = shutil.copy(walk, tmp_path / "other" / "walk.npz")
    assert names(walk, again)[0] == ["walk", "walk-2"]
    shutil.copytree(seq, tmp_path / "other" / "seq_smpl")
    both = names(seq / "smpl", tmp_path / "other" / "seq_smpl" / "smpl")[0]
    assert both == ["seq_smpl 0", "seq_smpl 7", "seq_smpl-2 0", "seq_smpl-2 7"]


def test_several_files_are_named_after_the_main_one(tmp_path, walk):
    rig = write_rig(tmp_path, "hero")
    assert names(*rig, walk) == (["hero", "walk"], "hero")


def test_free_title_increments_its_number():
    figure = load().actors[0].figure
    actors = [Actor(figure), Actor(figure, called="fox-2")]
    assert free_title(actors, "fox") == "fox-3" and free_title(actors, "cat") == "cat"


def test_suggested_folder_and_file_names(tmp_path):
    assert folder_name(tmp_path / "keypoints3d" / "smpl") == tmp_path.name
    assert opened_text(tmp_path / "take" / "smpl") == "take/smpl"
    assert opened_text(tmp_path / "take.bvh") == "take.bvh"
    assert file_stem("../seq 0\n") == ".._seq_0_"


def test_info_names_people_after_their_recording(seq, capsys):
    assert run(["info", str(seq / "smpl")]) == 0
    heads = [line for line in capsys.readouterr().out.splitlines() if line[:1] not in " w"]
    assert heads == ["seq_smpl 0", "seq_smpl 7"]
