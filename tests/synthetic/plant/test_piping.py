"""Scenes of piping: what the truth says of runs and fittings must be so in the cloud."""

import json
from itertools import combinations, pairwise

import numpy as np
import pytest

from cylx.errors import UsageError
from cylx.geometry.cylinder import cylinder_coordinates
from cylx.synthetic import NOISE, OTHER_SURFACE, piping
from cylx.synthetic.placement import segment_distances
from cylx.synthetic.plant.piping import room_size, scanner_places

KINDS = {"elbow", "tee", "cross", "reducer", "flange", "inline", "cap", "joint"}
LIFT = 0.02
"""Points within so many radii of a pipe that begins there may be missing or inside it."""


@pytest.fixture(scope="module", params=[(5, 0), (8, 3)], ids=["small", "larger"])
def scene(request):
    runs, seed = request.param
    return piping(points=60000, runs=runs, seed=seed, sigma=0.0, noise=0.0)


@pytest.fixture(scope="module")
def truth(scene):
    return scene.truth()


def of_kind(truth, *kinds):
    found = [entry for entry in truth["fittings"] if entry["kind"] in kinds]
    assert found
    return found


def ends_of(entry):
    return np.array([entry["start"], entry["end"]])


def centre_line(entry, cylinders):
    """Give points along the centre line of a fitting, and its radius there."""
    if entry["kind"] == "elbow":
        center, start = np.array(entry["center"]), np.array(entry["start"])
        turned = np.radians(np.linspace(0, entry["angle_deg"], 12))[:, None]
        u, v = start - center, np.cross(entry["normal"], start - center)
        return center + np.cos(turned) * u + np.sin(turned) * v, entry["radius"]
    if entry["kind"] == "reducer":
        return ends_of(entry), max(entry["start_radius"], entry["end_radius"])
    if entry["kind"] in {"flange", "inline"}:
        axis = np.array(cylinders[entry["joins"][0]]["axis_direction"])
        half = 0.5 * entry.get("thickness", entry.get("length"))
        return np.array(entry["center"]) + np.outer([-half, half], axis), entry["radius"]
    return None


def test_every_kind_is_there():
    scene = piping(points=2000, seed=0)
    assert {fitting.kind for fitting in scene.fittings} == KINDS
    assert len(scene.runs) == 5


@pytest.mark.parametrize("runs", [1, 20])
def test_a_plant_has_the_runs_that_were_asked_for(runs):
    scene = piping(points=3000, runs=runs, seed=5)
    assert len(scene.runs) == runs
    assert all(len(run.cylinders) >= 3 for run in scene.runs)
    for attribute in ("cylinders", "fittings"):
        listed = [one for run in scene.runs for one in getattr(run, attribute)]
        assert len(listed) == len(set(listed))
        assert sorted(listed) == list(range(len(listed)))


def test_points_are_on_what_their_label_says(scene):
    for index, true in enumerate(scene.cylinders):
        own = scene.points[scene.labels == index]
        assert len(own) == true.points
        heights, distances, _ = cylinder_coordinates(own, true.cylinder.point, true.cylinder.direction)
        assert np.allclose(distances, true.cylinder.radius, rtol=0, atol=1e-9)
        hidden = true.cylinder.radius  # the foot of a branch goes down into the pipe it starts from
        assert (np.abs(heights) <= 0.5 * true.cylinder.height + hidden).all()
    for index, true in enumerate(scene.fittings):
        assert (scene.fitting_labels == index).sum() == true.points


def test_points_of_an_elbow_are_on_its_torus_between_its_ends(scene, truth):
    for entry in of_kind(truth, "elbow"):
        own = scene.points[scene.fitting_labels == entry["id"]] - entry["center"]
        normal, start = np.array(entry["normal"]), np.array(entry["start"]) - entry["center"]
        across = own @ normal
        x, y = own @ start / entry["bend_radius"], own @ np.cross(normal, start) / entry["bend_radius"]
        off = np.hypot(np.hypot(x, y) - entry["bend_radius"], across)
        assert np.allclose(off, entry["radius"], rtol=0, atol=1e-9)
        angles = np.degrees(np.arctan2(y, x))
        assert ((angles > -1e-9) & (angles < entry["angle_deg"] + 1e-9)).all()


