"""The configuration: layers, strictness, exact messages, and the text that explains it."""

import errno
from pathlib import Path

import jsonschema
import pytest

from cylx.config import Config, Section, check_tolerance, load_config, named_options, plain_yaml
from cylx.config.choices import PRESETS
from cylx.config.faults import dotted_keys
from cylx.config.yaml_reader import parse_yaml
from cylx.config.yaml_writer import commented_yaml
from cylx.errors import ConfigError

SECTIONS = [name for name, field in Config.model_fields.items() if isinstance(field.default, Section)]
KEYS = [key for key in dotted_keys(Config) if key not in SECTIONS]


@pytest.fixture
def load(tmp_path, monkeypatch):
    """Load a YAML text as my.yaml."""
    monkeypatch.chdir(tmp_path)

    def load_text(text, **others):
        (tmp_path / "my.yaml").write_bytes(text if isinstance(text, bytes) else text.encode())
        return load_config(path="my.yaml", **others)

    return load_text


def value_of(config, key):
    for part in key.split("."):
        config = getattr(config, part)
    return config


# layers


def test_without_anything_it_is_the_defaults():
    assert load_config() == Config()


def test_each_layer_goes_over_the_one_below(load):
    key = "verification.enabled"  # true by default, false in the preset paper
    assert value_of(load_config(), key) is True
    assert value_of(load_config(preset="paper"), key) is False
    text = "verification: {enabled: true, min_height: 1}"
    assert value_of(load(text, preset="paper"), key) is True
    assert value_of(load(text, preset="paper", overrides=["verification.enabled=false"]), key) is False
    layered = load(text, preset="paper", overrides=["verification.enabled=false"], options={key: True})
    assert value_of(layered, key) is True
    assert layered.verification.min_height == 1
    assert layered.averaging.refine is False  # the rest of the preset is still there


def test_the_preset_may_come_from_any_layer(load):
    assert load("preset: paper") == load_config(preset="paper")
    assert load("", overrides=["preset=paper"]) == load_config(preset="paper")
    assert load("preset: paper", preset="auto") == load_config()
    assert load("preset: paper", overrides=["preset=auto"]) == load_config()


def test_the_presets_name_themselves():
    assert PRESETS == ("auto", "paper")
    assert [load_config(preset=name).preset for name in PRESETS] == ["auto", "paper"]


def test_a_later_override_wins():
    assert load_config(overrides=["slicing.planes=3", "slicing.planes=4"]).slicing.planes == 4


def test_an_override_may_set_a_whole_section():
    config = load_config(overrides=["slicing={planes: 3, thickness: 0.5}"])
    assert (config.slicing.planes, config.slicing.thickness, config.slicing.min_points) == (3, 0.5, 20)


def test_a_configuration_can_be_changed():
    start = load_config(preset="paper", overrides=["seed=3"])
    changed = load_config(start=start, options={"slicing.planes": 7})
    assert changed.slicing.planes == 7
    assert changed.model_copy(update={"slicing": start.slicing}) == start


@pytest.mark.parametrize("key", KEYS)
def test_setting_a_key_to_its_default_changes_nothing(key):
    value = value_of(Config(), key)
    assert load_config(options={key: value}) == Config()


def test_named_options_leave_out_what_was_not_given():
    assert named_options() == {}
    assert named_options(seed=0, radius=(None, 2.0)) == {"seed": 0, "scene.radius_max": 2.0}
    assert named_options(max_cylinders=1, planes=0, radius=(1.0, None)) == {
        "max_cylinders": 1,
        "slicing.planes": 0,
        "scene.radius_min": 1.0,
    }
    assert named_options(axis_sd_deg=0.1, known_radius=(0.5, None)) == {
        "scene.axis_sd_deg": 0.1,
        "scene.known_radius": 0.5,
    }
    assert named_options(known_radius=(0.5, 0.01)) == {"scene.known_radius": 0.5, "scene.known_radius_sd": 0.01}
    assert named_options(axis=(0, -1, 0), axis_tolerance_deg=5, min_coverage_deg=0) == {
        "scene.axis": [0, -1, 0],
        "scene.axis_tolerance_deg": 5,
        "verification.min_coverage_deg": 0,
    }
    assert named_options(blends=False) == {"verification.blends": False}
    assert named_options(blends=True) == {"verification.blends": True}
    assert [named_options(axis=name)["scene.axis"] for name in "xyz"] == [[1, 0, 0], [0, 1, 0], [0, 0, 1]]


def test_a_tolerance_may_be_given_apart_from_its_axis_but_not_without():
    options = named_options(axis_tolerance_deg=5)
    check_tolerance(load_config(overrides=["scene.axis=[0, 0, 1]"], options=options), options)
    check_tolerance(load_config(overrides=["scene.axis_tolerance_deg=5"]), {})
    with pytest.raises(ConfigError, match="axis tolerance: is given without the axis it refers to"):
        check_tolerance(load_config(options=options), options)


