"""The fraction of refusals of text formats that have a line, over seeded mutations of tiny files.
Only errors about a whole file have no line: an empty file, or an unknown format.
"""

import json
import random
import re

import pytest
from formats.bvh_text import GOOD as BVH
from formats.capture_files import body, points
from formats.easymocap.test_camera_files import EXTRINSIC, INTRINSIC, cameras
from formats.pig_text import GOOD as PIG
from formats.pig_text import write as write_pig
from test_count_lines import ANIM, MORPH, PLY, RIG
from test_mutations import SKEL, SKIN, mutate

from viewer.errors import FormatError
from viewer.formats import Source, detect, read

OBJ = """# four corners
mtllib a.mtl
v 0 0 0
v 1 0 0
v 1 1 0 0.5 0.5 0.5
v 0 1 0
vt 0 0
vt 1 1
vn 0 0 1
usemtl m
f 1/1/1 2/2/1 3/1/1
f -4//-1 -2//-1 -1//-1
"""
TEXTS = {
    "a.skel": SKEL,
    "a.skin": SKIN,
    "a.anim": ANIM.encode(),
    "a.morph": MORPH.encode(),
    "a.rig": RIG.encode(),
    "a.bvh": BVH.encode(),
    "a.obj": OBJ.encode(),
    "a.ply": PLY.encode(),
}
FRAMES = {
    "bodies.json": json.dumps([body(0, 9), body(1, 9)], indent=1).encode(),
    "points.json": json.dumps({"annots": [points(0, 3), points(1, 3)]}, indent=1).encode(),
}
SEEDS = range(3)
TRIES = 50
SHARE = 0.99


def refusal(source):
    """Return the refusal of a file; None if it is accepted or its format is unknown."""
    try:
        detect(source)
    except FormatError:
        return None
    try:
        read(source)
    except FormatError as problem:
        return problem
    return None


def assert_lines(problems, fewest):
    """Check the fraction of refusals, given with the refused bytes, that have a line."""
    told = [(problem, data) for problem, data in problems if data.strip()]
    assert len(told) >= fewest
    without = [str(problem) for problem, _ in told if problem.line is None]
    assert len(without) <= (1.0 - SHARE) * len(told), without
    for problem, data in told:
        # A line may end with CR, LF or both; one line is added for the end of the file.
        assert problem.line is None or 1 <= problem.line <= 1 + len(re.findall(rb"[\r\n]", data))


@pytest.mark.parametrize("name", TEXTS)
def test_refusals_of_text_formats_have_lines(name):
    problems = []
    for seed in SEEDS:
        rng = random.Random(seed)
        for data in (mutate(TEXTS[name], rng) for _ in range(TRIES)):
            problem = refusal(Source(name, data))
            problems += [(problem, data)] if problem else []
    assert_lines(problems, TRIES)


@pytest.mark.parametrize("name", FRAMES)
def test_refusals_of_easymocap_frames_have_lines(tmp_path, name):
    problems = []
    for seed in SEEDS:
        rng = random.Random(seed)
        for data in (mutate(FRAMES[name], rng) for _ in range(TRIES)):
            (tmp_path / name).write_bytes(data)
            problem = refusal(Source.open(tmp_path / name))
            # A frame without the key "annots" would be read as a pose, which is not tested here.
            problems += (
                [(problem, data)]
                if problem and not problem.diagnostic.key.startswith("F002.pose-")
                else []
            )
    assert_lines(problems, TRIES)


def test_refusals_of_pig_tables_have_lines(tmp_path):
    folder = write_pig(tmp_path / "pig")
    problems = []
    for seed in SEEDS:
        rng = random.Random(seed)
        for _ in range(TRIES):
            name = rng.choice(list(PIG))
            (folder / name).write_bytes(mutate(PIG[name].encode(), rng))
            problem = refusal(Source.open(folder))
            # The report may be about a different file, because the contents of the files depend on
            # each other.
            problems += [(problem, problem.path.read_bytes())] if problem else []
            (folder / name).write_text(PIG[name])
    assert_lines(problems, TRIES)


def test_refusals_of_cameras_have_lines(tmp_path):
    notes = []
    for seed in SEEDS:
        rng = random.Random(seed)
        for _ in range(TRIES):
            texts = [mutate(text.encode(), rng) for text in (INTRINSIC, EXTRINSIC)]
            decoded = [text.decode("latin-1") for text in texts]
            notes += cameras(tmp_path, *decoded)[1]
    assert {note.path.name for note in notes} <= {"intri.yml", "extri.yml"}
    without = [str(note) for note in notes if note.line is None]
    assert len(notes) >= TRIES and len(without) <= (1.0 - SHARE) * len(notes), without
