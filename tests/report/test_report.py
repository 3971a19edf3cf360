"""The report: what it says, that no name can break out of it, and that a browser opens it."""

import base64
import dataclasses
import html
import json
import re
import shutil
import struct
import subprocess
import sys
from html.parser import HTMLParser

import numpy as np
import pytest

import cylx
from cylx.errors import UsageError
from cylx.geometry.cylinder import Cylinder, axis_basis
from cylx.palette import cylinder_colors
from cylx.records import PointCloud, Source
from cylx.report import html_of, png_of
from cylx.report.page import json_for_script
from cylx.report.page_data import page_data_of
from cylx.report.picture import outline
from cylx.report.points import STEPS_ACROSS_BOX
from cylx.results import Result
from tests.support.patience import PATIENCE

HOSTILE = "</script><img src=x onerror=alert(1)>&lt;\u2028\"'{{script}}.ply"


def unpacked(text, dtype):
    return np.frombuffer(base64.b64decode(text), dtype)


def blob_of(page):
    (blob,) = re.findall(r'<script id="data" type="application/json">(.*?)</script>', page, re.DOTALL)
    return json.loads(blob)


@pytest.fixture
def extraction(make_extraction):
    return make_extraction()


@pytest.fixture
def hostile(make_extraction):
    """An extraction whose file, properties, warnings and reasons all try to get out of the page."""
    points = make_extraction().cloud.points
    table = np.zeros(len(points), [(name, "f8") for name in ("x", "y", "z", HOSTILE)])
    for place, axis in enumerate("xyz"):
        table[axis] = points[:, place]
    made = make_extraction(PointCloud(points, table, source=Source(f"{HOSTILE.replace('/', '')}", "ply", "0" * 64)))
    refused = [dataclasses.replace(one, reason=HOSTILE) for one in made.rejected]
    stages = [dataclasses.replace(one, name=HOSTILE, rejected={HOSTILE: 2}) for one in made.stages]
    fits = [dataclasses.replace(fit, evidence={HOSTILE: 1.0}) for fit in made.cylinders]
    return dataclasses.replace(
        made, warnings=(HOSTILE,), rejected=tuple(refused), stages=tuple(stages), cylinders=tuple(fits)
    )


# what it says


def test_the_object_in_the_page_agrees_with_the_result(extraction):
    page_data = blob_of(html_of(extraction))
    result = Result.of(extraction).to_object()
    config = result.pop("config")
    assert page_data["result"] == result
    assert f"seed: {config['seed']}" in page_data["config"].splitlines()
    assert (page_data["fields"], page_data["rejected_count"]) == (["x", "y", "z"], 1)
    assert [one["reason"] for one in page_data["rejected"]] == ["agreement"]
    view = page_data["view"]
    assert (view["count"], view["total"], len(view["cylinders"]), len(page_data["maps"])) == (24, 24, 2, 2)
    middle = np.array(view["low"]) + 0.5 * np.array(view["size"])
    fit = extraction.cylinders[1].cylinder
    assert view["cylinders"][1] == pytest.approx([*(fit.start - middle), *(fit.end - middle), 2.0])
    assert np.array_equal(unpacked(view["palette"], "u1").reshape(-1, 3), cylinder_colors(np.arange(2)))


def test_blends_are_in_the_page_but_not_among_the_cylinders(make_extraction):
    made = make_extraction(blends=1)
    page_data = page_data_of(made)
    view, result = page_data["view"], page_data["result"]
    assert (len(result["blends"]), len(view["blends"]), len(view["cylinders"]), len(page_data["maps"])) == (1, 1, 2, 2)
    middle = np.array(view["low"]) + 0.5 * np.array(view["size"])
    fit = made.blends[0].cylinder
    assert view["blends"][0] == pytest.approx([*(fit.start - middle), *(fit.end - middle), 0.5])
    assert page_data_of(make_extraction())["view"]["blends"] == []
    blob = blob_of(Elements(Result.of(made)._repr_html_()).of("iframe")[0]["srcdoc"])
    assert (len(blob["view"]["blends"]), "blends" in blob["result"]) == (1, False)


