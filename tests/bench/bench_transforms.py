"""Cost of sampling keyed translation, rotation and scale of 70 joints at one time. The table of all
channels is compared with a loop that evaluates one channel at a time with numpy.
"""

import numpy as np
from measure import interleaved, report

from viewer.rigs.geometry.quaternion import slerp
from viewer.rigs.motion.transform_clip import TransformChannel, TransformClip, sample_transforms

N_JOINTS, N_KEYS, N_CALLS = 70, 100, 10
GOAL = 0.1  # milliseconds for all channels at one time


def clip(shares: bool, mode: str = "linear") -> TransformClip:
    """Return 210 channels of 100 keys with common or different times."""
    rng = np.random.default_rng(0)
    channels = []
    for joint in range(N_JOINTS):
        for path, width in (("translation", 3), ("rotation", 4), ("scale", 3)):
            own = np.sort(rng.uniform(0.0, 3.3, N_KEYS))
            times = np.arange(N_KEYS) / 30.0 if shares else own
            slopes = rng.normal(size=(N_KEYS, 2, width)) if mode == "cubic" else None
            values = rng.normal(size=(N_KEYS, width))
            channels.append(TransformChannel(joint, path, times, values, mode, slopes))
    return TransformClip(mode, tuple(channels), 0.0, 3.3)


def one_by_one(motion: TransformClip, time: float) -> list[np.ndarray]:
    """Return the values of all channels by a loop over channels."""
    found = []
    for channel in motion.channels:
        key = int(np.searchsorted(channel.times, time, side="right")) - 1
        key = min(max(key, 0), len(channel.times) - 2)
        h = channel.times[key + 1] - channel.times[key]
        u = min(max((time - channel.times[key]) / h, 0.0), 1.0)
        p0, p1 = channel.values[key], channel.values[key + 1]
        if channel.tangents is not None:
            b, a = channel.tangents[key, 1], channel.tangents[key + 1, 0]
            value = (2 * u**3 - 3 * u**2 + 1) * p0 + h * (u**3 - 2 * u**2 + u) * b
            value = value + (3 * u**2 - 2 * u**3) * p1 + h * (u**3 - u**2) * a
        elif channel.path == "rotation":
            ends = (p / np.linalg.norm(p) for p in (p0, p1))
            value = slerp(*ends, u)
        else:
            value = p0 + u * (p1 - p0)
        found.append(value)
    return found


def main(rounds: int = 30) -> None:
    """Print the time of each kind of clip next to that of the loop."""
    for title, motion in (
        ("shared times", clip(shares=True)),
        ("times of their own", clip(shares=False)),
        ("cubic", clip(shares=True, mode="cubic")),
    ):
        times = np.random.default_rng(1).uniform(0.0, 3.3, N_CALLS)
        work = {
            "one table": lambda motion=motion, times=times: [
                sample_transforms(motion, np.array([time])) for time in times
            ],
            "loop over channels": lambda motion=motion, times=times: [
                one_by_one(motion, time) for time in times
            ],
        }
        heading = f"{3 * N_JOINTS} channels of {N_KEYS} keys, {title}, {N_CALLS} calls"
        heading += f" (goal: {N_CALLS * GOAL:g} ms)"
        report(heading, interleaved(work, rounds), ("one table", "loop over channels"))


if __name__ == "__main__":
    main()
