"""Pictures of scenes in notebooks."""

import html
import re
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import viewer
from viewer.notebook import LARGEST, SIZE, show_scenes


@pytest.fixture
def formatters(monkeypatch):
    """The functions that IPython would call, by type of content, module and class."""
    known = {}

    def formatter(kind):
        def keep(module, name, show):
            known[kind, module, name] = show

        return SimpleNamespace(for_type_by_name=keep)

    both = {kind: formatter(kind) for kind in ("image/png", "text/html")}
    shell = SimpleNamespace(display_formatter=SimpleNamespace(formatters=both))
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    show_scenes()
    return {kind: show for (kind, _, _), show in known.items()}


@pytest.mark.slow
def test_notebooks_show_a_picture_of_a_scene(formatters):
    data = formatters["image/png"](viewer.load())
    assert data.startswith(b"\x89PNG")
    width, height = (int.from_bytes(data[at : at + 4], "big") for at in (16, 20))
    assert (width, height) == SIZE


@pytest.mark.slow
def test_notebooks_show_the_page_over_a_picture(formatters, monkeypatch):
    """Where frames are removed, the picture is left; pages beyond the limit are not shown."""
    scene = viewer.load("fox")
    text = formatters["text/html"](scene)
    assert text.index('<img alt="3D view" src="data:image/png;base64,') < text.index("<iframe")
    frame = re.search(
        r'<iframe title="3D view" sandbox="allow-scripts" [^>]*srcdoc="([^"]*)"', text
    )
    page = html.unescape(frame[1])
    assert page.startswith("<!doctype html>") and page.rstrip().endswith("</html>")
    assert len(text) < 2 * LARGEST
    monkeypatch.setattr("viewer.notebook.LARGEST", len(page) - 1)
    assert formatters["text/html"](scene) is None


def test_scripts_of_ipython_without_a_shell_are_left_alone(monkeypatch):
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: None))
    show_scenes()


def test_widget_numbers_actors_as_its_page_does():
    """Pages have moving figures first."""
    pytest.importorskip("anywidget")
    still, moving = (
        viewer.figure([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], weights=np.ones((3, 1)),
                      joints=[[0, 0, 0]], name=name) for name in ("still", "walker")
    )  # fmt: skip
    moves = viewer.animate(moving, np.zeros((3, 1, 3)), fps=10)
    widget = viewer.widget(viewer.Scene([viewer.Actor(still), moves]))
    names = re.findall(r'"name": ?"(still|motion)"', widget._page)
    assert names[0] == "motion" and names[1] == "still"
    widget["still"].pose = widget["still"].pose
    assert [*widget._poses] == [str(names.index("still"))]
    widget.selection = ["motion"]
    assert widget.selection == ("motion",)
