"""Landmarks of one shape: any format to any other, the systems of 3D Slicer, places on faces, curves, medians."""

import csv
import json
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from isomatch import (
    Asset,
    FormatError,
    LandmarkError,
    Landmarks,
    Mesh,
    PointCloud,
    median_landmarks,
    write_landmarks,
)
from isomatch.io import Frame
from isomatch.landmarks import Curve, draw_curve, equally_spaced, join_places, write_specimens
from isomatch.surfaces import nearest_on_surface
from shapes import box, flat_grid, icosphere
from zoo.made import moved, together

SPHERE = icosphere(3)
SQUARE = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
SHIFTED = SPHERE.moved(np.add(SPHERE.vertices, [5, 2, 0]))
NAMES = ("nose", "left, ear", "p#;4", "#1", "-Müller 'x' <&>")
FORMATS = ("a.mrk.json", "a.fcsv", "a.pp", "a.csv")


def on_faces(mesh, n, seed=0):
    """Random points inside triangles."""
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet([1, 1, 1], n)
    corners = mesh.vertices[mesh.faces[rng.integers(len(mesh.faces), size=n)]]
    return np.einsum("ij,ijk->ik", weights, corners)


@pytest.fixture
def marks():
    points = on_faces(SPHERE, 5)
    points[3] = np.nan
    return Landmarks(points, NAMES, axes="RAS")


@pytest.mark.parametrize("last", FORMATS)
@pytest.mark.parametrize("first", FORMATS)
def test_any_format_becomes_any_other(tmp_path, marks, first, last):
    """Names, order and the last digit stay; only fcsv has no place for a landmark without a place."""
    sphere = in_space(SPHERE, "RAS")
    lost = write_landmarks(tmp_path / first, marks)
    between = Landmarks.read(tmp_path / first, sphere)
    lost += write_landmarks(tmp_path / f"again_{last}", between)
    found = Landmarks.read(tmp_path / f"again_{last}", sphere)
    rows = [0, 1, 2, 4] if "a.fcsv" in (first, last) else [0, 1, 2, 3, 4]
    assert found.names == tuple(NAMES[i] for i in rows)
    np.testing.assert_array_equal(found.positions, marks.positions[rows])
    assert ("landmarks without a place" in lost) == (len(rows) < 5)
    assert lost.count("the space (RAS)") == (first in FORMATS[2:]) + (last in FORMATS[2:])


def test_files_of_slicer_say_the_space_of_the_surface(tmp_path, marks):
    """As another program reads them: positions of the surface, and its space; without one, LPS."""
    for name, read in (
        ("a.mrk.json", lambda text: json.loads(text)["markups"][0]["controlPoints"][0]["position"]),
        ("a.fcsv", lambda text: [float(x) for x in text.splitlines()[3].split(",")[1:4]]),
    ):
        for axes, written, absent in (("RAS", "RAS", "LPS"), ("LPS", "LPS", "RAS"), (None, "LPS", "RAS")):
            write_landmarks(tmp_path / name, replace(marks, axes=axes))
            text = (tmp_path / name).read_text()
            assert written in text
            assert absent not in text
            assert read(text) == marks.positions[0].tolist()


def in_space(mesh, axes):
    return replace(Asset.of_mesh(mesh), frame=Frame(words=(f"SPACE={axes}",)))


@pytest.mark.parametrize("file_axes", ["RAS", "LPS"])
@pytest.mark.parametrize("surface_axes", ["RAS", "LPS", None])
def test_points_are_brought_into_the_space_of_the_surface(tmp_path, caplog, file_axes, surface_axes):
    """If the surface says none, the points tell which it is in: half a turn moves it far away."""
    truth = on_faces(SHIFTED, 4)
    turn = 1 if surface_axes in (file_axes, None) else np.array([-1.0, -1.0, 1.0])
    write_landmarks(tmp_path / "a.fcsv", Landmarks(truth * turn, "abcd", axes=file_axes))
    surface = in_space(SHIFTED, surface_axes) if surface_axes else SHIFTED
    found = Landmarks.read(tmp_path / "a.fcsv", surface)
    np.testing.assert_array_equal(found.positions, truth)
    assert found.axes == (surface_axes or file_axes)
    assert ("if it is in RAS" in caplog.text) == (surface_axes is None and file_axes == "RAS")


