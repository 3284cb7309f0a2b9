"""Cached results: count, lifetime, and use by several threads."""

import gc
import threading
import weakref

from viewer.rig.memo import Memo


class Owner:
    """An object that supports weak references."""


def test_result_is_computed_once() -> None:
    memo: Memo[Owner, list[int]] = Memo()
    owner, made = Owner(), []
    for _ in range(3):
        assert memo.get(owner, "a", lambda: made.append(1) or [7]) == [7]
    assert made == [1]


def test_oldest_result_is_evicted() -> None:
    memo: Memo[Owner, int] = Memo(kept=2)
    owner, made = Owner(), []

    def get(key: int) -> int:
        return memo.get(owner, key, lambda: made.append(key) or key)

    assert [get(key) for key in (1, 2, 3, 3, 2, 1)] == [1, 2, 3, 3, 2, 1]
    assert made == [1, 2, 3, 1]


def test_results_are_freed_with_their_owner() -> None:
    memo: Memo[Owner, Owner] = Memo()
    owner = Owner()
    gone = weakref.ref(memo.get(owner, "a", Owner))
    assert gone() is not None
    del owner
    gc.collect()
    assert gone() is None


def test_threads_that_evict_results_of_other_threads_get_correct_results() -> None:
    """The memo stores one result; a second thread requests another while the first is computed."""
    memo: Memo[Owner, str] = Memo(kept=1)
    owner, inside, go = Owner(), threading.Event(), threading.Event()
    found: list[str] = []

    def slow() -> str:
        inside.set()
        go.wait(10)
        return "slow"

    thread = threading.Thread(target=lambda: found.append(memo.get(owner, "slow", slow)))
    thread.start()
    inside.wait(10)
    assert memo.get(owner, "quick", lambda: "quick") == "quick"
    go.set()
    thread.join()
    assert found == ["slow"]
    assert memo.get(owner, "slow", lambda: "again") == "slow"


def test_threads_alternating_constantly_never_fail() -> None:
    memo: Memo[Owner, int] = Memo(kept=1)
    owner = Owner()
    wrong: list[int] = []

    def ask(first: int) -> None:
        for step in range(3000):
            key = (first + step) % 3
            if memo.get(owner, key, lambda key=key: key) != key:
                wrong.append(key)

    threads = [threading.Thread(target=ask, args=(k,)) for k in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
