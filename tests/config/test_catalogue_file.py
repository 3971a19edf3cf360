"""A catalogue of nominal radii: what a file of it may look like, and every fault of one."""

from pathlib import Path

import numpy as np
import pytest

from cylx.config import CatalogueEntry, Config, load_config, named_options
from cylx.config.catalogue_file import read_catalogue
from cylx.config.yaml_reader import parse_yaml
from cylx.config.yaml_writer import commented_yaml
from cylx.errors import ConfigError

DN = [
    {"name": "DN15", "radius": 0.01065, "tolerance": 0.0001},
    {"name": None, "radius": 0.02, "tolerance": None},
]


@pytest.fixture
def read(tmp_path, monkeypatch):
    """Read a text, or bytes, as pipes.csv."""
    monkeypatch.chdir(tmp_path)

    def read_as(content, name="pipes.csv"):
        Path(name).write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
        return read_catalogue(name)

    return read_as


@pytest.mark.parametrize(
    "text",
    [
        "name,radius,tolerance\nDN15,0.01065,0.0001\n,0.02,\n",
        "tolerance;name;radius\n1e-4;DN15;1.065e-2\n;;.02",
        "Name\tDiameter\tTolerance\r\nDN15\t0.0213\t0.0002\r\n\t0.04\t\r\n",
        "\ufeffname, radius, tolerance\n# steel\n\n  # more of it\nDN15, 0.01065, 0.0001\n\n, 0.02,\n",
        'name,radius,tolerance\r"DN15",+0.01065,"0.0001"\r"",0.02,""\r',
    ],
)
def test_a_table_may_be_written_in_many_ways(read, text):
    assert read(text) == DN


@pytest.mark.parametrize("name", ["pipes.yaml", "PIPES.YML"])
def test_a_list_in_a_yaml_file_does_as_well(read, name):
    text = "# steel\n- {name: DN15, radius: 0.01065, tolerance: 1e-4}\n- radius: 0.02\n"
    assert read(text, name) == [DN[0], {"radius": 0.02}]


def test_one_column_is_enough(read):
    assert [entry["radius"] for entry in read("diameter\n2\n3\n")] == [1.0, 1.5]


