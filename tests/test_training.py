"""How the evidence is trained: laws of the fit and of its scores, labels, and the scenes it learns from."""

import functools
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylx.evaluation import evaluate
from cylx.evidence import weights as evidence_weights
from cylx.geometry.cylinder import Cylinder, cylinder_coordinates
from cylx.synthetic import OTHER_SURFACE
from cylx.synthetic.surfaces import Box, Mantle, Sphere, Wall

sys.path.insert(0, str(Path(__file__).parent / "training"))

import ablation
import arcs
import collect
import drafts
import fit
import labels
import logistic
import real
import references
import scenes
import scores
import solids
import things
import visibility

POINTS = 30000
SEEDS = {"plant": (3, 4), "steelwork": (3, 7)}
"""Of kinds whose scenes take seconds, those that take the fewest."""
"""Of a scene."""
SIGNS = np.array([1.0, -1.0, 1.0])


def drawn_rows(rng, n, bias, weights, scenes_=60):
    """Draw rows of standard normal terms whose truth follows a law; every row is a cylinder of its own."""
    terms = rng.standard_normal((n, len(weights)))
    odds = bias + terms @ np.asarray(weights)
    true = rng.random(n) < 1 / (1 + np.exp(-odds))
    owners = np.where(true, np.arange(n), -1)
    return logistic.Rows(terms, true, np.array([f"s{i}" for i in rng.integers(0, scenes_, n)]), owners)


def errors_at_the_bound(rows, law):
    """Give the standard errors of bias and weights by the Fisher information."""
    design = np.column_stack([np.ones(len(rows.terms)), rows.terms])
    probability = law.probability(rows.terms)
    return np.sqrt(np.diag(np.linalg.inv(design.T @ (design * (probability * (1 - probability))[:, None]))))


@pytest.mark.parametrize("seed", range(4))
def test_the_fit_finds_the_law_that_rows_were_drawn_from(seed):
    rng = np.random.default_rng(seed)
    truth = logistic.Law(-1.5, np.array([2.0, -1.0, 0.5]))
    rows = drawn_rows(rng, 20000, *truth)
    found = logistic.fit_law(rows, SIGNS, caution=1.0)
    errors = errors_at_the_bound(rows, truth)
    assert abs(found.bias - truth.bias) < 4.5 * errors[0]
    assert (np.abs(found.weights - truth.weights) < 4.5 * errors[1:]).all()


def test_the_fit_does_not_depend_on_unit_and_zero_of_a_term():
    rows = drawn_rows(np.random.default_rng(1), 4000, -1.0, [1.0, -2.0, 0.3])
    scale, shift = np.array([1e-3, 1.0, 50.0]), np.array([7.0, -2.0, 1e3])
    plain = logistic.fit_law(rows, SIGNS)
    moved = logistic.fit_law(rows._replace(terms=scale * rows.terms + shift), SIGNS)
    assert moved.weights * scale == pytest.approx(plain.weights, rel=1e-3, abs=1e-4)


def test_no_weight_takes_the_wrong_sign():
    rows = drawn_rows(np.random.default_rng(2), 5000, 0.0, [-1.5, -1.0, 0.5])
    weights = logistic.fit_law(rows, SIGNS).weights
    assert weights[0] == 0
    assert (weights[1:] * SIGNS[1:] > 0).all()
    assert (np.copysign(1, logistic.fit_law(rows, -SIGNS).weights) == -SIGNS).all()


def test_fits_of_one_cylinder_count_as_one():
    rows = drawn_rows(np.random.default_rng(3), 3000, -1.0, [1.0, -1.0, 0.5])
    again = np.concatenate([np.arange(3000), np.repeat(np.flatnonzero(rows.true)[:200], 4)])
    once, often = logistic.fit_law(rows, SIGNS), logistic.fit_law(rows.subset(again), SIGNS)
    # the terms are standardised by all rows, so the penalty is not quite the same
    assert often.weights == pytest.approx(once.weights, rel=0.01)
    assert logistic.shared_weights(rows.subset(again)).sum() == pytest.approx(3000)


def test_equal_indices_in_two_scenes_are_two_cylinders():
    rows = logistic.Rows(
        np.zeros((4, 1)), np.array([1, 1, 1, 0], bool), np.array(list("aabb")), np.array([0, 0, 0, -1])
    )
    assert logistic.shared_weights(rows) == pytest.approx([0.5, 0.5, 1.0, 1.0])


