"""Fittings between cylinders: each kind is found where it is, as exactly as the noise allows, and only there."""

import math

import numpy as np
import pytest

from tests.support.pipework import Pipework, X, Y, Z, fit_of, of_kind

R = 0.05


def elbow(angle_deg=90.0, bend_radius=0.15, over=0.02, seed=0):
    """Make two straights with a bend between them."""
    work = Pipework(seed)
    work.pipe([-1, 0, 0], [0, 0, 0], R, over=(0, over))
    end, onward = work.bend([0, 0, 0], X, Y, bend_radius, math.radians(angle_deg), R)
    work.pipe(end, end + onward, R, over=(over, 0))
    return work


@pytest.mark.parametrize(("angle", "bend_radius"), [(90, 0.15), (90, 0.075), (45, 0.25), (60, 0.15), (120, 0.15)])
def test_an_elbow_is_fitted(angle, bend_radius):
    traced = elbow(angle, bend_radius).traced()
    (found,) = traced.piping.fittings
    assert found.kind == "elbow"
    assert found.joins == (0, 1)
    assert math.degrees(found.angle) == pytest.approx(angle, abs=0.5)
    assert abs(found.bend_radius - bend_radius) < max(4.0 * found.std["bend_radius"], 0.03 * bend_radius)
    assert found.radius == pytest.approx(R, rel=0.02)
    assert found.center == pytest.approx([0, bend_radius, 0], abs=0.04 * bend_radius + 0.003)
    assert found.normal == pytest.approx(Z, abs=0.02)
    assert found.start == pytest.approx(np.zeros(3), abs=0.01)
    assert found.confidence > 0.9
    (run,) = traced.piping.runs
    assert set(run.cylinders) == {0, 1}
    assert run.length == pytest.approx(2.0 + bend_radius * math.radians(angle), rel=0.01)


def test_straights_end_where_the_elbow_begins():
    traced = elbow(over=0.06).traced()
    assert traced.cylinders[0].cylinder.end == pytest.approx([0, 0, 0], abs=0.01)
    assert traced.cylinders[1].cylinder.start == pytest.approx([0.15, 0.15, 0], abs=0.01)
    assert (traced.piping.labels >= 0).sum() == traced.piping.fittings[0].inliers
    assert not ((traced.labels >= 0) & (traced.piping.labels >= 0)).any()


def test_the_bend_radius_scatters_as_it_says():
    found = [elbow(seed=seed).traced().piping.fittings[0] for seed in range(12)]
    scaled = [(one.bend_radius - 0.15) / one.std["bend_radius"] for one in found]
    assert 0.3 < np.std(scaled) < 2.0


def test_two_ends_that_point_past_each_other_are_joined_by_nothing():
    work = Pipework()
    work.pipe([-1, 0, 0], [0, 0, 0], R)
    work.pipe([0.15, 0.15, 0.2], [0.15, 1.15, 0.2], R)
    traced = work.traced()
    assert [one.kind for one in traced.piping.fittings] == []
    assert len(traced.piping.runs) == 2


def test_a_pipe_behind_an_elbow_that_nobody_found_is_found():
    work = Pipework()
    work.pipe([-1, 0, 0], [0, 0, 0], R)
    end, onward = work.bend([0, 0, 0], X, Y, 0.15, math.pi / 2, R)
    work.pipe(end, end + 0.12 * onward, R, known=False)
    last, away = work.bend(end + 0.12 * onward, onward, Z, 0.15, math.pi / 2, R)
    work.pipe(last, last + away, R)
    traced = work.traced()
    assert len(traced.cylinders) == 3
    assert traced.origins == (0, 1, None)
    assert traced.cylinders[2].cylinder.height == pytest.approx(0.12, abs=0.03)
    assert [math.degrees(one.angle) for one in of_kind(traced, "elbow")] == pytest.approx([90, 90], abs=1.5)
    assert traced.piping.runs[0].cylinders in {(0, 2, 1), (1, 2, 0)}


