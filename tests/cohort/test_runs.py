"""What a run does, and what it does not do again."""

import json
import logging
import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import combinations

import pytest

import isomatch
from isomatch import Outcome, SettingError
from isomatch._core.errors import InputError
from isomatch._core.skipped import telling_once
from isomatch.cli import Talk, main
from isomatch.cli.collect_state import say_cohort
from isomatch.cohort import Cohort, Collection, plan
from isomatch.cohort import jobs as jobs_module
from isomatch.cohort.jobs import Event
from isomatch.cohort.ledger import PairRow, Rows, ShapeRow, writing_ledger
from isomatch.cohort.run import follow
from isomatch.cohort.study_page import write_table
from isomatch.cohort.workers import Listener
from isomatch.datasets import example_pair
from isomatch.decimation import decimate
from small_collections import N, arrays_of, lines_of, run

PAIRS = set(combinations([f"s{i}" for i in range(len(N))], 2))
BAD = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"


class Work:
    """What has been prepared and matched since: files that are new or were written again."""

    def __init__(self, collection):
        self.folder = collection.folder
        self.before = self._files()

    def _files(self):
        files = [path for name in ("prepared", "maps") for path in (self.folder / name).glob("*.npz")]
        return {path: path.stat().st_mtime_ns for path in files}

    def done(self):
        """How many shapes were prepared, and the pairs that were matched."""
        written = [path for path, time in self._files().items() if self.before.get(path) != time]
        maps = {tuple(path.stem.split("__")) for path in written if path.parent.name == "maps"}
        return len(written) - len(maps), maps


NOTHING = 0, set()


def test_a_run_matches_all_pairs_and_the_next_one_nothing(copied):
    rows, work = copied.rows(), Work(copied)
    assert set(rows.pairs) == PAIRS
    assert run(copied) == []
    assert work.done() == NOTHING
    maps = copied.maps("s0", "s1")
    assert maps.forward.shape == (N[0], N[1])
    turned = copied.maps("s1", "s0")
    assert (turned.forward.shape, turned.record) == ((N[1], N[0]), maps.record)
    row = rows.pairs["s0", "s1"]
    keys = {"key", "seconds", "memory", "there", "back", "source_hash", "target_hash", "attempt"}
    assert keys <= set(row.to_json())
    assert row.forward.measures["spectral_residual"] == maps.record.forward.measures["spectral_residual"]


def test_what_is_whole_on_disk_is_recorded_without_being_done_again(copied):
    before, work = copied.rows(), Work(copied)
    copied.layout.ledger().unlink()
    assert len(run(copied)) == len(N) + len(PAIRS)
    assert work.done() == NOTHING
    after = copied.rows()
    for pair, row in before.pairs.items():
        assert replace(after.pairs[pair], time=row.time) == row


@pytest.mark.long
def test_a_file_that_is_lost_or_cut_short_is_made_again(copied):
    expected = arrays_of(copied.folder)
    copied.layout.maps(("s0", "s2")).unlink()
    cut = copied.layout.maps(("s1", "s3"))
    cut.write_bytes(cut.read_bytes()[:-50])
    copied.layout.ledger().unlink()  # which would vouch for the second
    work = Work(copied)
    run(copied)
    assert work.done() == (0, {("s0", "s2"), ("s1", "s3")})
    assert arrays_of(copied.folder) == expected


@pytest.mark.long
def test_a_shape_that_changed_is_done_again_with_its_pairs_only(small, copied, tmp_path, caplog):
    work = Work(copied)
    shapes = [tmp_path / f"s{i}.ply" for i in range(len(N))]
    for path in shapes:
        path.write_bytes((small.shapes / path.name).read_bytes())
    collection = Collection.create(copied.folder, shapes, pairs="all", config=small.config)
    run(collection)
    assert work.done() == NOTHING  # other files with the same contents
    isomatch.write_mesh(shapes[2], decimate(example_pair()[0].mesh, 300).mesh)
    pairs = {("s0", "s2"), ("s1", "s2"), ("s2", "s3")}
    with caplog.at_level(logging.INFO, "isomatch"):
        events = run(collection)
    reason = ("the contents of s2 changed",)
    assert {event.name: event.row.again for event in events} == dict.fromkeys(["s2", *pairs], reason)
    rows = collection.rows()
    assert {row.again for row in (rows.shapes["s2"], *(rows.pairs[pair] for pair in pairs))} == {reason}
    assert "s0 and s2: again, because the contents of s2 changed" in caplog.text
    assert work.done() == (1, pairs)


