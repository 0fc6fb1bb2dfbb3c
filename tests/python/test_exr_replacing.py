"""Files are replaced whole or not at all: after errors, on a full disk, when the writer is killed."""

import os
import resource
import shutil
import signal
import socket
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest

from frazil import exr
from frazil.replacing import check_writable, replacing


def write_old(path: Path) -> None:
    exr.write_exr(path, {"beauty": np.zeros((8, 8, 4), np.float32)}, {"beauty": "RGBA"})


def test_an_error_keeps_the_old_file_and_leaves_nothing_else(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")

    def fail():
        with replacing(path) as temporary:
            temporary.write_text("new")
            raise LookupError

    with pytest.raises(LookupError):
        fail()
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "real.txt").write_text("old")
    (tmp_path / "link.txt").symlink_to("real.txt")
    with replacing(tmp_path / "link.txt") as temporary:
        temporary.write_text("new")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "real.txt").read_text() == "new"


def test_leftovers_of_the_dead_are_removed_and_those_of_the_living_kept(tmp_path):
    with replacing(tmp_path / "[a]*.exr") as temporary:
        dead = temporary.with_name(temporary.name.replace(f"-{os.getpid()}.", "-999999999."))
        living = temporary.with_name(temporary.name.replace(f"-{os.getpid()}.", f"-{os.getppid()}."))
        temporary.write_text("1")
    dead.write_text("")
    living.write_text("")
    with replacing(tmp_path / "[a]*.exr") as temporary:
        temporary.write_text("2")
    assert not dead.exists()
    assert living.exists()


def test_unwritable_paths_are_refused_by_name(tmp_path):
    with pytest.raises(OSError, match=r"no/a\.exr: folder must exist"):
        check_writable(tmp_path / "no" / "a.exr")
    with pytest.raises(OSError, match="output must be a file, got a folder"):
        check_writable(tmp_path)
    with pytest.raises(OSError, match="output must be a file, got a device"):
        check_writable("/dev/null")
    with pytest.raises(OSError, match="folder must be writable"):
        check_writable("/proc/a.exr")
    assert os.listdir(tmp_path) == []


WRITE_LARGE = """
import sys, numpy as np
from frazil import exr
try:
    layer = np.random.default_rng(0).random((512, 512, 4), np.float32)
    exr.write_exr(sys.argv[1], {"beauty": layer}, {"beauty": "RGBA"}, compression="zip")
except OSError as error:
    print(error)
"""


def write_large(path: Path, **options) -> str:
    command = [sys.executable, "-c", WRITE_LARGE, str(path)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, **options).stdout


def assert_old_file_is_whole(path: Path, printed: str) -> None:
    assert f"{path.name}: cannot be written" in printed
    assert "The old file, if any, is whole" in printed
    assert os.listdir(path.parent) == [path.name]
    assert exr.read_exr(path)[0]["beauty"].shape == (8, 8, 4)


def test_a_write_that_fails_midway_keeps_the_old_file(tmp_path):
    path = tmp_path / "a.exr"
    write_old(path)

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))

    assert_old_file_is_whole(path, write_large(path, preexec_fn=limit))


def test_a_full_disk_keeps_the_old_file(tmp_path):
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = [shutil.which("mount") or "mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", str(folder)]
    if os.geteuid() != 0 or subprocess.run(mount, capture_output=True).returncode != 0:
        pytest.skip("a small file system cannot be mounted here")
    try:
        write_old(folder / "a.exr")
        assert_old_file_is_whole(folder / "a.exr", write_large(folder / "a.exr"))
    finally:
        subprocess.run(["umount", folder], check=True)


WRITE_FOREVER = """
import sys, numpy as np
from frazil import exr
value = 0
while True:
    value += 1
    layer = np.full((256, 256, 4), value, np.float32)
    exr.write_exr(sys.argv[1], {"beauty": layer}, {"beauty": "RGBA"}, compression="none")
"""


def test_a_killed_writer_leaves_a_whole_file(tmp_path):
    path = tmp_path / "a.exr"
    random = np.random.default_rng(11)
    written = []
    for _ in range(6):
        path.unlink(missing_ok=True)
        writer = subprocess.Popen([sys.executable, "-c", textwrap.dedent(WRITE_FOREVER), str(path)])
        deadline = time.monotonic() + 60
        while not path.exists() and time.monotonic() < deadline:
            time.sleep(0.01)
        time.sleep(0.3 * random.random())
        writer.send_signal(signal.SIGKILL)
        writer.wait()
        beauty = exr.read_exr(path)[0]["beauty"]
        assert beauty.min() == beauty.max() > 0
        written.append(beauty.max())
    assert max(written) > 1  # the writers were killed in the middle of their work
    # What the dead left is swept away by the next writer.
    write_old(path)
    assert os.listdir(tmp_path) == ["a.exr"]


def test_a_dead_writers_probe_is_swept_away_and_a_living_ones_is_not(tmp_path):
    path = tmp_path / "a.exr"
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    host = socket.gethostname()
    living = f".a.exr.{host}-{os.getppid()}.probe"
    for name in (f".a.exr.{host}-{gone.pid}.probe", f".a.exr.{host}-{gone.pid}.tmp", living):
        (tmp_path / name).touch()
    write_old(path)
    assert sorted(os.listdir(tmp_path)) == sorted([living, "a.exr"])
