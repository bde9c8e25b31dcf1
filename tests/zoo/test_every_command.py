"""Every shape of the zoo through every command and entry point: a result, or a named error that says why."""

import contextlib
import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import isomatch
import isomatch.visualization
from isomatch import IsomatchError, Mesh, Outcome
from isomatch.cli import main
from isomatch.matching import prepare_pair
from later import some_later
from zoo.cases import BODY, CASES

SOUND_INDICES = [case for case in CASES if "outside" not in case.distance]
MATCHED_NOW = {  # beside all that are refused; the others are matched by `make test-long`
    "inside_out",
}
VERBS = ("distance", "basis", "match")
CODES = {True: 1, False: 0}


def refused(words):
    """The error that the case must end in, or none."""
    return pytest.raises(IsomatchError, match=words) if words else contextlib.nullcontext()


def relabelled(mesh):
    """The mesh with its vertices and faces in another order, rotated about the origin, and the new name of each."""
    rng = np.random.default_rng(3)
    old = rng.permutation(mesh.n_vertices)
    new = np.argsort(old)
    turned = mesh.vertices[old] @ Rotation.random(random_state=3).as_matrix().T
    return Mesh(turned, new[mesh.faces][rng.permutation(mesh.n_faces)]), new


@pytest.fixture
def written(tmp_path):
    """Write meshes to files, and give their names."""

    def write(**meshes):
        for name, mesh in meshes.items():
            isomatch.write_mesh(tmp_path / f"{name}.ply", mesh)
        return [str(tmp_path / f"{name}.ply") for name in meshes]

    return write


@pytest.mark.parametrize("case", CASES, ids=repr)
def test_check_repair_and_check_again(case):
    report = isomatch.check(case.make())
    assert str(report)
    json.dumps(report.to_dict())
    mended = isomatch.repair(case.make()).mesh
    assert isomatch.repair(mended).mesh is mended
    assert not len(isomatch.check(mended).inward_components)


@pytest.mark.long
@pytest.mark.parametrize(
    "case", [case for case in CASES if case.name not in ("nothing", "one_vertex")], ids=repr
)
def test_distances(case):
    """Along the surface it is no shorter than through the air, and no longer than along the edges."""
    mesh, sources = case.make(), [0, case.make().n_vertices - 1]
    with refused(case.distance):
        distances = isomatch.geodesic_distances(mesh, sources)
        along_edges = isomatch.geodesic_distances(mesh, sources, "dijkstra")
        unit = np.abs(mesh.vertices).max() or 1.0
        points = mesh.vertices / unit
        straight = unit * np.linalg.norm(points[sources][:, None] - points, axis=2)
        assert np.array_equal(np.isinf(distances), np.isinf(along_edges))
        reached = np.isfinite(distances)
        assert (distances[reached] >= 0.9 * straight[reached] - 1e-7 * unit).all()
        assert (distances[reached] <= along_edges[reached] * (1 + 1e-6) + 1e-12 * unit).all()


@pytest.mark.long
@pytest.mark.parametrize("case", CASES, ids=repr)
def test_basis(case):
    with refused(case.basis):
        basis = isomatch.distance_basis(case.make())
        assert basis.error_estimate() < 0.1


@pytest.mark.long
@pytest.mark.parametrize("case", CASES, ids=repr)
def test_other_bases(case):
    """These have no settings that decide: any result will do, or a named error."""
    mesh = case.make()
    for compute in (
        lambda: isomatch.canonical_form(mesh).points,
        lambda: isomatch.laplace_basis(mesh, 20).vectors,
        lambda: isomatch.distance_basis(mesh, 10, 20, "nystrom", "uniform").vectors,
    ):
        with contextlib.suppress(IsomatchError):
            assert np.isfinite(compute()).all()


def mean_error(found, target, new):
    """Mean distance in space of the images from where the vertices went, over √area; of those that have an image."""
    with np.errstate(over="ignore"):
        unit = np.abs(target.vertices).max()
    points = target.vertices / unit
    area = Mesh(points, target.faces).area
    matched = found.map.vertices >= 0
    apart = np.linalg.norm(points[found.map.vertices] - points[new], axis=1)[matched]
    return apart.mean() / np.sqrt(area)


