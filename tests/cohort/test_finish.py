"""What a run leaves to look at and to work with: surfaces, reports, the page, files for other programs."""

import json
import re
import shutil
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

import isomatch
from isomatch import (
    Correspondence,
    FormatError,
    InputError,
    Outcome,
    SettingError,
    UnwritableFileError,
    read_mesh,
)
from isomatch.cli import main
from isomatch.cohort import Collection, export, finish, surfaces_written, write_reports
from isomatch.cohort.ledger import MapSummary, PairAgreement, writing_ledger
from isomatch.datasets import example_pair
from isomatch.decimation import decimate
from small_collections import N, finished_names, run

finish_module = import_module("isomatch.cohort.finish")  # the subpackage's public name is the function

PAIR = ("s0", "s1")


def reported(collection, which="doubtful"):
    with ThreadPoolExecutor(1) as executor:
        return [(pair, error) for pair, error in write_reports(collection, which, executor, 1)]


def changed(collection, pair, **values):
    with writing_ledger(collection.layout.ledger()) as ledger:
        ledger.put(pair, replace(ledger.rows.pairs[pair], **values))


@pytest.fixture(scope="module")
def star(small, tmp_path_factory):
    """A star that is finished; not to be changed."""
    folder = tmp_path_factory.mktemp("star")
    collection = Collection.create(folder, small.shapes, template="s0", config=small.config)
    run(collection)
    assert sorted(finished_names(collection)) == ["s0", "s1", "s2", "s3"]
    return collection


def test_reports_of_the_pairs_in_doubt_and_of_the_three_next(copied, plain_reports):
    rows = copied.rows().pairs
    for pair, row in rows.items():
        outcome = Outcome.CONVERGED if pair != PAIR else Outcome.SYMMETRY_AMBIGUOUS
        changed(copied, pair, forward=row.forward.with_outcome(outcome))
    others = [pair for pair in rows if pair != PAIR]
    worst = sorted(others, key=lambda pair: -rows[pair].forward.measures["spectral_residual"])[:3]
    assert set(reported(copied)) == {(pair, "") for pair in (PAIR, *worst)}
    assert reported(copied) == []


@pytest.mark.long
def test_a_report_shows_the_map_that_is_kept(copied):
    row = copied.rows().pairs[PAIR]
    there = row.forward.with_outcome(Outcome.LOW_CONFIDENCE)
    changed(copied, PAIR, forward=there, agreement=PairAgreement(inconsistency=0.31))
    assert reported(copied, 1) == [(PAIR, "")]
    text = copied.layout.report(PAIR).read_text()
    assert "<td>low confidence</td>" in text
    assert "contradict it by 0.31 √area" in text
    assert f"{copied.paths['s0']} {copied.paths['s1']} -o DIR" in text


@pytest.fixture
def plain_reports(monkeypatch):
    """Reports that take no time."""
    monkeypatch.setattr(
        "isomatch.visualization.write_report", lambda path, *_, **__: path.write_text("a report")
    )


@pytest.mark.long
def test_only_reports_of_present_maps_are_linked(copied, plain_reports):
    def links():
        finished_names(copied)
        return set(re.findall(r'href="(reports/[^"]*)"', copied.layout.page.read_text()))

    assert len(reported(copied, 2)) == 2
    assert len(links()) == 2
    assert all((copied.folder / link).exists() for link in links())
    for pair in copied.rows().pairs:
        changed(copied, pair, time=time.time() + 100)  # as if their maps were new
    assert links() == set()
    assert len(reported(copied, "all")) == len(copied.rows().pairs)


def test_a_report_that_cannot_be_written_is_told(copied, plain_reports):
    copied.layout.maps(PAIR).unlink()
    assert "no such file" in dict(reported(copied, "all"))[PAIR]


@pytest.mark.long
def test_a_surface_is_written_again_when_its_map_is_replaced(star, tmp_path):
    collection = Collection.open(shutil.copytree(star.folder, tmp_path / "star"))
    assert finished_names(collection) == []
    changed(collection, PAIR, replaced_by=("s0", "s2", "s1"))
    assert surfaces_written(collection) == ["s0", "s2", "s3"]
    assert finished_names(collection) == ["s1"]


@pytest.mark.long
def test_a_template_that_changed_is_read_again(small, tmp_path):
    shapes = [shutil.copy(path, tmp_path) for path in sorted(small.shapes.iterdir())[:2]]
    collection = Collection.create(tmp_path / "out", shapes, template="s0", config=small.config)
    for n in (N[0], 150):
        isomatch.write_mesh(shapes[0], decimate(example_pair()[0].mesh, n).mesh)
        run(collection)
        assert set(finished_names(collection)) == {"s0", "s1"}
        written = [collection.layout.corresponded(name) for name in ("s0", "s1")]
        assert [isomatch.read_mesh(path).n_vertices for path in written] == [n, n]


