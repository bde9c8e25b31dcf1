"""What a collection keeps: ledgers, maps, prepared shapes in memory, what killed runs left."""

import json
import os
import sqlite3
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from threading import Event

import numpy as np
import pytest

from isomatch import Correspondence, FormatError, Outcome, UnwritableFileError
from isomatch._core.files import claimed
from isomatch.cohort import PairMaps
from isomatch.cohort import ledger as ledger_module
from isomatch.cohort.jobs import load_shape
from isomatch.cohort.ledger import MapRecord, PairRow, Rows, ShapeRow, read_ledgers, writing_ledger
from isomatch.cohort.plan import STALE_AGE, Layout, key_of, medoid
from isomatch.settings import Config

RESULT = {"outcome": "CONVERGED", "quality": {"spectral_residual": 0.1, "orientation": 1.0, "mirrored": None}}
OF_SHAPE = {"key": "k", "hash": "h", "bytes": 1, "area": 1.0, "features": [0.5] * 50, "notes": []}
OF_PAIR = {"key": "k", "attempt": 0, "source_hash": "a", "target_hash": "b", "there": RESULT, "back": RESULT}
DONE, FAILED = (
    ShapeRow.from_json({"state": state, "time": 1.0, "error": "", **OF_SHAPE}) for state in ("done", "failed")
)
PAIR = PairRow.from_json({"state": "done", "time": 1.0, **OF_PAIR})


def test_maps_come_back_to_single_precision(tmp_path):
    rng = np.random.default_rng(0)
    weights = rng.dirichlet([1, 1, 1], 50)
    faces = rng.permuted(np.tile(np.arange(40), (50, 1)), axis=1)[:, :3]
    vertices = faces[np.arange(50), weights.argmax(axis=1)]
    vertices[7], faces[7], weights[7] = -1, -1, 0
    there = Correspondence(vertices, 40, faces, weights, "a", "b")
    back = Correspondence(rng.integers(50, size=40), 50, source_hash="b", target_hash="a")
    PairMaps(there, back, MapRecord(source_hash="a", target_hash="b")).save(tmp_path / "m.npz")
    read = PairMaps.load(tmp_path / "m.npz")
    for one, other in ((read.forward, there), (read.backward, back)):
        assert np.array_equal(one.vertices, other.vertices)
        assert np.array_equal(one.faces, other.faces)
        assert np.abs(one.barycentric - other.barycentric).max() < 1e-6
        assert (one.shape, one.source_hash, one.target_hash) == (
            other.shape,
            other.source_hash,
            other.target_hash,
        )


def test_damaged_maps_are_refused(tmp_path, finished):
    path = tmp_path / "m.npz"
    whole = Layout(finished).maps(("s0", "s1")).read_bytes()
    for size in (0, 100, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:size])
        with pytest.raises(FormatError, match="maps"):
            PairMaps.load(path)


def test_a_key_tells_contents_settings_and_seed():
    key = key_of(Config(), 0, "a", "b")
    assert key == key_of(Config(), 0, "a", "b")
    others = {
        key_of(Config(), 0, "b", "a"),
        key_of(Config(n_search=300), 0, "a", "b"),
        key_of(Config(), 1, "a", "b"),
    }
    assert len(others | {key}) == 4


def test_of_rows_in_several_ledgers_what_is_done_counts_and_then_the_later():
    late = replace(FAILED, time=2.0)
    rows = Rows({"a": FAILED, "b": DONE, "c": FAILED})
    rows.merge(Rows({"a": DONE, "b": late, "c": late, "d": FAILED}))
    assert rows.shapes == {"a": DONE, "b": DONE, "c": late, "d": FAILED}


def test_of_rows_of_a_file_that_changed_the_later_counts():
    before, after = (replace(DONE, size=1, changed=1), replace(FAILED, time=DONE.time + 1, size=2, changed=2))
    for first, second in ((before, after), (after, before)):
        rows = Rows({"a": first})
        rows.merge(Rows({"a": second}))
        assert rows.shapes == {"a": after}