@pytest.mark.long
def test_a_shape_that_is_added(small, copied, tmp_path):
    work = Work(copied)
    isomatch.write_mesh(tmp_path / "new.ply", decimate(example_pair()[0].mesh, 250).mesh)
    shapes = [*sorted(small.shapes.iterdir()), tmp_path / "new.ply"]
    collection = Collection.create(copied.folder, shapes, pairs="all", config=small.config)
    events = run(collection)
    assert {event.name: event.row.again for event in events if event.what == "pair"} == {
        (f"s{i}", "new"): () for i in range(len(N))
    }
    assert len(events) == 1 + len(N)
    assert work.done() == (1, {(f"s{i}", "new") for i in range(len(N))})


@pytest.mark.long
def test_the_template_of_a_star_stays_when_shapes_are_added(small, tmp_path, monkeypatch):
    files = sorted(small.shapes.iterdir())
    few = Collection.create(tmp_path, files[:3], config=small.config)
    run(few)
    first = few.chosen_template(few.rows())
    monkeypatch.setattr(plan, "medoid", lambda features: len(features) - 1)
    more = Collection.create(tmp_path, files, config=small.config)
    assert [event.name for event in run(more)] == ["s3", (first, "s3")]
    assert more.chosen_template(more.rows()) == first


def test_the_template_of_many_shapes_is_found_without_comparing_all_with_all(tmp_path):
    compared = []

    class Name(str):
        """A name that tells what it is compared with."""

        __hash__ = str.__hash__

        def __eq__(self, other):
            compared.append(other)
            return str.__eq__(self, other)

    names = [f"s{i:03}" for i in range(500)]
    for name in names:
        (tmp_path / f"{name}.off").touch()
    star = Collection.create(tmp_path / "out", [tmp_path / f"{name}.off" for name in names])
    rows = Rows(
        shapes={name: ShapeRow(state="done") for name in names},
        pairs={(Name("s250"), name): PairRow(state="done") for name in names if name != "s250"},
    )
    compared.clear()
    assert star.chosen_template(rows) == "s250"
    assert len(compared) <= 4 * len(names)


@pytest.mark.long
def test_a_failure_is_a_row_with_its_reason_and_can_be_tried_again(small, tmp_path, monkeypatch):
    shapes = [small.shapes / "s0.ply", small.shapes / "s1.ply", tmp_path / "bad.off", tmp_path / "gone.ply"]
    shapes[2].write_text(BAD)
    collection = Collection.create(tmp_path / "c", shapes, pairs="all", config=small.config)

    def broken(*given, **options):
        raise RuntimeError("no luck")

    with monkeypatch.context() as patch:
        patch.setattr(jobs_module, "match_both", broken)
        run(collection)
    rows = collection.rows()
    assert rows.pairs["s0", "s1"].error == "RuntimeError: no luck"
    assert "at least 50 are needed" in rows.shapes["bad"].error
    assert "no such file" in rows.shapes["gone"].error
    assert [event.name for event in run(collection)] == ["gone"]  # it may have come meanwhile
    isomatch.write_mesh(shapes[2], isomatch.read_mesh(small.shapes / "s2.ply"))
    assert collection.retry("failed") == [("s0", "s1")]
    again = {event.name for event in run(collection)}
    assert again == {"bad", "gone", ("s0", "s1"), ("s0", "bad"), ("s1", "bad")}
    assert {row.state for row in collection.rows().pairs.values()} == {"done"}


@pytest.mark.long
def test_low_confidence_is_tried_with_another_seed_and_the_surer_map_is_kept(copied):
    pair = ("s0", "s1")
    low = copied.maps(*pair)
    with writing_ledger(copied.layout.ledger()) as ledger:
        row = ledger.rows.pairs[pair]
        ledger.put(pair, replace(row, forward=row.forward.with_outcome(Outcome.LOW_CONFIDENCE)))
    before = arrays_of(copied.folder)
    assert copied.retry("low") == [pair]
    assert [event.name for event in run(copied)] == [pair]
    assert copied.rows().pairs[pair].attempt == 1
    assert low.record.forward.outcome is Outcome.CONVERGED  # so that the map on disk is at least as sure
    assert (
        copied.rows().pairs[pair].forward.measures["spectral_residual"]
        <= row.forward.measures["spectral_residual"]
    )
    assert set(arrays_of(copied.folder)) == set(before)
    assert run(copied) == []


