"""``isomatch statistics`` and ``isomatch asymmetry`` of landmarks: files, numbers, and one line for what is wrong."""

import json
import re

import numpy as np
import pytest

from command_line import one_line
from isomatch import Landmarks
from isomatch.cli import main
from isomatch.cohort import shape_statistics
from isomatch.cohort.shape_statistics import (
    CorrespondedShapes,
    ShapeDesign,
    ShapeModel,
    centroid_sizes,
    charts,
    shape_anova,
)
from isomatch.landmarks import Curve, read_specimens, write_specimens
from small_collections import lines_of

M = 12
AGE = [*range(M)]
GROUPS = ["a", "b", "c"] * 4


@pytest.fixture(autouse=True)
def nothing_drawn(monkeypatch):
    """Pictures are empty files: what is in them is tested in ``shape_statistics``, and takes half a second for each."""
    for name in [name for name in vars(charts) if name.startswith("draw_")]:
        monkeypatch.setattr(shape_statistics, name, lambda path, *_, **__: path.write_bytes(b""))


def configurations(m=M, n=8, dim=3, seed=0):
    """Configurations that grow and change with age; the second half of the landmarks lies opposite the first."""
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(n // 2, dim)) + 2 * np.eye(dim)[0]
    mean = np.concatenate([half, half - 2 * half * np.eye(dim)[0]])
    change = rng.normal(size=(n, dim))
    shapes = mean + 0.02 * np.arange(m)[:, None, None] * change + 0.03 * rng.normal(size=(m, n, dim))
    return shapes * (1 + 0.05 * rng.normal(size=(m, 1, 1)))


@pytest.fixture
def marks(tmp_path):
    """A TPS file of twelve specimens, and a table of them."""
    specimens = {f"s{i}": Landmarks(at) for i, at in enumerate(configurations())}
    write_specimens(tmp_path / "marks.tps", specimens)
    lines = [f"s{i},{GROUPS[i]},{AGE[i]},{'NA' if i == 3 else i % 2}" for i in range(M)]
    (tmp_path / "t.csv").write_text("name,group,age,dose\n" + "\n".join(lines) + "\n")
    return tmp_path / "marks.tps"


def refused(argv, capsys):
    """What a command complains of, which is one line."""
    assert main([str(each) for each in argv]) == 1
    return one_line(capsys)


def test_a_model_of_several_terms(marks, tmp_path, capsys):
    out = tmp_path / "out"
    (tmp_path / "wire.csv").write_text("1,2\n2,3\n")
    argv = ["statistics", marks, "-o", out, "--scale", "remove", "--groups", tmp_path / "t.csv", "--modes", 1]
    argv += ["--model", "size * group + age", "--wireframe", tmp_path / "wire.csv"]
    assert main([str(each) for each in argv]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "12 shapes of 8 landmarks vary in" in said
    assert re.search(r"age describes \d+\.\d% of the variance of shape, F = [\d.]+ on 1, Z = ", said)
    record = json.loads((out / "statistics.json").read_text())
    here = {str(path.relative_to(out)) for path in out.rglob("*") if path.is_file()}
    assert {*record["files"], "statistics.json"} == here
    shapes = CorrespondedShapes.of_landmarks(read_specimens(marks))
    model = ShapeModel.fit(shapes, "remove")
    table = {"size": np.log(centroid_sizes(shapes.vertices)), "group": GROUPS, "age": AGE}
    expected = shape_anova(model.aligned, ShapeDesign.of("size * group + age", table), model.weights)
    assert [row["term"] for row in lines_of(out / "anova.csv")] == [
        *("size", "group", "age", "size:group"),
        "residuals",
        "total",
    ]
    for row, own in zip(lines_of(out / "anova.csv"), expected.rows, strict=True):
        assert float(row["squares"]) == pytest.approx(own.squares)
        assert float(row["p_value"]) == pytest.approx(own.p_value, nan_ok=True)
    pairs = lines_of(out / "pairs.csv")
    assert [(row["of"], row["first"], row["second"]) for row in pairs[:3]] == [
        ("group", *"ab"),
        ("group", *"ac"),
        ("group", *"bc"),
    ]
    assert [row["of"] for row in pairs[3:]] == ["size:group"] * 3
    assert {row["group"] for row in lines_of(out / "classification.csv")} == {*"abc"}
    modes = read_specimens(out / "modes.csv")
    assert [*modes] == ["mean", "mode_1_minus2sd", "mode_1_plus2sd"]
    np.testing.assert_allclose(modes["mode_1_plus2sd"].positions, model.vertices([2 * model.deviations[0]]))
    np.testing.assert_allclose(
        [each.positions for each in read_specimens(out / "aligned.csv").values()], model.aligned
    )
    np.testing.assert_allclose(ShapeModel.load(out / "model.npz").modes, model.modes)
    page = (out / "index.html").read_text()
    assert {"modes.png", "canonical.png", "allometry.png"} <= set(re.findall(r'<img src="([^"]*)"', page))
    assert "Groups in pairs" in page


def test_specimens_without_a_value_are_left_out_of_the_model(marks, tmp_path, capsys):
    argv = ["statistics", str(marks), "-o", str(tmp_path / "out"), "--groups", str(tmp_path / "t.csv")]
    assert main([*argv, "--model", "factor(dose)", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert [row["degrees"] for row in record["terms"]] == [1, 9, 10]
    assert "not in the model 'factor(dose)', as a value is missing: s3" in record["notes"]


def test_groups_may_have_numbers_for_names(marks, tmp_path, capsys):
    (tmp_path / "n.csv").write_text(
        "name;Group;age\n" + "".join(f"s{i};{i % 3};{AGE[i]}\n" for i in range(M))
    )
    argv = ["statistics", str(marks), "-o", str(tmp_path / "out"), "--groups", str(tmp_path / "n.csv")]
    assert main([*argv, "--model", "age + Group", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert [(row["term"], row["degrees"]) for row in record["terms"]][:2] == [("age", 1), ("group", 2)]
    assert [(row["first"], row["second"]) for row in record["pairs"]] == [("0", "1"), ("0", "2"), ("1", "2")]
    assert (record["groups"]["names"], record["groups"]["counts"]) == ([*"012"], [4, 4, 4])


def test_the_plane_and_missing_landmarks(tmp_path, capsys):
    flat = configurations(dim=2)
    flat[4, 1] = np.nan
    write_specimens(tmp_path / "wings.tps", {f"s{i}": Landmarks(at) for i, at in enumerate(flat)})
    argv = ["statistics", str(tmp_path / "wings.tps"), "-o", str(tmp_path / "out")]
    argv += ["--scale", "remove", "--tangent"]
    assert main([*argv, "--quiet"]) == 0
    record = json.loads((tmp_path / "out" / "statistics.json").read_text())
    assert record["missing"] == {"s4": 0.125}
    assert (
        "s4: 12.5% of the landmarks were not measured, and count as the mean of the others" in record["notes"]
    )
    assert read_specimens(tmp_path / "out" / "aligned.csv")["s0"].positions.shape == (8, 2)


def test_semilandmarks_slide_without_meshes(tmp_path, capsys):
    curve = [Curve("edge", (0, 4, 5, 1))]
    specimens = {f"s{i}": Landmarks(at, curves=curve) for i, at in enumerate(configurations())}
    write_specimens(tmp_path / "marks.tps", specimens)
    for criterion in ("bending", "distance"):
        argv = ["statistics", str(tmp_path / "marks.tps"), "-o", str(tmp_path / criterion)]
        argv += ["--slide", criterion]
        assert main([*argv, "--quiet"]) == 0
        slid = lines_of(tmp_path / criterion / "slid.csv")
        if criterion == "bending":
            assert all(float(row["energy_after"]) <= float(row["energy_before"]) for row in slid)
        assert any(float(row["largest"]) > 0.01 for row in slid)
    (tmp_path / "marks_sliders.csv").unlink()
    assert "has no curves nor points of a surface that could slide" in refused([*argv, "--force"], capsys)


def test_object_symmetry_with_replicates(tmp_path, capsys):
    """Landmark i lies opposite i + 4; the same directional asymmetry in all is found."""
    shapes = np.repeat(configurations(6), 2, axis=0) + 0.002 * np.random.default_rng(1).normal(
        size=(12, 8, 3)
    )
    shapes[:, 2] += 0.2
    write_specimens(tmp_path / "marks.csv", {f"s{i}": Landmarks(at) for i, at in enumerate(shapes)})
    (tmp_path / "sides.csv").write_text("left,right\n" + "".join(f"{i},{i + 4}\n" for i in range(1, 5)))
    (tmp_path / "of.csv").write_text("name,group\n" + "".join(f"s{i},i{i // 2}\n" for i in range(12)))
    argv = ["asymmetry", str(tmp_path / "marks.csv"), "-o", str(tmp_path / "out")]
    argv += ["--left-right", str(tmp_path / "sides.csv"), "--individuals", str(tmp_path / "of.csv")]
    assert main([*argv, "--degrees", "dimensions"]) == 0
    assert "fluctuating asymmetry has" in " ".join(capsys.readouterr().out.split())
    found = lines_of(tmp_path / "out" / "anova.csv")
    # four pairs: 12 − 3 − 1 symmetric dimensions, 12 − 3 asymmetric
    assert [int(row["degrees"]) for row in found] == [5 * 8, 9, 5 * 9, 6 * 17]
    assert [float(row["p_value"]) for row in found[1:3]] == [2 / 64, 0.0002]
    directional = lines_of(tmp_path / "out" / "landmarks.csv")
    length = [np.linalg.norm([float(row[f"directional_{x}"]) for x in "xyz"]) for row in directional]
    assert sorted(np.argsort(length)[-2:]) == [2, 6]
    lines = lines_of(tmp_path / "out" / "individuals.csv")
    assert [line["name"] for line in lines] == [f"i{i}" for i in range(6)]
    assert min(float(line["directional"]) for line in lines) > 0
    record = json.loads((tmp_path / "out" / "asymmetry.json").read_text())
    here = {
        str(path.relative_to(tmp_path / "out")) for path in (tmp_path / "out").rglob("*") if path.is_file()
    }
    assert {*record["files"], "asymmetry.json"} == here


def test_matching_symmetry_and_sizes(tmp_path, capsys):
    """Left organs are mirror images that are larger by a tenth: all of the difference of sizes is directional."""
    right = configurations(8)
    names = [f"{side}{i}" for side in ("right", "left") for i in range(8)]
    both = np.concatenate([right, 1.1 * right * [-1, 1, 1]])
    write_specimens(tmp_path / "marks.tps", {name: Landmarks(at) for name, at in zip(names, both)})
    (tmp_path / "pairs.csv").write_text("left,right\n" + "".join(f"left{i},right{i}\n" for i in range(8)))
    argv = ["asymmetry", str(tmp_path / "marks.tps"), "-o", str(tmp_path / "out")]
    argv += ["--pairs", str(tmp_path / "pairs.csv"), "--weights", "uniform", "--json"]
    assert main(argv) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["symmetry"] == "matching"
    sizes = {row["source"]: row for row in record["size_anova"]}
    assert sizes["sides"]["squares"] > 100 * sizes["individuals × sides"]["squares"]
    assert sizes["sides"]["p_value"] == 2 / 2**8
    assert sum(row["share"] for row in record["anova"][1:]) < 1e-12, "shapes of both sides are the same"


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (["--groups", "other.csv"], "no shape is named 'x9'; shapes are named like their files"),
        (
            ["--groups", "t.csv", "--model", "size + weight"],
            "there is no variable 'weight'; the table has size, group, age",
        ),
        (
            ["--groups", "single.csv"],
            "group 'z' has one shape; give two or more of each group, or leave it out",
        ),
        (["--model", "age"], "there is no variable 'age'; the table has size"),
        (
            ["--wireframe", "t.csv"],
            "is no pair of landmarks; write two of their names, or numbers from 1 to 8",
        ),
        (["--tangent"], "have no tangent space; remove the scale"),
        (["--mirror", "auto"], "--mirror auto is for meshes"),
    ],
)
def test_bad_input(option, message, marks, tmp_path, capsys):
    (tmp_path / "other.csv").write_text("name,group\nx9,a\n")
    (tmp_path / "single.csv").write_text(
        "name,group\n" + "".join(f"s{i},{'zab'[min(i, 1 + i % 2)]}\n" for i in range(M))
    )
    option = [tmp_path / each if each.endswith(".csv") else each for each in option]
    assert message in refused(["statistics", marks, "-o", tmp_path / "out", *option], capsys)
    assert not (tmp_path / "out" / "statistics.json").exists()


def test_bad_landmarks(marks, tmp_path, capsys):
    out = ["-o", tmp_path / "out"]
    text = marks.read_text()
    (tmp_path / "mixed.tps").write_text(text + "LM=8\n" + "0 1\n" * 8 + "ID=flat\n")
    assert "those in the plane and those in space apart" in refused(
        ["statistics", tmp_path / "mixed.tps", *out], capsys
    )
    (tmp_path / "few.tps").write_text(text + "LM3=8\n" + "NA NA NA\n" * 6 + "0 0 1\n1 0 0\nID=few\n")
    assert "few lacks 6 of 8 landmarks, more than half; leave it out" in refused(
        ["statistics", tmp_path / "few.tps", *out], capsys
    )
    never = re.sub(r"(LM3=8\n)\S+ \S+ \S+\n", r"\1NA NA NA\n", text)
    (tmp_path / "never.tps").write_text(never)
    assert "the landmark 1 has a place in no specimen; leave it out" in refused(
        ["statistics", tmp_path / "never.tps", *out], capsys
    )
    assert "give a table of pairs of them (--left-right, or --pairs)" in refused(
        ["asymmetry", marks, *out], capsys
    )
    (tmp_path / "sides.csv").write_text("1,2\n2,3\n")
    assert "landmark 2 is in two pairs" in refused(
        ["asymmetry", marks, *out, "--left-right", tmp_path / "sides.csv"], capsys
    )
