"""Record what the program says and writes, so that two versions of it can be compared.

``python tests/record.py FOLDER`` runs ``info``, ``lint``, ``diff`` and ``convert`` to every format
for the bundled figures and for the files in ``../shared/data``, if that folder exists, and writes a
text file per input: the commands, exit codes, output, and the size and checksum of each file
written. ``help.txt`` holds the help of all commands. Two records are compared with ``diff -ru``.
``--benches`` adds ``benches.txt``: start time, peak memory and frame times, which differ between
runs. This is no part of the tests; it takes some minutes.
"""

import argparse
import hashlib
import os
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from viewer.commands import COMMANDS
from viewer.exporters import EXPORTERS
from viewer.formats import FORMATS

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT.parent / "shared" / "data"
SAMPLES = ROOT / "assets" / "samples"
BENCHES = ("bench_start.py", "bench_memory.py", "bench_frames.py")
SECONDS = 120  # for one command

# Runs several commands in one process, as most of the time of a command is its start.
RUNNER = """
import sys
from viewer.cli import run
for line in sys.stdin.read().splitlines():
    arguments = line.split("\\t")
    print("$ viewer", *arguments, flush=True)
    sys.stderr = sys.stdout
    try:
        code = run(arguments)
    except SystemExit as end:  # raised by --help
        code = end.code
    print(f"[exit {code}]", flush=True)
"""


def cases() -> dict[str, list[str]]:
    """Return the files of each input, by name."""
    fox = [str(SAMPLES / name) for name in ("fox.skel", "fox.skin")]
    found = {"bundled fox": fox, "bundled body": [str(SAMPLES / "body.npz")]}
    course = DATA / "cse169"
    if course.is_dir():
        found["wasp"] = [str(course / name) for name in ("wasp.skel", "wasp.skin")]
        found["wasp walking"] = [*found["wasp"], str(course / "wasp_walk.anim")]
        found["tube"] = [str(course / name) for name in ("tube.skel", "tube.skin")]
        found["pig"] = [str(DATA / "pig" / "core_txt_files")]
    suffixes = {suffix for kind in FORMATS.values() for suffix in kind.suffixes if suffix != "/"}
    for path in sorted(DATA.rglob("*")):
        name = path.relative_to(DATA).as_posix()
        if path.suffix.lower() in suffixes and path.is_file() and "core_txt_files" not in name:
            found[name] = [str(path)]
        elif path.is_dir() and name.startswith("reports/32_easymocap/"):
            found[name + "/"] = [str(path)]
    return found


def commands(files: list[str], folder: Path) -> list[list[str]]:
    """Return the commands that are run for an input; ``folder`` receives the files they write."""
    written = [
        ["convert", *files, "-o", str(folder / f"{key}{suffix.rstrip('/')}"), "--as", key]
        for key, kind in EXPORTERS.items()
        for suffix in kind.suffixes[:1]
    ]
    return [
        ["info", *files],
        ["info", "--json", *files],
        ["lint", *files],
        ["diff", "+".join(files), "+".join(files)],
        *written,
    ]


def record(name: str, files: list[str], target: Path) -> None:
    """Write the record of one input."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "out"
        folder.mkdir()
        lines = "\n".join("\t".join(command) for command in commands(files, folder))
        environment = os.environ | {
            "XDG_CACHE_HOME": scratch,
            "XDG_CONFIG_HOME": scratch,
            "COLUMNS": "100",
            "OPENBLAS_NUM_THREADS": "1",
        }
        try:
            run = subprocess.run(
                [sys.executable, "-c", RUNNER],
                input=lines,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                errors="backslashreplace",
                cwd=ROOT,
                env=environment,
                timeout=SECONDS,
            )
            text = run.stdout + (f"[died: {run.returncode}]\n" if run.returncode else "")
        except subprocess.TimeoutExpired as late:
            text = f"{(late.stdout or b'').decode(errors='replace')}[over {SECONDS} s]\n"
        for path in sorted(folder.rglob("*")):
            if path.is_file():
                digest = hashlib.sha256(path.read_bytes()).hexdigest()[:16]
                text += f"{path.relative_to(folder)}: {path.stat().st_size} bytes, {digest}\n"
        # Scratch folders, times and the checkout differ between runs.
        text = (
            text.replace(scratch, "SCRATCH").replace(str(DATA), "DATA").replace(str(ROOT), "ROOT")
        )
        text = re.sub(r"\b\d+(\.\d+)? (ms|s)\b(?= ?(to|of|in)? ?(read|load|parse))", "TIME", text)
    (target / (re.sub(r"[^\w.-]+", "_", name) + ".txt")).write_text(text)


def record_help(target: Path) -> None:
    """Write the help of all commands."""
    lines = "\n".join(["--help", *(f"{name}\t--help" for name in COMMANDS)])
    run = subprocess.run(
        [sys.executable, "-c", RUNNER],
        input=lines,
        capture_output=True,
        text=True,
        cwd=ROOT,
        env=os.environ | {"COLUMNS": "100"},
    )
    (target / "help.txt").write_text(run.stdout + run.stderr)


def main() -> None:
    """Record all inputs, or those whose names contain a word."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", default="", metavar="WORD")
    parser.add_argument("--benches", action="store_true")
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    record_help(options.folder)
    chosen = {name: files for name, files in cases().items() if options.only in name}
    with ThreadPoolExecutor(options.workers) as pool:
        for _ in pool.map(lambda case: record(*case, options.folder), chosen.items()):
            print(".", end="", flush=True)
    print(f" {len(chosen)} inputs")
    if options.benches:
        texts = [
            subprocess.run(
                [sys.executable, str(ROOT / "tests" / "bench" / name)],
                stdout=subprocess.PIPE,
                text=True,
                cwd=ROOT,
            ).stdout
            for name in BENCHES
        ]
        (options.folder / "benches.txt").write_text("\n".join(texts))


if __name__ == "__main__":
    main()
