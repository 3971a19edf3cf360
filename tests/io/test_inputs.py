"""Inputs: standard input, pipes, formats told and recognised, digests, and JSON."""

import hashlib
import io
import os
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from cylx.errors import InputError
from cylx.io import read_cloud, read_json, write_cloud

POINTS = np.array([[1, 2, 3], [4, 5, 6.5]])


def stdin_of(monkeypatch, data):
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(data)))


@pytest.fixture(params=["ply", "pcd", "xyz"])
def sample(request, tmp_path):
    path = tmp_path / f"scan.{request.param}"
    write_cloud(path, POINTS, properties={"label": np.array([7, 8], "i4")})
    return path


def test_source_says_where_the_cloud_came_from(sample):
    source = read_cloud(sample).source
    assert (source.file, source.format) == (str(sample), sample.suffix[1:])
    assert source.sha256 == hashlib.sha256(sample.read_bytes()).hexdigest()


@pytest.mark.parametrize("told", [True, False])
def test_standard_input_is_read_like_a_file(sample, monkeypatch, told):
    stdin_of(monkeypatch, sample.read_bytes())
    cloud = read_cloud("-", format=sample.suffix[1:] if told else None)
    from_file = read_cloud(sample)
    assert np.array_equal(cloud.points, POINTS)
    assert cloud.table.tolist() == from_file.table.tolist()
    assert (cloud.source.file, cloud.source.format) == ("-", sample.suffix[1:])
    assert cloud.source.sha256 == from_file.source.sha256


def test_no_format_needs_open3d_as_we_write_it(sample, monkeypatch):
    monkeypatch.setitem(sys.modules, "open3d", None)
    assert np.array_equal(read_cloud(sample).points, POINTS)


@pytest.mark.parametrize("suffix", ["", ".dat", ".txt", ".XYZ"])
def test_files_are_recognised_by_their_content(sample, suffix):
    other = sample.with_name(f"other{suffix}")
    sample.rename(other)
    assert read_cloud(other).source.format == sample.suffix[1:]


def test_a_format_that_is_told_beats_the_suffix(sample):
    other = sample.with_name("other.ply" if sample.suffix == ".xyz" else "other.xyz")
    sample.rename(other)
    assert np.array_equal(read_cloud(other, format=sample.suffix[1:]).points, POINTS)


def test_suffixes_may_be_in_capitals(tmp_path):
    write_cloud(tmp_path / "SCAN.PLY", POINTS)
    assert read_cloud(tmp_path / "SCAN.PLY").source.format == "ply"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes here")
def test_a_named_pipe_is_read_like_a_file(sample):
    pipe = sample.with_name(f"pipe{sample.suffix}")
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_bytes, args=(sample.read_bytes(),))
    writer.start()
    cloud = read_cloud(pipe)
    writer.join()
    assert np.array_equal(cloud.points, POINTS)


def test_an_empty_standard_input(monkeypatch):
    stdin_of(monkeypatch, b"")
    with pytest.raises(InputError, match=r"^standard input: is empty; check how it was made$"):
        read_cloud("-")


def test_a_closed_standard_input(monkeypatch):
    monkeypatch.setattr("sys.stdin", None)
    with pytest.raises(InputError, match=r"^standard input: is closed; "):
        read_cloud("-")


@pytest.mark.skipif(os.name == "nt", reason="names are Unicode there")
def test_a_name_that_is_no_utf8_is_told_as_utf8(tmp_path):
    path = os.fsdecode(os.fsencode(tmp_path) + b"/\xff.xyz")
    with open(path, "w") as file:  # noqa: PTH123  a path as text, as users give it
        file.write("1 2 3\n")
    assert read_cloud(path).source.file == f"{tmp_path}/?.xyz"


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="there are no such devices here")
def test_a_device_that_never_ends_is_refused(tmp_path):
    (tmp_path / "scan.ply").symlink_to("/dev/zero")
    for path in ("/dev/zero", tmp_path / "scan.ply"):
        with pytest.raises(InputError, match=rf"^{path}: is a device; give a file or a pipe$"):
            read_cloud(path)


@pytest.mark.skipif(os.name == "nt", reason="links need a privilege there")
def test_a_link_that_leads_nowhere_says_so(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("scan.ply").symlink_to("disk/\x1b[31mscan.ply")
    with pytest.raises(InputError) as refused:
        read_cloud("scan.ply")
    assert str(refused.value) == (
        "scan.ply: is a link to 'disk/\\x1b[31mscan.ply', which is not there; check where it leads"
    )


def test_json_objects(tmp_path, monkeypatch):
    path = tmp_path / "result.json"
    for data in ('{"a": [1, 2.5, null], "ü": "é"}', '\ufeff{"a": [1, 2.5, null], "ü": "é"}'):
        path.write_text(data, encoding="utf-8")
        assert read_json(path) == {"a": [1, 2.5, None], "ü": "é"}
    stdin_of(monkeypatch, b"{}")
    assert read_json("-") == {}


BAD_JSON = {
    b"": "result.json: is empty; check how it was made",
    b'{"a": 1,\n "b" 2}': "result.json:2:6: not JSON: expecting ':' delimiter; give a JSON file as cylx writes it",
    b"[1, 2]": "result.json: is not a JSON object; give a JSON file as cylx writes it",
    b'{"a": NaN}': "result.json: not JSON: NaN is not a number in JSON; give a JSON file as cylx writes it",
    b'{"a": "\xff"}': "result.json: not JSON: not UTF-8 text; give a JSON file as cylx writes it",
    b"[" * 100_000: "result.json: not JSON: nested too deeply; give a JSON file as cylx writes it",
}


@pytest.mark.parametrize(("data", "message"), BAD_JSON.items(), ids=range(len(BAD_JSON)))
def test_bad_json(tmp_path, monkeypatch, data, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "result.json").write_bytes(data)
    with pytest.raises(InputError) as refused:
        read_json("result.json")
    assert str(refused.value) == message


def test_missing_json(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=r"^result\.json: no such file; check the path$"):
        read_json("result.json")
