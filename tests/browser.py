"""Chromium without a window, driven through pipes by the DevTools protocol; skipped if missing."""

import json
import os
import shutil
import subprocess
import tempfile
from base64 import b64decode
from pathlib import Path
from types import TracebackType

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")

_FLAGS = [
    *("--headless=new", "--no-sandbox", "--no-first-run", "--disable-extensions", "--mute-audio"),
    *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage"),
    *("--disable-background-networking", "--remote-debugging-pipe"),
]
# A promise of the page's end of loading.
LOADED = (
    "new Promise(done => document.readyState === 'complete' ? done()"
    " : addEventListener('load', done))"
)
# Chromium reads commands from descriptor 3 and writes answers to descriptor 4.
_SHELL = 'commands=$1 answers=$2; shift 2; exec "$@" 3<&"$commands" 4>&"$answers"'


class Browser:
    """One page at a time; ``messages`` and ``requests`` are what the page logged and asked for."""

    def __init__(self, size: tuple[int, int] = (480, 320)) -> None:
        self.messages: list[str] = []
        self.requests: list[str] = []
        self._number, self._rest = 0, b""
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        theirs, self._commands = os.pipe()
        self._answers, ours = os.pipe()
        assert CHROMIUM is not None  # tests without it are skipped
        program = [CHROMIUM, *_FLAGS, f"--user-data-dir={self._folder.name}"]
        program.append(f"--window-size={size[0]},{size[1]}")
        self._process = subprocess.Popen(
            ["bash", "-c", _SHELL, "bash", str(theirs), str(ours), *program, "about:blank"],
            pass_fds=(theirs, ours),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(theirs)
        os.close(ours)
        targets = self._send("Target.getTargets")["targetInfos"]
        target = next(each["targetId"] for each in targets if each["type"] == "page")
        attached = self._send("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.send(f"{domain}.enable")

    _session = ""

    def send(self, method: str, **values: object) -> dict:
        """Send a command to the page and return its result."""
        return self._send(method, **values)

    def _send(self, method: str, **values: object) -> dict:
        self._number += 1
        message = {"id": self._number, "method": method, "params": values}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._commands, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                return answer["result"]
            self._note(answer)

    def _next(self) -> dict:
        while b"\0" not in self._rest:
            data = os.read(self._answers, 1 << 20)
            assert data, "chromium ended"
            self._rest += data
        text, self._rest = self._rest.split(b"\0", 1)
        return json.loads(text)

    def _note(self, event: dict) -> None:
        values = event.get("params", {})
        if event["method"] in ("Runtime.consoleAPICalled", "Runtime.exceptionThrown"):
            self.messages.append(json.dumps(values))
        elif event["method"] == "Log.entryAdded":
            self.messages.append(values["entry"]["text"])
        elif event["method"] == "Network.requestWillBeSent":
            self.requests.append(values["request"]["url"])

    def open(self, path: Path, fragment: str = "") -> None:
        """Open a page from disk and wait until its figures are drawn."""
        if fragment:  # a change of the fragment alone does not load the page again
            self.send("Page.navigate", url="about:blank")
        self.messages.clear()
        self.requests.clear()
        address = path.resolve().as_uri() + (f"#{fragment}" if fragment else "")
        self.send("Page.navigate", url=address)
        self.run(LOADED)
        self.run("viewer.ready.then(() => null)")
        self.settle()

    def settle(self) -> None:
        """Wait until changes are drawn."""
        self.run("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        self.run("window.viewer?.ready.then(page => page.drawn)")

    def run(self, script: str) -> object:
        """Return the value of an expression of the page; promises are awaited."""
        found = self.send(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def mouse(self, kind: str, x: float, y: float, **values: object) -> None:
        """Send a mouse event: ``Pressed``, ``Moved``, ``Released`` or ``Wheel``."""
        self.send("Input.dispatchMouseEvent", type=f"mouse{kind}", x=x, y=y, **values)

    def screenshot(self) -> bytes:
        """Return the picture of the page as the bytes of a PNG file."""
        return b64decode(self.send("Page.captureScreenshot", format="png")["data"])

    def __enter__(self) -> "Browser":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._process.terminate()
        self._process.wait(10)
        os.close(self._commands)
        os.close(self._answers)
        self._folder.cleanup()
