"""The documentation says what the code does: every command, key, file, equation and link."""

import ast
import importlib
import inspect
import json
import re

import click
import pytest
import yaml

from cylx import errors
from cylx.config import Config
from cylx.evidence import weights as evidence_weights
from cylx.io.annotated_columns import OURS
from cylx.pipeline import candidates, rounds
from cylx.records import Scene
from cylx.scene import priors, resolve
from cylx.stages import averaging, clustering, curvature, local_slices, patches, rims, verification
from cylx.tiles import results as tile_results
from tests.support.docs_tables import PACKAGE, TABLES, TOLD, commands, config_keys, config_sections, options_of

ROOT = PACKAGE.parent
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.glob("*.md")), ROOT / "sample_data" / "README.md", ROOT / "CHANGELOG.md"]


def read(page):
    return (ROOT / page).read_text(encoding="utf-8")


def part(text, heading):
    """Give what stands under a heading, up to the next one of its level or above."""
    level = len(heading) - len(heading.lstrip("#"))
    found = re.search(rf"^{re.escape(heading)}\n(.*?)(?=^#{{1,{level}}} |\Z)", text, re.DOTALL | re.MULTILINE)
    assert found, f"no heading {heading!r}"
    return found[1]


def rows_of(text):
    """Give the cells of the rows of the tables in a text."""
    lines = [line for line in text.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines if "---" not in line]


# --- what is written from the code


def generated():
    for path in PAGES:
        for name in re.findall(r"<!-- begin (.*?) -->", path.read_text(encoding="utf-8")):
            if name in TABLES:
                yield path, name


@pytest.mark.parametrize(("path", "name"), [pytest.param(path, name, id=name) for path, name in generated()])
def test_what_is_written_from_the_code_is_up_to_date(path, name, request):
    text = path.read_text(encoding="utf-8")
    pattern = re.compile(rf"(<!-- begin {name} -->\n).*?(<!-- end {name} -->)", re.DOTALL)
    assert len(pattern.findall(text)) == 1
    new = pattern.sub(lambda found: f"{found[1]}\n{TABLES[name]()}\n\n{found[2]}", text)
    if request.config.getoption("--regen"):
        path.write_text(new, encoding="utf-8", newline="\n")
        text = new
    assert text == new, "write it anew by pytest tests/test_docs.py --regen"


def test_every_table_is_on_one_page():
    assert sorted(name for _, name in generated()) == sorted(TABLES)


# --- the command line


@pytest.mark.parametrize(
    ("path", "command"), list(commands()), ids=lambda value: value if isinstance(value, str) else ""
)
def test_every_command_and_option_has_help_and_is_told_of(path, command):
    section = part(read("docs/command-line.md"), f"### {path}")
    assert command.help
    assert command.help.strip().split("\n")[0] in section
    for option in options_of(command):
        assert option.help, option.name
        assert option.help.endswith((".", "]")), f"{path} {option.opts[0]}: the help is no sentence"
        for name in [*option.opts, *option.secondary_opts]:
            assert re.search(rf"`{name}[ `]", section), name
    for argument in (param for param in command.params if isinstance(param, click.Argument)):
        word = (argument.metavar or argument.name.upper()).removesuffix("...")
        assert re.search(rf"\b{word}\b", command.help), f"{path}: the help does not say what {word} is"


def test_every_exit_code_is_told_of():
    kinds = [kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, errors.CylxError)]
    codes = {str(kind.exit_code) for kind in kinds} | {"0", "1", "130", "141"}
    assert {row[0].strip("`") for row in rows_of(part(read("docs/command-line.md"), "## Exit codes"))[1:]} == codes


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_line_that_sets_completion_up_works(shell, spawn_cylx):
    assert f"_CYLX_COMPLETE={shell}_source cylx" in read("docs/command-line.md")
    code = "import os; os.environ['_CYLX_COMPLETE'] = '{}'"
    source = spawn_cylx(prelude=code.format(f"{shell}_source"))
    assert source.returncode == 0
    assert b"_CYLX_COMPLETE" in source.stdout


FILES = [
    pytest.param(command, param, id=f"{path} {param.name}")
    for path, command in commands()
    for param in command.params
    if (isinstance(param, click.Argument) and not isinstance(param.type, click.Choice)) or param.metavar == "FILE"
]


@pytest.mark.parametrize(("command", "param"), FILES)
def test_the_shell_completes_the_names_of_files(command, param):
    (item,) = param.shell_complete(click.Context(command), "sc")
    assert (item.type, item.value) == ("file", "sc")


# --- the configuration


def test_every_key_of_the_configuration_is_told_of():
    page = read("docs/configuration.md")
    for section, _, entries in config_sections():
        told = part(page, f"### {section or 'Top level'}")
        for key, entry in entries.items():
            (row,) = (row for row in rows_of(told) if row[0] == f"`{key}`")
            assert all((row[1], row[3], row[4])), f"{section}.{key}"
            assert entry["description"].endswith(".")


