"""The arrows of docs/design.md: who may import whom, what files may be called, and how long they may be."""

import ast
from pathlib import Path

import pytest

from tests.support.arrows import MAY_IMPORT

PACKAGE = Path(__file__).resolve().parents[1] / "cylx"
FILES = sorted(PACKAGE.rglob("*.py"))

OWN_SECTION = {
    "curvature": "CandidatesConfig",
    "local_slices": "SlicingConfig",
    "patches": "CandidatesConfig",
}  # the others are called after their file
ONLY_IN = {
    "CSF": {"stems"},
    "OCP": {"export", "io"},
    "click": {"cli"},
    "ezdxf": {"export"},
    "ifcopenshell": {"export", "io"},
    "laspy": {"io"},
    "lazrs": {"io"},
    "matplotlib": {"experiments", "optional", "report"},  # but for types in optional alone
    "libusb_package": {"optional"},
    "open3d": {"optional"},
    "pandas": {"results"},
    "plyfile": {"io"},
    "pye57": {"io"},
    "pyproj": {"export", "io"},
    "rich": {"cli"},
    "trimesh": {"export"},
}
NAMES_OF_NO_ROOM = {"base", "common", "core", "helpers", "manager", "misc", "utils"}
MOST_LINES, MOST_LINES_OF_CODE = 350, 60  # of a file, of a function


def room_of(module):
    """Give the room a dotted module is in."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else "cylx"


def imports(tree):
    """Give (line, module, name) of every import, wherever it stands; name is None for a plain import."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name, None) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            module = "." * node.level + (node.module or "")
            for alias in node.names:
                inner = module == "cylx" and alias.name in MAY_IMPORT
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


def file_graph(sources):
    """Give the files that each file imports, wherever it does; a name of a room counts as the room's own file."""
    graph = {}
    for module, source in sources.items():
        found = set()
        for _, other, name in imports(ast.parse(source)):
            inner = f"{other}.{name}"
            is_file = name is not None and inner in sources and not re_exported(sources.get(other, ""), inner)
            found.add(inner if is_file else other)
        graph[module] = found & set(sources) - {module}
    return graph


def re_exported(source, inner):
    """Tell whether a room has a name of its own for what is in the file of the same name: `resolve` of `resolve.py`."""
    return any((module, name) == (inner, inner.rpartition(".")[2]) for _, module, name in imports(ast.parse(source)))


def circle_in(graph):
    """Give a way round from a node back to itself, or nothing."""
    done, way = set(), []

    def walk(node):
        if node in way:
            return [*way[way.index(node) :], node]
        if node in done:
            return []
        way.append(node)
        found = next(filter(None, map(walk, sorted(graph[node]))), [])
        way.pop()
        done.add(node)
        return found

    return next(filter(None, map(walk, sorted(graph))), [])


def module_name(path):
    return ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")


@pytest.mark.parametrize("path", FILES, ids=module_name)
def test_the_house_is_in_order(path):
    assert faults(module_name(path), path.read_text(encoding="utf-8")) == []


def test_every_room_is_there():
    assert {room_of(module_name(path)) for path in FILES} == set(MAY_IMPORT)


def test_no_room_imports_from_a_floor_above():
    assert circle_in(MAY_IMPORT) == []


def test_no_two_files_import_each_other():
    assert circle_in(file_graph({module_name(path): path.read_text(encoding="utf-8") for path in FILES})) == []


@pytest.mark.parametrize(
    "sources",
    [
        {"cylx.a": "import cylx.b", "cylx.b": "from cylx.a import f"},
        {"cylx.a": "from cylx import b", "cylx.b": "import cylx.c", "cylx.c": "def f():\n    from cylx.a import g"},
        {"cylx.a": "if TYPE_CHECKING:\n    from cylx.b import B", "cylx.b": "from cylx.a import f"},
        {"cylx.r": "from cylx.r.x import f", "cylx.r.x": "from cylx.b import g", "cylx.b": "from cylx.r import f"},
    ],
    ids=["of two", "of three", "for types", "through a room"],
)
def test_a_circle_is_found(sources):
    circle = circle_in(file_graph(sources))
    assert circle[0] == circle[-1]
    assert set(circle) == set(sources)


def test_rooms_within_a_room_make_no_circle():
    sources = {"cylx.r": "from cylx.r.x import f", "cylx.r.x": "from cylx.r.y import g", "cylx.r.y": ""}
    assert circle_in(file_graph(sources)) == []


@pytest.mark.parametrize(
    ("module", "source", "fault"),
    [
        ("cylx.geometry.plane", "from cylx.records import Slice", "must not import records"),
        ("cylx.game.dynamics", "import cylx.config.layers", "must not import config"),
        ("cylx.errors", "from cylx import records", "must not import records"),
        ("cylx.stages.slicing", "from cylx.io import read_cloud", "must not import io"),
        ("cylx.stages.slicing", "def f():\n    from cylx.stages.ellipses import fit", "imports another stage"),
        ("cylx.stages.slicing", "from cylx.stages import ellipses", "imports another stage"),
        ("cylx.stages.slicing", "from cylx.config import EllipsesConfig", "own section only, not EllipsesConfig"),
        ("cylx.stages.slicing", "import cylx.config", "own section only, not all of them"),
        ("cylx.stages.slicing", "from cylx.pipeline import extract_cylinders", "must not import pipeline"),
        ("cylx.pipeline", "from cylx.io import read_cloud", "must not import io"),
        ("cylx.scene.frame", "from cylx.stages.slicing import cut", "must not import stages"),
        ("cylx.api", "from cylx.cli import main", "must not import cli"),
        ("cylx.results.result", "from cylx import __version__", "must not import cylx"),
        ("cylx.results.result", "def f():\n    from cylx import show", "must not import cylx"),
        ("cylx.io.ply", "from cylx.results import Result", "must not import results"),
        ("cylx.cli.extract", "import plyfile", "plyfile is only for io"),
        ("cylx.scene.frame", "def f():\n    import open3d.core as o3c", "open3d is only for optional"),
        ("cylx.pipeline", "from rich.progress import Progress", "rich is only for cli"),
        ("cylx.io.ply", "import click", "click is only for cli"),
        ("cylx.stages.slicing", "import matplotlib.cm", "matplotlib is only for experiments"),
        ("cylx.game.dynamics", "from .geometry import plane", "relative import"),
        ("cylx.attic", "", "a new room"),
        ("cylx.io.utils", "", "'utils' is no name of a room"),
        ("cylx.game.dynamics", "@njit(cache=True)\ndef f(a, b):\n    a[0, :7] = b", "kernel f assigns a slice"),
        ("cylx.io.ply", "\n" * 351, "351 lines, at most 350"),
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
        ("cylx.results.result", "from cylx.version import __version__"),
        ("cylx.io.ply", "import plyfile\nfrom cylx.records import PointCloud"),
        ("cylx.io.ply", 'def f():\n    """Say.\n' + "    more\n" * 90 + '    """\n' + "\n    # why\n    x = 1\n" * 59),
    ],
)
def test_what_is_allowed_passes(module, source):
    assert faults(module, source) == []
