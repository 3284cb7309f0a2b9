"""The child process that reads ``.fbx`` files, which keeps the library's objects until it exits."""

import gc
import os
import sys
from types import SimpleNamespace

import pytest

from viewer.formats.fbx import worker
from viewer.formats.fbx.message import unpacked


def test_objects_of_the_library_live_until_the_process_exits(
    monkeypatch: pytest.MonkeyPatch, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    events = []

    class Scene:
        def __init__(self, *_arguments: object) -> None:
            pass

        def message(self, _stack: list[str]) -> tuple[dict[str, object], dict[str, object]]:
            return {}, {"names": ["root"]}

        def __del__(self) -> None:
            events.append("destroyed")

    def leave(code: int) -> None:
        events.append(f"exit {code}")
        raise SystemExit

    monkeypatch.setitem(sys.modules, "ufbx", SimpleNamespace(UfbxError=RuntimeError))
    monkeypatch.setattr(worker, "_Scene", Scene)
    monkeypatch.setattr(os, "_exit", leave)
    try:
        with pytest.raises(SystemExit):
            worker.main(["figure.fbx"])
    finally:
        gc.enable()
    assert events[0] == "exit 0"
    message = unpacked(capfdbinary.readouterr().out)
    assert message is not None and message[1] == {"names": ["root"]}
