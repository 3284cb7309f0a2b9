"""Number of items per task, from their times."""

from viewer.batching.engines._task_size import TaskSize


def test_tasks_begin_with_one_item_and_grow_to_half_a_second() -> None:
    size = TaskSize()
    sizes = []
    for _ in range(60):
        sizes.append(size.now(0, 2))
        size.add(0.02 * sizes[-1], sizes[-1])
    assert sizes[:9] == [1] * 8 + [2]
    assert sizes == sorted(sizes)
    assert sizes[-1] == 25  # of 0.02 s each


def test_tasks_of_the_shortest_items_are_limited() -> None:
    size = TaskSize()
    for _ in range(1000):
        size.add(0.0, 1)
    assert size.now(0, 2) == 64


def test_long_items_are_tasks_of_their_own() -> None:
    size = TaskSize()
    for _ in range(1000):
        size.add(0.251, 1)
    assert size.now(0, 2) == 1


def test_last_tasks_leave_two_for_each_worker() -> None:
    size = TaskSize()
    for _ in range(1000):
        size.add(0.01, 1)
    assert [size.now(n_left, 2) for n_left in (1000, 200, 41, 8, 3, 1)] == [50, 50, 10, 2, 1, 1]
    assert size.now(64, 16) == 2


def test_tasks_grow_again_after_a_worker_died() -> None:
    size = TaskSize()
    size.add(0.2, 200)
    assert size.now(0, 2) == 26  # 1 + 200 // 8
    size.restart()
    assert size.now(0, 2) == 1
    size.add(0.008, 8)
    assert size.now(0, 2) == 2
