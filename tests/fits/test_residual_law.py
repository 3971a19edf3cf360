"""The law of the residuals: its widths and its share, and the weights that follow from it."""

import numpy as np
import pytest

from cylx.fits.residual_law import BINS, Law, estimate_law


@pytest.mark.parametrize(("sigma", "broad", "share"), [(0.01, 0.04, 0.3), (0.01, 0.05, 0.5), (0.005, 0.03, 0.05)])
def test_the_law_of_residuals_is_found(sigma, broad, share):
    rng = np.random.default_rng(7)
    residuals = rng.standard_normal(50000) * np.where(rng.random(50000) < share, broad, sigma)
    width = 6.0 * broad
    counts, _ = np.histogram(np.abs(residuals), BINS, (0.0, width))
    law = estimate_law(counts.astype(float), width, Law(2 * sigma, 5 * sigma, 0.1))
    assert law.deviation == pytest.approx(sigma, rel=0.05)
    assert law.broad == pytest.approx(broad, rel=0.1)
    assert law.share == pytest.approx(share, rel=0.15)


def test_a_plain_law_has_no_outliers_to_speak_of():
    residuals = np.abs(np.random.default_rng(8).standard_normal(20000))
    counts, _ = np.histogram(residuals, BINS, (0.0, 8.0))
    law = estimate_law(counts.astype(float), 8.0, Law(1.0, 3.0, 0.1))
    assert law.deviation == pytest.approx(1.0, rel=0.02)
    assert law.share < 0.1


@pytest.mark.parametrize("outliers", [True, False])
@pytest.mark.parametrize("law", [Law(1.0, 3.0, 0.2), Law(1.0, 1.0, 0.0), Law(0.5, 4.0, 0.6)])
def test_the_tabulated_slope_is_the_derivative_of_the_score(law, outliers):
    weight, slope, outer = law.weights(8.0, outliers=outliers).T
    at = 8.0 * np.arange(BINS + 1) / BINS
    numerical = np.gradient(weight * at, at)
    assert slope[2:-2] == pytest.approx(numerical[2:-2], abs=0.02 * weight[0])
    assert (weight >= 0).all()
    assert (outer >= 0).all()
    if not outliers and law.share:
        assert weight[-1] < 1e-3 * weight[0]
