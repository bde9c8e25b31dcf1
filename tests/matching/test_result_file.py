"""Results and prepared shapes in files: what is read equals what was written, and what is neither is refused."""

import json
from dataclasses import replace

import numpy as np
import pytest

from isomatch import (
    Config,
    Correspondence,
    FormatError,
    Graph,
    MatchResult,
    MissingFileError,
    PointCloud,
    PreparedShape,
    SettingError,
    match,
    prepare,
)
from isomatch_lab.baselines import BASELINES
from shapes import icosphere

LevelSettings = type(Config().levels)

pytestmark = pytest.mark.usefixtures("prepared_once")


@pytest.fixture(scope="module")
def result(prepared_example):
    return match(*prepared_example)


def assert_same_map(one, other):
    assert one.n_target == other.n_target
    assert (one.source_hash, one.target_hash) == (other.source_hash, other.target_hash)
    for name in ("vertices", "faces", "barycentric"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def assert_same(one, other):
    assert_same_map(one.map, other.map)
    assert json.dumps(one.to_dict()) == json.dumps(other.to_dict())
    assert (one.config, one.outcome) == (other.config, other.outcome)
    np.testing.assert_array_equal(one.expected_error, other.expected_error)
    np.testing.assert_array_equal(one.descriptor_distance, other.descriptor_distance)
    assert len(one.alternatives) == len(other.alternatives)
    for a, b in zip(one.alternatives, other.alternatives):
        assert_same_map(a.map, b.map)


@pytest.mark.long
def test_a_result_is_read_as_it_was_written(tmp_path, result):
    assert result.alternatives
    result.save(tmp_path / "result.npz")
    assert_same(MatchResult.load(tmp_path / "result.npz"), result)
    assert_same_map(Correspondence.load(tmp_path / "result.npz"), result.map)


@pytest.mark.long
def test_a_result_without_alternatives_and_of_other_settings(tmp_path, result):
    errors = np.where(np.arange(len(result.expected_error)) < 3, np.nan, result.expected_error)
    odd = replace(result, alternatives=(), config=Config(rank=30), expected_error=errors)
    odd = replace(odd, notes=("source: a → b",))
    odd.save(tmp_path / "result.npz")
    assert_same(MatchResult.load(tmp_path / "result.npz"), odd)
    of_baseline = replace(result, config=BASELINES["zoomout"].config)
    of_baseline.save(tmp_path / "result.npz")
    assert MatchResult.load(tmp_path / "result.npz").config == of_baseline.config


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"about": "{"}, r"not a match result \(Expecting"),
        ({"about": "{}"}, r"not a match result \('outcome'\)"),
        ({"about": None}, "it has no array 'about'"),
        ({"vertices": np.zeros(3, dtype=int)}, "faces has shape"),
        ({"n_target": 1}, "mapped outside the target"),
        ({"format_version": 2}, "has format version 2, .* upgrade isomatch"),
    ],
)
def test_what_is_no_result(tmp_path, result, change, message):
    path = tmp_path / "result.npz"
    result.save(path)
    with np.load(path) as stored:
        arrays = {name: value for name, value in {**stored, **change}.items() if value is not None}
    np.savez(path, **arrays)
    with pytest.raises(FormatError, match=rf"result\.npz: .*{message}"):
        MatchResult.load(path)


def test_settings_are_only_those_of_methods(tmp_path, result):
    path = tmp_path / "result.npz"
    result.save(path)
    with np.load(path) as stored:
        arrays = dict(stored)
    about = json.loads(str(arrays["about"]))
    for settings in ("os.system", "Nobody"):
        np.savez(path, **{**arrays, "about": json.dumps({**about, "settings": settings})})
        with pytest.raises(FormatError, match="settings"):
            MatchResult.load(path)
    with pytest.raises(MissingFileError):
        MatchResult.load(tmp_path / "nothing.npz")


