"""Keyed transforms: evaluation, resulting poses, and editing of keys."""

from __future__ import annotations
