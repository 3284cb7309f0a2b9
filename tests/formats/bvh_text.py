"""Small BVH files as text, for the tests of the reader."""

from __future__ import annotations

from viewer.formats import Source, bvh
from viewer.rig.skeleton_motion import SkeletonMotion

GOOD = """HIERARCHY
ROOT Hips
{
	OFFSET 0.0 0.0 0.0
	CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
	JOINT LeftUpLeg
	{
		OFFSET 0.1 0.0 0.0
		CHANNELS 3 Zrotation Xrotation Yrotation
		JOINT LeftFoot
		{
			OFFSET 0.0 -0.9 0.0
			CHANNELS 3 Zrotation Xrotation Yrotation
			End Site
			{
				OFFSET 0.0 0.0 0.2
			}
		}
	}
	JOINT Head
	{
		OFFSET 0.0 0.6 0.0
		CHANNELS 3 Zrotation Xrotation Yrotation
		End Site
		{
			OFFSET 0.0 0.2 0.0
		}
	}
}
MOTION
Frames: 2
Frame Time: 0.0333333
0.0 1.0 0.0 0 0 0 90 0 0 0 90 0 0 0 90
1.0 2.0 3.0 10 20 30 0 0 0 0 0 0 0 0 0
"""


def read(text: str | bytes) -> tuple[SkeletonMotion, list[str]]:
    """Read a text; return also the warnings without the path."""
    data = text if isinstance(text, bytes) else text.encode()
    source = Source("a.bvh", data)
    motion = bvh.read(source)
    return motion, [line.removeprefix("a.bvh:").strip() for line in source.warnings]


def one_joint(channels: str, frames: str, extra: str = "") -> str:
    """Return a file of a root with these channels; the skeleton is 1.7 high."""
    count = len(channels.split())
    return (
        f"HIERARCHY ROOT a {{ OFFSET 0 0 0 CHANNELS {count} {channels} {extra} "
        f"End Site {{ OFFSET 0 1.7 0 }} }} MOTION Frames: {len(frames.splitlines())} "
        f"Frame Time: 0.04\n{frames}\n"
    )