@pytest.mark.long
def test_the_map_of_a_shape_as_it_was_is_not_kept(small, copied, tmp_path):
    """Pairs that were tried again keep the surer map, but not one of a surface that has changed since."""
    shapes = [shutil.copy(path, tmp_path) for path in sorted(small.shapes.iterdir())]
    collection = Collection.create(copied.folder, shapes, pairs="all", config=small.config)
    with writing_ledger(copied.layout.ledger()) as ledger:
        for pair, row in list(ledger.rows.pairs.items()):
            ledger.put(pair, replace(row, attempt=1, key="of the second attempt"))
    isomatch.write_mesh(shapes[0], decimate(example_pair()[0].mesh, 150).mesh)
    run(collection)
    there = collection.maps("s0", "s1").forward
    assert there.shape == (150, N[1])
    assert collection.rows().pairs["s0", "s1"].source_hash == collection.rows().shapes["s0"].hash


def test_shapes_in_another_order_are_the_same_pairs(small, copied):
    work, backwards = Work(copied), sorted(small.shapes.iterdir(), reverse=True)
    assert run(Collection.create(copied.folder, backwards, pairs="all", config=small.config)) == []
    assert work.done() == NOTHING


def test_of_a_shape_that_was_removed_nothing_is_told(small, copied):
    fewer = sorted(small.shapes.iterdir())[:3]
    collection = Collection.create(copied.folder, fewer, pairs="all", config=small.config)
    assert run(collection) == []
    rows = collection.rows()
    assert set(rows.shapes) == {"s0", "s1", "s2"}
    assert set(rows.pairs) == {("s0", "s1"), ("s0", "s2"), ("s1", "s2")}


@pytest.mark.long
def test_a_collection_stays_where_it_is_when_the_working_directory_changes(small, tmp_path, monkeypatch):
    monkeypatch.chdir(small.folder)
    made = Collection.create("relative", "shapes/*.ply", pairs="chain", config=small.config)
    monkeypatch.chdir(tmp_path)
    assert {event.state for event in run(made)} == {"done"}
    assert made.folder == small.folder / "relative"
    monkeypatch.chdir(small.folder)
    opened = Collection.open("relative")
    monkeypatch.chdir(tmp_path)
    assert len(opened.rows().pairs) == len(N) - 1


@pytest.mark.parametrize("shard", [(8, 8), (-1, 2), (0, 0)])
def test_a_shard_that_there_is_not(shard, copied):
    with pytest.raises(InputError, match="from 0"):
        copied.run(shard=shard)


@pytest.mark.parametrize("count", [0, -1])
def test_a_number_of_jobs_below_one(count, copied):
    with pytest.raises(InputError, match="from 1"):
        list(copied.run(jobs=count))


def test_a_plan_that_is_the_same_stays_as_it_is(small, copied):
    """Another shard may be reading it."""
    before = copied.layout.plan.stat()
    shapes = [entry.path for entry in copied.shapes]
    Collection.create(copied.folder, shapes, pairs="all", config=small.config)
    assert copied.layout.plan.stat() == before


@pytest.mark.parametrize(("name", "value"), [("seed", "zero"), ("seed", -1), ("shapes", {"../x": "a.ply"})])
def test_a_damaged_plan_is_refused(copied, name, value):
    plan = json.loads(copied.layout.plan.read_text())
    copied.layout.plan.write_text(json.dumps({**plan, name: value}))
    with pytest.raises(isomatch.FormatError, match="not the plan of a collection"):
        Collection.open(copied.folder)
    copied.layout.plan.unlink()
    with pytest.raises(isomatch.FormatError, match="holds no collection"):
        Collection.open(copied.folder)


def test_failed_pairs_are_not_said_to_be_done(copied, capsys):
    with writing_ledger(copied.layout.ledger()) as ledger:
        ledger.put(("s1", "s3"), replace(ledger.rows.pairs["s1", "s3"], state="failed", error="no luck"))
    assert main(["collect", "status", str(copied.folder)]) == 3
    said = capsys.readouterr()
    assert f"{len(PAIRS) - 1} of {len(PAIRS)} pairs matched, 1 failed" in said.out
    assert "1 shape or pair failed: s1 and s3; the rest is in" in said.err


def test_outcomes_that_are_refused_are_another_exit_code_than_failures(copied):
    found = Cohort.open(copied.folder)
    (ending,) = {row.ending for row in copied.rows().pairs.values()}
    say_cohort(found, Talk(quiet=True), tuple(each for each in isomatch.Outcome if each.name != ending))
    with pytest.raises(isomatch.NotConvergedError, match=f"{len(PAIRS)} of the maps"):
        say_cohort(found, Talk(quiet=True), (isomatch.Outcome[ending],))


def test_a_strict_run_ends_with_the_first_failure(copied):
    failed = replace(copied.rows().pairs["s1", "s3"], state="failed", error="no luck")
    events = [Event("pair", ("s1", "s3"), failed, 1, 2)]
    follow(events, Listener.of(None, None))
    with telling_once(strict=True), pytest.raises(isomatch.InputError, match="s1 and s3, failed: no luck"):
        follow(events, Listener.of(None, None))