# what a file may look like


@pytest.mark.parametrize("text", ["", "# nothing\n", "---\n", "null", "slicing:\n  # planes: 3\n", "\ufeffseed: 0"])
def test_a_file_that_says_nothing_is_the_defaults(load, text):
    assert load(text) == Config()


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 0.001),
        ("1E-3", 0.001),
        ("1.e+2", 100.0),
        (".5", 0.5),
        ("+2", 2),
        ("010", 10),
        ("~", None),
        ("Null", None),
        ("TRUE", True),
        ("yes", "yes"),
        ("on", "on"),
        ("1:30", "1:30"),
        ("1_000", "1_000"),
        (".inf", ".inf"),
        (".nan", ".nan"),
        ("0x10", "0x10"),
        ("2001-01-01", "2001-01-01"),
        ("'1'", "1"),
        ("nUll", "nUll"),
    ],
)
def test_scalars_mean_what_they_look_like(text, value):
    (read,) = parse_yaml(f"[{text}]", "text")
    assert (read, type(read)) == (value, type(value))


def test_a_number_may_be_written_with_an_exponent(load):
    assert load("slicing: {thickness: 1e-3}").slicing.thickness == 0.001


# what is refused, word for word

REFUSED = [
    ("slicing:\n  thicknes: 1", "my.yaml: slicing.thicknes: unknown key; did you mean 'thickness'?"),
    ("slicin: {planes: 1}", "my.yaml: slicin: unknown key; did you mean 'slicing'?"),
    ("thickness: 1", "my.yaml: thickness: unknown key; did you mean 'slicing.thickness'?"),
    ("slicing.planes: 1", "my.yaml: slicing.planes: unknown key; write 'planes' below 'slicing:', indented"),
    (
        "slicing: {zzz: 1}",
        "my.yaml: slicing.zzz: unknown key; "
        "the keys here are planes, inclination_deg, local_planes, windows, thickness, min_points",
    ),
    ("slicing: {planes: 2.5}", "my.yaml: slicing.planes: 2.5 is not an integer; write digits alone"),
    ("slicing: {planes: true}", "my.yaml: slicing.planes: true is not an integer; write digits alone"),
    ("slicing: {planes: null}", "my.yaml: slicing.planes: null is not an integer; write digits alone"),
    ("slicing: {thickness: yes}", "my.yaml: slicing.thickness: 'yes' is not a number; write a number such as 0.05"),
    ("slicing: {thickness: '1'}", "my.yaml: slicing.thickness: '1' is not a number; write a number such as 0.05"),
    ("slicing: {thickness: .inf}", "my.yaml: slicing.thickness: '.inf' is not a number; write a number such as 0.05"),
    (
        "slicing: {thickness: 1e999}",
        "my.yaml: slicing.thickness: inf is not a finite number; write a number such as 0.05",
    ),
    ("slicing: {thickness: 0}", "my.yaml: slicing.thickness: 0 is out of range; it must be > 0"),
    ("slicing: {min_points: 5}", "my.yaml: slicing.min_points: 5 is out of range; it must be >= 6"),
    ("ellipses: {min_share: 1.5}", "my.yaml: ellipses.min_share: 1.5 is out of range; it must be <= 1"),
    ("clustering: {angle_deg: 90}", "my.yaml: clustering.angle_deg: 90 is out of range; it must be < 90"),
    (
        "ellipses: {pieces: yes}",
        "my.yaml: ellipses.pieces: 'yes' is not true or false; write true or false without quotes",
    ),
    (
        "clustering: {kernel: lokal}",
        "my.yaml: clustering.kernel: 'lokal' is not one of its values; did you mean 'local'?",
    ),
    ("preset: on", "my.yaml: preset: 'on' is not one of its values; choose auto or paper"),
    ("preset: papre", "my.yaml: preset: 'papre' is not one of its values; did you mean 'paper'?"),
    ("candidates: {sources: slices}", "my.yaml: candidates.sources: 'slices' is not a list; write [a, b]"),
    ("candidates: {sources: []}", "my.yaml: candidates.sources: [] is too short; it must have 1 or more entries"),
    ("slicing: 3", "my.yaml: slicing: 3 is not a section; write its keys below it, indented"),
    ("seed: [1]", "my.yaml: seed: [1] is not an integer; write digits alone"),
    ("scene: {noise: {a: 1}}", "my.yaml: scene.noise: a section is not a number; write a number such as 0.05"),
    ("scene: {radius_min: 3, radius_max: 1}", "my.yaml: scene: radius_min 3 is above radius_max 1; swap them"),
    (
        "slicing: {planes: 0}\ncandidates: {sources: [slices]}",
        "my.yaml: there are no planes, and candidates.sources has slices alone; raise slicing.planes",
    ),
    ("scene: {axis: [0, 0, 0]}", "my.yaml: scene: axis [0, 0, 0] is not a direction; write [0, 0, 1] for upright"),
    (
        "scene: {axis: [0, 1, 2, 3]}",
        "my.yaml: scene.axis: [0, 1, 2, 3] is too long; it must have 3 or fewer entries",
    ),
    (
        "scene: {axis: [0, 1, up]}",
        "my.yaml: scene.axis.2: 'up' is not a number; write a number such as 0.05",
    ),
    (
        "scene: {axis: [0, 1, .inf]}",
        "my.yaml: scene.axis.2: '.inf' is not a number; write a number such as 0.05",
    ),
    ("scene: {axis_tolerance_deg: 0}", "my.yaml: scene.axis_tolerance_deg: 0 is out of range; it must be > 0"),
    ("scene: {axis_sd_deg: 1}", "scene.axis_sd_deg: is given without scene.axis; give that, too"),
    ("scene: {known_radius_sd: 1}", "scene.known_radius_sd: is given without scene.known_radius; give that, too"),
    (
        "scene: {axis: [0, 0, 1]}\nslicing: {inclination_deg: [50, 40]}",
        "my.yaml: slicing: inclination_deg [50, 40] has its least angle above its greatest; swap them",
    ),
    (
        "slicing: {inclination_deg: [40, 50]}",
        "slicing.inclination_deg: is given without the axis it refers to; give scene.axis, too",
    ),
    (
        "scene: {axis: [0, 0, 1]}\nslicing: {inclination_deg: [40, 91]}",
        "my.yaml: slicing.inclination_deg.1: 91 is out of range; it must be <= 90",
    ),
    (
        "scene: {axis: [0, 0, 1]}\nslicing: {inclination_deg: [40]}",
        "my.yaml: slicing.inclination_deg: [40] is too short; it must have 2 or more entries",
    ),
    (
        "method: msca",
        "my.yaml: method: 'msca' is not one of its values; did you mean 'msac'?",
    ),
    (
        "method: tran\nscene: {known_radius: 1}",
        "scene.known_radius: is for method gt alone, and the method is tran; leave it out, or use method gt",
    ),
    ("msac: {removal: 1}", "my.yaml: msac.removal: 1 is out of range; it must be < 1"),
    ("tran: {normal_angle_deg: 90}", "my.yaml: tran.normal_angle_deg: 90 is out of range; it must be < 90"),
    ("jin: {min_spheres: 2}", "my.yaml: jin.min_spheres: 2 is out of range; it must be >= 3"),
    ("line_fit: {reach: 0}", "my.yaml: line_fit.reach: 0 is out of range; it must be > 0"),
    ("line-fit: {reach: 0.5}", "my.yaml: line-fit: unknown key; did you mean 'line_fit'?"),
    ("scene: {known_radius: 0}", "my.yaml: scene.known_radius: 0 is out of range; it must be > 0"),
    ("scene: {axis_tolerance_deg: 91}", "my.yaml: scene.axis_tolerance_deg: 91 is out of range; it must be <= 90"),
    ("- a\n- b", "my.yaml: has no keys at its top level; write 'section:' and its keys below it"),
    ("seed", "my.yaml: has no keys at its top level; write 'section:' and its keys below it"),
    ("seed: 1\n\nseed: 2", "my.yaml:3: the key 'seed' appears twice; leave one of them out"),
    ("slicing:\n  planes: 1\n  planes: 1", "my.yaml:3: the key 'planes' appears twice; leave one of them out"),
    ("? [a]\n: 1", "my.yaml:1: a key must be a word; write 'key: value'"),
    ("seed: 1\n a: b: c", "my.yaml:2: mapping values are not allowed here; correct the YAML there"),
    ("\tseed: 1", "my.yaml:1: found character '\\t' that cannot start any token; correct the YAML there"),
    ("seed: {", "my.yaml:1: expected the node content, but found '<stream end>'; correct the YAML there"),
    ("seed: 'a", "my.yaml:1: found unexpected end of stream; correct the YAML there"),
    (
        "--- {}\n--- {}",
        "my.yaml:2: expected a single document in the stream but found another document; correct the YAML there",
    ),
    ("seed: &x 1", "my.yaml:1: anchors and aliases are not allowed; write the value out"),
    ("seed: *x", "my.yaml:1: anchors and aliases are not allowed; write the value out"),
    (
        "seed: !!python/object/apply:os.system ['true']",
        "my.yaml:1: the tag tag:yaml.org,2002:python/object/apply:os.system is not allowed; write a plain value",
    ),
    ("a: 1\nb: !thing {}", "my.yaml:2: the tag !thing is not allowed; write a plain value"),
    ("seed: !!int 3", "my.yaml:1: the tag tag:yaml.org,2002:int is not allowed; write a plain value"),
    ("seed: \x00", "my.yaml: holds the character #x0000; give a YAML text file"),
    (b"seed: \xff\xfe", "my.yaml: is not UTF-8 text; give a YAML file"),
    ("\n" + "[" * 40_000, "my.yaml:2: is nested too deeply; a configuration has two levels"),
    ("#" * 100_001, "my.yaml: is larger than 100 kB; give a YAML file"),
]