@pytest.mark.parametrize(
    "case",
    some_later(SOUND_INDICES, lambda case: case.match or case.name in MATCHED_NOW),
    ids=repr,
)
def test_match(case):
    mesh = case.make()
    target, new = relabelled(mesh)
    if case.symmetric and not case.match:
        assert isomatch.match(mesh, target).outcome is not Outcome.CONVERGED
        return
    with refused(case.match):
        found = isomatch.match(mesh, target)
        # a right map of a damaged mesh may be called less than it is, never more
        assert found.outcome.name in (case.outcome, "LOW_CONFIDENCE")
        assert mean_error(found, target, new) < 0.06


@pytest.mark.parametrize("side", ["source", "target"])
@pytest.mark.parametrize("case", [case for case in CASES if case.match], ids=repr)
def test_match_says_which_shape_it_refuses(case, side):
    shapes = {"source": BODY, "target": BODY, side: case.make()}
    with refused(f"^{side}: .*{case.match}"):
        isomatch.match(**shapes)


@pytest.mark.parametrize("case", some_later(CASES, lambda case: CASES.index(case) % 48 == 0), ids=repr)
def test_commands(case, written, tmp_path, capsys, monkeypatch):
    """Exit code 0 or 1, and a line that says why; `check --for` knows beforehand what the command will do."""
    for drawing in ("draw_map", "write_report"):
        monkeypatch.setattr(isomatch.visualization, drawing, lambda *_, **__: None)
    out = str(tmp_path / "out.npz")
    try:
        (file,) = written(mesh=case.make())
    except IsomatchError:
        return  # a shape that no file can hold
    commands = {
        "distance": ["distance", file, "--from", "0"],
        "basis": ["basis", file, "-o", out],
    }
    if case.match or CASES.index(case) % 12 == 0:  # all others are matched above
        commands["match"] = ["match", file, file, "-o", str(tmp_path / "map")]
    for verb, command in commands.items():
        words = getattr(case, verb)
        if case.name == "points_without_faces" and verb == "match":  # files of points are matched as clouds
            words = None
        code = main(command)
        said = capsys.readouterr().err
        assert code == CODES[bool(words)], said
        if code:
            assert said.startswith("isomatch: ")
            assert said.count("\n") == 1
        assert main(["check", file, "--for", verb]) == code, verb
        capsys.readouterr()
    assert main(["check", file, "--json"]) in (0, 1)
    assert main(["repair", file, "-o", str(tmp_path / "repaired.ply")]) in (0, 1)
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.usefixtures("small_pictures")
@pytest.mark.parametrize("case", [case for case in CASES if not case.match], ids=repr)
def test_pictures_and_report(case, written, tmp_path):
    (file,) = written(mesh=case.make())
    main(["match", file, file, "-o", str(tmp_path)])
    assert (tmp_path / "result.json").exists() == (tmp_path / "report.html").exists()


@pytest.mark.long
@pytest.mark.parametrize("case", CASES, ids=repr)
def test_points_and_graphs(case):
    """The vertices as a point cloud, and the edges as a graph: any result will do, or a named error."""
    mesh = case.make()
    for shape in (
        lambda: isomatch.PointCloud(mesh.vertices),
        lambda: isomatch.Graph(mesh.n_vertices, mesh.edges, mesh.edge_lengths),
    ):
        with contextlib.suppress(IsomatchError):
            distances = isomatch.geodesic_distances(shape(), [0])
            assert not np.isnan(distances).any()
        with contextlib.suppress(IsomatchError):
            assert np.isfinite(isomatch.distance_basis(shape(), 10, 20).vectors).all()
        with contextlib.suppress(IsomatchError):
            prepared = isomatch.prepare(shape())
            assert np.isfinite(prepared.signatures).all()


INSIDE_OUT = [case for case in CASES if case.name.startswith("inside_out")]


@pytest.mark.parametrize("case", INSIDE_OUT, ids=repr)
def test_what_is_inside_out_is_rewound_outward(case):
    body = prepare_pair(case.make(), BODY).source.body
    assert body.volume > 0
    cosines = np.einsum("ij,ij->i", body.face_cross, isomatch.prepare(case.make()).body.face_cross)
    assert (cosines > 0).all()
