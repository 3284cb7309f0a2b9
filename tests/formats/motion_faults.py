"""Skeleton and motion files with one error each, and the reported error."""

from typing import Any

from faults import Fault
from formats.broken_text import ANIM
from formats.bvh_text import GOOD as BVH
from formats.skel_text import GOOD as SKEL

from viewer.formats import anim, bvh, skel

# (module, name, text, old, new, fault, part, places)
MOTION_FAULTS: list[tuple[Any, str, str, str, str, Fault, str, list[int]]] = [
    (
        skel,
        "a.skel",
        SKEL,
        "offset 0 1 0",
        "offset 0 nan 0",
        (
            "F003.number",
            10,
            {
                "item": "offset of joint arm",
                "found": b"nan",
            },
        ),
        "joints",
        [1],
    ),
    (
        skel,
        "a.skel",
        SKEL,
        "offset 0 1 0",
        "offset 0 1",
        (
            "F002.width",
            10,
            {
                "item": "offset of joint arm",
                "expected": 3,
                "found": 2,
            },
        ),
        "joints",
        [1],
    ),
    (
        skel,
        "a.skel",
        SKEL,
        "pose 0.5",
        "pose up",
        (
            "F002.number",
            8,
            {"item": "pose of joint root", "found": b"up"},
        ),
        "items",
        [0],
    ),
    (
        bvh,
        "a.bvh",
        BVH,
        "0.1 0.0 0.0",
        "0.1 nan 0.0",
        (
            "F003.number",
            8,
            {
                "item": "OFFSET of joint LeftUpLeg",
                "found": b"nan",
            },
        ),
        "joints",
        [1],
    ),
    (
        anim,
        "a.anim",
        ANIM,
        "0.5 1",
        "0.5 nan",
        (
            "F003.number",
            6,
            {
                "where": "channel 0, key 1",
                "found": b"nan",
                "begins": None,
                "item": "channel 0, key 1: value",
            },
        ),
        "channels",
        [0],
    ),
    (
        anim,
        "a.anim",
        ANIM,
        "keys 3",
        "keys 4",
        (
            "F002.anim-keys",
            4,
            {"where": "channel 0", "found": 3, "begins": None, "expected": 4},
        ),
        "channels",
        [0],
    ),
    (
        anim,
        "a.anim",
        ANIM,
        "channels 1",
        "channels 2",
        (
            "F002.anim-channels",
            3,
            {"where": "animation", "found": 1, "begins": None, "expected": 2},
        ),
        "",
        [],
    ),
]
