"""A small collection of creatures with a wrong map: found, replaced, and written so that nothing is done twice."""

import json
import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from isomatch import write_mesh
from isomatch._core.errors import InputError, MemoryBudgetError, UnwritableFileError
from isomatch._core.processes import worker_processes
from isomatch.cli.collect_command import collect
from isomatch.cohort import Collection, PairMaps, Rows, agree, agreement_of
from isomatch.cohort import combine as combine_module
from isomatch.cohort.combine import MAX_INCONSISTENCY, CycleJob
from isomatch.cohort.ledger import MapSummary, PairAgreement, PairRow, ShapeRow, writing_ledger
from isomatch.cohort.map_file import digest_of
from isomatch.datasets import ground_truth
from isomatch.matching import match_both
from isomatch.shapes import PreparedShape
from isomatch_lab.procedural import creature
from small_collections import lines_of, run

pytest.importorskip("skimage")
pytestmark = pytest.mark.usefixtures("small_pictures")
NAMES = ("w", "x", "y", "z")
WRONG = ("w", "y")


@pytest.fixture(scope="module")
def creatures():
    return {
        name: creature(1500, pose=i + 1, kind="biped", symmetric=True, triangulation=i)
        for i, name in enumerate(NAMES)
    }


@pytest.fixture(scope="module")
def right(creatures, tmp_path_factory):
    folder = tmp_path_factory.mktemp("right")
    for name, made in creatures.items():
        write_mesh(folder / f"{name}.ply", made.mesh)
    collection = Collection.create(folder / "all", folder, pairs="all")
    run(collection)
    return collection


@pytest.fixture(scope="module")
def mirrored(right):
    """The best maps of a pair that reverse the orientation, called right by the match that was asked for them."""
    rows = right.rows()
    shapes = [PreparedShape.load(right.layout.prepared(rows.shapes[name].key)) for name in WRONG]
    found = match_both(*shapes, config=replace(right.config, orientation="reverse"))
    there, back = (MapSummary.of(each, settings=True) for each in found)
    record = replace(right.maps(*WRONG).record, forward=there, backward=back)
    return PairMaps(found.source_to_target.map, found.target_to_source.map, record)


@pytest.fixture
def spoilt(right, mirrored, tmp_path):
    """A copy of the collection with the wrong map; its ledger is made from the files."""
    shutil.copytree(right.folder, tmp_path / "all", ignore=shutil.ignore_patterns("ledger*"))
    copy = Collection.open(tmp_path / "all")
    mirrored.save(copy.layout.maps(WRONG))
    run(copy)
    return copy


def agreed(collection):
    with ThreadPoolExecutor(1) as executor:
        return list(agree(collection, executor))


def error(creatures, collection, pair):
    truth = ground_truth(creatures[pair[0]], creatures[pair[1]]).vertices
    points = creatures[pair[1]].rest
    found = collection.maps(*pair).forward.vertices
    return np.linalg.norm(points[found] - points[truth], axis=1).mean()


@pytest.mark.long
def test_right_maps_stay(right, tmp_path):
    shutil.copytree(right.folder, tmp_path / "all")
    copy = Collection.open(tmp_path / "all")
    before = copy.rows()
    assert agreed(copy) == []
    rows = copy.rows()
    assert agreement_of(rows) == (6, [], [], [])
    for pair, row in rows.pairs.items():
        assert row.agreement.inconsistency < MAX_INCONSISTENCY
        assert replace(before.pairs[pair], agreement=row.agreement, time=row.time) == row


@pytest.mark.long
def test_the_wrong_map_is_replaced(spoilt, right, creatures):
    assert error(creatures, spoilt, WRONG) > 0.1
    (event,) = agreed(spoilt)
    assert (event.what, event.name) == ("agreement", WRONG)
    rows = spoilt.rows()
    row = rows.pairs[WRONG]
    assert agreement_of(rows) == (6, [], [WRONG], [])
    assert row.replaced_by in (("w", "x", "y"), ("w", "z", "y"))
    assert row.agreement.before > MAX_INCONSISTENCY > row.agreement.inconsistency
    assert "contradict" in row.forward.notes[0]
    assert error(creatures, spoilt, WRONG) < 1.2 * error(creatures, right, WRONG) + 0.005
    assert error(creatures, spoilt, WRONG[::-1]) < 1.2 * error(creatures, right, WRONG[::-1]) + 0.005
    assert agreed(spoilt) == []
    assert spoilt.rows() == rows
    assert run(spoilt) == []


def test_without_prepared_shapes_nothing_is_compared(tmp_path):
    for name in "abc":
        (tmp_path / f"{name}.ply").write_text("no shape")
    broken = Collection.create(tmp_path / "all", tmp_path, pairs="all")
    assert [event.state for event in run(broken)] == ["failed"] * 3
    assert agreed(broken) == []


