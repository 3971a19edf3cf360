"""Files packed by gzip: the same clouds, the digest of the file as it lies, and no bombs."""

import gzip
import hashlib

import numpy as np
import pytest

from cylx.errors import InputError
from cylx.io import packed, read_cloud, write_cloud

POINTS = np.round(np.random.default_rng(0).normal(size=(200, 3)), 4)


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".xyz", ".txt", ".csv", ".pts", ".asc", ".PLY"])
def test_every_format_can_be_packed(tmp_path, suffix):
    write_cloud(tmp_path / f"scan{suffix}", POINTS, properties={"intensity": np.arange(200, dtype="u2")})
    path = tmp_path / f"scan{suffix}.gz"
    path.write_bytes(gzip.compress((tmp_path / f"scan{suffix}").read_bytes()))
    cloud, plain = read_cloud(path), read_cloud(tmp_path / f"scan{suffix}")
    assert np.array_equal(cloud.points, plain.points)
    assert np.array_equal(cloud.table["intensity"], np.arange(200))
    assert cloud.source.format == plain.source.format
    assert cloud.source.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


def test_it_is_recognised_by_its_content(tmp_path, run_cylx):
    data = gzip.compress(b"0 0 0\n") + gzip.compress(b"1 2 3\n")  # several members are one file
    (tmp_path / "scan").write_bytes(data)
    assert read_cloud(tmp_path / "scan").points.tolist() == [[0, 0, 0], [1, 2, 3]]
    assert run_cylx("info", "-", input=data).stdout.splitlines()[1:3] == [
        "format   xyz",
        "points   2, 2 of them finite",
    ]


def test_a_bomb_is_refused_in_one_line(tmp_path, run_cylx):
    path = tmp_path / "bomb.xyz.gz"
    path.write_bytes(gzip.compress(b"0 0 0\n" * (packed.ALWAYS_ALLOWED // 5)))
    shown = run_cylx("info", path)
    fault = "is more than 100 times as large when unpacked; unpack it yourself if you trust it"
    assert (shown.exit_code, shown.stderr) == (3, f"cylx: {path}: {fault}\n")


def test_what_is_small_may_expand_as_it_likes(tmp_path):
    path = tmp_path / "scan.xyz.gz"
    path.write_bytes(gzip.compress(b"0 0 0\n" * 200_000))
    assert len(read_cloud(path).points) == 200_000


WHOLE = gzip.compress(b"0 0 0\n1 2 3\n" * 50)
BAD = {
    "cut": (WHOLE[:-9], "the file ends within the packed data; get a complete copy of the file"),
    "header": (WHOLE[:5], "the file ends within the packed data; get a complete copy of the file"),
    "checksum": (
        WHOLE[:-8] + bytes(4) + WHOLE[-4:],
        "the packed data are damaged: CRC check failed",
    ),
    "inside": (WHOLE[:10] + b"\xff" * 9 + WHOLE[19:], "the packed data are damaged: "),
    "other": (b"0 0 0\n", "is not packed by gzip; give it its right suffix"),
    "nothing": (gzip.compress(b""), "is empty; check how it was made"),
}


@pytest.mark.parametrize(("data", "message"), BAD.values(), ids=BAD)
def test_bad_files(tmp_path, monkeypatch, data, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scan.xyz.gz").write_bytes(data)
    with pytest.raises(InputError) as refused:
        read_cloud("scan.xyz.gz")
    assert str(refused.value).startswith(f"scan.xyz.gz: {message}")
    assert "\n" not in str(refused.value)
