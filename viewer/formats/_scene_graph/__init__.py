"""Files that describe a tree of nodes (glTF, FBX): their contents, and conversion to figures."""

from __future__ import annotations
