"""Motions for the tests of ``viewer render``, and their images."""

import numpy as np
from PIL import Image


def anim_text(end: float, channels: int, moving: dict[int, tuple[float, float]]) -> str:
    """Return a clip from 0 to ``end``, with channels of 0 or linear from one value to another."""
    lines = ["animation {", f"range 0 {end}", f"numchannels {channels}"]
    for channel in range(channels):
        low, high = moving.get(channel, (0.0, 0.0))
        keys = f"0 {low} linear linear\n{end} {high} linear linear"
        lines.append(f"channel {{\nextrapolate constant constant\nkeys 2 {{\n{keys}\n}}\n}}")
    return "\n".join([*lines, "}"])


def picture(path) -> np.ndarray:
    return np.array(Image.open(path).convert("RGBA")).astype(int)


def frames(path) -> list[np.ndarray]:
    import av  # optional

    with av.open(str(path)) as container:
        return [f.to_ndarray(format="rgb24").astype(int) for f in container.decode(video=0)]


def names(folder, *suffixes) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if path.suffix in suffixes)
