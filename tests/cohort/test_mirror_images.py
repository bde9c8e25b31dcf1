"""Left specimens among right ones: named, and on request reflected, if the match bears it out."""

import json
import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from isomatch import Correspondence, InputError, Mesh, Outcome, SettingError, read_mesh, write_mesh
from isomatch._core.errors import MeshError
from isomatch.cli import main
from isomatch.cohort import Collection, export, write_reports
from isomatch.cohort import jobs as jobs_module
from isomatch.cohort.ledger import Ledger, MapSummary, PairRow, Rows, ShapeRow
from isomatch.cohort.snapshot import Snapshot, two_groups
from isomatch.matching import match_both
from isomatch.surfaces import Graph, PointCloud, reflected
from isomatch_lab.procedural import creature
from shapes import box, disguised
from small_collections import arrays_of, finished_names, lines_of, lopsided_blob, run

NAMES = ("l0", "l1", "r0", "r1", "r2")
LEFT = ["l0", "l1"]


def box_with_unlike_corners():
    plain = box(9, 12, 15)
    points = plain.vertices.copy()
    for corner, height in (((1, 0, 0), 4), ((0, 1, 0), 6), ((0, 0, 1), 8), ((1, 1, 1), 2)):
        apart = np.linalg.norm(plain.vertices - np.array(corner) * (9, 12, 15), axis=1)
        points += height * np.exp(-((apart / 3) ** 2))[:, None] * (np.array(corner) * 2 - 1)
    return Mesh(points, plain.faces)


@pytest.fixture(scope="module")
def blobs(small, tmp_path_factory):
    """The folder of two left and three right blobs, each turned and renumbered, and what became of their vertices."""
    folder = tmp_path_factory.mktemp("blobs")
    new_vertex = {}
    for seed, name in enumerate(NAMES):
        blob = lopsided_blob(2, seed)
        made = disguised(reflected(blob) if name in LEFT else blob, seed)
        write_mesh(folder / f"{name}.ply", made.mesh)
        new_vertex[name] = made.new_vertex
    return SimpleNamespace(folder=folder, new_vertex=new_vertex, config=small.config)


@pytest.fixture(scope="module")
def plain(blobs, tmp_path_factory):
    """Folder of a star in which nothing was reflected; not to be changed."""
    folder = tmp_path_factory.mktemp("plain") / "out"
    collection = Collection.create(folder, blobs.folder, template="r0", config=blobs.config)
    run(collection)
    finished_names(collection)
    return folder


@pytest.fixture(scope="module")
def auto(blobs, plain, tmp_path_factory):
    """Folder of that star, continued with ``reflect="auto"``; not to be changed."""
    folder = shutil.copytree(plain, tmp_path_factory.mktemp("auto") / "out")
    collection = star(blobs, folder, "auto")
    run(collection)
    finished_names(collection)
    return folder


@pytest.fixture
def work(monkeypatch):
    """How often shapes are prepared and pairs are matched."""
    done = []

    def counted(word, function):
        return lambda *given, **options: done.append(word) or function(*given, **options)

    monkeypatch.setattr(jobs_module, "prepare", counted("prepare", jobs_module.prepare))
    monkeypatch.setattr(jobs_module, "match_both", counted("match", jobs_module.match_both))
    return done


def star(blobs, folder, reflect=None, **options):
    given = {"template": "r0", "config": blobs.config, **options}
    return Collection.create(folder, blobs.folder, reflect=reflect, **given)


def outcomes(collection):
    return {pair: row.ending for pair, row in collection.rows().pairs.items()}


def sides(folder):
    """Names of the shapes that the table calls reflected, and mirror images."""
    lines = lines_of(folder / "shapes.csv")
    return [
        [line["name"] for line in lines if line[column] == "yes"] for column in ("reflected", "mirror_image")
    ]


