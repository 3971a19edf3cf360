"""What is fuzzed: each target has seeds and a function of bytes, which returns, or raises a documented error."""

import json
import os
import struct
import tempfile
from pathlib import Path

import click

SEEDS = Path(__file__).parent / "seeds"
_MEMORY = Path("/dev/shm")
_SUFFIXES = {
    "xyz": ".xyz", "csv": ".csv", "pts": ".pts", "ply": ".ply", "pcd": ".pcd", "npy": ".npy", "npz": ".npz",
    "ptx": ".ptx", "guessed": "",
}  # fmt: skip


class Scratch:
    """A folder in memory, whose files are new ones each time."""

    def __init__(self):
        place = str(_MEMORY) if os.access(_MEMORY, os.W_OK) else None
        self.folder = tempfile.TemporaryDirectory(prefix="cylx-fuzz-", dir=place)

    def put(self, name, data):
        path = Path(self.folder.name) / name
        path.unlink(missing_ok=True)  # an input that is still mapped keeps its bytes
        path.write_bytes(data)
        return path


SCRATCH = Scratch()


def read_scan(suffix):
    """Return a function that reads a cloud from bytes."""

    def read(data):
        from cylx.io import read_cloud

        cloud = read_cloud(SCRATCH.put(f"scan{suffix}", data))
        check_cloud(cloud)
        return cloud

    return read


def read_las_here(data):
    """Read a LAS file in this process."""
    import numpy as np

    from cylx.io.inputs import open_input
    from cylx.io.las import read_las
    from cylx.io.las_header import kept_header, las_header
    from cylx.records import PointCloud, Source

    with open_input(SCRATCH.put("scan.las", data)) as source:
        table = read_las(source)
        header = kept_header(source, las_header(source))
    with np.errstate(all="ignore"):
        points = np.column_stack([table[axis] for axis in "xyz"])
    cloud = PointCloud(points, table, None, Source("scan.las", "las", header=header))
    check_cloud(cloud)
    return cloud


def guard_e57(data):
    """Check the XML of an E57 file; what passes is harmless to a parser that opens and expands everything."""
    from xml.parsers import expat

    from cylx.io.e57_xml import check_xml
    from cylx.io.inputs import open_input

    payload = bytes(48) + data
    pages = b"".join(
        payload[place : place + 1020].ljust(1020, b"\0") + bytes(4) for place in range(0, len(payload), 1020)
    )
    head = struct.pack("<8s2I4Q", b"ASTM-E57", 1, 0, len(pages), 48, len(data), 1024)
    with open_input(SCRATCH.put("scan.e57", head[:48] + pages[48:])) as source:
        check_xml(source)

    def harm(*_):
        raise AssertionError("a DOCTYPE or an entity gets through")

    def start(_name, attributes):
        if any(name.lower().endswith("schemalocation") for name in attributes):
            raise AssertionError("the place of a schema gets through")

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = parser.ExternalEntityRefHandler = harm
    parser.StartElementHandler = start
    parser.Parse(data.removeprefix(b"\xef\xbb\xbf").lstrip(b" \t\r\n"), True)


def check_cloud(cloud):
    """Refuse a cloud that no reader may return."""
    import numpy as np

    if not (0 < len(cloud.points) <= cloud.rows and np.isfinite(cloud.points).all()):
        raise AssertionError("a cloud without points, or with points that are not finite")
    names = cloud.table.dtype.names if cloud.table is not None else ()
    if len({*names}) != len(names):
        raise AssertionError("two properties of one name")


def annotate(read, suffix):
    """Return a function that reads a scan and writes its annotated cloud: what cannot be written is known before."""

    def write(data):
        from cylx.errors import OutputError
        from cylx.io import check_annotated, write_annotated

        cloud = read(data)
        if cloud.rows > 1000 or (cloud.table is not None and cloud.table.dtype.itemsize > 2000):
            return
        path = Path(SCRATCH.folder.name) / f"annotated{suffix}"
        check_annotated(path, cloud)
        try:
            write_annotated(path, _extraction(cloud), overwrite=True)
        except OutputError as error:
            raise AssertionError(f"refused late: {error}") from error

    return write


def _extraction(cloud):
    import numpy as np

    from cylx.config import Config
    from cylx.records import Extraction, Scene

    count = len(cloud.points)
    return Extraction(
        cylinders=(), labels=np.full(count, -1, np.int32), residuals=np.full(count, np.nan, np.float32), cloud=cloud,
        scene=Scene(1.0, 0.1, 1.0), stages=(), config=Config(), warnings=(),
    )  # fmt: skip


def read_config(data):
    from cylx.config import load_config

    load_config(path=SCRATCH.put("settings.yaml", data))


def read_override(data):
    from cylx.config import load_config

    load_config(overrides=data.decode("utf-8", "surrogateescape").split("\n"))


