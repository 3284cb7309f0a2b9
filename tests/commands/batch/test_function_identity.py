"""Identity of functions: changes that --resume must detect, and differences that it must ignore."""

from functools import partial
from typing import Any

from viewer.commands._batch.calling import identity_of


def defined(source: str) -> Any:
    """Return a newly compiled function, as in another process."""
    names: dict[str, object] = {"__name__": "jobs"}
    exec(source, names)
    return names["job"]


def test_changed_functions_have_different_identities():
    sources = [
        "def job(item): return max(item.files)",
        "def job(item): return min(item.files)",
        "def job(item): return min(item.files, key=lambda one: one[0])",
        "def job(item): return min(item.files, key=lambda one: one[1])",
        "def job(item, scale=1.0): return min(item.files)",
        "def job(item, scale=2.0): return min(item.files)",
        "def outer(n):\n def job(item): return n\n return job\njob = outer(1)",
        "def outer(n):\n def job(item): return n\n return job\njob = outer(2)",
        "def outer(n):\n def job(item): return job(n)\n return job\njob = outer(2)",
    ]
    assert len({identity_of(defined(source)) for source in sources}) == len(sources)
    # Nested code and sets remain equal when they are created again.
    assert all(identity_of(defined(one)) == identity_of(defined(one)) for one in sources)


def scaled(factor, item):
    return factor


def test_bound_arguments_and_objects_are_included():
    class Job:
        def __init__(self, factor):
            self.factor = factor

        def run(self, item):
            return self.factor

    jobs = [partial(scaled, 1), partial(scaled, 2), partial(print, 1), scaled, Job(1).run]
    assert len({identity_of(job) for job in jobs}) == len(jobs)
    assert identity_of(partial(scaled, 2)) == identity_of(jobs[1])


def test_identity_does_not_depend_on_the_order_of_sets():
    # Small integers that collide in a set are stored in the order in which they are added.
    one, other = set(range(0, 17, 8)), set(range(16, -1, -8))
    assert [*one] != [*other]
    assert identity_of(partial(scaled, one)) == identity_of(partial(scaled, other))
    nested = [partial(scaled, {"a": (each,)}) for each in (one, other, {0, 8})]
    assert len({identity_of(job) for job in nested}) == 2
    sources = (f"def job(item, kinds=set({each})): return 1" for each in ("[0, 8]", "[8, 0]"))
    assert len({identity_of(defined(source)) for source in sources}) == 1
