"""Reading a large .skin, against numpy.fromstring over as many bytes and against Python tokens."""

from __future__ import annotations

import tempfile
import warnings
from pathlib import Path

import numpy as np
from measure import interleaved, median_ratio, report

import viewer

MEGABYTES = 50
N_JOINTS = 60


def skin_text(megabytes: float) -> str:
    """Return a .skin of about this size, as exporters print it, six decimals."""
    rng = np.random.default_rng(0)
    n = round(megabytes * 1e6 / 125)

    def table(name: str, values: np.ndarray) -> str:
        rows = "\n".join(" ".join(f"{v:.6f}" for v in row) for row in values.tolist())
        return f"{name} {len(values)} {{\n{rows}\n}}\n"

    normals = rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    counts = rng.integers(1, 5, n)
    rows = []
    for count in counts.tolist():
        pairs = " ".join(f"{rng.integers(N_JOINTS)} {1.0 / count:.6f}" for _ in range(count))
        rows.append(f"{count} {pairs}")
    weights = "\n".join(rows)
    triangles = rng.integers(0, n, (2 * n, 3))
    faces = "\n".join(f"{a} {b} {c}" for a, b, c in triangles.tolist())
    matrix = "matrix {\n1 0 0\n0 1 0\n0 0 1\n0 0 0\n}\n"
    return (
        table("positions", rng.normal(size=(n, 3)))
        + table("normals", normals)
        + f"skinweights {n} {{\n{weights}\n}}\n"
        + f"triangles {2 * n} {{\n{faces}\n}}\n"
        + f"bindings {N_JOINTS} {{\n{matrix * N_JOINTS}}}\n"
    )


def main(rounds: int = 3) -> None:
    """Print the ratios and megabytes per second."""
    text = skin_text(MEGABYTES)
    size = len(text)
    row = " ".join(f"{v:.6f}" for v in np.random.default_rng(1).normal(size=1000)) + "\n"
    numbers = (row * (size // len(row) + 1))[:size].rpartition(" ")[0]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "large.skin"
        path.write_text(text)
        work = {
            "viewer": lambda: viewer.load(path),
            "numpy.fromstring": lambda: fromstring(numbers),
            "Python tokens": lambda: tokens(path),
        }
        times = interleaved(work, rounds)
    report(f"a .skin of {size / 1e6:.0f} MB", times, ("viewer", "numpy.fromstring"), 1.0)
    for name in work:
        print(f"  {name:<20} {1e-3 * size / np.median(times[name]):7.1f} MB/s")
    faster = median_ratio(times, "Python tokens", "viewer")
    print(f"  Python tokens / viewer: {faster:.1f}\n")


def fromstring(text: str) -> object:
    """Read a text of numbers with numpy alone."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return np.fromstring(text, sep=" ")


def tokens(path: Path) -> object:
    """Split the file into words and convert each to a number, as simple readers do."""
    return [float(word) for word in path.read_text().split() if word[0] in "-0123456789"]


if __name__ == "__main__":
    main()