def read_catalogue(suffix):
    def read(data):
        from cylx.config.catalogue_file import read_catalogue

        read_catalogue(SCRATCH.put(f"pipes{suffix}", data))

    return read


def read_a_design(suffix):
    def read(data):
        from cylx.deviation import shapes_of
        from cylx.io.design import read_design

        shapes_of(read_design(SCRATCH.put(f"design{suffix}", data)))

    return read


def read_wkt(data):
    from cylx.io.crs import crs_facts

    crs_facts(data.decode("utf-8", "replace"))


def read_result(data):
    from cylx.io import read_json
    from cylx.results import Result

    result = Result.parse(read_json(SCRATCH.put("scan.cylinders.json", data)), "scan.cylinders.json")
    json.loads(result.to_json().encode())


def evaluate(data):
    from cylx import evaluation
    from cylx.io import read_json

    truth = read_json(SEEDS / "truth" / "two.json")
    evaluation.evaluate(read_json(SCRATCH.put("truth.json", data)), truth)
    evaluation.evaluate(truth, read_json(SCRATCH.put("truth.json", data)))
    piping = read_json(SEEDS / "truth" / "piping.json")
    outcome = evaluation.evaluate(piping, read_json(SCRATCH.put("truth.json", data)))
    json.dumps(outcome.to_dict(), allow_nan=False)
    evaluation.evaluate(read_json(SCRATCH.put("truth.json", data)), piping)


def compare(data):
    from cylx.evaluation.regression import compare as compare_results
    from cylx.io import read_json

    one = read_json(SEEDS / "result" / "two.json")
    compare_results(one, read_json(SCRATCH.put("scan.cylinders.json", data)))


def use_option(data):
    """Give the command line an option, whose name is the first line, with a value; the scan does not exist."""
    from click.testing import CliRunner

    from cylx.cli import main
    from cylx.errors import UsageError

    name, _, value = data.decode("utf-8", "replace").partition("\n")
    name = name if name in OPTIONS else OPTIONS[len(value) % len(OPTIONS)]
    scan = str(Path(SCRATCH.folder.name) / "none.ply")
    outcome = CliRunner().invoke(main, ["extract", scan, f"{name}={value}"])
    if isinstance(outcome.exception, SystemExit | click.exceptions.Exit) and outcome.exit_code in (2, 3):
        if len(outcome.output.strip().splitlines()) > 1 or len(outcome.output) > 1000:
            raise AssertionError(f"a message of {len(outcome.output)} letters: {outcome.output[:100]!r}")
        raise UsageError("option", "is refused", "correct it")
    raise AssertionError(f"exit code {outcome.exit_code}: {outcome.output[:300]!r} {outcome.exception!r}")


OPTIONS = (
    "--radius", "--known-radius", "--axis", "--axis-tolerance", "--axis-sd", "--min-coverage", "--set", "--crop",
    "--voxel", "--every", "--classes", "--scan", "--threads", "--preset", "--seed", "--require", "--max-cylinders",
)  # fmt: skip


SHARED = {"las-annotated": "las", "compare": "result", "csv": "text", "xyz": "text", "pts": "text"}


def seeds_of(name):
    """Return the seeds of a target, those of other names if they share them."""
    folder = SEEDS / {"las-annotated": "las", "compare": "result", "csv": "text", "xyz": "text", "pts": "text"}.get(
        name, name
    )
    if name in ("guessed", "ply-annotated"):
        files = (path for path in sorted(SEEDS.glob("*/*")) if path.parent.name in _SUFFIXES | {"text": ""})
    else:
        files = sorted(folder.iterdir())
    return [seed for seed in (path.read_bytes() for path in files) if not _is_packed(seed)]


def _is_packed(seed):
    """Return whether a seed is a PCD whose body is unpacked in another process, whose start takes longer than all else.

    It has a target of its own, among those of native code.
    """
    return b"DATA binary_compressed" in seed


FUNCTIONS = {
    **{name: read_scan(suffix) for name, suffix in _SUFFIXES.items()},
    "las": read_las_here,
    "e57-guard": guard_e57,
    "las-annotated": annotate(read_las_here, ".las"),
    "ply-annotated": annotate(read_scan(""), ".ply"),
    "config": read_config,
    "override": read_override,
    "catalogue": read_catalogue(".csv"),
    "catalogue-yaml": read_catalogue(".yaml"),
    "design-csv": read_a_design(".csv"),
    "design-json": read_a_design(".json"),
    "wkt": read_wkt,
    "result": read_result,
    "compare": compare,
    "truth": evaluate,
    "option": use_option,
}
TARGETS = {name: (seeds_of(name), function) for name, function in FUNCTIONS.items()}
"""Name of a target: its seeds, and its function."""
