"""Each registry lists exactly the modules of its folder, and its entries can be loaded."""

import pydoc
from importlib import import_module
from inspect import signature
from pathlib import Path

import pytest

import viewer
from viewer.app.features import ACTIONS, KEYS
from viewer.app.layout import PANELS, panel_module
from viewer.batching.engines import ENGINES
from viewer.commands import COMMANDS
from viewer.examples import EXAMPLES
from viewer.exporters import EXPORTERS
from viewer.formats import FORMATS
from viewer.rendering.gpu.program import SHADING
from viewer.resources import resource
from viewer.rigs.skinning import METHODS

PACKAGE = Path(viewer.__file__).parent


def modules(folder: str) -> set[str]:
    """Return the modules and packages of a folder that are not private."""
    found = {path.stem for path in (PACKAGE / folder).glob("*.py")}
    found |= {path.parent.name for path in (PACKAGE / folder).glob("*/__init__.py")}
    return {name for name in found if not name.startswith("_")}


@pytest.mark.parametrize(
    ("folder", "registry"),
    [
        ("formats", FORMATS),
        ("rigs/skinning", METHODS),
        ("commands", COMMANDS),
        ("exporters", EXPORTERS),
        ("batching/engines", ENGINES),
        ("examples", EXAMPLES),
    ],
    ids=["formats", "skinning", "commands", "exporters", "engines", "examples"],
)
def test_registry_matches_its_folder(folder, registry):
    assert modules(folder) == {name.replace("-", "_") for name in registry}


@pytest.mark.parametrize(
    ("folder", "registry"), [("skin", METHODS), ("shade", SHADING)], ids=["skin", "shade"]
)
def test_shader_registry_matches_its_folder(folder, registry):
    assert {path.stem for path in resource("shaders", folder).glob("*.glsl")} == set(registry)


def test_formats_can_read_and_write_as_declared():
    for name in FORMATS:
        module = import_module(f"viewer.formats.{name}")
        assert callable(module.read)
        assert hasattr(module, "write") == FORMATS[name].writes


def test_exporters_write_what_they_declare():
    for name, kind in EXPORTERS.items():
        module = import_module(f"viewer.exporters.{name}")
        assert callable(module.export) and kind.stores
        assert hasattr(module, "require") == bool(kind.joints)


def test_panel_table_lists_the_panels_of_all_features():
    found = {(path.parent.name, path.stem) for path in (PACKAGE / "app").rglob("*_panel.py")}
    assert found == {(panel.feature, f"{name}_panel") for name, panel in PANELS.items()}
    assert all(path.parent.parent == PACKAGE / "app" for path in PACKAGE.rglob("*_panel.py"))


def test_panels_can_draw():
    for name in PANELS:
        assert callable(panel_module(name).draw)


def test_keys_and_actions_are_functions_of_the_state():
    for names in (
        [key.label for key in KEYS],
        [key.name for key in KEYS],
        [action.text for action in ACTIONS],
    ):
        assert len(names) == len(set(names))
    for one in (*KEYS, *ACTIONS):
        assert next(iter(signature(one.run).parameters)) == "state", one
        signature(one.run).bind(None)


def test_commands_can_run():
    for name in COMMANDS:
        module = import_module(f"viewer.commands.{name.replace('-', '_')}")
        assert callable(module.run) and callable(module.add_arguments)


def test_public_names_exist_and_are_documented():
    for name in viewer.__all__:
        value = getattr(viewer, name)
        assert value.__doc__ and value.__doc__.strip(), name


def test_help_begins_with_an_overview():
    """Without the packages that some functions need, too: only calls import them."""
    text = pydoc.plain(pydoc.render_doc(viewer))
    first = text.partition("DESCRIPTION")[2]
    assert "viewer.load(" in first[:300] and "retarget, clean, rig" in first[:1200]
    assert "widget(scene" in text and "class Findings" in text
