"""``.anim`` files as text for tests, and functions that read them."""

from faults import Fault, warnings_of

from viewer.formats import Source, read
from viewer.rig.motion.clip import Clip

ONE = "channel { extrapolate cycle bounce keys 2 { 0 1 flat smooth 2 3 linear -0.5 } }"
GOOD = f"animation {{ range -1 4 numchannels 1 {ONE} }}"


def parse(text: str) -> tuple[Clip, list[Fault]]:
    source = Source("walk.anim", text.encode())
    clip = read(source)
    assert isinstance(clip, Clip)
    return clip, warnings_of(source.diagnostics)