def test_kinds_of_scenes_weigh_the_same_however_many_fits_they_have():
    scenes = np.array(["room1"] * 6 + ["clutter1"] * 1 + ["clutter12"] * 1)
    rows = logistic.Rows(np.zeros((8, 1)), np.zeros(8, bool), scenes, np.full(8, -1))
    weights = logistic.balanced_weights(rows)
    assert weights.sum() == pytest.approx(8)
    assert weights[:6].sum() == pytest.approx(weights[6:].sum())


@pytest.mark.parametrize(("name", "share"), [("plant3", 2.0), ("depth_learn33", 3.0), ("wild_tree.las", 3.0)])
def test_some_kinds_weigh_more(name, share):
    scenes = np.array(["room1"] * 6 + [name] * 2)
    weights = logistic.balanced_weights(logistic.Rows(np.zeros((8, 1)), np.zeros(8, bool), scenes, np.full(8, -1)))
    assert weights[6:].sum() == pytest.approx(share * weights[:6].sum())
    assert weights.sum() == pytest.approx(8)


def test_one_part_under_several_noises_is_in_one_fold_and_of_one_kind():
    names = [f"fit4cad_PC{part}@{noise:g}" for part in range(30) for noise in (0.0, 0.05, 0.5)]
    fold = logistic.folds_of(np.array(names)).reshape(30, 3)
    assert (fold == fold[:, :1]).all()
    assert len(set(fold[:, 0])) == logistic.FOLDS
    assert {logistic.kind_of(name) for name in names} == {"fit4cad"}


@given(st.lists(st.sampled_from("abcdefghijkl"), min_size=1, max_size=80))
def test_a_scene_is_never_in_two_folds(names):
    fold = logistic.folds_of(np.array(names), 4)
    assert len(set(zip(names, fold.tolist(), strict=True))) == len(set(names))
    sizes = np.bincount([fold[names.index(name)] for name in set(names)], minlength=4)
    assert sizes.max() - sizes.min() <= 1


def test_no_scene_helps_to_judge_itself():
    """A term that is the truth in one scene and nothing elsewhere would be believed if the scene were its own judge."""
    rows = drawn_rows(np.random.default_rng(5), 2000, -1.0, [1.0], scenes_=12)
    told = np.where(rows.scenes == "s0", np.where(rows.true, 5.0, -5.0), 0.0)
    rows = rows._replace(terms=np.column_stack([rows.terms, told]))
    mine, signs = rows.scenes == "s0", np.ones(2)
    own = logistic.fit_law(rows, signs).probability(rows.terms)[mine]
    fair = logistic.cross_validated(rows, signs)[mine]
    assert scores.average_precision(own, rows.true[mine]) == 1
    assert scores.average_precision(fair, rows.true[mine]) < 0.9


def test_a_false_row_weighs_as_much_as_caution_says():
    rows = drawn_rows(np.random.default_rng(5), 4000, -0.5, [2.0])
    twice = np.concatenate([np.arange(4000), np.flatnonzero(~rows.true)])
    cautious, doubled = (
        logistic.fit_law(rows, np.ones(1), caution=2.0),
        logistic.fit_law(rows.subset(twice), np.ones(1), caution=1.0),
    )
    assert cautious.bias == pytest.approx(doubled.bias, abs=0.02)
    assert cautious.bias < logistic.fit_law(rows, np.ones(1), caution=1.0).bias - 0.5


def test_cross_validated_probabilities_are_calibrated():
    rows = drawn_rows(np.random.default_rng(7), 30000, -1.5, [2.0, -1.0, 0.5])
    table = scores.calibration(logistic.cross_validated(rows, SIGNS, caution=1.0), rows.true)
    assert sum(count for _, _, count, _, _ in table) == 30000
    for low, high, count, mean, share in table:
        assert low <= mean <= high
        assert abs(share - mean) < 4.5 * np.sqrt(mean * (1 - mean) / count) + 0.002


def test_a_term_that_matters_is_missed_and_one_that_does_not_is_not():
    rows = drawn_rows(np.random.default_rng(9), 6000, -1.0, [2.0, -1.0, 0.0])
    full = fit.quality(logistic.cross_validated(rows, SIGNS), rows)["log_loss"]
    without = [fit.quality(probability, rows)["log_loss"] for probability in fit.left_out(rows, SIGNS)]
    assert without[0] > without[1] > full + 0.01
    assert without[2] == pytest.approx(full, abs=1e-3)


