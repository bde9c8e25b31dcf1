"""Array files of unknown origin: contents that fit together, or one named error before anything large is allocated."""

import io
import re
import tracemalloc
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mutations import fuzzed, mutated

from isomatch import Config, Correspondence, DistanceBasis, MatchResult, Outcome, Quality
from isomatch._core.errors import FormatError, IsomatchError
from isomatch.cohort.shape_statistics import CorrespondedShapes, ShapeModel
from isomatch.geodesics import Sampling
from isomatch.matching import Alternative
from isomatch_lab.evaluation import read_published_curves
from isomatch_lab.sets import tosca
from isomatch_lab.sets.shape_files import arrays, read_landmarks
from later import some_later
from zoo import grid

BASIS = DistanceBasis(
    vectors=np.arange(12.0).reshape(6, 2) / 10,
    values=np.array([2.0, -1.0]),
    weights=np.ones(6),
    method="nystrom",
    engine="fast_marching",
    samples=np.array([0, 2, 5]),
    held_out=Sampling(np.array([1]), np.ones((1, 6))),
)
MAP = Correspondence([0, 3, -1, 2], 4, np.array([[0, 1, 2]] * 4), np.full((4, 3), 1 / 3))
RESULT = MatchResult(
    MAP, Outcome.CONVERGED, Quality(*[0.5] * 12), np.array([0.1, 0.2, np.nan, 0.1]),
    (Alternative(lambda: MAP, 1.0, 0.5, "flip"),), {"total": 1.0},
    ("a note",), "fast_marching", "extremities", "the best", Config(), 0,
)  # fmt: skip
SHAPES = {
    "faces": grid(3, 3).faces,
    "cat0": grid(3, 3).vertices,
    "cat1": grid(3, 3).vertices + 1,
    "vts": np.arange(9),
    "vts_sym": np.arange(9)[::-1],
    "landmark_vertices": np.array([1, 2, 3]),
    "symmetry_perm": np.array([1, 0, 2]),
}
CURVES = {"FAUST|gdd|x": np.linspace(0, 0.2, 5), "FAUST|gdd|y": np.linspace(0, 100, 5)}


def load_shapes(path):
    arrays.cache_clear()
    shapes = tosca(path.parent)
    return [shapes[name] for name in shapes.names], read_landmarks(path)


def use_basis(basis):
    n = len(basis.vectors)
    with np.errstate(all="ignore"):
        basis.distance(np.arange(n), np.arange(n)[::-1])
        basis.distance([0, -1], [n - 1, -n])
        basis.row(0)
        if basis.held_out is not None:
            basis.error_estimates()


def use_map(found):
    if found.n_target < 1e6:
        found.pull_back(np.ones(found.n_target))
        found.reversed()


def use_result(found):
    found.to_dict()
    for each in (found, *found.alternatives):
        use_map(each.map)


def use_model(model):
    with np.errstate(all="ignore"):
        _ = model.variance_ratios, model.vertex_variances, model.aligned
        model.mesh()


LOADERS = {
    "result": (MatchResult.load, use_result),
    "model": (ShapeModel.load, use_model),
    "basis": (DistanceBasis.load, use_basis),
    "map": (Correspondence.load, use_map),
    "shapes": (load_shapes, lambda loaded: None),
    "curves": (lambda path: read_published_curves(path.parent), lambda curves: None),
}


@pytest.fixture(scope="module")
def seeds(tmp_path_factory):
    """The arrays of a sound file of each kind."""
    path = tmp_path_factory.mktemp("sound") / "file.npz"
    mesh, found = grid(3, 3), {"shapes": SHAPES, "curves": CURVES}
    model = ShapeModel.fit(CorrespondedShapes(("a", "b"), [mesh.vertices, mesh.vertices**2], mesh.faces))
    for kind, value in (("basis", BASIS), ("map", MAP), ("result", RESULT), ("model", model)):
        value.save(path)
        with np.load(path) as stored:
            found[kind] = dict(stored)
    return found


def as_file(stored, write=np.savez):
    buffer = io.BytesIO()
    write(buffer, **stored)
    return buffer.getvalue()


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz") / "cat.npz"


def attempt(kind, path, content):
    """Load a file and use what it holds; return what is wrong with it. Memory grows with its size at most."""
    path.write_bytes(content)
    load, use = LOADERS[kind]
    problem = ""
    tracemalloc.start()
    try:
        loaded = load(path)
    except IsomatchError as error:
        problem = str(error)
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peak < 20 * len(content) + 2**20
    assert "\n" not in problem
    if not problem:
        use(loaded)
    return problem


@pytest.mark.parametrize("kind", LOADERS)
@pytest.mark.parametrize("write", [np.savez, np.savez_compressed])
def test_the_seeds_are_sound(seeds, path, kind, write):
    assert not attempt(kind, path, as_file(seeds[kind], write))


@pytest.mark.parametrize("kind", some_later(LOADERS, lambda kind: kind != "result"))
@pytest.mark.parametrize(
    "write", some_later([np.savez, np.savez_compressed], lambda write: write is np.savez)
)
@fuzzed
@given(data=st.data())
def test_changed_bytes(seeds, path, kind, write, data):
    attempt(kind, path, data.draw(mutated(as_file(seeds[kind], write))))


@pytest.mark.long
@pytest.mark.parametrize("kind", LOADERS)
@settings(fuzzed, max_examples=300)
@given(data=st.data())
def test_many_changed_bytes(seeds, path, kind, data):
    attempt(kind, path, data.draw(mutated(as_file(seeds[kind]))))


