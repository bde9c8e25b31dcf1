"""Landmarks of several specimens: files of other programs, each place once, and what geomorph reads of our files."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from isomatch import FormatError, LandmarkError, Landmarks, MissingFileError, write_landmarks
from isomatch.landmarks import Curve, join_places, read_landmark_pairs, read_specimens, write_specimens

RNG = np.random.default_rng(3)
POINTS = RNG.normal(size=(2, 4, 3))
FLAT = POINTS[:, :, :2]


def rows(points, separator=" "):
    return "\n".join(separator.join("NA" if np.isnan(x) else repr(x) for x in row) for row in points.tolist())


def tps(points, dim=3):
    head = {2: "LM", 3: "LM3"}[dim]
    return "".join(f"{head}=4\n{rows(specimen)}\nID=s{i}\n" for i, specimen in enumerate(points))


def wide(points, separator=","):
    head = [f"{mark}_{axis}" for mark in ("nose", "b", "c", "d") for axis in "XYZ"]
    lines = [f"s{i}{separator}" + rows(row[None], separator) for i, row in enumerate(points.reshape(2, -1))]
    return "\n".join([separator.join(["specimen", *head]), *lines])


def long(points):
    places = [(i, mark, place) for i, marks in enumerate(points) for mark, place in zip("abcd", marks)]
    lines = [f"s{i},{mark},{rows(place[None], ',')}" for i, mark, place in places]
    return "\n".join(["specimen,landmark,x,y,z", *lines])


MORPHOLOGIKA = (
    "[individuals]\n2\n[landmarks]\n4\n[dimensions]\n3\n[names]\ns0\ns1\n[labels]\nsex\n[labelvalues]\nf\nm\n"
    f"[rawpoints]\n'#1\n{rows(POINTS[0])}\n\n'#2\n{rows(POINTS[1])}\n[wireframe]\n1 2\n2 4\n"
)
FILES = {
    "a.tps": tps(POINTS),
    "scaled.tps": "COMMENT=one\n"
    + tps(POINTS / 2).replace("ID=", "IMAGE=x.jpg\nID=").replace("ID=s1", "ID=s1\nSCALE=2"),
    "n.nts": f'"comment\n1 2L 12 0 DIM=3\ns0 s1\n{rows(POINTS.reshape(2, -1))}\n',
    "codes.nts": f"1 2L 12 1 -999 dim=3\ns0\ns1\n{rows(POINTS.reshape(8, 3))}\n",
    "labelled.nts": f"1 2L 12L 0 DIM=3\ns0 s1\n{' '.join(f'v{i}' for i in range(12))}\n{rows(POINTS.reshape(2, -1))}",
    "d.dta": f"1 2L 12 1 9999 Dim=3\ns0\ns1\n\n{rows(POINTS[0])}\n\n{rows(POINTS[1])}\n",
    "m.txt": MORPHOLOGIKA,
    "wide.csv": wide(POINTS),
    "semicolons.csv": wide(POINTS, ";").replace(".", ","),
    "r.csv": wide(POINTS).replace("specimen", '""'),
    "long.csv": long(POINTS),
}


@pytest.mark.parametrize("name", FILES)
def test_files_of_other_programs(name, tmp_path):
    (tmp_path / name).write_text(FILES[name])
    found = read_specimens(tmp_path / name)
    assert [*found] == ["s0", "s1"]
    positions = [marks.positions for marks in found.values()]
    scale = [[[0.5]], [[1]]] if name == "scaled.tps" else 1
    np.testing.assert_allclose(positions, POINTS * scale, rtol=1e-12)


def test_missing_and_planar_landmarks(tmp_path):
    points = FLAT.copy()
    points[0, 2] = np.nan
    (tmp_path / "a.tps").write_text(tps(points, 2))
    (tmp_path / "c.nts").write_text(
        f"1 2L 8 1 -999 DIM=2\ns0 s1\n{rows(points.reshape(2, -1)).replace('NA', '-999.0')}"
    )
    for name in ("a.tps", "c.nts"):
        found = read_specimens(tmp_path / name)
        np.testing.assert_array_equal([marks.positions for marks in found.values()], points)
        assert found["s0"].placed.tolist() == [True, True, False, True]


def test_folders(tmp_path):
    """A file for each specimen, whose landmarks may be in another order if they have names."""
    for suffix in (".mrk.json", ".fcsv", ".pts", ".csv"):
        folder = tmp_path / suffix
        folder.mkdir()
        for i, points in enumerate(POINTS):
            order = [*range(4)] if i == 0 or suffix == ".pts" else [3, 1, 0, 2]
            if suffix == ".pts":
                text = "\n".join(f"S00{j} {rows(place[None])}" for j, place in enumerate(points))
                (folder / f"s{i}.pts").write_text(f"Version 1.0\n4\n{text}\n")
            else:
                marks = Landmarks(points[order], ["abcd"[j] for j in order])
                write_landmarks(folder / f"s{i}{suffix}", marks)
        found = read_specimens(folder)
        np.testing.assert_allclose([marks.positions for marks in found.values()], POINTS)
        assert [*found] == ["s0", "s1"]
    (tmp_path / ".fcsv" / "s0.pts").write_text("Version 1.0\n1\na 0 0 0\n")
    with pytest.raises(FormatError, match=r"several kinds, \.fcsv, \.pts"):
        read_specimens(tmp_path / ".fcsv")


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.tps", "", "no landmarks; give a .tps"),
        ("a.tps", "LM=2\n0 0\nID=a\n", r"a\.tps:1: .*has 1 points, and says 2"),
        ("a.tps", "LM=x\n0 0\n", "gives no count"),
        ("a.tps", "LM=1\n0 ?x\n", r"a\.tps:2: .*no position"),
        (
            "a.tps",
            "LM=1\n0 0\nID=a\nLM3=1\n0 0 0\nID=b\n",
            "b has 3 coordinates .* a 2; give those in the plane",
        ),
        ("a.tps", "LM=2\n0 0\n1 1 1\n", "has 2 coordinates, other points"),
        ("a.tps", "LM=1\n0 0\nID=a\nLM=2\n0 0\n1 1\nID=b\n", "b has 2 landmarks, a 1"),
        ("a.tps", "LM=1\n0 0\nID=a\nLM=1\n1 1\nID=a\n", "several specimens are named a"),
        ("a.tps", "LM=1\n0 0\nSCALE=x\n", "SCALE='x' is no number"),
        ("a.nts", "2 2 4 0 DIM=2\n1 2 3 4\n", "does not begin with a line of NTSYS"),
        ("a.nts", "1 2 4 0 DIM=2\n1 2 3 4\n", "4 cells .* 2 × 4 numbers"),
        ("a.txt", "[individuals]\n1\n", "lacks one of"),
        (
            "a.txt",
            "[individuals]\n1\n[landmarks]\n2\n[dimensions]\n2\n[rawpoints]\n0 0\n",
            "1 points, for 1 individuals",
        ),
        ("a.csv", "specimen,a_X,a_Y,a_Z,b_X,b_Y\nx,1,2,3,4,5\n", "landmark 'b' lacks the column"),
        (
            "a.csv",
            "specimen,landmark,x,y\ns,a,0,0\ns,b,1,0\nt,a,0,0\nt,c,1,1\n",
            "t and s do not both have the landmark 'b'",
        ),
    ],
)
def test_bad_files(name, text, message, tmp_path):
    (tmp_path / name).write_text(text)
    with pytest.raises((FormatError, LandmarkError), match=message) as error:
        read_specimens(tmp_path / name)
    assert "\n" not in str(error.value)


def test_what_there_is_not(tmp_path):
    with pytest.raises(MissingFileError):
        read_specimens(tmp_path / "none.tps")
    with pytest.raises(MissingFileError):
        read_specimens(tmp_path / "none")
    (tmp_path / "a.tps").write_text(tps(POINTS))
    with pytest.raises(FormatError, match="of 2 specimens"):
        Landmarks.read(tmp_path / "a.tps")
    with pytest.raises(LandmarkError, match=r"in the plane; write \.tps or \.csv"):
        write_landmarks(tmp_path / "flat.fcsv", Landmarks(FLAT[0]))
    (tmp_path / "flat.tps").write_text(tps(FLAT[:1], 2))
    with pytest.raises(LandmarkError, match="in the plane"):
        Landmarks.read(tmp_path / "flat.tps", (POINTS[0], [[0, 1, 2]]))


def meeting_curves(seed=0):
    """Two landmarks; a curve that joins them, one from its middle, a closed one; a patch; places are repeated."""
    rng = np.random.default_rng(seed)
    nose, tail, *inner = rng.normal(size=(20, 3))
    points = [nose, *inner[:2], tail, nose, *inner[2:5], tail, inner[3], *inner[5:7], *inner[7:10]]
    names = ["nose", "surface-1", "surface-2", "tail", *(f"c{i}" for i in range(11))]
    curves = [Curve("ridge", (4, 5, 6, 7, 8)), Curve("branch", (9, 10, 11)), Curve("rim", (12, 13, 14), True)]
    return Landmarks(points, names, curves)


def test_each_place_is_given_once():
    specimens = {f"s{i}": meeting_curves(i) for i in range(3)}
    joined, place = join_places(specimens)
    first = joined["s0"]
    assert " ".join(first.names) == "nose tail c1 c2 c3 c6 c7 c8 c9 c10 surface-1 surface-2"
    curves = {curve.name: [first.names[row] for row in curve.rows] for curve in first.curves}
    assert curves == {  # the ridge ends where the branch begins, so that this place stays
        "ridge": ["nose", "c1", "c2"],
        "ridge 2": ["c2", "c3", "tail"],
        "branch": ["c2", "c6", "c7"],
        "rim": ["c8", "c9", "c10"],
    }
    for name, marks in specimens.items():
        np.testing.assert_array_equal(joined[name].positions[place], marks.positions)
    again, same = join_places(joined)
    assert again["s1"].names == first.names
    assert same.tolist() == [*range(12)]
    marks = meeting_curves()
    distinct = {"s0": marks, "s1": Landmarks(RNG.normal(size=(15, 3)), marks.names, marks.curves)}
    assert len(join_places(distinct)[0]["s0"]) == 15, (
        "points that coincide in one specimen only are two places"
    )


def test_sliders_name_the_landmarks(tmp_path):
    specimens = {f"s{i}": meeting_curves(i) for i in range(3)}
    assert write_specimens(tmp_path / "l.tps", specimens) == []
    write_specimens(tmp_path / "l.csv", specimens)
    lines = (tmp_path / "l_sliders.csv").read_text().split()
    assert lines == ["before,slide,after", "1,3,4", "4,5,2", "4,6,7", "8,9,10", "9,10,8"]
    assert (tmp_path / "l_surfaces.csv").read_text().split() == ["slide", "11", "12"]
    joined, _ = join_places(specimens)
    for name in ("l.tps", "l.csv"):  # and so they are read again
        found = read_specimens(tmp_path / name)
        for specimen, marks in joined.items():
            np.testing.assert_array_equal(found[specimen].positions, marks.positions)
            assert [curve[1:] for curve in found[specimen].curves] == [curve[1:] for curve in marks.curves]
            assert found[specimen].patch == marks.patch
    (tmp_path / "l_sliders.csv").write_text("before,slide,after\n1,3,13\n")
    with pytest.raises(FormatError, match="numbers of landmarks from 1 to 12"):
        read_specimens(tmp_path / "l.tps")


def test_a_place_that_is_missing_in_one_of_two_is_taken_from_the_other():
    marks = Landmarks([[0, 0, 0], [1, 0, 0], [np.nan] * 3, [0, 1, 0]], [*"abcd"], [Curve("k", (2, 3))])
    other = Landmarks([[0, 0, 0], [1, 0, 0], [0, 0, 0], [0, 1, 0]], [*"abcd"], [Curve("k", (2, 3))])
    joined, place = join_places({"s": marks, "t": other})
    assert (joined["s"].names, place.tolist()) == (("a", "b", "d"), [0, 1, 0, 2])
    assert joined["s"].placed.all()


def test_names_that_geomorph_takes_for_other_lines_are_told(tmp_path):
    marks = Landmarks(POINTS[0])
    names = ["SCALE5", "a", "IMAGE", "x LM3=2", "scale", "GRID=1"]
    commands = write_specimens(tmp_path / "l.tps", dict.fromkeys(names, marks))
    assert commands == ["SCALE5", "x LM3=2", "GRID=1"]
    assert write_specimens(tmp_path / "l.csv", {"SCALE5": marks}) == []


def test_pairs_of_landmarks(tmp_path):
    for text in ("left,right\na,c\nb,b\n", "1;3\n2;2\n", "a c\n2 b\n"):
        (tmp_path / "p.csv").write_text(text)
        assert read_landmark_pairs(tmp_path / "p.csv", [*"abc"]) == [(0, 2), (1, 1)]
    (tmp_path / "p.csv").write_text("a,c\na,x\n")
    with pytest.raises(
        FormatError, match=r"p\.csv:2: 'a,x' is no pair of landmarks; write two of their names"
    ):
        read_landmark_pairs(tmp_path / "p.csv", [*"abc"])


@pytest.mark.long
def test_the_lines_of_r_on_the_page_run(tmp_path):
    """Where R and geomorph are: curves that share landmarks, a patch, and no singular matrix."""
    program = shutil.which("Rscript")
    ask = ["-e", "options(rgl.useNULL = TRUE); suppressMessages(library(geomorph))"]
    if not program or subprocess.run([program, *ask], capture_output=True).returncode:
        pytest.skip("needs R with the package geomorph")
    marks = meeting_curves()
    specimens = {}
    for i in range(6):
        bend = 0.05 * np.sin(marks.positions[:, [1, 2, 0]] * (1 + 0.2 * i))
        specimens[f"s{i}"] = Landmarks(marks.positions + bend, marks.names, marks.curves)
    (tmp_path / "carried").mkdir()
    for name in ("landmarks.tps", "landmarks.csv"):
        write_specimens(tmp_path / "carried" / name, specimens)
    page = (Path(__file__).parents[2] / "docs" / "wishes" / "landmarks_to_fifty.md").read_text(
        encoding="utf-8"
    )
    found = re.findall(r"```r\n(.*?)```", page, re.DOTALL)
    assert found
    for lines in found:
        check = "stopifnot(is.finite(aligned$coords), max(abs(aligned$coords)) < 1, dim(land)[1] == 12)\n"
        (tmp_path / "lines.R").write_text(f"options(rgl.useNULL = TRUE)\n{lines}\n{check}")
        ran = subprocess.run([program, "lines.R"], cwd=tmp_path, capture_output=True, text=True)
        assert ran.returncode == 0, ran.stderr