def test_left_stays_left_on_a_body_that_half_a_turn_carries_onto_itself(tmp_path, caplog):
    """On a sphere any turn fits: what the files say decides, and without that a warning says what was taken."""
    left = Landmarks([[-1.0, 0, 0], [0, 0, 1]], ["left", "top"], axes="RAS")
    write_landmarks(tmp_path / "a.mrk.json", left)
    assert Landmarks.read(tmp_path / "a.mrk.json", in_space(SPHERE, "RAS"))["left"].tolist() == [-1, 0, 0]
    assert Landmarks.read(tmp_path / "a.mrk.json", in_space(SPHERE, "LPS"))["left"].tolist() == [1, 0, 0]
    assert not caplog.text
    assert Landmarks.read(tmp_path / "a.mrk.json", SPHERE).axes == "LPS"
    assert "in RAS and in LPS, which is taken" in caplog.text


def test_points_a_little_off_the_surface_are_not_refused(tmp_path):
    """0.09 √area off, so that neither space fits much better than the other."""
    body = SPHERE.moved(SPHERE.vertices + np.array([0.1, 0, 0]))
    points = on_faces(SPHERE, 4) * (1 + 0.09 * np.sqrt(SPHERE.area)) + np.array([0.1, 0, 0])
    write_landmarks(tmp_path / "a.fcsv", Landmarks(points, "abcd", axes="RAS"))
    turned = body.moved(body.vertices * [-1, -1, 1])
    found = Landmarks.read(tmp_path / "a.fcsv", in_space(turned, "LPS"))
    np.testing.assert_array_equal(found.positions, points * [-1, -1, 1])
    found = Landmarks.read(tmp_path / "a.fcsv", body)
    np.testing.assert_array_equal(found.positions, points)


def test_a_wrong_space_is_named(tmp_path):
    write_landmarks(tmp_path / "a.fcsv", Landmarks(on_faces(SHIFTED, 4), "abcd", axes="LPS"))
    with pytest.raises(LandmarkError, match=r"one of the files says the wrong space: .* half a turn"):
        Landmarks.read(tmp_path / "a.fcsv", in_space(SHIFTED, "RAS"))


def test_a_table_says_no_space_and_the_surface_decides(tmp_path, caplog):
    truth = on_faces(SHIFTED, 4)
    write_landmarks(tmp_path / "a.csv", Landmarks(truth, "abcd"))
    write_landmarks(tmp_path / "b.pp", Landmarks(truth * [-1, -1, 1], "abcd"))
    np.testing.assert_array_equal(Landmarks.read(tmp_path / "a.csv", SHIFTED).positions, truth)
    assert not caplog.text
    np.testing.assert_array_equal(Landmarks.read(tmp_path / "b.pp", SHIFTED).positions, truth)
    assert "after half a turn" in caplog.text


def test_points_in_the_scanner_are_brought_to_a_surface_with_an_offset(tmp_path):
    """A GIFTI matrix leads from the surface to the scanner; points were marked there, or on the surface itself."""
    matrix = np.eye(4)
    matrix[:3, 3] = [5, -20, 30]
    brain = replace(Asset.of_mesh(SPHERE), frame=Frame("unknown", "scanner_anat", matrix))
    truth = on_faces(SPHERE, 4)
    for name, points, axes in (
        ("a.fcsv", truth + matrix[:3, 3], "RAS"),
        ("b.fcsv", (truth + matrix[:3, 3]) * [-1, -1, 1], "LPS"),
        ("c.fcsv", truth, "RAS"),
    ):
        write_landmarks(tmp_path / name, Landmarks(points, "abcd", axes=axes))
        found = Landmarks.read(tmp_path / name, brain)
        np.testing.assert_allclose(found.positions, truth, atol=1e-12)
        assert found.axes == "RAS"


