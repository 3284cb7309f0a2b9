"""Notes about materials and names that differ between two figures."""

from dataclasses import replace

import numpy as np

from viewer.rig.blendshapes import BlendShapes
from viewer.rig.comparison import compare, content_notes
from viewer.rig.figure import Figure
from viewer.rig.material import Material, Outline, Rim
from viewer.rig.mesh import Mesh
from viewer.rig.scene import Actor

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])


def figure(*materials: Material, parts=("coat", "hat"), **more) -> Figure:
    mesh = Mesh(
        CORNERS,
        np.tile([0.0, 0.0, 1.0], (3, 1)),
        np.array([[0, 1, 2]], dtype=np.int32),
        materials=materials,
        triangle_materials=np.zeros(1, np.int32) if materials else None,
        parts=parts,
        triangle_parts=np.zeros(1, np.int32) if parts else None,
    )
    return Figure("a", mesh, **more)


def test_changed_materials_and_unmatched_names_are_noted() -> None:
    first = figure(Material("skin"), Material("cloth"))
    skin = Material("skin", base_color=(1.0, 0.0, 0.0, 1.0), roughness=0.2)
    second = figure(skin, Material("metal"), parts=("coat", "belt"))
    found = [note.message for note in content_notes(first, second)]
    assert found == [
        "parts only in the first: hat",
        "parts only in the second: belt",
        "materials only in the first: cloth",
        "materials only in the second: metal",
        'material "skin" differs: base color, roughness',
    ]
    assert content_notes(first, first) == []
    # Missing materials or parts in a format are not a difference.
    assert content_notes(first, figure(parts=())) == []


def test_rim_lights_and_outlines_are_compared_by_value() -> None:
    one, same, other = (
        Material("a", rim=Rim((0.5, 0.0, 0.0)), outline=Outline(width), is_physical=True)
        for width in (0.01, 0.01, 0.02)
    )
    assert content_notes(figure(one), figure(same)) == []
    (note,) = content_notes(figure(one), figure(other))
    assert note.message == 'material "a" differs: outline'


def test_offsets_of_blend_shapes_are_compared() -> None:
    offsets = np.zeros((1, 3, 3))
    first = figure(blend_shapes=BlendShapes(("smile",), offsets))
    offsets[0, 2] = 0.0, 3.0, 4.0
    second = replace(first, blend_shapes=BlendShapes(("smile",), offsets))
    measures = {one.name: one for one in compare(Actor(first), Actor(second)).measures}
    assert measures["blend shapes"].maximum == 5.0
