"""Report about this machine: packages, OpenGL, EGL and display, with remedies.

``--bench`` also measures whole programs from start to end, frames, and the parts of a frame other
than drawing. Times that are compared with each other are measured alternately.
"""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import viewer
from viewer.commands import COMMANDS
from viewer.commands._printing import print_line
from viewer.data_classes import dataclass
from viewer.errors import PluginError, RenderError
from viewer.phrases import counted, printable
from viewer.plugins import GROUPS, Group, Plugin, installed_plugins, plugin_of

if TYPE_CHECKING:
    from viewer.rendering.offscreen import Offscreen
    from viewer.rendering.options import DisplayOptions
    from viewer.rigs.scene import Scene

_PACKAGES = (
    "numpy",
    "moderngl",
    "glcontext",
    "glfw",
    "imgui-bundle",
    "pyrr",
    "pillow",
    "platformdirs",
    "orjson",
    "rich",
    "scipy",
    "shtab",
)
_EXTRAS = {
    "ufbx": "reading .fbx files",
    "DracoPy": "glTF files compressed with Draco",
    "av": "videos",
    "anywidget": "viewer.widget in notebooks",
    "isal": "faster PNG encoding",
    "pebble": "worker processes of viewer batch",
    "dask": "viewer batch on clusters",
    "distributed": "viewer batch on clusters",
    "dask-jobqueue": "viewer batch on SLURM clusters",
}
_WINDOW_SECONDS = 20  # time limit for opening a window
_STYLES = {"ok": "green", "note": "yellow", "missing": "bold red"}
# Measurements.
_SIZE = 1280, 720  # pixels
_STARTS, _FRAMES = 5, 9  # numbers of repetitions; the median is used
_INSTANCES, _ROUNDS_OF_MANY = 100, 3  # bodies in a crowd, and repetitions of its frame

# A minimal program that draws: it imports numpy and creates an OpenGL context.
_LEAST = "from viewer.rendering.gpu.context import headless_context; headless_context()"


@dataclass(frozen=True, slots=True)
class _Finding:
    """One line of the report: subject, state, details and a remedy."""

    subject: str
    state: Literal["ok", "note", "missing"]
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
        for measurement in measured():
            print_line(f"{'bench':<8}", str(measurement))
            sys.stdout.flush()
    return code


def examine() -> Iterator[_Finding]:
    """Yield findings as the checks complete, quick ones first."""
    system = f"{platform.system()} {platform.release()} {platform.machine()}"
    yield _Finding(
        "viewer", "ok", f"{viewer.__version__}, Python {sys.version.split()[0]}, {system}"
    )
    yield from _examine_packages()
    yield from _examine_plugins()
    yield from _examine_devices()
    yield from _examine_drawing()
    yield from _examine_display()
    yield _examine_state_folder()
    yield _examine_cache()


def _examine_packages() -> Iterator[_Finding]:
    found, missing = [], []
    for name in _PACKAGES:
        try:
            found.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            missing.append(name)
    yield _Finding("packages", "ok", ", ".join(found))
    if missing:
        cure = f"pip install {' '.join(missing)}"
        yield _Finding("packages", "missing", ", ".join(missing), cure, is_vital=True)
    yield from _examine_extras()


def _examine_plugins() -> Iterator[_Finding]:
    """List plug-ins by package; each is imported, to see that it can be used."""
    found: dict[str, list[str]] = {}
    for plugin in (each for group in GROUPS for each in installed_plugins(group)):
        unused = f"{plugin.distribution}: {plugin.group} {plugin.name} is not used"
        used = plugin_of(plugin.group, plugin.name)
        if used is not None and used is not plugin:
            yield _Finding("plug-in", "note", f"{unused}: that of {used.distribution} is")
            continue
        try:
            plugin.load()
        except PluginError as problem:
            yield _Finding("plug-in", "missing", str(problem))
            continue
        if plugin.name in _own_keys(plugin.group):
            yield _Finding("plug-in", "note", f"{unused}: this program has its own")
            continue
        try:
            _use(plugin)
        except PluginError as problem:
            yield _Finding("plug-in", "missing", str(problem))
            continue
        found.setdefault(plugin.distribution, []).append(f"{plugin.group} {plugin.name}")
    for package, rows in found.items():
        yield _Finding("plug-in", "ok", f"{package}: {', '.join(rows)}")


