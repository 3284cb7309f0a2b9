"""Mapping of values to colours, with ranges that are robust to outliers."""

import numpy as np
import pytest
from rendering.front_view import alone, front_view, grid_figure

from viewer.rendering.offscreen import Offscreen
from viewer.rendering.options import DisplayOptions
from viewer.rendering.scalar_look import look_of, typical_span
from viewer.rig.scalars import SCALARS, compute
from viewer.rig.skin import skin_from_lists


def test_largest_one_percent_of_values_is_ignored():
    # The 99th percentile of 1 to 1000 is 990 or slightly more; the sign does not matter.
    numbers = np.arange(1.0, 1001.0)
    low, high = typical_span(numbers)
    assert low == 1.0 and 990 <= high <= 991
    assert typical_span(-numbers) == (-high, -1.0)
    numbers[:500] *= -1.0
    assert typical_span(numbers) == (-500.0, high)


def test_zero_values_are_ignored():
    # Only 50 of 10,000 vertices move, so nearly all values are 0; the range is that of the 50.
    numbers = np.zeros(10_000)
    numbers[:50] = np.linspace(-20, 30, 50)
    assert typical_span(numbers) == (-20.0, 30.0)


def test_all_values_of_small_samples_are_typical():
    assert typical_span(np.array([0.0, -3.0, 7.0])) == (-3.0, 7.0)
    assert typical_span(np.zeros(5)) == (0.0, 0.0)
    assert typical_span(np.arange(100.0)) == (0.0, 99.0)


@pytest.mark.parametrize("name", SCALARS)
def test_only_automatic_strain_ranges_are_robust(name):
    figure = grid_figure()
    is_robust = name in ("stretch", "stretch-mean", "area")
    assert SCALARS[name].robust == is_robust
    assert look_of(name, figure, (-1.0, 1.0), DisplayOptions()).is_typical == is_robust
    fixed = DisplayOptions(scalar_range=(-1.0, 1.0))
    assert not look_of(name, figure, (-1.0, 1.0), fixed).is_typical


def test_one_outlier_does_not_flatten_the_other_colours():
    # The weights of joint 1 increase to the right; a single vertex has weight 1.
    figure = grid_figure(40)
    x = (figure.mesh.positions[:, 0] + 1.5) / 3.0
    weights = 0.5 * x**2
    weights[820] = 1.0
    rows = [[(0, 1.0 - w), (1, w)] for w in weights.tolist()]
    skin = skin_from_lists(rows, np.tile(np.eye(4), (2, 1, 1)))
    scene = alone(type(figure)("grid", figure.mesh, figure.skeleton, skin))
    actor = scene.actors[0]
    actor.pose.translations[1] = 0.3, 0.0, 0.0
    with Offscreen() as offscreen:
        front_view(offscreen, scene, shading="scalar", scalar="stretch")
        scalars = offscreen.renderer.scalars
        legend = scalars.legend
        front_view(offscreen, scene, shading="scalar", scalar="stretch", scalar_range=(-10.0, 10.0))
        fixed = scalars.ends, offscreen.renderer.scalars.legend.note
        numbers = compute("stretch", actor.figure, actor.pose, DisplayOptions().skinning)
        front_view(offscreen, scene, shading="scalar", scalar="stretch")
    amounts = np.sort(np.abs(numbers[numbers != 0.0]))
    most = amounts[int(np.ceil(0.99 * (len(amounts) - 1)))]
    assert amounts[-1] > 3.0 * most  # the outlier
    assert scalars.ends == pytest.approx((-most, most))
    assert scalars.range == pytest.approx((numbers.min(), numbers.max()))
    low, high = numbers.min(), numbers.max()
    span = f"from {low:+.3g} to {high:+.3g}"
    assert legend.note == f"99 %: up to ±{most:.3g}; {span}"
    assert fixed == ((-10.0, 10.0), span)
