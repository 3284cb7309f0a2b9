"""Reading of 10,000 EasyMocap frames of two people, compared with json.loads of the same bytes."""

import json
import tempfile
import tracemalloc
from pathlib import Path

import numpy as np
from measure import interleaved, report

from viewer.formats import Source, easymocap, read
from viewer.loading import bundled_body
from viewer.loading.capturing import Builder

FRAMES = 10_000
PEOPLE = 2
NUMBERS = {"Rh": 3, "Th": 3, "poses": 72, "shapes": 10}
POINTS = 25


def body_text(rng: np.random.Generator) -> str:
    """Return one frame as written by EasyMocap, with three decimals and CRLF within records."""
    people = []
    for person in range(PEOPLE):
        lines = [f'        "id": {person}']
        for key, count in NUMBERS.items():
            row = ", ".join(f"{value:.3f}" for value in rng.normal(size=count).tolist())
            lines.append(f'        "{key}": [\r\n          [{row}]\r\n        ]')
        people.append("    {\n" + ",\n".join(lines) + "\n    }")
    return "[\n" + ",\n".join(people) + "\n]\n"


def points_text(rng: np.random.Generator) -> str:
    """Return one frame of keypoints with seven decimals."""
    people = []
    for person in range(PEOPLE):
        rows = ",\n".join(
            "          [" + ", ".join(f"{value:.7f}" for value in row) + "]"
            for row in np.abs(rng.normal(size=(POINTS, 4))).tolist()
        )
        people.append(f'    {{\n        "id": {person},\n        "keypoints3d": [\n{rows}\n    ]}}')
    return "[\n" + ",\n".join(people) + "\n]\n"


def write(folder: Path) -> list[bytes]:
    """Write the frames; return the contents of the files."""
    rng = np.random.default_rng(0)
    data = []
    for kind, text in (("smpl", body_text), ("keypoints3d", points_text)):
        (folder / kind).mkdir(parents=True)
        for frame in range(FRAMES):
            data.append(text(rng).encode())
            (folder / kind / f"{frame:06}.json").write_bytes(data[-1])
    return data


def motions(folder: Path) -> list[object]:
    """Read a capture and keep all of its data."""
    return list(easymocap.read(Source.open(folder)).parts())


def actors(folder: Path, model: object) -> Builder:
    """Read a capture into actors, as the window does."""
    builder = Builder(easymocap.read(Source.open(folder)), model, keeps_shape=False)
    while not builder.is_done:
        builder.read_some()
    return builder


def parsed(data: list[bytes]) -> None:
    """Parse and discard the frames, as the reference."""
    for text in data:
        json.loads(text)


def memory(folder: Path) -> float:
    """Return the peak memory of reading, as a multiple of the raw floats."""
    tracemalloc.start()
    kept = motions(folder)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert kept
    points = 4 * POINTS if (folder / "keypoints3d").is_dir() else 0
    return peak / (8 * FRAMES * PEOPLE * (sum(NUMBERS.values()) + points))


def main(rounds: int = 5) -> None:
    """Print the ratios for bodies only, then for bodies and keypoints."""
    model = read(Source.open(bundled_body()))
    with tempfile.TemporaryDirectory() as name:
        out = Path(name) / "out"
        data = write(out)
        for folder, texts in ((out / "smpl", data[:FRAMES]), (out, data)):
            work = {
                "motions": lambda folder=folder: motions(folder),
                "actors": lambda folder=folder: actors(folder, model),
                "json.loads": lambda texts=texts: parsed(texts),
            }
            times = interleaved(work, rounds)
            what = "bodies" if folder.name == "smpl" else "bodies and keypoints"
            title = f"{FRAMES} frames of {PEOPLE} people, {what}"
            report(title, times, ("motions", "json.loads"), 2.5)
            report("  with the clips of a figure", times, ("actors", "json.loads"), 2.5)
            print(f"  peak memory / raw floats: {memory(folder):.2f} (goal: at most 4)\n")


if __name__ == "__main__":
    main()
