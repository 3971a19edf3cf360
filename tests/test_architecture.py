"""The arrows of docs/design.md: who may import whom, what files may be called, and how long they may be."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "cylx"
FILES = sorted(PACKAGE.rglob("*.py"))

EVERYTHING = {
    "api", "baselines", "catalogue", "cautions", "cli", "config", "consensus", "cylx", "diagnosis", "errors",
    "evaluation", "evidence", "experiments", "export", "fitting", "game", "geometry", "io", "json_parts",
    "matplotlib_door", "measures", "noise", "open3d_door", "palette", "payoff", "pipeline", "records", "rejections",
    "report", "results", "scene", "selection", "stages", "surroundings", "synthetic", "tables",
}  # fmt: skip
MAY_IMPORT = {
    "cylx": EVERYTHING - {"cli"},
    "__main__": {"cli"},
    "cli": EVERYTHING,
    "api": {"config", "errors", "io", "pipeline", "records", "results", "selection", "tables"},
    "diagnosis": {"api", "cylx", "open3d_door", "pipeline", "records", "synthetic"},
    "export": {"cylx", "errors", "geometry", "palette", "results", "tables"},
    "consensus": {"records"},
    "fitting": {"errors", "geometry", "measures", "records", "scene"},
    "experiments": {
        "config", "cylx", "errors", "geometry", "matplotlib_door", "open3d_door", "pipeline", "records", "synthetic",
    },
    "measures": {"geometry", "records"},
    "pipeline": {
        "baselines", "catalogue", "cautions", "config", "consensus", "errors", "game", "geometry", "measures",
        "records", "scene", "stages",
    },
    "baselines": {"config", "errors", "geometry", "measures", "open3d_door", "records"},
    "stages": {
        "catalogue", "config", "consensus", "errors", "evidence", "game", "geometry", "measures", "payoff", "records",
        "surroundings",
    },
    "noise": {"geometry"},
    "payoff": {"game", "geometry"},
    "scene": {"catalogue", "config", "errors", "geometry", "noise", "records"},
    "results": {"config", "cylx", "errors", "geometry", "json_parts", "records", "tables"},
    "rejections": {"cylx", "json_parts", "records", "results"},
    "json_parts": {"records"},
    "report": {
        "config", "cylx", "errors", "geometry", "json_parts", "matplotlib_door", "palette", "records", "rejections",
        "results",
    },
    "selection": {"errors", "records"},
    "surroundings": {"measures"},
    "tables": {"errors"},
    "io": {"errors", "geometry", "open3d_door", "palette", "records"},
    "matplotlib_door": {"errors"},
    "open3d_door": set(),
    "palette": set(),
    "records": {"catalogue", "config", "cylx", "geometry"},
    "config": {"errors"},
    "synthetic": {"errors", "geometry"},
    "evaluation": {"errors"},
    "catalogue": set(),
    "cautions": {"records"},
    "evidence": set(),
    "geometry": set(),
    "game": set(),
    "errors": set(),
}  # fmt: skip
OWN_SECTION = {
    "curvature": "CandidatesConfig",
    "local_slices": "SlicingConfig",
}  # the others are called after their file
ONLY_IN = {
    "OCP": {"export"},
    "click": {"cli"},
    "ezdxf": {"export"},
    "ifcopenshell": {"export"},
    "laspy": {"io"},
    "lazrs": {"io"},
    "matplotlib": {"experiments", "matplotlib_door", "report"},  # but for types in the door alone
    "libusb_package": {"open3d_door"},
    "open3d": {"open3d_door"},
    "pandas": {"tables"},
    "plyfile": {"io"},
    "pye57": {"io"},
    "rich": {"cli"},
    "trimesh": {"export"},
}
NAMES_OF_NO_ROOM = {"base", "common", "core", "helpers", "manager", "misc", "utils"}
MOST_LINES, MOST_LINES_OF_CODE = 320, 60  # of a file, of a function


def room_of(module):
    """Give the room a dotted module is in; the configuration has several files beside each other."""
    parts = module.split(".")
    name = parts[1] if len(parts) > 1 else "cylx"
    return "config" if name.startswith("config") or name == "strict_yaml" else name


def imports(tree):
    """Give (line, module, name) of every import, wherever it stands; name is None for a plain import."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name, None) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            module = "." * node.level + (node.module or "")
            for alias in node.names:
                inner = module == "cylx" and room_of(f"cylx.{alias.name}") in EVERYTHING
                yield (node.lineno, f"cylx.{alias.name}", None) if inner else (node.lineno, module, alias.name)


def import_faults(module, tree):
    here = room_of(module)
    if here not in MAY_IMPORT:
        yield f"{module}: a new room: say in MAY_IMPORT what it may import"
        return
    for line, other, name in imports(tree):
        place, top, there = f"{module}:{line}:", other.split(".")[0], room_of(other)
        if not top:
            yield f"{place} relative import"
        elif top != "cylx":
            if here not in ONLY_IN.get(top, {here}):
                yield f"{place} {top} is only for {' and '.join(sorted(ONLY_IN[top]))}"
        elif here == there == "stages" and other != module:
            yield f"{place} a stage imports another stage, {other}"
        elif there not in MAY_IMPORT[here] | {here}:
            yield f"{place} {here} must not import {there}"
        elif (here, there) == ("stages", "config"):
            stage = module.split(".")[-1]
            if name != OWN_SECTION.get(stage, f"{stage.capitalize()}Config"):
                yield f"{place} a stage knows its own section only, not {name or 'all of them'}"


