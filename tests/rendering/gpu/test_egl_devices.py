"""EGL devices of worker processes, on simulated machines with several graphics cards."""

import pytest

from viewer.rendering.gpu.context import device_count
from viewer.rendering.gpu.egl_devices import EglDevice, device_of_worker, egl_devices

SOFTWARE = EglDevice(2, None, True)
# EGL lists cards in a different order than CUDA.
CARDS = [EglDevice(0, 1), EglDevice(1, 0), SOFTWARE]
# This driver numbers only the card in CUDA_VISIBLE_DEVICES.
ONE_VISIBLE = [EglDevice(0, None), EglDevice(1, 0), SOFTWARE]


@pytest.mark.parametrize(
    ("devices", "visible", "chosen"),
    [
        (CARDS, "", [0, 1, 0]),
        (CARDS, "0", [1, 1, 1]),
        (CARDS, "1,0", [0, 0, 0]),
        (ONE_VISIBLE, "3", [1, 1, 1]),
        (CARDS, "GPU-5c0f", [0, 1, 0]),
        ([EglDevice(0), EglDevice(1)], "1", [0, 1, 0]),
        ([SOFTWARE], "0", [None, None, None]),
    ],
    ids=["in-turn", "by-cuda", "first", "relative", "uuid", "no-cuda", "software"],
)
def test_workers_draw_on_the_visible_card_or_take_cards_in_turn(devices, visible, chosen) -> None:
    assert [device_of_worker(rank, devices, visible) for rank in range(3)] == chosen


def test_listed_devices_are_those_used_by_contexts() -> None:
    devices = egl_devices()
    assert [one.index for one in devices] == [*range(device_count())]
