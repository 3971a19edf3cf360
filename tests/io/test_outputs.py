"""Outputs: whole or not at all, refused in time, and in nobody's way."""

import errno
import io
import os
import stat
import subprocess
import sys
import threading

import numpy as np
import pytest

from cylx.errors import OutputError
from cylx.io import check_writable, write_bytes, write_cloud, write_text
from cylx.io.outputs import open_output, write_together

POSIX = pytest.mark.skipif(os.name == "nt", reason="the system has no such things")
POINTS = np.array([[1, 2, 3], [4, 5, 6.5]])


@pytest.fixture(autouse=True)
def at_home(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write_half(path, failure):
    with open_output(path, overwrite=True) as file:
        file.write(b"half")
        raise failure


def names(folder):
    return sorted(entry.name for entry in folder.iterdir())


def test_text_is_utf8_with_the_line_ends_it_has(at_home):
    write_text("a.txt", "ä\r\nb\n")
    assert (at_home / "a.txt").read_bytes() == b"\xc3\xa4\r\nb\n"
    assert names(at_home) == ["a.txt"]


def test_an_existing_file_is_replaced_only_if_told(at_home):
    (at_home / "a.txt").write_text("old")
    with pytest.raises(OutputError) as refused:
        write_text("a.txt", "new")
    assert str(refused.value) == "a.txt: exists already; choose another name, or give --overwrite"
    assert refused.value.exit_code == 4
    assert (at_home / "a.txt").read_text() == "old"
    write_text("a.txt", "new", overwrite=True)
    assert (at_home / "a.txt").read_text() == "new"


REFUSED = {
    "there.txt": "there.txt: exists already; choose another name, or give --overwrite",
    "folder": "folder: is a folder; give a file name",
    "there.txt/a.txt": "there.txt/a.txt: '{home}/there.txt' is not a folder; choose another folder",
    "nowhere/a.txt": "nowhere/a.txt: the folder '{home}/nowhere' does not exist; create it first",
    "x" * 300: f"{'x' * 300}: cannot be written: file name too long; choose another path",
    "a\0b": "'a\\x00b': cannot be written: embedded null byte; choose another path",
}


@POSIX
@pytest.mark.parametrize(("path", "message"), REFUSED.items(), ids=range(len(REFUSED)))
def test_what_could_not_be_written_is_refused_before(at_home, path, message):
    (at_home / "there.txt").write_text("old")
    (at_home / "folder").mkdir()
    for refuse in (lambda: check_writable(path, overwrite=False), lambda: write_bytes(path, b"")):
        with pytest.raises(OutputError) as refused:
            refuse()
        assert str(refused.value) == message.format(home=os.path.realpath(at_home))


@pytest.mark.parametrize(
    ("read_only", "message"),
    [
        ("there.txt", "there.txt: is read-only; choose another name, or change its permissions"),
        (".", "the folder '{home}' is read-only; choose another folder"),
    ],
)
def test_what_is_read_only_is_left_alone(at_home, monkeypatch, read_only, message):
    (at_home / "there.txt").write_text("old")
    target = os.path.realpath(read_only)
    monkeypatch.setattr("os.access", lambda path, _mode: os.path.realpath(path) != target)
    with pytest.raises(OutputError) as refused:
        check_writable("there.txt", overwrite=True)
    assert str(refused.value).endswith(message.format(home=os.path.realpath(at_home)))


def test_what_can_be_written_is_not_refused(at_home):
    (at_home / "there.txt").write_text("old")
    check_writable("there.txt", overwrite=True)
    check_writable("new.txt", overwrite=False)
    check_writable("-", overwrite=False)
    assert names(at_home) == ["there.txt"]


@pytest.mark.parametrize("failure", [KeyboardInterrupt, ZeroDivisionError, BrokenPipeError])
def test_nothing_is_left_of_a_write_that_fails(at_home, failure):
    (at_home / "there.txt").write_text("old")
    for path in ("there.txt", "new.txt"):
        with pytest.raises(failure):
            write_half(path, failure)
    assert names(at_home) == ["there.txt"]
    assert (at_home / "there.txt").read_text() == "old"


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO])
def test_a_disk_that_is_full_or_fails(at_home, number):
    with pytest.raises(OutputError) as refused:
        write_half("new.txt", OSError(number, os.strerror(number)))
    reason = os.strerror(number)
    remedy = "free some space, or choose another folder" if number == errno.ENOSPC else "choose another path"
    assert str(refused.value) == f"new.txt: cannot be written: {reason[0].lower()}{reason[1:]}; {remedy}"
    assert names(at_home) == []


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no full device here")  # noqa: PTH110  a path as text, as users give it
def test_a_device_that_is_full():
    with pytest.raises(OutputError, match="/dev/full: cannot be written: no space left on device; free some space"):
        write_bytes("/dev/full", bytes(100))


