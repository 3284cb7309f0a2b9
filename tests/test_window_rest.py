"""The idle window: frames that show the awaited event, then none."""

import pytest

from viewer.app.window import Rest

pytestmark = pytest.mark.slow


def test_awaited_event_is_followed_by_frames_showing_it():
    for at in range(1, 9):  # the frame that shows it, even the last before the window sleeps
        rest = Rest()
        for frame in range(at):
            rest.count(happened=frame % 4 == 0, awaits=True)
        drawn = 0
        for _ in range(12):
            rest.count(happened=False, awaits=False)
            drawn += rest.left >= 0
        # ImGui measures a window in its first frame, and shows it with its size in the second.
        assert drawn >= 2 and rest.left < 0


def test_waiting_times_out_when_nothing_happens():
    rest, drawn = Rest(), 0
    for _ in range(20):
        rest.count(happened=False, awaits=False)
        drawn += rest.left >= 0
    assert 0 < drawn < 5
