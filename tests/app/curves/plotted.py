"""A clip of the tiny rig in the Curves panel, and positions in its plot."""

import math

import numpy as np
from imgui_bundle import imgui

from viewer.rigs.motion.clip import Clip

ARM_X = 6  # rows of the tiny rig: three translations, three rotations of the root, then the arm
SIZE = (1180, 900)


def _channel(mode, keys):
    words = " ".join(f"{time} {value} {rule} {rule}" for time, value, rule in keys)
    return f"channel {{ extrapolate {mode} {mode} keys {len(keys)} {{ {words} }} }}\n"


def clip_text():
    """A clip that moves root x and rotates the arm about x; all other channels have one key."""
    still = [_channel("constant", [(0, value, "flat")]) for value in (0, 0, 0, 0.6, 0.3)]
    slide = _channel("linear", [(0, 0, "linear"), (2, 1, "linear")])
    wave = _channel("cycle", [(0, 0.2, "smooth"), (1, 0.6, "smooth"), (2, -0.2, "smooth")])
    rest = [_channel("constant", [(0, value, "flat")]) for value in (0, -0.1)]
    return f"animation {{ range 0 2 numchannels 9\n{slide}{''.join(still)}{wave}{''.join(rest)}}}"


def _clip(hand) -> Clip:
    return hand.state.actor.clip


def _arm(hand):
    return _clip(hand).channels[ARM_X]


def _center(hand, label):
    x0, y0, x1, y1 = hand.state.item_rects[label]
    return (x0 + x1) / 2, (y0 + y1) / 2


def _scale(hand):
    """Pixels per second and per degree, measured between two drawn keys."""
    (x0, y0), (x1, y1) = _center(hand, "key arm.x 0"), _center(hand, "key arm.x 1")
    times, values = _arm(hand).times, np.degrees(_arm(hand).values)
    return (x1 - x0) / (times[1] - times[0]), (y1 - y0) / (values[1] - values[0])


def _at(hand, time, degrees):
    """Return the screen position of a time and a value."""
    (x0, y0), (across, up) = _center(hand, "key arm.x 0"), _scale(hand)
    return (
        x0 + across * (time - _arm(hand).times[0]),
        y0 + up * (degrees - math.degrees(_arm(hand).values[0])),
    )


# Tangents


def _pick(hand, label, number):
    """Choose an entry of a drop-down list, which opens upwards if there is no room below."""
    hand.click(label)
    hand.step(2)
    popup = imgui.internal.find_window_by_name("##Combo_00")
    line = imgui.get_style().item_spacing.y + imgui.get_font_size()
    hand.click((popup.pos.x + 12, popup.pos.y + 8 + (number + 0.4) * line))
    hand.step(2)


def _type_into(hand, label, text):
    hand.click(hand.place(label, 0.3))
    hand.key("a", "ctrl")
    hand.type(text)
    hand.key("enter")
    hand.step(2)