REMEDY = "give a CSV file with a column 'radius' or 'diameter'"
HEADER = "begin with a line that names the columns, such as 'name,radius,tolerance'"
ENTRY = "write '- {name: DN50, radius: 0.03015}'"
NAME = "name: the name is invalid; write 1 to 40 printable characters without spaces around them"
REFUSED = [
    ("pipes.csv", "", f"pipes.csv: is empty; {HEADER}"),
    ("pipes.csv", "\n# nothing\n", f"pipes.csv: is empty; {HEADER}"),
    ("pipes.csv", "radius\n", "pipes.csv: has no entries; give each nominal radius a line"),
    ("pipes.csv", b"\x89PNG\r\n\x1a\n\xff", f"pipes.csv: is not UTF-8 text; {REMEDY}"),
    ("pipes.csv", "radius\n1\0\n", f"pipes.csv: is not text; {REMEDY}"),
    ("pipes.csv", "radius\n" + 50_000 * "1\n", f"pipes.csv: is larger than 100 kB; {REMEDY}"),
    ("pipes.csv", "0.1,0.2\n", f"pipes.csv:1: is not a header line; {HEADER}"),
    ("pipes.csv", "radios\n1\n", "pipes.csv:1: unknown column 'radios'; did you mean 'radius'?"),
    (
        "pipes.csv",
        "radius,wall\n1,2\n",
        "pipes.csv:1: unknown column 'wall'; the columns are name, radius, diameter, tolerance",
    ),
    ("pipes.csv", "radius,radius\n1,1\n", "pipes.csv:1: names the column 'radius' twice; leave one of them out"),
    (
        "pipes.csv",
        "# a\nradius,diameter\n1,2\n",
        "pipes.csv:2: names both 'radius' and 'diameter'; give one of these columns",
    ),
    ("pipes.csv", "name\nDN15\n", "pipes.csv:1: names neither 'radius' nor 'diameter'; give one of these columns"),
    ("pipes.csv", "name,radius\nDN15\n", "pipes.csv:2: expected 2 columns, found 1; write one cell for each"),
    ("pipes.csv", "radius\n1\n1,2\n", "pipes.csv:3: expected 1 columns, found 2; write one cell for each"),
    ("pipes.csv", "name,radius\nDN15,\n", "pipes.csv:2: has no radius; write one, or leave the line out"),
    ("pipes.csv", "radius\n1\n\nwide\n", "pipes.csv:4: the radius 'wide' is not a number; write digits"),
    ("pipes.csv", "radius\nnan\n", "pipes.csv:2: the radius 'nan' is not a number; write digits"),
    ("pipes.csv", "radius\ninf\n", "pipes.csv:2: the radius 'inf' is not a number; write digits"),
    ("pipes.csv", "radius\n1_000\n", "pipes.csv:2: the radius '1_000' is not a number; write digits"),
    ("pipes.csv", "radius\n\u0661\n", "pipes.csv:2: the radius '\u0661' is not a number; write digits"),
    ("pipes.csv", "name;diameter\nDN15;21,3\n", "pipes.csv:2: the diameter '21,3' is not a number; write 21.3"),
    ("pipes.csv", "radius\n0\n", "pipes.csv:2: the radius '0' is out of range; it must be > 0 and finite"),
    ("pipes.csv", "diameter\n-2\n", "pipes.csv:2: the diameter '-2' is out of range; it must be > 0 and finite"),
    ("pipes.csv", "radius\n1e999\n", "pipes.csv:2: the radius '1e999' is out of range; it must be > 0 and finite"),
    (
        "pipes.csv",
        "diameter\n5e-324\n",
        "pipes.csv:2: the diameter '5e-324' is out of range; it must be > 0 and finite",
    ),
    (
        "pipes.csv",
        "radius,tolerance\n1,0\n",
        "pipes.csv:2: the tolerance '0' is out of range; it must be > 0 and finite",
    ),
    ("pipes.csv", "radius\n1\n2\n1.0\n", "pipes.csv:4: has the radius of line 2 again; leave one of them out"),
    (
        "pipes.csv",
        'name,radius\n"DN15,1\n',
        "pipes.csv:2: is not CSV (unexpected end of data); close the quotes, and put nothing behind them",
    ),
    (
        "pipes.csv",
        f"name,radius\n{41 * 'x'},1\n",
        f"pipes.csv:2: {NAME}",
    ),
    (
        "pipes.csv",
        "name,radius\n\x1b[31mred,1\n",
        f"pipes.csv:2: {NAME}",
    ),
    ("pipes.yaml", "", "pipes.yaml: has no entries; give each nominal radius a line"),
    ("pipes.yaml", "[]", "pipes.yaml: has no entries; give each nominal radius a line"),
    ("pipes.yaml", "radius: 1", f"pipes.yaml: is not a list of entries; {ENTRY} for each of them"),
    ("pipes.yaml", "- radius: 1\n- 2\n", f"pipes.yaml:2: is not an entry; {ENTRY}"),
    ("pipes.yaml", "- radius: 1\n\n- radus: 2\n", "pipes.yaml:3: radius: is missing; add it"),
    ("pipes.yaml", "- radius: 1\n  radus: 2\n", "pipes.yaml:1: radus: unknown key; did you mean 'radius'?"),
    ("pipes.yaml", "- radius: 1\n- radius: 0\n", "pipes.yaml:2: radius: 0 is out of range; it must be > 0"),
    (
        "pipes.yaml",
        "- radius: 1\n- radius: 1.0\n",
        "pipes.yaml:2: has the radius of line 1 again; leave one of them out",
    ),
    ("pipes.yaml", "- &a {radius: 1}\n", "pipes.yaml:1: anchors and aliases are not allowed; write the value out"),
]


@pytest.mark.parametrize(("name", "content", "message"), REFUSED, ids=[message[:60] for _, _, message in REFUSED])
def test_a_fault_in_a_file_is_named(read, name, content, message):
    with pytest.raises(ConfigError) as caught:
        read(content, name)
    assert str(caught.value) == message
    assert caught.value.exit_code == 2


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ConfigError) as missing:
        read_catalogue(tmp_path / "pipes.csv")
    assert str(missing.value) == f"{tmp_path / 'pipes.csv'}: no such file; {REMEDY}"
    with pytest.raises(ConfigError, match="cannot be read: "):
        read_catalogue(tmp_path)
    with pytest.raises(ConfigError, match="cannot be read: "):
        read_catalogue("pipes\0.csv")