def test_a_row_is_written_as_it_was_read():
    """With the values of other versions."""
    record = {"time": 1.0, "of_a_later_version": [1], "state": "done", **OF_PAIR, "reflected": []}
    record |= {"memory": None, "agreement": {"later": 1, "inconsistency": 0.0}}
    row = PairRow.from_json(record)
    assert json.loads(json.dumps(row.to_json())) == record
    new = replace(row, time=2.0, again=("asked for",), forward=row.forward.with_outcome(Outcome.PARTIAL))
    there = {**RESULT, "outcome": "PARTIAL", "advice": Outcome.PARTIAL.advice}
    expected = {**record, "time": 2.0, "there": there, "again": ["asked for"]}
    assert json.loads(json.dumps(new.to_json())) == expected


@pytest.mark.parametrize("one_host", [True, False])
def test_a_ledger_is_read_while_it_is_written_and_one_file_when_it_is_not(one_host, tmp_path):
    path = tmp_path / "ledger.sqlite"
    for turn in range(2):
        with writing_ledger(path, one_host=one_host) as ledger:
            ledger.put(("a", str(turn)), PAIR)
            assert len(read_ledgers([path]).pairs) == turn + 1
            with pytest.raises(UnwritableFileError, match="written"), writing_ledger(path):
                pass
        assert [file.name for file in tmp_path.iterdir()] == ["ledger.sqlite"]


def test_a_reader_does_not_keep_a_run_from_its_end(tmp_path):
    path = tmp_path / "ledger.sqlite"
    with writing_ledger(path) as ledger:
        ledger.put(("a", "b"), PAIR)
        reader = sqlite3.connect(path)
        assert len(reader.execute("SELECT * FROM pairs").fetchone()) == 3
    reader.close()
    assert read_ledgers([path]).pairs == {("a", "b"): PAIR}


KILLED = """
import os, sys
from pathlib import Path
from isomatch.cohort.ledger import writing_ledger
from isomatch.cohort.ledger import PairRow
with writing_ledger(Path(sys.argv[1]), one_host=sys.argv[2] == "True") as ledger:
    for i in range(50):
        ledger.put((str(i), "x"), PairRow(state="todo", time=1.0))
    if sys.argv[2] == "False":  # a transaction that has begun to change the file
        ledger._connection.execute("PRAGMA cache_size = 1")
        ledger._connection.execute("BEGIN")
        ledger._connection.execute("DELETE FROM pairs")
        for i in range(2000):
            ledger._connection.execute("INSERT INTO shapes VALUES (?, ?)", (str(i), "x" * 100))
    os.kill(os.getpid(), 9)
"""


@pytest.mark.long
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("one_host", [True, False])
def test_a_ledger_whose_writer_was_killed_has_all_its_rows(one_host, tmp_path):
    path = tmp_path / "ledger.sqlite"
    subprocess.run([sys.executable, "-c", KILLED, str(path), str(one_host)], check=False)
    assert len(list(tmp_path.glob("ledger.sqlite-*"))) == (2 if one_host else 1)
    assert len(read_ledgers([path]).pairs) == 50
    with writing_ledger(path, one_host=not one_host) as ledger:
        assert len(ledger.rows.pairs) == 50
        assert not ledger.rows.shapes


@pytest.mark.parametrize("one_host", [True, False])
def test_a_ledger_is_read_while_it_is_made(one_host, tmp_path):
    """As by the shards of a run, which begin at about the same time."""
    ended = Event()

    def reads(path):
        while not ended.is_set():
            if path.exists():
                assert read_ledgers([path]) in (Rows(), Rows(shapes={"a": DONE}))

    for turn in range(30):
        path = tmp_path / f"ledger_{turn}.sqlite"
        ended.clear()
        with ThreadPoolExecutor(1) as other:
            reading = other.submit(reads, path)
            with writing_ledger(path, one_host=one_host) as ledger:
                ledger.put("a", DONE)
            ended.set()
            reading.result()


def test_a_ledger_that_is_just_begun_has_no_rows(tmp_path):
    path = tmp_path / "ledger.sqlite"
    path.touch()
    assert read_ledgers([path]) == Rows()


def test_a_ledger_in_use_is_not_called_damaged(tmp_path, monkeypatch):
    path = tmp_path / "ledger.sqlite"
    with writing_ledger(path) as ledger:
        ledger.put("a", DONE)
    monkeypatch.setattr(ledger_module, "LOCK_TIMEOUT", 0.0)
    with closing(sqlite3.connect(path)) as other:
        other.execute("BEGIN EXCLUSIVE")
        with pytest.raises(UnwritableFileError, match=r"locked.*wait"):
            read_ledgers([path])
        with pytest.raises(UnwritableFileError, match=r"locked.*wait"), writing_ledger(path):
            pass
    assert read_ledgers([path]).shapes == {"a": DONE}