@pytest.mark.long
def test_what_seems_to_be_a_mirror_image_is_named_but_not_reflected(blobs, plain, capsys):
    collection = Collection.open(plain)
    found = {pair[1] for pair, outcome in outcomes(collection).items() if outcome == "MIRROR_IMAGE"}
    assert found == set(LEFT)
    assert Snapshot(collection, collection.rows()).mirror_images == {name: ("r0", name) for name in LEFT}
    assert sides(plain) == [[], LEFT]
    assert (plain / "index.html").read_text().count("seems to be a mirror image") == len(LEFT)
    assert main(["collect", "status", str(plain)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "l0, l1; run again with --reflect auto" in said


@pytest.mark.long
def test_reflecting_later_matches_only_what_changes(blobs, plain, tmp_path, work):
    folder = shutil.copytree(plain, tmp_path / "out")
    before = arrays_of(folder)
    collection = star(blobs, folder, "auto")
    assert [(event.what, event.name) for event in run(collection)] == [("reflection", name) for name in LEFT]
    assert work == ["prepare", "match"] * len(LEFT)
    assert run(collection) == []
    assert len(work) == 2 * len(LEFT)
    assert sorted(finished_names(collection)) == LEFT
    after = arrays_of(folder)
    assert {name for name in before if before[name] != after[name]} == {"r0__l0.npz", "r0__l1.npz"}
    assert set(outcomes(collection).values()) == {"CONVERGED"}


@pytest.mark.long
def test_reflected_shapes_are_remembered_in_every_row(auto, capsys):
    collection = Collection.open(auto)
    rows = collection.rows()
    assert rows.reflected(NAMES) == LEFT
    assert Snapshot(collection, rows).mirror_images == {}
    for pair, row in rows.pairs.items():
        expected = [name for name in pair if name in LEFT]
        assert row.reflected == collection.maps(*pair).record.reflected == tuple(expected)
        notes = [note for note in row.forward.notes if note.startswith("target: reflected")]
        assert len(notes) == len(expected)
    reflected_in = {line["target"]: line["reflected"] for line in lines_of(auto / "pairs.csv")}
    assert reflected_in == {"l0": "l0", "l1": "l1", "r1": "", "r2": ""}
    assert sides(auto) == [LEFT, []]
    assert (auto / "index.html").read_text().count("<small class=told>reflected</small>") == len(LEFT)
    assert main(["collect", "status", str(auto)]) == 0
    assert "reflected before they were matched: l0, l1" in capsys.readouterr().out


@pytest.mark.long
@pytest.mark.parametrize("name", ["l0", "l1", "r2"])
def test_maps_are_right_and_fit_the_files_of_the_user(blobs, auto, name, tmp_path):
    collection = Collection.open(auto)
    files = [read_mesh(collection.paths[each]) for each in ("r0", name)]
    maps = collection.maps("r0", name)
    maps.forward.check_fits(*files)
    maps.backward.check_fits(*files[::-1])
    truth = np.empty(files[0].n_vertices, dtype=int)
    truth[blobs.new_vertex["r0"]] = blobs.new_vertex[name]
    apart = files[1].vertices[maps.forward.vertices] - files[1].vertices[truth]
    assert np.linalg.norm(apart, axis=1).mean() < 0.03 * np.sqrt(files[1].area)
    list(export(collection, tmp_path / "out"))
    Correspondence.load(tmp_path / "out" / "maps" / f"r0__{name}.npz").check_fits(*files)


@pytest.mark.long
def test_surfaces_in_one_topology_are_those_of_the_reflected_shapes(blobs, auto):
    collection = Collection.open(auto)
    template = read_mesh(collection.layout.corresponded("r0"))
    for name in NAMES:
        written = read_mesh(collection.layout.corresponded(name))
        own = read_mesh(collection.paths[name])
        own = reflected(own) if name in LEFT else own
        assert written.faces.tolist() == template.faces.tolist()
        truth = own.vertices[blobs.new_vertex[name]]
        apart = np.linalg.norm(written.vertices[blobs.new_vertex["r0"]] - truth, axis=1)
        assert apart.mean() < 0.03 * np.sqrt(own.area)
        assert written.volume == pytest.approx(own.volume, rel=0.05)
    assert {float(line["turned"]) for line in lines_of(auto / "shapes.csv")} == {0.0}


@pytest.mark.long
def test_statistics_know_what_was_reflected(auto, tmp_path, capsys):
    assert main(["statistics", str(auto), "-o", str(tmp_path / "model"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["shapes"] == list(NAMES)
    assert told["notes"][0] == "mirror images of the surfaces in their files: l0, l1"


@pytest.mark.long
def test_a_report_shows_the_reflected_shape(auto, tmp_path):
    collection = Collection.open(shutil.copytree(auto, tmp_path / "out"))
    with ThreadPoolExecutor(1) as executor:
        errors = {error for _, error in write_reports(collection, "all", executor, 1)}
    assert errors == {""}
    assert "--orientation any -o DIR" in collection.layout.report(("r0", "l0")).read_text()
    assert "--orientation" not in collection.layout.report(("r0", "r1")).read_text()


@pytest.mark.long
def test_the_maps_do_not_depend_on_the_way(blobs, auto, tmp_path, work):
    """Found from the start, named from the start, in shards; each left blob is matched once if it is named."""
    expected = arrays_of(auto)
    at_once, named, shards = (
        star(blobs, tmp_path / name, reflect)
        for name, reflect in (("a", "auto"), ("b", LEFT[::-1]), ("c", "auto"))
    )
    run(at_once)
    assert work.count("match") == 4 + 2
    work.clear()
    run(named)
    assert (work.count("prepare"), work.count("match")) == (5, 4)
    for i in (1, 0):
        run(shards, shard=(i, 2))
    assert run(shards) == []
    assert arrays_of(at_once.folder) == arrays_of(named.folder) == arrays_of(shards.folder) == expected


@pytest.mark.long
@pytest.mark.parametrize("written", [0, 1])
def test_a_run_that_is_killed_while_it_reflects(blobs, plain, auto, tmp_path, work, monkeypatch, written):
    """Maps are whole on disk, the rows of shapes or pairs are not written; maps without a digest are made again."""
    collection = star(blobs, shutil.copytree(plain, tmp_path / "out"), "auto")
    with monkeypatch.context() as patch:
        kind, put = (ShapeRow, PairRow)[written], Ledger.put
        patch.setattr(Ledger, "put", lambda *all: 1 / 0 if isinstance(all[-1], kind) else put(*all))
        with pytest.raises(ZeroDivisionError):
            run(collection)
    work.clear()
    run(collection)
    assert len(work) <= 4
    assert collection.rows().reflected(NAMES) == LEFT
    assert arrays_of(collection.folder) == arrays_of(auto)


@pytest.mark.long
def test_a_reflection_that_the_match_does_not_bear_out_is_not_kept(
    blobs, plain, tmp_path, work, monkeypatch, capsys
):
    collection = star(blobs, shutil.copytree(plain, tmp_path / "out"), "auto")
    before, rows = arrays_of(collection.folder), collection.rows()

    def doubtful(*given, **options):
        found = match_both(*given, **options)
        doubted = replace(found.target_to_source, outcome=Outcome.LOW_CONFIDENCE)
        return found._replace(target_to_source=doubted)

    with monkeypatch.context() as patch:
        patch.setattr(jobs_module, "match_both", doubtful)
        events = run(collection)
    assert [(event.what, event.name) for event in events] == [("reflection", name) for name in LEFT]
    assert arrays_of(collection.folder) == before
    after = collection.rows()
    assert after.shapes == rows.shapes
    assert outcomes(collection)["r0", "l0"] == "MIRROR_IMAGE"
    work.clear()
    assert run(collection) == []
    assert work == []
    assert main(["collect", "status", str(collection.folder)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "not reflected: l0: the other way round, the match ends with low confidence" in said


@pytest.mark.long
def test_a_match_that_fails_is_no_reflection(blobs, plain, tmp_path, monkeypatch):
    collection = star(blobs, shutil.copytree(plain, tmp_path / "out"), "auto")
    monkeypatch.setattr(jobs_module, "match_both", lambda *_, **__: 1 / 0)
    assert {"division" in event.row.not_reflected[event.name] for event in run(collection)} == {True}
    assert collection.rows().reflected(NAMES) == []


@pytest.mark.long
def test_what_to_reflect_may_change_and_otherwise_stays(blobs, auto, tmp_path, work):
    folder = shutil.copytree(auto, tmp_path / "out")
    assert star(blobs, folder).reflect == Collection.open(folder).reflect == "auto"
    assert run(star(blobs, folder)) == []
    names = [event.name for event in run(star(blobs, folder, ["l1"]))]
    assert names == ["l0", ("r0", "l0")]
    assert work == ["match"]  # it was prepared before
    assert star(blobs, folder).reflect == ("l1",)
    assert [event.name for event in run(star(blobs, folder, "auto"))] == ["l0"]
    none = star(blobs, folder, [])
    assert [event.name for event in run(none)] == [*LEFT, ("r0", "l0"), ("r0", "l1")]
    assert none.rows().reflected(NAMES) == []


@pytest.mark.long
def test_a_reflected_shape_whose_file_becomes_a_right_one_is_turned_back(blobs, auto, tmp_path):
    shapes = shutil.copytree(blobs.folder, tmp_path / "shapes")
    folder = shutil.copytree(auto, tmp_path / "out")
    collection = Collection.create(folder, shapes, template="r0", config=blobs.config)
    shutil.copy(shapes / "r1.ply", shapes / "l0.ply")
    assert [(event.what, event.name) for event in run(collection)] == [
        ("shape", "l0"),
        ("outlier", "r1"),  # the same file
        ("pair", ("r0", "l0")),
        ("reflection", "l0"),
    ]
    assert collection.rows().reflected(NAMES) == ["l1"]


@pytest.mark.long
def test_the_surer_map_of_the_reflected_shape_is_not_kept_for_the_shape_itself(blobs, plain, tmp_path):
    """Pairs that were tried again keep the surer map, but only one of the same surfaces."""
    folder = shutil.copytree(plain, tmp_path / "out")
    assert star(blobs, folder).retry("low") == [("r0", name) for name in LEFT]
    run(star(blobs, folder, LEFT))
    assert outcomes(Collection.open(folder))["r0", "l0"] == "CONVERGED"
    back = star(blobs, folder, [])
    run(back)
    assert outcomes(back)["r0", "l0"] == "MIRROR_IMAGE"
    assert back.maps("r0", "l0").record.reflected == ()


@pytest.mark.long
def test_of_all_pairs_the_smaller_group_is_reflected(blobs, tmp_path, work):
    pairs = star(blobs, tmp_path, "auto", pairs="all", template=None)
    run(pairs, shard=(0, 2))
    run(pairs, shard=(1, 2))
    assert work.count("match") == 10
    assert pairs.rows().reflected(NAMES) == []  # a shard does not see all pairs
    assert set(Snapshot(pairs, pairs.rows()).mirror_images) == set(LEFT)
    run(pairs)
    assert pairs.rows().reflected(NAMES) == LEFT
    assert set(outcomes(pairs).values()) <= {"CONVERGED", "SYMMETRY_AMBIGUOUS"}
    assert set(outcomes(pairs)) == set(combinations(NAMES, 2))
    assert work.count("match") == 10 + 2 + 5  # two to see, and the others of which a shape was reflected
    assert run(pairs) == []


@pytest.mark.long
def test_the_side_of_a_template_that_is_named_stays(blobs, tmp_path):
    chain = star(blobs, tmp_path, "auto", pairs="chain", template="l0")
    run(chain)
    assert chain.rows().reflected(NAMES) == ["r0", "r1", "r2"]
    assert "MIRROR_IMAGE" not in outcomes(chain).values()


def matched(outcome, mirrored=None, turned=()):
    result = {"outcome": outcome, "quality": {"mirrored": mirrored}}
    return PairRow(state="done", reflected=turned, forward=MapSummary(result), backward=MapSummary(result))


def test_groups_of_shapes_by_their_pairs(blobs, tmp_path):
    """The pair that shows it best; then the group of which more are reflected stays, although it is smaller."""
    pairs = star(blobs, tmp_path, pairs="all", template=None)
    rows = Rows({name: ShapeRow(state="done", features=(0.0,)) for name in NAMES})
    for a, b in combinations(NAMES, 2):
        rows.pairs[a, b] = matched("MIRROR_IMAGE", 0.5) if a[0] != b[0] else matched("PARTIAL")
    rows.pairs["l1", "r1"] = matched("MIRROR_IMAGE", 0.2)
    rows.pairs["l0", "r2"] = matched("LOW_CONFIDENCE")
    assert Snapshot(pairs, rows).mirror_images == {"l0": ("l0", "r0"), "l1": ("l1", "r1")}
    rows.shapes["l0"] = replace(rows.shapes["l0"], reflected=True)
    for pair, row in rows.pairs.items():
        rows.pairs[pair] = replace(row, reflected=tuple(name for name in pair if name == "l0"))
    assert set(Snapshot(pairs, rows).mirror_images) == {"r0", "r1", "r2"}
    rows.shapes["l1"] = replace(rows.shapes["l1"], hash="another file")
    assert set(Snapshot(pairs, rows).mirror_images) == {"r0", "r1"}


def test_two_groups_outvote_a_wrong_link():
    names = range(8)
    links = {a: {b: 1 if (a < 3) == (b < 3) else -1 for b in names if b != a} for a in names}
    links[0][7] = links[7][0] = 1
    assert list(two_groups(links)) == [([3, 4, 5, 6, 7], [0, 1, 2])]
    assert list(two_groups({"a": {"b": 1}, "b": {"a": 1}, "c": {"d": -1}, "d": {"c": -1}})) == [
        ([], ["a", "b"]),
        (["d"], ["c"]),
    ]


def test_names_that_are_not_known_and_orientations_that_do_not_tell(blobs, tmp_path):
    with pytest.raises(InputError, match="collection"):
        star(blobs, tmp_path, ["l0", "l7"])
    either = replace(blobs.config, orientation="any")
    with pytest.raises(SettingError, match="orientation"):
        star(blobs, tmp_path, "auto", config=either)
    assert star(blobs, tmp_path, "l0", config=either).reflect == ("l0",)


def test_the_command_takes_names_and_a_file_of_names(blobs, small, tmp_path, capsys):
    names = tmp_path / "left.txt"
    names.write_text("l1\n\nl0\n")
    command = ["collect", str(blobs.folder), "-o", str(tmp_path / "out"), "--template", "r0"]
    command += ["--config", str(small.settings), "--time-limit", "0", "--json", "--reflect"]
    for given, expected in (
        ("l0, l1", LEFT),
        ("l0," * 200, ["l0"]),
        ("none", []),
        (str(names), LEFT),
        ("auto", "auto"),
    ):
        assert main([*command, given]) == 0
        assert json.loads((tmp_path / "out" / "collection.json").read_text())["reflect"] == expected
        capsys.readouterr()
    assert main([*command, "r9"]) == 1
    assert "r9 cannot be reflected" in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.parametrize("kind", ["creature", "box"])
def test_other_lopsided_shapes(kind, tmp_path):
    """Creatures in other poses, and a box with unlike corners; all moved and renumbered."""
    pytest.importorskip("skimage")
    shapes = [box_with_unlike_corners()] * 2
    if kind == "creature":
        shapes = [creature(1500, pose=pose, style=3, kind="quadruped").mesh for pose in (1, 2)]
    for seed, (name, mesh) in enumerate([("right", shapes[1]), ("left", reflected(shapes[1]))]):
        write_mesh(tmp_path / f"{name}.ply", disguised(mesh, seed).mesh)
    write_mesh(tmp_path / "template.ply", shapes[0])
    collection = Collection.create(tmp_path / "out", tmp_path, template="template", reflect="auto")
    run(collection)
    assert collection.rows().reflected(collection.names) == ["left"]
    assert set(outcomes(collection).values()) == {"CONVERGED"}


def test_a_reflected_surface():
    blob = lopsided_blob(1)
    image = reflected(blob)
    assert image.volume == pytest.approx(blob.volume)
    assert image.edges.tolist() == blob.edges.tolist()
    assert reflected(image).content_hash == blob.content_hash
    points = PointCloud(blob.vertices, 7)
    assert reflected(points).vertices.tolist() == (points.vertices * [-1, 1, 1]).tolist()
    assert reflected(points).n_neighbours == 7
    with pytest.raises(MeshError, match="no positions"):
        reflected(Graph(2, [[0, 1]], [1.0]))