@pytest.mark.parametrize(
    ("probability", "true", "loss", "square", "precision"),
    [
        ([0.5, 0.5], [1, 0], np.log(2), 0.25, 0.5),
        ([0.8, 0.2], [1, 0], -np.log(0.8), 0.04, 1.0),
        ([0.9, 0.6, 0.3], [0, 1, 1], -np.log(0.1 * 0.6 * 0.3) / 3, (0.81 + 0.16 + 0.49) / 3, (1 / 2 + 2 / 3) / 2),
        ([0.7, 0.7, 0.7, 0.1], [1, 0, 1, 1], -np.log(0.7 * 0.3 * 0.7 * 0.1) / 4, 1.48 / 4, (2 * 2 / 3 + 3 / 4) / 3),
    ],
)
def test_scores_of_a_few(probability, true, loss, square, precision):
    probability, true, share = np.array(probability), np.array(true, bool), np.ones(len(true))
    assert scores.log_loss(probability, true, share) == pytest.approx(loss)
    assert scores.brier(probability, true, share) == pytest.approx(square)
    assert scores.average_precision(probability, true) == pytest.approx(precision)


def test_rates_at_a_bar():
    probability, true = np.array([0.9, 0.8, 0.6, 0.2]), np.array([1, 0, 1, 1], bool)
    assert scores.rates(probability, true, 0.5) == (2 / 3, 2 / 3)
    assert scores.rates(probability, true, 0.95) == (None, 0.0)
    rows = logistic.Rows(np.zeros((4, 0)), true, np.array(list("abaa")), np.array([3, -1, 3, 4]))
    assert scores.cylinders_found(probability, rows, 0.5) == {("a", 3)}


PIPE = Cylinder((1, 2, 3), (0, 0, 1), 0.5, 4.0)


def shifted(radius=0.5, aside=0.0, along=0.0, tilt=0.0):
    direction = (np.sin(np.radians(tilt)), 0, np.cos(np.radians(tilt)))
    return Cylinder(PIPE.point + np.array([0, aside, along]), direction, radius, 1.0)


def truth_of(*, ignore=False):
    """Write the truth of a scene with one pipe."""
    true = drafts.TrueCylinder(PIPE, 1000, 360.0, ignore)
    return drafts.SyntheticScene(np.zeros((0, 3)), np.zeros(0, np.int32), (true,), 0.0, "pipe", 0, {}).truth()


@pytest.mark.parametrize(
    ("given_", "label"),
    [
        (shifted(), labels.TRUE),
        (shifted(radius=0.55, aside=0.1, tilt=4), labels.TRUE),
        (shifted(along=2.4), labels.TRUE),
        (shifted(along=2.6), labels.FALSE),
        (shifted(tilt=6), labels.AMBIGUOUS),
        (shifted(tilt=9), labels.FALSE),
        (shifted(aside=0.15), labels.AMBIGUOUS),
        (shifted(aside=0.4), labels.FALSE),
        (shifted(radius=0.6), labels.AMBIGUOUS),
        (shifted(radius=0.7), labels.FALSE),
    ],
)
def test_labels(given_, label):
    for ignore, expected in ((False, label), (True, labels.IGNORED if label == labels.TRUE else labels.AMBIGUOUS)):
        (found,), (owner,) = labels.label_fits(truth_of(ignore=ignore), [given_])
        assert found == expected
        assert owner == (0 if expected in {labels.TRUE, labels.IGNORED} else None)


def test_labels_where_there_is_nothing():
    assert labels.label_fits({"cylinders": []}, [PIPE]) == ([labels.FALSE], [None])
    assert labels.label_fits(truth_of(), []) == ([], [])


TURN = solids.random_turn(np.random.default_rng(0))
SURFACES = {
    "mantle": Mantle(Cylinder((1, 2, 3), TURN[:, 0], 0.3, 2.0), 0.0, 2 * np.pi),
    "box": Box(np.ones(3), np.array([1.0, 2, 3]), TURN),
    "sphere": Sphere(np.ones(3), 0.7),
    "wall": Wall(np.array([2.0, 3, 1]), 2, 0.0),
    "cone": solids.cone(np.ones(3), TURN[:, 1], 0.3, 1.0, 0.2),
    "bulging": solids.worn(PIPE, 0.0, 2 * np.pi, 0.0, 0.1),
    "lid": solids.lid(PIPE, 1),
    "elbow": solids.Elbow(np.ones(3), TURN, 0.2, 0.6, 2.0),
    "horn": solids.Horn(np.ones(3), TURN, 0.2, 1.5, 1.5, 0.3, 0.0),
    "ellipsoid": solids.Ellipsoid(np.ones(3), np.array([0.5, 0.7, 1.1]), TURN),
    "rounded box": solids.RoundedBox(Box(np.ones(3), np.array([1.0, 2, 3]), TURN), 0.2),
}


@pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)
def test_a_step_along_the_normal_leaves_the_surface_at_a_right_angle(surface):
    """Points of the surface about a point lie, to first order, on the plane that the normal there says."""
    rng = np.random.default_rng(1)
    points = surface.sample(rng, 40000)
    normals = solids.normals_of(surface, points)
    assert np.linalg.norm(normals, axis=1) == pytest.approx(np.ones(len(points)))
    at = rng.choice(len(points), 200)
    _, near = drafts.cKDTree(points).query(points[at], k=6)
    steps = points[near[:, 1:]] - points[at][:, None]
    slopes = np.abs(np.einsum("ijk,ik->ij", steps, normals[at])) / np.linalg.norm(steps, axis=2)
    assert np.median(slopes) < 0.05
    assert (slopes.min(axis=1) < 0.2).mean() > 0.95  # but for edges


@pytest.mark.parametrize("name", ["cone", "bulging", "lid", "elbow", "horn", "ellipsoid"])
def test_points_are_even_over_the_area(name):
    """As many points per area near the one end of a surface as anywhere: the area is what the points say it is."""
    surface = SURFACES[name]
    rng = np.random.default_rng(2)
    points = surface.sample(rng, 60000)
    at = rng.choice(len(points), 3000, replace=False)
    reach = 0.06 * np.sqrt(surface.area)
    counts = drafts.cKDTree(points).query_ball_point(points[at], reach, return_length=True) - 1
    expected = len(points) * np.pi * reach**2 / surface.area
    assert np.median(counts) == pytest.approx(expected, rel=0.06)


def test_a_dent_is_as_deep_as_it_says_where_it_is():
    dent = solids.Dent(height=0.5, angle=1.0, depth=0.2, length=0.1, width=0.3)
    surface = solids.worn(PIPE, 0.0, 2 * np.pi, 0.0, 0.0, (dent,))
    heights, distances, angles = cylinder_coordinates(
        surface.sample(np.random.default_rng(5), 50000), PIPE.start, PIPE.direction
    )
    depths = 1 - distances / PIPE.radius
    at = (np.abs(heights - 0.5) < 0.02) & (np.abs(angles - 1.0) < 0.05)
    assert depths[at] == pytest.approx(0.2, abs=0.01)
    assert depths.max() <= 0.2 + 1e-9
    assert depths[np.abs(heights - 0.5) > 0.5] == pytest.approx(0.0, abs=1e-4)


def test_what_is_behind_is_not_seen():
    rng = np.random.default_rng(3)
    sketch = drafts.Sketch.empty()
    near, far = Sphere(np.array([2.0, 0, 0]), 0.5), Sphere(np.array([6.0, 0, 0]), 0.5)
    sketch.add(near, far, Sphere(np.array([0.0, 4.0, 0]), 0.5))
    draft, ranges = visibility.scanned(rng, sketch, [np.zeros(3)], bin_width=0.02, dense=300000, count=3000)
    assert 2500 < len(draft.points) <= 3200
    assert ranges == pytest.approx(np.linalg.norm(draft.points, axis=1))
    assert not (draft.points[:, 0] > 3).any()
    assert (draft.points[:, 0] > 1).any()
    assert (draft.points[:, 1] > 3).any()
    away = draft.points / ranges[:, None]
    centers = np.where(draft.points[:, :1] > 1, near.center, [0.0, 4.0, 0])
    assert (np.einsum("ij,ij->i", away, draft.points - centers) < 0).all()


def test_density_falls_with_the_square_of_the_range():
    rng = np.random.default_rng(4)
    sketch = drafts.Sketch.empty()
    for side, distance in ((0, 2.0), (1, 4.0)):
        sketch.add(Sphere(distance * np.eye(3)[side], 0.2))
    _, ranges = visibility.scanned(rng, sketch, [np.zeros(3)], bin_width=0.01, dense=400000, count=10000)
    assert (ranges < 3).sum() / (ranges > 3).sum() == pytest.approx(4, rel=0.1)


@functools.cache
def made(kind, seed):
    """Make a scene once for several tests: some kinds take seconds."""
    return scenes.make(kind, seed, POINTS)


@pytest.mark.parametrize("kind", scenes.KINDS)
def test_a_scene_is_its_kind_and_seed(kind):
    first, second = SEEDS.get(kind, (0, 1))
    one, same, other = made(kind, first), scenes.make(kind, first, POINTS), made(kind, second)
    assert (one.points == same.points).all()
    assert one.truth() == same.truth()
    assert one.points.shape != other.points.shape or (one.points != other.points).any()
    assert np.isfinite(one.points).all()


