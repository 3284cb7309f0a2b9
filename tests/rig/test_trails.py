"""Paths of joints and captured points, with gaps."""

from __future__ import annotations

import numpy as np
import pytest
from hand_made import *  # noqa: F403