def test_elbows_go_on_where_pipes_end_in_their_direction(truth):
    for entry in of_kind(truth, "elbow"):
        normal, center = np.array(entry["normal"]), np.array(entry["center"])
        for place, joined in zip(ends_of(entry), entry["joins"], strict=True):
            pipe = truth["cylinders"][joined]
            assert np.linalg.norm(place - center) == pytest.approx(entry["bend_radius"])
            assert np.linalg.norm(ends_of(pipe) - place, axis=1).min() < 1e-9
            tangent = np.cross(normal, place - center) / entry["bend_radius"]
            assert abs(tangent @ pipe["axis_direction"]) == pytest.approx(1)
            assert pipe["radius"] == entry["radius"]
        first, second = (np.cross(normal, place - center) for place in ends_of(entry))
        turned = np.degrees(np.arccos(first @ second / entry["bend_radius"] ** 2))
        assert turned == pytest.approx(entry["angle_deg"])
        nominal = 2 * entry["radius"]
        assert 0.8 * nominal < entry["bend_radius"] < 5.0 * nominal  # nominal diameters are below the outer ones


def test_points_of_a_reducer_are_on_its_oblique_cone(scene, truth):
    for entry in of_kind(truth, "reducer"):
        (start, end), pipes = ends_of(entry), [truth["cylinders"][one] for one in entry["joins"]]
        assert [pipe["radius"] for pipe in pipes] == [entry["start_radius"], entry["end_radius"]]
        axis = np.array(pipes[0]["axis_direction"])
        axis = axis if axis @ (end - start) > 0 else -axis
        aside = np.linalg.norm(end - start - (end - start) @ axis * axis)
        assert aside == pytest.approx(entry["offset"], abs=1e-9)
        assert entry["concentric"] == (entry["offset"] == 0)
        own = scene.points[scene.fitting_labels == entry["id"]]
        share = (own - start) @ axis / ((end - start) @ axis)
        assert ((share > -1e-9) & (share < 1 + 1e-9)).all()
        rho = np.linalg.norm(own - start - share[:, None] * (end - start), axis=1)
        assert np.allclose(rho, (1 - share) * entry["start_radius"] + share * entry["end_radius"], rtol=0, atol=1e-9)


def test_a_tee_is_where_axes_meet_at_its_angle(truth):
    for entry in of_kind(truth, "tee", "cross"):
        assert entry["joins"] == entry["main"] + entry["branches"]
        assert len(entry["branches"]) == (2 if entry["kind"] == "cross" else 1)
        main = truth["cylinders"][entry["main"][0]]
        for branch in (truth["cylinders"][one] for one in entry["branches"]):
            for pipe in (main, branch):
                between = np.array(entry["center"]) - pipe["axis_point"]
                along = between @ pipe["axis_direction"]
                assert np.linalg.norm(between - along * np.array(pipe["axis_direction"])) < 1e-9
            cosine = abs(np.dot(main["axis_direction"], branch["axis_direction"]))
            assert np.degrees(np.arccos(cosine)) == pytest.approx(entry["angle_deg"])
            assert branch["radius"] <= main["radius"]
            away = np.linalg.norm(ends_of(branch) - entry["center"], axis=1).min()
            assert away == pytest.approx(main["radius"] / np.sin(np.radians(entry["angle_deg"])))


def test_flanges_and_valves_are_about_the_axis_they_sit_on(scene, truth):
    for entry in of_kind(truth, "flange", "inline"):
        (joined,) = entry["joins"]
        pipe = truth["cylinders"][joined]
        between = np.array(entry["center"]) - pipe["axis_point"]
        assert np.linalg.norm(np.cross(between, pipe["axis_direction"])) < 1e-9
        assert abs(np.dot(entry["axis"], pipe["axis_direction"])) == pytest.approx(1)
        own = scene.points[scene.fitting_labels == entry["id"]]
        heights, distances, _ = cylinder_coordinates(own, np.array(entry["center"]), np.array(entry["axis"]))
        assert (np.abs(heights) <= 0.5 * entry.get("thickness", entry.get("length")) + 1e-9).all()
        assert (distances <= entry["radius"] + 1e-9).all()
    rims = [one for one in truth["cylinders"] if "part_of" in one]
    assert rims
    assert all(one["ignore"] and truth["fittings"][one["part_of"]]["kind"] == "flange" for one in rims)


