"""What is measured of a segment: shapes that are no cylinders show it in the measure that is called after them."""

import numpy as np
import pytest

from cylx.config import Config, VerificationConfig
from cylx.evidence.measures import look_at
from cylx.evidence.places import PLACES, distinct_places
from cylx.geometry.cells import Cells
from cylx.geometry.coverage import covered_angle
from cylx.geometry.cylinder import Cylinder
from cylx.records import IndexedCloud, Noise, Segment
from cylx.scene import make_frame
from cylx.stages.verification import verify
from cylx.synthetic.surfaces import Frustum, Mantle, Sphere

SIGMA = 0.01
UP = np.array([0.0, 0.0, 1.0])


def world(points, radius=1.0, half=2.0, flat=0.0, sigma=SIGMA):
    """Give the ground of points, and the segment about the z axis of the scene."""
    frame, _ = make_frame(points, Config())
    noise = Noise(np.ones(1), np.array([sigma / frame.spacing]))
    indexed = IndexedCloud(Cells(frame.points, frame.codes), np.full(len(points), flat), noise)
    model = np.concatenate([-frame.origin, UP * frame.spacing, [radius]]) / frame.spacing
    model[3:6] = UP
    return indexed, Segment(model, half / frame.spacing, sigma / frame.spacing)


def noisy(surface, n=3000, seed=0):
    rng = np.random.default_rng(seed)
    return surface.sample(rng, n) + SIGMA * rng.standard_normal((n, 3))


def pipe(arc_deg=360.0, height=4.0, n=3000):
    return noisy(Mantle(Cylinder((0, 0, 0), UP, 1.0, height), 0.0, np.radians(arc_deg)), n)


def judge(points, agreement=(40, 42), payoff=0.8, config=None, **place):
    indexed, segment = world(points, **place)
    return verify(segment, indexed, payoff, agreement, config or VerificationConfig())


def test_a_cylinder_passes_and_shows_nothing_else():
    verdict = judge(pipe())
    assert verdict.reason == ""
    assert verdict.confidence > 0.95
    measures = verdict.measures
    assert np.isclose(measures["noise_ratio"], 1.0, atol=0.1)
    assert measures["lack_of_fit"] < 1.5
    assert measures["inside"] < 0.02
    assert measures["outside"] < 0.02
    assert measures["curvature"] > 1000
    assert abs(measures["slope"]) < 4 * measures["slope_error"]
    assert abs(measures["bulge"]) < 4 * measures["bulge_error"]
    assert measures["bend"] < 4 * measures["bend_error"]
    assert measures["flank"] == 0.0
    assert np.isclose(measures["radius_noises"], 1.0 / SIGMA, rtol=0.1)
    assert np.isclose(measures["height_radii"], 4.0)
    assert np.isclose(verdict.coverage, 2 * np.pi, rtol=0.02)
    assert 2900 < len(verdict.points) <= 3000


def test_errors_are_those_of_the_bound():
    indexed, segment = world(pipe())
    verdict = verify(segment, indexed, 0.8, (40, 42), VerificationConfig())
    # over a full turn: 2 sigma / sqrt(n) of the place, 2 sigma sqrt(3) / (h / 2) / sqrt(n) of the angle
    noise, n = SIGMA * segment.radius, len(verdict.points)
    assert np.isclose(verdict.offset_error, 2 * noise / np.sqrt(n), rtol=0.1)
    assert np.isclose(verdict.tilt_error, 2 * noise * np.sqrt(3) / segment.half / np.sqrt(n), rtol=0.1)


def test_nothing_and_a_few_points_are_no_cylinder():
    far = pipe() + 50.0 * np.eye(3)[0]
    indexed, segment = world(np.concatenate([far, pipe(n=15)]))
    verdict = verify(segment, indexed, 0.8, (0, 0), VerificationConfig())
    assert (verdict.reason, verdict.confidence) == ("too few points", 0.0)
    assert len(verdict.points) <= 15


@pytest.mark.parametrize("taper_deg", [3.0, 8.0])
def test_a_cone_shows_its_slope(taper_deg):
    slope = np.tan(np.radians(taper_deg))
    indexed, segment = world(noisy(Frustum(np.zeros(3), UP, 1 - slope / 2, 1 + slope / 2, 1.0)), half=0.5)
    verdict = verify(segment, indexed, 0.8, (40, 42), VerificationConfig())
    assert np.isclose(verdict.measures["slope"], slope, rtol=0.4)
    assert verdict.reason != ""
    segment.model[3:6] *= -1.0  # the result has the upward direction all the same
    turned = verify(segment, indexed, 0.8, (40, 42), VerificationConfig())
    assert np.isclose(turned.measures["slope"], verdict.measures["slope"], rtol=1e-6)


