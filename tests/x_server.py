"""A display of the tests' own: Xvfb, and the reason why a test is skipped without it."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

import pytest


def require(*programs: str) -> None:
    """Skip a test if a program is missing; fail where the gate should have installed it."""
    missing = [each for each in programs if shutil.which(each) is None]
    if missing:
        text = f"{' and '.join(missing)} not installed"
        pytest.fail(text) if os.environ.get("CI") == "true" else pytest.skip(text)


@contextmanager
def x_server(size: str, *options: str) -> Iterator[tuple[subprocess.Popen, str]]:
    """Yield the process and the name of a display with a screen of ``WIDTHxHEIGHT`` pixels."""
    require("Xvfb")
    reading, writing = os.pipe()
    process = subprocess.Popen(
        [
            "Xvfb",
            "-displayfd",
            str(writing),
            "-screen",
            "0",
            f"{size}x24",
            *options,
            "-nolisten",
            "tcp",
        ],
        pass_fds=[writing],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.close(writing)
    with os.fdopen(reading) as stream:
        number = stream.readline().strip()
    try:
        yield process, f":{number}"
    finally:
        process.terminate()
        process.wait(10)