def test_writers_of_clouds_leave_nothing_when_they_fail(at_home, monkeypatch):
    def fail(*_args):
        raise OSError(errno.ENOSPC, "No space left on device")

    for room, suffix in (("write_ply", ".ply"), ("write_pcd", ".pcd"), ("write_xyz", ".xyz")):
        monkeypatch.setattr(f"cylx.io.clouds.{room}", fail)
        with pytest.raises(OutputError, match="no space left on device"):
            write_cloud(f"a{suffix}", POINTS)
    assert names(at_home) == []


def test_clouds_of_an_unknown_suffix(at_home):
    with pytest.raises(OutputError) as refused:
        write_cloud("a.las", POINTS)
    assert str(refused.value) == ("a.las: unknown suffix '.las'; use one of .ply, .pcd, .xyz, .txt, .csv, .pts, .asc")
    assert names(at_home) == []


def test_properties_that_do_not_fit_are_a_bug_of_the_caller():
    with pytest.raises(ValueError, match=r"label must have shape \(2,\), not \(3,\)"):
        write_cloud("a.ply", POINTS, properties={"label": np.zeros(3)})
    with pytest.raises(ValueError, match="a property must be made of numbers"):
        write_cloud("a.ply", POINTS, properties={"label": np.array(["a", "b"])})


@POSIX
def test_permissions_are_those_of_any_new_file(at_home):
    (at_home / "plain.txt").write_text("")
    write_bytes("ours.txt", b"")
    assert stat.S_IMODE(os.stat("ours.txt").st_mode) == stat.S_IMODE(os.stat("plain.txt").st_mode)  # noqa: PTH116  a path as text, as users give it


@POSIX
@pytest.mark.parametrize("there", [True, False], ids=["to a file", "to nothing"])
def test_a_symbolic_link_is_replaced_and_not_followed(at_home, there):
    (at_home / "elsewhere").mkdir()
    real = at_home / "elsewhere" / "real.txt"
    if there:
        real.write_bytes(b"theirs")
    (at_home / "link.txt").symlink_to(real)
    with pytest.raises(OutputError, match="exists already"):
        write_bytes("link.txt", b"1")
    write_bytes("link.txt", b"2", overwrite=True)
    write_together({"link.txt": b"3"}, overwrite=True)
    assert not (at_home / "link.txt").is_symlink()
    assert (at_home / "link.txt").read_bytes() == b"3"
    assert names(at_home / "elsewhere") == (["real.txt"] if there else [])
    assert not there or real.read_bytes() == b"theirs"
    assert names(at_home) == ["elsewhere", "link.txt"]


@POSIX
def test_a_link_to_a_device_is_replaced_and_a_link_in_the_folder_is_a_folder(at_home):
    (at_home / "device.txt").symlink_to("/dev/full")
    write_together({"device.txt": b"1"}, overwrite=True)
    assert (at_home / "device.txt").read_bytes() == b"1"
    (at_home / "real").mkdir()
    (at_home / "folder").symlink_to("real")
    write_bytes("folder/out.txt", b"2")
    assert (at_home / "real" / "out.txt").read_bytes() == b"2"
    with pytest.raises(OutputError, match="is a folder"):
        write_bytes("folder", b"3", overwrite=True)


@POSIX
def test_devices_and_pipes_are_written_to_as_they_are(at_home):
    write_bytes("/dev/null", b"1")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)  # noqa: PTH116  a path as text, as users give it
    os.mkfifo("pipe")
    received = []
    reader = threading.Thread(target=lambda: received.append((at_home / "pipe").read_bytes()))
    reader.start()
    write_bytes("pipe", b"through")
    reader.join()
    assert received == [b"through"]
    assert stat.S_ISFIFO(os.stat("pipe").st_mode)  # noqa: PTH116  a path as text, as users give it


@pytest.mark.parametrize("path", ["-", pytest.param("/dev/stdout", marks=POSIX)])
def test_standard_output_comes_after_what_was_printed(path):
    code = f"import cylx.io; print('first'); cylx.io.write_bytes({path!r}, b'second')"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    assert ran.stdout.split() == [b"first", b"second"]


def test_a_closed_pipe_is_left_to_the_caller(monkeypatch):
    class Closed(io.BytesIO):
        def write(self, _data):
            raise BrokenPipeError

    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(Closed()))
    with pytest.raises(BrokenPipeError):
        write_bytes("-", b"1")


def test_a_closed_standard_output(monkeypatch):
    monkeypatch.setattr("sys.stdout", None)
    with pytest.raises(OutputError, match="standard output: is closed; give a file name"):
        check_writable("-", overwrite=False)


def test_a_cloud_on_standard_output_is_a_ply(monkeypatch):
    stream = io.TextIOWrapper(io.BytesIO())
    monkeypatch.setattr("sys.stdout", stream)
    write_cloud("-", POINTS)
    assert stream.buffer.getvalue().startswith(b"ply\nformat binary_little_endian 1.0\nelement vertex 2\n")


def test_small_outputs_need_no_large_libraries():
    code = "import sys; from cylx.io import check_writable, read_json, write_text; print('numpy' in sys.modules)"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    assert ran.stdout.strip() == b"False"
