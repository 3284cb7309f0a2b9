"""Import directions, no circles, few imports without a window, tests beside their sources."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from house import reached
from sources import parsed

import viewer

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "viewer"
WIDE = {"Exception", "BaseException"}  # types that nearly every problem has
SOURCES = sorted(PACKAGE.rglob("*.py"))
TESTS = ROOT / "tests"
TEST_FILES = sorted(TESTS.rglob("*.py"))
# Folders of tests without a corresponding folder of sources.
OTHER_FOLDERS = {"bench", "bench/references", "data", "golden"}

# The parts of the package that each part may import, in addition to itself and to the parts that
# every part may import.
EVERYWHERE = {
    "arguments",
    "data_classes",
    "diagnostics",
    "errors",
    "near_names",
    "phrases",
    "plugins",
    "progress",
    "schemas",
    "version",
}
PARTS = {
    "rigs": set(),
    "autorig": {"rigs"},
    "media": {"rigs", "interrupts", "streams"},
    "formats": {"media", "rigs", "interrupts", "streams"},
    "rendering": {"rigs", "interrupts", "resources"},
    "exporters": {"autorig", "formats", "media", "rendering", "rigs", "interrupts"},
    "loading": {"formats", "models", "rigs", "interrupts"},
    "live": {"exporters", "formats", "rigs"},
    "app": {
        *("autorig", "exporters", "formats", "linting", "live", "loading", "manual", "media"),
        *("models", "rendering", "rigs", "interrupts", "resources"),
    },
    "linting": {"loading", "formats", "rigs"},
    "batching": {"formats", "media", "interrupts", "streams", "version"},
    "manual": {"resources"},
    "models": {"formats", "interrupts", "media", "resources"},
    "plugin_template": {"formats", "linting", "rigs"},  # otherwise the names of ``viewer.__all__``
    "examples": {
        "batching",
        "models",
        "resources",
        "rigs",
    },  # otherwise the names of ``viewer.__all__``
    "interrupts": set(),
    "resources": set(),
    "streams": set(),
    "version": set(),
}
LEAVES = {
    "arguments": {"errors"},
    "data_classes": set(),
    "phrases": set(),
    "diagnostics": {"data_classes", "phrases"},
    "errors": {"diagnostics", "phrases"},
    "near_names": {"phrases"},
    "plugins": {"data_classes", "errors", "interrupts", "phrases", "progress"},
    "progress": {"interrupts"},
    "schemas": set(),
    "version": set(),
}
ALLOWED = {name: parts | {name} for name, parts in LEAVES.items()} | {
    name: parts | EVERYWHERE | {name} for name, parts in PARTS.items()
}
# The folders of the window that each of its folders may import: no feature imports all others, and
# the core imports none. Modules outside these folders assemble the window and may import
# everything.
ALLOWED_IN_APP = {
    "core": {"core"},
    "layout": {"core"},
    "files": {"core", "files"},
    "preferences": {"core", "files", "preferences"},
    "actors": {"core", "actors", "retargeting"},
    "playback": {"core", "files", "playback"},
    "curves": {"core", "files", "curves"},
    "posing": {"core", "files", "curves", "posing"},
    "weights": {"core", "layout", "files", "posing", "weights"},
    "view": {"core", "files", "posing", "weights", "view"},
    "live": {"core", "actors", "closing", "live"},
    "manual": {"core", "manual"},
    "palette": {"core", "palette"},
    "context_menu": {
        *("core", "actors", "posing", "weights", "view", "palette", "rigging", "context_menu"),
    },
    "linting": {"core", "layout", "playback", "view", "linting"},
    "retargeting": {"core", "files", "retargeting"},
    "rigging": {"core", "files", "posing", "view", "rigging"},
    "recording": {"core", "files", "actors", "weights", "linting", "recording"},
    "closing": {
        *("core", "files", "curves", "playback", "posing", "retargeting", "rigging", "closing"),
    },
}
# Third-party modules that only one part may import.
HOMES = {
    "moderngl": {"rendering", "app"},
    "pyrr": {"rendering/camera.py"},
    "glfw": {"app"},
    "imgui_bundle": {"app"},
    "PIL": {
        "examples",
        "media/captioned_sheet.py",
        "media/image.py",
        "media/picture_sinks.py",
        "rendering/overlay/legend.py",
        "rendering/overlay/typeface.py",
    },
    "av": {"media/video.py", "media/video_reading.py"},
    "isal": {"media/png.py"},
    "orjson": {"formats/_text"},
    "rich": {"commands"},
    "shtab": {"commands/completion.py"},
    "pebble": {"batching/engines/processes.py"},
    "anywidget": {"notebook_widget.py"},
}


@cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    """Return the nodes that are checked in a whole file: imports, functions and conditions."""
    kinds = (ast.Import, ast.ImportFrom, ast.FunctionDef, ast.If)
    return tuple(node for node in statements(parsed(path)) if isinstance(node, kinds))


def statements(block: ast.AST) -> Iterator[ast.AST]:
    """Yield the statements of a block and of the blocks in it, without their expressions."""
    for name in ("body", "orelse", "finalbody", "handlers", "cases"):
        inner = getattr(block, name, ())
        for node in inner if isinstance(inner, list) else ():
            yield node
            yield from statements(node)


@cache
def imports(path: Path, with_types: bool = False) -> frozenset[str]:
    """Return the modules that a file imports anywhere, with or without those for type checking."""
    guarded = {
        id(inner)
        for node in nodes(path)
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        for inner in statements(node)
        if not with_types
    }
    names: set[str] = set()
    for node in nodes(path):
        if id(node) in guarded:
            continue
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
    return frozenset(names)


def part_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def test_imports_follow_the_allowed_directions():
    for path in SOURCES:
        allowed = ALLOWED.get(part_of(path))
        if allowed is None:
            continue  # the command line may import everything
        used = {name.split(".")[1] for name in imports(path) if name.startswith("viewer.")}
        assert used <= allowed, path


def part_of_app(name: str) -> str:
    """Return the folder of a window module, or the module itself if it is in no folder."""
    return name.split(".")[2]


def test_window_features_follow_the_allowed_directions():
    folders = {path.name for path in (PACKAGE / "app").iterdir() if path.is_dir()}
    assert folders - {"__pycache__"} <= set(ALLOWED_IN_APP)
    for path in (PACKAGE / "app").rglob("*.py"):
        allowed = ALLOWED_IN_APP.get(part_of_app(module_name(path) + "."))
        names = imports(path, with_types=True)
        used = {part_of_app(name) for name in names if name.startswith("viewer.app.")}
        assert allowed is None or used <= allowed, path
        assert "viewer.app" not in names, path


def test_folders_of_tests_mirror_the_sources():
    folders = {path.parent.relative_to(TESTS).as_posix() for path in TEST_FILES}
    for folder in folders:
        mirrored = PACKAGE / folder
        # Tests of private folders are in a folder without the underscore. Tests of a module with
        # many of them are in a folder named after it.
        private = mirrored.parent / f"_{mirrored.name}"
        module = mirrored.with_suffix(".py")
        known = any(
            path.exists() for path in (mirrored, private, module, private.with_suffix(".py"))
        )
        assert folder in OTHER_FOLDERS or known, folder


def test_tests_are_in_the_mirrored_folder():
    """A test file that imports only one folder's modules must be in that folder's tests."""
    for path in TEST_FILES:
        used = set(re.findall(r"^ *(?:from|import) viewer\.(\w+)", path.read_text(), re.MULTILINE))
        if path.name.startswith("test_") and used - EVERYWHERE == {"media"}:
            assert path.parent == TESTS / "media", path


def test_third_party_modules_are_imported_by_one_part_only():
    for path in SOURCES:
        inside = path.relative_to(PACKAGE).as_posix()
        for name in imports(path):
            homes = HOMES.get(name.split(".")[0])
            assert homes is None or any(inside.startswith(home) for home in homes), (path, name)


def test_scipy_is_imported_where_it_is_used():
    """Importing scipy.ndimage takes half as long as the rest of a window's start."""
    for path in SOURCES:
        for node in parsed(path).body:
            if isinstance(node, ast.Import | ast.ImportFrom):
                names = [alias.name for alias in node.names]
                names.append(getattr(node, "module", None) or "")
                assert not {"scipy"} & {name.split(".")[0] for name in names}, path