def _use(plugin: Plugin) -> None:
    """Let the registry check what a plug-in adds to it."""
    from viewer.exporters import exporters_at
    from viewer.linting import plugged_check
    from viewer.rigs.scalars import find_quantity
    from viewer.rigs.skinning import Skinning

    match plugin.group:
        case "exporters":
            exporters_at(f"file.{plugin.name}")
        case "scalars":
            find_quantity(plugin.name)
        case "checks":
            plugged_check(plugin)
        case "skinning":
            Skinning(plugin.name)


def _own_keys(group: Group) -> Collection[str]:
    """Return the keys of this program in a registry, which no plug-in replaces."""
    from viewer.exporters import EXPORTERS
    from viewer.formats import SUFFIXES
    from viewer.formats.video_mocap.tools import TOOLS
    from viewer.linting import CHECKS
    from viewer.rigs.scalars import SCALARS
    from viewer.rigs.skinning import METHODS

    if group == "panels":
        from viewer.app.layout import PANELS

        return PANELS
    written = [EXPORTERS[key].suffixes for key in EXPORTERS if key[0] != "."]
    keys: dict[str, Collection[str]] = {
        "formats": {suffix[1:] for suffix in SUFFIXES},
        "exporters": {suffix[1:] for suffixes in written for suffix in suffixes},
        "scalars": SCALARS,
        "checks": CHECKS,
        "skinning": [key for key, method in METHODS.items() if method.plugin is None],
        "commands": COMMANDS,
        "tools": TOOLS,
    }
    return keys[group]


def _examine_extras() -> Iterator[_Finding]:
    """Report optional packages, and the uses of each missing one."""
    found, missing = [], {}
    for name, purpose in _EXTRAS.items():
        try:
            found.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            missing[name] = purpose
    if found:
        yield _Finding("extras", "ok", ", ".join(found))
    if missing:
        uses = ", ".join(f"{name} ({purpose})" for name, purpose in missing.items())
        yield _Finding(
            "extras", "note", f"not installed: {uses}", f"pip install {' '.join(missing)}"
        )


def _examine_devices() -> Iterator[_Finding]:
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
            yield _Finding(f"EGL {index}", "ok", f"{found} (--gpu {index})")
        except RenderError as problem:
            yield _Finding(f"EGL {index}", "note", str(problem))
    for node in unreadable_devices():
        cure = f"sudo usermod -aG render {os.environ.get('USER', '$USER')}, then log in again"
        yield _Finding(
            "graphics", "note", f"{node} exists but you have no permission to open it", cure
        )


def _examine_drawing() -> Iterator[_Finding]:
    from viewer.rendering.gpu.context import headless_context, is_software

    try:
        context = headless_context()
    except RenderError as problem:
        yield _Finding("drawing", "missing", str(problem), is_vital=True)
        return
    info = context.info
    yield _Finding("drawing", "ok", f"without a window: {info['GL_RENDERER']}, {info['GL_VENDOR']}")
    yield _Finding(
        "limits",
        "ok",
        f"textures {info['GL_MAX_TEXTURE_SIZE']}, images "
        f"{min(info['GL_MAX_VIEWPORT_DIMS'])} pixels per side, "
        f"{context.max_samples} samples per pixel",
    )
    if is_software(context):
        cure = "install the graphics driver, and give containers access to /dev/dri"
        yield _Finding("graphics", "note", "rendering uses software", cure)
    context.release()


def _examine_display() -> Iterator[_Finding]:
    names = ("DISPLAY", "WAYLAND_DISPLAY", "XDG_SESSION_TYPE")
    values = ", ".join(f"{name}={os.environ[name]}" for name in names if os.environ.get(name))
    from viewer.app.display import NoDisplay, find_display

    try:
        find_display()
    except NoDisplay as problem:
        cure = "to render without a window: viewer render FILES -o out.png; over ssh: ssh -X"
        yield _Finding("display", "note", str(problem), cure)
        return
    yield _Finding("display", "ok", values or "found")
    yield _examine_window()


def _examine_window() -> _Finding:
    """Open a window in a separate process, since a broken driver may crash it."""
    cure = "update the graphics driver, or render in software: LIBGL_ALWAYS_SOFTWARE=1 viewer"
    script = "from viewer.app.window import probe; print(probe())"
    command = [sys.executable, "-c", script]
    try:
        result = subprocess.run(command, capture_output=True, text=True, timeout=_WINDOW_SECONDS)
    except subprocess.TimeoutExpired:
        return _Finding("window", "missing", f"none within {_WINDOW_SECONDS} s", cure)
    if result.returncode == 0:
        return _Finding("window", "ok", result.stdout.strip())
    lines = (result.stderr or result.stdout).strip().splitlines() or ["it crashed"]
    return _Finding(
        "window", "missing", lines[-1].removeprefix("viewer.errors.RenderError: "), cure
    )


