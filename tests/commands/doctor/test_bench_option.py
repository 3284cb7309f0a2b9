"""``viewer doctor --bench``: its measurements, with few repetitions."""

import pytest

from viewer.commands import doctor
from viewer.commands.doctor import Measured, measured
from viewer.errors import RenderError

pytestmark = pytest.mark.slow


def test_all_measurements_are_made(monkeypatch):
    commands: list[list[str]] = []
    monkeypatch.setattr(doctor, "_process", lambda words, _: lambda: commands.append([*words]))
    for name, value in (("_SIZE", (32, 24)), ("_FRAMES", 1), ("_STARTS", 2), ("_INSTANCES", 2)):
        monkeypatch.setattr(doctor, name, value)
    found = [*measured()]
    assert all(one.milliseconds > 0.0 for one in found)
    assert [one.subject.partition(":")[0] for one in found].count("start to end") == 6
    assert len(found) == 13
    compared = [one.to for one in found if one.to]
    still = ["a still body", "a still body", "2 still bodies"]
    assert compared == ["import numpy", *3 * ["OpenGL context"], *still, "the CPU"]
    assert len(commands) == 3 * 6  # a warm-up round and two measured rounds


def test_relative_times_state_their_reference():
    assert str(Measured("a", 2.0)).split() == ["a", "2.00", "ms"]
    assert str(Measured("a", 2.0, 1.5, "b")).split() == ["a", "2.00", "ms", "1.50", "times", "b"]


def test_failure_of_a_program_is_reported_in_one_line():
    run = doctor._process(["-c", "import sys; print('x'); sys.exit('no\\nOpenGL')"], {})
    with pytest.raises(RenderError, match=r"^OpenGL$"):
        run()


def test_programs_receive_the_environment():
    doctor._process(["-c", "import os; assert os.environ['A'] == 'b'"], {"A": "b"})()


def test_doctor_measures_only_on_request(monkeypatch, capsys):
    from viewer.cli import run

    monkeypatch.setattr(doctor, "examine", lambda: iter(()))
    monkeypatch.setattr(doctor, "measured", lambda: iter([Measured("a", 2.0)]))
    assert run(["doctor"]) == 0
    assert capsys.readouterr().out == ""
    assert run(["doctor", "--bench"]) == 0
    assert capsys.readouterr().out.split() == ["bench", "a", "2.00", "ms"]