def test_letters_of_windows_stay_apart(tmp_path):
    table = "name,x,y,z,curve\nä,1,0,0,ä\nö,0,1,0,ä\nü,0,0,1,ö\nß,0,0,-1,ö\n"
    (tmp_path / "a.csv").write_text(table, encoding="cp1252")
    found = Landmarks.read(tmp_path / "a.csv", SPHERE)
    assert (found.names, found.curves) == ((*"äöüß",), (Curve("ä", (0, 1)), Curve("ö", (2, 3))))
    (tmp_path / "a.fcsv").write_text("# columns = id,x,y,z,label\n1,1,0,0,ä\n2,0,1,0,ö\n", encoding="cp1252")
    assert Landmarks.read(tmp_path / "a.fcsv", SPHERE).names == ("ä", "ö")


def test_a_table_of_vertices_and_one_without_places(tmp_path):
    (tmp_path / "a.csv").write_text("name;vertex\na;7\nb;NA\n")
    found = Landmarks.read(tmp_path / "a.csv", SPHERE)
    np.testing.assert_array_equal(found.positions, [SPHERE.vertices[7], [np.nan] * 3])
    (tmp_path / "a.csv").write_text("name;vertex\na;9999\n")
    with pytest.raises(LandmarkError, match="9999"):
        Landmarks.read(tmp_path / "a.csv", SPHERE)


def test_a_point_in_the_middle_of_a_large_face_is_on_the_surface(tmp_path, caplog):
    cube = Mesh(box(1, 1, 1).vertices * 10, box(1, 1, 1).faces)
    (tmp_path / "a.txt").write_text("5 5.1 10\n")
    assert Landmarks.read(tmp_path / "a.txt", cube).positions.tolist() == [[5, 5.1, 10]]
    assert not caplog.records
    (tmp_path / "a.txt").write_text("5 5 30\n")
    with pytest.raises(LandmarkError, match=r"0\.816"):
        Landmarks.read(tmp_path / "a.txt", cube)


@pytest.mark.long
def test_nearest_point_of_all_triangles():
    """Against the exhaustive search, on a mesh of long triangles whose nearest vertices belong to others."""
    rng = np.random.default_rng(1)
    mesh = Mesh(rng.random((40, 3)) * [10, 1, 1], rng.integers(40, size=(60, 3)))
    queries = rng.random((200, 3)) * [10, 1, 1]
    found = nearest_on_surface(mesh, queries)
    distance = np.linalg.norm(found.interpolated(mesh.vertices) - queries, axis=1)
    u = np.linspace(0, 1, 41)
    s, t = (grid.ravel() for grid in np.meshgrid(u, u))
    inside = s + t <= 1
    weights = np.stack([1 - s - t, s, t], axis=1)[inside]
    samples = np.einsum("ka,fad->fkd", weights, mesh.vertices[mesh.faces]).reshape(-1, 3)
    sampled = np.linalg.norm(queries[:, None] - samples, axis=2).min(axis=1)
    assert (distance <= sampled + 1e-12).all()
    assert (sampled - distance).max() < 0.3
    np.testing.assert_allclose(found.barycentric.sum(axis=1), 1)


def test_one_large_triangle_takes_no_memory():
    grid = flat_grid(50, 50)
    larger = together(grid, Mesh([[-500, -500, -9], [500, -500, -9], [0, 900, -9]], [[0, 1, 2]]))
    queries = np.add(grid.vertices[:200], [0, 0, 0.1])
    peaks = []
    for mesh in (grid, grid, larger):
        tracemalloc.start()
        nearest_on_surface(mesh, queries)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[2] < 2 * peaks[1]


def test_vertices_without_faces_are_no_part_of_a_surface():
    queries = 1.001 * on_faces(SPHERE, 9)
    with_loose = Mesh(np.vstack([SPHERE.vertices, queries, np.full((1, 3), np.nan)]), SPHERE.faces)
    found, expected = (
        nearest_on_surface(mesh, queries).interpolated(SPHERE.vertices) for mesh in (with_loose, SPHERE)
    )
    np.testing.assert_array_equal(found, expected)