@pytest.mark.parametrize("offset", [0.0, 0.02], ids=["concentric", "eccentric"])
def test_a_reducer_is_fitted(offset):
    work, small = Pipework(), 0.03
    work.pipe([-1, 0, 0], [0, 0, 0], R, over=(0, 0.03))
    work.cone([0, 0, 0], [0.12, 0, offset], R, small, axis=X)
    work.pipe([0.12, 0, offset], [1, 0, offset], small, over=(0.03, 0))
    (found,) = work.traced().piping.fittings
    assert found.kind == "reducer"
    assert sorted([found.start_radius, found.end_radius]) == pytest.approx([small, R], rel=0.02)
    ends = sorted([found.start[0], found.end[0]])
    assert ends == pytest.approx([0.0, 0.12], abs=0.02)
    assert found.offset == pytest.approx(offset, abs=0.002)
    assert found.concentric == (offset == 0.0)


def test_the_end_of_an_insulation_is_no_reducer():
    work = Pipework()
    work.pipe([-1, 0, 0], [1, 0, 0], R)
    work.pipe([0, 0, 0], [0.8, 0, 0], 0.09)
    work.disc(np.zeros(3), X, R, 0.09)
    traced = work.traced()
    assert traced.piping.fittings == ()
    assert len(traced.cylinders) == 2


@pytest.mark.parametrize("angle", [90, 45])
def test_a_tee_is_told_by_the_axes(angle):
    work, small = Pipework(), 0.03
    main = work.pipe([-1, 0, 0], [1, 0, 0], R)
    onward = np.array([math.cos(math.radians(angle)), 0, math.sin(math.radians(angle))])
    branch = work.pipe(R / math.sin(math.radians(angle)) * onward, 0.8 * onward, small)
    (found,) = work.traced().piping.fittings
    assert found.kind == "tee"
    assert (found.main, found.branches) == ((main,), (branch,))
    assert found.ends == ("side", "start")
    assert math.degrees(found.angle) == pytest.approx(angle, abs=0.5)
    assert found.center == pytest.approx(np.zeros(3), abs=0.005)


def test_branches_that_face_each_other_are_a_cross():
    work, small = Pipework(), 0.03
    work.pipe([-1, 0, 0], [1, 0, 0], R)
    work.pipe([0, 0, R], [0, 0, 0.6], small)
    work.pipe([0, 0, -0.6], [0, 0, -R], small)
    (found,) = work.traced().piping.fittings
    assert found.kind == "cross"
    assert set(found.branches) == {1, 2}


def test_a_pipe_that_was_found_through_another_is_two_branches():
    work, small = Pipework(), 0.03
    work.pipe([-1, 0, 0], [1, 0, 0], R)
    work.pipe([0, 0, -0.6], [0, 0, 0.6], small)
    traced = work.traced()
    assert len(traced.cylinders) == 3
    assert [one.kind for one in traced.piping.fittings] == ["cross"]


def test_pipes_that_cross_without_contact_are_two_runs():
    work = Pipework()
    work.pipe([-1, 0, 0], [1, 0, 0], R)
    work.pipe([0, -1, 0.2], [0, 1, 0.2], R)
    traced = work.traced()
    assert traced.piping.fittings == ()
    assert [run.cylinders for run in traced.piping.runs] == [(0,), (1,)]


@pytest.mark.parametrize("thickness", [0.04, 0.06])
def test_a_flange_is_fitted(thickness):
    work = Pipework()
    work.pipe([-1, 0, 0], [1, 0, 0], R)
    work.flange(np.array([0.2, 0, 0]), X, R, 0.1, thickness)
    (found,) = work.traced().piping.fittings
    assert found.kind == "flange"
    assert (found.joins, found.ends, found.pair) == ((0,), ("side",), True)
    assert found.center == pytest.approx([0.2, 0, 0], abs=0.004)
    assert found.radius == pytest.approx(0.1, abs=0.003)
    assert found.thickness == pytest.approx(thickness, abs=0.006)


def test_the_rim_of_a_flange_is_no_pipe():
    work = Pipework()
    work.pipe([-1, 0, 0], [1, 0, 0], R)
    work.flange(np.array([0.2, 0, 0]), X, R, 0.1, 0.05)
    work.fits.append(fit_of([0.175, 0, 0], [0.225, 0, 0], 0.1))
    work.labels[-1][:] = 1
    traced = work.traced()
    assert traced.origins == (0,)
    assert [one.kind for one in traced.piping.fittings] == ["flange"]


