"""`cylx.extract`: the same as the command, in one call."""

import sys

import numpy as np
import pytest

import cylx
from cylx.config import CatalogueEntry, load_config
from cylx.errors import ConfigError, InputError, UsageError
from cylx.records import PointCloud, SilentObserver
from cylx.synthetic import single


@pytest.fixture
def asked(monkeypatch, make_extraction):
    """Put a pipeline in place that remembers what it is asked."""
    calls = []

    def remember(cloud, config, **others):
        calls.append((cloud, config, others))
        return make_extraction(cloud, config)

    monkeypatch.setattr("cylx.api.extract_cylinders", remember)
    return calls


@pytest.mark.parametrize("kind", [np.asarray, np.ndarray.tolist, PointCloud, lambda points: points.astype("f4")])
def test_points_come_in_any_form(asked, kind):
    points = np.arange(12.0).reshape(4, 3)
    cylx.extract(kind(points))
    ((cloud, config, others),) = asked
    assert np.array_equal(cloud.points, points)
    assert config == load_config()
    assert others["threads"] is None
    assert isinstance(others["observer"], SilentObserver)


@pytest.mark.parametrize("kind", [str, lambda path: path])
def test_a_path_is_read(asked, scan, kind):
    cylx.extract(kind(scan))
    ((cloud, _, _),) = asked
    assert (cloud.source.file, cloud.source.format, len(cloud.points)) == (str(scan), "xyz", 24)


def test_a_cloud_is_taken_as_it_is(asked):
    cloud = PointCloud(np.zeros((1, 3)))
    cylx.extract(cloud)
    assert asked[0][0] is cloud


def test_rows_that_are_not_finite_stay_rows(asked):
    cylx.extract([[0, 0, 0], [np.nan, 0, 0]])
    assert (len(asked[0][0].points), asked[0][0].rows) == (1, 2)


def test_options_are_those_of_the_command(asked, tmp_path):
    (tmp_path / "my.yaml").write_text("preset: paper\nslicing: {min_points: 9}")
    options = {"seed": 3, "radius": (None, 2.0), "max_cylinders": 4, "planes": 7, "overrides": ["slicing.thickness=1"]}
    options |= {"axis": "y", "axis_tolerance_deg": 5.0, "axis_sd_deg": 0.5, "min_coverage_deg": 60}
    options |= {"known_radius": (1.5, 0.01), "blends": False}
    cylx.extract([[0, 0, 0]], config=tmp_path / "my.yaml", threads=2, **options)
    cylx.extract([[0, 0, 0]], catalogue=[{"name": "DN50", "radius": 0.03}, 0.05])
    assert asked[1][1].scene.catalogue == [CatalogueEntry(name="DN50", radius=0.03), CatalogueEntry(radius=0.05)]
    expected = load_config(
        preset="paper",
        overrides=["slicing.thickness=1", "slicing.min_points=9"],
        options={
            "seed": 3,
            "scene.radius_max": 2.0,
            "max_cylinders": 4,
            "slicing.planes": 7,
            "scene.axis": [0, 1, 0],
            "scene.axis_tolerance_deg": 5,
            "scene.axis_sd_deg": 0.5,
            "scene.known_radius": 1.5,
            "scene.known_radius_sd": 0.01,
            "verification.min_coverage_deg": 60,
            "verification.blends": False,
        },
    )
    assert asked[0][1] == expected
    assert asked[0][2]["threads"] == 2


def test_a_configuration_can_be_handed_over_and_changed(asked):
    settings = load_config(preset="paper", overrides=["slicing.planes=7"])
    cylx.extract([[0, 0, 0]], config=settings)
    cylx.extract([[0, 0, 0]], config=settings, seed=5)
    assert asked[0][1] == settings
    assert asked[1][1] == settings.model_copy(update={"seed": 5})


def test_faults_are_errors_of_cylx(tmp_path):
    with pytest.raises(ConfigError, match="scene: radius_min 3 is above radius_max 1; swap them"):
        cylx.extract([[0, 0, 0]], radius=(3, 1))
    with pytest.raises(ConfigError, match="axis tolerance: is given without the axis"):
        cylx.extract([[0, 0, 0]], axis_tolerance_deg=5)
    with pytest.raises(ConfigError, match=r"scene\.axis: 'up' is not a list"):
        cylx.extract([[0, 0, 0]], axis="up")
    with pytest.raises(InputError, match="no such file"):
        cylx.extract(tmp_path / "none.ply")
    with pytest.raises(ValueError, match=r"points must have shape \(N, 3\), not \(2,\)"):
        cylx.extract([1.0, 2.0])


