"""Options of ``viewer serve``; ``tests/test_window.py`` opens its window."""

import pytest

from viewer.cli import run


@pytest.mark.parametrize("text", ["abc", "0", "65536", "host:", "39539:host"])
@pytest.mark.parametrize("option", ["--vmc-in", "--vmc-out"])
def test_port_is_a_number(option, text, capsys):
    assert run(["serve", option, text]) == 2
    found = capsys.readouterr().err
    assert found == (
        f"viewer: {option}: expected a port from 1 to 65535, or HOST:PORT, found {text}\n"
    )


def test_window_without_a_display_is_an_error_of_one_line(capsys, monkeypatch, tmp_path):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    path = tmp_path / "window.json"
    assert run(["serve", "--connection-file", str(path)]) == 2
    assert "no display found" in capsys.readouterr().err
    assert not path.exists()
