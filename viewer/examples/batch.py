"""Run a function on many files, in worker processes, and collect a table of its results."""

import viewer
from viewer.batching.items import Item
from viewer.models import resolve


def measure(item: Item) -> dict[str, float]:
    """Return the columns of one row."""
    figure = viewer.load(*item.files).actors[0].figure
    positions, _ = viewer.deform(figure)
    return {"vertices": len(positions), "height": round(float(positions[:, 1].max()), 3)}


# Workers import this file again, so the rest must not run there.
if __name__ == "__main__":
    files = [resolve("body")]  # or 'models/**/*.npz'
    report = viewer.batch(files, measure, table="heights.csv", workers=2, force=True)
    for result in report.results:
        print(result.item.name, result.status, result.values, result.message)
