"""Conversion of long BVH files part by part, compared with conversion of the whole file."""

import tracemalloc

import numpy as np
import pytest

from viewer.cli import run
from viewer.commands import convert as convert_command
from viewer.commands._progress import Progress
from viewer.formats import Source, bvh
from viewer.formats.bvh.motion import Irregular

FRAMES = 60
PART = 1500  # bytes: about ten frames
ORDERS = ("Zrotation Xrotation Yrotation", "Xrotation Yrotation Zrotation", "Yrotation Zrotation")
PLACES = "Xposition Yposition Zposition"


@pytest.fixture
def converted(tmp_path, monkeypatch, capsys):
    """Return a function that converts a text, and returns text, output, errors and exit code."""
    monkeypatch.setattr(bvh, "PART", PART)

    def convert(data, options=(), streams=True):
        source, target = tmp_path / "a.bvh", tmp_path / "b.bvh"
        source.write_bytes(data if isinstance(data, bytes) else data.encode())
        monkeypatch.setattr(convert_command, "_LARGE", 0 if streams else 1 << 40)
        code = run(["convert", str(source), "-o", str(target), "--force", *options])
        written = target.read_bytes() if target.exists() else None
        target.unlink(missing_ok=True)
        assert [path.name for path in tmp_path.iterdir()] == ["a.bvh"]
        return written, *capsys.readouterr(), code

    return convert


@pytest.fixture
def streamed(converted, monkeypatch):
    """Return a function that also requires that the file was read part by part."""
    taken = []
    known = convert_command.convert_streamed

    def convert(*arguments):
        found = known(*arguments)
        taken.append(found is not None)
        return found

    monkeypatch.setattr("viewer.commands.convert.convert_streamed", convert)

    def both(data, options=(), expected=True):
        taken.clear()
        parts, whole = (converted(data, options, streams) for streams in (True, False))
        assert taken == [expected, False]
        assert parts == whole
        return parts

    return both


