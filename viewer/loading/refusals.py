"""Errors about figures that a motion does not match."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from viewer.diagnostics import Diagnostic
from viewer.errors import RigError

__all__ = ["map_refusal", "model_refusal"]


def model_refusal(problem: RigError, path: Path | None) -> RigError:
    """Return the error for a requested model that does not match.

    Parameters
    ----------
    problem : RigError
        Reason why it does not match; returned unchanged if it refers to a file, such as a joint
        map.
    path : Path or None
        File of the motion.
    """
    cause = problem.cause
    if isinstance(cause, Diagnostic) and cause.path is not None:
        return problem
    return RigError(Diagnostic("F004.model", path, values={"problem": cause}))


def map_refusal(problem: RigError, path: Path | None) -> RigError:
    """Return the error for a joint map that matches no figure; see ``model_refusal``."""
    cause = problem.cause
    if isinstance(cause, Diagnostic) and cause.path is None:
        return RigError(replace(cause, path=path))
    return problem
