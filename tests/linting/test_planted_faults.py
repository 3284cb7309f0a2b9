"""Single errors introduced into valid figures and motions, and their codes and locations."""

import pytest
from linting.planted import FAULTS, captured, findings_of, keyed, moving
from linting.sound import (
    column,
)

from viewer.linting import CODES


@pytest.mark.parametrize("name", FAULTS)
def test_planted_fault_is_found_at_its_location(name):
    maker, code, where, expected = FAULTS[name]
    found = [finding for finding in findings_of(maker) if finding.code == code]
    assert len(found) == 1, name
    assert sorted(getattr(found[0], where).tolist()) == pytest.approx(sorted(expected))
    assert found[0].severity == CODES[code].severity
    assert found[0].actor == 0 and found[0].message and found[0].hint


# Other findings that are consequences of an introduced error.
COMPANIONS = {
    "sum too large": {"Y002"},
    "negative": {"Y002"},
    "no influence": {"Y002"},
    "weights of 0": {"Y002"},
    "flat triangle": {"M006"},  # repeats the edge from 4 to 5
    "sliver": {"M006"},
    "three on an edge": {"M005"},
    "triangle twice": {"M006"},
    "stray vertex": {"Y001", "M001"},  # its triangles are slivers
    "vertex a hundred sizes away": {"Y001", "M003"},  # inverts the volume
    "jitter": {"C007"},  # moves by 20 mm back and forth
    "exchanged people": {"C003"},  # both people jump
    "sinking": {"C003"},  # within a frame
    "floating": {"C003"},
    # The frame is also off the path of its neighbours; the ankle follows the knee.
    "jump": {"C020"},
    "fast turn": {"C003", "C020"},
}


@pytest.mark.parametrize("name", FAULTS)
def test_planted_fault_causes_no_other_serious_finding(name):
    """Errors and warnings must be those of the introduced error or its listed consequences."""
    maker, code, _, _ = FAULTS[name]
    heavy = {finding.code for finding in findings_of(maker) if finding.severity != "note"}
    assert heavy - {code} <= COMPANIONS.get(name, set()), name


def test_there_are_more_than_40_planted_faults():
    assert len(FAULTS) >= 40


@pytest.mark.parametrize(
    "maker",
    [column, lambda: moving(lambda root, turns: None), lambda: captured(lambda points: None),
     lambda: keyed({7: ([0.0, 1.0], [0.0, 2.0])})],
    ids=["column", "legs", "points", "keys"],
)  # fmt: skip
def test_base_figures_of_planted_faults_are_valid(maker):
    assert findings_of(maker) == []
