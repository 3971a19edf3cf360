"""A made tank against its truth, and what must not change it."""

import numpy as np
import pytest
from scipy.optimize import minimize

from cylx.deviation import Tolerances, check_deviation, measure_deviations, overall
from cylx.deviation.form import form_of, smooth_of
from cylx.deviation.surface import cells_of
from cylx.geometry.cylinder import Cylinder
from tests.support.tanks import DEPTH, REACH, tank

MAP = np.array([512345.0, 5412345.0, 300.0])


def only(points, *designs, **options):
    found, labels, _ = measure_deviations(points, list(designs), **options)
    return found[0].measured, labels


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("middle", [(0, 0, 0), MAP], ids=["near", "map"])
def test_a_dent_is_as_deep_and_large_as_it_is(seed, middle):
    points, shape, place = tank(points=200_000, seed=seed, middle=middle)
    measured, _ = only(points, shape)
    (patch,) = measured.patches
    cell = np.sqrt(measured.cells.width * measured.cells.length)
    assert patch.kind == "dent"
    assert patch.depth == pytest.approx(DEPTH, abs=4 * patch.depth_sd + 0.05 * DEPTH)
    assert np.linalg.norm(measured.place_of(patch) - place) < cell
    # it is seen where it is deeper than half of what is certain
    seen = 0.5 * 5 * np.median(measured.cells.sds)
    reach = REACH * np.arccos(2 * seen / DEPTH - 1) / np.pi
    assert np.pi * (reach - 0.5 * cell) ** 2 < patch.area < np.pi * (reach + 0.7 * cell) ** 2
    assert patch.around == pytest.approx(2 * reach, abs=2.5 * cell)
    assert patch.along == pytest.approx(2 * reach, abs=2.5 * cell)
    volume = DEPTH * REACH**2 * (np.pi / 2 - 2 / np.pi)
    assert patch.volume == pytest.approx(volume, rel=0.15)


@pytest.mark.parametrize("seed", range(5))
def test_without_a_dent_there_is_none(seed):
    points, shape, _ = tank(dent=0.0, oval=0.02, taper=0.001, seed=seed)
    measured, _ = only(points, shape)
    assert measured.patches == ()
    form = measured.form
    assert abs(form.ovality - 0.02) < 4 * form.ovality_sd
    assert abs(abs(form.taper) - 0.001) < 4 * form.taper_sd
    assert form.ovality_sd < 0.001
    assert form.taper_sd < 1e-4


def test_neither_ovality_nor_taper_heeds_a_dent():
    points, shape, _ = tank(dent=0.1, oval=0.02)
    form = only(points, shape)[0].form
    assert abs(form.ovality - 0.02) < 0.001
    assert abs(form.taper) < 2e-4


def test_a_bulge_is_no_dent():
    points, shape, _ = tank(dent=-DEPTH)
    (patch,) = only(points, shape)[0].patches
    assert patch.kind == "bulge"


def test_a_dent_across_the_cut_is_one():
    points, shape, _ = tank()
    for turn in np.linspace(0, 2 * np.pi, 8):
        cosine, sine = np.cos(turn), np.sin(turn)
        turned = points @ np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]]).T
        (patch,) = only(turned, shape)[0].patches
        assert patch.around < 1.2


def test_place_tilt_and_size_are_those_it_has():
    points, shape, _ = tank(dent=0.0)
    tilt = np.radians(0.2)
    design = Cylinder(shape.point + np.array([0.01, 0, 0]), (np.sin(tilt), 0, np.cos(tilt)), 2.99, 8.0)
    measured, _ = only(points, design)
    assert measured.offset == pytest.approx(0.01, abs=4 * measured.offset_sd + 1e-5)
    np.testing.assert_allclose(measured.shift, [-0.01 * np.cos(tilt) ** 2, 0, 0], atol=2e-4)
    assert np.degrees(measured.tilt) == pytest.approx(0.2, abs=4 * np.degrees(measured.tilt_sd))
    assert measured.radius == pytest.approx(0.01, abs=4 * measured.radius_sd)
    assert measured.radius_sd < 1e-4


def test_the_uncertainties_are_those_of_repetitions():
    found = []
    for seed in range(30):
        points, shape, _ = tank(points=8000, dent=0.0, seed=seed)
        measured, _ = only(points, shape)
        found.append((measured.radius, measured.radius_sd, *measured.shift[:2], measured.offset_sd))
    radius, radius_sd, x, y, offset_sd = np.array(found).T
    assert 0.7 < radius.std() / radius_sd.mean() < 1.4
    assert 0.7 < np.concatenate([x, y]).std() / offset_sd.mean() < 1.4


