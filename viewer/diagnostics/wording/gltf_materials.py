"""Messages about materials, textures and images of glTF files."""

MESSAGES = {
    "F005.gltf-image": "{problem:text}; drawn without this image",
    "F005.gltf-format": "{found:text} images are not supported; drawn without this image",
    "F005.gltf-texture": "no image; drawn untextured",
    "F006.gltf-material": "{problem:text}; ignored",
    "F006.gltf-range": "expected {limits:text}, found {found:text}; {used:text} used",
    "F006.gltf-choice": "expected {choices:or}, found {found:quoted}; {used:quoted} used",
    "F007.gltf-not-drawn": "{extension:text} not drawn ({n:#material})",
    "F007.gltf-glossiness": "KHR_materials_pbrSpecularGlossiness is approximated by metallic and "
    "roughness ({n:#material})",
    "F007.gltf-toon": "{n:#toon material|is|are} lit by the white key light only{names:+; not "
    "drawn: {:list}}",
}

PHRASES: dict[str, str] = {}