@pytest.mark.long
def test_surfaces_that_were_written_are_known_though_the_rest_was_killed(copied, monkeypatch):
    monkeypatch.setattr(finish_module, "SAVE_INTERVAL", 0.0)
    monkeypatch.setattr(finish_module, "SURFACES_PER_TASK", 1)
    collection = replace(copied, template="s0")
    with ThreadPoolExecutor(1) as executor:
        begun = finish(collection, executor, 1)
        first = [next(begun).name, next(begun).name]
        begun.close()
    assert set(surfaces_written(collection)) >= set(first[:1])
    assert not set(finished_names(collection)) & set(first[:1])


def test_no_surface_is_begun_when_time_is_up(copied):
    collection = replace(copied, template="s0")
    with ThreadPoolExecutor(1) as executor:
        assert list(finish(collection, executor, 1, time_limit=0.0)) == []
    assert len(finished_names(collection)) == len(N)


@pytest.mark.long
def test_export(star, tmp_path):
    files = [path for path, _ in export(star, tmp_path, ".obj")]
    assert len(files) == 4 + 6 + 1
    meshes = {name: read_mesh(tmp_path / "meshes" / f"{name}.obj") for name in star.names}
    for name, mesh in meshes.items():
        assert mesh.faces.tolist() == meshes["s0"].faces.tolist()
        assert mesh.vertices.tolist() == read_mesh(star.layout.corresponded(name)).vertices.tolist()
    for pair in (PAIR, PAIR[::-1]):
        found = Correspondence.load(tmp_path / "maps" / f"{'__'.join(pair)}.npz")
        assert np.array_equal(found.vertices, star.maps(*pair).forward.vertices)
    assert len((tmp_path / "pairs.csv").read_text().splitlines()) == 4
    with pytest.raises(UnwritableFileError, match="already exists"):
        list(export(star, tmp_path))
    assert len(list(export(star, tmp_path, None, ".txt", force=True))) == 6 + 1
    vertices = np.loadtxt(tmp_path / "maps" / "s0__s1.txt", dtype=int)
    assert np.array_equal(vertices, star.maps(*PAIR).forward.vertices)


def test_export_refuses_what_would_not_correspond_and_what_is_not_there(small, star, tmp_path):
    with pytest.raises(FormatError, match="do not keep the order"):
        next(export(star, tmp_path / "out", ".stl"))
    empty = Collection.create(tmp_path / "empty", small.shapes, config=small.config)
    with pytest.raises(InputError, match="nothing to export"):
        next(export(empty, tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_export_never_writes_over_the_collection_or_what_it_did_not_ask_for(star, tmp_path):
    for force in (False, True):
        with pytest.raises(InputError, match="collection"):
            next(export(star, star.folder / ".." / star.folder.name, force=force))
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "s0__s1.npz").write_text("of an export that was ended")
    with pytest.raises(UnwritableFileError, match="already exists"):
        list(export(star, tmp_path))


def test_a_surface_that_could_not_be_written_is_tried_again(star, tmp_path, monkeypatch):
    collection = Collection.open(shutil.copytree(star.folder, tmp_path / "star"))
    changed(collection, PAIR, replaced_by=("s0", "s2", "s1"))
    with monkeypatch.context() as broken:
        broken.setattr(finish_module, "wrap", lambda *_: 1 / 0)
        assert finished_names(collection) == ["s1"]
    assert surfaces_written(collection) == ["s0", "s2", "s3"]
    assert finished_names(collection) == ["s1"]
    assert "s1" in surfaces_written(collection)


def test_the_page_does_not_call_failed_what_is_to_be_matched_again(copied):
    changed(copied, PAIR, state="todo", forward=MapSummary())
    finished_names(copied)
    assert "6 pairs: 5 converged, 1 todo." in copied.layout.page.read_text(encoding="utf-8")


def test_a_number_of_reports_is_not_negative(copied):
    with pytest.raises(SettingError, match="-3 reports"):
        reported(copied, -3)


def test_a_map_that_was_contradicted_stays_so_when_its_match_fails(copied):
    changed(copied, PAIR, state="failed", error="no luck", attempt=1, contradicted=True)
    assert copied.retry("failed") == [PAIR]
    assert copied.rows().pairs[PAIR].contradicted


def test_the_status_of_a_collection_that_was_not_run(small, tmp_path, capsys):
    Collection.create(tmp_path, small.shapes, config=small.config)
    assert main(["collect", "status", str(tmp_path)]) == 0
    assert "0 of 4 shapes prepared\ntemplate not yet chosen" in capsys.readouterr().out


def test_the_command_line_exports(star, tmp_path, capsys):
    assert (
        main(["collect", "export", str(star.folder), str(tmp_path / "out"), "--format", "vtp", "--json"]) == 0
    )
    said = json.loads(capsys.readouterr().out)
    assert said == {"folder": str(tmp_path / "out"), "meshes": 4, "maps": 6, "left_out": [], "not_kept": {}}
    assert main(["collect", "export", str(star.folder), str(tmp_path / "out"), "--format", "doc"]) == 1
    assert "is not a mesh format" in capsys.readouterr().err
