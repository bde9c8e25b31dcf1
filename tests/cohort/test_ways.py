"""Surfaces in the template's topology by all ways that lead to a shape, of a made cohort with known truth."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from isomatch import Correspondence, Outcome, read_mesh, wrap, write_mesh
from isomatch.cohort import Collection, PairMaps, surfaces_written
from isomatch.cohort.ledger import writing_ledger
from small_collections import finished_names, lines_of, lopsided_blob, run

NAMES = tuple("abcdef")
NOISE = 0.15  # of the radius: how far maps slide, there more and here less


@pytest.fixture(scope="module")
def cohort(small, tmp_path_factory):
    """Six blobs, vertex i of one on vertex i of every other, all pairs matched by the truth with a slide of its own."""
    folder = tmp_path_factory.mktemp("cohort")
    for seed, name in enumerate(NAMES):
        write_mesh(folder / f"{name}.ply", lopsided_blob(3, seed, 0.1))
    collection = Collection.create(folder / "all", folder, pairs="all", template="a", config=small.config)
    run(collection)
    rng = np.random.default_rng(0)
    meshes = {name: read_mesh(path) for name, path in collection.paths.items()}
    with writing_ledger(collection.layout.ledger()) as ledger:
        for pair, row in ledger.rows.pairs.items():
            there, back = (side.with_outcome(Outcome.CONVERGED) for side in row.sides)
            ledger.put(pair, replace(row, forward=there, backward=back))
            record = collection.maps(*pair).record
            maps = [slid(meshes[source], meshes[target], rng) for source, target in (pair, pair[::-1])]
            PairMaps(*maps, record).save(collection.layout.maps(pair))
    finished_names(collection)
    return collection


@pytest.fixture
def copied(cohort, tmp_path):
    """A copy of the cohort."""
    return Collection.open(shutil.copytree(cohort.folder, tmp_path / "all"))


def slid(source, target, rng):
    """The true map, with images that slide along the target."""
    waves = np.sin(target.vertices @ rng.standard_normal((3, 3)) + rng.uniform(0, 2 * np.pi, 3))
    nearest = cKDTree(target.vertices).query(target.vertices + NOISE * waves)[1]
    return Correspondence(
        nearest, target.n_vertices, source_hash=source.content_hash, target_hash=target.content_hash
    )


def written(collection, name):
    return read_mesh(collection.layout.corresponded(name)).vertices


def ways(collection):
    return {line["name"]: line["ways"] for line in lines_of(collection.layout.shapes_table)}


def through_template(surfaces, truth):
    """Mean distance from where they belong of vertices that are carried through the template, over all pairs."""
    errors = []
    for source in surfaces:
        nearest = cKDTree(surfaces[source]).query(truth[source])[1]
        errors += [
            np.linalg.norm(surfaces[target][nearest] - truth[target], axis=1).mean()
            for target in surfaces
            if target != source
        ]
    return np.mean(errors)


@pytest.mark.long
def test_the_median_of_all_ways_is_nearer_to_the_truth_than_the_map_of_the_pair(cohort):
    meshes = {name: read_mesh(path) for name, path in cohort.paths.items()}
    truth = {name: mesh.vertices for name, mesh in meshes.items()}
    together = {name: written(cohort, name) for name in NAMES}
    alone = {"a": truth["a"]} | {
        name: wrap(cohort.maps("a", name).forward, meshes["a"], meshes[name]).mesh.vertices
        for name in NAMES[1:]
    }
    assert through_template(together, truth) < 0.8 * through_template(alone, truth)
    assert ways(cohort) == {"a": "1", **dict.fromkeys(NAMES[1:], "5")}


@pytest.mark.long
def test_the_template_is_as_it_was(cohort):
    np.testing.assert_array_equal(written(cohort, "a"), read_mesh(cohort.paths["a"]).vertices)


@pytest.mark.long
def test_one_wrong_map_changes_little(copied):
    before = written(copied, "b")
    maps = copied.maps("a", "c")
    rng = np.random.default_rng(1)
    wrong = [
        Correspondence(
            rng.permutation(each.vertices),
            each.n_target,
            source_hash=each.source_hash,
            target_hash=each.target_hash,
        )
        for each in (maps.forward, maps.backward)
    ]
    replace(maps, forward=wrong[0], backward=wrong[1]).save(copied.layout.maps(("a", "c")))
    copied.layout.corresponded("b").unlink()
    assert finished_names(copied) == ["b"]
    assert 0 < np.linalg.norm(written(copied, "b") - before, axis=1).mean() < NOISE / 4


@pytest.mark.long
def test_the_same_maps_give_the_same_files(copied):
    before = {name: copied.layout.corresponded(name).read_bytes() for name in NAMES}
    for name in NAMES:
        copied.layout.corresponded(name).unlink()
    assert finished_names(copied) == list(NAMES)
    assert {name: copied.layout.corresponded(name).read_bytes() for name in NAMES} == before


@pytest.mark.long
def test_without_a_shape_the_others_are_made_again(copied):
    assert finished_names(copied) == []
    fewer = copied.of(NAMES[:-1])
    assert surfaces_written(fewer) == ["a"]
    assert finished_names(fewer) == ["b", "c", "d", "e"]
    assert ways(fewer) == {"a": "1", **dict.fromkeys("bcde", "4")}


@pytest.mark.long
def test_doubtful_maps_are_no_ways(copied):
    with writing_ledger(copied.layout.ledger()) as ledger:
        for pair in (("a", "b"), ("c", "d")):
            row = ledger.rows.pairs[pair]
            ledger.put(pair, replace(row, forward=row.forward.with_outcome(Outcome.LOW_CONFIDENCE)))
    finished_names(copied)
    assert ways(copied) == {"a": "1", "b": "4", "c": "3", "d": "3", "e": "4", "f": "4"}
