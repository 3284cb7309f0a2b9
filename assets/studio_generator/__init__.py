"""The studio that lights metallic-roughness surfaces, and the matcaps."""
