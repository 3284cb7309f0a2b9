"""Motions beyond the range of single precision, which are refused at the line of the value."""

import numpy as np
import pytest
from faults import fault_of
from formats.capture_files import body, opened, rows_of, write_frames

from viewer.diagnostics import Collector, Phrase
from viewer.errors import FormatError
from viewer.formats import Source, amass, anim
from viewer.formats import bvh as bvh_reader
from viewer.formats._translation_limit import is_beyond
from viewer.phrases import rounded

TOO_FAR = [2e9, -1e20, 1e38]


def refusal(read, path):
    with pytest.raises(FormatError) as caught:
        read(Source.open(path))
    return caught.value


def tolerant(read, path):
    source = Source.open(path, diagnostics=Collector(keeps_errors=True))
    return read(source), source.diagnostics.errors


def test_positions_out_of_range_are_detected_row_by_row():
    rows = np.array([[[1e9, 0.0]], [[0.0, -1.0000001e9]], [[np.nan, 0.0]]])
    assert is_beyond(rows).tolist() == [False, True, False]


def motion_file(path, far, key="trans", **more):
    trans = np.zeros((3, 3))
    trans[1, 2] = far
    np.savez(path, poses=np.zeros((3, 72)), mocap_framerate=30.0, **{key: trans}, **more)
    return path


@pytest.mark.parametrize("far", TOO_FAR)
@pytest.mark.parametrize("key", ["trans", "transl"])
def test_far_translation_is_a_gap(tmp_path, far, key):
    source = Source.open(motion_file(tmp_path / "a.npz", far, key))
    assert amass.read(source).timing.rows.tolist() == [0, -1, 2]
    (note,) = (note for note in source.diagnostics.warnings if note.key == "F007.frames-lost")
    values = {"item": key, "limit": 1e9, "found": far, "frame": 1}
    assert fault_of(note.values["problem"]) == ("F003.motion-reach", None, values)


def test_translation_is_checked_after_scaling(tmp_path):
    path = motion_file(tmp_path / "a.npz", 5e10, smpl_scaling=np.array([100.0]))
    assert amass.read(Source.open(path)).translations[1, 2] == 5e8


def test_translation_at_the_limit_is_accepted(tmp_path):
    path = motion_file(tmp_path / "a.npz", 1e9)
    assert amass.read(Source.open(path)).translations[1, 2] == 1e9


@pytest.mark.parametrize("far", TOO_FAR)
def test_far_person_is_a_gap(tmp_path, far):
    good, bad = [body(0)], [body(0, Th=[[0.0, far, 0.0]])]
    folder = write_frames(tmp_path / "smpl", {0: bad, 1: good, 2: bad, 3: good})
    _, parts, _ = opened(tmp_path)
    assert rows_of(parts, 0) == [1, 3]
    problem = Phrase(
        "expected numbers within ±{limit}, found {found:g}", limit=rounded(1e9, 2), found=far
    )
    fault = ("F003.record", None, {"item": "person 0: Th", "problem": problem})
    warnings = [found for part in parts for found in part.warnings]
    assert [(found.path, *fault_of(found)) for found in warnings] == [
        (folder / "000000.json", "F007.record", 1, {"problem": fault}),
        (folder / "000002.json", "F007.record", 1, {"problem": fault}),
    ]


BVH = """HIERARCHY
ROOT hip
{{
OFFSET {offset} 0 0
CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
End Site
{{
OFFSET 0 1 0
}}
}}
MOTION
Frames: 3
Frame Time: 0.1
{offset} 0 0 0 0 0
{offset} 0 {far} 0 0 0
{offset} 1 0 0 0 0
"""


@pytest.mark.parametrize("far", TOO_FAR)
def test_far_position_is_refused_with_its_line(tmp_path, far):
    path = tmp_path / "a.bvh"
    path.write_text(BVH.format(offset=0, far=far))
    item = "frame 1: Zposition of joint hip"
    values = {"item": item, "most": 1e9, "found": pytest.approx(far)}
    error = refusal(bvh_reader.read, path)
    assert fault_of(error.diagnostic) == ("F003.beyond", 15, values)
    assert error.path == path
    motion, faults = tolerant(bvh_reader.read, path)
    assert [(fault.part, fault.places.tolist()) for fault in faults] == [("frames", [1])]
    assert motion.clip.translations[:, 0].tolist() == [[0, 0, 0], [0, 0, 0], [0, 1, 0]]


def test_large_skeleton_without_translation_is_accepted(tmp_path):
    path = tmp_path / "a.bvh"
    path.write_text(BVH.format(offset=1e12, far=1))
    assert bvh_reader.read(Source.open(path)).clip.translations[1, 0].tolist() == [0, 0, 1]


@pytest.mark.parametrize("far", TOO_FAR)
def test_far_key_is_refused_with_its_line(tmp_path, far):
    path = tmp_path / "a.anim"
    keys = f"keys 2 {{\n0 1 linear linear\n1 {far} linear linear\n}}"
    head = "animation {\nrange 0 1\nnumchannels 1\nchannel {\nextrapolate constant constant\n"
    path.write_text(f"{head}{keys}\n}}\n}}\n")
    error = refusal(anim.read, path)
    key, line, values = fault_of(error.diagnostic)
    assert (key, line, values["most"], values["item"].values["item"]) == (
        "F003.beyond", 8, 1e9, "value"
    )  # fmt: skip
    assert values["found"] == pytest.approx(far)
    clip, faults = tolerant(anim.read, path)
    assert len(faults) == 1 and clip.channels[0].values.tolist() == [1.0]
