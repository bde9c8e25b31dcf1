"""New subjects of a finished collection: what they are to the old model, and that nothing else changes."""

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
from hashlib import blake2b
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import isomatch
from isomatch._core import files as files_module
from isomatch._core.errors import InputError, SettingError
from isomatch.cli import main
from isomatch.cohort import Collection
from isomatch.cohort.ledger import PairRow, writing_ledger
from isomatch.cohort.map_file import DIGESTED_FOLDERS
from isomatch.cohort.scoring import plan_added
from isomatch.cohort.shape_statistics import ShapeModel, read_shapes
from isomatch.decimation import decimate
from isomatch_lab.procedural import creature
from small_collections import QUICK, arrays_of, finished_names, lines_of, lopsided_blob, run

LEVEL, OLD, NEW = 2, ("b0", "b1", "b2", "b3"), ("b4", "b5")


def digests(folder, without="added"):
    """Digests of all files in a folder, but for those of what was added."""
    found = (path for path in folder.rglob("*") if path.is_file())
    names = {path.relative_to(folder): path for path in found}
    return {str(n): blake2b(p.read_bytes()).hexdigest() for n, p in names.items() if n.parts[0] != without}


def finished(folder, shapes, **options):
    """A collection that is finished, with its model."""
    collection = Collection.create(folder, shapes, **options)
    run(collection)
    finished_names(collection)
    (folder / "statistics").mkdir(exist_ok=True)
    ShapeModel.fit(read_shapes(folder)).save(folder / "statistics" / "model.npz")
    return collection


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Files of old and of new subjects, and a finished collection of the old ones; not to be changed."""
    folder = tmp_path_factory.mktemp("cohort")
    for name in (*OLD, *NEW):
        isomatch.write_mesh(folder / f"{name}.ply", lopsided_blob(LEVEL, int(name[1:]), 0.05))
    (folder / "quick.toml").write_text(QUICK)
    config = isomatch.Config.from_file(folder / "quick.toml")
    files = {name: folder / f"{name}.ply" for name in (*OLD, *NEW)}
    finished(folder / "out", [files[name] for name in OLD], template="b0", config=config)
    return SimpleNamespace(folder=folder, files=files, config=config)


@pytest.fixture
def cohort(made, tmp_path, in_threads):
    """A copy of the finished collection, with the arguments that add its new subjects."""
    folder = shutil.copytree(made.folder / "out", tmp_path / "out")
    argv = ["collect", "add", str(folder), *(str(made.files[name]) for name in NEW), "--reports", "none"]
    return SimpleNamespace(folder=folder, argv=argv, files=made.files, config=made.config)


def table(folder):
    return {row["name"]: row for row in lines_of(folder / "added" / "scored.csv")}


@pytest.mark.long
def test_new_subjects_are_as_if_they_had_been_there_and_nothing_else_changes(cohort, made, tmp_path, capsys):
    before = digests(cohort.folder)
    assert main(cohort.argv) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "standard deviations from the mean" in said
    assert digests(cohort.folder) == before
    # all six in one star from the start
    whole = finished(tmp_path / "whole", list(made.files.values()), template="b0", config=made.config)
    model = ShapeModel.load(cohort.folder / "statistics" / "model.npz")
    for name, row in table(cohort.folder).items():
        surface = cohort.folder / "added" / "corresponded" / f"{name}.ply"
        assert surface.read_bytes() == whole.layout.corresponded(name).read_bytes()
        scored = model.score(isomatch.read_mesh(whole.layout.corresponded(name)))
        assert [float(row[f"mode_{i}"]) for i in range(1, 4)] == scored.scores.tolist()
        assert float(row["mahalanobis"]) == scored.mahalanobis
        assert row["outcome"] == whole.rows().pairs["b0", name].forward.outcome.name
        assert int(row["farthest_vertex"]) == scored.vertex_errors.argmax()
    assert {*table(cohort.folder)} == {*NEW}
    assert read_shapes(cohort.folder).names == OLD  # statistics of the collection are of the old ones


@pytest.mark.long
def test_nothing_is_done_twice_and_more_can_be_added(cohort, capsys):
    assert main([*cohort.argv[:4], *cohort.argv[-2:]]) == 0
    inner = cohort.folder / "added"
    kept = {file: (inner / file).stat().st_mtime_ns for file in ("maps/b0__b4.npz", "corresponded/b4.ply")}
    before = digests(inner)
    elsewhere = cohort.folder.parent / "b4.ply"
    shutil.copy(cohort.files["b4"], elsewhere)
    with pytest.raises(InputError, match=r"b4 was added from .*; give .*b4.ply another name"):
        plan_added(Collection.open(cohort.folder), [elsewhere])
    capsys.readouterr()
    assert main([*cohort.argv, "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert [line["name"] for line in record["shapes"]] == [*NEW]
    assert record["status"]["pairs"]["all"] == 2
    assert {*table(cohort.folder)} == {*NEW}
    assert {file: (inner / file).stat().st_mtime_ns for file in kept} == kept
    after = digests(inner)
    for file in ("maps/b0__b4.npz", "corresponded/b4.ply", "corresponded/b0.ply", "thumbnails/b4.png"):
        assert after[file] == before[file]


@pytest.mark.long
def test_what_was_added_stays_where_its_file_is_gone(cohort):
    own = cohort.folder.parent / "scan.ply"
    shutil.copy(cohort.files["b4"], own)
    assert main([*cohort.argv[:3], str(own), *cohort.argv[-2:]]) == 0
    surface = (cohort.folder / "added" / "corresponded" / "scan.ply").read_bytes()
    own.unlink()
    assert main([*cohort.argv[:3], str(cohort.files["b5"]), *cohort.argv[-2:]]) == 0
    assert {*table(cohort.folder)} == {"scan", "b5"}
    assert (cohort.folder / "added" / "corresponded" / "scan.ply").read_bytes() == surface


def refused(cohort, capsys, *arguments):
    """The complaint of a command that does nothing."""
    before = digests(cohort.folder, without="")
    capsys.readouterr()
    assert main(["collect", "add", str(cohort.folder), *map(str, arguments)]) == 1
    assert digests(cohort.folder, without="") == before
    return capsys.readouterr().err


def test_bad_subjects_are_all_named_and_the_others_are_added(cohort, tmp_path, capsys):
    body = lopsided_blob(LEVEL, 9)
    isomatch.write_mesh(tmp_path / "b1.ply", body)
    isomatch.write_mesh(tmp_path / "inches.ply", body.moved(body.vertices / 25.4))
    isomatch.write_mesh(tmp_path / "large.ply", body.moved(2.1 * body.vertices))
    isomatch.write_mesh(tmp_path / "little.ply", body.moved(body.vertices / 2.1))
    isomatch.write_mesh(tmp_path / "larger.ply", body.moved(1.5 * body.vertices))
    isomatch.write_mesh(tmp_path / "points.ply", isomatch.Mesh(body.vertices, np.zeros((0, 3), dtype=int)))
    (tmp_path / "text.ply").write_text("no mesh")
    names = ("b1", "inches", "large", "little", "larger", "points", "text")
    bad = [tmp_path / f"{name}.ply" for name in names if name != "larger"]
    said = refused(cohort, capsys, *bad)
    assert "nothing is added" in said
    assert "b1 is a shape of the collection" in said
    assert "inches is 0.0" in said
    assert "--units inches=in" in said
    assert "large is 2." in said
    assert "little is 0.4" in said
    assert "points.ply: has no surface" in said
    assert "text.ply:" in said
    collection = Collection.open(cohort.folder)
    more, left_out = plan_added(collection, [*bad, tmp_path / "larger.ply", cohort.files["b4"]])
    assert more.names == ["b0", "larger", "b4"]
    assert {*left_out} == {*names} - {"larger"}
    shutil.rmtree(cohort.folder / "added")
    assert "no such file" in refused(cohort, capsys, tmp_path / "none.ply")
    assert "several shapes are named b4" in refused(cohort, capsys, cohort.files["b4"], cohort.files["b4"])
    assert "no shapes" in refused(cohort, capsys)


@pytest.mark.long
def test_units_that_are_told(cohort, tmp_path, capsys):
    body = isomatch.read_mesh(cohort.files["b4"])
    isomatch.write_mesh(tmp_path / "b4.ply", body.moved(body.vertices / 25.4))
    collection = Collection.open(cohort.folder)
    with pytest.raises(InputError, match="b4: in units that fit no unit of the collection"):
        plan_added(collection, [tmp_path / "b4.ply"], units={"b4": "um"})
    argv = [*cohort.argv[:3], str(tmp_path / "b4.ply"), *cohort.argv[-2:]]
    assert main([*argv, "--units", "mm,b4=in"]) == 0
    inches = table(cohort.folder)["b4"]
    shutil.rmtree(cohort.folder / "added")
    assert main(cohort.argv) == 0
    assert float(inches["mahalanobis"]) == pytest.approx(
        float(table(cohort.folder)["b4"]["mahalanobis"]), rel=0.05
    )
    assert main([*argv[:3], str(cohort.files["b5"]), "--units", "cm,b5=mm"]) == 0


@pytest.mark.long
def test_collections_and_models_that_do_not_serve(cohort, made, tmp_path, capsys):
    new = cohort.files["b4"]
    assert "is not finished: 3 shapes are not prepared" in unfinished(made, tmp_path / "a", new, 0)
    assert "is not finished: 1 pairs are not matched" in unfinished(made, tmp_path / "b", new, 1)
    assert "its template is not written" in unfinished(made, tmp_path / "c", new, 2)
    other = tmp_path / "other.npz"
    shapes = read_shapes(cohort.folder)
    turned = shapes.faces[:, [1, 2, 0]]
    ShapeModel.fit(type(shapes)(shapes.names, shapes.vertices, turned)).save(other)
    assert "has other faces than the template b0" in refused(cohort, capsys, new, "--model", other)
    stretched = shapes.moved(shapes.vertices * [1.1, 1.0, 1.0])
    ShapeModel.fit(stretched).save(other)
    assert "was made of another surface of b0" in refused(cohort, capsys, new, "--model", other)
    (cohort.folder / "statistics" / "model.npz").unlink()
    assert "no model; run isomatch statistics" in refused(cohort, capsys, new)
    assert "holds no collection" in missing(tmp_path / "none", new, capsys)


def missing(folder, new, capsys):
    capsys.readouterr()
    assert main(["collect", "add", str(folder), str(new)]) == 1
    return capsys.readouterr().err


def unfinished(made, folder, new, steps):
    """The complaint about a collection that was made, prepared or matched, and no more."""
    collection = Collection.create(
        folder, [made.files[n] for n in OLD[:3]], template="b0", config=made.config
    )
    if steps:
        events = run(collection)
        assert [event.what for event in events] == ["shape"] * 3 + ["pair"] * 2
    if steps == 1:
        with writing_ledger(collection.layout.ledger()) as ledger:
            ledger.put(("b0", "b2"), PairRow(state="todo"))
    with pytest.raises(InputError) as caught:
        plan_added(collection, [new])
    return str(caught.value)


@pytest.mark.long
def test_the_template_and_what_was_added_must_be_those_of_the_collection(cohort, made, tmp_path):
    shutil.copy(made.files["b0"], tmp_path / "b0.ply")
    files = [tmp_path / "b0.ply", made.files["b1"]]
    collection = finished(tmp_path / "own", files, template="b0", config=made.config)
    plan_added(collection, [made.files["b4"]])
    shutil.copy(made.files["b3"], tmp_path / "b0.ply")
    with pytest.raises(InputError, match="the template was changed"):
        plan_added(collection, [made.files["b4"]])
    shutil.rmtree(tmp_path / "own" / "statistics")
    other = finished(tmp_path / "else", files, template="b1", config=made.config)
    shutil.move(tmp_path / "own" / "added", tmp_path / "else" / "added")
    with pytest.raises(SettingError, match=r"to add all subjects anew, move .*added away"):
        plan_added(other, [made.files["b4"]])


@pytest.mark.long
def test_mirror_images(made, tmp_path):
    collection = Collection.create(
        tmp_path / "out", [made.files[n] for n in OLD], template="b0", config=made.config, reflect=["b0"]
    )
    finished(tmp_path / "out", [made.files[n] for n in OLD], template="b0", config=made.config)
    more, _ = plan_added(collection, [made.files["b4"]])
    assert more.reflect == ("b0",)  # as it was in the collection
    assert plan_added(collection, [made.files["b4"]], reflect="b4")[0].reflect == ("b0", "b4")
    with pytest.raises(SettingError, match="name those to reflect"):
        plan_added(collection, [made.files["b4"]], reflect="auto")


def file_of(to):
    """The file that is complete once it is moved there, with its folder, if that stays."""
    return f"{'' if to.parent.name.endswith('.unfinished') else to.parent.name}/{to.name}"


@pytest.mark.long
def test_after_a_disk_was_full_at_any_file_it_is_continued(cohort, monkeypatch):
    """After each file in turn was written, the disk is full."""
    before = digests(cohort.folder)
    moved, seen, kept = files_module.Path.replace, set(), {}

    def moved_and_full(path, to):
        moved(path, to)
        if file_of(to) not in seen:
            seen.add(file_of(to))
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(files_module.Path, "replace", moved_and_full)
    while main(cohort.argv):
        assert digests(cohort.folder) == before
        assert kept.items() <= complete(cohort.folder).items()
        kept = complete(cohort.folder)
    assert {"added/collection.json", "corresponded/b4.ply", "maps/b0__b5.npz", "added/scored.json"} <= seen
    assert digests(cohort.folder) == before
    assert {*table(cohort.folder)} == {*NEW}
    assert not list(cohort.folder.glob("**/.*"))


def complete(folder):
    """Digests of what was added and is not made from other files at each run."""
    inner = folder / "added"
    found = digests(inner) if inner.exists() else {}
    return {
        name: digest
        for name, digest in found.items()
        if name.split("/")[0] in DIGESTED_FOLDERS and "/." not in name
    }


KILLED = """
import os, sys
from concurrent.futures import ThreadPoolExecutor
sys.path.insert(0, sys.argv[1])
from test_added import file_of
from isomatch.cli import main
from isomatch.cohort import workers
from isomatch._core.files import Path
workers.worker_processes = lambda _: ThreadPoolExecutor(1)
moved, seen = Path.replace, Path(sys.argv[2])
def moved_and_killed(path, to):
    moved(path, to)
    if file_of(to) not in seen.read_text().split():
        seen.open("a").write(file_of(to) + "\\n")
        os.kill(os.getpid(), 9)
