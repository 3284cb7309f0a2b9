"""Report about this machine: packages, OpenGL, EGL and display, with remedies."""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
import sys
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import viewer
from viewer.commands._printing import print_line
from viewer.data_classes import dataclass
from viewer.errors import RenderError
from viewer.phrases import counted, printable

__all__ = ["Finding", "add_arguments", "examine", "run"]

_PACKAGES = (
    "numpy",
    "moderngl",
    "glcontext",
    "glfw",
    "imgui-bundle",
    "pyrr",
    "pillow",
    "platformdirs",
    "rich",
    "shtab",
)
_EXTRAS = {
    "ufbx": "reading .fbx files",
    "DracoPy": "glTF files compressed with Draco",
    "av": "videos",
    "isal": "faster PNG encoding",
    "scipy": "viewer rig, comparing different meshes",
    "pebble": "worker processes of viewer batch",
    "dask": "viewer batch on clusters",
    "distributed": "viewer batch on clusters",
    "dask-jobqueue": "viewer batch on SLURM clusters",
}
_WINDOW_SECONDS = 20
_STYLES = {"ok": "green", "note": "yellow", "missing": "bold red"}


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the report: subject, state, details and a remedy."""

    subject: str
    state: str  # "ok", "note" or "missing"
    found: str
    cure: str = ""
    is_vital: bool = False


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's option."""
    parser.usage = "%(prog)s [--bench]"
    parser.add_argument(
        "--bench",
        action="store_true",
        help="also measure start-up and drawing times on this machine (takes a minute)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the report; return 4 if drawing is impossible."""
    code = 0
    for finding in examine():
        found = f"{finding.subject:<12}{printable(finding.found, 300)}"
        print_line((f"{finding.state:<8}", _STYLES[finding.state]), found)
        if finding.cure:
            print_line(f"{'':<20}-> {printable(finding.cure, 400)}")
        sys.stdout.flush()  # the next check may take seconds
        if finding.is_vital and finding.state == "missing":
            code = RenderError.exit_code
    if arguments.bench and not code:
        _print_measurements()
    return code


def _print_measurements() -> None:
    """Print the speed of this machine; all times are medians."""
    from viewer.commands._benchmarks import measured

    for found in measured():
        print_line(f"{'bench':<8}", str(found))
        sys.stdout.flush()


def examine() -> Iterator[Finding]:
    """Yield findings as the checks complete, quick ones first."""
    system = f"{platform.system()} {platform.release()} {platform.machine()}"
    yield Finding(
        "viewer", "ok", f"{viewer.__version__}, Python {sys.version.split()[0]}, {system}"
    )
    yield from _examine_packages()
    yield from _examine_devices()
    yield from _examine_drawing()
    yield from _examine_display()
    yield _examine_state_folder()
    yield _examine_cache()


def _examine_packages() -> Iterator[Finding]:
    found, missing = [], []
    for name in _PACKAGES:
        try:
            found.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            missing.append(name)
    yield Finding("packages", "ok", ", ".join(found))
    if missing:
        cure = f"pip install {' '.join(missing)}"
        yield Finding("packages", "missing", ", ".join(missing), cure, is_vital=True)
    yield from _examine_extras()


def _examine_extras() -> Iterator[Finding]:
    """Report optional packages, and the uses of each missing one."""
    found, missing = [], {}
    for name, purpose in _EXTRAS.items():
        try:
            found.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            missing[name] = purpose
    if found:
        yield Finding("extras", "ok", ", ".join(found))
    if missing:
        uses = ", ".join(f"{name} ({purpose})" for name, purpose in missing.items())
        yield Finding(
            "extras", "note", f"not installed: {uses}", f"pip install {' '.join(missing)}"
        )


def _examine_devices() -> Iterator[Finding]:
    """Report every EGL device; `--gpu N` selects one."""
    if not sys.platform.startswith("linux"):
        return
    from viewer.rendering.gpu.context import device_count, headless_context, unreadable_devices

    count = device_count()
    for index in range(count):
        try:
            context = headless_context(index)
            found = f"{context.info['GL_RENDERER']}, OpenGL {context.info['GL_VERSION']}"
            context.release()
            yield Finding(f"EGL {index}", "ok", f"{found} (--gpu {index})")
        except RenderError as problem:
            yield Finding(f"EGL {index}", "note", str(problem))
    for node in unreadable_devices():
        cure = f"sudo usermod -aG render {os.environ.get('USER', '$USER')}, then log in again"
        yield Finding(
            "graphics", "note", f"{node} exists but you have no permission to open it", cure
        )


def _examine_drawing() -> Iterator[Finding]:
    from viewer.rendering.gpu.context import headless_context, is_software

    try:
        context = headless_context()
    except RenderError as problem:
        yield Finding("drawing", "missing", str(problem), is_vital=True)
        return
    info = context.info
    yield Finding("drawing", "ok", f"without a window: {info['GL_RENDERER']}, {info['GL_VENDOR']}")
    yield Finding(
        "limits",
        "ok",
        f"textures {info['GL_MAX_TEXTURE_SIZE']}, images "
        f"{min(info['GL_MAX_VIEWPORT_DIMS'])} pixels per side, "
        f"{context.max_samples} samples per pixel",
    )
    if is_software(context):
        cure = "install the graphics driver, and give containers access to /dev/dri"
        yield Finding("graphics", "note", "rendering uses software", cure)
    context.release()


def _examine_display() -> Iterator[Finding]:
    names = ("DISPLAY", "WAYLAND_DISPLAY", "XDG_SESSION_TYPE")
    values = ", ".join(f"{name}={os.environ[name]}" for name in names if os.environ.get(name))
    from viewer.app.display import NoDisplay, find_display

    try:
        find_display()
    except NoDisplay as problem:
        cure = "to render without a window: viewer render FILES -o out.png; over ssh: ssh -X"
        yield Finding("display", "note", str(problem), cure)
        return
    yield Finding("display", "ok", values or "found")
    yield _examine_window()


def _examine_window() -> Finding:
    """Open a window in a separate process, since a broken driver may crash it."""
    cure = "update the graphics driver, or render in software: LIBGL_ALWAYS_SOFTWARE=1 viewer"
    script = "from viewer.app.window import probe; print(probe())"
    command = [sys.executable, "-c", script]
    try:
        result = subprocess.run(command, capture_output=True, text=True, timeout=_WINDOW_SECONDS)
    except subprocess.TimeoutExpired:
        return Finding("window", "missing", f"none within {_WINDOW_SECONDS} s", cure)
    if result.returncode == 0:
        return Finding("window", "ok", result.stdout.strip())
    lines = (result.stderr or result.stdout).strip().splitlines() or ["it crashed"]
    return Finding("window", "missing", lines[-1].removeprefix("viewer.errors.RenderError: "), cure)


def _examine_state_folder() -> Finding:
    from viewer.app.files.recent import state_folder

    folder = state_folder()
    existing = next((path for path in (folder, *folder.parents) if path.exists()), Path("/"))
    if os.access(existing, os.W_OK):
        return Finding("settings", "ok", str(folder))
    cure = "set XDG_STATE_HOME to a writable folder"
    return Finding("settings", "note", f"{folder} is not writable: settings are not saved", cure)


def _examine_cache() -> Finding:
    """Report the folder and size of the cache of parsed numbers and decoded images."""
    from viewer.media.array_cache import LIMIT, VARIABLE, cache_folder, cache_use

    folder = cache_folder()
    if folder is None:
        return Finding("cache", "ok", f"switched off by {VARIABLE}")
    count, size = cache_use()
    used = f"{counted(count, 'array')}, {size / 1e6:.1f} of at most {LIMIT / 1e6:.0f} MB"
    return Finding("cache", "ok", f"{folder}: {used} ({VARIABLE}=off for none)")