def _examine_state_folder() -> _Finding:
    from viewer.app.files.recent import state_folder

    folder = state_folder()
    existing = next((path for path in (folder, *folder.parents) if path.exists()), Path("/"))
    if os.access(existing, os.W_OK):
        return _Finding("settings", "ok", str(folder))
    cure = "set XDG_STATE_HOME to a writable folder"
    return _Finding("settings", "note", f"{folder} is not writable: settings are not saved", cure)


def _examine_cache() -> _Finding:
    """Report the folder and size of the cache of parsed numbers and decoded images."""
    from viewer.media.array_cache import LIMIT, VARIABLE, cache_folder, cache_use

    folder = cache_folder()
    if folder is None:
        return _Finding("cache", "ok", f"switched off by {VARIABLE}")
    count, size = cache_use()
    used = f"{counted(count, 'array')}, {size / 1e6:.1f} of at most {LIMIT / 1e6:.0f} MB"
    return _Finding("cache", "ok", f"{folder}: {used} ({VARIABLE}=off for none)")


@dataclass(frozen=True, slots=True)
class Measured:
    """A duration in milliseconds, and the duration that it is compared with, if any."""

    subject: str
    milliseconds: float
    relative: float = 0.0
    to: str = ""

    def __str__(self) -> str:
        ratio = f"   {self.relative:.2f} times {self.to}" if self.to else ""
        return f"{self.subject:<54}{self.milliseconds:9.2f} ms{ratio}"


def measured() -> Iterator[Measured]:
    """Yield durations as they are measured, medians of several repetitions."""
    # Those that need no drawing come first, in case it is impossible.
    yield from _starts()
    yield from _frames()
    yield from _parts()


def _starts() -> Iterator[Measured]:
    """Measure whole programs, from start to exit."""
    from viewer.loading import bundled_body, bundled_files

    skeleton = next(str(file) for file in bundled_files() if Path(file).suffix == ".skel")
    with tempfile.TemporaryDirectory(prefix="viewer-bench-") as folder:
        picture = str(Path(folder) / "picture.png")
        draw = ["-m", "viewer", "render", "-o", picture, "--force", "--quality", "draft"]
        runs = (
            ("import numpy", "", ["-c", "import numpy"]),
            ("viewer info, a skeleton", "import numpy", ["-m", "viewer", "info", skeleton]),
            ("OpenGL context", "", ["-c", _LEAST]),
            ("viewer render, bundled figure to PNG", "OpenGL context", draw),
            ("the same without the cache", "OpenGL context", [*draw, "--no-cache"]),
            ("bundled body to PNG", "OpenGL context", [*draw, str(bundled_body())]),
        )
        own = {"VIEWER_CACHE": str(Path(folder) / "cache")}
        times = _interleaved({name: _process(words, own) for name, _, words in runs}, _STARTS)
    for name, base, _ in runs:
        ratio = _ratio(times[name], times[base]) if base else 0.0
        yield Measured(f"start to end: {name}", _median(times[name]), ratio, base)


def _ratio(times: Sequence[float], others: Sequence[float]) -> float:
    """Return the median ratio of times that were measured alternately."""
    return _median(one / other for one, other in zip(times, others, strict=True))


def _median(times: Iterable[float]) -> float:
    import statistics  # imports fractions and decimal, which no report without --bench needs

    return statistics.median(times)


