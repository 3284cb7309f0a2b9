"""Peak memory of rendering the bundled figure, compared with a minimal program."""

import statistics
import tempfile
from pathlib import Path

from measure import run_process


def main(rounds: int = 3) -> None:
    """Print both peaks and their ratio."""
    baseline = str(Path(__file__).parent / "references" / "baseline.py")
    with tempfile.TemporaryDirectory() as folder:
        picture = str(Path(folder) / "picture.png")
        command = ["-m", "viewer", "render", "-o", picture, "--force"]
        pairs = [
            (run_process(command)[1], run_process([baseline, picture])[1]) for _ in range(rounds)
        ]
    ours, least = (statistics.median(column) for column in zip(*pairs, strict=True))
    print("peak memory, bundled figure, 1280 x 720")
    print(f"  viewer render {ours:9.1f} MB\n  baseline      {least:9.1f} MB")
    print(f"  viewer render / baseline: {ours / least:.2f}\n")


if __name__ == "__main__":
    main()
