"""A page opened in Firefox, driven by its Marionette protocol; skipped if it is missing."""

import json
import os
import shutil
import socket
import subprocess
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exporters.html.test_page import HOSTILE, check_frames, moving, tangle, write
from x_server import x_server

from viewer.rigs.material import Material
from viewer.rigs.skinning import Skinning

pytestmark = pytest.mark.slow
FIREFOX = shutil.which("firefox") or shutil.which("firefox-esr")
# Any free port; OpenGL in software; nothing that a fresh profile would fetch or show.
_PREFERENCES = {
    "marionette.port": 0,
    "webgl.force-enabled": True,
    "app.normandy.enabled": False,
    "app.update.disabledForTesting": True,
    "browser.shell.checkDefaultBrowser": False,
    "browser.startup.homepage_override.mstone": "ignore",
    "datareporting.policy.dataSubmissionEnabled": False,
    "network.captive-portal-service.enabled": False,
    "network.connectivity-service.enabled": False,
}
# Messages of pages: those of the program itself are about its own files.
_MESSAGES = """
const seen = Services.console.getMessageArray().filter((each) => each instanceof Ci.nsIScriptError);
const logged = Cc["@mozilla.org/consoleAPI-storage;1"].getService(Ci.nsIConsoleAPIStorage);
return [...seen.map((each) => [each.sourceName, each.errorMessage]),
  ...logged.getEvents().map((each) => [each.filename, each.arguments.map(String).join()])]
  .filter(([file]) => !/^(resource|chrome|moz-[a-z]+):/.test(file)).map((each) => each.join(" "));
"""


class Firefox:
    """One page at a time."""

    def __init__(self, display: str, folder: Path) -> None:
        rows = (
            f"user_pref({json.dumps(key)}, {json.dumps(_PREFERENCES[key])});"
            for key in _PREFERENCES
        )
        (folder / "user.js").write_text("\n".join(rows))
        words = (
            "--marionette",
            "--remote-allow-system-access",
            "--no-remote",
            "--profile",
            str(folder),
        )
        self._process = subprocess.Popen(
            [FIREFOX, *words, str(folder), "about:blank"],
            env={**os.environ, "DISPLAY": display, "HOME": str(folder)},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        port, patience = folder / "MarionetteActivePort", time.monotonic() + 120.0
        while not (port.is_file() and port.read_text().strip()):
            assert self._process.poll() is None and time.monotonic() < patience, "no Firefox"
            time.sleep(0.05)
        self._socket = socket.create_connection(("127.0.0.1", int(port.read_text())), 120.0)
        self._answers, self._number = self._socket.makefile("rb"), 0
        self._next()
        self.send("WebDriver:NewSession")

    def _next(self) -> list:
        length = b""
        while not length.endswith(b":"):
            length += self._answers.read(1)
        return json.loads(self._answers.read(int(length[:-1])))

    def send(self, name: str, **values: object) -> dict:
        """Send a command and return its result."""
        self._number += 1
        text = json.dumps([0, self._number, name, values]).encode()
        self._socket.sendall(b"%d:%s" % (len(text), text))
        _, _, error, result = self._next()
        assert error is None, error
        return result

    @property
    def messages(self) -> list[str]:
        """What pages logged, and what the browser logged about them."""
        self.send("Marionette:SetContext", value="chrome")
        found = self.send("WebDriver:ExecuteScript", script=_MESSAGES, args=[])["value"]
        self.send("Marionette:SetContext", value="content")
        return found

    def open(self, path: Path) -> None:
        """Open a page from disk and wait until its figures are drawn."""
        self.send("WebDriver:Navigate", url=path.resolve().as_uri())
        self.run("viewer.ready.then(() => null)")
        self.settle()

    def settle(self) -> None:
        """Wait until changes are drawn."""
        shown = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
        for script in (shown, "viewer.ready.then(page => page.drawn)", shown):
            self.run(script)

    def run(self, script: str) -> object:
        """Return the value of an expression of the page; promises are awaited."""
        # Its scripts see the objects of the page, whose policy forbids to evaluate text.
        whole = f"return Promise.resolve({script})"
        return self.send("WebDriver:ExecuteScript", script=whole, args=[])["value"]

    def press(self, *keys: str) -> None:
        """Press and release keys."""
        kinds = "keyDown", "keyUp"
        actions = [{"type": kind, "value": key} for key in keys for kind in kinds]
        self.send(
            "WebDriver:PerformActions", actions=[{"type": "key", "id": "k", "actions": actions}]
        )
        self.settle()

    def screenshot(self) -> str:
        """Return the picture of the page, a PNG file in base 64."""
        return self.send("WebDriver:TakeScreenshot", full=False)["value"]

    def close(self) -> None:
        """End the program."""
        self._answers.close()
        self._socket.close()
        self._process.terminate()
        self._process.wait(30)


@pytest.fixture
def firefox():
    if FIREFOX is None:
        pytest.skip("firefox is not installed")
    # Outside pytest's folders, which are kept: a profile has hundreds of files.
    with (
        x_server("640x480") as (_, display),
        tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder,
    ):
        found = Firefox(display, Path(folder))
        yield found
        found.close()


def test_page_plays_in_firefox_exactly_and_without_a_message(firefox, tmp_path):
    how = Skinning("mix", 0.3)
    glass = Material(
        base_color=(1.0, 1.0, 1.0, 0.5), alpha_mode="blend"
    )  # its triangles are sorted
    plain = tangle(far=40.0)
    one = np.zeros(plain.mesh.n_triangles, np.int32)
    figure = replace(plain, mesh=replace(plain.mesh, materials=(glass,), triangle_materials=one))
    (animation,), _ = write(tmp_path / "a.html", moving(figure), how=how)
    firefox.open(tmp_path / "a.html")
    still = firefox.screenshot()
    check_frames(firefox, animation, how, [0, 2, 4])
    firefox.press("\ue011")  # Home
    assert firefox.screenshot() == still
    firefox.press("\ue014")  # the right arrow: a frame of a tenth of a second
    assert firefox.run("viewer.ready.then(page => page.time)") == pytest.approx(0.1)
    assert firefox.screenshot() != still
    firefox.run("document.getElementById('loop').click()")
    firefox.press(" ")
    ended = "const check = () => page.isPlaying ? requestAnimationFrame(check) : done(page.time)"
    played = f"viewer.ready.then(page => new Promise(done => {{ {ended}; check(); }}))"
    assert firefox.run(played) == pytest.approx(0.4)
    names = "[...document.getElementById('joint').options].map(each => each.text)"
    assert firefox.run(names)[1] == HOSTILE and firefox.run("document.title") == "a"
    assert firefox.run("performance.getEntriesByType('resource').map(each => each.name)") == []
    assert firefox.messages == []
