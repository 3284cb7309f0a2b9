"""Columns of legends: as few as possible, with a count of omitted entries."""

import pytest

from viewer.rendering.overlay.legend import LegendColumns, legend_columns


def test_empty_list_has_no_column():
    assert legend_columns([], 3, 100.0) == LegendColumns((), ())
    assert legend_columns([], 3, 100.0).rows == 0


def test_one_column_is_used_if_its_lines_fit():
    assert legend_columns([4.0, 7.0, 5.0], 3, 100.0) == LegendColumns((3,), (7.0,))


def test_columns_are_balanced_and_as_wide_as_needed():
    found = legend_columns([4.0, 7.0, 5.0, 3.0, 2.0], 4, 100.0)
    assert found == LegendColumns((3, 2), (7.0, 3.0))
    assert found.rows == 3


def test_full_columns_are_used_if_balanced_columns_are_too_wide():
    # Balanced columns of 2 + 2 entries need 9 + 9; full columns of 3 + 1 need 9 + 2.
    assert legend_columns([1.0, 9.0, 9.0, 2.0], 3, 12.0) == LegendColumns((3, 1), (9.0, 2.0))


def test_overflow_is_counted_on_a_separate_line():
    found = legend_columns([5.0] * 10, 3, 11.0)
    assert found == LegendColumns((3, 2), (5.0, 5.0), 5)
    assert found.rows == 3


@pytest.mark.parametrize(("rows", "counts", "left_out"), [(2, (1,), 3), (1, (0,), 4)])
def test_first_column_is_kept_in_any_width(rows, counts, left_out):
    found = legend_columns([50.0] * 4, rows, 11.0)
    assert found == LegendColumns(counts, (50.0,), left_out)
    assert found.rows == rows