def test_the_points_in_the_page_are_those_of_the_cloud(extraction):
    view = page_data_of(extraction)["view"]
    steps = unpacked(view["points"], "<u2").reshape(-1, 3)
    points = np.array(view["low"]) + steps / STEPS_ACROSS_BOX * np.array(view["size"])
    expected = extraction.cloud.points[np.lexsort(extraction.cloud.points.T)]
    assert points[np.lexsort(np.round(points, 4).T)] == pytest.approx(expected, abs=4.0 / STEPS_ACROSS_BOX)
    assert set(unpacked(view["labels"], "u1")) == {0}
    assert set(unpacked(view["residuals"], "i1")) == {0}


def test_a_result_without_a_cylinder_has_a_page(make_extraction):
    page_data = blob_of(html_of(make_extraction(cylinders=0, rejected=0)))
    assert (page_data["result"]["cylinders"], page_data["maps"], page_data["rejected"]) == ([], [], [])
    assert set(unpacked(page_data["view"]["labels"], "u1")) == {255}
    assert set(unpacked(page_data["view"]["residuals"], "i1")) == {-128}


def test_of_many_refused_ones_the_first_are_told_of(make_extraction):
    page_data = page_data_of(make_extraction(rejected=70))
    assert (len(page_data["rejected"]), page_data["rejected_count"]) == (50, 70)


def test_the_same_result_gives_the_same_bytes(make_extraction):
    assert html_of(make_extraction()) == html_of(make_extraction())
    assert png_of(make_extraction()) == png_of(make_extraction())


# names that want to get out


def test_no_name_gets_out_of_the_object(hostile):
    page = html_of(hostile)
    assert page.count("<script") == page.count("</script>") == 2
    assert "<img" not in page
    assert "onerror=alert" in page  # it is there, as text
    page_data = blob_of(page)
    assert page_data["fields"][3] == page_data["result"]["warnings"][0] == page_data["rejected"][0]["reason"] == HOSTILE
    assert page_data["result"]["input"]["file"] == HOSTILE.replace("/", "")


@pytest.mark.parametrize("text", ["</script>", "<!--", "]]>", "&amp;", "\u2028\u2029", "\ud800", "ü", "\\", '"'])
def test_the_object_is_harmless_and_unchanged(text):
    written = json_for_script({text: [text, 1.5, None]})
    assert not set(written) & {"<", ">", "&", "\u2028", "\u2029"}
    assert written.isascii()
    assert json.loads(written) == {text: [text, 1.5, None]}


def test_the_page_may_not_load_anything(extraction):
    page = html_of(extraction)
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)[1]
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    assert "unsafe" not in policy
    assert not re.findall(
        r"https?:|//[a-z]+\.|@import|url\(|innerHTML|outerHTML|insertAdjacent|eval\(|document\.write", page
    )


# the picture


def test_the_picture_is_a_png_of_its_size(hostile):
    data = png_of(hostile)
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    assert struct.unpack(">II", data[16:24]) == (1200, 900)


@pytest.mark.parametrize("name", ["$\\frac{$.ply", "a\nb\x07.ply", "日本.ply", "x" * 300])
def test_a_picture_has_any_title(make_extraction, name):
    points = make_extraction().cloud.points
    assert png_of(make_extraction(PointCloud(points, source=Source(name, "ply")), cylinders=0))


def test_the_outline_is_on_the_cylinder():
    shape = Cylinder((1, 2, 3), (1, 1, 0), 0.5, 2.0)
    lines = np.vstack(outline(shape))
    offsets = lines - shape.point
    heights = offsets @ shape.direction
    assert np.abs(heights) == pytest.approx(1.0)
    assert np.linalg.norm(offsets - np.outer(heights, shape.direction), axis=1) == pytest.approx(0.5)


# in a browser

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
BROWSER = next(filter(None, map(shutil.which, BROWSERS)), None)


