"""Shader texts in GLSL ES, for browsers."""

import pytest

from viewer.rendering.shader_text import embedded_text
from viewer.rigs.skinning import METHODS


@pytest.mark.parametrize("method", METHODS)
def test_embedded_texts_begin_with_their_version_and_are_composed(method):
    text = embedded_text("skin.vert", method, ("AFFINE_PALETTE",))
    lines = text.splitlines()
    assert lines[0] == "#version 300 es" and "#define AFFINE_PALETTE" in lines
    assert text.count("#version") == 1 and "#pragma" not in text and "#line" not in text
    assert "vec3 inverse_transposed(" in text and "void skin(" in text and "//" not in text
