"""Properties of materials for ``viewer info``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from viewer.phrases import printable

if TYPE_CHECKING:
    from viewer.rig.material import Material

__all__ = ["describe_surface", "surface_words"]


def describe_surface(material: Material) -> dict[str, Any]:
    """Return the properties of a material other than one opaque texture."""
    if material.is_plain:
        return {}
    maps = {
        name.removesuffix("_texture"): texture.name
        for name, texture in material.textures.items()
        if name != "base_texture"
    }
    color = None if material.base_color is None else list(material.base_color)
    surface: dict[str, Any] = {"base_color": color, "maps": maps, "alpha": material.alpha_mode}
    if material.is_physical:
        surface |= {"metallic": material.metallic, "roughness": material.roughness}
    if material.shade_color is not None:
        surface["toon"] = _describe_toon(material)
    return surface


def _describe_toon(material: Material) -> dict[str, Any]:
    """Return the shade, rim light and outline of a toon material; None for what it lacks."""
    rim, outline = material.rim, material.outline
    toon: dict[str, Any] = {
        "shade_color": None if material.shade_color is None else list(material.shade_color),
        "shade_range": list(material.shade_range),
        "rim": None,
        "outline": None,
    }
    if rim is not None and rim.has_effect:
        matcap = None if rim.matcap is None else rim.matcap.name
        toon["rim"] = {"color": list(rim.color), "power": rim.power, "matcap": matcap}
    if outline is not None:
        color = list(outline.color)
        toon["outline"] = {"mode": outline.mode, "width": outline.width, "color": color}
    return toon


def surface_words(material: dict[str, Any]) -> list[str]:
    """Return the properties of ``describe_surface`` other than one texture, as text."""
    if "maps" not in material:
        return []
    words, toon = [], material.get("toon")
    if material["base_color"] is not None:
        words.append(f"colour {_numbers(material['base_color'])}")
    if toon is not None:
        words += _toon_words(toon)
    elif "metallic" in material:
        words.append(f"metallic {material['metallic']:.3g}, roughness {material['roughness']:.3g}")
    words += [f"{kind} {printable(file)}" for kind, file in material["maps"].items()]
    return words if material["alpha"] == "opaque" else [*words, f"alpha {material['alpha']}"]


def _toon_words(toon: dict[str, Any]) -> list[str]:
    words = [f"toon with shade colour {_numbers(toon['shade_color'])}"]
    rim, outline = toon["rim"], toon["outline"]
    if rim is not None:
        matcap = f", matcap {printable(rim['matcap'])}" if rim["matcap"] else ""
        words.append(f"rim light {_numbers(rim['color'])}{matcap}")
    if outline is not None:
        on_screen = outline["mode"] == "screen"
        width = f"{100.0 * outline['width']:.3g} %" if on_screen else f"{outline['width']:.3g} m"
        of = " of the picture's height" if on_screen else ""
        words.append(f"outline {width}{of}, colour {_numbers(outline['color'])}")
    return words


def _numbers(values: list[float]) -> str:
    return " ".join(f"{value:.3g}" for value in values)