def shape_faults(module, source, tree):
    for part in module.split(".")[1:]:
        if part.strip("_") in NAMES_OF_NO_ROOM:
            yield f"{module}: '{part}' is no name of a room"
    lines = source.splitlines()
    if len(lines) > MOST_LINES:
        yield f"{module}: {len(lines)} lines, at most {MOST_LINES}"
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            docstring = node.body[0] if ast.get_docstring(node) is not None else None
            prose = range(docstring.lineno, docstring.end_lineno + 1) if docstring else ()
            code = (lines[n - 1].strip() for n in range(node.lineno, node.end_lineno + 1) if n not in prose)
            length = sum(1 for line in code if line and not line.startswith("#"))
            if length > MOST_LINES_OF_CODE:
                yield f"{module}:{node.lineno}: {node.name} has {length} lines of code, at most {MOST_LINES_OF_CODE}"


def kernel_faults(module, tree):
    """Find what makes a kernel slow to compile: of arrays that differ in shape Numba can tell, with seconds of code."""
    for kernel in ast.walk(tree):
        if isinstance(kernel, ast.FunctionDef) and any("njit" in ast.unparse(one) for one in kernel.decorator_list):
            for node in ast.walk(kernel):
                targets = node.targets if isinstance(node, ast.Assign) else []
                places = [target.slice for target in targets if isinstance(target, ast.Subscript)]
                if any(isinstance(part, ast.Slice) for place in places for part in ast.walk(place)):
                    yield f"{module}:{node.lineno}: kernel {kernel.name} assigns a slice"


def faults(module, source):
    tree = ast.parse(source)
    return [*import_faults(module, tree), *shape_faults(module, source, tree), *kernel_faults(module, tree)]


def module_name(path):
    return ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")


@pytest.mark.parametrize("path", FILES, ids=module_name)
def test_the_house_is_in_order(path):
    assert faults(module_name(path), path.read_text(encoding="utf-8")) == []


def test_the_whole_house_is_looked_at():
    assert {room_of(module_name(path)) for path in FILES} >= EVERYTHING


@pytest.mark.parametrize(
    ("module", "source", "fault"),
    [
        ("cylx.geometry.plane", "from cylx.records import Slice", "must not import records"),
        ("cylx.game", "import cylx.geometry.plane", "must not import geometry"),
        ("cylx.errors", "from cylx import records", "must not import records"),
        ("cylx.stages.slicing", "from cylx.io import read_cloud", "must not import io"),
        ("cylx.stages.slicing", "def f():\n    from cylx.stages.ellipses import fit", "imports another stage"),
        ("cylx.stages.slicing", "from cylx.stages import ellipses", "imports another stage"),
        ("cylx.stages.slicing", "from cylx.config import EllipsesConfig", "own section only, not EllipsesConfig"),
        ("cylx.stages.slicing", "import cylx.config", "own section only, not all of them"),
        ("cylx.stages.slicing", "from cylx.pipeline import extract_cylinders", "must not import pipeline"),
        ("cylx.pipeline", "from cylx.io import read_cloud", "must not import io"),
        ("cylx.scene", "from cylx.stages.slicing import cut", "must not import stages"),
        ("cylx.api", "from cylx.cli import main", "must not import cli"),
        ("cylx.io.ply", "from cylx.results import Result", "must not import results"),
        ("cylx.cli.extract", "import plyfile", "plyfile is only for io"),
        ("cylx.scene", "def f():\n    import open3d.core as o3c", "open3d is only for open3d_door"),
        ("cylx.pipeline", "from rich.progress import Progress", "rich is only for cli"),
        ("cylx.io.ply", "import click", "click is only for cli"),
        ("cylx.stages.slicing", "import matplotlib.cm", "matplotlib is only for experiments"),
        ("cylx.game", "from .geometry import plane", "relative import"),
        ("cylx.attic", "", "a new room"),
        ("cylx.io.utils", "", "'utils' is no name of a room"),
        ("cylx.game", "@njit(cache=True)\ndef f(a, b):\n    a[0, :7] = b", "kernel f assigns a slice"),
        ("cylx.io.ply", "\n" * 321, "321 lines, at most 320"),
        ("cylx.io.ply", "def f():\n" + "    x = 1\n" * 60, "f has 61 lines of code, at most 60"),
    ],
)
def test_each_rule_can_fail(module, source, fault):
    (only,) = faults(module, source)
    assert fault in only


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("cylx.stages.slicing", "from cylx.config import SlicingConfig\nfrom cylx.stages.slicing import cut_slices"),
        ("cylx.stages.curvature", "from cylx.config import CandidatesConfig"),
        ("cylx.geometry.ellipse", "from cylx.geometry.plane import Plane"),
        ("cylx.results", "from cylx import __version__"),
        ("cylx.io.ply", "import plyfile\nfrom cylx.records import PointCloud"),
        ("cylx.io.ply", 'def f():\n    """Say.\n' + "    more\n" * 90 + '    """\n' + "\n    # why\n    x = 1\n" * 59),
    ],
)
def test_what_is_allowed_passes(module, source):
    assert faults(module, source) == []