def test_nearest_point_of_a_cloud():
    cloud = PointCloud(SPHERE.vertices)
    found = nearest_on_surface(cloud, 1.01 * SPHERE.vertices[[3, 8]])
    np.testing.assert_array_equal(found.interpolated(cloud.vertices), SPHERE.vertices[[3, 8]])


def test_a_curve_on_a_sphere_is_a_great_circle():
    """Through two points, its length is the angle between them; its points are equally far from each other."""
    fine = icosphere(5)
    ends = np.array([[1.0, 0, 0], [0, 0, 1.0]])
    path = draw_curve(fine, ends, closed=False)
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).sum() == pytest.approx(np.pi / 2, rel=1e-3)
    assert np.abs(path[:, 1]).max() < 1e-3
    piece, share = equally_spaced(path, 7, closed=False)
    points = path[piece] + share[:, None] * (path[piece + 1] - path[piece])
    angles = np.arctan2(points[:, 2], points[:, 0])
    np.testing.assert_allclose(angles, np.linspace(0, np.pi / 2, 7), atol=2e-3)


def test_a_closed_curve_returns_to_its_first_point():
    corners = np.array([[1.0, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    path = draw_curve(icosphere(5), corners, closed=True)
    np.testing.assert_array_equal(path[0], path[-1])
    piece, share = equally_spaced(path, 8, closed=True)
    points = path[piece] + share[:, None] * (path[piece + 1] - path[piece])
    np.testing.assert_allclose(
        np.unwrap(np.arctan2(points[:, 1], points[:, 0])), np.arange(8) * np.pi / 4, atol=2e-3
    )


def test_a_curve_on_points():
    cloud = PointCloud(icosphere(4).vertices)
    path = draw_curve(cloud, np.array([[1.0, 0, 0], [0, 0, 1.0]]), closed=False)
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).sum() == pytest.approx(np.pi / 2, rel=0.03)


def test_a_curve_that_leaves_the_surface():
    near = flat_grid(4, 4)
    two = together(near, moved(near, [20, 0, 0]))
    with pytest.raises(LandmarkError, match="suture"):
        draw_curve(two, np.array([[0.0, 0, 0], [1, 1, 0], [21, 0, 0]]), closed=False, name="suture")
    with pytest.raises(LandmarkError, match="two points"):
        draw_curve(near, np.zeros((1, 3)), closed=False)


def test_curves_survive_their_files(tmp_path):
    curves = Curve("suture", (1, 2, 3)), Curve("rim", (4, 5, 6), True)
    marks = Landmarks(on_faces(SPHERE, 7), [*"abcdefg"], curves)
    for name in ("a.mrk.json", "a.csv"):
        assert write_landmarks(tmp_path / name, marks) == ()
        found = Landmarks.read(tmp_path / name, SPHERE)
        assert (found.names, found.curves) == (marks.names, marks.curves)
    assert write_landmarks(tmp_path / "a.pp", marks) == ("curves",)
    markups = json.loads((tmp_path / "a.mrk.json").read_text())["markups"]
    sizes = [(markup["type"], len(markup["controlPoints"])) for markup in markups]
    assert sizes == [("Fiducial", 1), ("Curve", 3), ("ClosedCurve", 3)]


def test_surface_semilandmarks_are_a_list_of_their_own(tmp_path):
    marks = Landmarks(on_faces(SPHERE, 4), [*"abcd"], [Curve("rim", (2, 3))]).with_patch(on_faces(SPHERE, 3))
    write_landmarks(tmp_path / "a.mrk.json", marks)
    markups = json.loads((tmp_path / "a.mrk.json").read_text())["markups"]
    assert [(each["name"], len(each["controlPoints"])) for each in markups] == [
        ("a", 2),
        ("rim", 2),
        ("a semilandmarks", 3),
    ]
    found = Landmarks.read(tmp_path / "a.mrk.json", SPHERE)
    assert (found.names, found.curves, found.patch) == (marks.names, marks.curves, [4, 5, 6])
    assert found.semilandmarks == [2, 3, 4, 5, 6]


def test_a_curve_with_others_between_its_points_survives_its_files(tmp_path):
    marks = Landmarks(on_faces(SPHERE, 5), [*"abcde"], [Curve("suture", (0, 2, 4))])
    for name, order in (("a.mrk.json", "acebd"), ("a.csv", "abcde")):
        write_landmarks(tmp_path / name, marks)
        found = Landmarks.read(tmp_path / name, SPHERE)
        assert found.names == (*order,)
        (curve,) = found.curves
        assert [found.names[row] for row in curve.rows] == ["a", "c", "e"]


@pytest.mark.parametrize(("rows", "message"), [((0, 1, 1), "each once"), ((3, 4), "0 to 3")])
def test_curves_go_through_landmarks_that_there_are_each_once(rows, message):
    with pytest.raises(LandmarkError, match=message):
        Landmarks(np.zeros((4, 3)), curves=[Curve("rim", rows)])


def test_a_file_of_one_shape_has_curves_apart(tmp_path):
    """Two curves that share a landmark, one of them backwards, are the same after writing and joining again."""
    points = on_faces(SPHERE, 5)
    marks = Landmarks(points, [*"abcde"], [Curve("one", (0, 1, 2)), Curve("two", (4, 3, 2))])
    for name in ("m.mrk.json", "m.csv"):
        write_landmarks(tmp_path / name, marks)
        read = Landmarks.read(tmp_path / name)
        assert len(read) == 6
        joined = join_places({"m": read})[0]["m"]
        assert [[joined.names[row] for row in curve.rows] for curve in joined.curves] == [[*"abc"], [*"edc"]]
        np.testing.assert_allclose([joined[name] for name in "abcde"], points)


def test_two_curves_of_one_name_stay_two(tmp_path):
    points = on_faces(SPHERE, 4).tolist()
    markup = {"type": "Curve", "name": "C", "coordinateSystem": "LPS"}
    markups = [
        {**markup, "controlPoints": [{"label": "", "position": point} for point in half]}
        for half in (points[:2], points[2:])
    ]
    (tmp_path / "a.mrk.json").write_text(json.dumps({"markups": markups}))
    curves = Landmarks.read(tmp_path / "a.mrk.json", SPHERE).curves
    assert curves == (Curve("C", (0, 1)), Curve("C 2", (2, 3)))


def test_files_without_landmarks_or_a_known_suffix(tmp_path, marks):
    with pytest.raises(FormatError, match="xyz"):
        write_landmarks(tmp_path / "a.xyz", marks)
    (tmp_path / "a.csv").write_text("name,x,y,z\n")
    with pytest.raises(LandmarkError, match="no landmarks"):
        Landmarks.read(tmp_path / "a.csv", SPHERE)
    with pytest.raises(LandmarkError, match="names"):
        Landmarks(np.zeros((2, 3)), ["a"])
    with pytest.raises(LandmarkError, match="tail"):
        marks["tail"]


def read_tps(text):
    """Landmarks of each specimen as geomorph's ``readland.tps`` takes them apart."""
    lines = text.splitlines()
    counts = [int(line[4:]) for line in lines if line.startswith("LM3=")]
    names = [line[3:] for line in lines if line.startswith("ID=")]
    points = [
        [float(cell.replace("NA", "nan")) for cell in line.split()] for line in lines if "=" not in line
    ]
    return counts, np.array(points).reshape(len(names), -1, 3), names


def test_files_for_geomorph(tmp_path):
    points = on_faces(SPHERE, 9)
    points[0] = np.nan
    curves = [Curve("suture", (1, 2, 3)), Curve("rim", (5, 6, 7, 8), True)]
    one = Landmarks(points, [*"abcdefghi"], curves)
    two = Landmarks(2 * points, [*"abcdefghi"], curves)
    write_specimens(tmp_path / "s.tps", {"one": one, "t=wo": two})
    counts, arrays, names = read_tps((tmp_path / "s.tps").read_text())
    order = [0, 4, 1, 2, 3, 5, 6, 7, 8]
    assert (counts, names) == ([9, 9], ["one", "t=wo"])
    np.testing.assert_array_equal(arrays, [points[order], 2 * points[order]])
    with (tmp_path / "s_sliders.csv").open() as file:
        sliders = [tuple(map(int, row.values())) for row in csv.DictReader(file)]
    assert sliders == [(3, 4, 5), (6, 7, 8), (7, 8, 9), (8, 9, 6)]

    write_specimens(tmp_path / "s.csv", {"one": one, "two": two})
    with (tmp_path / "s.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0])[:7] == ["specimen", "a_X", "a_Y", "a_Z", "e_X", "e_Y", "e_Z"]
    assert rows[0]["a_X"] == "NA"
    assert float(rows[1]["i_Z"]) == 2 * points[8, 2]
    with pytest.raises(LandmarkError, match="two"):
        write_specimens(tmp_path / "s.csv", {"one": one, "two": Landmarks(points)})


def test_the_median_withstands_one_wrong_template():
    truth = on_faces(SPHERE, 20)
    wrong = Landmarks(-truth, [f"p{i}" for i in range(20)])
    near = [Landmarks(truth, wrong.names), Landmarks(truth + 1e-9, wrong.names)]
    found = median_landmarks([wrong, *near], SPHERE)
    np.testing.assert_allclose(found.positions, truth, atol=1e-8)
    np.testing.assert_allclose(found.spread, 2 * np.linalg.norm(truth, axis=1) / 3, atol=1e-6)


def test_one_template_has_no_spread():
    a, b = on_faces(SPHERE, 2)
    assert np.isnan(median_landmarks([Landmarks([a])], SPHERE).spread).all()
    several = [Landmarks([a, b], ["a", "b"]), Landmarks([b], ["b"])]
    assert np.isnan(median_landmarks(several, SPHERE).spread).tolist() == [True, False]


def test_templates_that_agree_are_expected_to_be_nearer_than_one_alone():
    """Errors of templates have a common part and a part of their own; the spread predicts the error of the median."""
    plane, rng = flat_grid(20, 20), np.random.default_rng(0)
    truth = np.column_stack([rng.uniform(8, 11, (400, 2)), np.zeros(400)])

    def noise(size):
        return np.column_stack([rng.normal(0, size, (400, 2)), np.zeros(400)])

    for count in (3, 12):
        common = noise(0.1)
        templates = [truth + common + noise(0.18) for _ in range(count)]
        alone = np.linalg.norm(templates[0] - truth, axis=1).mean()
        several = [Landmarks(points, expected_error=np.full(400, alone)) for points in templates]
        found = median_landmarks(several, plane)
        error = np.linalg.norm(found.positions - truth, axis=1).mean()
        assert 0.8 * error < found.expected_error.mean() < 1.25 * error < alone
    assert median_landmarks(several[:1], plane).expected_error.tolist() == [alone] * 400


def test_the_median_of_three_points_is_the_point_of_fermat():
    """In an equilateral triangle the centre, and at an angle beyond 120° the corner."""
    plane = flat_grid(3, 3)
    corners = [[[0.2, 0.2, 0]], [[1.8, 0.2, 0]], [[1.0, 0.2 + 0.8 * 3**0.5, 0]]]
    found = median_landmarks([*map(Landmarks, corners)], plane)
    np.testing.assert_allclose(found.positions, [[1.0, 0.2 + 0.8 / 3**0.5, 0]], atol=1e-9)
    flat = [[[0.2, 0.2, 0]], [[1.8, 0.2, 0]], [[1.0, 0.3, 0]]]
    assert median_landmarks([*map(Landmarks, flat)], plane).positions.tolist() == [[1.0, 0.3, 0]]


def test_medians_are_joined_by_name_and_leave_out_what_is_missing(caplog):
    a, b, c = on_faces(SPHERE, 3)
    several = [Landmarks([a, b], ["a", "b"]), Landmarks([b, a, c], ["b", "a", "c"]), Landmarks([a], ["a"])]
    found = median_landmarks(several, SPHERE)
    assert found.names == ("a", "b")
    np.testing.assert_allclose(found.positions, [a, b], atol=1e-12)
    assert "not in all templates: c" in caplog.text
    nowhere = Landmarks([[np.nan] * 3, b], ["a", "b"])
    found = median_landmarks([nowhere, nowhere], SPHERE)
    np.testing.assert_allclose(found.positions, [[np.nan] * 3, b], atol=1e-12)
    with pytest.raises(LandmarkError, match="name"):
        median_landmarks([Landmarks([a, b], ["x", "x"]), Landmarks([a, b], ["y", "y"])], SPHERE)
    with pytest.raises(LandmarkError, match="template"):
        median_landmarks([], SPHERE)


NOWHERE_IN = {
    "words.csv": "name,x,y,z\na,0.5,0.25,0\nb,-,-,-\nc,NaN,NaN,NaN\nd,,,\ne,1,1,0\n",
    "numbers.csv": "name,x,y,z\na,0.5,0.25,0\nb,9999,9999,9999\nc,-9999,-9999,-9999\nd,n/a,n/a,n/a\ne,1,1,0\n",
    "a.pts": "Version 1.0\n5\na 0.5 0.25 0\nb 9999 9999 9999\nc -9999 -9999 -9999\nd - - -\ne 1 1 0\n",
    "a.fcsv": "# CoordinateSystem = LPS\n# columns = id,x,y,z,label\n"
    "1,0.5,0.25,0,a\n2,nan,nan,nan,b\n3,,,,c\n4,9999,9999,9999,d\n5,1,1,0,e\n",
    "a.pp": "<PickedPoints>"
    + "".join(
        f'<point x="{x}" y="{y}" z="{z}" active="1" name="{name}"/>'
        for name, (x, y, z) in zip(
            "abcde", [(0.5, 0.25, 0), ("nan",) * 3, (9999,) * 3, (-9999,) * 3, (1, 1, 0)]
        )
    )
    + "</PickedPoints>",
}


@pytest.mark.parametrize("name", NOWHERE_IN)
def test_landmarks_without_a_place_keep_name_and_order(tmp_path, name):
    (tmp_path / name).write_text(NOWHERE_IN[name])
    marks = Landmarks.read(tmp_path / name, SQUARE)
    assert marks.names == tuple("abcde")
    assert marks.placed.tolist() == [True, False, False, False, True]
    write_landmarks(tmp_path / "again.csv", marks)
    again = Landmarks.read(tmp_path / "again.csv", SQUARE)
    assert again.names == marks.names
    np.testing.assert_array_equal(again.positions, marks.positions)


def test_a_label_of_freesurfer_has_vertices_or_positions(tmp_path):
    (tmp_path / "lh.label").write_text("#!ascii label\n2\n2 9.0 9.0 9.0 0.0\n-1 0.5 0.25 0 1.0\n")
    assert Landmarks.read(tmp_path / "lh.label", SQUARE).positions.tolist() == [[1, 1, 0], [0.5, 0.25, 0]]


def test_units_of_slicer_are_kept(tmp_path):
    point = {"label": "a", "position": [0.5, 0.25, 0], "positionStatus": "defined"}
    markup = {"type": "Fiducial", "coordinateUnits": "um", "controlPoints": [point]}
    (tmp_path / "a.mrk.json").write_text(json.dumps({"markups": [markup]}))
    write_landmarks(tmp_path / "b.mrk.json", Landmarks.read(tmp_path / "a.mrk.json", SQUARE))
    assert json.loads((tmp_path / "b.mrk.json").read_text())["markups"][0]["coordinateUnits"] == "um"