def test_a_strip_of_a_sphere_shows_its_bulge():
    points = noisy(Sphere(np.zeros(3), 1.0), 12000)
    verdict = judge(points[np.abs(points[:, 2]) < 0.25], half=0.2, radius=0.99)
    assert 0.7 < verdict.measures["bulge"] < 1.3  # a sphere has one
    assert verdict.reason != ""


def test_a_flat_strip_shows_no_curvature():
    strip = np.column_stack([np.full(2000, 1.0), *np.random.default_rng(1).uniform([-0.1, -2], [0.1, 2], (2000, 2)).T])
    verdict = judge(strip + SIGMA * np.random.default_rng(2).standard_normal((2000, 3)))
    assert verdict.measures["curvature"] < 100 < judge(pipe()).measures["curvature"]
    assert verdict.reason != ""


@pytest.mark.parametrize(("low", "high", "name"), [(0.3, 0.9, "inside"), (1.1, 1.45, "outside")])
def test_points_beside_the_surface_are_counted_against_it(low, high, name):
    distance = np.random.default_rng(8).uniform(low, high, (len(pipe()), 1))
    other = pipe() * np.column_stack([distance, distance, np.ones(len(distance))])
    measures = judge(np.concatenate([pipe(), other])).measures
    assert np.isclose(measures[name], 1.0, atol=0.1)
    assert measures["inside" if name == "outside" else "outside"] < 0.05


def test_the_inner_wall_of_a_tube_does_not_count_against_the_outer_one():
    assert judge(np.concatenate([pipe(), pipe() * [0.8, 0.8, 1]])).measures["inside"] < 0.05


def test_a_lid_is_forgiven():
    rng = np.random.default_rng(4)
    turn, distance = rng.uniform(0, 2 * np.pi, 800), np.sqrt(rng.random(800))
    lid = np.column_stack([distance * np.cos(turn), distance * np.sin(turn), np.full(800, 1.95)])
    assert judge(np.concatenate([pipe(), lid])).measures["inside"] < 0.03


def test_sides_that_go_on_show_a_rounded_edge():
    rng = np.random.default_rng(5)
    sigma = 0.2 * SIGMA
    arc = Mantle(Cylinder((0, 0, 0), UP, 1.0, 4.0), 0.0, np.radians(90)).sample(rng, 1200)  # from y to -x about z
    heights, away, on = rng.uniform(-2, 2, 800), rng.random(800), np.ones(800)
    sides = np.concatenate([np.column_stack([away, on, heights]), np.column_stack([-on, -away, heights])])
    points = np.concatenate([arc, sides])
    points += sigma * rng.standard_normal(points.shape)
    assert judge(points[:1200], sigma=sigma).measures["tangent"] < 0.05
    assert judge(points[:2000], sigma=sigma).measures["tangent"] > 0.5  # the other side may be hidden
    assert judge(points, sigma=sigma).measures["tangent"] > 0.5


@pytest.mark.parametrize("bend", [0.01, 0.02, 0.03])
def test_a_bent_pipe_shows_its_bend_and_no_bulge(bend):
    straight = pipe(n=6000)
    offset = 0.5 * bend * straight[:, 2] ** 2
    measures = judge(straight + np.outer(offset - offset.mean(), [0.6, 0.8, 0.0])).measures
    assert 0.8 * bend < measures["bend"] < 1.1 * bend  # what is bent furthest no longer counts as on the surface
    assert abs(measures["bulge"]) < 4 * measures["bulge_error"] + 0.01


def test_a_straight_pipe_bends_no_more_than_its_standard_error_says():
    ratios = []
    for seed in range(16):
        points = noisy(Mantle(Cylinder((0, 0, 0), UP, 1.0, 4.0), 0.0, 2 * np.pi), 1000, seed)
        measures = judge(points).measures
        ratios.append(measures["bend"] / measures["bend_error"])
    # the length of a vector of two independent normals: its square has a mean of two
    assert np.mean(np.square(ratios)) == pytest.approx(2.0, abs=1.2)


def edge(radius, width=4.0, n=1500):
    """Give a sharp edge along z, its sides going off at 45 degrees, and the circle that fits into it best."""
    rng = np.random.default_rng(6)
    away, heights = rng.uniform(0, width, (2, n)), rng.uniform(-2, 2, (2, n))
    sides = [np.column_stack([-a, sign * a, h]) for a, h, sign in zip(away, heights, (-1, 1), strict=True)]
    return np.concatenate(sides) / [np.sqrt(2), np.sqrt(2), 1] + [np.sqrt(2) * radius, 0, 0]


