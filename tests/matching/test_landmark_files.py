"""Landmarks from files of pairs and of points, and from positions."""

import json

import numpy as np
import pytest

from isomatch import (
    FormatError,
    Graph,
    LandmarkError,
    Mesh,
    MissingFileError,
    nearest_landmarks,
    read_landmarks,
)
from zoo import grid

pytestmark = pytest.mark.usefixtures("prepared_once")
SOURCE = grid(4, 4)
TARGET = Mesh(2 * SOURCE.vertices + [5, 0, 0], SOURCE.faces)
PAIRS = np.array([[0, 3], [5, 6], [15, 12]])
NAMES = "nose", "left, ear", "tail"


def write(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def positions(side):
    mesh = (SOURCE, TARGET)[side]
    return mesh.vertices[PAIRS[:, side]] + 0.001


def lines(rows, separator=" "):
    return "".join(separator.join(map(str, row)) + "\n" for row in rows)


def markups(side, system="LPS", turned=False):
    points = positions(side) * ([-1, -1, 1] if (system == "RAS") != turned else 1)
    control = [
        {"label": name, "position": point, "positionStatus": "defined"}
        for name, point in zip(NAMES, points.tolist())
    ]
    control.append({"label": "unset", "position": [0, 0, 0], "positionStatus": "undefined"})
    return json.dumps({"markups": [{"coordinateSystem": system, "controlPoints": control}]})


def fiducials(side, system="LPS"):
    points = positions(side) * ([-1, -1, 1] if system in ("RAS", "0") else 1)
    head = f"# Markups fiducial file version = 4.11\n# CoordinateSystem = {system}\n# columns = id,x,y,z,ow,label\n"
    rows = [(i, *point, 0, f'"{name}"') for i, (point, name) in enumerate(zip(points.tolist(), NAMES))]
    return head + lines(rows, ",")


def picked(side):
    rows = "".join(
        f'<point x="{x}" y="{y}" z="{z}" active="1" name="{name}"/>'
        for (x, y, z), name in zip(positions(side).tolist(), NAMES)
    )
    off = '<point x="0" y="0" z="9" active="0" name="9"/>'
    return f"<!DOCTYPE PickedPoints>\n<PickedPoints><DocumentData/>{rows}{off}</PickedPoints>"


def table(side):
    quoted = [f'"{name}"' for name in NAMES]
    return "name,X,Y,Z\n" + lines(zip(quoted, *positions(side).T.tolist()), ",")


def vertices(side):
    return "label;vertex\n" + lines(zip((f'"{name}"' for name in NAMES), PAIRS[:, side]), ";")


@pytest.mark.parametrize(
    "text",
    [
        lines(PAIRS),
        "# source, target\n" + lines(PAIRS, ", "),
        "name,source,target\n" + lines(zip("abc", *PAIRS.T), ","),
        "target\tsource\n" + lines(PAIRS[:, ::-1], "\t"),
        lines(np.hstack([positions(0), positions(1)])),
        "source_x,source_y,source_z,target_x,target_y,target_z\n"
        + lines(np.hstack([positions(0), positions(1)]), ","),
    ],
)
def test_a_file_of_pairs(tmp_path, text):
    np.testing.assert_array_equal(read_landmarks(write(tmp_path / "pairs", text), SOURCE, TARGET), PAIRS)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.mrk.json", markups),
        ("a.mrk.json", lambda side: markups(side, "RAS")),
        ("a.fcsv", fiducials),
        ("a.fcsv", lambda side: fiducials(side, "RAS")),
        ("a.fcsv", lambda side: fiducials(side, "0")),
        ("a.pp", picked),
        ("a.csv", table),
        ("a.csv", vertices),
        ("a.txt", lambda side: lines(positions(side))),
        ("a.txt", lambda side: lines(PAIRS[:, [side]])),
    ],
)
def test_two_files_of_points(tmp_path, name, content):
    files = [write(tmp_path / f"{side}_{name}", content(side)) for side in (0, 1)]
    np.testing.assert_array_equal(read_landmarks(files[0], SOURCE, TARGET, files[1]), PAIRS)


def test_points_are_joined_by_name(tmp_path, caplog):
    of_source = write(tmp_path / "here.csv", "name,vertex\na,1\nb,2\nc,3\nd,4\n")
    of_target = write(tmp_path / "there.csv", "vertex,name\n7,c\n8,a\n9,b\n")
    assert read_landmarks(of_source, SOURCE, TARGET, of_target).tolist() == [[1, 8], [2, 9], [3, 7]]
    assert "1 points without a partner" in caplog.text


def test_a_mesh_in_the_other_system_of_slicer(tmp_path, caplog):
    files = [write(tmp_path / f"{side}.mrk.json", markups(side, turned=True)) for side in (0, 1)]
    np.testing.assert_array_equal(read_landmarks(files[0], SOURCE, TARGET, files[1]), PAIRS)
    assert "if it is in RAS" in caplog.text