@pytest.mark.parametrize("kind", scenes.KINDS)
def test_the_truth_of_a_scene_is_where_its_points_are(kind):
    asked = 0
    for seed in SEEDS.get(kind, (0, 1, 2, 3)):
        scene = made(kind, seed)
        assert scene.labels.max(initial=-1) < len(scene.cylinders)
        assert (scene.labels == OTHER_SURFACE).any()
        for i, true in enumerate(scene.cylinders):
            mine = scene.points[scene.labels == i]
            assert len(mine) == true.points
            shape = true.cylinder
            if true.ignore:
                continue
            asked += 1
            heights, distances, _ = cylinder_coordinates(mine, shape.point, shape.direction)
            within = np.abs(distances - shape.radius) < 0.03 * shape.radius + 8 * scene.sigma
            assert within.mean() > (
                0.5 if kind in {"plant", "steelwork", "tabletop"} else 0.97
            )  # dents may be much of what is seen
            assert np.quantile(np.abs(heights), 0.95) < 0.5 * shape.height + 4 * scene.sigma
            assert true.points >= 40
            assert true.coverage_deg >= 25
            assert shape.height >= 0.5 * shape.radius
    assert asked > 0
    assert evaluate(scene.truth(), scene.truth()).f1 == 1


@pytest.mark.parametrize(
    ("change", "ignore"),
    [({}, False), ({"n": 39}, True), ({"arc": 15}, True), ({"height": 0.4}, True), ({"sigma": 0.4}, True)],
)
def test_what_need_not_be_found(change, ignore):
    given_ = {"n": 500, "arc": 90, "height": 2.0, "sigma": 0.01, **change}
    shape = Cylinder((0, 0, 0), (0, 0, 1), 1.0, given_["height"])
    seen = Mantle(shape, 0.3, np.radians(given_["arc"])).sample(np.random.default_rng(0), given_["n"])
    true = drafts.true_cylinder(shape, seen, given_["sigma"])
    assert true.ignore == ignore
    assert true.coverage_deg == pytest.approx(given_["arc"], abs=10 if given_["n"] > 100 else 60)
    assert drafts.true_cylinder(shape, seen, given_["sigma"], doubtful=True).ignore


def test_the_truth_ends_where_the_cylinder_is_hidden():
    shape = Cylinder((0, 0, 0), (0, 0, 1), 1.0, 10.0)
    seen = Mantle(shape, 0.0, 2 * np.pi).sample(np.random.default_rng(0), 5000)
    visible = drafts.true_cylinder(shape, seen[seen[:, 2] > 1], 0.01).cylinder
    assert visible.start[2] == pytest.approx(1, abs=0.1)
    assert visible.end[2] == pytest.approx(5, abs=0.1)


def test_rows_of_a_scene_hold_what_the_evidence_weighs(tmp_path, monkeypatch, capsys):
    output = tmp_path / "rows.jsonl"
    command = ["collect.py", str(output), "--kinds", "clutter", "--seeds", "0:2", "--points", "20000"]
    monkeypatch.setattr(sys, "argv", command)
    assert collect.main() == 0
    text = output.read_text(encoding="utf-8")
    lines = [json.loads(line) for line in text.splitlines()]
    assert {line["scene"] for line in lines} <= {"clutter0", "clutter1"}
    assert {labels.TRUE, labels.FALSE} <= {line["label"] for line in lines}
    for line in lines:
        assert (line["cylinder"] is None) == (line["label"] in {labels.FALSE, labels.AMBIGUOUS})
        # what counts as a point of a cylinder differs a little before and after all of them are known
        assert evidence_weights.weigh(line["measures"])[0] == pytest.approx(line["confidence"], abs=0.05)
    rows = fit.table_of(lines)
    assert rows.terms.shape == (len(rows.true), len(evidence_weights.TERMS))
    capsys.readouterr()
    monkeypatch.setattr(sys, "argv", [*command, "--append"])
    assert collect.main() == 0
    assert output.read_text(encoding="utf-8") == text
    assert capsys.readouterr().out == ""


def test_the_program_prints_what_can_be_pasted(tmp_path, monkeypatch, capsys):
    rng = np.random.default_rng(11)
    lines = [synthetic_line(rng, i) for i in range(400)]
    path, weights = tmp_path / "rows.jsonl", tmp_path / "weights.json"
    path.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")
    monkeypatch.setattr(sys, "argv", ["fit.py", str(path), "--ablation", str(weights)])
    assert fit.main() == 0
    out = capsys.readouterr().out
    assert "Brier score" in out
    laws = json.loads(weights.read_text(encoding="utf-8"))
    assert f"BIAS = {laws['all']['bias']:.3f}" in out
    for term in evidence_weights.TERMS:
        assert f'Term("{term.reason}", {laws["all"]["weights"][term.reason]:.3f}' in out
        assert set(laws["without"][term.reason]["weights"]) == {t.reason for t in evidence_weights.TERMS} - {
            term.reason
        }
    monkeypatch.setattr(sys, "argv", ["fit.py", str(path), str(path)])
    with pytest.raises(SystemExit, match="in another file"):
        fit.main()


