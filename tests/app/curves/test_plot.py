"""The lines of the plot in the Curves panel."""

from dataclasses import replace

from app.curves.plotted import ARM_X

from viewer.app.curves import plot


def test_curves_are_sampled_again_only_if_the_motion_changes(curves, monkeypatch):
    sampled, original = [], plot.keyed_lines

    def noted(keyed, row, low, high):
        sampled.append(row)
        return original(keyed, row, low, high)

    monkeypatch.setattr(plot, "keyed_lines", noted)
    curves.step(3)
    assert sampled == []
    curves.state.actor.clip = replace(curves.state.actor.clip, end=1.5)
    curves.step(3)
    assert sampled == [ARM_X]
