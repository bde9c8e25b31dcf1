"""Files and rows of a collection that were damaged after they were written: made again, and told by name."""

import json
import shutil
import sqlite3
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import numpy as np
import pytest

import isomatch
from isomatch import FormatError
from isomatch.cli import main
from isomatch.cohort import Collection, export, finish
from isomatch.cohort.map_file import CHANGED, MISSING, changed_files
from later import some_later
from small_collections import arrays_of, run

PAIR, OTHER = ("s0", "s1"), ("s1", "s3")


def contents(folder):
    """Bytes of all files that are kept."""
    return {
        path.relative_to(folder): path.read_bytes() for path in folder.glob("*/*") if path.suffix != ".html"
    }


@pytest.fixture(scope="module")
def complete(finished, tmp_path_factory):
    """The finished collection with its surfaces; not to be changed."""
    folder = shutil.copytree(finished, tmp_path_factory.mktemp("complete") / "all")
    finished_lines(Collection.open(folder))
    return folder


@pytest.fixture
def collection(complete, tmp_path):
    return Collection.open(shutil.copytree(complete, tmp_path / "all"))


def finished_lines(collection):
    with ThreadPoolExecutor(1) as executor:
        return list(finish(collection, executor, 1))


def cut(path):
    path.write_bytes(path.read_bytes()[:-50])


