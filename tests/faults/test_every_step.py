"""The n-th write, flush, rename or allocation fails: the first, the last and some between, or all until one succeeds.

Each run ends in one line about it and leaves what was there before, or all that is new.
"""

import errno
import io
import os
import shutil
import sqlite3
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import isomatch
from isomatch.cli import main
from isomatch.cohort import Collection
from isomatch.cohort import ledger as ledger_module
from isomatch.cohort.map_file import changed_files
from isomatch.io import Asset, Attribute, write_asset
from small_collections import QUICK, arrays_of

ALLOCATORS = ("empty", "zeros", "full", "array", "concatenate", "arange")


class Faults:
    """Steps of a kind are counted, and one of them fails."""

    def __init__(self, monkeypatch):
        self.kind, self.left, self.count = "", 0, 0
        for kind, place, name in (
            ("rename", Path, "replace"),
            ("flush", os, "fsync"),
            ("folder", Path, "mkdir"),
        ):
            monkeypatch.setattr(place, name, self._failing(kind, getattr(place, name)))
        for name in ALLOCATORS:
            monkeypatch.setattr(np, name, self._failing("allocation", getattr(np, name)))
        faults, usual, connect = self, Path.open, ledger_module.sqlite3.connect

        class Stored(io.FileIO):
            def write(self, data):
                faults.step("write")
                return super().write(data)

        def opened(path, mode="r", buffering=-1, **options):
            if mode != "xb":
                return usual(path, mode, buffering, **options)
            return io.BufferedWriter(Stored(path, "x"), 2**20)

        class Connection:
            def __init__(self, connection):
                self.connection = connection

            def execute(self, command, *values):
                if command.startswith(("INSERT", "DELETE")):
                    faults.step("row")
                return self.connection.execute(command, *values)

            def __getattr__(self, name):
                return getattr(self.connection, name)

        monkeypatch.setattr(Path, "open", opened)
        monkeypatch.setattr(
            ledger_module.sqlite3, "connect", lambda *given, **options: Connection(connect(*given, **options))
        )

    def _failing(self, kind, function):
        def call(*given, **options):
            self.step(kind)
            return function(*given, **options)

        return call

    def step(self, kind):
        if kind != self.kind:
            return
        self.count += 1
        if self.count == self.left:
            raise {
                "allocation": MemoryError("no more is given"),
                "row": sqlite3.OperationalError("disk I/O error"),
            }.get(kind) or OSError(errno.EIO, os.strerror(errno.EIO))

    @contextmanager
    def at(self, kind, n):
        self.kind, self.left, self.count = kind, n, 0
        try:
            yield
        finally:
            self.kind = ""


@pytest.fixture
def faults(monkeypatch):
    return Faults(monkeypatch)


@pytest.fixture(scope="module")
def prepared(finished, tmp_path_factory):
    """What the commands start from: a collection with surfaces, a map, and surfaces with values."""
    folder = tmp_path_factory.mktemp("prepared")
    shutil.copytree(finished, folder / "all")
    collection = Collection.open(folder / "all")
    with ThreadPoolExecutor(1) as executor:
        list(isomatch.cohort.finish(collection, executor, 1))
    maps = collection.maps("s0", "s1")
    maps.forward.save(folder / "map.npz")
    (folder / "quick.toml").write_text(QUICK)
    for name in ("s0", "s1"):
        mesh = isomatch.read_mesh(collection.paths[name])
        values = Attribute("height", "point", "scalar", mesh.vertices[:, 2])
        write_asset(folder / f"{name}.ply", Asset.of_mesh(mesh, [values]))
    return folder


def state(folder):
    return {
        path.relative_to(folder): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and path.name != "ledger.sqlite"
    }


def fails(faults, kind, n, argv, capsys):
    """Run a command, of which a step fails; whether it did, which it has to say in one line, and what it says else."""
    with faults.at(kind, n):
        code = main(argv)
    out, said = capsys.readouterr()
    reached = faults.count >= n
    if code:
        assert code in ((1, 3) if argv[0] == "collect" else (1,))  # 3: some shapes or pairs failed
        assert reached
        assert all(line.startswith("isomatch: ") for line in said.splitlines())
        *notes, error = said.splitlines()
        assert "; " in error
        assert all("done again, because" in note for note in notes)
    return bool(code), reached, out


