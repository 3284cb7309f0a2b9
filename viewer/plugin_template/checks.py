"""A lint check: meshes with more triangles than a budget."""

from collections.abc import Iterator

from viewer.linting import Code, Finding, Subject

MOST = 20_000

CODES = {"PBUDGET": Code("warning", "more triangles than the budget", "simplify the mesh")}


def check(subject: Subject) -> Iterator[Finding]:
    """Yield the findings about an actor."""
    mesh = subject.actor.figure.mesh
    if mesh is not None and mesh.n_triangles > MOST:
        yield subject.found(
            "PBUDGET: {n} triangles, {excess} more than {most}",
            n=mesh.n_triangles,
            excess=mesh.n_triangles - MOST,
            most=MOST,
        )