def test_a_wall_that_a_pipe_goes_through_is_no_flange():
    work = Pipework()
    work.pipe([-1, 0, 0], [1, 0, 0], R)
    wall = np.column_stack([np.zeros(9000), work.rng.uniform(-1, 1, (9000, 2))])
    work.add(wall[np.hypot(wall[:, 1], wall[:, 2]) > R])
    assert work.traced().piping.fittings == ()


def test_a_gap_within_a_pipe_is_bridged_and_said_to_be_assumed():
    work = Pipework()
    work.pipe([-1, 0, 0], [0, 0, 0], R)
    work.pipe([0.3, 0, 0], [1, 0, 0], R)
    (found,) = work.traced().piping.fittings
    assert found.kind == "joint"
    assert found.assumed
    assert found.length == pytest.approx(0.3, abs=0.02)


def test_a_cap_closes_an_end_of_a_run():
    work = elbow()
    work.disc(np.array([-1.0, 0, 0]), X, 0.0, R)
    traced = work.traced()
    (found,) = of_kind(traced, "cap")
    assert found.center == pytest.approx([-1, 0, 0], abs=0.003)
    assert found.axis == pytest.approx(-X, abs=0.01)
    assert [one.kind for one in traced.piping.fittings if one is not found] == ["elbow"]


def test_a_disc_at_the_end_of_a_cylinder_alone_is_no_cap():
    work = Pipework()
    work.pipe([-1, 0, 0], [0, 0, 0], R)
    work.disc(np.zeros(3), X, 0.0, R)
    assert work.traced().piping.fittings == ()


def test_two_pipes_that_overlap_in_a_slight_bend_are_joined_once():
    work, angle = Pipework(), math.radians(15.0)
    work.pipe([-0.2, 0, 0], [0, 0, 0], R, over=(0, 0.09))
    end, onward = work.bend([0, 0, 0], X, Y, 0.18, angle, R)
    work.pipe(end, end + 0.2 * onward, R, over=(0.09, 0))
    traced = work.traced()
    assert [one.kind for one in traced.piping.fittings] == ["elbow"]
    assert [one.cylinder.height for one in traced.cylinders] == pytest.approx([0.2, 0.2], abs=0.03)
    assert math.degrees(traced.piping.fittings[0].angle) == pytest.approx(15.0, abs=1.0)


def test_what_is_found_turns_and_grows_with_the_cloud():
    work = elbow()
    points, labels = work.cloud()
    from cylx.geometry.cylinder import Cylinder
    from cylx.runs import trace_runs

    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    origin, scale = np.array([500_000.0, 5_000_000.0, 100.0]), 1000.0

    def moved(fit):
        shape = fit.cylinder
        units = np.array([scale, scale, 1, 1, scale])
        there = Cylinder(
            scale * turn @ shape.point + origin, turn @ shape.direction, scale * shape.radius, scale * shape.height
        )
        return fit.__class__(
            there,
            fit.inliers,
            scale * fit.rmse,
            fit.coverage,
            10,
            0.9,
            0.98,
            covariance=fit.covariance * np.outer(units, units),
        )

    here = trace_runs(work.fits, points, labels, spacing=0.016, noise=0.002)
    fits = [moved(fit) for fit in work.fits]
    there = trace_runs(fits, scale * points @ turn.T + origin, labels, spacing=16.0, noise=2.0)
    (one,), (other,) = here.piping.fittings, there.piping.fittings
    assert other.bend_radius / scale == pytest.approx(one.bend_radius, rel=1e-3)
    assert other.angle == pytest.approx(one.angle, abs=1e-4)
    assert (other.center - origin) / scale == pytest.approx(turn @ one.center, abs=1e-3)


def test_without_points_the_axes_tell():
    work = elbow(over=0.0)
    from cylx.runs import trace_runs

    traced = trace_runs(work.fits, np.empty((0, 3)), np.empty(0, np.int32), spacing=0.016, noise=0.002)
    (found,) = traced.piping.fittings
    assert found.kind == "elbow"
    assert found.bend_radius == pytest.approx(0.15, rel=0.02)
    assert (found.inliers, found.confidence) == (0, 0.5)


def test_nothing_is_made_of_nothing():
    work = Pipework()
    work.pipe([-1, 0, 0], [1, 0, 0], R)
    traced = work.traced()
    assert traced.piping.fittings == ()
    (run,) = traced.piping.runs
    assert run.length == pytest.approx(2.0)
    assert {one.reason for one in run.open_ends} == {"leaves_cloud"}
