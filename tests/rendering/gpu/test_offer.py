"""Messages about OpenGL versions that are too old or only appear to be new enough."""

import pytest

from viewer.rendering.gpu.context import OpenGLOffer, offer_text

MESA = "llvmpipe (LLVM 15.0.6, 256 bits)"


@pytest.mark.parametrize(
    ("version", "language", "environment", "needed", "offered"),
    [
        ("3.1 Mesa 22.3.6", "4.50", {}, "OpenGL 3.3", "offers 3.1 ("),
        ("2.1 Mesa 22.3.6", "1.20", {}, "OpenGL 3.3", "offers 2.1 with GLSL 1.20 ("),
        ("OpenGL ES 3.2 Mesa", "OpenGL ES GLSL ES 3.20", {}, "OpenGL 3.3", "offers 3.2 with GLSL"),
        ("3.3 (Core Profile)", "1.50", {}, "GLSL 3.30", "offers GLSL 1.50 ("),
        # The override applies to core profiles; compatibility profiles do not report it.
        (
            "4.5 (Compatibility Profile) Mesa 22.3.6",
            "4.50",
            {"MESA_GLSL_VERSION_OVERRIDE": "130"},
            "GLSL 3.30",
            "offers GLSL 1.30 (",
        ),
        ("4.5 (Compatibility Profile)", "4.50", {}, "core profile of OpenGL 3.3", "offers 4.5 "),
        ("4.5 (Compatibility)", "4.50", {"MESA_GLSL_VERSION_OVERRIDE": "x"}, "core", "offers 4.5 "),
        ("", "", {}, "OpenGL 3.3", "offers 0.0"),
    ],
)
def test_required_and_available_versions_are_reported(
    version, language, environment, needed, offered
):
    text = offer_text(OpenGLOffer(version, language, MESA), environment)
    before, after = text.split("; ")
    assert needed in before and offered in after and f"renderer {MESA}" in after
    assert all(f"{name}={value} is set" in after for name, value in environment.items())


def test_no_message_states_that_a_newer_version_is_too_old():
    for version in ("3.3", "4.5", "4.6 (Core Profile)"):
        text = offer_text(OpenGLOffer(version, "4.60", MESA), {"MESA_GLSL_VERSION_OVERRIDE": "140"})
        assert "OpenGL 3.3 is needed" not in text and "GLSL 1.40" in text
