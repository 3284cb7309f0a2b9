"""Small files for tests of errors, and functions that read them tolerantly."""

from typing import Any

from faults import Fault, fault_of

from viewer.diagnostics import Collector
from viewer.formats import Source

OBJ = """v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vn 0 0 1
f 1//1 2//1 3//1 4//1
f 1 2 3
"""
PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
1 1 0
0 1 0
3 0 1 2
3 0 2 3
"""
ANIM = """animation {
range 0 1
numchannels 1
channel { extrapolate constant constant keys 3 {
0 0 flat flat
0.5 1 flat flat
1 2 flat flat } }
}
"""


def gone_on(
    module: Any, text: str, name: str
) -> tuple[Any, list[tuple[Fault, int, str, list[int]]]]:
    """Return the contents, and each recovered error with its count, part and locations."""
    source = Source(name, text.encode(), diagnostics=Collector(keeps_errors=True))
    content = module.read(source)
    faults = [
        (fault_of(f), f.count, f.part, [] if f.places is None else f.places.tolist())
        for f in source.diagnostics.errors
    ]
    return content, faults
