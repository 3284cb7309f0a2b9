"""Materials changed by the weights of expressions, compared with hand calculation."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.errors import RigError
from viewer.formats.gltf.textures import transform_matrix
from viewer.rig.expressions import MaterialBinds
from viewer.rig.material import Material, Outline, Rim, Texture

TOON = Material(
    base_color=(0.5, 0.5, 0.5, 1.0),
    shade_color=(0.2, 0.2, 0.2),
    rim=Rim((0.0, 0.0, 0.0), matcap_factor=(1.0, 1.0, 1.0)),
    outline=Outline(0.01, color=(0.0, 0.0, 0.0)),
)


def binds(*rows: tuple[int, int, str, tuple[float, ...]]) -> MaterialBinds:
    shapes, materials, kinds, targets = zip(*rows, strict=True)
    return MaterialBinds(np.array(shapes), np.array(materials), kinds, np.array(targets))


def test_targets_of_several_expressions_are_added():
    found = binds(
        (0, 0, "color", (1.0, 0.0, 0.5, 1.0)), (1, 0, "color", (0.5, 1.0, 0.5, 0.0))
    ).changed([TOON], np.array([0.5, 0.25]))
    # 0.5 + 0.5 (1 - 0.5), 0.5 + 0.5 (0 - 0.5) + 0.25 (1 - 0.5), 0.5, 1 + 0.25 (0 - 1)
    assert_allclose(found[0].base_color, (0.75, 0.375, 0.5, 0.75), atol=1e-12)


def test_each_colour_has_its_own_target():
    red = (1.0, 0.0, 0.0, 1.0)
    kinds = ("shadeColor", "rimColor", "matcapColor", "outlineColor", "emissionColor")
    found = binds(*((0, 0, kind, red) for kind in kinds)).changed([TOON], np.array([0.5]))[0]
    assert found.base_color == TOON.base_color
    assert_allclose(found.shade_color, (0.6, 0.1, 0.1), atol=1e-12)
    assert_allclose(found.rim.color, (0.5, 0, 0), atol=1e-12)
    assert_allclose(found.rim.matcap_factor, (1, 0.5, 0.5), atol=1e-12)
    assert_allclose(found.outline.color, (0.5, 0, 0), atol=1e-12)
    assert_allclose(found.emissive, (0.5, 0, 0), atol=1e-12)


def test_only_active_materials_change():
    rows = binds((0, 1, "color", (1.0, 0, 0, 1)), (1, 0, "color", (1.0, 0, 0, 1)))
    assert [*rows.changed([TOON, TOON], np.array([1.0, 0.0]))] == [1]
    assert rows.changed([TOON, TOON], np.zeros(0)) == {}
    assert rows.n_materials == {0: 1, 1: 1}


def test_colours_stay_in_range():
    found = binds((0, 0, "color", (1.0, 0.0, 0.0, 1.0))).changed([TOON], np.array([3.0]))
    assert found[0].base_color == (1.0, 0.0, 0.0, 1.0)


@pytest.mark.parametrize("angle", [0.0, 0.5, -2.0])
@pytest.mark.parametrize("weight", [0.25, 1.0])
def test_scale_and_offset_are_blended_and_rotation_is_kept(angle, weight):
    start = np.array([2.0, 0.5]), np.array([0.1, 0.2])
    target = np.array([1.0, 3.0]), np.array([-0.3, 0.7])
    before = transform_matrix(start[1], angle, start[0])
    material = Material(base_texture=Texture("a", transform=before), rim=Rim(), outline=None)
    rows = binds((0, 0, "transform", (*target[0], *target[1])))
    found = rows.changed([material], np.array([weight]))[0].base_texture.matrix
    scale, offset = (a + weight * (b - a) for a, b in zip(start, target, strict=True))
    assert_allclose(found, transform_matrix(offset, angle, scale), atol=1e-12)


def test_mirrored_texture_remains_mirrored():
    before = transform_matrix(np.zeros(2), 0.3, np.array([1.0, -2.0]))
    material = Material(base_texture=Texture("a", transform=before))
    rows = binds((0, 0, "transform", (1.0, -2.0, 0.5, 0.0)))
    found = rows.changed([material], np.array([1.0]))[0].base_texture.matrix
    expected = transform_matrix(np.array([0.5, 0.0]), 0.3, np.array([1.0, -2.0]))
    assert_allclose(found, expected, atol=1e-12)
    assert math.isfinite(found.sum())


@pytest.mark.parametrize("scale", [(-1.0, 1.0), (-2.0, -1.0), (1.0, -1.0), (0.0, 2.0)])
@pytest.mark.parametrize("weight", [0.25, 1.0])
def test_negative_scales_without_rotation_are_blended(scale, weight):
    before = transform_matrix(np.array([0.5, 0.25]), 0.0, np.array(scale))
    material = Material(base_texture=Texture("a", transform=before))
    rows = binds((0, 0, "transform", (3.0, 1.0, 0.0, 0.0)))
    found = rows.changed([material], np.array([weight]))[0].base_texture.matrix
    blended = (1.0 - weight) * np.array(scale) + weight * np.array([3.0, 1.0])
    offset = (1.0 - weight) * np.array([0.5, 0.25])
    assert_allclose(found, transform_matrix(offset, 0.0, blended), atol=1e-12)


def test_unknown_kinds_are_refused():
    with pytest.raises(RigError, match="glow"):
        binds((0, 0, "glow", (1.0, 0, 0, 1)))
