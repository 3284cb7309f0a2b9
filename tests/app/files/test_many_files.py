"""Files that are opened one after the other, as on a long day: nothing accumulates."""

import gc
from collections import Counter

import viewer

OPENED = 6
FEW = 50  # objects of caches, of which there are 79,000


def gl_objects() -> Counter[str]:
    """Return the number of moderngl's objects by type."""
    gc.collect()
    kinds = (type(found) for found in gc.get_objects())
    return Counter(kind.__name__ for kind in kinds if str(kind.__module__) == "moderngl")


def test_opened_files_leave_no_objects_behind(hand, tmp_path):
    for number in range(OPENED + 2):
        viewer.export(viewer.load().actors[0], tmp_path / f"fox-{number}.glb")
    counts, n_objects = [], []
    for number in range(OPENED + 2):
        hand.open(tmp_path / f"fox-{number}.glb")
        hand.wait_for_loader()
        hand.step(2)
        assert hand.state.scene.files == [tmp_path / f"fox-{number}.glb"]
        counts.append(gl_objects())
        n_objects.append(len(gc.get_objects()))
    assert not hand.state.error
    assert counts[1]["Buffer"] > 0 and counts[1]["Texture"] > 0
    # The first two files fill caches.
    assert counts[-1] == counts[1]
    assert n_objects[-1] - n_objects[1] < FEW