@pytest.mark.parametrize(("text", "message"), REFUSED, ids=[message[:60] for _, message in REFUSED])
def test_a_fault_in_a_file_is_named(load, text, message):
    with pytest.raises(ConfigError) as caught:
        load(text)
    assert str(caught.value) == message
    assert caught.value.exit_code == 2


def test_a_bomb_of_aliases_does_not_go_off(load):
    lines = ["a0: &a0 [x, x]"] + [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 12)]
    with pytest.raises(ConfigError, match="anchors and aliases are not allowed"):
        load("\n".join(lines))


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["slicing.thicknes=1"], "--set slicing.thicknes: unknown key; did you mean 'thickness'?"),
        (["slicing.planes"], "--set slicing.planes: has no key and value; write --set section.key=value"),
        (["=3"], "--set =3: has no key and value; write --set section.key=value"),
        (["slicing.planes=yes"], "--set slicing.planes: 'yes' is not an integer; write digits alone"),
        (["slicing.planes="], "--set slicing.planes: null is not an integer; write digits alone"),
        (["seed=["], "--set seed:1: expected the node content, but found '<stream end>'; correct the YAML there"),
        (["scene.radius_min=2", "scene.radius_max=1"], "--set scene: radius_min 2 is above radius_max 1; swap them"),
    ],
)
def test_a_fault_in_an_override_is_named(overrides, message):
    with pytest.raises(ConfigError) as caught:
        load_config(overrides=overrides)
    assert str(caught.value) == message