COMMANDS = {
    "match": "match {0}/s0.ply {0}/s1.ply --config {0}/quick.toml -o {1}/out --force",
    "export": "collect export {0}/all {1}/out --force",
    "statistics": "statistics {0}/all -o {1}/out --modes 1 --force",
    "transfer": "transfer {0}/map.npz {0}/s0.ply {0}/s1.ply -o {1}/out/carried.obj --force",
}
KINDS = ("write", "flush", "rename", "folder")


def steps(growth):
    """Yield 1, 2, 3, … or 1, 2, 4, …; who takes them ends when no step of that number is reached."""
    n = 1
    while True:
        yield n
        n = max(n + 1, growth * n)


def spread(count, most):
    """Yield at most so many of the steps 1 … count, evenly, with the first and the last; then one that is not reached."""
    return sorted({*np.linspace(1, count, min(count, most)).round().astype(int).tolist(), count + 1})


def cases():
    """All commands with all kinds, and how many steps fail; those that take seconds are in the long version."""
    for command in COMMANDS:
        for kind in (*KINDS, "allocation"):
            is_long = command in ("statistics", "match", "export")
            most = 40 if command == "transfer" else 5 if command == "statistics" else 12
            yield pytest.param(command, kind, most, marks=[pytest.mark.long] * is_long)


@pytest.mark.long
@pytest.mark.usefixtures("coarse_pictures", "small_pictures")
@pytest.mark.parametrize(("command", "kind", "most"), cases())
def test_old_or_new(command, kind, most, prepared, faults, tmp_path, monkeypatch, capsys):
    matched = isomatch.match(
        *(isomatch.read_mesh(prepared / f"s{i}.ply") for i in range(2)),
        config=isomatch.Config.from_file(prepared / "quick.toml"),
    )
    if kind != "allocation":
        monkeypatch.setattr(isomatch, "match", lambda *_, **__: matched)
    argv = COMMANDS[command].format(prepared, tmp_path).split()
    out = tmp_path / "out"
    out.mkdir()
    assert main(argv) == 0
    with faults.at(kind, 0):
        assert main(argv) == 0
    new = state(out).keys()
    capsys.readouterr()
    marked = {path: b"earlier" for path in state(out)}
    for n in spread(faults.count, most):
        for path, text in marked.items():
            (out / path).write_bytes(text)
        failed, reached, said = fails(faults, kind, n, argv, capsys)
        after = state(out)
        if "there is no picture" in said or "there is no report" in said:  # drawings are no part of a result
            assert kind == "allocation"
            after = {Path("map.png"): b"", Path("report.html"): b""} | after
        assert after.keys() == new
        assert not list(out.rglob("*.unfinished"))
        if failed:
            assert after == marked, f"the {n}th {kind}"
        else:
            assert all(data != b"earlier" for data in after.values())
    assert not reached, "all steps were counted"


@pytest.mark.long
@pytest.mark.parametrize("growth", [1, 2])
@pytest.mark.parametrize("kind", [*KINDS, "row", "allocation"])
def test_collect(kind, growth, prepared, small, in_threads, faults, tmp_path, capsys):
    """Of a collection in which a shape, a map and a surface have to be made again."""
    expected = arrays_of(prepared / "all")
    argv = (
        f"collect {small.shapes} -o {tmp_path}/all --pairs all --config {small.settings} --jobs 1 --no-agree"
    )
    for n in steps(2 if kind == "allocation" else growth):
        shutil.rmtree(tmp_path / "all", ignore_errors=True)
        shutil.copytree(prepared / "all", tmp_path / "all")
        collection = Collection.open(tmp_path / "all")
        layout = collection.layout
        layout.prepared(collection.rows().shapes["s0"].key).unlink()
        layout.maps(("s1", "s2")).unlink()
        layout.corresponded("s1").unlink()
        failed, reached, _ = fails(faults, kind, n, [*argv.split(), "--reports", "none"], capsys)
        rows = collection.rows()
        assert not rows.damaged
        if kind != "allocation":
            assert {row.state for row in (*rows.shapes.values(), *rows.pairs.values())} == {"done"}
        if (failed and n % 4 == 0) or not reached:
            if kind == "allocation":  # a shape or a pair that failed is begun again when that is asked for
                assert main(["collect", "retry", "failed", f"{tmp_path}/all"]) == 0
            assert main([*argv.split(), "--reports", "none"]) == 0
            capsys.readouterr()
            assert arrays_of(tmp_path / "all") == expected
            assert changed_files(layout, collection.rows()) == {}
        if not reached:
            break
