"""Collection of doctests from the modules that contain examples, one in fifteen."""

from collections.abc import Generator
from pathlib import Path

import pytest


@pytest.hookimpl(wrapper=True)
def pytest_collect_file(
    file_path: Path,
) -> Generator[None, list[pytest.Collector], list[pytest.Collector]]:
    """Drop the doctest collectors of modules without examples."""
    collectors = yield
    if not collectors or b">>> " in file_path.read_bytes():
        return collectors
    return [one for one in collectors if type(one) is pytest.Module]