@pytest.fixture
def browse(tmp_path):
    """Open a page in a browser without a window; gives what it told of itself and what it complained about."""
    if BROWSER is None:
        pytest.skip(f"none of {', '.join(BROWSERS)} is installed")

    def run(page, *options):
        path = tmp_path / "page.html"
        path.write_text(page, encoding="utf-8", newline="\n")
        command = [BROWSER, "--headless=new", "--no-sandbox", f"--user-data-dir={tmp_path / 'profile'}"]
        command += ["--disable-background-networking", "--enable-logging=stderr", "--virtual-time-budget=3000"]
        command += ["--window-size=1280,900", *options, "--dump-dom", f"{path.as_uri()}#selftest"]
        done = subprocess.run(command, capture_output=True, timeout=PATIENCE, check=False)
        body = re.search(r"<body[^>]*>", done.stdout.decode("utf-8", "replace"))
        assert body, done.stderr.decode("utf-8", "replace")[-2000:]
        told = re.search(r'data-selftest="([^"]*)"', body[0])
        complaints = re.findall(r"CONSOLE.*", done.stderr.decode("utf-8", "replace"))
        return json.loads(html.unescape(told[1])) if told else None, complaints

    return run


SOFTWARE = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")


def test_a_browser_shows_the_page_and_can_be_used(browse, hostile):
    told, complaints = browse(html_of(hostile), *SOFTWARE)
    assert complaints == []
    assert told is not None
    name = Result.of(hostile).input.file
    assert told["title"].split() == f"{name}: 2 cylinders".split()
    assert (told["rows"], told["radii"]) == (2, [2.0, 1.0])  # sorted twice by radius: descending
    assert (told["selected"], told["heading"]) == (1, "Cylinder 1")
    if told["webgl"]:
        assert (told["visible"], told["without"]) == (24, 0)
        assert told["picked"] == [0, 1]
        assert told["lit"] > 500
        slow, *_, fast, faster = told["shares"]  # of the points, where frames take 600 ms, and 10 ms after that
        assert 1 / 16 <= slow < 1 / 5
        assert told["shares"][2] == 1 / 16 < fast < faster


def test_without_webgl_the_rest_is_there(browse, extraction):
    told, complaints = browse(html_of(extraction), "--disable-gpu", "--disable-3d-apis")
    assert [line for line in complaints if "WebGL" not in line] == []
    assert (told["webgl"], told["rows"], told["heading"]) == (False, 2, "Cylinder 1")


# in a notebook


class Elements(HTMLParser):
    """The elements of a text with their attributes, and the text between them."""

    def __init__(self, text):
        super().__init__()
        self.found, self.text = [], ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.text += data

    def of(self, tag):
        return [attributes for name, attributes in self.found if name == tag]


def annotated(extraction):
    """Give the points of an extraction as `read_cloud` gives the annotated cloud."""
    count = len(extraction.cloud.points)
    table = np.zeros(count, [("cylinder_id", "i4"), ("residual", "f4")])
    table["cylinder_id"], table["residual"] = extraction.labels, extraction.residuals
    return PointCloud(extraction.cloud.points, table)


def test_a_notebook_shows_a_table_and_a_frame(extraction):
    for found in (extraction, Result.of(extraction)):
        shown = Elements(found._repr_html_())
        assert len(shown.of("tr")) == 1 + len(extraction.cylinders)
        (frame,) = shown.of("iframe")
        assert frame["sandbox"] == "allow-scripts"
        blob = blob_of(frame["srcdoc"])
        assert blob["embedded"] is True
        assert [one["radius"] for one in blob["result"]["cylinders"]] == [1.0, 2.0]
        assert blob["view"]["count"] == (len(extraction.labels) if found is extraction else 0)
    assert repr(extraction) == "2 cylinders in 24 points"
    assert repr(Result.of(extraction)) == "2 cylinders in '<array>'"


def test_the_points_of_a_result_come_from_its_annotated_cloud(extraction):
    own, brought = (
        blob_of(Elements(view.html).of("iframe")[0]["srcdoc"])["view"]
        for view in (cylx.show(extraction), cylx.show(Result.of(extraction), annotated(extraction)))
    )
    assert own == brought
    other = blob_of(Elements(cylx.show(Result.of(extraction), extraction.cloud.points).html).of("iframe")[0]["srcdoc"])
    assert set(unpacked(other["view"]["labels"], "u1")) == {255}
    assert other["maps"] == []  # no point is known to be of a cylinder: an empty ring would say that nothing is seen


