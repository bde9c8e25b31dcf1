"""``isomatch statistics``: exit codes, output and files."""

import json
import re

import numpy as np
import pytest

import isomatch
from command_line import one_line
from corresponded import ellipsoids, moved, random_shapes
from isomatch.cli import main
from isomatch.cohort.shape_statistics import ShapeModel, leave_one_out, read_shapes
from isomatch.cohort.study_input import read_shape_cells
from shapes import icosphere
from small_collections import lines_of

pytestmark = pytest.mark.usefixtures("coarse_pictures")


def write(folder, shapes):
    folder.mkdir()
    for i, name in enumerate(shapes.names):
        isomatch.write_mesh(folder / f"{name}.ply", shapes.mesh(i))
    return folder


@pytest.fixture
def folder(tmp_path):
    return write(tmp_path / "shapes", moved(random_shapes(8)))


@pytest.mark.long
def test_everything(folder, tmp_path, capsys):
    isomatch.write_mesh(folder / "odd.ply", icosphere(2))
    groups = tmp_path / "groups.csv"
    groups.write_text("name,group\n" + "".join(f"s00{i},{'ab'[i % 2]}\n" for i in range(7)))
    out = tmp_path / "out"
    argv = ["statistics", str(folder), "-o", str(out), "--groups", str(groups)]
    assert main([*argv, "--modes", "2"]) == 0
    said = capsys.readouterr().out
    assert "8 shapes of 42 vertices vary in 7 modes" in said
    assert "note: left out: odd: other faces than most shapes" in said
    assert "note: without a group: s007" in said
    assert "a (4) and b (3) do not differ significantly" in said
    record = json.loads((out / "statistics.json").read_text())
    here = {str(path.relative_to(out)) for path in out.rglob("*") if path.is_file()}
    assert set(record["files"]) == here - {"statistics.json"}
    written = {"mean.ply", "mode_2_plus2sd.ply", "dendrogram.png", "groups.ply", "aligned/s000.ply"}
    assert written <= here
    assert "mode_3_plus2sd.ply" not in here

    model = ShapeModel.load(out / "model.npz")
    scores = [[float(row[f"mode_{i}"]) for i in range(1, 8)] for row in lines_of(out / "scores.csv")]
    np.testing.assert_allclose(scores, model.scores)
    assert float(lines_of(out / "variance.csv")[-1]["share_so_far"]) == pytest.approx(1)
    assert [row["modes"] for row in lines_of(out / "quality.csv")] == [str(i) for i in range(8)]
    assert float(lines_of(out / "distances.csv")[2]["s003"]) > 0
    seen = isomatch.read_asset(out / "variance.ply")
    np.testing.assert_allclose(seen.attribute("variance").values, model.vertex_variances, rtol=1e-6)

    page = (out / "index.html").read_text()
    shown = set(re.findall(r'<img src="([^"]*)"', page))
    assert shown == {path.name for path in out.glob("*.png")}
    assert all(
        sentence in page for sentence in ("left out: odd", "a (4) and b (3) do not differ significantly")
    )

    assert main(argv) == 1
    assert "already exists" in one_line(capsys)
    assert main(["statistics", str(folder), "-o", str(out), "--modes", "1", "--force", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["shares"] == model.variance_ratios.tolist()
    here = {str(path.relative_to(out)) for path in out.rglob("*") if path.is_file()}
    assert set(printed["files"]) == here - {"statistics.json"}, "files of the earlier result are gone"


def test_new_shapes_in_an_old_model(tmp_path, capsys):
    model = ShapeModel.fit(random_shapes(8))
    model.save(tmp_path / "model.npz")
    before = (tmp_path / "model.npz").read_bytes()
    new = write(tmp_path / "new", random_shapes(10))
    argv = ["statistics", "project", str(tmp_path / "model.npz")]
    argv += [str(new / "s008.ply"), str(new / "s009.ply")]
    out = tmp_path / "out"
    assert main([*argv, "-o", str(out)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "of 8 shapes, each left out, are as far" in said
    record, table = json.loads((out / "scored.json").read_text()), lines_of(out / "scored.csv")
    usual = leave_one_out(model)
    assert record["usual"] == {
        "mahalanobis": pytest.approx(np.median(usual.mahalanobis)),
        "errors": pytest.approx(np.median(usual.errors)),
    }
    for row, line in zip(table, record["shapes"], strict=True):
        scored = model.score_file(new / f"{row['name']}.ply")
        assert float(row["mahalanobis"]) == line["mahalanobis"] == scored.mahalanobis
        assert float(row["p_value"]) == scored.p_value
        assert int(row["as_far"]) == (usual.mahalanobis >= scored.mahalanobis).sum()
        assert float(row["error"]) == scored.error
        assert int(row["farthest_vertex"]) == scored.vertex_errors.argmax()
        assert [float(row[f"mode_{i}"]) for i in range(1, 8)] == line["scores"] == scored.scores.tolist()
        assert line["deviations"] == scored.deviations.tolist()
        field = isomatch.read_asset(out / "scored" / f"{row['name']}.ply")
        np.testing.assert_allclose(field.attribute("residual").values, scored.vertex_errors, rtol=1e-5)
        np.testing.assert_allclose(field.points, scored.aligned, atol=1e-6)
    here = {str(path.relative_to(out)) for path in out.rglob("*") if path.is_file()}
    assert {*record["files"], "scored.json"} == here == {"scored.json", "scored.csv", *record["files"]}
    assert (tmp_path / "model.npz").read_bytes() == before
    assert main([*argv, "-o", str(out)]) == 1
    assert "already exists" in one_line(capsys)
    assert main([*argv[:3], str(new), "-o", str(out), "--force", "--json"]) == 0  # a whole folder
    assert [line["name"] for line in json.loads(capsys.readouterr().out)["shapes"]] == [
        f"s{i:03d}" for i in range(10)
    ]


def test_shapes_that_the_model_does_not_describe(tmp_path, capsys):
    ShapeModel.fit(random_shapes(4)).save(tmp_path / "model.npz")
    isomatch.write_mesh(tmp_path / "odd.ply", icosphere(2))
    (tmp_path / "text.ply").write_text("no mesh")
    argv = ["statistics", "project", str(tmp_path / "model.npz"), "-o", str(tmp_path / "out")]
    for file, words in (
        ("odd.ply", "odd.ply: Mesh(162 vertices, 320 faces) has other faces than the model"),
        ("odd.ply", "isomatch collect add"),
        ("text.ply", "text.ply:"),
        ("none.ply", "none.ply: no such file"),
    ):
        assert main([*argv, str(tmp_path / file)]) == 1
        assert words in one_line(capsys)
    assert main(argv) == 1
    assert "no shapes" in one_line(capsys)
    assert not (tmp_path / "out").exists()


@pytest.mark.long
@pytest.mark.parametrize("lengths", [[1.0], [1.0, 1.2], [1.0, 1.0, 1.0]])
def test_few_shapes_and_equal_ones(lengths, tmp_path, capsys):
    folder = write(tmp_path / "shapes", ellipsoids(lengths))
    assert main(["statistics", str(folder), "-o", str(tmp_path / "out"), "--scale", "remove", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["n_modes"] == (1 if len(set(lengths)) > 1 else 0)


@pytest.mark.long
def test_mirror_images_and_doubtful_maps(tmp_path, capsys):
    out = tmp_path / "collection"
    out.mkdir()
    write(out / "corresponded", ellipsoids([1.0, 1.2]))
    (out / "pairs.csv").write_text("source,target,outcome\ne00,t,CONVERGED\ne01,t,LOW_CONFIDENCE\n")
    points = icosphere(2).vertices
    other = np.abs(points[:, None] * [-1, 1, 1] - points).sum(axis=2).argmin(axis=1)
    (tmp_path / "sides.txt").write_text("".join(f"{i}\n" for i in other))
    argv = ["statistics", str(out), "-o", str(tmp_path / "out"), "--mirror", str(tmp_path / "sides.txt")]
    assert main(argv) == 0
    said = capsys.readouterr().out
    assert "4 shapes of 162 vertices vary in 1 mode\n" in said
    assert "note: e01 may be matched wrongly: LOW_CONFIDENCE" in said
    assert "e00 may" not in said
    assert [row["name"] for row in lines_of(tmp_path / "out" / "sizes.csv")] == [
        "e00",
        "e01",
    ]  # the specimens
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert "<h1>Statistics of 2 shapes and their mirror images</h1>" in page


def test_bad_input(folder, tmp_path, capsys):
    out = ["-o", str(tmp_path / "out")]
    assert main(["statistics", str(tmp_path / "none"), *out]) == 1
    assert "no such folder" in one_line(capsys)
    assert main(["statistics", str(folder), *out, "--modes", "-1"]) == 1
    assert "--modes -1" in one_line(capsys)
    groups = tmp_path / "groups.csv"
    for text, message in (
        ("s000,a,b", "groups.csv:1: 's000,a,b' is not a shape and its group"),
        ("name,group\nx,a", "groups.csv:2: no shape is named 'x'"),
        ("s000,a\ns001,b", "groups 'a' of 1, 'b' of 1; give two groups"),
    ):
        groups.write_text(text)
        assert main(["statistics", str(folder), *out, "--groups", str(groups)]) == 1
        assert message in one_line(capsys)
    assert not (tmp_path / "out" / "statistics.json").exists()
    assert main(["statistics", str(folder), *out, "--scale", "double"]) == 2


NAMES = ("Müller, Anna", "patient 2", "p#3", "p;4", "05", "5", "#7")
GROUPS = dict(zip(NAMES, "xxyyxyx"))
ROWS = [(f'"{name}"', group) for name, group in GROUPS.items()]


def table(header, rows, separator=",", end="\n"):
    return end.join(separator.join(row) for row in (*([header] if header else []), *rows)) + end


@pytest.mark.parametrize(
    "data",
    [
        table(("name", "group"), ROWS).encode("utf-8-sig"),
        table(("name", "group"), ROWS).encode("utf-16"),
        table(("name", "group"), ROWS).encode("cp1252"),
        table(("Name", "GROUP"), ROWS, ";", "\r\n").encode(),
        table(("name", "group"), ROWS, "\t").encode(),
        table(("age", "group", "name"), [("20", group, name) for name, group in ROWS]).encode(),
        table(None, ROWS).encode(),
        ("sep=;\n" + table(("name", "group"), ROWS, ";")).encode(),
        table(None, [(*row, "", "") for row in ROWS]).encode(),
        table(None, [(f'"scans/{name}.ply"', group) for name, group in GROUPS.items()]).encode(),
        (
            "# a comment\n" + table(("name", "group"), [*ROWS, ("lost", "x"), ("lost.ply", "y"), ("", "")])
        ).encode(),
        table(("name", "group"), ROWS).replace("ü", "u\u0308").encode(),
    ],
)
def test_tables_of_groups_as_spreadsheets_write_them(data, tmp_path):
    (tmp_path / "groups.csv").write_bytes(data)
    cells = read_shape_cells(tmp_path / "groups.csv", NAMES, ["lost: other faces than most shapes"])
    assert {name: row["group"] for name, row in cells.items() if row["group"]} == GROUPS


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,group\n5,x\n5,y\n", r"groups\.csv:3: '5' is in group 'y' and in 'x'"),
        ("name,group\n5\n", r"groups\.csv:2: '5' is not a shape and its group"),
        (
            "name,sex,age\n5,x,1\n",
            r"groups\.csv:1: 'name,sex,age' is not a shape and its group; write name,group, or",
        ),
        ("name,group\n6,x\n", r"groups\.csv:2: no shape is named '6'"),
    ],
)
def test_odd_tables_of_groups(text, message, tmp_path):
    (tmp_path / "groups.csv").write_text(text)
    with pytest.raises(isomatch.FormatError, match=message):
        read_shape_cells(tmp_path / "groups.csv", NAMES)


@pytest.mark.long
def test_odd_shapes_are_named_before_anything_is_computed(tmp_path, capsys):
    shapes = random_shapes(6)
    vertices = shapes.vertices.copy()
    vertices[2] *= 1000
    vertices[3] *= [-1, 1, 1]
    folder = write(tmp_path / "shapes", shapes.moved(vertices))
    argv = ["statistics", str(folder), "-o", str(tmp_path / "out"), "--quiet"]
    assert main(argv) == 0
    said = capsys.readouterr()
    assert said.out == ""
    assert re.search(r"s002 is \d+ times as large as the others: in mm, if they are in m", said.err)
    assert "s003 fits the others better as its mirror image" in said.err
    record = json.loads((tmp_path / "out" / "statistics.json").read_text())
    assert [(each["kind"], each["names"]) for each in record["doubts"]] == [
        ("units", ["s002"]),
        ("mirrored", ["s003"]),
    ]


@pytest.mark.long
def test_sizes_scores_and_what_size_describes(tmp_path, capsys):
    """Shapes that grow taller as they grow larger."""
    base = random_shapes(9, spread=0.02)
    factors = np.linspace(1, 2, 9)
    taller = (
        base.vertices * factors[:, None, None] * np.stack([np.ones(9), np.ones(9), factors**0.5], -1)[:, None]
    )
    folder = write(tmp_path / "shapes", moved(base.moved(taller)))
    groups = tmp_path / "groups.csv"
    groups.write_text("name,group\n" + "".join(f"s00{i},{'ab'[i // 4]}\n" for i in range(8)))
    out = tmp_path / "out"
    argv = ["statistics", str(folder), "-o", str(out), "--groups", str(groups), "--seed", "3"]
    assert main([*argv, "--pictures", "svg"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    record = json.loads((out / "statistics.json").read_text())
    assert record["allometry"]["r_squared"] > 0.8
    assert (record["allometry"]["p_value"], record["allometry"]["seed"]) == (1 / 5000, 3)
    assert "size describes 8" in said
    assert "p = 0.0002 (4999 permutations, seed 3)" in said
    assert "the groups describe" in said
    table = lines_of(out / "sizes.csv")
    sizes = np.array([float(row["centroid_size"]) for row in table])
    assert (np.diff(sizes) > 0).all()
    np.testing.assert_allclose([float(row["log_centroid_size"]) for row in table], np.log(sizes))
    assert (np.diff([float(row["regression_score"]) for row in table]) > 0).all()
    small, large = (isomatch.read_mesh(out / f"allometry_{end}.ply") for end in ("smallest", "largest"))
    heights = [np.sort(np.ptp(mesh.vertices - mesh.vertices.mean(axis=0), axis=0)) for mesh in (small, large)]
    assert heights[1][0] / heights[1][2] > 1.1 * heights[0][0] / heights[0][2]
    assert not list(out.glob("*.png"))
    assert {"scores", "variance", "groups", "allometry"} <= {path.stem for path in out.glob("*.svg")}


@pytest.mark.long
def test_without_sizes_that_differ_nothing_is_regressed(tmp_path, capsys):
    folder = write(tmp_path / "shapes", ellipsoids([1.0, 1.0, 1.0]))
    assert main(["statistics", str(folder), "-o", str(tmp_path / "out")]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "note: shape was not regressed on size: the variables do not vary" in said
    assert not (tmp_path / "out" / "allometry.png").exists()
    assert len(lines_of(tmp_path / "out" / "sizes.csv")) == 3


def test_an_unknown_format_of_pictures(folder, tmp_path):
    assert main(["statistics", str(folder), "-o", str(tmp_path / "out"), "--pictures", "gif"]) == 2


@pytest.fixture
def model(folder, tmp_path):
    return ShapeModel.fit(read_shapes(folder)), tmp_path / "model.npz"


def test_a_shape_is_completed(model, tmp_path, capsys):
    known, path = model
    known.save(path)
    truth = known.vertices(known.scores[2]) + 5
    holed = truth.copy()
    holed[:9] = np.nan
    isomatch.write_mesh(tmp_path / "part.ply", known.mesh().moved(holed))
    out = tmp_path / "whole.ply"
    argv = ["statistics", "complete", str(path), str(tmp_path / "part.ply"), "-o", str(out)]
    argv += ["--noise", "0.001"]
    assert main(argv) == 0
    said = capsys.readouterr().out
    assert "completed from 33 points" in said
    assert "note        33 of 42 vertices have a position" in said
    whole = isomatch.read_asset(out)
    np.testing.assert_allclose(whole.points, truth, atol=0.01)
    record = json.loads((tmp_path / "whole.json").read_text())
    np.testing.assert_allclose(record["scores"], known.scores[2], atol=0.02)
    deviations = whole.attribute("standard_deviation", "point").values
    assert deviations.max() == pytest.approx(record["largest_standard_deviation"], rel=1e-4)
    assert deviations[:9].mean() > deviations[9:].mean()
    assert main(argv) == 1, "an earlier file is not replaced"


def test_a_shape_is_completed_from_landmarks(model, tmp_path, capsys):
    known, path = model
    known.save(path)
    rows = range(0, 42, 3)
    truth = known.vertices(known.scores[2]) + 5
    mean, found = tmp_path / "mean.csv", tmp_path / "found.csv"
    mean.write_text("name,vertex\n" + "".join(f"p{i},{i}\n" for i in rows))
    places = (f"p{i},{x},{y},{z}\n" for i, (x, y, z) in zip(rows, truth[list(rows)].tolist()))
    found.write_text("name,x,y,z\n" + "".join(places))
    out = str(tmp_path / "whole.ply")
    argv = ["statistics", "complete", str(path), str(found), "-o", out, "--force", "--noise", "0.001"]
    assert main(argv) == 1
    assert "give the landmarks of the mean too" in one_line(capsys)
    assert main([*argv, "--landmarks", str(mean)]) == 0
    np.testing.assert_allclose(isomatch.read_mesh(out).vertices, truth, atol=0.02)
    assert main([*argv[:3], str(mean), *argv[4:], "--landmarks", str(mean)]) == 1
    assert "a vertex says nothing without its surface" in one_line(capsys)