@pytest.mark.long
def test_a_shape_whose_row_was_forgotten_is_left_out(spoilt):
    with writing_ledger(spoilt.layout.ledger()) as ledger:
        ledger.put("y", ShapeRow(state="failed", error="gone"))
        ledger.forget("shapes", "y")
    assert agreed(spoilt) == []


@pytest.mark.long
def test_shards_and_agreement_exclude_each_other(spoilt):
    shard = spoilt.layout.ledger((0, 2))
    with writing_ledger(shard), pytest.raises(UnwritableFileError, match="ledger_1_of_2"):
        agreed(spoilt)
    assert agreed(spoilt)


@pytest.mark.long
def test_low_confidence_is_tried_again_where_a_shard_has_the_row_too(spoilt, monkeypatch):
    shutil.copy(spoilt.layout.ledger(), spoilt.layout.ledger((0, 2)))
    monkeypatch.setattr(combine_module, "MAX_PATHS", 0)
    agreed(spoilt)
    assert spoilt.rows().pairs[WRONG].verdict == "low"
    assert spoilt.retry("low") == [WRONG]
    assert spoilt.rows().pairs[WRONG].state == "todo"
    assert spoilt.retry("low") == []


@pytest.mark.long
def test_killed_before_the_row_was_written(spoilt):
    ledger, earlier = spoilt.layout.ledger(), spoilt.folder / "earlier"
    shutil.copy(ledger, earlier)
    agreed(spoilt)
    replaced, stamp = spoilt.rows().pairs[WRONG], spoilt.layout.maps(WRONG).stat().st_mtime_ns
    shutil.copy(earlier, ledger)
    assert agreed(spoilt) == []
    row = spoilt.rows().pairs[WRONG]
    assert spoilt.layout.maps(WRONG).stat().st_mtime_ns == stamp
    assert row.replaced_by == replaced.replaced_by
    assert row.forward == replaced.forward


@pytest.mark.long
def test_killed_before_the_row_of_a_newer_version_was_written(spoilt):
    """The map file has another key than the row, which says that its map was replaced: no reason for an error."""
    agreed(spoilt)
    with writing_ledger(spoilt.layout.ledger()) as ledger:
        ledger.put(
            WRONG, replace(ledger.rows.pairs[WRONG], key="of an older version", replaced_by=("w", "x", "y"))
        )
    assert agreed(spoilt) == []
    assert [event.name for event in run(spoilt)] == [WRONG]


@pytest.mark.long
def test_what_stays_contradicted_has_low_confidence(spoilt, monkeypatch):
    own = spoilt.rows().pairs[WRONG].ending
    assert own != "LOW_CONFIDENCE"
    with monkeypatch.context() as patched:
        patched.setattr(combine_module, "MAX_PATHS", 0)
        assert agreed(spoilt) == []
    rows = spoilt.rows()
    assert agreement_of(rows).contradicted == [WRONG]
    assert rows.pairs[WRONG].ending == "LOW_CONFIDENCE"
    assert rows.pairs[WRONG].agreement.outcomes[0] == own
    agreed(spoilt)
    assert spoilt.rows().pairs[WRONG].ending != "LOW_CONFIDENCE"


@pytest.mark.long
def test_a_contradicted_map_gives_way_when_it_is_tried_again(spoilt, mirrored, monkeypatch, creatures):
    values = mirrored.record.forward.values
    measures = {**values["quality"], "spectral_residual": 0.0}
    there = MapSummary({**values, "outcome": "CONVERGED", "quality": measures})
    sure = replace(mirrored.record, forward=there)
    file = spoilt.layout.maps(WRONG)
    replace(mirrored, record=sure).save(file)
    with writing_ledger(spoilt.layout.ledger()) as ledger:
        ledger.put(WRONG, replace(ledger.rows.pairs[WRONG], file=digest_of(file)))
    monkeypatch.setattr(combine_module, "MAX_PATHS", 0)
    agreed(spoilt)
    assert agreement_of(spoilt.rows()).contradicted == [WRONG]
    assert spoilt.retry("low") == [WRONG]
    (event,) = run(spoilt)
    assert event.name == WRONG
    assert error(creatures, spoilt, WRONG) < 0.1
    agreed(spoilt)
    assert agreement_of(spoilt.rows()).contradicted == []


@pytest.mark.long
def test_a_star_has_no_triangles(right, in_threads, tmp_path):
    (tmp_path / "all" / "maps").mkdir(parents=True)
    shutil.copytree(right.folder / "prepared", tmp_path / "all" / "prepared")
    shapes = [entry.path for entry in right.shapes]
    for name in "xyz":
        shutil.copy(right.layout.maps(("w", name)), tmp_path / "all" / "maps")
    star = Collection.create(tmp_path / "all", shapes, pairs="star", template="w")
    run(star)
    before = star.rows()
    assert agreed(star) == []
    assert star.rows() == before
    assert agreement_of(before).compared == 0
    with pytest.raises(InputError, match="no three shapes"):
        command_line("agree", star.folder, "--jobs", 1)