def test_what_null_means_is_told_of_and_true():
    rows = {
        row[0].strip("`"): row[1] for row in rows_of(part(read("docs/configuration.md"), "## What `null` means"))[1:]
    }
    assert set(rows) <= set(config_keys())
    for known in (Scene(0.01, 0.002, 3.0), Scene(0.01, 0.03, 50.0)):
        resolved = resolve(Config(), known).model_dump()
        values = {"spacing": known.spacing, "noise": known.noise, "extent": known.extent}
        for key in config_keys():
            section, _, name = key.rpartition(".")
            before, after = (c[section][name] if section else c[name] for c in (Config().model_dump(), resolved))
            if before is None and after is None:
                assert key not in rows or "`" not in rows[key]
            elif before is None:
                rule = re.fullmatch("`(.*)`", rows[key])[1]
                meaning = eval(rule, {"max": max, "min": min, **values})
                assert after == pytest.approx(meaning), key
                values[name] = after


# --- the files


@pytest.mark.parametrize("golden", sorted((ROOT / "sample_data" / "golden").glob("*.json")), ids=lambda path: path.stem)
def test_every_key_of_a_result_is_told_of(golden):
    result = json.loads(golden.read_text(encoding="utf-8"))
    page = read("docs/json-format.md")
    places = {
        "### The file": [result],
        "### Input": [result["input"]],
        "### SceneScale": [result["scene"]],
        "### Stage": result["stages"],
        "### ResultCylinder": result["cylinders"],
    }
    for heading, parts in places.items():
        told = [row[0] for row in rows_of(part(page, heading))[1:]]
        for one in parts:
            assert [f"`{key}`" for key in one] == [key for key in told if key.strip("`") in one]


def test_every_measure_of_the_evidence_is_told_of():
    told = [row[0].strip("`") for row in rows_of(part(read("docs/json-format.md"), "## The evidence"))[1:]]
    for golden in (ROOT / "sample_data" / "golden").glob("*.json"):
        for cylinder in json.loads(golden.read_text(encoding="utf-8"))["cylinders"]:
            assert set(cylinder.get("evidence", ())) <= set(told)
    measured = re.search(r"measures = \{\n(.*?)\n    \}", inspect.getsource(verification), re.DOTALL)[1]
    assert told == re.findall(r'^        "(\w+)": ', measured, re.MULTILINE)


def test_every_stage_is_told_of_with_its_reasons():
    page = read("docs/json-format.md")
    rejected = part(page, "## The rejected")
    rows = rows_of(part(page, "## The stages"))[1:]
    told = {row[0].strip("`"): row[3] + (rejected if "](#the-rejected)" in row[3] else "") for row in rows}
    source = "".join(inspect.getsource(module) for module in (candidates, rounds, curvature, patches, rims, clustering))
    source += inspect.getsource(tile_results)
    assert set(told) == set(re.findall(r'(?:\.report|StageReport)\("([a-z ]+)"', source))
    reasons = {("curvature", reason) for reason in curvature.OUTCOMES[:-1]}
    reasons |= {("patches", reason) for reason in patches.OUTCOMES[:-1]}
    reasons |= {("local slicing", reason) for reason in local_slices.COUNTS[1:]}
    reasons |= {("verification", rounds.FOUND_BEFORE)}
    for golden in (ROOT / "sample_data" / "golden").glob("*.json"):
        for stage in json.loads(golden.read_text(encoding="utf-8"))["stages"]:
            reasons |= {(stage["name"], reason) for reason in stage["rejected"]}
    assert [(stage, reason) for stage, reason in sorted(reasons) if f"`{reason}`" not in told[stage]] == []


def test_every_reason_of_a_rejection_is_told_of():
    told = part(read("docs/json-format.md"), "## The rejected")
    reasons = {term.reason for term in (*evidence_weights.TERMS, *evidence_weights.UPRIGHT_TERMS)}
    reasons |= set(re.findall(r'"([a-z _]+)": ', inspect.getsource(verification.broken_limit)))
    ours = r'"([a-z_ ]+ (?:range|one|max_cylinders))"'
    for module, found in ((averaging, r'return "([a-z ]+)"'), (rounds, ours), (priors, ours)):
        reasons |= set(re.findall(found, inspect.getsource(module)))
    assert {"agreement", "bulge", "drifted away", "axis out of range", "beyond max_cylinders"} <= reasons
    assert [reason for reason in sorted(reasons) if f"`{reason}`" not in told] == []


def test_every_key_of_a_truth_is_told_of():
    told = part(read("docs/json-format.md"), "## Truth files")
    for path in (ROOT / "sample_data").glob("*.truth.json"):
        truth = json.loads(path.read_text(encoding="utf-8"))
        for key in [*truth, *truth["cylinders"][0]]:
            assert f"`{key}`" in told


def test_every_property_of_the_annotated_ply_is_told_of():
    told = part(read("docs/json-format.md"), "## The annotated PLY")
    assert {row[0].strip("`") for row in rows_of(told)[1:]} == set(OURS)


# --- the method


EQUATIONS = ["eq. 1", "eq. 2", "eq. 3", "eq. 4", "eq. 5", "eq. 6", "eq. 7", "eq. 8", "A.1", "A.2", "A.3", "A.4"]


