"""A ring: a body that moves and comes back, reached both ways round by maps that slide a little, all the same way."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from isomatch import Correspondence, Mesh, Outcome, read_mesh, write_mesh
from isomatch._core.tables import read_table
from isomatch.cli import main
from isomatch.cohort import Collection, PairMaps
from isomatch.cohort.ledger import ShapeRow, writing_ledger
from isomatch.correspondence import nearest_points
from small_collections import finished_names, lopsided_blob, run

M = 6
DRIFT = 2.0  # degrees about z by which each map slides
NAMES = [f"frame{i}" for i in range(1, M + 1)]
BLOB = lopsided_blob(3)
BODIES = [BLOB.vertices * [1 + 0.1 * np.sin(at), 1 + 0.1 * np.cos(at), 1] for at in np.arange(M) * np.pi / 3]
ORDERS = [np.random.default_rng(i).permutation(BLOB.n_vertices) for i in range(M)]
FRAMES = [Mesh(body[order], np.argsort(order)[BLOB.faces]) for body, order in zip(BODIES, ORDERS)]


@pytest.fixture(scope="module")
def ring(small, tmp_path_factory):
    """A finished ring of these frames, each with its vertices in another order."""
    folder = tmp_path_factory.mktemp("ring")
    for name, frame in zip(NAMES, FRAMES):
        write_mesh(folder / f"{name}.ply", frame)
    how = {"pairs": "ring", "template": "frame1", "config": small.config}
    collection = Collection.create(folder / "made", folder, **how)
    run(collection)
    with writing_ledger(collection.layout.ledger()) as ledger:
        for i, (pair, row) in enumerate(ledger.rows.pairs.items()):
            there, back = (side.with_outcome(Outcome.CONVERGED) for side in row.sides)
            ledger.put(pair, replace(row, forward=there, backward=back))
            record = collection.maps(*pair).record
            maps = slid(i, (i + 1) % M, DRIFT), slid((i + 1) % M, i, -DRIFT)
            PairMaps(*maps, record, *np.full((2, BLOB.n_vertices), 0.02)).save(collection.layout.maps(pair))
    return finished(collection)


def finished(collection):
    finished_names(collection)
    return collection


def slid(a, b, degrees):
    """The true map between two frames, with images that are turned about z."""
    there = BODIES[b][ORDERS[a]] @ Rotation.from_euler("z", degrees, degrees=True).as_matrix().T
    nearest = cKDTree(FRAMES[b].vertices).query(there)[1]
    points = nearest_points(FRAMES[b].vertices, there, FRAMES[b].faces, nearest)
    hashes = FRAMES[a].content_hash, FRAMES[b].content_hash
    return Correspondence(points.corners[:, 0], BLOB.n_vertices, *points, *hashes)


def errors_of(collection):
    written = [read_mesh(collection.layout.corresponded(name)).vertices for name in NAMES]
    return np.linalg.norm(np.array(written) - np.array(BODIES)[:, ORDERS[0]], axis=2).mean(axis=1)


def told(collection, column):
    return [line[column] for line in read_table(collection.layout.shapes_table).records()]


def status(collection, capsys, code=0):
    assert main(["collect", "status", str(collection.folder), "--json"]) == code
    return json.loads(capsys.readouterr().out)


@pytest.fixture
def copied(ring, tmp_path):
    return Collection.open(shutil.copytree(ring.folder, tmp_path / "copy"))


@pytest.mark.long
def test_both_ways_round_cancel_a_drift_that_one_way_adds_up(ring, copied, capsys):
    assert told(ring, "ways") == ["1"] + ["2"] * (M - 1)
    turn = Rotation.from_euler("z", M * DRIFT, degrees=True).as_matrix()
    apart = np.linalg.norm(BODIES[0] @ turn.T - BODIES[0], axis=1) / np.sqrt(FRAMES[0].area)
    loop = status(ring, capsys)["loop"]
    assert loop.pop("open") == []
    assert list(loop.values()) == pytest.approx([apart.mean(), apart.max()], rel=0.1)
    last = NAMES[-1], NAMES[0]
    with writing_ledger(copied.layout.ledger()) as ledger:
        row = ledger.rows.pairs[last]
        ledger.put(last, replace(row, forward=row.forward.with_outcome(Outcome.LOW_CONFIDENCE)))
    assert (errors_of(ring)[1:] < errors_of(finished(copied))[1:] / 2).all()
    assert status(copied, capsys)["loop"] == {"open": [list(last)]}


@pytest.mark.long
def test_a_wrong_map_does_not_draw_frames_between_two_places(copied):
    maps = replace(copied.maps("frame4", "frame5"), forward=slid(3, 4, 120), backward=slid(4, 3, -120))
    maps.save(copied.layout.maps(("frame4", "frame5")))
    for name in NAMES:
        copied.layout.corresponded(name).unlink()
    assert (errors_of(finished(copied)) < 0.1).all()
    assert told(copied, "ways") == ["1"] * M


@pytest.mark.long
def test_around_a_frame_that_failed_the_others_are_reached(copied, tmp_path, capsys):
    with writing_ledger(copied.layout.ledger()) as ledger:
        ledger.put("frame4", ShapeRow(state="failed", error="no faces", time=2e9))
    loop = status(finished(copied), capsys, code=3)["loop"]
    assert loop == {"open": [["frame3", "frame4"], ["frame4", "frame5"]]}
    assert main(["statistics", "time", str(copied.folder), "-o", str(tmp_path / "time"), "--json"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["shapes"] == [name for name in NAMES if name != "frame4"]
    assert "missing: frame4" in said.err