@pytest.mark.long
def test_too_many_triangles_are_refused_and_the_command_goes_on(
    right, in_threads, tmp_path, monkeypatch, capsys
):
    shutil.copytree(right.folder, tmp_path / "all")
    copy = Collection.open(tmp_path / "all")
    monkeypatch.setenv("ISOMATCH_MEMORY_BUDGET", "0.000001")
    with pytest.raises(MemoryBudgetError, match="maps of 4 shapes"):
        agreed(copy)
    monkeypatch.setenv("ISOMATCH_MEMORY_BUDGET", "1")
    monkeypatch.setattr(combine_module, "TRIANGLE_BYTES", 2**40)
    assert agreement_of(copy.rows()).compared == 0
    files = [entry.path for entry in right.shapes]
    listed = tmp_path / "list.csv"
    listed.write_text("\n".join(["path", *map(str, files)]))
    command_line(
        listed, "-o", copy.folder, "--pairs", "all", "--jobs", 1, "--reports", "none", "--seed", copy.seed
    )
    assert "maps were not compared" in capsys.readouterr().err
    assert copy.layout.page.exists()


def test_only_shapes_in_triangles_are_compared():
    names = "abcdef"
    rows = Rows(
        {name: ShapeRow(state="done", key=name) for name in names},
        {tuple(pair): PairRow(state="done") for pair in ("ab", "bc", "ca", "cd", "de")}
        | {("e", "c"): PairRow(state="failed")},
    )
    assert combine_module._names_in_triangles(rows) == ["a", "b", "c"]


def test_shapes_that_are_mirrored_together_are_named():
    def row(pair):
        side = -0.9 if "m" in pair else 0.9
        there, agreement = MapSummary({"quality": {"orientation": side}}), PairAgreement(inconsistency=0.02)
        return PairRow(state="done", forward=there, agreement=agreement)

    names = ("a", "b", "m", "n")
    rows = Rows(pairs={(a, b): row((a, b)) for i, a in enumerate(names) for b in names[i + 1 :]})
    assert agreement_of(rows).turned == ["m"]
    assert agreement_of(rows).contradicted == []


@pytest.mark.long
def test_jobs_travel_to_processes(right):
    job = CycleJob(right, {name: row.key for name, row in right.rows().shapes.items()})
    here = job.images(WRONG)
    with worker_processes(1) as executor:
        there = executor.submit(job.images, WRONG).result()
    np.testing.assert_array_equal(here[0], there[0])


def command_line(*words):
    command, bound, _ = collect.parse_args([str(word) for word in words], exit_on_error=False)
    command(*bound.args, **bound.kwargs)


@pytest.mark.long
def test_command_replaces_and_tells(spoilt, in_threads, capsys):
    command_line("agree", spoilt.folder, "--jobs", 1, "--json")
    said = json.loads(capsys.readouterr().out)["agreement"]
    assert said == {"compared": 6, "contradicted": [], "replaced": [list(WRONG)], "turned": []}
    lines = {(line["source"], line["target"]): line for line in lines_of(spoilt.layout.table)}
    assert lines[WRONG]["replaced_by"] in ("w > x > y", "w > z > y")
    assert (
        float(lines[WRONG]["inconsistency_before"]) > MAX_INCONSISTENCY > float(lines[WRONG]["inconsistency"])
    )


@pytest.mark.long
def test_all_pairs_are_made_to_agree_unless_refused(spoilt, in_threads, capsys):
    shapes = spoilt.folder.parent / "list.csv"
    shapes.write_text("path\n" + "".join(f"{entry.path}\n" for entry in spoilt.shapes))
    words = (shapes, "-o", spoilt.folder, "--pairs", "all", "--jobs", 1, "--json")
    command_line(*words, "--no-agree")
    assert json.loads(capsys.readouterr().out)["agreement"]["compared"] == 0
    command_line(*words)
    assert json.loads(capsys.readouterr().out)["agreement"]["replaced"] == [list(WRONG)]


@pytest.mark.long
def test_maps_of_a_shape_that_was_lost_are_left_out(right, tmp_path):
    shutil.copytree(right.folder, tmp_path / "all")
    shapes = []
    for entry in right.shapes:
        shapes.append(tmp_path / entry.path.name)
        shutil.copy(entry.path, shapes[-1])
    shapes[0].write_text("ply\n")
    copy = Collection.create(tmp_path / "all", shapes, pairs="all")
    run(copy)
    assert copy.rows().shapes["w"].state == "failed"
    agreed(copy)
    assert agreement_of(copy.rows()).compared == 3
