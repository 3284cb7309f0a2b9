"""Readers that continue after errors, with one error of each kind, its location and its effect."""

import pytest
from formats.broken_text import ANIM, OBJ, PLY, gone_on
from formats.bvh_text import GOOD as BVH
from formats.mesh_faults import MESH_FAULTS
from formats.motion_faults import MOTION_FAULTS
from formats.skel_text import GOOD as SKEL
from formats.skin_text import GOOD as SKIN

from viewer.errors import ViewerError
from viewer.formats import Source, anim, bvh, obj, ply, skel, skin


@pytest.mark.parametrize(
    "case", MESH_FAULTS + MOTION_FAULTS, ids=lambda case: f"{case[1]}, {case[4]!r}"[:40]
)
def test_each_error_is_reported_with_its_location(case):
    module, name, text, old, new, fault, part, places = case
    assert old in text
    broken = text.replace(old, new, 1)
    assert gone_on(module, broken, name)[1] == [(fault, 1, part, places)]
    with pytest.raises(ViewerError):  # without collecting errors, the reader refuses the file
        module.read(Source(name, broken.encode()))


@pytest.mark.parametrize(
    ("module", "name", "text"),
    [(skin, "a.skin", SKIN), (obj, "a.obj", OBJ), (ply, "a.ply", PLY), (skel, "a.skel", SKEL),
     (bvh, "a.bvh", BVH), (anim, "a.anim", ANIM)],
)  # fmt: skip
def test_valid_files_have_no_errors(module, name, text):
    assert gone_on(module, text, name)[1] == []
