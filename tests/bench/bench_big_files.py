"""Reading and writing of large files, compared with numpy's fastest text routines.

These are numpy.fromstring and numpy.savetxt, on the same number of bytes for meshes and on the same
numbers for motions. Seconds are processor time, which does not depend on other processes. Memory
peaks are those of child processes above their memory after importing the package.

Text of motions is converted part by part, so its memory peak does not depend on the number of
frames. To show this, a quarter of the frames is measured too.

``--full`` uses files of a size that users notice: 430 MB of .skin, 100,000 frames.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np
from measure import ROOT, median_ratio

from viewer import cli
from viewer.formats import Source, read
from viewer.formats import skin as skin_format
from viewer.formats._text.numbers import parse_numbers
from viewer.media.array_cache import without_cache

FULL = "--full" in sys.argv
SCALE = 1.0 if FULL else 0.1
N_JOINTS = 62
LOAD = "kept = read(Source.open(sys.argv[1]))"
CONVERT = "cli.run(['convert', sys.argv[1], '-o', sys.argv[2]])"
# The peak returned by getrusage includes that of the parent process at the fork.
CHILD = """
import sys
import viewer.exporters.bvh, viewer.formats.bvh, viewer.loading
from viewer import cli
from viewer.formats import Source, read
from viewer.media.array_cache import without_cache
def peak():
    with open("/proc/self/status") as lines:
        return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))
before = peak()
with without_cache():
    {}