def motion(
    moves_inner: bool = False, roots: int = 1, size: float = 1.0, frames: int = FRAMES
) -> str:
    """Return a random walk of a chain per root, through gimbal lock and several revolutions."""
    lines = ["HIERARCHY"]
    for root in range(roots):
        for joint in range(5):
            turns = ORDERS[joint % 3]
            channels = f"{PLACES} {turns}" if joint == 0 or (moves_inner and joint == 2) else turns
            kind = "JOINT" if joint else "ROOT"
            lines += [f"{kind} part {root}-{joint}", "{", f"OFFSET {0.1 * size} {0.5 * size} 0"]
            lines += [f"CHANNELS {len(channels.split())} {channels}"]
        lines += ["End Site", "{", f"OFFSET 0 {0.3 * size} 0.01", "}", *["}"] * 5]
    width = sum(line.count("rotation") + line.count("position") for line in lines)
    steps = np.random.default_rng(3).normal(size=(frames, width)).cumsum(axis=0)
    steps[:, 4::7] = 90.0  # gimbal lock of some joints, in some orders
    steps[frames // 2 :, 4::7] *= 3.0
    steps[:, :3] *= 0.01 * size
    rows = [" ".join(f"{value:.5f}" for value in row) for row in steps]
    head = [*lines, "MOTION", f"Frames: {frames}", "Frame Time: 0.0166667"]
    return "\n".join([*head, *rows]) + "\n"


OPTIONS = (
    "",
    "--to-unit m --to-up z",
    "--rotation-order xyz --digits 9",
    "--rest-frame --digits 2",
    "--up z --unit in",
    "--up -y --fps 25",
    "--safe-names",
    "--frames 25:47",
    "--frames 40: --as bvh --gaps hold",
)


@pytest.mark.parametrize("options", OPTIONS)
def test_options_produce_the_same_file_and_notes(streamed, options):
    written, _, _, code = streamed(motion(), options.split())
    assert code == 0
    frames = {"--frames 25:47": 22, "--rest-frame --digits 2": FRAMES + 1}.get(options)
    frames = 20 if options.startswith("--frames 40") else frames or FRAMES
    assert f"Frames: {frames}\n".encode() in written


def test_names_are_those_that_were_read(streamed):
    names = ("mixamorig:Hips", "spine.001", "センター", "left  leg", "part 0-4")
    text = motion()
    for joint, name in enumerate(names):
        text = text.replace(f"part 0-{joint}", name)
    written, _, _, code = streamed(text)
    lines = [
        line.strip() for line in written.decode().split("\n") if "ROOT" in line or "JOINT" in line
    ]
    assert (code, lines) == (0, [f"ROOT {names[0]}", *(f"JOINT {name}" for name in names[1:])])


@pytest.mark.parametrize("options", ("", "--rest-frame", "--frames 1:59", "--unit cm"))
@pytest.mark.parametrize(
    "kind", ({"moves_inner": True}, {"roots": 3}, {"size": 100.0}, {"frames": 3})
)
def test_skeletons_produce_the_same_file_and_notes(streamed, kind, options):
    if kind.get("frames") != 3 or "59" not in options:
        assert streamed(motion(**kind), options.split())[-1] == 0


@pytest.mark.parametrize(
    "change",
    (
        lambda text: text.replace("\n", "\r\n"),
        lambda text: "\ufeff" + text,
        lambda text: text + "\n\n  \n",
        lambda text: text.rstrip(),
        lambda text: text.replace("Time: 0.0166667\n", "Time: 0.0166667 \n\n\t"),
        lambda text: text.replace("Frames: 60\nFrame Time: 0.0166667", "Frame Time:1\nframes 60"),
        lambda text: text.replace("OFFSET 0.1 0.5 0\n", "", 1),
        lambda text: text.replace("}\nMOTION", "}\n}\nMOTION"),
        lambda text: text.replace("0.0166667", "0"),
        lambda text: text.replace(" 90.00000 ", "\n90\n"),
        lambda text: text.replace("\n", "\r"),
    ),
)
def test_unusual_spellings_are_read_part_by_part(streamed, change):
    assert streamed(change(motion()))[-1] == 0


def test_roots_that_begin_to_move_late_get_position_channels(streamed):
    """Several roots become children of a common root, so their channels depend on all frames."""
    head, rows = motion(roots=3).split("Frame Time: 0.0166667\n")
    numbers = [row.split() for row in rows.splitlines()]
    width = len(numbers[0]) // 3
    for row in numbers[:40]:
        for root in (1, 2):
            row[root * width : root * width + 3] = ["1", "2", "3"]
    lines = "\n".join(" ".join(row) for row in numbers)
    written, _, _, code = streamed(f"{head}Frame Time: 0.0166667\n{lines}\n")
    assert code == 0
    assert written.count(b"CHANNELS 6") == 4


def test_person_field_in_the_output_name_is_replaced(tmp_path, monkeypatch):
    monkeypatch.setattr(convert_command, "_LARGE", 0)
    source = tmp_path / "a.bvh"
    source.write_text(motion(frames=5))
    assert run(["convert", str(source), "-o", str(tmp_path / "walk_{person}.bvh")]) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.bvh", "walk_1.bvh"]


def broken(line: int, new: str):
    """Return a function that replaces one line, counted from the end."""

    def change(text):
        lines = text.splitlines()
        lines[-line] = new.replace("$", lines[-line])
        return "\n".join(lines) + "\n"

    return change


@pytest.mark.parametrize(
    ("change", "code"),
    (
        (broken(20, "$ 1.0"), 2),
        (broken(2, "$ up"), 2),
        (broken(2, ""), 0),
        (broken(30, "nan" + " 0" * 16), 0),
        (broken(30, "1e30" + " 0" * 16), 2),
        (broken(1, "1 2 3"), 0),
        (lambda text: text.replace("Frames: 60", "Frames: 59"), 0),
        (lambda text: text.replace("Frames: 60\n", ""), 0),
        (lambda text: text.replace("Frame Time: 0.0166667\n", ""), 0),
        (lambda text: text.replace("MOTION", "MOTIONS"), 2),
        (lambda text: text[:300], 2),
    ),
)
def test_irregular_files_are_read_as_a_whole(streamed, change, code):
    # Frames after the requested ones are also checked.
    for options in ((), ("--frames", "10:20")):
        assert streamed(change(motion()), options, False)[-1] == code


@pytest.mark.parametrize(
    "options", ("--trim 10:20", "--resample 30", "--smooth", "--frame 3", "--time 0", "--mirror")
)
def test_options_that_need_the_whole_motion_read_it_as_a_whole(streamed, options):
    streamed(motion(frames=40), options.split(), False)


def test_position_channels_that_are_all_zero_are_added_to_the_offset(streamed):
    text = motion(moves_inner=True)
    head, rows = text.split("Frame Time: 0.0166667\n")
    numbers = [row.split() for row in rows.splitlines()]
    for row in numbers:
        row[9:12] = ["0", "0", "0"]
    lines = "\n".join(" ".join(row) for row in numbers)
    _, _, errors, code = streamed(f"{head}Frame Time: 0.0166667\n{lines}\n")
    assert code == 0
    assert "position" in errors


def test_files_that_change_between_the_passes_are_read_as_a_whole(tmp_path):
    path = tmp_path / "a.bvh"
    path.write_text(motion())
    stream = bvh.open_long(Source(path))
    path.write_text(motion(frames=FRAMES - 1))
    with pytest.raises(Irregular):
        list(stream.clips(0, FRAMES))


def test_standard_output_receives_the_same_file(tmp_path, monkeypatch, capfdbinary):
    path = tmp_path / "a.bvh"
    path.write_text(motion(frames=5))
    outputs = []
    for large in (0, 1 << 40):
        monkeypatch.setattr(convert_command, "_LARGE", large)
        link = tmp_path / f"{large}.bvh"
        link.symlink_to("/dev/stdout")
        assert run(["convert", str(path), "-o", str(link)]) == 0
        outputs.append(capfdbinary.readouterr().out)
    assert outputs[0] == outputs[1]
    assert outputs[0].startswith(b"HIERARCHY")


def test_memory_does_not_depend_on_the_number_of_frames(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(convert_command, "_LARGE", 0)
    monkeypatch.setattr(bvh, "PART", 20_000)
    monkeypatch.setattr(bvh, "_HEAD", 20_000)
    peaks = []
    for frames in (100, 500, 2000):
        path = tmp_path / f"{frames}.bvh"
        path.write_text(motion(frames=frames))
        tracemalloc.start()
        assert run(["convert", str(path), "-o", str(tmp_path / "b.bvh"), "--force"]) == 0
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    # A frame has 17 numbers and 5 joints: its rotations need 160 bytes. Only the numbers of lines
    # and rows are kept, at most 16 bytes per frame.
    assert (peaks[2] - peaks[1]) / 1500 < 40


def test_progress_is_reported_in_frames_only(tmp_path, monkeypatch):
    """Reports in two units would make the progress bar in the terminal flicker."""
    monkeypatch.setattr(convert_command, "_LARGE", 0)
    monkeypatch.setattr(bvh, "PART", 2000)
    (tmp_path / "a.bvh").write_text(motion(frames=100))
    found = []
    monkeypatch.setattr(Progress, "receive", lambda self, *step: found.append(step))
    assert run(["convert", str(tmp_path / "a.bvh"), "-o", str(tmp_path / "b.bvh")]) == 0
    assert len(found) > 5 and {(total, unit) for _, total, unit, _ in found} == {(100, "frames")}
