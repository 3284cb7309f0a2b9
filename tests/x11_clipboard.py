"""Another program that uses the clipboard of an X display."""

import subprocess
import sys

_READ = """
import glfw
glfw.ERROR_REPORTING = False  # an empty clipboard is an error to GLFW
glfw.init()
glfw.window_hint(glfw.VISIBLE, False)
glfw.window_hint(glfw.CLIENT_API, glfw.NO_API)
window = glfw.create_window(1, 1, "clipboard", None, None)
print((glfw.get_clipboard_string(None) or b"").decode(), end="")
"""
_OFFER = """
import sys, glfw
glfw.ERROR_REPORTING = False  # an empty clipboard is an error to GLFW
glfw.init()
glfw.window_hint(glfw.VISIBLE, False)
glfw.window_hint(glfw.CLIENT_API, glfw.NO_API)
window = glfw.create_window(1, 1, "clipboard", None, None)
glfw.set_clipboard_string(None, sys.argv[1])
print("ready", flush=True)
while True:
    glfw.wait_events_timeout(0.1)
"""


def read_clipboard(environment):
    """Return the text on the clipboard."""
    done = subprocess.run(
        [sys.executable, "-c", _READ],
        env=environment, capture_output=True, text=True, timeout=30, check=True,
    )  # fmt: skip
    return done.stdout


def offer_clipboard(environment, text):
    """Put a text on the clipboard; return the process that owns it."""
    process = subprocess.Popen(
        [sys.executable, "-c", _OFFER, text], env=environment, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "ready\n"
    return process