def test_arcs_and_what_is_held_upright_have_weights_of_their_own(tmp_path, monkeypatch, capsys):
    rng = np.random.default_rng(12)
    fits, judged = [synthetic_line(rng, i) for i in range(300)], [synthetic_line(rng, i) for i in range(300)]
    both = [(line, opening) for opening in (0.0, 1.6) for line in judged]  # without the planes, and with them
    arcs = [{**line, "arc": True, "measures": {**line["measures"], "arc": x, "edge_gain": 90.0}} for line, x in both]
    arcs += [{**line, "arc": False, "upright": True} for line in judged]
    for name, lines in (("fits", fits), ("arcs", arcs)):
        text = "".join(json.dumps(line) + "\n" for line in lines)
        (tmp_path / f"{name}.jsonl").write_text(text, encoding="utf-8")
    names = [str(tmp_path / f"{name}.jsonl") for name in ("fits", "arcs")]
    monkeypatch.setattr(sys, "argv", ["fit.py", *names])
    assert fit.main() == 0
    out = capsys.readouterr().out
    cylinders, rest = out[: out.index("BLEND_BIAS")], out[out.index("BLEND_BIAS") :]
    blends, rest = rest[: rest.index("PROFILE_BIAS")], rest[rest.index("PROFILE_BIAS") :]
    profiles, upright = rest[: rest.index("UPRIGHT_BIAS")], rest[rest.index("UPRIGHT_BIAS") :]
    laws = (cylinders, evidence_weights.TERMS), (blends, evidence_weights.BLEND_TERMS)
    laws += (profiles, evidence_weights.PROFILE_TERMS), (upright, evidence_weights.UPRIGHT_TERMS)
    for part, terms in laws:
        for term in terms:
            assert f'Term("{term.reason}", ' in part
        assert "| source | scenes | fits |" in part
        assert "| s | 20 | 300 |" in part


@pytest.mark.parametrize(
    ("scene", "label", "tangent", "coverage", "missed"),
    [
        ("fit4cad_PC1@0.2", "true", 0.5, 1.6, True),
        ("fit4cad_PC1@0.2", "true", 0.0, 1.6, False),
        ("fit4cad_PC1@0.2", "true", 0.5, 6.0, False),
        ("fit4cad_PC1@0.2", "false", 0.5, 1.6, False),
        ("room3", "true", 0.5, 1.6, False),
    ],
)
def test_true_arcs_of_parts_are_no_cylinders_to_be_found(scene, label, tangent, coverage, missed):
    line = {"scene": scene, "label": label, "measures": {"tangent": tangent, "coverage": coverage}}
    assert fit.may_be_missed(line) == missed


PART = [{"axis_point": [1.0, 2.0, 3.0], "axis_direction": [0.0, 0.0, -1.0], "radius": 2.0}]


@pytest.mark.parametrize(
    ("point", "direction", "radius", "label"),
    [
        ((1, 2, 50), (0, 0, 1), 2.0, labels.TRUE),
        ((1.19, 2, 0), (0, 0, 1), 2.09, labels.TRUE),
        ((1.21, 2, 0), (0, 0, 1), 2.0, labels.AMBIGUOUS),
        ((1, 2, 3), (0, 0.1, 1), 2.0, labels.AMBIGUOUS),
        ((1, 2, 3), (0, 0, 1), 2.3, labels.AMBIGUOUS),
        ((1, 2, 3), (0, 0, 1), 2.5, labels.FALSE),
        ((3, 2, 3), (0, 0, 1), 2.0, labels.FALSE),
        ((1, 2, 3), (1, 0, 0), 2.0, labels.FALSE),
    ],
)
def test_what_a_fit_of_a_part_is(point, direction, radius, label):
    shape = Cylinder(point, direction, radius, 1.0)
    assert references.judge_of_part(PART)(shape) == (label, 0 if label == labels.TRUE else None)


def test_an_open_mug_is_known_by_either_wall():
    wall = {"point": [0.0, 0, 1], "axis": [0.0, 0, 2], "radius": 0.04}
    judge = references.judge_of_depth([{**wall, "alternatives": [{**wall, "radius": 0.05}]}])
    verdicts = [judge(Cylinder((0, 0, 1), (0, 0, 1), radius, 0.1)) for radius in (0.04, 0.05, 0.0445, 0.07)]
    assert verdicts == [(labels.TRUE, 0), (labels.TRUE, 0), (labels.AMBIGUOUS, None), (labels.FALSE, None)]