def test_an_extraction_takes_no_other_points(extraction):
    with pytest.raises(UsageError, match="an extraction has its points already"):
        cylx.show(extraction, extraction.cloud)


def test_no_name_gets_out_of_a_notebook(hostile):
    for found in (hostile, Result.of(hostile)):
        shown = Elements(found._repr_html_())
        assert {tag for tag, _ in shown.found} <= {
            "div",
            "strong",
            "table",
            "thead",
            "tbody",
            "tr",
            "th",
            "td",
            "span",
            "iframe",
        }
        assert len(shown.of("iframe")) == 1
        page = shown.of("iframe")[0]["srcdoc"]
        assert page.count("<script") == html_of(hostile).count("<script")
        assert "<img" not in page
    assert "<img" in Elements(Result.of(hostile)._repr_html_()).text  # as text it is there


@pytest.mark.parametrize("change", [
    {"cylinders": (), "labels": np.full(24, -1, np.int32)},
    {"residuals": np.full(24, np.nan, np.float32)},
    {"labels": np.full(24, -1, np.int32)},
])  # fmt: skip
def test_whatever_was_found_can_be_shown(extraction, change):
    found = dataclasses.replace(extraction, **change)
    for one in (found, Result.of(found)):
        assert repr(one).split()[0] in Elements(one._repr_html_()).text


@pytest.mark.parametrize("name", ["", "\ud800", "\x00\x1b[2J", "a" * 5000])
def test_any_name_can_be_shown(make_extraction, name):
    made = make_extraction()
    found = dataclasses.replace(made, cloud=PointCloud(made.cloud.points, source=Source(name, "ply", None)))
    for one in (found, Result.of(found)):
        one._repr_html_().encode("utf-8")
        repr(one).encode("utf-8")


def test_a_notebook_stays_small(make_extraction):
    rng = np.random.default_rng(1)
    cloud = PointCloud(rng.random((1_200_000, 3)))
    made = make_extraction(cloud, cylinders=1000)
    found = dataclasses.replace(made, labels=rng.integers(-1, 1000, len(cloud.points)).astype(np.int32))
    shown = found._repr_html_()
    assert len(shown) < 2_500_000
    assert "and 950 more" in shown
    blob = blob_of(Elements(shown).of("iframe")[0]["srcdoc"])
    assert blob["view"]["count"] <= 30_000
    assert len(blob["maps"]) == len(blob["result"]["cylinders"]) == len(blob["view"]["cylinders"]) == 500
    few = cylx.show(make_extraction(cloud), most_points=500)
    assert blob_of(Elements(few.html).of("iframe")[0]["srcdoc"])["view"]["count"] == 500


def test_a_browser_shows_the_frame_of_a_notebook(browse, extraction):
    for view in (cylx.show(extraction), cylx.show(Result.of(extraction))):
        told, complaints = browse(Elements(view.html).of("iframe")[0]["srcdoc"], *SOFTWARE)
        assert complaints == []
        assert (told["rows"], told["heading"]) == (2, "Cylinder 1")
        if told["webgl"]:
            assert told["picked"] == [0, 1]
            assert told["lit"] > 500


# plots


def labels_of(figure):
    axes = figure.axes[0]
    return axes.get_xlabel(), axes.get_ylabel(), axes.get_title()


def test_the_scene_of_a_result_is_drawn_with_and_without_points(extraction):
    result = Result.of(extraction)
    drawn = [cylx.plot_scene(extraction), cylx.plot_scene(result, annotated(extraction)), cylx.plot_scene(result)]
    assert [len(figure.axes[0].collections) for figure in drawn] == [1, 1, 0]  # the points
    assert [len(figure.axes[0].lines) for figure in drawn] == [12] * 3  # two rims and four lines a cylinder
    assert drawn[0]._repr_png_()[:4] == b"\x89PNG"
    assert drawn[0].get_suptitle() == "<array>: 2 cylinders"


