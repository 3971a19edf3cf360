"""Files that crash a library, hang it or flood its memory: one line, from the process that is made for it."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from cylx.errors import InputError
from cylx.io import isolated, isolated_start
from cylx.io.inputs import Input, open_input
from cylx.io.isolated_start import readable
from tests.support.kept_readers import KeptReaders
from tests.support.patience import PATIENCE

LINUX = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the limits are those of Linux")


@pytest.fixture
def scan(tmp_path):
    path = tmp_path / "scan.las"
    path.write_bytes(b"LASF" + bytes(500))
    return path


@pytest.fixture
def misled(monkeypatch):
    """Let the process run other code in place of the reader of LAS."""

    def mislead(code):
        body = "\n".join(f"    {line}" for line in code.splitlines())
        start = (
            "import json, sys; sys.path[:], *about = json.loads(sys.stdin.buffer.readline())\n"
            f"import ctypes, os, signal, socket, time\nimport numpy as np\nimport cylx.io.las as reader\n"
            f"def read_las(source, *, allocate):\n{body}\n"
            "reader.read_las = read_las\nfrom cylx.io.isolated_child import serve; serve(*about)"
        )
        monkeypatch.setattr(isolated_start, "START", start)

    return mislead


def read(path):
    with open_input(path) as source, readable(source) as file, isolated.Reader("las", file) as reader:
        return reader.read(source)


@LINUX
@pytest.mark.parametrize(
    ("code", "fault"),
    [
        ("ctypes.string_at(0)", "broken LAS: the library that reads it crashed (SIGSEGV)"),
        ("os.abort()", "broken LAS: the library that reads it crashed (SIGABRT)"),
        ("os._exit(7)", "broken LAS: the library that reads it crashed (exit code 7)"),
        ("os.kill(os.getpid(), 9)", "the process that reads the LAS was killed, perhaps for want of memory"),
        ("while True: pass", "takes too long to read for a file of its size"),
        ("time.sleep(100)", "takes too long to read for a file of its size"),
        ("return np.ones(1 << 30)", "asks for more memory than a file of its size can need"),
        ("return allocate(1 << 40, np.dtype([('x', 'f8')]))", "asks for more memory than a file of its size can need"),
    ],
)
def test_what_happens_to_the_library_is_one_line(scan, misled, monkeypatch, code, fault):
    if "too long" in fault:  # the others have time to be started on a machine that is busy
        monkeypatch.setattr(isolated, "_SECONDS", 1)
    monkeypatch.setattr(isolated, "_LEAST_TABLE", 1 << 20)
    misled(code)
    with pytest.raises(InputError) as refused:
        read(scan)
    assert (refused.value.place, refused.value.fault) == (str(scan), fault)
    assert not list(Path(scan.parent).glob("core*"))


@LINUX
def test_points_come_back_and_prints_do_not_disturb(scan, misled):
    misled(
        "os.write(1, b'noise'); print('noise')\nt = allocate(3, np.dtype([('x', 'f8'), ('é', 'u2')]))\n"
        "t['x'] = 7\nreturn t"
    )
    table = read(scan)
    assert table.dtype == np.dtype([("x", "f8"), ("é", "u2")])
    assert table["x"].tolist() == [7.0] * 3


def test_files_with_names_do_where_there_are_no_others(scan, misled, monkeypatch):
    for module in (isolated, isolated_start):
        monkeypatch.setattr(module, "LINUX", False)
    misled("t = allocate(5, np.dtype([('x', 'f8')]))\nt['x'] = len(source.head(9))\nreturn t")
    assert read(scan)["x"].tolist() == [9.0] * 5
    with scan.open("rb") as file:
        source = Input("scan", file, 504, "")  # as unpacked from gzip
        with readable(source) as copy, isolated.Reader("las", copy) as reader:
            assert len(reader.read(source)) == 5


@LINUX
def test_a_file_on_disk_does_where_there_is_none_in_memory(scan, misled, monkeypatch):
    misled("t = allocate(2, np.dtype([('x', 'f8')]))\nt['x'] = 3\nreturn t")
    with open_input(scan) as source:
        monkeypatch.delattr(os, "memfd_create")
        with isolated.Reader("las", source.file) as reader:
            assert reader.read(source)["x"].tolist() == [3.0] * 2


@LINUX
def test_the_process_has_no_network_where_the_system_permits_it(scan, misled):
    allowed = subprocess.run(["unshare", "-rn", "true"], capture_output=True, check=False).returncode == 0
    if not allowed and os.geteuid() != 0:
        pytest.skip("the system permits no name spaces")
    misled(
        "t = allocate(1, np.dtype([('space', 'i8')]))\n"
        "t['space'] = int(os.readlink('/proc/self/ns/net').strip('net:[]'))\nreturn t"
    )
    assert read(scan)["space"][0] != int(os.readlink("/proc/self/ns/net").strip("net:[]"))  # noqa: PTH115  no path


@LINUX
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_the_process_ends_with_the_one_that_waits_for_it(tmp_path, scan, how):
    code = f"""
import sys
from cylx.io import isolated, isolated_start
sleep = "lambda *_, **__: (open({str(tmp_path / "pid")!r}, 'w').write(str(os.getpid())), time.sleep(6000))"
code = "import os, time, cylx.io.las as reader\\nreader.read_las = " + sleep + "\\nfrom cylx"
isolated_start.START = isolated_start.START.replace("from cylx", code)
from cylx.io.inputs import Input, open_input
with open_input({str(scan)!r}) as source:
    isolated.read_isolated(source, "las")
"""
    parent = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL)
    child = wait_for(lambda: int((tmp_path / "pid").read_text() or "0") if (tmp_path / "pid").exists() else 0)
    parent.send_signal(how)
    parent.wait(PATIENCE)
    assert wait_for(lambda: not Path(f"/proc/{child}").exists() or state_of(child) == "Z")


def wait_for(question, seconds=PATIENCE):
    end = time.monotonic() + seconds
    while not (answer := question()) and time.monotonic() < end:
        time.sleep(0.02)
    return answer


def state_of(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return "Z"


@LINUX
def test_a_program_without_standard_streams_reads_too(tmp_path, scan, misled):
    import laspy

    header = laspy.LasHeader(point_format=3, version="1.2")
    cloud = laspy.LasData(header)
    cloud.x = cloud.y = cloud.z = np.arange(9.0)
    cloud.write(str(tmp_path / "a.laz"))
    code = f"""
import os
for fd in (0, 1, 2): os.close(fd)
from cylx.io import read_cloud
ok = len(read_cloud({str(tmp_path / "a.laz")!r}).points) == 9
os._exit(5 if ok else 6)
"""
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=PATIENCE).returncode == 5


@LINUX
def test_kept_readers_start_again_after_a_death(misled):
    misled("if source.head(5)[4:] == b'!': ctypes.string_at(0)\nreturn allocate(1, np.dtype([('x', 'f8')]))")
    readers = KeptReaders()
    try:
        for data in (b"LASF", b"LASF!", b"LASF"):
            if data.endswith(b"!"):
                with pytest.raises(InputError, match="SIGSEGV"):
                    readers.read_bytes(data, "las")
            else:
                assert len(readers.read_bytes(data, "las")) == 1
        assert readers.deaths == 1
    finally:
        readers.close()