def equation_table():
    rows = rows_of(part(read("docs/how-it-works.md"), "## Equations and functions"))[1:]
    return [(row[0], name) for row in rows for name in re.findall(r"`(cylx\.[\w.]+)`", row[2])]


def equations_named(source):
    """Give the equations that a source names, as in 'eq. 2, 5 and 6' or '(A.1)'."""
    for first in re.findall(r"\beq\. (\d(?:(?:, | and |, and )\d)*)", source):
        yield from (f"eq. {number}" for number in re.findall(r"\d", first))
    yield from re.findall(r"\bA\.\d", source)


def test_every_equation_has_its_function():
    assert list(dict.fromkeys(equation for equation, _ in equation_table())) == EQUATIONS


@pytest.mark.parametrize(("equation", "name"), equation_table())
def test_the_function_of_an_equation_is_there_and_names_it(equation, name):
    module, _, function = name.rpartition(".")
    try:
        home = importlib.import_module(module)
    except ModuleNotFoundError:  # a method
        module, _, kind = module.rpartition(".")
        home = getattr(importlib.import_module(module), kind)
    found = getattr(home, function)
    assert callable(found)
    assert equation in set(equations_named(inspect.getsource(found)))


# --- the house and the pages


def test_every_file_of_the_package_is_on_the_page_of_the_design():
    rooms = read("docs/design.md").partition("<!-- begin rooms -->")[2].partition("<!-- end rooms -->")[0]
    told = [path for block in rooms.split("\n\n`") for path in files_of(block)]
    there = [path for path in PACKAGE.rglob("*") if path.suffix in TOLD and path.stat().st_size]
    assert sorted(told) == sorted(path.relative_to(ROOT).as_posix() for path in there)
    assert all(re.findall(r"^- `.*`: \S.*$", rooms, re.MULTILINE))
    assert not re.findall(r"^- `.*`: *$", rooms, re.MULTILINE)


def questions():
    """Give the questions of a newcomer, each with the file that answers it and a name defined there."""
    for question, path, name in rows_of(part(read("docs/design.md"), "## Where is …?").partition("\n### ")[0])[1:]:
        yield pytest.param(path.strip("`"), name.strip("`"), id=question)


@pytest.mark.parametrize(("path", "name"), list(questions()))
def test_the_file_that_answers_a_question_defines_the_name(path, name):
    defined = rf"^(?:def {name}\b|class {name}\b|{name}(?:: .*)? = )"
    assert re.search(defined, read(path), re.MULTILINE)


def test_the_files_to_change_when_contributing_are_there():
    named = set(re.findall(r"`(cylx/[a-z_/]+\.py)`", part(read("docs/design.md"), "## Contributing")))
    new = {"cylx/io/abc.py", "cylx/export/abc.py"}  # that of an example
    assert new <= named
    assert [path for path in sorted(named - new) if not (ROOT / path).is_file()] == []


def files_of(block):
    folder = re.search(r"(cylx[\w/]*/)`", block)
    return [folder[1] + name for name in re.findall(r"^- `(.*?)`", block, re.MULTILINE)] if folder else []


def test_the_index_leads_to_every_page():
    links = set(re.findall(r"\]\(([\w-]+\.md)\)", read("docs/README.md")))
    assert {path.name for path in DOCS.glob("*.md")} - {"README.md"} <= links


def nav_pages(entries):
    """Give the pages of a part of the navigation, in their order."""
    for entry in entries:
        place = next(iter(entry.values())) if isinstance(entry, dict) else entry
        yield from nav_pages(place) if isinstance(place, list) else [place]


def papers():
    """Give the files outside docs/ that are pages of the site, by their paths: `PAPERS` of its hooks, read not run."""
    tree = ast.parse(read(".ci/site/hooks.py"))
    (value,) = (node.value for node in tree.body if isinstance(node, ast.Assign) and node.targets[0].id == "PAPERS")
    return ast.literal_eval(value)


def test_the_navigation_of_the_site_has_every_page_once():
    found = list(nav_pages(yaml.safe_load(read(".mkdocs.yml"))["nav"]))
    assert sorted(found) == sorted([*(path.name for path in DOCS.glob("*.md")), *papers().values()])
    assert all((ROOT / path).is_file() for path in papers())


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_page_that_is_linked_to_is_in_the_site(path):
    for target in re.findall(r"\]\((?!https?:|#)([^)\s#]+)", path.read_text(encoding="utf-8")):
        there = (path.parent / target).resolve().relative_to(ROOT)
        assert there.parts[0] == "docs" or there.as_posix() in papers(), target


def anchors(text):
    """Give the anchors of the headings of a page, as GitHub makes them."""
    bare = re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
    for heading in re.findall(r"^#+ (.*)$", bare, re.MULTILINE):
        yield re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_link_inside_the_project_leads_somewhere(path):
    text = path.read_text(encoding="utf-8")
    for target in re.findall(r"\]\((?!https?:)([^)\s]+)\)", text):
        name, _, anchor = target.partition("#")
        there = path.parent / name if name else path
        assert there.exists(), target
        if anchor:
            assert anchor in anchors(there.read_text(encoding="utf-8")), target
