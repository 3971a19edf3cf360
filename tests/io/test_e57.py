"""E57: several scans with their poses in one cloud."""

import sys

import numpy as np
import pye57
import pytest

from cylx.errors import InputError
from cylx.io import read_cloud

N = 300
RNG = np.random.default_rng(0)
SEEN = RNG.uniform(-5, 5, (2, N, 3)).astype("f4").astype(float)
TURN = np.array([np.cos(0.4), 0.0, 0.0, np.sin(0.4)])  # about z by 0.8
PLACES = np.array([[500_000.0, 5_000_000.0, 100.0], [500_010.0, 5_000_000.0, 100.0]])


def as_seen(points, **others):
    return {f"cartesian{axis}": points[:, place] for place, axis in enumerate("XYZ")} | others


def written(path):
    colors = {f"color{name}": np.full(N, value, "u1") for name, value in (("Red", 200), ("Green", 100), ("Blue", 0))}
    invalid = (np.arange(N) % 10 == 0).astype("i1")
    with pye57.E57(str(path), mode="w") as file:
        file.write_scan_raw(
            as_seen(SEEN[0], intensity=RNG.random(N).astype("f4"), **colors), rotation=TURN, translation=PLACES[0]
        )
        file.write_scan_raw(
            as_seen(SEEN[1], cartesianInvalidState=invalid), rotation=np.array([1.0, 0, 0, 0]), translation=PLACES[1]
        )
    return path


@pytest.fixture(scope="module")
def scans(tmp_path_factory):
    return written(tmp_path_factory.mktemp("e57") / "zwei Räume.e57")


def test_all_scans_are_joined_with_their_poses(scans):
    cloud = read_cloud(scans)
    turned = np.array([[np.cos(0.8), -np.sin(0.8), 0], [np.sin(0.8), np.cos(0.8), 0], [0, 0, 1]])
    truth = np.concatenate([SEEN[0] @ turned.T + PLACES[0], SEEN[1] + PLACES[1]])
    valid = np.concatenate([np.ones(N, bool), np.arange(N) % 10 != 0])
    assert np.array_equal(cloud.valid, valid)
    assert np.abs(cloud.points - truth[valid]).max() < 1e-6
    assert np.isnan(cloud.table["x"][~valid]).all()
    assert (cloud.table["scan"].dtype, cloud.source.format) == (np.uint16, "e57")
    assert np.array_equal(cloud.table["scan"], np.repeat([0, 1], N))


def test_colours_and_intensity_are_properties(scans):
    table = read_cloud(scans).table
    assert table.dtype.names == ("x", "y", "z", "scan", "intensity", "red", "green", "blue")
    assert (table["red"][:N] == 200).all()
    assert not table["red"][N:].any()
    assert np.isfinite(table["intensity"][:N]).all()
    assert np.isnan(table["intensity"][N:]).all()


def test_one_scan_can_be_chosen(scans):
    whole, one = read_cloud(scans), read_cloud(scans, scan=1)
    assert np.array_equal(one.points, whole.points[N:])
    assert one.rows == N
    assert one.source.selection.scan == 1
    with pytest.raises(InputError, match="has 2 scans, from 0 to 1, and none of number 2; choose another"):
        read_cloud(scans, scan=2)


def test_a_scan_of_another_format_cannot_be_chosen(scan):
    with pytest.raises(InputError, match="is neither E57 nor PTX, so no scan can be chosen; leave --scan out"):
        read_cloud(scan, scan=0)


def test_spherical_coordinates_are_turned_into_cartesian_ones():
    from cylx.io.e57 import _coordinates

    read = {
        "sphericalRange": np.array([2.0, 1.0]),
        "sphericalAzimuth": np.array([np.pi / 2, 0.0]),
        "sphericalElevation": np.array([np.pi / 6, 0.0]),
        "sphericalInvalidState": np.array([0, 1]),
    }
    assert np.allclose(_coordinates(read), [[0, np.sqrt(3), 1], [np.nan] * 3], equal_nan=True)


def test_standard_input_will_do(scans, run_cylx):
    shown = run_cylx("info", "-", input=scans.read_bytes())
    assert (shown.exit_code, shown.stdout.splitlines()[2]) == (0, "points   600, 570 of them finite")


def test_damaged_files_are_one_line(scans, tmp_path):
    data, path = scans.read_bytes(), tmp_path / "cut.e57"
    rng = np.random.default_rng(0)
    for size in np.linspace(1, len(data) - 1, 25).astype(int):
        path.write_bytes(data[:size])
        with pytest.raises(InputError) as refused:
            read_cloud(path)
        assert "\n" not in str(refused.value)
    for place in rng.integers(0, len(data), 40):
        broken = bytearray(data)
        broken[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(broken)
        with pytest.raises(InputError) as refused:
            read_cloud(path)
        assert "\n" not in str(refused.value)
    assert path.exists()


def test_garbage_and_no_scans(tmp_path):
    path = tmp_path / "scan.e57"
    path.write_bytes(b"garbage")
    with pytest.raises(InputError, match="is not E57: it does not begin with ASTM-E57; give it its right suffix"):
        read_cloud(path)
    with pye57.E57(str(tmp_path / "none.e57"), mode="w"):
        pass
    with pytest.raises(InputError, match="holds no points; give a file with points"):
        read_cloud(tmp_path / "none.e57")


def test_a_missing_library_is_named_with_the_command_that_installs_it(scans, monkeypatch, run_cylx):
    monkeypatch.setitem(sys.modules, "pye57", None)
    shown = run_cylx("extract", scans)
    fault = "needs pye57, which is not installed; pip install 'cylx[e57]'"
    assert (shown.exit_code, shown.stderr) == (3, f"cylx: {scans}: {fault}\n")
