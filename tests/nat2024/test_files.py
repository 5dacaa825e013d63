"""Files are whole or absent, and what a killed process had begun goes away."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from nat2024.errors import Unwritable
from nat2024.files import check_writable, remove_leftovers, write_atomic


def test_folders_are_made_and_bytes_are_kept(tmp_path: Path) -> None:
    write_atomic(tmp_path / "a" / "b.txt", "x\r\nü")
    assert (tmp_path / "a" / "b.txt").read_bytes() == "x\r\nü".encode()
    write_atomic(tmp_path / "a" / "b.txt", b"\0")
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["b.txt"]
    assert (tmp_path / "a" / "b.txt").read_bytes() == b"\0"


def test_whether_a_file_can_be_written_is_known_before(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    check_writable(tmp_path / "a" / "b" / "c.txt")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    with pytest.raises(Unwritable, match="cannot be written"):
        check_writable(tmp_path / "file" / "c.txt")


def test_a_failed_write_keeps_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    write_atomic(path, "old")
    path.chmod(0o644)
    with pytest.raises(TypeError):
        write_atomic(path, 3)  # type: ignore[arg-type]
    assert path.read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 1


def test_permissions_follow_the_umask(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        write_atomic(tmp_path / "a.txt", "x")
    finally:
        os.umask(before)
    assert (tmp_path / "a.txt").stat().st_mode & 0o777 == 0o640


def test_leftovers_of_dead_processes_are_removed_and_no_others(tmp_path: Path) -> None:
    code = (
        "import os, sys, time; from pathlib import Path; from nat2024 import files\n"
        "os.fsync = lambda handle: (print('writing', flush=True), time.sleep(60))\n"
        f"files.write_atomic({str(tmp_path / 'a.txt')!r}, 'x')"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
    assert process.stdout
    process.stdout.readline()
    (begun,) = tmp_path.iterdir()
    remove_leftovers(tmp_path)
    assert begun.exists()  # its writer is alive
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    (tmp_path / ".mine.tmp").write_text("somebody else's")
    elsewhere = begun.with_name(f".a.txt.another_host-{process.pid}-00ff00ff.tmp")
    elsewhere.write_text("of another machine")
    remove_leftovers(tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([".mine.tmp", elsewhere.name])