def _process(arguments: Sequence[str], environment: dict[str, str]) -> Callable[[], object]:
    """Return a function that runs Python with the given arguments."""

    def run() -> None:
        done = subprocess.run(
            [sys.executable, *arguments],
            env={**os.environ, **environment},
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise RenderError((done.stderr.strip().splitlines() or ["it crashed"])[-1])

    return run


def _frames() -> Iterator[Measured]:
    """Measure frames of the bundled body, rendered and read into memory."""
    from viewer.loading import bundled_body, load
    from viewer.rendering.offscreen import Offscreen
    from viewer.rendering.options import DisplayOptions

    scene = load(bundled_body())
    crowd, many = _crowd(scene), f"{_INSTANCES} bodies"
    plain = DisplayOptions(grid=False, samples=1)
    cases = (
        ("a body that moves, 4 samples and grid", scene, DisplayOptions(), _FRAMES, "a still body"),
        ("a body that moves, 1 sample, no grid", scene, plain, _FRAMES, "a still body"),
        (
            f"{many} that move, 1 sample, no grid",
            crowd,
            plain,
            _ROUNDS_OF_MANY,
            f"{_INSTANCES} still bodies",
        ),
    )
    with Offscreen() as offscreen:
        for subject, drawn, options, rounds, base in cases:
            work = {
                "still": _drawn(offscreen, drawn, options),
                "moved": _drawn(offscreen, drawn, options, moves=True),
            }
            times = _interleaved(work, rounds)
            ratio = _ratio(times["moved"], times["still"])
            yield Measured(f"frame of {subject}", _median(times["moved"]), ratio, base)
        yield from _correctives(offscreen, crowd)


def _correctives(offscreen: Offscreen, crowd: Scene) -> Iterator[Measured]:
    """Measure the sums of pose correctives on CPU and GPU; playback uses the faster one."""
    import numpy as np

    from viewer.rendering.gpu.rest_buffers import RestBuffers
    from viewer.rigs.shape import pose_weights

    figure = crowd.actors[0].figure
    assert figure.correctives is not None  # of the bundled body
    skeleton, poses = figure.require_skeleton(), [actor.pose for actor in crowd.actors]
    weights = np.stack([pose_weights(figure.correctives, skeleton, pose) for pose in poses])
    with offscreen.context:
        renderer = offscreen.renderer
        rest = RestBuffers(offscreen.context, renderer.programs, renderer.buffers.mesh(figure))
        times = rest.corrective_times(weights)
        rest.release()
    for way, seconds in times.items():
        ratio = 0.0 if way == "cpu" else seconds / times["cpu"]
        subject = f"pose correctives of {len(poses)} bodies on the {way.upper()}"
        yield Measured(subject, 1e3 * seconds, ratio, "the CPU" if ratio else "")


def _drawn(
    offscreen: Offscreen, scene: Scene, options: DisplayOptions, moves: bool = False
) -> Callable[[], object]:
    """Return a function that draws a scene into memory, in a new pose each time if it moves."""
    from viewer.rendering.offscreen import default_camera
    from viewer.rigs.scene import scene_box

    camera, box = default_camera(scene, _SIZE), scene_box(scene)

    def draw() -> None:
        if moves:
            _pose(scene)
        offscreen.render(scene, _SIZE, camera, options, box)

    return draw


def _crowd(scene: Scene) -> Scene:
    """Return copies of the first figure, in rows of ten."""
    from viewer.rigs.scene import Actor, Scene

    actors = [Actor(scene.actors[0].figure) for _ in range(_INSTANCES)]
    for number, actor in enumerate(actors):
        actor.placement[:3, 3] = number % 10, 0.0, -(number // 10)
    return Scene(actors)


def _pose(scene: Scene) -> None:
    """Give every actor a new pose."""
    import numpy as np

    now = time.perf_counter()
    for number, actor in enumerate(scene.actors):
        pose = actor.pose
        pose.dofs[:] = 0.1 * np.sin(now + number + np.arange(len(pose.dofs)))


def _parts() -> Iterator[Measured]:
    """Measure the parts of a frame other than drawing."""
    import numpy as np

    from viewer.loading import bundled_body, load
    from viewer.media.png import encode_png
    from viewer.rigs.kinematics import world_matrices

    scene = load(bundled_body())
    actor = scene.actors[0]
    skeleton, pose = actor.figure.require_skeleton(), actor.pose

    def place() -> None:
        _pose(scene)
        world_matrices(skeleton, pose)

    # Smooth shading with a little noise, as in a rendered image.
    ramp = np.add.outer(np.arange(_SIZE[1]), np.arange(_SIZE[0]))[..., None] // 16
    noise = np.random.default_rng(0).integers(0, 2, (_SIZE[1], _SIZE[0], 1))
    pixels = (ramp + noise + np.array([0, 40, 80, 0])).astype(np.uint8)
    pixels[..., 3] = 255
    times = _interleaved({"place": place, "encode": lambda: encode_png(pixels)}, 5 * _FRAMES)
    yield Measured(f"pose of {skeleton.n_joints} joints", _median(times["place"]))
    yield Measured("PNG of 1280 x 720 pixels", _median(times["encode"]))


def _interleaved(work: dict[str, Callable[[], object]], rounds: int) -> dict[str, list[float]]:
    """Time all functions once per round, after a warm-up round: milliseconds by name."""
    times: dict[str, list[float]] = {name: [] for name in work}
    for number in range(rounds + 1):
        for name, run in work.items():
            started = time.perf_counter()
            run()
            if number:  # the warm-up round compiles and fills caches
                times[name].append(1e3 * (time.perf_counter() - started))
    return times
