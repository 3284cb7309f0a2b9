"""The studio's light, reproduced by its script and compared with the integrals."""

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.resources import resource

ROWS = np.array([3, 40, 70, 101])
STEPS = 240  # steps of the quadrature from pole to pole


@pytest.fixture
def generator(monkeypatch):
    """Return the modules of the script."""
    monkeypatch.syspath_prepend(str(Path(__file__).resolve().parents[3] / "assets"))
    import make_studio

    return make_studio


@pytest.fixture(scope="module")
def bundled():
    with np.load(resource("assets", "studio", "studio.npz")) as stored:
        return {name: stored[name].astype(float) for name in stored.files}


def sphere() -> tuple[np.ndarray, np.ndarray]:
    """Return directions over the sphere about +z, and the solid angle of each."""
    polar = (np.arange(STEPS) + 0.5) * math.pi / STEPS
    around = (np.arange(2 * STEPS) + 0.5) * math.pi / STEPS
    p, a = np.meshgrid(polar, around, indexing="ij")
    points = np.stack([np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), np.cos(p)], axis=-1)
    return points.reshape(-1, 3), (np.sin(p) * (math.pi / STEPS) ** 2).ravel()


def lobe(alpha: float, n_h: np.ndarray) -> np.ndarray:
    """Return the GGX distribution of half vectors (Walter et al. 2007, eq. 33)."""
    return alpha**2 / (math.pi * (n_h**2 * (alpha**2 - 1.0) + 1.0) ** 2)


def test_bundled_light_is_the_output_of_the_script(generator, bundled):
    directions = generator.octahedral_directions(generator.SIZE)[np.ix_(ROWS, ROWS)]
    light, samples = generator.radiance, generator.SAMPLES
    for layer in (0, 2, 7):
        made = generator.specular(light, directions, (layer / 7) ** 2, samples)
        stored = bundled["light"][layer][np.ix_(ROWS, ROWS)]
        assert_allclose(stored, made, rtol=0.004)  # eight bits of the mantissa are stored
    stored = bundled["light"][8][np.ix_(ROWS, ROWS)]
    assert_allclose(stored, generator.irradiance(light, directions, samples), rtol=0.004)
    with np.load(resource("assets", "studio", "matcaps.npz")) as matcaps:
        assert sorted(matcaps.files) == sorted(generator.MATCAPS)
        small = generator.matcap("clay", 64).astype(float)
        stored = matcaps["clay"].reshape(64, 4, 64, 4, 3).mean(axis=(1, 3))
    inside = np.hypot(*np.meshgrid(*2 * (np.linspace(-1, 1, 64),))) < 0.9
    assert np.abs(stored - small)[inside].max() < 3.0


def test_borders_continue_the_octahedral_map(generator):
    """Beyond an edge is the texel of the edge, mirrored about the centre of the edge."""
    points = generator.octahedral_directions(8)
    assert_allclose(points[0, 1:-1], points[1, 1:-1][::-1], atol=1e-12)
    assert_allclose(points[1:-1, -1], points[1:-1, -2][::-1], atol=1e-12)


@pytest.mark.parametrize("layer", [3, 5, 7])
def test_light_is_the_integral_of_the_lobe(generator, bundled, layer):
    """The expected value is the mean radiance, weighted by D(h) (n . l), along the normal."""
    points, angles = sphere()
    light = generator.radiance(points)
    for row, column in ((20, 20), (60, 75), (110, 40)):
        normal = generator.octahedral_directions(generator.SIZE)[row, column]
        n_l = points @ normal
        above = n_l > 0.0
        n_h = np.sqrt(0.5 + 0.5 * n_l[above])
        weights = lobe((layer / 7) ** 2, n_h) * n_l[above] * angles[above]
        wanted = weights @ light[above] / weights.sum()
        assert_allclose(bundled["light"][layer][row, column], wanted, rtol=0.02)


def test_last_layer_is_the_irradiance(generator, bundled):
    points, angles = sphere()
    light = generator.radiance(points)
    for row, column in ((20, 20), (60, 75), (110, 40)):
        normal = generator.octahedral_directions(generator.SIZE)[row, column]
        weights = np.maximum(points @ normal, 0.0) * angles / math.pi
        assert_allclose(bundled["light"][8][row, column], weights @ light, rtol=0.01)


@pytest.mark.parametrize("roughness", [0.3, 0.5, 0.9])
@pytest.mark.parametrize("n_v", [0.2, 0.7])
def test_table_is_the_integral_of_the_brdf(bundled, roughness, n_v):
    """The reflectance of F0 = 1 is factor + summand, that of F0 = 0 the summand; both are < 1."""
    row, column = int(64 * roughness), int(64 * n_v)
    alpha, n_v = ((row + 0.5) / 64) ** 2, (column + 0.5) / 64
    points, angles = sphere()
    points, angles = points[points[:, 2] > 0.0], angles[points[:, 2] > 0.0]
    view = np.array([math.sqrt(1.0 - n_v**2), 0.0, n_v])
    half = points + view
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    n_l, n_h, v_h = points[:, 2], half[:, 2], half @ view

    def shadowing(cosine):
        """Return Smith's Lambda of GGX (Heitz 2014, eq. 72)."""
        return 0.5 * (np.sqrt(1.0 + alpha**2 * (1.0 / cosine**2 - 1.0)) - 1.0)

    visible = 1.0 / (1.0 + shadowing(n_l) + shadowing(n_v))
    reflected = lobe(alpha, n_h) * visible / (4.0 * n_l * n_v) * n_l * angles
    factor, summand = bundled["split_sum"][row, column]
    assert factor + summand == pytest.approx(reflected.sum(), rel=0.01)
    assert summand == pytest.approx((reflected * (1.0 - v_h) ** 5).sum(), rel=0.02, abs=1e-3)
    assert factor + summand <= 1.0