def test_nothing_depends_on_origin_unit_turn_or_order():
    points, shape, _ = tank(points=30_000, oval=0.01)
    base, _ = only(points, shape)
    rng = np.random.default_rng(1)
    order = rng.permutation(len(points))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    cases = {
        "order": (points[order], shape, 1.0),
        "unit": (1000 * points, shape.moved((0, 0, 0), 1000), 1000.0),
        "origin": (points + MAP, shape.moved(MAP), 1.0),
        "turn": (points @ turn.T, Cylinder(turn @ shape.point, turn @ shape.direction, 3.0, 8.0), 1.0),
    }
    for moved, design, scale in cases.values():
        other, _ = only(moved, design)
        assert other.radius / scale == pytest.approx(base.radius, abs=2e-5)
        assert other.form.minimum_zone / scale == pytest.approx(base.form.minimum_zone, rel=0.1)
        assert other.form.ovality / scale == pytest.approx(base.form.ovality, rel=0.02)
        assert len(other.patches) == 1
        sd = np.hypot(base.patches[0].depth_sd, other.patches[0].depth_sd / scale)
        assert other.patches[0].depth / scale == pytest.approx(base.patches[0].depth, abs=4 * sd)


def test_the_minimum_zone_is_the_least():
    """Another search, over the axis, finds no narrower zone; and none is wider than that of least squares."""
    rng = np.random.default_rng(4)
    angles, heights = rng.uniform(-np.pi, np.pi, 6000), rng.uniform(-1, 1, 6000)
    off = 0.02 * np.cos(3 * angles) + 0.01 * np.sin(angles) * heights + 0.01 * heights**2
    cells = cells_of(heights, angles, off, 1.0, 2.0, 0.2)
    form = form_of(cells, 1.0, smooth_of(cells))
    places = (1.0 + cells.values)[:, None] * np.column_stack([np.cos(cells.angles), np.sin(cells.angles)])

    def zone(axis):
        return np.ptp(np.hypot(*(places - axis[:2] - cells.heights[:, None] * axis[2:]).T))

    searched = min(
        minimize(zone, start, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-10, "maxiter": 5000}).fun
        for start in rng.normal(0, 0.01, (6, 4))
    )
    assert form.minimum_zone <= searched * (1 + 1e-6)
    assert form.minimum_zone >= searched * (1 - 1e-3)
    assert form.minimum_zone <= form.least_squares


def test_a_perfect_cylinder_has_the_cylindricity_of_its_noise():
    points, shape, _ = tank(dent=0.0)
    form = only(points, shape)[0].form
    assert 0.5 * form.noise < form.minimum_zone < 1.5 * form.noise


def test_each_point_is_of_the_nearest_design():
    one, first, _ = tank(points=5000, radius=0.1, height=2.0, dent=0.0, noise=0.001)
    other, second, _ = tank(points=5000, radius=0.1, height=2.0, dent=0.0, noise=0.001, middle=(0.22, 0, 0))
    away = Cylinder((5, 5, 5), (0, 0, 1), 0.1, 1.0)
    found, labels, residuals = measure_deviations(np.vstack([one, other]), [first, second, away])
    assert (labels[:5000] == 0).mean() > 0.99
    assert (labels[5000:] == 1).mean() > 0.99
    assert np.abs(residuals[labels >= 0]).max() < 0.015
    assert (found[2].measured, found[2].points) == (None, 0)
    assert [overall(check_deviation(one, Tolerances())) for one in found] == ["pass", "pass", "fail"]


def test_what_is_about_it_does_little_harm():
    points, shape, _ = tank(points=30_000, dent=0.0)
    clutter = np.random.default_rng(2).uniform(-4, 4, (20_000, 3))
    measured, _ = only(np.vstack([points, clutter]), shape)
    assert abs(measured.radius) < 4 * measured.radius_sd + 1e-4
    assert measured.patches == ()


def test_an_arc_has_no_ovality():
    points, shape, _ = tank(arc=np.pi / 2)
    measured, _ = only(points, shape)
    assert measured.form.ovality is None
    (patch,) = measured.patches
    assert patch.depth == pytest.approx(DEPTH, rel=0.15)


@pytest.mark.parametrize(
    ("limits", "verdict"),
    [
        ({"dent": 0.03}, "pass"),
        ({"dent": 0.01}, "fail"),
        ({"radius": 0.001, "offset": 0.001, "tilt_deg": 0.1, "ovality": 0.01, "taper": 0.001}, "pass"),
        ({"cylindricity": 0.005}, "fail"),
        ({"cylindricity": 0.1}, "pass"),
        ({"ovality": 0.0}, "undecided"),
    ],
)
def test_verdicts_heed_the_uncertainty(limits, verdict):
    points, shape, _ = tank()
    found, *_ = measure_deviations(points, [shape])
    assert overall(check_deviation(found[0], Tolerances(**limits))) == verdict


def test_what_cannot_be_measured_is_undecided():
    points, shape, _ = tank(arc=np.pi / 2)
    found, *_ = measure_deviations(points, [shape])
    (_, check) = check_deviation(found[0], Tolerances(ovality=0.1))
    assert (check.value, check.verdict) == (None, "undecided")
