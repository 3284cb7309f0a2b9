"""Golden images: their location, and the ones that a run re-renders.

``VIEWER_UPDATE_GOLDEN`` holds their names, or ``all``; ``make golden NAME…`` sets it. Look at every
re-rendered image before committing it.
"""

import os
from pathlib import Path

import pytest

GOLDEN = Path(__file__).resolve().parent / "golden"
ALL = "all"


def asked() -> set[str]:
    """Return the names of the images to be re-rendered, or ``all``."""
    return set(os.environ.get("VIEWER_UPDATE_GOLDEN", "").split())


def is_redrawn(name: str) -> bool:
    """Return whether this run re-renders an image."""
    return bool(asked() & {name, ALL})


def name_of(item: pytest.Item) -> str:
    """Return the image name of a test marked ``golden``, or an empty name for other tests."""
    mark = item.get_closest_marker("golden")
    if mark is None:
        return ""
    given = item.callspec.params if hasattr(item, "callspec") else {}
    return str(mark.args[0]).format(**given)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Deselect all tests except those of re-rendered images."""
    names = asked()
    if not names:
        return
    left = [item for item in items if name_of(item) and is_redrawn(name_of(item))]
    unknown = names - {ALL} - {name_of(item) for item in left}
    if unknown:
        raise pytest.UsageError(f"no stored picture is called {', '.join(sorted(unknown))}")
    config.hook.pytest_deselected(items=[item for item in items if item not in left])
    items[:] = left
