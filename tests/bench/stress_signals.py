"""Random interruption of commands, with counts of the outcomes.

    python tests/bench/stress_signals.py [--tries N] [--seed S] [WORK:SIGNAL ...]

Each try runs a command that would replace an old output file, and signals it at a random time
between the start of the viewer and slightly after its usual end. Allowed are exit code 0 with a new
file, and 130 (Ctrl-C) or 143 (SIGTERM) with the old file and one line of text. All other outcomes
are printed with the program's output, and the exit code is then 1. PYTHONPATH selects another copy
of the viewer.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from children import listening  # noqa: E402

OLD = b"the old file"
# The arguments, and the name of the output, "" for none.
WORKS: dict[str, tuple[list[str], str]] = {
    "png": (["render", "--size", "320x240"], "x.png"),
    "mp4": (["render", "--size", "320x240", "--turntable", "2"], "x.mp4"),
    "webm": (["render", "--size", "160x120", "--turntable", "0.5"], "x.webm"),
    "gif": (["render", "--size", "160x120", "--turntable", "0.5"], "x.gif"),
    "convert": (["convert"], "x.glb"),
    "rig": (["rig", "{mesh}", "--from", "fox"], "x.npz"),
    "lint": (["lint", "--body"], ""),
    "info": (["info", "--body"], ""),
}
ENDINGS = {"INT": (130, b"viewer: interrupted\n"), "TERM": (143, b"viewer: terminated\n")}
USUAL = ("png:INT", "mp4:TERM", "webm:INT", "gif:INT", "convert:TERM", "rig:INT", "lint:INT")
PROGRAM = """
import os, sys
from viewer.__main__ import main
os.write(1, b".")
sys.exit(main())
"""


class Trial:
    """A command that is started repeatedly in its own folder."""

    def __init__(self, work: str, kind: str, folder: Path, mesh: Path) -> None:
        arguments, name = WORKS[work]
        self.folder, self.output = folder, folder / name if name else None
        self.number: int = getattr(signal, f"SIG{kind}")
        self.code, self.words = ENDINGS[kind]
        self.arguments = [one.format(mesh=mesh) for one in arguments]
        if self.output is not None:
            self.arguments += ["-o", name, "--force"]

    def start(self) -> subprocess.Popen[bytes]:
        """Start the command; return the time at which it begins to run the viewer."""
        for path in self.folder.iterdir():
            path.unlink()
        if self.output is not None:
            self.output.write_bytes(OLD)
        environment = {"PYTHONPATH": str(ROOT), **os.environ, "PYTHONFAULTHANDLER": "1"}
        process = subprocess.Popen(
            listening("-c", PROGRAM, *self.arguments),
            cwd=self.folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        assert process.stdout is not None
        process.stdout.read(1)
        return process

    def once(self, delay: float) -> tuple[str, float]:
        """Interrupt the command after some seconds; return its outcome and remaining run time."""
        process = self.start()
        try:
            process.wait(delay)
        except subprocess.TimeoutExpired:
            process.send_signal(self.number)
        sent = time.monotonic()
        said = process.communicate(timeout=120)[1]
        return self.ending(process.returncode, said), time.monotonic() - sent

    def ending(self, code: int, said: bytes) -> str:
        """Return the exit code and all deviations from the expected outcome."""
        faults = [] if code in (0, self.code) else ["exit code"]
        notes = b"".join(
            line for line in said.splitlines(True) if line.startswith((b"warning: ", b"note: "))
        )
        if said.replace(notes, b"") != (b"" if code == 0 else self.words):
            faults.append("words")
        faults += [f"left {path.name}" for path in self.folder.iterdir() if path != self.output]
        if self.output is not None and (self.output.read_bytes() == OLD) != (code != 0):
            faults.append("the old file" if code == 0 else "the new file")
        if faults:
            print(f"--- exit code {code}: {', '.join(faults)}\n{said.decode(errors='replace')}")
        return f"{code} FAULT" if faults else str(code)


def tried(work: str, kind: str, tries: int, mesh: Path) -> bool:
    """Interrupt one command many times; return whether all outcomes were allowed."""
    with tempfile.TemporaryDirectory() as name:
        trial = Trial(work, kind, Path(name), mesh)
        started = time.monotonic()
        process = trial.start()
        process.communicate()
        assert process.returncode == 0, f"{work} fails without a signal"
        usual = time.monotonic() - started
        endings = [trial.once(random.uniform(0.0, 1.1 * usual)) for _ in range(tries)]
    counts = Counter(ending for ending, _ in endings)
    waits = sorted(seconds for ending, seconds in endings if ending != "0")
    listed = ", ".join(f"{count} x {ending}" for ending, count in sorted(counts.items()))
    last = f"; to the end {waits[len(waits) // 2]:.2f} s, {waits[-1]:.2f} s" if waits else ""
    print(
        f"{work} SIG{kind}: {tries} tries of up to {1.1 * usual:.1f} s: {listed}{last}", flush=True
    )
    return not any("FAULT" in ending for ending in counts)


def main() -> int:
    """Run the named trials, or the default ones."""
    parser = argparse.ArgumentParser(description="Interrupt commands at random moments.")
    parser.add_argument("trials", nargs="*", metavar="WORK:SIGNAL", default=USUAL)
    parser.add_argument("--tries", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    random.seed(asked.seed)
    with tempfile.TemporaryDirectory() as folder:
        mesh = Path(folder, "mesh.obj")
        subprocess.run([sys.executable, "-m", "viewer", "convert", "-o", mesh], check=True)
        good = [tried(*one.split(":"), asked.tries, mesh) for one in asked.trials]
    return int(not all(good))


if __name__ == "__main__":
    sys.exit(main())