def test_positions_as_arrays():
    np.testing.assert_array_equal(nearest_landmarks(SOURCE, TARGET, positions(0), positions(1)), PAIRS)
    with pytest.raises(LandmarkError, match="positions"):
        nearest_landmarks(SOURCE, TARGET, [1, 2, 3], positions(1))
    for bad in (np.nan, np.inf):
        with pytest.raises(LandmarkError, match="landmark"):
            nearest_landmarks(SOURCE, TARGET, positions(0), positions(1) + np.outer([0, bad, 0], [1, 1, 1]))
    with pytest.raises(LandmarkError, match="landmarks"):
        nearest_landmarks(SOURCE, TARGET, positions(0)[:2], positions(1))
    with pytest.raises(LandmarkError, match="landmark"):
        nearest_landmarks(SOURCE, TARGET, positions(0), positions(1) + np.outer([0, 9, 0], [0, 0, 1]))
    with pytest.raises(LandmarkError, match="the source is a graph"):
        nearest_landmarks(Graph(2, [[0, 1]], [1.0]), TARGET, positions(0), positions(1))


def test_a_position_somewhat_off_is_reported(caplog):
    points = positions(0)
    points[1, 2] += 0.05 * np.sqrt(SOURCE.area)
    np.testing.assert_array_equal(nearest_landmarks(SOURCE, TARGET, points, positions(1)), PAIRS)
    assert "√area away from all vertices of the source; the nearest one is taken" in caplog.text


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("p.txt", "0 1\n2 x\n", r"p\.txt:2: '2 x' is not a landmark; write two 0-based"),
        ("p.txt", "0 1\n2 3.5\n", r"p\.txt:2: '2 3\.5' is not a landmark"),
        ("p.txt", "0 1 2\n", r"p\.txt:1: '0 1 2' is not a landmark"),
        ("p.txt", "0 0 0 0 0 nan\n", r"p\.txt:1: .* is not a landmark"),
        ("p.txt", "0 0 0 0 0 1e999\n", r"p\.txt:1: .* is not finite"),
        ("p.csv", "source,aim\n1,2\n", r"p\.csv:1: the header 'source, aim' has neither"),
        ("p.csv", "source,target\n1\n", r"p\.csv:2: '1' is not a landmark"),
        ("p.txt", "# none\n", "no landmarks"),
        ("p.pp", picked(0), "points of one shape only"),
    ],
)
def test_bad_files_of_pairs(tmp_path, name, text, message):
    with pytest.raises((FormatError, LandmarkError), match=message):
        read_landmarks(write(tmp_path / name, text), SOURCE, TARGET)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("p.txt", "0 0 0\n0 1\n", r"p\.txt:2: '0 1' is not a point"),
        ("p.csv", "name,x,y\na,1,2\n", r"p\.csv:1: the header .* has neither x, y, z nor vertex"),
        ("p.csv", "name,x,y,z\na,1,2\n", r"p\.csv:2: .* is not a landmark"),
        ("p.txt", "1\n2\n", "2 and 3 points that share no names"),
        ("p.csv", 'name,vertex\nnose,1\n"nose",2\n', "several points have one name"),
        ("p.txt", "# none\n", "no landmarks|share no names"),
        ("p.mrk.json", "{", r"p\.mrk\.json:1: is not JSON"),
        ("p.mrk.json", "[]", "is no list of markups"),
        ("p.mrk.json", markups(0).replace("LPS", "XYZ"), "neither LPS nor RAS"),
        ("p.mrk.json", markups(0).replace("[0.001, ", "["), "three finite numbers"),
        ("p.mrk.json", markups(0).replace("[0.001, ", f"[{10**400}, "), "positions of three numbers"),
        ("p.fcsv", "# columns = id,x,y,z\n1,2,3\n", r"p\.fcsv:2: '1,2,3' has no position"),
        ("p.pp", "<a>\n<b></a>", r"p\.pp:2: is not XML"),
        ("p.pp", '<a><point x="1" y="2"/></a>', r"p\.pp: point 1: .* is not a landmark"),
        ("p.pp", picked(0).replace('x="0.001"', 'x="99"'), r"point 1: .* √area away from all vertices"),
    ],
)
def test_bad_files_of_points(tmp_path, name, text, message):
    of_target = write(tmp_path / "there.csv", table(1))
    with pytest.raises((FormatError, LandmarkError), match=message):
        read_landmarks(write(tmp_path / name, text), SOURCE, TARGET, of_target)


def test_a_missing_file(tmp_path):
    with pytest.raises(MissingFileError, match="no such file"):
        read_landmarks(tmp_path / "none.txt", SOURCE, TARGET)