def test_a_folder_with_other_settings_is_refused(small, copied):
    other = isomatch.Config.from_dict({**small.config.to_dict(), "n_refine": 150})
    for options, name in (
        ({"config": other}, "n_refine"),
        ({"seed": 1}, "seed"),
        ({"pairs": "star"}, "pairs"),
        ({"template": "s1"}, "template"),
    ):
        given = {"config": small.config, "pairs": "all", **options}
        with pytest.raises(SettingError, match=f"other {name}"):
            Collection.create(copied.folder, small.shapes, **given)


@pytest.mark.long
def test_a_time_limit_ends_between_pairs_and_the_next_run_continues(small, copied):
    for path in (copied.folder / "maps").iterdir():
        path.unlink()
    assert run(copied, time_limit=0) == []
    seen = [event.name for event in run(copied, time_limit=0.1)]
    assert len(seen) < len(PAIRS)
    seen += [event.name for event in run(copied)]
    assert sorted(seen) == sorted(PAIRS)


@pytest.mark.long
def test_shards_need_only_their_own_shapes_and_make_a_whole(small, finished, tmp_path):
    collection = Collection.create(
        tmp_path / "c", small.shapes, pairs="star", template="s0", config=small.config
    )
    parts, done = [], []
    for i in range(3):
        work = Work(collection)
        parts.append(run(collection, shard=(i, 3)))
        done.append((work.done()[0], len(work.done()[1])))
    assert [len(part) for part in parts] == [3, 2, 2]
    assert done == [(2, 1), (1, 1), (1, 1)]  # the template and one shape, which the others find prepared
    assert sorted(path.name for path in collection.layout.ledgers()) == [
        f"ledger_{i}_of_3.sqlite" for i in (1, 2, 3)
    ]
    assert run(collection) == []  # all in one is done, too
    expected = arrays_of(finished)
    assert arrays_of(collection.folder) == {name: expected[name] for name in arrays_of(collection.folder)}


@pytest.mark.long
def test_two_shards_at_once(small, finished, tmp_path, capsys):
    collection = Collection.create(tmp_path, small.shapes, pairs="all", config=small.config)
    with ThreadPoolExecutor(2) as both:
        parts = list(both.map(lambda i: run(collection, shard=(i, 2)), range(2)))
    assert sorted(event.name for part in parts for event in part if event.what == "pair") == sorted(PAIRS)
    assert arrays_of(tmp_path) == arrays_of(finished)
    assert main(["collect", "status", str(tmp_path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["pairs"] == {"all": len(PAIRS), "done": len(PAIRS)}
    assert len(collection.layout.table.read_text().splitlines()) == 1 + len(PAIRS)


def test_the_table_has_a_line_for_each_pair_worst_first(copied):
    with writing_ledger(copied.layout.ledger()) as ledger:
        ledger.put(("s1", "s3"), replace(ledger.rows.pairs["s1", "s3"], state="failed", error="no luck"))
    write_table(copied.rows(), copied.layout.table)
    first, *others = lines_of(copied.layout.table)
    assert (first["source"], first["target"], first["error"]) == ("s1", "s3", "no luck")
    assert {(line["source"], line["target"]) for line in others} == PAIRS - {("s1", "s3")}
    spectral_residuals = [float(line["spectral_residual"]) for line in others]
    assert spectral_residuals == sorted(spectral_residuals, reverse=True)
    parquet = pytest.importorskip("pyarrow.parquet")
    assert parquet.read_table(copied.layout.table.with_suffix(".parquet")).num_rows == len(PAIRS)


@pytest.mark.long
def test_the_command_line_continues_tells_and_tries_again(small, copied, capsys):
    def said(*argv):
        assert main(["collect", *argv, "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    again = [str(small.shapes), "-o", str(copied.folder), "--pairs", "all", "--config", str(small.settings)]
    again += ["--reports", "none"]
    status = said(*again, "--jobs", "1")
    assert status["pairs"] == {"all": len(PAIRS), "done": len(PAIRS)}
    assert status == said("status", str(copied.folder))
    assert said("retry", "failed", str(copied.folder)) == {"pairs": []}
    for shard in ("0/2", "3/2", "1", "a/b"):
        assert main(["collect", *again, "--shard", shard]) == 1
        assert "is not i/n" in capsys.readouterr().err
    assert main(["collect", *again, "--seed", "3"]) == 1
    assert "holds a collection with other seed" in capsys.readouterr().err