Path.replace = moved_and_killed
sys.exit(main(sys.argv[3:]))
"""


@pytest.mark.long
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_killed_after_any_file_it_is_continued(cohort, made, tmp_path):
    before, kept, status = digests(cohort.folder), {}, -signal.SIGKILL
    own = [*cohort.argv[:4], *cohort.argv[-2:]]  # one new subject
    seen, tests = tmp_path / "seen.txt", Path(__file__).parent
    seen.touch()
    path = os.pathsep.join([str(tests.parent), os.environ.get("PYTHONPATH", "")])
    while status == -signal.SIGKILL:
        argv = [sys.executable, "-c", KILLED, str(tests), str(seen), *own, "--quiet"]
        status = subprocess.run(argv, check=False, env={**os.environ, "PYTHONPATH": path}).returncode
        after = digests(cohort.folder)
        assert {name: after.get(name) for name in before} == before
        assert kept.items() <= complete(cohort.folder).items()
        kept = complete(cohort.folder)
    assert status == 0
    assert {"corresponded/b4.ply", "maps/b0__b4.npz", "added/scored.json"} <= {*seen.read_text().split()}
    assert digests(cohort.folder) == before
    once = shutil.copytree(made.folder / "out", tmp_path / "once")
    assert main([*own[:2], str(once), *own[3:]]) == 0
    assert table(once) == table(cohort.folder)
    assert arrays_of(once / "added") == arrays_of(
        cohort.folder / "added"
    )  # files have the times of their matches
    surfaces = {name: digest for name, digest in complete(once).items() if name.startswith("corresponded")}
    assert surfaces.items() <= kept.items()
    assert not list(cohort.folder.glob("**/.*"))


@pytest.mark.long
def test_five_creatures_in_the_model_of_fifteen(made, tmp_path, in_threads):
    folder = tmp_path / "shapes"
    folder.mkdir()
    files = [folder / f"c{i:02d}.ply" for i in range(20)]
    for i, file in enumerate(files):
        isomatch.write_mesh(file, decimate(creature(1500, pose=i).mesh, 500).mesh)
    options = {"template": "c00", "config": made.config}
    old = finished(tmp_path / "old", files[:15], **options)
    before = digests(old.folder)
    assert main(["collect", "add", str(old.folder), *map(str, files[15:]), "--reports", "none"]) == 0
    assert digests(old.folder) == before
    whole = finished(tmp_path / "whole", files, **options)
    model = ShapeModel.load(old.folder / "statistics" / "model.npz")
    together = ShapeModel.fit(read_shapes([whole.layout.corresponded(f"c{i:02d}") for i in range(15)]))
    rows = table(old.folder)
    assert len(rows) == 5
    for name, row in rows.items():
        scores = [float(row[f"mode_{i}"]) for i in range(1, 15)]
        surface = isomatch.read_mesh(whole.layout.corresponded(name))
        np.testing.assert_array_equal(scores, model.score(surface).scores)
        np.testing.assert_array_equal(scores, together.score(surface).scores)