def test_a_stem_is_known_by_height():
    profile = [{"h": h, "x": 0.1 * h, "y": 0.0, "d": 0.4 - 0.02 * h} for h in (0.5, 1.5, 2.5, 3.5, 4.5)]
    allowed = {"angle_deg": 5, "offset_r": 0.25, "radius_pct": 10}
    stem = {"kind": "profile", "profile": profile, "ground_z": 10.0, "axis": [0.1, 0, 1], "tolerances": allowed}
    judge = references.judge_of_wild({"refs": [stem], "never_all": True}, np.empty((0, 3)))
    leaning = (0.1, 0, 1)
    assert judge(Cylinder((0.2, 0, 12), leaning, 0.18, 1.0)) == (labels.TRUE, 0)
    for point, direction, radius in (
        ((0.0, 0, 12), leaning, 0.18),
        ((0.2, 0, 12), leaning, 0.22),
        ((0.2, 0, 12), (0.3, 0, 1), 0.18),
        ((0.6, 0, 16), leaning, 0.28),
    ):
        assert judge(Cylinder(point, direction, radius, 1.0)) == (labels.FALSE, None)


def test_what_is_not_known_may_be_borne_out_by_its_points():
    rng = np.random.default_rng(8)
    shape = Cylinder((1, 2, 3), (0, 0.5, 1), 0.2, 2.0)
    points = Mantle(shape, 0.0, 2 * np.pi).sample(rng, 500)
    assert references.borne_out(points, shape)
    assert not references.borne_out(Mantle(shape, 0.0, 1.0).sample(rng, 500), shape)
    assert not references.borne_out(np.concatenate([points, shape.point + 0.1 * rng.standard_normal((900, 3))]), shape)
    assert not references.borne_out(points[:60], shape)


def test_the_noise_of_a_part_is_in_spacings():
    points = np.column_stack([np.random.default_rng(9).random((20000, 2)), np.zeros(20000)])
    assert references.noisy(points, 0.0) is points
    moved = references.noisy(points, 0.2) - points
    assert moved.std() == pytest.approx(0.2 / np.sqrt(20000), rel=0.1)


