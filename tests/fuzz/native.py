"""Targets whose readers are native code: E57, LAS, STEP and more, read by processes that stay and die under limits."""

import atexit
import os
import re
import tempfile
from contextlib import contextmanager
from pathlib import Path

from cylx.io import isolated
from cylx.optional.extras import is_found
from tests.fuzz.targets import SCRATCH, SEEDS
from tests.support.e57 import paged, unpaged, with_xml, xml_of
from tests.support.kept_readers import KeptReaders

READERS = KeptReaders()
_POINTS = 60
_SECONDS = 4
"""Processor time of an input of some kilobytes: less than a file may take, so that one that hangs costs little."""
atexit.register(READERS.close)


@contextmanager
def kept_readers():
    """Let the processes that stay read, with less time."""
    before = isolated.read_isolated, isolated.ask_isolated, isolated._SECONDS
    isolated.read_isolated, isolated.ask_isolated = READERS.read_isolated, READERS.ask_isolated
    isolated._SECONDS = _SECONDS
    try:
        yield
    finally:
        isolated.read_isolated, isolated.ask_isolated, isolated._SECONDS = before


def read_as(kind):
    """Return a function that reads a cloud of a format from bytes."""

    def read(data):
        from cylx.io import read_cloud

        with kept_readers(), os.fdopen(os.memfd_create("scan"), "w+b") as file:
            file.write(data or b"\0")
            file.flush()
            cloud = read_cloud(f"/proc/self/fd/{file.fileno()}", format=kind)
            if not 0 < len(cloud.points) <= cloud.rows:
                raise AssertionError("a cloud without points")
        return cloud

    return read


def read_a_model(suffix):
    """Return a function that reads a design in STEP or IFC from bytes."""

    def read(data):
        from cylx.deviation import shapes_of
        from cylx.io.design import read_design

        with kept_readers():
            shapes_of(read_design(SCRATCH.put(f"design{suffix}", data)))

    return read


def read_inside_e57(data):
    """Read an E57 file from its bytes without checksums: they are right, so the damage gets through to the library."""
    return read_as("e57")(paged(data))


def read_e57_xml(data):
    """Read an E57 file from its XML; the points are those of a seed."""
    return read_as("e57")(with_xml(_e57()[0], data))


def _e57():
    """Make E57 files: one scan, and two with poses, colours, and whole and invalid points."""
    import numpy as np
    import pye57

    points = np.random.default_rng(0).uniform(0, 2, (_POINTS, 3)).astype("f4").astype(float)
    fields = {f"cartesian{axis}": points[:, place] for place, axis in enumerate("XYZ")}
    more = {f"color{name}": np.arange(_POINTS).astype("u1") for name in ("Red", "Green", "Blue")}
    more |= {"cartesianInvalidState": (np.arange(_POINTS) % 7 == 0).astype("i1"), "intensity": np.ones(_POINTS, "f4")}
    turned = {"rotation": np.array([0.8, 0.0, 0.0, 0.6]), "translation": np.array([1.0, 2.0, 3.0])}
    seeds = []
    with tempfile.TemporaryDirectory() as folder:
        for name, scans in (("one", [(fields, {})]), ("two", [(fields | more, turned), (fields, turned)])):
            path = Path(folder) / name
            with pye57.E57(str(path), mode="w") as file:
                for values, pose in scans:
                    file.write_scan_raw(values, **pose)
            seeds.append(path.read_bytes())
    xml = re.sub(rb'type="Float" precision="single" minimum="[^"]*" maximum="[^"]*"', _SCALED, xml_of(seeds[0]))
    return [*seeds, with_xml(seeds[0], xml)]


_SCALED = b'type="ScaledInteger" minimum="0" maximum="4294967295" scale="1e-9" offset="-1"'


def _las():
    """Make LAS and LAZ files of old and new point formats, with extra bytes and records."""
    import io

    import laspy
    import numpy as np

    seeds = []
    for kind, version, compressed in ((0, "1.2", True), (3, "1.2", False), (3, "1.2", True), (7, "1.4", True)):
        header = laspy.LasHeader(point_format=kind, version=version)
        header.scales = [0.001] * 3
        if kind != 0:
            header.add_extra_dims([laspy.ExtraBytesParams("amplitude", "f4"), laspy.ExtraBytesParams("normal", "3u1")])
        header.vlrs.append(laspy.VLR("LASF_Projection", 2112, "a place", b"somewhere\0"))
        cloud = laspy.LasData(header)
        cloud.x, cloud.y, cloud.z = np.random.default_rng(0).uniform(0, 2, (3, _POINTS))
        file = io.BytesIO()
        cloud.write(file, do_compress=compressed)
        seeds.append(file.getvalue())
    return seeds


def _packed():
    """Make PCD files with compressed bodies: of literals alone, and with repetitions."""
    import struct

    import numpy as np

    seeds = []
    for points in (np.random.default_rng(0).uniform(0, 2, (3, _POINTS)), np.ones((3, _POINTS))):
        raw = points.astype("f4").tobytes()
        body = b"".join(bytes([len(part) - 1]) + part for part in _pieces(raw))
        if points.std() == 0:  # four bytes, and back by four for the rest: LZF has at most 264 at a time
            body = bytes([3]) + raw[:4] + (len(raw) - 4) // 264 * bytes([0xE0, 255, 3])
            rest = (len(raw) - 4) % 264
            body += bytes([0xE0, rest - 9, 3])
        header = (
            f"VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {_POINTS}\nHEIGHT 1\n"
            f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {_POINTS}\nDATA binary_compressed\n"
        )
        seeds.append(header.encode() + struct.pack("<II", len(body), len(raw)) + body)
    return seeds


def _models(suffix):
    """Return designs as cylx and others write them."""
    return [path.read_bytes() for path in sorted((SEEDS / f"design-{suffix}").iterdir())]


def _pieces(raw):
    return (raw[place : place + 32] for place in range(0, len(raw), 32))


_LIBRARIES = {"step": "OCP", "ifc": "ifcopenshell"}
NATIVE_TARGETS = {
    "las-native": (_las(), read_as("las")),
    "e57": (_e57(), read_as("e57")),
    "e57-inside": ([unpaged(seed) for seed in _e57()], read_inside_e57),
    "pcd-packed": (_packed(), read_as("pcd")),
    "e57-xml": ([xml_of(seed) for seed in _e57()], read_e57_xml),
    **{
        f"design-{kind}": (_models(kind), read_a_model(f".{kind}"))
        for kind, library in _LIBRARIES.items()
        if is_found(library)
    },
}