@pytest.mark.long
@pytest.mark.parametrize(
    "config", [Config(), Config(levels=LevelSettings(matched=1000, polished=2000))], ids=["full", "levels"]
)
def test_matches_of_shapes_read_from_files_are_the_same(tmp_path, example, config):
    shapes = [prepare(made.mesh, config) for made in example]
    for side, shape in enumerate(shapes):
        shape.save(tmp_path / f"{side}.npz")
    read = [PreparedShape.load(tmp_path / f"{side}.npz", config) for side in range(2)]
    assert_same(*(replace(match(*pair), timings={}) for pair in (shapes, read)))
    assert (read[0].notes, read[0].seed, read[0].timings) == (shapes[0].notes, 0, shapes[0].timings)
    if config.levels.matched == 1000:
        assert read[0].refining.fine is read[0].finer.refining.coarse.mesh, "what is shared stays shared"


def test_points_and_graphs_in_files(tmp_path):
    points = PointCloud(icosphere(3).vertices)
    lattice = np.arange(100).reshape(10, 10)
    edges = [
        *zip(lattice[:-1].ravel(), lattice[1:].ravel()),
        *zip(lattice[:, 1:].ravel(), lattice[:, :-1].ravel()),
    ]
    for surface in (points, Graph(100, edges, np.ones(len(edges)))):
        prepare(surface).save(tmp_path / "shape.npz")
        assert PreparedShape.load(tmp_path / "shape.npz").surface.content_hash == surface.content_hash


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "row", "value", "message"),
    [
        ("sample_vertices", 3, 10**9, r"sample_vertices 0…1000000000 are outside 0…\d+"),
        ("body_vertex", 0, -2, "body_vertex -2…"),
        ("user_vertex", 0, 10**6, "user_vertex 1…1000000 are outside"),
        ("owner", 1, -1, "owner -1…"),
        ("extremities", 0, 10**6, "extremities"),
    ],
)
def test_vertices_that_a_prepared_shape_does_not_have(tmp_path, example, name, row, value, message):
    """Of a file that was made on purpose, with the right digest."""
    shape = prepare(example[0].mesh, Config(levels=LevelSettings(matched=1000, polished=2000)))
    holder = shape.detail.transfer.coarse if name == "owner" else shape
    changed = getattr(holder, name).copy()
    changed[row] = value
    object.__setattr__(holder, name, changed)
    shape.save(tmp_path / "shape.npz")
    with pytest.raises(FormatError, match=message):
        PreparedShape.load(tmp_path / "shape.npz")


def test_what_is_no_prepared_shape(tmp_path, prepared_example, result):
    path = tmp_path / "shape.npz"
    prepared_example[0].save(path)
    with pytest.raises(SettingError, match="prepared"):
        PreparedShape.load(path, Config(rank=20))
    with np.load(path) as stored:
        arrays = dict(stored)
    np.savez(path, **{**arrays, "array_0": arrays["array_0"] + 1})
    with pytest.raises(FormatError, match="changed"):
        PreparedShape.load(path)
    np.savez(path, **arrays, array_x=np.zeros(1))
    assert PreparedShape.load(path).surface.n_vertices == prepared_example[0].surface.n_vertices
    np.savez(path, **{name: array for name, array in arrays.items() if name != "format_version"})
    with pytest.raises(FormatError, match="prepared"):
        PreparedShape.load(path)
    for version, message in ((2, "prepared in another way"), (4, "upgrade isomatch")):
        np.savez(path, **{**arrays, "format_version": version})
        with pytest.raises(FormatError, match=message):
            PreparedShape.load(path)
    result.save(path)
    with pytest.raises(FormatError, match="prepared"):
        PreparedShape.load(path)


def test_a_result_becomes_a_mesh_of_pyvista(prepared_example, result):
    pytest.importorskip("pyvista")
    source, target = (shape.surface for shape in prepared_example)
    mesh = result.to_pyvista(source, target)
    np.testing.assert_array_equal(mesh.point_data["image"], result.map.vertices)
    np.testing.assert_allclose(mesh.point_data["expected error"], result.expected_error)
    assert mesh.n_points == source.n_vertices