def test_lengths_of_runs_add_up_and_everything_is_connected(truth):
    for run in truth["runs"]:
        fittings = [truth["fittings"][one] for one in run["fittings"]]
        length = sum(truth["cylinders"][one]["height"] for one in run["cylinders"])
        together = {one: {one} for one in run["cylinders"]}
        for entry in fittings:
            if entry["kind"] == "elbow":
                length += entry["bend_radius"] * np.radians(entry["angle_deg"])
            elif entry["kind"] == "reducer":
                length += np.linalg.norm(np.subtract(entry["end"], entry["start"]))
            elif entry["kind"] in {"tee", "cross"}:  # branches count from the axis of the pipe they start from
                radius = truth["cylinders"][entry["main"][0]]["radius"]
                length += len(entry["branches"]) * radius / np.sin(np.radians(entry["angle_deg"]))
            group = set().union(*(together[one] for one in entry["joins"]))
            together.update(dict.fromkeys(group, group))
            assert entry["run"] == run["id"]
        assert run["length"] == pytest.approx(length)
        assert together[run["cylinders"][0]] == set(run["cylinders"])


def test_every_end_is_joined_capped_or_open(truth):
    for run in truth["runs"]:
        fittings = [truth["fittings"][one] for one in run["fittings"]]
        joints = sum(2 for one in fittings if one["kind"] in {"elbow", "reducer"})
        branches = sum(len(one["branches"]) for one in fittings if one["kind"] in {"tee", "cross"})
        caps = sum(one["kind"] == "cap" for one in fittings)
        assert 2 * len(run["cylinders"]) == joints + branches + caps + len(run["open_ends"])
        for end in run["open_ends"]:
            assert end["reason"] in {"nothing_there", "leaves_cloud"}
            ends = ends_of(truth["cylinders"][end["cylinder"]])
            assert np.linalg.norm(ends - end["point"], axis=1).min() < 1e-9


def test_nothing_interpenetrates_unless_it_is_joined(truth):
    cylinders = truth["cylinders"]
    straights = [one for one in cylinders if "run" in one or "insulates" in one]
    joined = {frozenset(pair) for one in truth["fittings"] for pair in combinations(one["joins"], 2)}
    joined |= {frozenset((one["id"], one["insulates"])) for one in straights if "insulates" in one}
    starts, ends = (np.array([one[key] for one in straights]) for key in ("start", "end"))
    radii = np.array([one["radius"] for one in straights])
    for one, radius in zip(straights, radii, strict=True):
        gaps = segment_distances(np.array(one["start"]), np.array(one["end"]), starts, ends) - radii - radius
        others = [other["id"] != one["id"] and frozenset((one["id"], other["id"])) not in joined for other in straights]
        assert gaps[others].min() > 0
    for entry in truth["fittings"]:
        line = centre_line(entry, cylinders)
        if line is None:
            continue
        for start, end in pairwise(line[0]):
            gaps = segment_distances(start, end, starts, ends) - radii - line[1]
            strangers = [
                one["id"] not in entry["joins"] and one.get("insulates") not in entry["joins"] for one in straights
            ]
            assert gaps[strangers].min() > 0


def test_points_are_seen_by_a_scanner(scene, truth):
    """March along the rays of some points: to one scanner at least no pipe and no elbow is in the way."""
    rng = np.random.default_rng(0)
    chosen = rng.choice(len(scene.points), 40, replace=False)
    places = scanner_places(room_size(len(scene.runs)))[:4]
    steps = np.linspace(0, 1, 200)[:, None]
    lines = [
        (np.array([one["start"], one["end"]]), one["radius"]) for one in truth["cylinders"] if "part_of" not in one
    ]
    lines += [centre_line(entry, truth["cylinders"]) for entry in of_kind(truth, "elbow")]
    for point in scene.points[chosen]:
        free = False
        for place in places:
            way = point + steps * (place - point)
            way = way[np.linalg.norm(way - point, axis=1) > 0.02]
            free |= all(_clear(way, line, radius) for line, radius in lines)
        assert free