def test_the_one_line_finds_a_cylinder():
    scene = single(points=4000, height=3.0, sigma=0.005, seed=2)
    found = cylx.extract(scene.points, max_cylinders=1, seed=1)
    (fit,) = found.cylinders
    assert fit.cylinder.radius == pytest.approx(1.0, abs=5 * 0.005 / np.sqrt(4000) + 0.005**2)
    assert abs(fit.cylinder.direction[2]) == pytest.approx(1.0, abs=1e-6)
    assert found.config.seed == 1
    assert len(found.labels) == 4000


def test_an_extraction_as_arrays(make_extraction):
    found = make_extraction(cylinders=3)
    arrays = found.to_arrays()
    shapes = {"points": (3, 3), "directions": (3, 3), "starts": (3, 3), "ends": (3, 3)}
    assert {name: array.shape for name, array in arrays.items()} == {**dict.fromkeys(arrays, (3,)), **shapes}
    assert arrays["radii"].tolist() == [1.0, 2.0, 3.0]
    assert arrays["starts"].tolist() == [[0, 0, 0]] * 3
    assert np.isnan(arrays["confidences"]).all()
    assert arrays["inliers"].dtype == np.int64
    assert {array.shape for array in make_extraction(cylinders=0).to_arrays().values()} == {(0, 3), (0,)}


@pytest.mark.parametrize("blends", [None, 0, 2])
def test_an_extraction_as_an_object_is_what_the_command_writes(make_extraction, tmp_path, blends):
    found = make_extraction(blends=blends)
    assert cylx.to_dict(found) == cylx.Result.of(found).to_object()
    (tmp_path / "r.json").write_text(cylx.Result.of(found).to_json(), encoding="utf-8")
    assert cylx.read_result(tmp_path / "r.json").to_object() == cylx.to_dict(found)
    assert cylx.read_result(str(tmp_path / "r.json")).cylinders[1].radius == 2.0
    assert cylx.Result.from_json(cylx.Result.of(found).to_json()) == cylx.read_result(tmp_path / "r.json")


def test_what_is_no_result_is_named(tmp_path):
    (tmp_path / "r.json").write_text("{}", encoding="utf-8")
    with pytest.raises(InputError, match=r"r\.json: cylx_version: is missing"):
        cylx.read_result(tmp_path / "r.json")
    with pytest.raises(InputError, match="no such file"):
        cylx.read_result(tmp_path / "none.json")


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("", "not JSON"),
        ("[" * 10**5, "nested too deeply"),
        ("[]", "not a JSON object"),
        ("NaN", "not a JSON object"),
        ('{"schema": "cylx.summary/1"}', "schema: 'cylx.summary/1' is not one of its values"),
    ],
)
def test_a_text_that_is_no_result_is_named(text, fault):
    with pytest.raises(InputError, match=f"the text: .*{fault}"):
        cylx.Result.from_json(text)


def test_a_data_frame(make_extraction, tmp_path):
    pytest.importorskip("pandas", reason="needs cylx[dataframe]")
    found = make_extraction()
    frame = cylx.to_dataframe(found)
    assert frame["radius"].tolist() == [1.0, 2.0]
    assert frame["end_z"].tolist() == [4.0, 4.0]
    assert frame["evidence_slope"].tolist() == [0.125, 0.125]
    assert frame.equals(cylx.Result.of(found).to_dataframe())
    assert cylx.to_dataframe(make_extraction(cylinders=0)).shape[0] == 0


def test_without_pandas_the_extra_is_named(make_extraction, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(UsageError, match=r"pandas is not installed; pip install 'cylx\[dataframe\]'"):
        cylx.to_dataframe(make_extraction())


def test_what_is_evaluated_comes_in_any_form(make_extraction, tmp_path):
    found = make_extraction()
    path = tmp_path / "found.json"
    path.write_text(cylx.Result.of(found).to_json(), encoding="utf-8")
    expected = cylx.evaluate(cylx.to_dict(found), cylx.to_dict(found))
    assert (expected.matched, expected.f1) == (2, 1.0)
    for given in (found, cylx.Result.of(found), path, str(path)):
        assert cylx.evaluate(given, cylx.to_dict(found)) == cylx.evaluate(cylx.to_dict(found), given) == expected
    with pytest.raises(InputError, match="no such file"):
        cylx.evaluate(tmp_path / "nothing.json", found)