def one_byte(path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


def written_anew(path):
    """Other values in a file that is whole by itself."""
    with np.load(path) as stored:
        arrays = dict(stored)
    name = next(name for name in arrays if name in ("there_vertices", "array_0"))
    arrays[name] = np.roll(arrays[name], 1, axis=0)
    np.savez(path, **arrays)


def moved_vertex(path):
    mesh = isomatch.read_mesh(path)
    isomatch.write_mesh(path, mesh.moved(mesh.vertices * 1.5))


def swapped(path):
    other = max(each for each in path.parent.iterdir() if each != path)
    first, second = path.read_bytes(), other.read_bytes()
    path.write_bytes(second)
    other.write_bytes(first)


def files(collection):
    layout, rows = collection.layout, collection.rows()
    return {
        "prepared": layout.prepared(rows.shapes["s1"].key),
        "maps": layout.maps(PAIR),
        "corresponded": layout.corresponded("s1"),
    }


@pytest.mark.parametrize(
    ("folder", "damage"),
    some_later(
        [
            *(
                (folder, damage)
                for folder in ("prepared", "maps")
                for damage in (cut, one_byte, written_anew, swapped)
            ),
            *(("corresponded", damage) for damage in (cut, one_byte, moved_vertex, swapped)),
        ],
        {("prepared", cut), ("maps", one_byte), ("corresponded", moved_vertex)}.__contains__,
    ),
)
def test_what_is_damaged_is_named_and_made_again(folder, damage, collection, capsys):
    before, path = contents(collection.folder), files(collection)[folder]
    damage(path)
    damaged = {name for name, data in contents(collection.folder).items() if data != before[name]}
    found = changed_files(collection.layout, collection.rows())
    assert found == {collection.folder / name: CHANGED for name in damaged}
    assert main(["collect", "status", str(collection.folder), "--json"]) == 0
    assert {*json.loads(capsys.readouterr().out)["damaged"]} == {name.as_posix() for name in damaged}
    events = run(collection)
    surfaces = [line for line in finished_lines(collection) if line.again]
    if folder != "corresponded":
        assert [event.row.again for event in events] == [(f"its file {CHANGED}",)] * len(damaged)
    else:
        assert [line.again for line in surfaces] == [f"its file {CHANGED}"] * len(damaged)
    assert len(events) + len(surfaces) == len(damaged)
    assert changed_files(collection.layout, collection.rows()) == {}
    assert run(collection) == []
    if folder == "corresponded":  # the others hold the time that they took
        assert contents(collection.folder) == before


@pytest.mark.long
def test_maps_that_were_damaged_come_back_as_they_were(collection, finished):
    swapped(files(collection)["maps"])
    written_anew(collection.layout.maps(OTHER))
    run(collection)
    assert arrays_of(collection.folder) == arrays_of(finished)


def test_what_is_lost_is_named(collection):
    for path in (kept := files(collection)).values():
        path.unlink()
    assert changed_files(collection.layout, collection.rows()) == dict.fromkeys(kept.values(), MISSING)
    assert [event.row.again for event in run(collection)] == [(f"its file {MISSING}",)] * 2
    assert [line.again for line in finished_lines(collection)] == [f"its file {MISSING}"]


@pytest.mark.parametrize("folder", ["maps", "corresponded"])
def test_nothing_damaged_is_exported(folder, collection, tmp_path):
    path = files(collection)[folder]
    one_byte(path)
    with pytest.raises(FormatError, match=path.name):
        list(export(collection, tmp_path / "exported"))
    assert not (tmp_path / "exported").exists()
    assert list(
        export(
            collection, tmp_path / "exported", **({"maps": None} if folder == "maps" else {"meshes": None})
        )
    )


def test_nothing_damaged_is_in_statistics(collection, tmp_path, capsys):
    path = files(collection)["corresponded"]
    one_byte(path)
    assert main(["statistics", str(collection.folder), "-o", str(tmp_path / "out")]) == 1
    assert f"{path} {CHANGED}" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.long
def test_landmarks_that_were_changed_are_named(collection, tmp_path, capsys):
    marks = tmp_path / "s0.csv"
    x, y, z = isomatch.read_mesh(collection.paths["s0"]).vertices[5]
    marks.write_text(f"name,x,y,z\nnose,{x},{y},{z}\n")
    argv = ["collect", "landmarks", str(collection.folder), str(marks), str(collection.layout.landmarks)]
    assert main(argv) == 0
    path = collection.layout.landmarks / "s2.mrk.json"
    one_byte(path)
    assert changed_files(collection.layout, collection.rows()) == {path: CHANGED}
    assert main([*argv, "--force"]) == 0
    assert changed_files(collection.layout, collection.rows()) == {}
    one_byte(files(collection)["maps"])
    assert main([*argv, "--force"]) == 1
    assert f"s0__s1.npz {CHANGED}" in capsys.readouterr().err


ROWS = ["[]", "{}", '"x"', "null", "3", "{", "[" * 100_000]
ROWS += ['{"state": "done"}', '{"state": ["done"], "time": 1}']


@pytest.mark.parametrize("table", ["shapes", "pairs", "files", "origins"])
def test_rows_of_the_wrong_kind_are_named_and_ignored(table, collection, capsys):
    before = arrays_of(collection.folder)
    for text in ROWS:
        with closing(sqlite3.connect(collection.layout.ledger(), isolation_level=None)) as connection:
            connection.execute(f"UPDATE {table} SET record = ? WHERE rowid = 1", (text,))
        (where,) = collection.rows().damaged
        assert main(["collect", "status", str(collection.folder)]) == 0
        assert f"{where} is no row of a collection, and was ignored" in capsys.readouterr().out
    run(collection)
    finished_lines(collection)
    assert collection.rows().damaged == []
    assert arrays_of(collection.folder) == before


@pytest.mark.long
@pytest.mark.parametrize("table", ["shapes", "pairs"])
def test_no_value_of_a_row_ends_a_command(table, collection, capsys):
    """Each of the wrong kind in turn: its row is ignored, or the value does not matter."""
    rows = collection.rows()
    name, row = ("s0", rows.shapes["s0"]) if table == "shapes" else (PAIR, rows.pairs[PAIR])
    record, names = row.to_json(), [name] if table == "shapes" else name
    where = "name = ?" if table == "shapes" else "source = ? AND target = ?"
    for field in record:
        for value in (None, "x", -1, [], {}, [["x"]]):
            with closing(sqlite3.connect(collection.layout.ledger(), isolation_level=None)) as connection:
                text = json.dumps({**record, field: value})
                connection.execute(f"UPDATE {table} SET record = ? WHERE {where}", (text, *names))
            assert main(["collect", "status", str(collection.folder)]) == 0
            capsys.readouterr()
