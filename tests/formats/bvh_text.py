"""Small BVH files as text, for tests of the reader."""

from faults import Fault, warnings_of

from viewer.diagnostics import Phrase
from viewer.formats import Source, bvh
from viewer.rigs.motion.skeleton_motion import SkeletonMotion

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


def read(text: str | bytes) -> tuple[SkeletonMotion, list[Fault | Phrase]]:
    """Read a text; return the motion, its warnings as (key, line, values), and the estimates."""
    data = text if isinstance(text, bytes) else text.encode()
    source = Source("a.bvh", data)
    motion = bvh.read(source)
    guesses = [] if motion.unit_note is None else [motion.unit_note]
    return motion, [*warnings_of(source.diagnostics), *guesses, *motion.up_notes]


def one_joint(channels: str, frames: str, extra: str = "") -> str:
    """Return a file with these channels of the root; the skeleton is 1.7 high."""
    count = len(channels.split())
    return (
        f"HIERARCHY ROOT a {{ OFFSET 0 0 0 CHANNELS {count} {channels} {extra} "
        f"End Site {{ OFFSET 0 1.7 0 }} }} MOTION Frames: {len(frames.splitlines())} "
        f"Frame Time: 0.04\n{frames}\n"
    )


def person(scale: float = 1.0) -> str:
    """Return a standing person 1.7 tall with hips, knees and a head. In the second frame the root
    is at (0.5, 0.9, 0.25) and rotated by 90 degrees about z.
    """

    def offset(*place: float) -> str:
        return "OFFSET " + " ".join(f"{scale * number:.6f}" for number in place)

    turns = "CHANNELS 3 Zrotation Yrotation Xrotation"

    def leg(side: str, x: float) -> str:
        hip, knee = offset(x, -0.05, 0), offset(0, -0.4, 0)
        below = f"JOINT {side}_knee {{ {knee} {turns} End Site {{ {offset(0, -0.45, 0)} }} }}"
        return f"JOINT {side}_hip {{ {hip} {turns} {below} }}\n"

    root = "CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation"
    rest = " 0 0 0" * 5
    first, second = (
        " ".join(f"{scale * number:.6f}" for number in place)
        for place in ((0, 0.9, 0), (0.5, 0.9, 0.25))
    )
    return (
        f"HIERARCHY ROOT pelvis {{ {offset(0, 0, 0)} {root}\n"
        + leg("left", 0.1)
        + leg("right", -0.1)
        + f"JOINT head {{ {offset(0, 0.6, 0)} {turns} End Site {{ {offset(0, 0.2, 0)} }} }} }}\n"
        f"MOTION Frames: 2 Frame Time: 0.1\n{first} 0 0 0{rest}\n{second} 90 0 0{rest}\n"
    )


PERSON_JOINTS = ("pelvis", "left_hip", "left_knee", "right_hip", "right_knee", "head")
PERSON_TURNED = [
    [0.5, 0.9, 0.25],
    [0.55, 1.0, 0.25],
    [0.95, 1.0, 0.25],
    [0.55, 0.8, 0.25],
    [0.95, 0.8, 0.25],
    [-0.1, 0.9, 0.25],
]
"""Joint positions of ``person()`` in the second frame, where (x, y) at rest becomes (-y, x)."""
