"""Reports of findings: one line each for people and editors, all data for programs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from viewer.diagnostics import SEVERITIES, described
from viewer.linting._finding import Finding
from viewer.phrases import as_data, counted, printable
from viewer.rigs.scene import Scene
from viewer.rigs.skeleton import joint_labels

if TYPE_CHECKING:
    from viewer.schemas import FindingData, LintData

_LISTED = 100  # maximum number of locations of a finding in JSON; the total is always included


def worst_first(findings: Sequence[Finding]) -> list[Finding]:
    """Return findings sorted by severity, worst first; stable within a severity."""
    return sorted(findings, key=lambda finding: -SEVERITIES.index(finding.severity))


def finding_text(finding: Finding) -> str:
    """Return one finding in the format of compilers, so that editors can jump to file and line."""
    return f"{finding}\n    {finding.title}; remedy: {finding.hint}"


def summary(findings: Sequence[Finding], n_files: int = 0) -> str:
    """Return the numbers by severity: ``1 error, 0 warnings, 3 notes in 2 files``."""
    counts = Counter(finding.severity for finding in findings)
    parts = [counted(counts[kind], kind) for kind in reversed(SEVERITIES)]
    return ", ".join(parts) + (f" in {counted(n_files, 'file')}" if n_files else "")


@as_data()
def describe(findings: Sequence[Finding], scene: Scene) -> LintData:
    """Return findings as data for JSON, worded as for the command line."""
    counts = Counter(finding.severity for finding in findings)
    return {
        "schema": "lint/1",
        "findings": [_describe(finding, scene) for finding in findings],
        "counts": {
            "error": counts["error"],
            "warning": counts["warning"],
            "note": counts["note"],
        },
        "bodies": [
            {
                "name": printable(actor.name),
                "model": actor.shape_space.model or None,
                "gender": actor.shape_space.gender or None,
            }
            for actor in scene.actors
            if actor.shape_space.title
        ],
    }


def _describe(finding: Finding, scene: Scene) -> FindingData:
    has_file = finding.file is not None and finding.file != Path()
    data = described(finding.diagnostic)
    return {
        "code": finding.code,
        "severity": finding.severity,
        "title": finding.title,
        "message": printable(finding.message, 2000),
        "hint": finding.hint,
        "file": printable(finding.file, 1000) if has_file else None,
        "line": finding.line,
        "pointer": finding.pointer,
        "actor": finding.actor,
        "name": printable(finding.name),
        "animation": printable(finding.motion) or None,
        "key": data["key"],
        "part": data["part"],
        "places": data["places"],
        "n_places": data["n_places"],
        "count": data["count"],
        "values": data["values"],
        "vertices": finding.vertices[:_LISTED].tolist(),
        "n_vertices": len(finding.vertices),
        "triangles": finding.triangles[:_LISTED].tolist(),
        "n_triangles": len(finding.triangles),
        "joints": finding.joints[:_LISTED].tolist(),
        "n_joints": len(finding.joints),
        "frames": finding.frames[:_LISTED].tolist(),
        "n_frames": len(finding.frames),
        "times": finding.times[:_LISTED].tolist(),
        "n_times": len(finding.times),
        "joint_names": _joint_names(finding, scene),
    }


def _joint_names(finding: Finding, scene: Scene) -> list[str]:
    if finding.actor is None or len(finding.joints) == 0:
        return []
    figure = scene.actors[finding.actor].figure
    if figure.points is not None:
        names: tuple[str, ...] = figure.points.names
    elif figure.skeleton is not None:
        names = joint_labels(figure.skeleton)
    else:
        return []
    some = finding.joints[:_LISTED].tolist()
    return [printable(names[joint]) if joint < len(names) else f"#{joint}" for joint in some]