def test_standard_dataclass_decorator_is_not_used():
    """The decorator of the standard library delays every start by 0.5 ms for each class."""
    for path in SOURCES:
        found = re.search(
            r"^from dataclasses import .*\bdataclass\b", path.read_text(), re.MULTILINE
        )
        assert not found, path


def test_every_public_module_documents_itself():
    for path in SOURCES:
        assert ast.get_docstring(parsed(path)), path


def test_no_module_has_the_name_of_a_public_function():
    """Importing the module would replace the function in ``viewer``."""
    modules = {part_of(path) for path in SOURCES if path.parent != PACKAGE or path.stem[0] != "_"}
    functions = {*viewer.__all__, "rig", "lint", "diff", "clean", "retarget", "widget"}
    assert not functions & modules


def test_benchmarks_are_described():
    folder = TESTS / "bench"
    text = (folder / "README.md").read_text()
    missing = [path.name for path in folder.glob("bench_*.py") if f"| `{path.name}` |" not in text]
    assert missing == []


def test_shaders_state_their_version_and_use_name_prefixes():
    for path in (ROOT / "shaders").glob("*.*"):
        text = path.read_text()
        version = 430 if path.suffix == ".comp" else 330
        assert text.startswith(f"#version {version}\n"), path
        assert not re.findall(r"^in \w+ (?!in_|v_)", text, re.MULTILINE), path
        assert not re.findall(r"^out \w+ (?!v_|f_)", text, re.MULTILINE), path
        assert not re.findall(r"^uniform \w+ (?!u_)", text, re.MULTILINE), path