def test_a_damaged_page_of_a_ledger_is_named(tmp_path):
    path = tmp_path / "ledger.sqlite"
    with writing_ledger(path) as ledger:
        for i in range(200):
            ledger.put(str(i), DONE)
    content = bytearray(path.read_bytes())
    content[4096:] = b"x" * (len(content) - 4096)
    path.write_bytes(content)
    with pytest.raises(FormatError, match="cannot"):
        read_ledgers([path])
    with pytest.raises(FormatError, match="not a ledger"), writing_ledger(path):
        pass


def test_what_is_no_ledger_is_refused(tmp_path):
    path = tmp_path / "ledger.sqlite"
    path.write_text("nothing of the kind")
    with pytest.raises(FormatError, match="ledger"), writing_ledger(path):
        pass
    with pytest.raises(FormatError, match="ledger"):
        read_ledgers([path])
    path.unlink()
    with writing_ledger(path) as ledger:
        ledger.put("a", DONE)
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("UPDATE shapes SET record = '{'")
    assert read_ledgers([path]) == Rows(damaged=["the row of a in ledger.sqlite"])


def test_a_full_disk_is_named(tmp_path):
    path = tmp_path / "ledger.sqlite"
    with writing_ledger(path) as ledger:
        ledger.put("a", DONE)
        ledger._connection.execute("PRAGMA max_page_count = 1")
        with pytest.raises(UnwritableFileError, match="database"):
            ledger.put("b", replace(DONE, more={"text": "x" * 100_000}))
    assert set(read_ledgers([path]).shapes) == {"a"}


def test_what_killed_runs_left_is_removed_but_nothing_that_a_shard_may_be_writing(tmp_path):
    layout = Layout(tmp_path)
    (tmp_path / "maps").mkdir()
    new, old = (tmp_path / "maps" / f".isomatch-{name}.unfinished" for name in ("new", "old"))

    def left_by(run, ledgers):
        for name in ledgers:
            (tmp_path / name).touch()
        for file in (new, old):
            file.touch()
        os.utime(old, (0, os.stat(new).st_mtime - 2 * STALE_AGE))
        layout.remove_unfinished(run)
        return {file for file in (new, old) if file.exists()}

    assert left_by((0, 1), ["ledger.sqlite"]) == set()
    assert left_by((0, 1), ["ledger_2_of_2.sqlite"]) == {new}
    (tmp_path / "ledger.sqlite").unlink()
    assert left_by((0, 2), ["ledger_1_of_2.sqlite"]) == {new}


def test_prepared_shapes_stay_in_memory_up_to_so_many_bytes(finished):
    files = sorted((finished / "prepared").iterdir())
    config = Config.from_dict(json.loads((finished / "collection.json").read_text())["config"])
    room = 3 * max(file.stat().st_size for file in files)
    zero, one, two, *again, _, one_again, two_again = (
        load_shape(files[i], config, room) for i in (0, 1, 2, 1, 0, 3, 1, 2)
    )
    assert again == [one, zero]
    assert one_again is one
    assert two_again is not two  # it was not used for longest when three came
    assert load_shape(files[0], config, 1) is not zero
    assert load_shape(files[2], config, 1) is two_again  # those of a pair stay
    assert load_shape(files[1], config, 1) is not one


def test_a_shape_that_was_just_prepared_is_not_read(finished, tmp_path):
    written = sorted((finished / "prepared").iterdir())[0]
    config = Config.from_dict(json.loads((finished / "collection.json").read_text())["config"])
    shape, file = load_shape(written, config), tmp_path / "prepared.npz"
    shape.save(file)
    assert load_shape(file, config, prepared=shape) is shape
    assert load_shape(file, config) is shape
    os.utime(file, (0, 0))
    assert load_shape(file, config) is not shape  # the file was written again


def test_the_medoid_is_the_nearest_to_all_and_does_not_need_their_matrix():
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(5000, 3))
    rows[3210] = 0
    assert medoid(rows) == 3210
    assert medoid(np.array([[0.0, np.nan], [1.0, np.nan], [3.0, np.nan]])) == 1
    assert medoid(np.ones((1, 4))) == 0


def test_a_second_run_is_refused_by_name(copied):
    with claimed(copied.layout.ledger()), pytest.raises(UnwritableFileError, match="another run"):
        next(copied.run("local", 1))
