"""Why something is computed again, in the ledger and in what a run tells."""

import json
from dataclasses import replace

import pytest

import isomatch
from isomatch.cli import main
from isomatch.cohort import Collection, plan
from small_collections import run


def reasons(collection):
    """Of each pair that is matched, what its event and its row say."""
    found = {event.name: event.row.again for event in run(collection) if event.what == "pair"}
    rows = collection.rows().pairs
    assert found == {pair: rows[pair].again for pair in found}
    return found


@pytest.fixture
def other_version(monkeypatch):
    monkeypatch.setattr(plan, "version", lambda name: "99.0")
    plan._settings.cache_clear()
    yield
    plan._settings.cache_clear()


@pytest.mark.long
def test_version(copied, other_version):
    found = reasons(copied)
    assert {*map(tuple, found.values())} == {(f"isomatch {isomatch.__version__} → 99.0",)}
    assert len(found) == 6


@pytest.mark.long
def test_settings_and_seed_by_name(copied):
    """A plan that was changed by hand, and a version with another default, are told alike."""
    search = replace(copied.config.search, flipped=2)
    other = replace(copied, config=replace(copied.config, n_search=120, search=search), seed=1)
    found = reasons(other)
    assert {*map(tuple, found.values())} == {("n_search 100 → 120", "search.flipped 1 → 2", "seed 0 → 1")}
    assert other.rows().shapes["s0"].again == ("n_search 100 → 120", "search.flipped 1 → 2", "seed 0 → 1")


@pytest.mark.long
def test_reflection(small, copied):
    turned = Collection.create(copied.folder, small.shapes, pairs="all", config=small.config, reflect=["s3"])
    pairs = [("s0", "s3"), ("s1", "s3"), ("s2", "s3")]
    assert reasons(turned) == {pair: ("s3 is matched as its mirror image",) for pair in pairs}
    back = replace(turned, reflect=())
    assert reasons(back) == {pair: ("s3 is not matched as its mirror image any more",) for pair in pairs}


@pytest.mark.long
def test_the_command_tells_each_reason_once(small, copied, other_version, in_threads, capsys):
    copied.layout.maps(("s0", "s1")).unlink()
    options = f"--pairs all --config {small.settings} --jobs 1 --reports none --no-agree --json-lines".split()
    assert main(["collect", str(small.shapes), "-o", str(copied.folder), *options]) == 0
    said = capsys.readouterr()
    change = f"isomatch {isomatch.__version__} → 99.0"
    assert f"isomatch: 6 pairs done again, because {change}\n" in said.err
    assert "isomatch: 1 pair done again, because its file is missing\n" in said.err
    stages = [json.loads(line).get("stage", "") for line in said.out.splitlines()]
    assert sum("again, because" in stage and stage.startswith("matched") for stage in stages) == 6