# in the configuration


def test_it_can_be_given_in_every_way(tmp_path):
    (tmp_path / "pipes.csv").write_text("radius\n0.02\n")
    expected = [CatalogueEntry(radius=0.02)]
    for given in (
        tmp_path / "pipes.csv",
        str(tmp_path / "pipes.csv"),
        [0.02],
        np.array([0.02]),
        ({"radius": 0.02},),
        [{"radius": np.float32(0.02).astype(float)}],
        expected,
    ):
        config = load_config(options=named_options(catalogue=given))
        assert config.scene.catalogue[0].radius == pytest.approx(0.02)
        assert (config.scene.catalogue[0].name, config.scene.catalogue[0].tolerance) == (None, None)
    assert named_options(catalogue=None) == {}
    assert expected[0].spread == 0.02 * 2e-3
    assert CatalogueEntry(radius=0.02, tolerance=0.001).spread == 0.001


@pytest.mark.parametrize(
    ("catalogue", "message"),
    [
        ("[]", "scene.catalogue: [] is too short; it must have 1 or more entries"),
        ("0.02", "scene.catalogue: 0.02 is not a list; write [a, b]"),
        ("[0.02]", "scene.catalogue.0: 0.02 is not a section; write its keys below it, indented"),
        ("[{}]", "scene.catalogue.0.radius: is missing; add it"),
        (
            "[{radius: 1}, {radius: nan}]",
            "scene.catalogue.1.radius: 'nan' is not a number; write a number such as 0.05",
        ),
        ("[{radius: -1}]", "scene.catalogue.0.radius: -1 is out of range; it must be > 0"),
        ("[{radius: 1, tolerance: 0}]", "scene.catalogue.0.tolerance: 0 is out of range; it must be > 0"),
        ("[{radius: 1, tolerence: 1}]", "scene.catalogue.0.tolerence: unknown key; did you mean 'tolerance'?"),
        ("[{radius: 1, x: 1}]", "scene.catalogue.0.x: unknown key; the keys here are name, radius, tolerance"),
        ("[{radius: 1, name: 50}]", "scene.catalogue.0.name: 50 is not a word; put it in quotes"),
        ("[{radius: 1}, {radius: 1.0}]", "scene: catalogue has the radius 1 twice; leave one of them out"),
        (
            "[{radius: 1, name: ''}]",
            f"scene.catalogue.0.{NAME}",
        ),
    ],
)
def test_a_fault_in_the_configuration_is_named(catalogue, message):
    with pytest.raises(ConfigError) as caught:
        load_config(overrides=[f"scene.catalogue={catalogue}"])
    assert str(caught.value) == f"--set {message}"


def test_it_contradicts_a_known_radius():
    options = named_options(catalogue=[0.02])
    with pytest.raises(
        ConfigError, match=r"^scene\.catalogue: contradicts scene\.known_radius; leave one of them out$"
    ):
        load_config(overrides=["scene.known_radius=0.02"], options=options)


def test_one_catalogue_takes_the_place_of_another(tmp_path):
    (tmp_path / "my.yaml").write_text("scene: {catalogue: [{radius: 1}, {radius: 2}]}")
    config = load_config(path=tmp_path / "my.yaml", options=named_options(catalogue=[3.0]))
    assert [entry.radius for entry in config.scene.catalogue] == [3.0]
    assert load_config(start=config) == config
    assert load_config(path=tmp_path / "my.yaml", overrides=["scene.catalogue=null"]) == Config()


def test_what_is_written_loads_back():
    entries = [{"name": f"Ø {i}: #{i}, 'x'", "radius": 0.01 * (i + 1)} for i in range(60)]
    config = load_config(options=named_options(catalogue=entries))
    again = parse_yaml(commented_yaml(config), "again.yaml")
    assert Config.model_validate(again) == config
