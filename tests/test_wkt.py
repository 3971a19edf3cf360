"""What WKT says, as this program and pyproj read it."""

import pytest

from cylx.units import METRES, unit_of
from cylx.wkt import facts_of

CODES = [25832, 32633, 2263, 4326, 4979, 4978, 2154, 5972, 7415, 3857, 27700, 6360, 8802]


@pytest.mark.parametrize("version", ["WKT1_GDAL", "WKT1_ESRI", "WKT2_2015", "WKT2_2019", "WKT2_2019_SIMPLIFIED"])
@pytest.mark.parametrize("code", CODES)
def test_it_says_what_pyproj_says(code, version):
    pyproj = pytest.importorskip("pyproj")
    try:
        crs = pyproj.CRS.from_epsg(code)
        text = crs.to_wkt(version)
    except pyproj.exceptions.CRSError:
        pytest.skip("has no such form")
    facts = facts_of(text)
    level = crs.sub_crs_list[0] if crs.is_compound else crs
    kind = "projected" if level.is_projected else "geographic" if level.is_geographic else "geocentric"
    assert facts.kind == ("other" if level.is_vertical else kind)
    if kind == "projected" and not level.is_vertical:
        assert facts.metres == pytest.approx(level.axis_info[0].unit_conversion_factor, rel=1e-9)
    if kind == "geographic":
        assert facts.metres is None
    if crs.is_compound:
        factor = crs.sub_crs_list[1].axis_info[0].unit_conversion_factor
        assert facts.vertical_metres == pytest.approx(factor, rel=1e-9)
    if version != "WKT1_ESRI":
        assert facts.epsg == code
        assert facts.name


@pytest.mark.parametrize(
    "text",
    [
        "", "EPSG:25832", "PROJCS", "PROJCS[", 'PROJCS["a"', 'PROJCS["a"]]', "[" * 100, "PROJCS[" * 100, '"a"',
        'SPHEROID["a",1,2]', 'UNIT["m",1]', "1", "PROJCS[1e999e9]", 'PROJCS["a', "x" * 70000, "PROJCS[(1)]",
    ],
)  # fmt: skip
def test_what_is_none_is_none(text):
    assert facts_of(text) is None


@pytest.mark.parametrize(
    ("unit", "metres"),
    [('UNIT["m",1]', 1.0), ('UNIT["m",0]', None), ('UNIT["m",-1]', None), ('UNIT["m"]', None), ('UNIT["m","1"]', None)],
)
def test_units_have_lengths(unit, metres):
    assert facts_of(f'LOCAL_CS["a",{unit}]').metres == metres


@pytest.mark.parametrize("name", METRES)
def test_each_unit_is_found_by_its_length(name):
    assert unit_of(METRES[name]) == name
    assert unit_of(float(f"{METRES[name]:.10g}")) == name


def test_a_foot_of_surveys_is_no_foot():
    assert unit_of(0.3048006) == "us-ft"
    assert unit_of(0.3048) == "ft"
    assert unit_of(0.9144) is None
