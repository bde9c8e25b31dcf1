"""Which shapes and pairs a collection has."""

import csv
from itertools import combinations

import pytest

from isomatch import InputError
from isomatch._core.errors import IsomatchError
from isomatch.cohort import Collection
from isomatch.cohort.jobs import Run
from isomatch.cohort.plan import entries_of, pairs_of, tiles_of

NAMES = [f"n{i:02}" for i in range(13)]


@pytest.fixture
def folder(tmp_path):
    for name in ("b.ply", "a.off", "notes.txt", "c.obj"):
        (tmp_path / name).write_text("")
    return tmp_path


def write_list(path, *lines):
    with path.open("w", newline="") as file:
        csv.writer(file).writerows(lines)
    return str(path)


def test_a_folder_a_pattern_and_files_in_the_order_of_their_names(folder):
    assert [entry.name for entry in entries_of(folder)] == ["a", "b", "c"]
    assert [entry.name for entry in entries_of(f"{folder}/*.o*")] == ["a", "c"]
    assert [entry.path for entry in entries_of([folder / "c.obj", folder / "a.off"])] == [
        folder / "c.obj",
        folder / "a.off",
    ]


def test_a_list_names_shapes_relative_to_its_folder(folder):
    found = entries_of(write_list(folder / "list.csv", ["name", "path"], ["one", "b.ply"], ["", "c.obj"]))
    assert [(entry.name, entry.path) for entry in found] == [
        ("one", folder / "b.ply"),
        ("c", folder / "c.obj"),
    ]


@pytest.mark.parametrize(
    ("lines", "complaint"),
    [
        ([["path"]], "no shapes that can be read"),
        ([["file"], ["a.off"]], "has no column 'path'"),
        ([["path"], ["a.off"], ["x/a.ply"]], "several shapes are named a"),
        ([["name", "path"], ["a__b", "a.off"]], "'a__b' cannot be the name of a shape"),
        ([["name", "path"], ["a_", "a.off"], ["_b", "b.ply"]], "'a_' cannot be the name of a shape"),
    ],
)
def test_bad_lists(lines, complaint, folder):
    with pytest.raises(IsomatchError, match=complaint):
        entries_of(write_list(folder / "list.csv", *lines))


def test_patterns():
    assert set(map(frozenset, pairs_of(NAMES, "all", None))) == set(map(frozenset, combinations(NAMES, 2)))
    assert pairs_of(NAMES[:3], "star", "n01") == [("n01", "n00"), ("n01", "n02")]
    assert pairs_of(NAMES[:3], "chain", None) == [("n00", "n01"), ("n01", "n02")]
    assert pairs_of(NAMES[:3], "ring", None) == [("n00", "n01"), ("n01", "n02"), ("n02", "n00")]
    with pytest.raises(InputError, match="a ring has at least three shapes, not 2"):
        pairs_of(NAMES[:2], "ring", None)


@pytest.mark.parametrize(
    ("lines", "complaint"),
    [
        ([["a", "b"], ["n01", "n02"]], "give columns source and target"),
        ([["source", "target"], ["n01", "x"]], "x are no shapes"),
        ([["source", "target"], ["n01", "n01"]], "paired with itself"),
    ],
)
def test_bad_lists_of_pairs(lines, complaint, tmp_path):
    with pytest.raises(IsomatchError, match=complaint):
        pairs_of(NAMES, write_list(tmp_path / "pairs.csv", *lines), None)


def test_a_listed_pair_is_matched_once_in_both_directions(tmp_path):
    path = write_list(
        tmp_path / "p.csv", ["source", "target"], ["n02", "n01"], ["n01", "n02"], ["n00", "n01"]
    )
    assert pairs_of(NAMES, path, None) == [("n02", "n01"), ("n00", "n01")]


@pytest.mark.parametrize(("side", "most"), [(1, 1), (3, 4), (4, 100), (50, 7)])
@pytest.mark.parametrize("pattern", ["all", "star", "chain"])
def test_tiles_hold_every_pair_once_and_few_shapes(pattern, side, most):
    pairs = pairs_of(NAMES, pattern, "n05")
    tiles = tiles_of(pairs, NAMES, side, most)
    assert sorted(pair for tile in tiles for pair in tile) == sorted(pairs)
    for tile in tiles:
        assert len(tile) <= most
        assert len({name for pair in tile for name in pair}) <= 2 * side


@pytest.mark.parametrize("pattern", ["all", "star", "chain"])
@pytest.mark.parametrize("count", [1, 2, 5, 100])
def test_shards_hold_every_pair_once(pattern, count, tmp_path):
    files = [tmp_path / f"{name}.ply" for name in NAMES]
    collection = Collection.create(tmp_path / "c", files, pairs=pattern, template="n05")
    rows = collection.rows()
    parts = [Run(collection, (i, count)).pairs_of_shard(rows) for i in range(count)]
    assert sorted(pair for part in parts for pair in part) == sorted(pairs_of(NAMES, pattern, "n05"))
    sizes = [len(part) for part in parts]
    assert max(sizes) - min(sizes) <= 1


def test_a_template_is_a_name_or_a_file_of_the_collection(folder):
    assert Collection.create(folder / "1", folder, template="b").template == "b"
    assert Collection.create(folder / "2", folder, template=str(folder / "b.ply")).template == "b"
    with pytest.raises(InputError, match="template 'x' is no shape"):
        Collection.create(folder / "3", folder, template="x")
