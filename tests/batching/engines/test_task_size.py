"""Number of items per task, from their times."""

from __future__ import annotations

from viewer.batching.engines._task_size import TaskSize


def test_tasks_begin_with_one_item_and_grow_to_a_fifth_of_a_second() -> None:
    size = TaskSize()
    sizes = []
    for _ in range(40):
        sizes.append(size.now())
        size.add(0.02 * sizes[-1], sizes[-1])
    assert sizes[:9] == [1] * 8 + [2]
    assert sizes == sorted(sizes)
    assert sizes[-1] == 10  # of 0.02 s each


def test_tasks_of_the_shortest_items_are_limited() -> None:
    size = TaskSize()
    for _ in range(1000):
        size.add(0.0, 1)
    assert size.now() == 32


def test_long_items_are_tasks_of_their_own() -> None:
    size = TaskSize()
    for _ in range(1000):
        size.add(0.101, 1)
    assert size.now() == 1


def test_tasks_grow_again_after_a_worker_died() -> None:
    size = TaskSize()
    size.add(0.2, 200)
    assert size.now() == 26  # 1 + 200 // 8
    size.restart()
    assert size.now() == 1
    size.add(0.008, 8)
    assert size.now() == 2