@pytest.mark.parametrize("noises", [5.0, 8.0, 12.0])
def test_the_sides_of_an_edge_are_flanks_however_thin_the_cylinder(noises):
    sigma = 1.0 / noises
    points = edge(1.0) + sigma * np.random.default_rng(7).standard_normal((3000, 3))
    assert judge(points, sigma=sigma).measures["flank"] > 0.4
    one_side = points[:1500]
    assert judge(one_side, sigma=sigma).measures["flank"] > 0.4


def test_a_floor_a_crossing_plate_and_stray_points_are_no_flanks():
    rng = np.random.default_rng(8)
    across, along = rng.uniform(-4, 4, (2, 3000)), rng.uniform(-2, 2, (2, 3000))
    floor = np.column_stack([across[0], np.full(3000, -1.0), along[0]])
    plate = np.column_stack([across[0], across[1], np.full(3000, 0.5)])
    strays = rng.uniform(-2, 2, (3000, 3))
    assert judge(pipe()).measures["flank"] == 0.0
    for other in (floor, plate[np.hypot(*plate[:, :2].T) > 1], strays):
        assert judge(np.concatenate([pipe(), other])).measures["flank"] < 0.15


@pytest.mark.parametrize(
    ("limit", "reason"),
    [
        ({"min_inliers": 5000}, "too few points"),
        ({"min_coverage_deg": 200.0}, "coverage"),
        ({"min_height": 5.0}, "height"),
    ],
)
def test_limits_of_the_user_are_kept(limit, reason):
    points = pipe(180.0)
    assert judge(points).reason == ""
    assert judge(points, config=VerificationConfig(**limit)).reason == reason


def test_candidates_that_disagree_speak_against_it():
    trusted = [judge(pipe(120.0), agreement=pair).confidence for pair in ((40, 40), (20, 40), (0, 40))]
    assert trusted[0] > trusted[1] > trusted[2]
    assert judge(pipe(120.0), payoff=0.9).confidence > judge(pipe(120.0), payoff=0.3).confidence


@pytest.mark.parametrize("arc_deg", [20, 45, 90, 180, 300, 360])
@pytest.mark.parametrize("n", [400, 40000])
def test_the_covered_angle_is_that_of_the_arc(arc_deg, n):
    rng = np.random.default_rng(6)
    angles = rng.uniform(0, np.radians(arc_deg), n) + 1.0
    angles = (angles + np.pi) % (2 * np.pi) - np.pi
    assert np.isclose(np.degrees(covered_angle(angles)), arc_deg, atol=15 if n < 1000 else 3)


def test_no_points_cover_nothing():
    assert covered_angle(np.empty(0)) == 0.0


def test_the_shell_is_what_is_about_the_segment():
    indexed, segment = world(np.concatenate([pipe(), pipe() * [3, 3, 1]]))
    shell = look_at(segment, indexed)
    assert (np.abs(shell.heights) <= 1).all()
    assert (shell.residuals <= 0.5 * segment.radius * (1 + 1e-9)).all()
    assert np.array_equal(shell.on, np.abs(shell.residuals) < 3 * shell.deviation)
    assert len(shell.indices) < 3100
    assert not shell.flat.any()
    half = shell.thinned(2)
    assert len(half.indices) == len(half.on) == (len(shell.indices) + 1) // 2
    indexed, segment = world(pipe(), flat=1e9)
    assert look_at(segment, indexed).flat.all()
    assert not look_at(segment, indexed).on.any()


@pytest.mark.parametrize("lines", [2, 3, 4, 6])
def test_lines_along_the_axis_are_counted(lines):
    rng = np.random.default_rng(lines)
    angles = np.repeat(np.linspace(0.0, 4.0, lines), 200) + 0.02 * rng.standard_normal(200 * lines)
    turned = (angles + rng.uniform(0, 6) + np.pi) % (2 * np.pi) - np.pi
    # a line is as wide as the noise makes it: half a place more
    assert distinct_places(turned, 1.0, 0.02) == pytest.approx(1.55 * lines, abs=0.1 * lines)
    strays = rng.uniform(-np.pi, np.pi, 6 * lines)
    assert distinct_places(np.concatenate([turned, strays]), 1.0, 0.02) == pytest.approx(1.55 * lines, abs=0.2 * lines)


@pytest.mark.parametrize("n", [20, 100, 5000])
@pytest.mark.parametrize("arc_deg", [60.0, 200.0, 360.0])
def test_an_arc_is_no_line(n, arc_deg):
    rng = np.random.default_rng(n)
    shares = [distinct_places(np.radians(arc_deg) * rng.random(n), 1.0, 0.02) == PLACES for _ in range(50)]
    assert np.mean(shares) > 0.95


def test_places_of_nothing_and_of_one():
    assert distinct_places(np.empty(0), 1.0, 0.1) == 0.0
    assert distinct_places(np.zeros(1), 1.0, 0.1) == 1.0
    assert 0.0 < distinct_places(np.zeros(50), 1.0, 0.0) <= PLACES