def test_what_is_impossible_together_is_found_across_layers(load):
    with pytest.raises(ConfigError, match=r"^scene: radius_min 3 is above radius_max 1; swap them$"):
        load("scene: {radius_max: 1}", options={"scene.radius_min": 3.0})
    with pytest.raises(ConfigError, match=r"^there are no planes|^configuration: there are no planes"):
        load_config(preset="paper", options={"slicing.planes": 0})


def test_an_unknown_preset_is_named():
    with pytest.raises(ConfigError) as caught:
        load_config(preset="papr")
    assert str(caught.value) == "preset: 'papr' is not one of its values; did you mean 'paper'?"


def test_a_file_that_cannot_be_read_is_named(tmp_path):
    with pytest.raises(ConfigError) as missing:
        load_config(path=tmp_path / "my.yaml")
    assert str(missing.value) == f"{tmp_path / 'my.yaml'}: no such file; 'cylx config init' writes one"
    with pytest.raises(ConfigError, match="cannot be read: Is a directory; give a readable YAML file"):
        load_config(path=tmp_path)


def test_a_file_that_may_not_be_read_is_named(monkeypatch):
    def refuse(*_):
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(ConfigError, match=r"^my\.yaml: cannot be read: Permission denied; give a readable YAML file$"):
        load_config(path="my.yaml")


# texts


@pytest.mark.parametrize("write", [commented_yaml, plain_yaml])
@pytest.mark.parametrize("preset", PRESETS)
def test_what_is_written_loads_back(load, write, preset):
    config = load_config(preset=preset, overrides=["slicing.thickness=1e-7", "scene.radius_max=1e9", "max_cylinders=3"])
    assert load(write(config)) == config


def test_every_key_is_written_below_its_meaning():
    lines = [line.strip() for line in commented_yaml(Config()).splitlines()]
    properties = Config.model_json_schema()["properties"]
    sections = Config.model_json_schema()["$defs"]
    for key in KEYS:
        *section, name = key.split(".")
        described = sections[properties[section[0]]["$ref"].rpartition("/")[2]]["properties"] if section else properties
        places = [i for i, line in enumerate(lines) if line.startswith(f"{name}: ")]
        above = " ".join(line.removeprefix("# ") for i in places for line in lines[max(0, i - 4) : i])
        assert described[name]["description"] in above, key
        assert "default" in above, key


def test_the_published_schema_holds_for_what_is_written():
    schema = Config.model_json_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    for preset in PRESETS:
        jsonschema.validate(parse_yaml(commented_yaml(load_config(preset=preset)), "text"), schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"slicing": {"thicknes": 1}}, schema)