@pytest.mark.parametrize("program", [real, arcs])
def test_scans_that_are_not_there_are_asked_for(program, tmp_path, monkeypatch):
    command = [f"{program.__name__}.py", str(tmp_path / "rows.jsonl"), "--data", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", command)
    with pytest.raises(SystemExit, match="give --data the folder"):
        program.main()


def a_part(folder):
    """Write a plate with a rounded edge and a bore as the only CAD part there is."""
    rng = np.random.default_rng(10)
    turn, around = 0.5 * np.pi * rng.random(1500), 2 * np.pi * rng.random(1500)
    edge = np.column_stack([np.cos(turn), np.sin(turn), 6 * rng.random(1500)])
    flat = np.column_stack([-6 * rng.random(5000), np.ones(5000), 6 * rng.random(5000)])
    flat = flat[np.hypot(flat[:, 0] + 3, flat[:, 2] - 3) > 1]
    side = np.column_stack([np.ones(1500), -2 * rng.random(1500), 6 * rng.random(1500)])
    bore = np.column_stack([np.cos(around) - 3, 1 - 2 * rng.random(1500), np.sin(around) + 3])
    (folder / "fit4cad").mkdir()
    np.savez(folder / "fit4cad" / "PC1.npz", np.concatenate([edge, flat, side, bore]))
    known = [
        {"axis_point": [0, 0, 3], "axis_direction": [0, 0, 1], "radius": 1.0},
        {"axis_point": [-3, 0, 3], "axis_direction": [0, 1, 0], "radius": 1.0},
    ]
    (folder / "fit4cad" / "truth.json").write_text(json.dumps({"PC1": known}), encoding="utf-8")


@pytest.mark.parametrize("program", [real, arcs])
def test_rows_of_a_part(program, tmp_path, monkeypatch):
    a_part(tmp_path)
    output = tmp_path / "rows.jsonl"
    command = [f"{program.__name__}.py", str(output), "--data", str(tmp_path), "--noise", "0.1"]
    monkeypatch.setattr(sys, "argv", command + (["--sources", "fit4cad"] if program is real else ["--boxes"]))
    assert program.main() == 0
    lines = [json.loads(line) for line in output.read_text(encoding="utf-8").splitlines()]
    assert {line["scene"] for line in lines} <= {"fit4cad_PC1@0.1"}
    if program is real:
        assert {0, 1} & {line["cylinder"] for line in lines if line["label"] == labels.TRUE}
    terms = evidence_weights.BLEND_TERMS if program is arcs else evidence_weights.TERMS
    assert all((fit.law_of(line) != "BIAS") == (program is arcs) for line in lines)
    assert fit.table_of(lines, terms).terms.shape[1] == len(terms)


def test_boxes_have_sharp_edges_and_nothing_round():
    scans = list(arcs.boxes(3))
    assert len({scan.name for scan in scans}) == len(scans) == len(arcs.BOXES) * len(arcs.NOISES_OF_BOXES)
    assert {fit.kind_of(scan.name) for scan in scans} == {"box"}
    assert {scan.judge(None) for scan in scans} == {(labels.FALSE, None)}
    points = scans[0].cloud.points - scans[0].cloud.points.mean(axis=0)
    assert np.linalg.norm(points, axis=1).max() == pytest.approx(0.5 * np.linalg.norm(arcs.BOXES[0]), rel=0.05)


def test_arcs_are_noted_for_a_while_only():
    before = arcs.judging.verify
    with arcs.noted() as found:
        assert arcs.judging.verify is not before
        assert found == []
    assert arcs.judging.verify is before


@pytest.mark.parametrize("name", things.MORE)
def test_a_thing_is_its_name_seed_and_noise(name):
    one, same, other = (things.make(name, seed, 0.001) for seed in (100, 100, 101))
    assert (one == same).all()
    assert one.shape != other.shape or (one != other).any()
    assert np.isfinite(one).all()
    assert len(one) in things.COUNTS


def test_fits_of_a_thing_are_false(tmp_path, monkeypatch):
    output = tmp_path / "rows.jsonl"
    command = ["things.py", str(output), "--seeds", "100:101", "--noise", "0.002", "--only", "barrel"]
    monkeypatch.setattr(sys, "argv", command)
    assert things.main() == 0
    lines = [json.loads(line) for line in output.read_text(encoding="utf-8").splitlines()]
    assert {logistic.kind_of(line["scene"]) for line in lines} == {"thing"}
    assert {line["label"] for line in lines} == {labels.FALSE}


def test_a_picture_is_drawn(tmp_path):
    pytest.importorskip("matplotlib", reason="pictures are drawn where matplotlib is")
    rows = drawn_rows(np.random.default_rng(13), 500, -1.0, [2.0])
    fit.draw(logistic.fit_law(rows, np.ones(1)).probability(rows.terms), rows, tmp_path / "new" / "calibration.png")
    assert (tmp_path / "new" / "calibration.png").read_bytes().startswith(b"\x89PNG")


def test_the_evidence_is_itself_again_after_an_ablation():
    before = evidence_weights.BIAS, evidence_weights.TERMS
    names = [term.reason for term in evidence_weights.TERMS]
    law = {"bias": -1.0, "weights": dict.fromkeys(names[1:], 0.5)}
    measures = synthetic_line(np.random.default_rng(0), 0)["measures"]
    with ablation.weighed_by(law):
        assert [(term.reason, term.weight) for term in evidence_weights.TERMS] == [(name, 0.5) for name in names[1:]]
        odds = -1.0 + 0.5 * sum(term.value(measures) for term in evidence_weights.TERMS)
        assert evidence_weights.weigh(measures)[0] == pytest.approx(1 / (1 + np.exp(-odds)))
    assert before == (evidence_weights.BIAS, evidence_weights.TERMS)
    with pytest.raises(SystemExit, match="no term magic"), ablation.weighed_by({"bias": 0, "weights": {"magic": 1}}):
        pass


def synthetic_line(rng, index):
    """Make a line with every measure there is, of which the agreement decides."""
    names = "inside outside tangent tangent_both flank slope slope_error bulge bulge_error bend noise_ratio".split()  # noqa: SIM905  a list would be long
    names += "structure structure_radii form_radii ovality explained facets prism".split()  # noqa: SIM905
    measures = {name: float(0.1 * rng.random()) for name in names}
    true = bool(rng.random() < 0.4)
    measures |= {"height_radii": float(5 * rng.random()), "agreement": float(0.4 * true + 0.5 * rng.random())}
    measures |= {"curvature": 9.0, "windows": 5.0, "places": 12.0, "coverage": 3.0, "inliers": 300.0, "payoff": 0.7}
    measures |= {"lack_of_fit": float(1.0 + rng.random()), "bend_error": 0.01, "radius_noises": 9.0}
    measures |= {"scatter_radii": 0.1, "roughness": float(1.0 + rng.random()), "deviation_radii": 0.1}
    return {
        "scene": f"s{index % 20}",
        "label": labels.TRUE if true else labels.FALSE,
        "cylinder": index if true else None,
        "measures": measures,
        "support": 9,
        "confidence": 0.5,
        "reason": "",
    }