def test_uniforms_are_set_in_one_place_only():
    """Values set elsewhere would not be noticed by ``set_uniforms``, which skips known ones."""
    setting = re.compile(r"""\[f?["']u_\w+["']\](?:\.value)?(?:,.*)? = |\]\.write\(""")
    assert setting.search('program["u_size"], program["u_step"] = 1.0, 2.0')
    found = {path for path in SOURCES for line in path.read_text().splitlines()
             if "program" in line and setting.search(line)}  # fmt: skip
    assert not found


def loaded_modules(script: str) -> set[str]:
    code = f"import sys\n{script}\nprint(*sys.modules, file=sys.stderr)"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, timeout=60
    )
    assert result.returncode == 0, result.stderr
    return {name.split(".")[0] for name in result.stderr.splitlines()[-1].split()}


def test_importing_viewer_loads_few_modules():
    loaded = loaded_modules("import viewer")
    assert not loaded & {
        "numpy",
        "moderngl",
        "PIL",
        "imgui_bundle",
        "glfw",
        "scipy",
        "pyrr",
        "rich",
    }


def test_reading_a_figure_needs_no_opengl():
    loaded = loaded_modules("import viewer; viewer.deform(viewer.load().actors[0].figure)")
    assert not loaded & {"moderngl", "imgui_bundle", "glfw", "scipy", "pyrr"}


def test_printing_a_skeleton_loads_few_modules():
    """Modules that take long to import: shutil for archives, hashlib for OpenSSL, numpy.random."""
    command = ["info", str(ROOT / "assets" / "samples" / "fox.skel")]
    loaded = loaded_modules(f"from viewer.cli import run; run({command})")
    assert "numpy" in loaded
    assert not loaded & {"shutil", "hashlib", "secrets", "moderngl", "PIL", "pyrr", "rich", "json"}


@pytest.mark.slow
def test_drawing_headlessly_needs_no_window_library():
    loaded = loaded_modules("import viewer; viewer.render(viewer.load(), size=(32, 32))")
    assert "moderngl" in loaded
    # numpy.random loads secrets.
    assert not loaded & {"imgui_bundle", "glfw", "scipy", "secrets", "hashlib"}


def test_no_module_changes_environment_variables():
    """A library must not set environment variables of the program that uses it.

    Exceptions: those for OpenBLAS and NVIDIA's driver, set by the program, and one for EGL, set to
    draw without a window.
    """
    setting = r"os\.environ\[[^]]+\]\s*=|putenv|environ\.(?:update|setdefault)"
    setters = {path for path in SOURCES if re.search(setting, path.read_text())}
    assert setters == {PACKAGE / "__main__.py", PACKAGE / "rendering" / "gpu" / "context.py"}


def import_graph() -> dict[str, set[str]]:
    """Return which modules of the package each module imports, also in functions and for types."""
    modules = {module_name(path): path for path in SOURCES}
    graph = {}
    for name, path in modules.items():
        members = {
            f"{node.module}.{alias.name}"
            for node in nodes(path)
            if isinstance(node, ast.ImportFrom) and node.module
            for alias in node.names
        }
        found = imports(path, with_types=True)
        graph[name] = {
            other
            for other in modules
            if other != name and ((other in found and other not in members) or other in members)
        }
    return graph


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def test_modules_have_no_circular_imports():
    """Circular imports are errors at run time, within functions, and for type checking."""
    graph = import_graph()
    behind = {name: reached(graph, name) for name in graph}
    circles = {
        frozenset(other for other in behind[name] if name in behind[other])
        for name in graph
        if name in behind[name]
    }
    assert not circles


def test_assertions_only_tell_readers_and_type_checkers_what_a_value_is():
    def narrows(test: ast.expr) -> bool:
        if isinstance(test, ast.BoolOp):
            return isinstance(test.op, ast.And) and all(map(narrows, test.values))
        if isinstance(test, ast.UnaryOp):
            return isinstance(test.op, ast.Not) and narrows(test.operand)
        if isinstance(test, ast.Compare):
            return ast.unparse(test).endswith((" is None", " is not None"))
        return isinstance(test, ast.Call) and ast.unparse(test.func) in {"isinstance", "callable"}

    wrong = [
        f"{path}:{node.lineno}: {ast.unparse(node)}"
        for path in SOURCES
        for node in statements(parsed(path))
        if isinstance(node, ast.Assert) and not narrows(node.test)
    ]
    assert not wrong


def test_broad_handlers_raise_again_or_hand_the_problem_on():
    """One that tries the next of several devices says so on its line."""
    wrong = []
    for path in SOURCES:
        lines = path.read_text(encoding="utf-8").splitlines()
        for node in statements(parsed(path)):
            if not isinstance(node, ast.ExceptHandler):
                continue
            if node.type is not None and ast.unparse(node.type) not in WIDE:
                continue
            body = [inner for line in node.body for inner in ast.walk(line)]
            raises = any(isinstance(inner, ast.Raise) for inner in body)
            uses = any(isinstance(inner, ast.Name) and inner.id == node.name for inner in body)
            if not raises and not uses and "#" not in lines[node.lineno - 1]:
                wrong.append(f"{path}:{node.lineno}")
    assert not wrong