@st.composite
def changed(draw, array):
    """Another array in place of one: its shape, type, order of bytes or one entry is different."""
    array = np.array(array)
    how = draw(st.sampled_from(["shape", "type", "entry", "empty", "scalar", "order"]))
    if how == "shape":
        return np.resize(array, tuple(draw(st.lists(st.integers(0, 4), max_size=4))))
    if how == "type":
        kind = draw(
            st.sampled_from(
                ["f2", "f4", ">f8", "c16", "i1", ">i4", "u8", "?", "U3", "S3", "O", "M8[s]", "V4"]
            )
        )
        return np.resize(np.zeros(1, kind), array.shape)
    if how == "entry" and array.size and array.dtype.kind in "fiu":
        with np.errstate(invalid="ignore"):
            array = array.astype(draw(st.sampled_from([array.dtype, np.float64, np.int64])))
        extremes = {
            "f": [np.nan, np.inf, -1e308, 5e-324, -1.0, 0.5],
            "i": [-1, 2**63 - 1, -(2**63), 4, 6],
            "u": [0, 9],
        }
        array.flat[draw(st.integers(0, array.size - 1))] = draw(st.sampled_from(extremes[array.dtype.kind]))
        return array
    if how == "order":
        return np.asfortranarray(array)
    return (
        array[:0]
        if how == "empty" and array.ndim
        else draw(st.sampled_from([0, -1, 3, 2**40, 0.5, "text", "\ud800"]))
    )


@pytest.mark.long
@pytest.mark.parametrize("kind", LOADERS)
@fuzzed
@given(data=st.data())
def test_changed_arrays(seeds, path, kind, data):
    stored = dict(seeds[kind])
    for _ in range(data.draw(st.integers(1, 2))):
        name = data.draw(st.sampled_from(sorted(stored)))
        if data.draw(st.integers(0, 5)):
            stored[name] = data.draw(changed(stored[name]))
        else:
            del stored[name]
    attempt(kind, path, as_file(stored))


HEADERS = [
    "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000, 1000000), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (0, 1000000000000000), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (-1,), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (" + "9" * 5000 + ",), }",
    "{'descr': '|O', 'fortran_order': False, 'shape': (1,), }",
    "{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (1,), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': " + "(" * 9000 + ", }",
    "{" * 9000,
    "{'descr': '<U999999999', 'fortran_order': False, 'shape': (), }",
    "__import__('os').abort()",
    "",
]


def npy(header, version=1):
    width = 2 if version == 1 else 4
    return b"\x93NUMPY" + bytes([version, 0]) + len(header).to_bytes(width, "little") + header.encode()


@pytest.mark.parametrize("header", HEADERS, ids=lambda header: header[:60])
@pytest.mark.parametrize("version", [1, 2, 3])
def test_headers_that_lie(seeds, path, header, version):
    for kind in LOADERS:
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w") as archive:
            for name in seeds[kind]:
                archive.writestr(f"{name}.npy", npy(header, version) + b"\0" * 16)
        assert attempt(kind, path, buffer.getvalue())


def bomb(claimed=None):
    """A small archive of many zeros; optionally its directory claims another size."""
    buffer = io.BytesIO()
    zeros = np.zeros((2_000_000, 2))
    np.savez_compressed(buffer, vectors=zeros, values=np.ones(2))
    content = buffer.getvalue()
    if claimed is not None:
        true = (zeros.nbytes + 128).to_bytes(4, "little")
        assert true in content
        content = content.replace(true, claimed.to_bytes(4, "little"))
    return content


@pytest.mark.parametrize("claimed", [None, 0, 2**32 - 2])
def test_a_bomb_is_not_opened(path, claimed):
    assert attempt("basis", path, bomb(claimed))


@pytest.mark.long
@pytest.mark.parametrize("n", [10_000_000, 100_000_000])
def test_a_map_of_zeros_does_not_become_thousands_of_times_its_file(path, n):
    """What is refused is what would be far above the file, whether or not it would fit into the memory budget."""
    content = as_file({"vertices": np.zeros(n, np.int64), "n_target": 1}, np.savez_compressed)
    assert re.search(r"its \d+ bytes would become \d+", attempt("map", path, content))


def test_a_map_that_is_all_unmatched_is_read(path):
    unmatched = Correspondence(np.full(200_000, -1), 4)
    unmatched.save(path)
    assert path.stat().st_size < 20_000
    assert not Correspondence.load(path).matched.any()


def test_more_than_the_budget_is_not_read(path, monkeypatch):
    monkeypatch.setenv("ISOMATCH_MEMORY_BUDGET", "0.0000001")
    BASIS.save(path)
    with pytest.raises(MemoryError, match="reading"):
        DistanceBasis.load(path)


@pytest.mark.parametrize(
    ("byte", "message"), [(6, "encrypted"), (8, "method other than deflate|compression")]
)
def test_archives_that_cannot_be_opened(path, byte, message):
    BASIS.save(path)
    content = bytearray(path.read_bytes())
    entry = content.find(b"PK\1\2")
    while entry >= 0:
        content[entry + byte + 2] |= 1
        entry = content.find(b"PK\1\2", entry + 4)
    path.write_bytes(content)
    with pytest.raises(FormatError, match=message):
        DistanceBasis.load(path)
