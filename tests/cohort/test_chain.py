"""A chain: files in the order of their numbers, and the template carried along the path of sure maps."""

import numpy as np
import pytest

import isomatch
from isomatch._core.texts import natural_order
from isomatch.cohort import Collection, finish
from isomatch.cohort.ledger import MapSummary, PairRow, Rows, ShapeRow
from small_collections import N, lines_of


def test_numbers_in_names_are_counted():
    assert sorted(["frame10", "frame2", "Frame1"], key=natural_order) == ["Frame1", "frame2", "frame10"]
    assert sorted(["a", "a1b10", "a1b9", "A"], key=natural_order) == ["A", "a", "a1b9", "a1b10"]


@pytest.fixture(scope="module")
def chain(small, tmp_path_factory):
    """A finished chain of frames 1, 2, 10 and 11, the last one the template, with a file that is none."""
    folder = tmp_path_factory.mktemp("chain")
    for number, i in zip((1, 2, 10, 11), range(len(N))):
        (folder / f"frame{number}.ply").write_bytes((small.shapes / f"s{i}.ply").read_bytes())
    (folder / "._frame1.ply").write_bytes(b"of macOS")
    collection = Collection.create(
        folder.parent / "made", folder, pairs="chain", template="frame11", config=small.config
    )
    list(collection.run("local", 1))
    return collection


def lines(collection):
    return {line["name"]: line for line in lines_of(collection.layout.shapes_table)}


@pytest.mark.long
def test_shapes_are_in_order_and_each_gets_a_surface(chain):
    assert list(chain.names) == ["frame1", "frame2", "frame10", "frame11"]
    doubtful = [pair for pair in chain.rows().pairs if chain.rows().is_doubtful(pair)]
    list(finish(chain))
    reached = [name for name in chain.names if chain.rows().path("frame11", name)]
    for name in chain.names:
        line = lines(chain)[name]
        assert chain.layout.corresponded(name).exists() == (name in reached)
        assert bool(line["error"]) == (name not in reached)
        assert name in reached or doubtful
    errors = [float(lines(chain)[name]["expected_error"]) for name in reversed(reached) if name != "frame11"]
    assert all(np.diff(errors) > 0)


def rows(*pairs, doubtful=()):
    """Rows of current pairs with their outcomes."""
    names = {name for pair in pairs for name in pair}
    sure, unsure = (MapSummary({"outcome": outcome}) for outcome in ("CONVERGED", "LOW_CONFIDENCE"))
    of = {}
    for source, target in pairs:
        there = unsure if (source, target) in doubtful else sure
        hashes = {"source_hash": source, "target_hash": target}
        of[source, target] = PairRow(state="done", **hashes, forward=there, backward=there)
    return Rows(shapes={name: ShapeRow(state="done", hash=name) for name in names}, pairs=of)


def test_a_path_is_the_shortest_of_sure_maps():
    chained = [("a", "b"), ("c", "b"), ("c", "d")]
    assert rows(*chained).path("a", "d") == ("a", "b", "c", "d")
    assert rows(*chained, ("a", "d")).path("a", "d") == ("a", "d")
    assert rows(*chained, doubtful=[("c", "b")]).path("a", "d") is None
    assert rows(*chained).path("d", "a") == ("d", "c", "b", "a")


def test_polygons_in_another_order_are_one_topology():
    from isomatch.cohort.shape_statistics import CorrespondedShapes

    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]])
    again = faces[[2, 0, 3, 1]][:, [1, 2, 0]]
    meshes = {"a": isomatch.Mesh(square, faces), "b": isomatch.Mesh(square + 1, again)}
    shapes = CorrespondedShapes.of_meshes(meshes)
    assert shapes.names == ("a", "b")
    assert np.array_equal(shapes.faces, faces)


def test_quads_are_cut_once(tmp_path):
    """A quad that is concave in one pose is cut along its other diagonal there, and is the same quad."""
    from isomatch.cohort.shape_statistics import read_shapes

    flat = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv 4 0 0\nv 4 2 0\nf 1 2 3 4\nf 2 5 6 3\n"
    for i, corner in enumerate(("2 2 0", "0.5 0.5 0", "2 1.9 0.1")):
        (tmp_path / f"s{i}.obj").write_text(flat.replace("v 2 2 0", f"v {corner}"))
    shapes = read_shapes(tmp_path)
    assert shapes.names == ("s0", "s1", "s2")
    assert len(shapes.faces) == 4
    (tmp_path / "s3.obj").write_text(flat.replace("f 1 2 3 4", "f 1 2 4"))
    assert [each.partition(":")[0] for each in read_shapes(tmp_path).left_out] == ["s3"]
