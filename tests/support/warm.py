"""A process that has imported cylx and loaded its kernels, and forks for each call of a command: no call starts cold.

What an extraction gives is remembered, too: pages and tests about commands extract the same scans again and again.

`python -m tests.support.warm SOCKET FOLDER` serves. `calls(SOCKET)` is the text of a command that passes its arguments,
folder, environment and streams on, and ends as the process does that runs cylx for it.
"""

import contextlib
import hashlib
import importlib
import io
import json
import multiprocessing.connection
import multiprocessing.context
import os
import pickle
import pkgutil
import socket
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

_CALL = """#!{python} -ISE
import json, os, signal, socket, sys
with socket.socket(socket.AF_UNIX) as server:
    server.connect({path!r})
    socket.send_fds(server, [b"!"], [0, 1, 2])
    server.sendall(json.dumps([os.getcwd(), dict(os.environ), sys.argv[1:]]).encode())
    server.shutdown(socket.SHUT_WR)
    status = int(server.makefile().read())
if status < 0:
    signal.signal(-status, signal.SIG_DFL)
    os.kill(os.getpid(), -status)
sys.exit(status)
"""
LIBRARIES = ["scipy.optimize", "scipy.ndimage", "plyfile", "laspy", "trimesh", "ifcopenshell", "ezdxf", "jsonschema"]
"""Of those that commands use; no Open3D, which starts threads."""
POSSIBLE = hasattr(os, "fork") and hasattr(socket, "send_fds") and sys.platform.startswith("linux")


def calls(path):
    """Return the text of a command that calls the process at a socket."""
    return _CALL.format(python=sys.executable, path=str(path))


@contextlib.contextmanager
def serving(path, folder):
    """Start the process, which remembers extractions in a folder; wait until it is ready, and stop it at the end."""
    command = [sys.executable, "-m", "tests.support.warm", str(path), str(folder)]
    with subprocess.Popen(command, cwd=Path(__file__).resolve().parents[2], stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"ready\n"
        try:
            yield
        finally:
            process.kill()


def serve(path):
    """Wait for calls; returns in a process of its own for each of them."""
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(path)
        server.listen()
        print("ready", flush=True)
        while True:
            caller, _ = server.accept()
            if os.fork() == 0:
                break
            caller.close()
            bury()
    _, streams, _, _ = socket.recv_fds(caller, 1, 3)
    folder, environment, arguments = json.loads(caller.makefile().read())
    process = os.fork()
    if process:
        status = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
        with contextlib.suppress(OSError):
            caller.sendall(str(status).encode())
        os._exit(0)
    caller.close()
    for place, stream in enumerate(streams):
        os.dup2(stream, place)
        os.close(stream)
    names = ("stdin", "stdout", "stderr")
    for place, name in enumerate(names):
        stream = open(place, "w" if place else "r", 1 if place == 2 else -1, "utf-8", closefd=False)  # noqa: SIM115
        setattr(sys, name, stream)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv[1:] = arguments


def bury():
    """Wait for those that have answered: then their processor time counts as that of the tests."""
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG) != (0, 0):
            pass


class Recorder:
    """An observer that remembers what it is told, to tell another one."""

    def __init__(self, listener):
        self.listener, self.told = listener, []

    def __getattr__(self, name):
        def tell(*args):
            self.told.append((name, args))
            getattr(self.listener, name)(*args)

        return tell


class WithoutCloud(pickle.Pickler):
    """Leaves out the cloud of an extraction."""

    def __init__(self, file, cloud):
        super().__init__(file)
        self.cloud = cloud

    def persistent_id(self, one):
        return "the cloud" if one is self.cloud else None


class WithCloud(pickle.Unpickler):
    """Puts the cloud of an extraction where it was left out."""

    def __init__(self, file, cloud):
        super().__init__(file)
        self.cloud = cloud

    def persistent_load(self, _):
        return self.cloud


def remembered(extract, folder):
    """Return a function that keeps what an extraction gives, as the same points and settings give the same."""
    from cylx.records import SilentObserver

    def extract_once(cloud, config, *, threads=None, observer=None):
        observer = observer or SilentObserver()
        valid = b"" if cloud.valid is None else cloud.valid.tobytes()
        source = replace(cloud.source, file="")  # wherever it lies
        about = f"{source!r} {cloud.rows} {config.model_dump_json()}".encode()
        path = folder / hashlib.sha256(b"|".join([cloud.points.tobytes(), valid, about])).hexdigest()
        if path.is_file():
            with path.open("rb") as file:
                found, told = WithCloud(file, cloud).load()
            for name, args in told:
                getattr(observer, name)(*args)
            return found
        recorder = Recorder(observer)
        found = extract(cloud, config, threads=threads, observer=recorder)
        kept = io.BytesIO()
        WithoutCloud(kept, cloud).dump((found, recorder.told))
        temporary = path.with_suffix(f".{os.getpid()}")
        temporary.write_bytes(kept.getvalue())
        temporary.replace(path)
        return found

    return extract_once


def forks():
    """Return what starts the processes of a command as copies of its own, which are warm and remember, too."""

    class Copy(multiprocessing.context.ForkProcess):
        def run(self):
            # the other ends of pipes are not for copies: who reads from one is to notice that its owner has closed it
            mine = {one.fileno() for one in self._args if isinstance(one, multiprocessing.connection.Connection)}
            for path in list(Path("/proc/self/fd").iterdir()):
                with contextlib.suppress(OSError):  # the folder itself
                    if int(path.name) not in mine and str(path.readlink()).startswith("socket:"):
                        os.close(int(path.name))
            super().run()

    class Copies(multiprocessing.context.ForkContext):
        Process = Copy

    return Copies()


def import_all():
    """Import what commands import when they are called: all of cylx, and the libraries of extras that are here."""
    import cylx

    names = [module.name for module in pkgutil.walk_packages(cylx.__path__, "cylx.")]
    for name in [name for name in names if not name.endswith("__main__")] + LIBRARIES:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)


def load(folder):
    """Import what a run imports, load what it calls, and let extractions be remembered in a folder."""
    import cylx.pipeline
    from cylx.api import warmup

    import_all()
    extract_once = remembered(cylx.pipeline.extract_cylinders, folder)
    extract_once(warmup.PointCloud(warmup.practice_cloud()), warmup.Config(), threads=1)
    # whoever warms up again finds all kernels loaded, and would only practise once more
    cylx.pipeline.extract_cylinders = warmup.extract_cylinders = extract_once
    copies = forks()
    multiprocessing.get_context = lambda kind: copies
    assert threading.active_count() == 1, "a process with threads cannot be forked"


if __name__ == "__main__":
    path, folder = sys.argv[1:]
    load(Path(folder))
    serve(path)
    from cylx.__main__ import run

    run()
