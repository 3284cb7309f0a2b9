"""A strict and slow BVH reader that works line by line and shares no code with the viewer. It
requires the line layout expected by Blender's importer: "{" on its own line, then OFFSET, then
CHANNELS.
"""

import math
import re
from pathlib import Path

from builders import axis_turn


class PlainBvh:
    """Names, parents, offsets, channels and frames as written in a file."""

    def __init__(self, path: Path) -> None:
        self.text = path.read_bytes().decode("utf-8")
        assert "\r" not in self.text and self.text.endswith("\n")
        self.lines = [line.strip() for line in self.text.split("\n")]
        self.names: list[str] = []
        self.parents: list[int] = []
        self.offsets: list[list[float]] = []
        self.channels: list[list[str]] = []
        self.ends: dict[int, list[float]] = {}
        assert self.lines[0] == "HIERARCHY"
        at = self._joints(1)
        assert self.lines[at] == "MOTION"
        self.n_frames = int(re.fullmatch(r"Frames: (\d+)", self.lines[at + 1])[1])
        self.frame_time = float(re.fullmatch(r"Frame Time: (\d\.\d{7,})", self.lines[at + 2])[1])
        rows = [line for line in self.lines[at + 3 :] if line]
        assert len(rows) == self.n_frames
        number = re.compile(r"-?\d+\.\d+")
        self.frames = []
        for row in rows:
            words = row.split(" ")
            assert all(number.fullmatch(word) for word in words)
            self.frames.append([float(word) for word in words])
            assert len(words) == sum(map(len, self.channels))

    def _joints(self, at: int) -> int:
        open_joints: list[int] = []
        while True:
            line = self.lines[at]
            if line == "}":
                open_joints.pop()
                at += 1
                if not open_joints:
                    return at
            elif line == "End Site":
                assert self.lines[at + 1] == "{" and self.lines[at + 3] == "}"
                self.ends[open_joints[-1]] = self._offset(at + 2)
                at += 4
            else:
                keyword, name = re.fullmatch(r"(ROOT|JOINT) ?(.*)", line).groups()
                assert (keyword == "ROOT") == (not self.names)
                assert self.lines[at + 1] == "{"
                self.parents.append(open_joints[-1] if open_joints else -1)
                open_joints.append(len(self.names))
                self.names.append(name)
                self.offsets.append(self._offset(at + 2))
                count, *channels = self.lines[at + 3].removeprefix("CHANNELS ").split(" ")
                assert int(count) == len(channels) in (3, 6)
                self.channels.append(channels)
                at += 4

    def _offset(self, at: int) -> list[float]:
        keyword, *numbers = self.lines[at].split(" ")
        assert keyword == "OFFSET" and len(numbers) == 3
        return [float(number) for number in numbers]

    def places(self, frame: int) -> dict[str, list[float]]:
        """Return the position of every joint."""
        return {name: place for name, (_, place) in self.joints(frame).items()}

    def joints(self, frame: int) -> dict[str, tuple[list[list[float]], list[float]]]:
        """Return the world rotation and position of every joint."""
        values = iter(self.frames[frame])
        matrices, places = [], []
        for joint, parent in enumerate(self.parents):
            offset = list(self.offsets[joint])
            turn = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            for channel in self.channels[joint]:
                axis, value = "XYZ".index(channel[0]), next(values)
                if channel.endswith("position"):
                    offset[axis] = value
                else:
                    turn = product(turn, axis_turn(axis, math.radians(value)).tolist())
            if parent < 0:
                matrices.append(turn)
                places.append(offset)
            else:
                above = matrices[parent]
                matrices.append(product(above, turn))
                moved = [a * offset[0] + b * offset[1] + c * offset[2] for a, b, c in above]
                places.append([a + b for a, b in zip(places[parent], moved, strict=True)])
        return dict(zip(self.names, zip(matrices, places, strict=True), strict=True))


def product(a: list[list[float]], b: list[list[float]]) -> list[list[float]]:
    """Return the matrix product."""
    return [[x * p + y * q + z * r for p, q, r in zip(*b, strict=True)] for x, y, z in a]
