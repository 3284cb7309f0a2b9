"""Print the numbers that show how well the tree can be held in mind, beside those of the last tag.

``make house`` runs this. There are no limits: a commit that moves a number the wrong way says why.
"""

import ast
import io
import re
import statistics
import subprocess
import sys
import tarfile
import tempfile
import tokenize
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from sources import parsed

ROOT = Path(__file__).resolve().parent.parent


@dataclass
class Module:
    """A source file, parsed."""

    name: str
    path: Path
    text: str
    tree: ast.Module


def modules_of(root: Path) -> list[Module]:
    """Return all modules of the package in a checkout."""
    found = []
    for path in sorted((root / "viewer").rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        text = path.read_text()
        found.append(Module(name, path, text, parsed(path)))
    return found


def imported_by(modules: list[Module]) -> dict[str, set[str]]:
    """Return which modules import each module, also in functions and for types."""
    names = {module.name for module in modules}
    importers: dict[str, set[str]] = {name: set() for name in names}
    for module in modules:
        for node in ast.walk(module.tree):
            used: set[str] = set()
            if isinstance(node, ast.Import):
                used = {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                inner = {f"{node.module}.{alias.name}" for alias in node.names} & names
                used = inner or {node.module}
            for name in used & names - {module.name}:
                importers[name].add(module.name)
    return importers


def reached(graph: dict[str, set[str]], start: str) -> set[str]:
    """Return all that can be reached from a node of a graph, in one step or several."""
    found: set[str] = set()
    left = [start]
    while left:
        for other in graph[left.pop()] - found:
            found.add(other)
            left.append(other)
    return found


def repeated_annotations(modules: list[Module]) -> int:
    """Return how many docstring lines only repeat a type that the signature states.

    These are entries such as ``path : Path`` where the parameter is annotated ``Path``.
    """
    count = 0
    for module in modules:
        for node in ast.walk(module.tree):
            if not isinstance(node, ast.FunctionDef | ast.ClassDef):
                continue
            if isinstance(node, ast.FunctionDef):
                arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
                types = {a.arg: ast.unparse(a.annotation) for a in arguments if a.annotation}
            else:
                fields = [item for item in node.body if isinstance(item, ast.AnnAssign)]
                types = {ast.unparse(f.target): ast.unparse(f.annotation) for f in fields}
            for name, said in re.findall(r"^\s*(\w+) : (.+)$", ast.get_docstring(node) or "", re.M):
                stated = re.sub(r",? (optional|or None)$", "", said).replace(" or ", " | ")
                count += stated == types.get(name, "").removesuffix(" | None")
    return count


def comment_lines(modules: list[Module]) -> int:
    """Return how many lines hold nothing but a comment."""
    count = 0
    for module in modules:
        for token in tokenize.generate_tokens(io.StringIO(module.text).readline):
            count += token.type == tokenize.COMMENT and token.line.lstrip().startswith("#")
    return count


def numbers(root: Path) -> dict[str, str]:
    """Return all numbers of a checkout, by their names, in the order in which they are printed."""
    modules = modules_of(root)
    importers = imported_by(modules)
    sizes = {module.name: module.text.count("\n") for module in modules}
    own = {node.name for m in modules for node in m.tree.body if isinstance(node, ast.ClassDef)}
    # A name counts once per use, whatever module it stands for.
    uses: Counter[str] = Counter()
    checks = 0
    for module in modules:
        for node in ast.walk(module.tree):
            if isinstance(node, ast.Name):
                uses[node.id] += 1
            elif isinstance(node, ast.Attribute):
                uses[node.attr] += 1
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "isinstance":
                checks += any(
                    isinstance(inner, ast.Name | ast.Attribute)
                    and ast.unparse(inner).split(".")[-1] in own
                    for inner in ast.walk(node.args[1])
                )
    functions = [
        node.name
        for module in modules
        for node in module.tree.body
        if isinstance(node, ast.FunctionDef)
    ]
    public = [name for name in functions if not name.startswith("_")]
    private = [name for name in functions if name.startswith("_")]
    rows = {}
    for part in sorted({name.split(".")[1] for name in sizes if "." in name}):
        inside = [n for name, n in sizes.items() if name.split(".")[1:2] == [part]]
        if len(inside) > 1:
            middle = statistics.median(inside)
            rows[part] = f"{len(inside):5} files {sum(inside):7,} lines {middle:4.0f} median"
    middle = statistics.median(sizes.values())
    rows["viewer"] = f"{len(sizes):5} files {sum(sizes.values()):7,} lines {middle:4.0f} median"
    comments = comment_lines(modules)
    n_in_circles = sum(name in reached(importers, name) for name in importers)
    tests = [path.read_text().count("\n") for path in (root / "tests").rglob("*.py")]
    middle = statistics.median(tests)
    return rows | {
        "tests": f"{len(tests):5} files {sum(tests):7,} lines {middle:4.0f} median",
        "modules with one importer": f"{sum(len(who) == 1 for who in importers.values()):,}",
        "public functions used once": f"{sum(uses[name] == 1 for name in public):,}",
        "private functions used once": f"{sum(uses[name] == 1 for name in private):,}",
        "isinstance on our own types": f"{checks:,}",
        "docstring lines that repeat a type": f"{repeated_annotations(modules):,}",
        "comment lines": f"{comments:,} ({comments / sum(sizes.values()):.1%})",
        "modules in import circles": f"{n_in_circles:,}",
    }


def last_tag() -> str:
    """Return the name of the last tag, or an empty string."""
    command = ["git", "describe", "--tags", "--abbrev=0"]
    run = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    return run.stdout.strip()


def main() -> None:
    """Print a table."""
    here = numbers(ROOT)
    tag = sys.argv[1] if len(sys.argv) > 1 else last_tag()
    then: dict[str, str] = {}
    if tag:
        with tempfile.TemporaryDirectory() as folder:
            packed = subprocess.run(["git", "archive", tag], stdout=subprocess.PIPE, cwd=ROOT)
            with tarfile.open(fileobj=io.BytesIO(packed.stdout)) as archive:
                archive.extractall(folder, filter="data")
            then = numbers(Path(folder))
    print(f"{'':36}{'now':38}{tag}")
    for name, value in here.items():
        print(f"{name:36}{value.strip():38}{then.get(name, '').strip()}")
    print("Gate time: the last line of make test.")


if __name__ == "__main__":
    main()
