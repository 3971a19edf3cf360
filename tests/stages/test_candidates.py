"""Candidates of ellipses: one of the two axes of eq. 4 is the cylinder's, and the polish finds out which."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.config import CandidatesConfig, Config
from cylx.geometry.cylinder import Cylinder, axis_basis
from cylx.geometry.ellipse import Ellipse, fit_ellipse
from cylx.geometry.plane import Plane, random_directions
from cylx.records import Candidates, EllipseFit
from cylx.scene import make_frame
from cylx.stages.candidates import axes_of, polish_candidates, propose_cylinders
from cylx.synthetic import multi, single

seeds = st.integers(0, 2**32 - 1)
laws = settings(max_examples=60, deadline=None)


def cut(seed, oblique_deg):
    """Cut a cylinder by a plane whose normal makes an angle with its axis: the cylinder and the ellipse of the cut."""
    rng = np.random.default_rng(seed)
    shape = Cylinder(rng.standard_normal(3), rng.standard_normal(3), rng.uniform(0.3, 3))
    normal_, across = axis_basis(shape.direction)
    angle = np.radians(oblique_deg)
    normal = rng.choice([-1, 1]) * (np.cos(angle) * shape.direction + np.sin(angle) * normal_)
    center = shape.point + rng.uniform(-5, 5) * shape.direction
    offset = rng.standard_normal(2)
    plane = Plane(center, normal)
    plane = Plane(plane.lift(offset), normal)  # its zero is not the centre of the ellipse
    minor = plane.project(plane.point + across)
    ellipse = Ellipse(
        plane.project(center), shape.radius / np.cos(angle), shape.radius, np.arctan2(minor[1], minor[0]) + np.pi / 2
    )
    return shape, EllipseFit(ellipse, plane, 100)


def apart(one, other):
    """Sine of the angle of two unit directions, whatever their signs."""
    return np.linalg.norm(np.cross(one, other), axis=-1)


@laws
@given(seeds, st.floats(0, 75))
def test_one_of_the_two_axes_is_the_true_one(seed, oblique_deg):
    shape, fit = cut(seed, oblique_deg)
    axes = axes_of(fit)
    assert np.allclose(np.linalg.norm(axes, axis=1), 1.0)
    assert apart(axes, shape.direction).min() < 1e-7  # of 1 - (b / a)^2 half the digits are left close to a circle
    # both make the angle of eq. 3 with the normal, on either side of it: cos = b / a
    assert np.allclose(np.abs(axes @ fit.plane.normal), fit.ellipse.semi_minor / fit.ellipse.semi_major, atol=1e-12)
    middle = axes.sum(axis=0)
    assert apart(middle / np.linalg.norm(middle), fit.plane.normal) < 1e-12


@laws
@given(seeds, st.floats(0, 70))
def test_points_of_the_cut_lead_to_the_cylinder(seed, oblique_deg):
    shape, fit = cut(seed, oblique_deg)
    # points of the surface in the plane: along each line of the mantle to where it meets the plane
    first, second = axis_basis(shape.direction)
    turns = np.linspace(0, 2 * np.pi, 30, endpoint=False)
    mantle = shape.point + shape.radius * (np.outer(np.cos(turns), first) + np.outer(np.sin(turns), second))
    reach = -((mantle - fit.plane.point) @ fit.plane.normal) / (shape.direction @ fit.plane.normal)
    points = mantle + reach[:, None] * shape.direction
    assert np.allclose(((points - fit.plane.point) @ fit.plane.normal), 0, atol=1e-12)
    proposed = propose_cylinders([[EllipseFit(fit_ellipse(fit.plane.project(points)), fit.plane, 30)]])
    assert apart(proposed.directions, shape.direction).min() < 1e-6
    assert np.allclose(proposed.radii, shape.radius, rtol=1e-9)
    assert np.allclose(np.cross(proposed.points - shape.point, shape.direction), 0, atol=1e-6)


def test_two_candidates_an_ellipse_and_a_parent_a_slice():
    fits = [cut(seed, 40)[1] for seed in range(4)]
    proposed = propose_cylinders([[], fits[:1], [], fits[1:]])
    assert len(proposed) == 8
    assert proposed.parents.tolist() == [1, 1, 3, 3, 3, 3, 3, 3]
    assert proposed.inliers.tolist() == [100] * 8
    assert np.allclose(proposed.radii, np.repeat([fit.ellipse.semi_minor for fit in fits], 2))
    assert np.allclose(proposed.points[::2], [fit.plane.lift(fit.ellipse.center) for fit in fits])


@pytest.mark.parametrize("slices", [[], [[], []]])
def test_no_ellipses_are_no_candidates(slices):
    assert len(propose_cylinders(slices)) == 0


@pytest.fixture(scope="module")
def scan():
    """A noisy cylinder in its frame, its true model there, and how many points it has."""
    scene = single(points=6000, sigma=0.01, p=0.1, sigma_o=0.1, height=6.0)
    frame, _ = make_frame(scene.points, Config())
    model = np.concatenate([-frame.origin, [0, 0, frame.spacing], [1.0]]) / frame.spacing
    return frame, model


def candidates_of(models):
    count = len(models)
    return Candidates(np.array(models), np.arange(count), np.zeros(count), np.full(count, 30), models[:, 6].copy())


def test_the_polish_brings_rough_candidates_to_the_surface(scan):
    frame, truth = scan
    rng = np.random.default_rng(0)
    models = np.repeat(truth[None], 50, axis=0)
    models[:, 2] += rng.uniform(-1, 1, 50) * truth[6]
    models[:, :3] += 0.1 * truth[6] * rng.uniform(-1, 1, (50, 3))
    models[:, 3:6] += 0.1 * rng.uniform(-1, 1, (50, 3))
    models[:, 3:6] /= np.linalg.norm(models[:, 3:6], axis=1, keepdims=True)
    models[:, 6] *= rng.uniform(0.9, 1.1, 50)
    rough = candidates_of(models)
    fine = polish_candidates(rough, frame, (0.0, np.inf), CandidatesConfig())
    assert len(fine) >= 48
    assert (apart(fine.directions, truth[3:6]) < 0.01).all()
    assert np.allclose(fine.radii, truth[6], rtol=0.005)
    assert (apart((fine.points - truth[:3]) / truth[6], truth[3:6]) < 0.01).all()
    # each still speaks for its own place: what of the axis was nearest to its centre
    kept = rough.take(fine.parents)
    along = np.einsum("ij,ij->i", fine.points - kept.points, fine.directions)
    assert np.allclose(along, 0, atol=1e-9 * truth[6])
    assert (fine.extents > truth[6]).all()
    assert (fine.inliers > 30).all()


def test_only_the_right_one_of_two_axes_is_kept(scan):
    frame, truth = scan
    fits = []
    for normal in random_directions(200, np.random.default_rng(1)):
        cosine = abs(normal[2])
        if not np.cos(np.radians(60)) < cosine < np.cos(np.radians(25)):
            continue
        plane = Plane(truth[:3], normal)
        across = np.cross(normal, [0, 0, 1])
        minor = plane.project(plane.point + across / np.linalg.norm(across))
        angle = np.arctan2(minor[1], minor[0]) + np.pi / 2
        fits.append([EllipseFit(Ellipse((0, 0), truth[6] / cosine, truth[6], angle), plane, 50)])
    proposed = propose_cylinders(fits)
    right = apart(proposed.directions, [0, 0, 1]) < 1e-6
    assert right.sum() == len(fits) == len(proposed) / 2
    fine = polish_candidates(proposed, frame, (0.0, np.inf), CandidatesConfig())
    good = apart(fine.directions, [0, 0, 1]) < 0.01
    assert good.mean() > 0.95
    assert len(np.unique(fine.parents[good])) == len(fits)


@pytest.mark.parametrize("radii", [(1.1, np.inf), (0.0, 0.9)])
def test_radii_out_of_range_are_dropped(scan, radii):
    frame, truth = scan
    limits = radii[0] * truth[6], radii[1] * truth[6]
    assert len(polish_candidates(candidates_of(truth[None].copy()), frame, limits, CandidatesConfig())) == 0


@pytest.mark.parametrize("strict", [{"min_inliers": 100000}, {"min_share": 1.0}])
def test_badly_supported_candidates_are_dropped(scan, strict):
    frame, truth = scan
    one = candidates_of(truth[None].copy())
    assert len(polish_candidates(one, frame, (0.0, np.inf), CandidatesConfig())) == 1
    assert len(polish_candidates(one, frame, (0.0, np.inf), CandidatesConfig(**strict))) == 0


def test_candidates_with_nothing_about_them_are_dropped():
    scene = multi(points=3000, cylinders=0, spheres=0, boxes=0, cones=0, planes=1, noise=0.0, seed=1)
    frame, _ = make_frame(scene.points, Config())
    models = np.tile([10.0, 10.0, 30.0, 0, 0, 1, 5.0], (3, 1))
    assert len(polish_candidates(candidates_of(models), frame, (0.0, np.inf), CandidatesConfig())) == 0


def test_the_polish_leaves_what_it_was_given(scan):
    frame, truth = scan
    rough = candidates_of(truth[None] * [1, 1, 1, 1, 1, 1, 1.05])
    before = rough.models.copy()
    polish_candidates(rough, frame, (0.0, np.inf), CandidatesConfig())
    assert np.array_equal(rough.models, before)
