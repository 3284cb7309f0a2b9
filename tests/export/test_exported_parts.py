"""Exporters write hidden parts, and say so."""

from dataclasses import replace

import numpy as np

import viewer
from viewer.export import export


def test_hidden_parts_are_written(tmp_path):
    actor = viewer.load().actors[0]
    mesh = actor.figure.mesh
    parts = np.arange(mesh.n_triangles) % 2
    mesh = replace(mesh, parts=("even", "odd"), triangle_parts=parts)
    actor.figure = replace(actor.figure, mesh=mesh)
    actor.hidden_parts = frozenset({1})
    notes = export(actor, tmp_path / "fox.ply")
    assert [note.values for note in notes if note.key == "X005.hidden-parts"] == [{"n": 1}]
    written = viewer.load(tmp_path / "fox.ply").actors[0].figure.mesh
    assert written.n_triangles == mesh.n_triangles
