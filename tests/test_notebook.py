"""Pictures of scenes in notebooks."""

import sys
from types import SimpleNamespace

import pytest

import viewer
from viewer.notebook import SIZE, show_pictures


@pytest.fixture
def formatter(monkeypatch):
    """The functions that IPython would call, by module and class."""
    known = {}
    pictures = SimpleNamespace(
        for_type_by_name=lambda module, name, show: known.update({(module, name): show})
    )
    shell = SimpleNamespace(display_formatter=SimpleNamespace(formatters={"image/png": pictures}))
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    return known


def test_notebooks_show_a_picture_of_a_scene(formatter):
    show_pictures()
    ((module, name), show) = formatter.popitem()
    assert getattr(sys.modules[module], name) is viewer.Scene
    data = show(viewer.load())
    assert data.startswith(b"\x89PNG")
    width, height = (int.from_bytes(data[at : at + 4], "big") for at in (16, 20))
    assert (width, height) == SIZE


def test_scripts_of_ipython_without_a_shell_are_left_alone(monkeypatch):
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: None))
    show_pictures()