def _clear(way, line, radius):
    for start, end in pairwise(line):
        along = np.clip((way - start) @ (end - start) / ((end - start) @ (end - start)), 0, 1)
        flat = (along > 0) & (along < 1)
        if (np.linalg.norm(way - start - along[:, None] * (end - start), axis=1)[flat] < 0.97 * radius - 0.001).any():
            return False
    return True


def test_hidden_sides_gaps_and_insulated_pipes_have_no_points(scene, truth):
    one_view = piping(points=40000, runs=5, scanners=1, seed=0, sigma=0.0, noise=0.0)
    widest = [true.coverage_deg for true in one_view.cylinders if "run" in true.of]
    assert max(widest) <= 185.0  # of a convex mantle nobody sees more than half
    for true in scene.cylinders:
        if true.pieces is None:
            continue
        own = scene.points[scene.labels == scene.cylinders.index(true)]
        heights = (own - true.cylinder.point) @ true.cylinder.direction
        bounds = np.sort((true.pieces - true.cylinder.point) @ true.cylinder.direction, axis=1)
        inside = np.zeros(len(own), dtype=bool)
        for low, high in bounds:
            inside |= (heights > low - LIFT * true.cylinder.radius) & (heights < high + LIFT * true.cylinder.radius)
        foot = np.abs(heights) > 0.5 * true.cylinder.height  # of a branch
        assert (inside | foot).all()


def test_what_is_hardly_seen_need_not_be_found(scene):
    for true in scene.fittings:
        hardly = true.points < 30 or true.seen < 0.15 or true.kind == "joint" or true.part_of is not None
        assert 0 <= true.seen <= 1
        assert true.ignore or not hardly
    assert any(true.ignore for true in scene.fittings)
    assert not all(true.ignore for true in scene.fittings)


def test_labels_name_noise_and_other_surfaces():
    scene = piping(points=20000, runs=2, noise=0.1, seed=1)
    assert (scene.labels == NOISE).sum() == 2000
    assert (scene.labels == OTHER_SURFACE).any()
    assert scene.fitting_labels.min() == OTHER_SURFACE
    assert (scene.fitting_labels[scene.labels == NOISE] == OTHER_SURFACE).all()


def test_moving_carries_fittings_and_runs_along():
    scene = piping(points=3000, runs=2, seed=2)
    offset = np.array([100.0, -200.0, 300.0])
    before, after = scene.truth(), scene.moved(1000.0, offset).truth()
    assert json.loads(json.dumps(after)) == after
    for old, new in zip(before["fittings"], after["fittings"], strict=True):
        assert np.allclose(new["center"], 1000 * np.array(old["center"]) + offset)
        for key in ("angle_deg", "points", "seen", "joins", "axis", "normal"):
            assert new.get(key) == old.get(key)
        for key in ("radius", "bend_radius", "thickness", "start_radius", "end_radius", "offset", "length"):
            if key in old:
                assert new[key] == pytest.approx(1000 * old[key])
    for old, new in zip(before["runs"], after["runs"], strict=True):
        assert new["length"] == pytest.approx(1000 * old["length"])
    assert np.allclose(after["cylinders"][0]["pieces"], 1000 * np.array(before["cylinders"][0]["pieces"]) + offset)


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"points": 0}, "points: must be > 0, not 0; choose another value"),
        ({"runs": 0}, "runs: must be > 0, not 0; choose another value"),
        ({"scanners": 9}, "scanners: must be 1 to 8, not 9; choose another value"),
        ({"scanners": 0}, "scanners: must be 1 to 8, not 0; choose another value"),
        ({"planes": 7}, "planes: must be 0 to 6, not 7; choose another value"),
        ({"noise": 1.0}, "noise: must be in [0, 1), not 1.0; choose another value"),
        ({"sigma": -1.0}, "sigma: must be >= 0, not -1.0; choose another value"),
        ({"seed": -1}, "seed: must be >= 0, not -1; choose another value"),
    ],
)
def test_what_cannot_be_made_is_refused(params, message):
    with pytest.raises(UsageError) as caught:
        piping(**params)
    assert str(caught.value) == message
