"""VRM 0.x and 1.0: properties of humanoid characters in glTF files."""

from __future__ import annotations