def test_nothing_found_is_drawn_as_nothing(make_extraction):
    found = make_extraction(cylinders=0)
    for one in (found, Result.of(found)):
        assert cylx.plot_scene(one)._repr_png_()[:4] == b"\x89PNG"
        assert cylx.plot_radii(one)._repr_png_()[:4] == b"\x89PNG"


def test_the_residuals_that_are_drawn_are_those_of_the_cylinder(extraction):
    shape = Cylinder((0, 0, 2), (0, 0, 1), 1.0, 4.0)
    rng = np.random.default_rng(2)
    angles, heights = rng.uniform(-np.pi, np.pi, 4000), rng.uniform(-2, 2, 4000)
    dent = (np.abs(angles - 1.0) < 0.4) & (np.abs(heights - 1.0) < 0.4)
    first, second = axis_basis(shape.direction)
    around = np.cos(angles)[:, None] * first + np.sin(angles)[:, None] * second
    residuals = np.where(dent, -0.1, 0.0)
    points = shape.point + heights[:, None] * shape.direction + (1.0 + residuals)[:, None] * around
    found = dataclasses.replace(
        extraction, cloud=PointCloud(points), labels=np.zeros(4000, np.int32), residuals=residuals.astype(np.float32)
    )
    for figure in (cylx.plot_residuals(found), cylx.plot_residuals(Result.of(found), 0, annotated(found))):
        image = figure.axes[0].images[0]
        values = np.ma.filled(image.get_array(), np.nan)
        assert np.nanmin(values) == pytest.approx(-0.1, rel=0.02)
        row = int(np.nanargmin(values)) // values.shape[1]
        low, high = image.get_extent()[2:]
        assert low + (row + 0.5) / values.shape[0] * (high - low) == pytest.approx(3.0, abs=0.4)
        assert labels_of(figure)[0] == "angle about the axis, degrees (0 is towards x)"


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda found: cylx.plot_residuals(found, 2), "there is no cylinder 2; choose another; its ids are 0 to 1"),
        (lambda found: cylx.plot_residuals(found, -1), "there is no cylinder -1"),
        (lambda found: cylx.plot_residuals(found, 1), "it has no points of cylinder 1; give the annotated cloud"),
        (lambda found: cylx.plot_residuals(Result.of(found)), "it has no points of cylinder 0"),
        (lambda found: cylx.plot_radii(found, [1.0]), "1 radii for 2 cylinders"),
        (lambda found: cylx.plot_scene(found, found.cloud), "an extraction has its points already"),
    ],
)
def test_what_cannot_be_drawn_is_named(extraction, ask, message):
    with pytest.raises(UsageError, match=re.escape(message)):
        ask(extraction)


def test_radii_are_drawn_with_two_standard_deviations(extraction):
    sure = dataclasses.replace(extraction.cylinders[0], covariance=np.diag([0, 0, 0, 0, 0.01]))
    found = dataclasses.replace(extraction, cylinders=(sure, extraction.cylinders[1]))
    for one in (found, Result.of(found)):
        figure = cylx.plot_radii(one, [0.9, np.nan])
        bars = [segment for lines in figure.axes[0].collections for segment in lines.get_segments()]
        assert len(bars) == 1  # of the other there is no uncertainty
        assert bars[0][:, 0] == pytest.approx([-0.1, 0.3])
        assert [text.get_text() for text in figure.axes[0].texts] == ["1.00 ± 0.10", "2"]


@pytest.mark.parametrize("plot", [cylx.plot_scene, cylx.plot_residuals, cylx.plot_radii])
def test_plots_without_matplotlib_name_what_to_install(extraction, monkeypatch, plot):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(UsageError) as refused:
        plot(extraction)
    assert str(refused.value) == "the picture: matplotlib is not installed; pip install 'cylx[plots]'"


def test_a_notebook_needs_no_matplotlib(extraction, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert "<iframe" in extraction._repr_html_()