print(peak() - before)
"""

Work = dict[str, Callable[[], object]]


def grid(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return positions, unit normals and triangles of a mesh with about this many vertices."""
    side = int(np.sqrt(count))
    x, y = np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side), indexing="ij")
    normals = np.stack([np.cos(5 * x), np.sin(7 * y), np.ones_like(x)], axis=2).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    index = np.arange(side * side).reshape(side, side)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    triangles = np.concatenate([np.stack(t, axis=2).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    return np.stack([x, y, np.sin(x * y)], axis=2).reshape(-1, 3), normals, triangles


def write_skin(path: Path) -> None:
    """Write a .skin with six decimals, as exporters do, and with two influences per vertex."""
    positions, normals, triangles = grid(round(2_900_000 * SCALE))
    count = len(positions)
    rng = np.random.default_rng(0)
    weights = np.column_stack(
        [np.full(count, 2), rng.integers(0, 60, (count, 2)), rng.random(count)]
    )
    weights = np.column_stack([weights[:, [0, 1, 3, 2]], 1 - weights[:, 3]])
    with path.open("w") as stream:
        for name, rows, form in (
            ("positions", positions, "%.6f"),
            ("normals", normals, "%.6f"),
            ("skinweights", weights, ["%d", "%d", "%.6f", "%d", "%.6f"]),
            ("triangles", triangles, "%d"),
        ):
            stream.write(f"{name} {len(rows)} {{\n")
            np.savetxt(stream, rows, fmt=form)
            stream.write("}\n")
        matrix = "matrix {\n1 0 0\n0 1 0\n0 0 1\n0 0 0\n}\n"
        stream.write(f"bindings 60 {{\n{60 * matrix}}}\n")


def write_obj(path: Path) -> None:
    """Write an .obj with positions, normals and triangles."""
    positions, normals, triangles = grid(round(2_000_000 * SCALE))
    with path.open("w") as stream:
        np.savetxt(stream, positions, fmt="v %.6f %.6f %.6f")
        np.savetxt(stream, normals, fmt="vn %.6f %.6f %.6f")
        corners = np.repeat(triangles + 1, 2, axis=1)
        np.savetxt(stream, corners, fmt="f %d//%d %d//%d %d//%d")


def write_ply(path: Path, binary: bool) -> None:
    """Write a .ply with positions, normals and triangles."""
    positions, normals, triangles = grid(round((6_500_000 if binary else 2_900_000) * SCALE))
    names = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    kind = "binary_little_endian" if binary else "ascii"
    head = f"ply\nformat {kind} 1.0\nelement vertex {len(positions)}\n{names}"
    head += f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = np.hstack([positions, normals])
    with path.open("wb") as stream:
        stream.write(head.encode())
        if binary:
            faces = np.zeros(len(triangles), dtype=[("n", "u1"), ("corners", "<i4", 3)])
            faces["n"], faces["corners"] = 3, triangles
            stream.write(rows.astype("<f4").tobytes() + faces.tobytes())
        else:
            np.savetxt(stream, rows, fmt="%.6f")
            np.savetxt(stream, triangles, fmt="3 %d %d %d")


def motion_numbers(count: int) -> np.ndarray:
    """Return smooth channels, (count, 3 + 3 J)."""
    rng = np.random.default_rng(0)
    width = 3 + 3 * N_JOINTS
    times = np.arange(count)[:, None] / 120.0
    phases = times * rng.uniform(0.2, 2, width) + rng.uniform(0, 6, width)
    return rng.uniform(5, 60, width) * np.sin(phases)


def write_bvh(path: Path, share: int = 1) -> None:
    """Write a chain of joints at 120 frames per second, with a part of the frames."""
    count = round(100_000 * SCALE / share)
    lines = ["HIERARCHY"]
    for joint in range(N_JOINTS):
        channels = "6 Xposition Yposition Zposition" if joint == 0 else "3"
        lines += [f"{'JOINT' if joint else 'ROOT'} j{joint}", "{", "OFFSET 0 2 0"]
        lines += [f"CHANNELS {channels} Zrotation Xrotation Yrotation"]
    lines += ["End Site", "{", "OFFSET 0 1 0", "}", *["}"] * N_JOINTS]
    with path.open("w") as stream:
        stream.write("\n".join([*lines, "MOTION", f"Frames: {count}", "Frame Time: 0.008333333\n"]))
        np.savetxt(stream, motion_numbers(count), fmt="%.6f")


def write_capture(folder: Path) -> None:
    """Write a folder of EasyMocap frames of one person."""
    count = round(20_000 * SCALE)
    (folder / "smpl").mkdir(parents=True)
    numbers = np.round(motion_numbers(count)[:, :88] / 200, 3)
    for frame, row in enumerate(numbers.tolist()):
        parts = {"Rh": [row[:3]], "Th": [row[3:6]], "poses": [[0, 0, 0, *row[6:75]]]}
        record = {"id": 0, **parts, "shapes": [row[75:85]]}
        (folder / "smpl" / f"{frame:06}.json").write_text(json.dumps([record], indent=1))


def numbers_of(text: str) -> np.ndarray:
    """Parse a text of numbers by the fastest routine of numpy."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return np.fromstring(text, sep=" ")


def cpu_rounds(work: Work, rounds: int) -> dict[str, list[float]]:
    """Run each function once per round in turn; return seconds of processor time by name."""
    times: dict[str, list[float]] = {name: [] for name in work}
    for _ in range(rounds):
        for name, run in work.items():
            started = time.process_time()
            run()
            times[name].append(time.process_time() - started)
    return times


def show(title: str, size: float, work: Work, goal: float, rounds: int) -> None:
    """Print processor times of ``viewer`` and ``numpy``, and their ratio."""
    times = cpu_rounds(work, rounds)
    ratio = median_ratio(times, "viewer", "numpy")
    seconds = float(np.median(times["viewer"]))
    met = "met" if ratio <= goal else "MISSED"
    print(f"{title}: {seconds:.2f} s, {size / 1e6 / seconds:.0f} MB/s")
    print(f"  viewer / numpy: {ratio:.2f} (goal: at most {goal:g}, {met})")


def show_peak(work: str, arguments: list[Path], arrays: float) -> None:
    """Print the memory peak of a child process, relative to the arrays of the result."""
    if not sys.platform.startswith("linux"):
        return
    command = [sys.executable, "-c", CHILD.format(work), *map(str, arguments)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    result = subprocess.run(command, env=environment, capture_output=True, check=True, text=True)
    peak = int(result.stdout.split()[-1]) / 1e3
    print(f"  peak {peak:.0f} MB, {peak / arrays:.1f} times the arrays of {arrays:.0f} MB\n")


def array_megabytes(content: object) -> float:
    """Return the memory of all distinct arrays in a figure or motion."""
    found: dict[int, int] = {}

    def look(part: object) -> None:
        if isinstance(part, np.ndarray):
            base = part
            while isinstance(base.base, np.ndarray):
                base = base.base
            found[id(base)] = max(found.get(id(base), 0), part.nbytes)
        elif isinstance(part, list | tuple):
            for each in part:
                look(each)
        elif is_dataclass(part):
            for each in fields(part):
                look(getattr(part, each.name, None))

    look(content)
    return sum(found.values()) / 1e6


def show_numbers(rounds: int) -> None:
    """Compare the parser with numpy for several spellings of numbers."""
    rng = np.random.default_rng(0)
    values = (rng.normal(size=300_000) * 10.0 ** rng.integers(-2, 3, 300_000)).tolist()
    for form in ("%.6f", "%.9g", "%.9e", "%.17g", "%r"):
        text = " ".join(form % value for value in values)
        data = text.encode()
        work: Work = {"numpy": lambda text=text: numbers_of(text)}
        work["viewer"] = lambda data=data: parse_numbers(data, 0, len(data))
        show(f"numbers as {form}", len(data), work, 1 / 2.5, rounds)


def show_meshes(folder: Path, rounds: int) -> None:
    """Compare the readers of meshes, and the writer of .skin."""
    for name, write in (
        ("a.skin", write_skin),
        ("a.obj", write_obj),
        ("text.ply", lambda path: write_ply(path, False)),
        ("binary.ply", lambda path: write_ply(path, True)),
    ):
        path = folder / name
        write(path)
        size = path.stat().st_size
        figure = read(Source.open(path))
        rows = np.random.default_rng(1).normal(size=1000)
        row = " ".join(f"{value:.6f}" for value in rows) + "\n"
        text = row * round(size / len(row))
        work = {"numpy": lambda text=text: numbers_of(text)}
        work["viewer"] = lambda path=path: read(Source.open(path))
        show(f"{name}, {size / 1e6:.0f} MB, read", size, work, 1.5, rounds)
        show_peak(LOAD, [path], array_megabytes(figure))
        if name == "a.skin":
            numbers = np.concatenate([figure.mesh.positions, figure.mesh.normals])
            work = {"numpy": lambda rows=numbers: np.savetxt(os.devnull, rows, fmt="%.17g")}
            work["viewer"] = lambda figure=figure: skin_format.write(figure, folder / "again.skin")
            show("a.skin, written (numpy: only its vertices)", size, work, 1.5, rounds)


def show_motions(folder: Path, rounds: int) -> None:
    """Compare conversions of motions to the format of the input."""
    write_bvh(folder / "a.bvh")
    write_capture(folder / "a")
    text = (folder / "a.bvh").read_text()
    text = text[text.index("Frame Time:") :].partition("\n")[2]
    out = folder / "out.bvh"

    def copy_numbers() -> None:
        np.savetxt(os.devnull, numbers_of(text).reshape(-1, 3 + 3 * N_JOINTS), fmt="%.6f")

    def copy_frames() -> None:
        for path in sorted((folder / "a" / "smpl").iterdir()):
            data = path.read_text().translate(
                str.maketrans(dict.fromkeys('"RhTposeidshap:{}[],', " "))
            )
            with (folder / "frame.txt").open("w") as stream:
                np.savetxt(stream, numbers_of(data)[None], fmt="%.7f")

    def convert(source: Path, target: Path) -> None:
        sys.stdout.flush()
        assert cli.run(["convert", str(source), "-o", str(target), "--force"]) == 0

    work = {"numpy": copy_numbers, "viewer": lambda: convert(folder / "a.bvh", out)}
    show(f"{round(100_000 * SCALE):,} frames, BVH to BVH", 2 * len(text), work, 1.5, rounds)
    arrays = array_megabytes(read(Source.open(folder / "a.bvh")))
    for name, share in (("short.bvh", 4), ("a.bvh", 1)):
        if share > 1:
            write_bvh(folder / name, share)
        out.unlink()
        print(f"  a conversion of 1/{share} of the frames:", end="")
        show_peak(CONVERT, [folder / name, out], arrays / share)
    size = sum(path.stat().st_size for path in (folder / "a" / "smpl").iterdir())
    work = {"numpy": copy_frames, "viewer": lambda: convert(folder / "a", folder / "b")}
    show(f"{round(20_000 * SCALE):,} frames, EasyMocap to EasyMocap", 2 * size, work, 1.5, rounds)
    show_peak(CONVERT, [folder / "a", folder / "c"], 8e-6 * 88 * round(20_000 * SCALE))


def main(rounds: int = 1 if FULL else 5) -> None:
    """Print processor times, ratios and peaks of memory."""
    # The second round would measure the cache instead of the parser.
    with without_cache(), tempfile.TemporaryDirectory() as name:
        show_numbers(max(rounds, 5))
        show_meshes(Path(name), rounds)
        show_motions(Path(name), rounds)


if __name__ == "__main__":
    main()
