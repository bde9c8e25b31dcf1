"""A disk that is full after any number of bytes leaves what was there before, and an error that says so."""

import errno
import io
import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from isomatch import Correspondence, DistanceBasis, UnwritableFileError, read_mesh, write_mesh
from isomatch._core.array_file import write_arrays
from isomatch._core.texts import write_csv
from isomatch.cli import main
from isomatch.cohort import Collection
from isomatch.geodesics import Sampling
from isomatch_lab.evaluation.ledger import appending, read_rows
from shapes import icosphere
from small_collections import arrays_of

N = 600
MESH = icosphere(2)
MAP = Correspondence(np.arange(N)[::-1], N)
BASIS = DistanceBasis(
    vectors=np.random.default_rng(0).normal(size=(N, 3)),
    values=np.array([3.0, -2.0, 1.0]),
    weights=np.ones(N),
    method="nystrom",
    engine="fast_marching",
    samples=np.array([0, 2]),
    held_out=Sampling(np.array([1]), np.ones((1, N))),
)
WRITERS = {
    "map.npz": (MAP.save, Correspondence.load),
    "map.txt": (MAP.save, Correspondence.load),
    "basis.npz": (BASIS.save, DistanceBasis.load),
    "mesh.ply": (lambda path: write_mesh(path, MESH), read_mesh),
    "arrays.npz": (lambda path: write_arrays(path, {"a": np.arange(N)}), lambda path: np.load(path)["a"]),
    "table.csv": (lambda path: write_csv(path, [{"a": i} for i in range(N)], ["a"]), Path.read_text),
}


class SmallDisk:
    """Room for a number of bytes; the write that needs more stores a part and, if there is none, fails."""

    def __init__(self, monkeypatch):
        self.room, self.number = 0, errno.ENOSPC
        disk, usual = self, Path.open

        class Stored(io.FileIO):
            def write(self, data):
                data = memoryview(data).cast("B")[: disk.room]
                if not len(data):
                    raise OSError(disk.number, os.strerror(disk.number))
                disk.room -= len(data)
                return super().write(data)

        def opened(path, mode="r", buffering=-1, **options):
            if mode not in ("xb", "ab+"):
                return usual(path, mode, buffering, **options)
            raw = Stored(path, mode.replace("b", ""))
            return raw if buffering == 0 else io.BufferedWriter(raw)

        monkeypatch.setattr(Path, "open", opened)


@pytest.fixture
def disk(monkeypatch):
    return SmallDisk(monkeypatch)


@pytest.mark.parametrize("name", WRITERS)
def test_a_file_is_whole_or_what_it_was_before(name, disk, tmp_path):
    write, read = WRITERS[name]
    path = tmp_path / name
    disk.room = 10**6
    write(path)
    before, size = path.read_bytes(), 10**6 - disk.room
    read(path)
    for room in {0, 1, size - 1, *np.random.default_rng(1).integers(size, size=40).tolist()}:
        disk.room = room
        with pytest.raises(UnwritableFileError, match=f"{name}.*No space"):
            write(path)
        assert path.read_bytes() == before
        assert [one.name for one in tmp_path.iterdir()] == [name]


def test_the_rows_of_a_benchmark_stay_readable(disk, tmp_path):
    """A write that finds too little room stores a part of a row without an error; no other row may continue it."""
    rows = [{"pair": f"{i}-{i + 1}", "error": i / 7} for i in range(6)]
    for room in range(len(json.dumps(rows[3]))):
        (tmp_path / "rows.jsonl").unlink(missing_ok=True)
        disk.room = 10**6
        with appending(tmp_path) as append:
            for row in rows[:3]:
                append(row)
            disk.room = room
            with pytest.raises(UnwritableFileError, match="written"):
                append(rows[3])
        assert read_rows(tmp_path) == rows[:3]
        disk.room = 10**6
        with appending(tmp_path) as append:
            for row in rows[3:]:
                append(row)
        assert read_rows(tmp_path) == rows


ROOMS = {20_000: "ENOSPC", 150_000: "EDQUOT", 700_000: "EIO", 600_000: "ENOSPC", 100_000: "EDQUOT"}


@pytest.mark.long
def test_a_full_disk_is_no_failure_of_a_shape(small, finished, in_threads, disk, tmp_path, capsys):
    """Whatever there is room for, nothing is called failed, and the last run completes what the others began."""
    argv = f"collect {small.shapes} -o {tmp_path} --pairs all --config {small.settings} --jobs 1 --reports 1"
    for disk.room, name in ROOMS.items():
        disk.number = getattr(errno, name)
        assert main(argv.split()) == 1
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert f"cannot be written ({os.strerror(disk.number)}); " in said
        assert said.endswith("with free space\n"), "the remedy"
        rows = Collection.open(tmp_path).rows()
        assert {row.state for row in (*rows.shapes.values(), *rows.pairs.values())} <= {"done"}
    assert (tmp_path / "maps" / "s0__s1.npz").exists()
    disk.room = 10**9
    assert main(argv.split()) == 0
    assert arrays_of(tmp_path) == arrays_of(finished)


@pytest.fixture
def tmpfs(tmp_path):
    """A file system with room for the map, but not for the picture."""
    folder = tmp_path / "small"
    folder.mkdir()
    try:
        subprocess.run(
            ["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", folder], check=True, capture_output=True
        )
    except (OSError, subprocess.CalledProcessError) as error:
        pytest.skip(f"a small file system cannot be mounted here: {error}")
    yield folder
    subprocess.run(["umount", folder], check=True)


@pytest.mark.long
def test_a_match_on_a_full_disk_ends_in_one_line(pair, match_argv, tmpfs, capsys):
    out = tmpfs / "out"
    assert main(match_argv(out)) == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "cannot be written (No space left on device)" in said
    assert not out.exists()
