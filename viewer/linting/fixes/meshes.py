"""Fixes of meshes: winding, normals and spikes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.diagnostics import Diagnostic, note
from viewer.linting._finding import Finding
from viewer.linting._subject import Subject
from viewer.linting._surface import surface_of
from viewer.phrases import agree, counted
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.mesh import vertex_normals


def fix(subject: Subject, finding: Finding) -> Diagnostic | None:
    """Replace the mesh of the actor's figure; None if nothing changes."""
    figure = subject.actor.figure
    mesh = figure.require_mesh()
    vertices, code = finding.vertices, finding.code
    if code in ("M002", "M003"):
        triangles, normals = mesh.triangles.copy(), mesh.normals.copy()
        triangles[finding.triangles] = triangles[finding.triangles, ::-1]
        # Normals that agreed with the winding would oppose it.
        others = np.delete(triangles, finding.triangles, axis=0)
        wrong = np.setdiff1d(triangles[finding.triangles], others)
        facing = vertex_normals(mesh.positions, mesh.triangles)[wrong]
        wrong = wrong[np.einsum("va,va->v", facing, normals[wrong]) > 0.0]
        normals[wrong] *= -1.0
        corners = mesh.uv_triangles
        if corners is not None:
            corners = corners.copy()
            corners[finding.triangles] = corners[finding.triangles, ::-1]
        mesh = replace(mesh, triangles=triangles, uv_triangles=corners, normals=normals)
        subject.actor.figure = replace(figure, mesh=mesh)
        return note(
            "X007.winding: {figure}: {code} fixed: winding of {n} reversed",
            figure=subject.actor.name,
            code=code,
            n=counted(len(finding.triangles), "triangle"),
        )
    if code == "M013":
        return _flattened(subject, finding)
    normals = mesh.normals.copy()
    if code == "M007":
        normals[vertices] = vertex_normals(mesh.positions, mesh.triangles)[vertices]
    else:
        normals[vertices] = unit(normals[vertices])
    if not normals[vertices].any(axis=1).all() or (normals == mesh.normals).all():
        return None  # vertices without triangles have no normal
    subject.actor.figure = replace(figure, mesh=replace(mesh, normals=normals))
    return note(
        "X007.normals: {figure}: {code} fixed: {n} {done}",
        figure=subject.actor.name,
        code=code,
        n=counted(len(vertices), "normal"),
        done="computed again" if code == "M007" else "normalised",
    )


def _flattened(subject: Subject, finding: Finding) -> Diagnostic | None:
    """Move vertices that stick out to the middle of their neighbours, those at one place together.

    Of two spikes side by side, each is first moved without the other.
    """
    figure = subject.actor.figure
    mesh, surface = figure.require_mesh(), surface_of(figure)
    points, spikes = mesh.positions.copy(), np.unique(surface.place[finding.vertices])
    start, end = surface.edges.T
    away = ~np.isin(end, spikes)
    for spike in spikes.tolist():
        around = end[(start == spike) & away]
        if len(around):
            points[surface.place == spike] = mesh.positions[around].mean(axis=0)
    moved = np.linalg.norm(points - mesh.positions, axis=1)
    if not moved.any():
        return None
    normals = mesh.normals.copy()
    changed = np.isin(surface.place, np.append(spikes, end[np.isin(start, spikes)]))
    normals[changed] = vertex_normals(points, mesh.triangles)[changed]
    subject.actor.figure = replace(figure, mesh=replace(mesh, positions=points, normals=normals))
    return note(
        "X007.spikes: {figure}: M013 fixed: {n} moved to the middle of {their} neighbours, by up "
        "to {most}",
        figure=subject.actor.name,
        n=counted(len(spikes), "place"),
        their=agree(len(spikes), "its", "their"),
        most=subject.length(float(moved.max())),
    )
