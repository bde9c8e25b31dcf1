"""Mesh files of unknown origin: a mesh or one named error, in bounded memory."""

import re
import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mutations import fuzzed, mutated, spliced

from isomatch import read_asset, write_asset
from isomatch._core.errors import FormatError
from isomatch.io import FORMATS, Asset
from zoo import grid, torus

PLY_WITH_EVERYTHING = (
    b"ply\nformat ascii 1.0\ncomment made by hand\nelement camera 1\nproperty float f\nelement vertex 4\n"
    b"property float x\nproperty double y\nproperty int z\nproperty list uchar short flags\nelement face 2\n"
    b"property uchar kind\nproperty list uchar int vertex_indices\nend_header\n"
    b"35.5\n0 0 0 0\n1 0 0 2 7 8\n1 1 0 1 9\n0 1 0 0\n1 4 0 1 2 3\n2 3 0 1 2\n"
)
MIXED_BINARY_PLY = (
    b"ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    b"property list ushort uchar note\nelement face 2\nproperty list uchar ushort vertex_index\nend_header\n"
    + np.array([0, 0, 0], ">f4").tobytes() + b"\0\0"
    + np.array([1, 0, 0], ">f4").tobytes() + b"\0\2ab"
    + np.array([0, 1, 0], ">f4").tobytes() + b"\0\1c"
    + b"\3\0\0\0\1\0\2" + b"\4\0\0\0\1\0\2\0\0"
)  # fmt: skip


def written(suffix, mesh, **options):
    return FORMATS[suffix].write(Asset.of_mesh(mesh), **options)


SEEDS = {
    ".off": [
        written(".off", grid(3, 3)),
        b"# c\nCOFF 4 2 0\n0 0 0 1 1 1\n1 0 0\n1 1 0\n0 1 0 # end\n\n4 0 1 2 3 9 9\n3 0 1 2\n",
    ],
    ".obj": [
        written(".obj", torus(4, 3)),
        b"mtllib C:\\a.mtl\no part\nv 0 0 0 .5 .5 .5\nv 1 0 0\nv 1 1 0\nvt 0 0\nf 1/1/1 2//1 3/1\nf -3 -2 \\\n -1\r",
    ],
    ".ply": [
        written(".ply", grid(3, 3)),
        written(".ply", grid(3, 3), binary=False),
        PLY_WITH_EVERYTHING,
        MIXED_BINARY_PLY,
    ],
    ".stl": [written(".stl", grid(3, 3)), written(".stl", grid(2, 2), binary=False)],
}
SEEDS[".glb"] = [written(".glb", grid(3, 3))]
SEEDS[".gltf"] = [written(".gltf", grid(2, 2))]
CASES = [(suffix, seed) for suffix, seeds in SEEDS.items() for seed in seeds]
FACTOR = 20  # times the size of the file
ROOM = 2**21  # bytes; what a reader needs for a file of any size


@pytest.fixture(autouse=True, scope="module")
def compiled_loops():
    """Load the compiled loops, which take memory of their own."""
    for suffix, seed in CASES:
        FORMATS[suffix].read(seed, "file")


def outcome(suffix, data):
    """Read a file; return the mesh, or None if it was refused. Memory is limited, any other error passes."""
    mesh, problem = None, "file:"
    tracemalloc.start()
    try:
        mesh = FORMATS[suffix].read(data, "file")
    except FormatError as error:
        problem = str(error)
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    result = mesh.vertices.nbytes + mesh.faces.nbytes if mesh else 0
    assert peak < FACTOR * len(data) + result + ROOM
    assert re.match(r"file:[^\n]*\Z", problem)
    return mesh


@pytest.mark.parametrize(("suffix", "seed"), CASES)
def test_the_seeds_are_sound(suffix, seed):
    mesh = outcome(suffix, seed)
    assert mesh.n_faces >= 2
    assert mesh.sound_faces.min() == 0


@pytest.mark.parametrize(("suffix", "seed"), CASES)
@fuzzed
@given(data=st.data())
def test_a_changed_file(suffix, seed, data):
    mesh = outcome(suffix, data.draw(mutated(seed)))
    if mesh is not None:
        assert mesh.vertices.shape[1] == mesh.faces.shape[1] == 3


@pytest.mark.long
@pytest.mark.parametrize(("suffix", "seed"), CASES)
@fuzzed
@given(data=st.data())
def test_all_that_a_changed_file_holds(tmp_path_factory, suffix, seed, data):
    path = tmp_path_factory.getbasetemp() / f"changed{suffix}"
    path.write_bytes(data.draw(mutated(seed)))
    try:
        asset = read_asset(path)
    except FormatError as error:
        problem = str(error)
    else:
        problem = f"{path}: none"
        write_asset(path, asset)
        assert read_asset(path).polygons.corners.tolist() == asset.polygons.corners.tolist()
    assert problem.startswith(str(path))


@pytest.mark.parametrize("suffix", SEEDS)
@fuzzed
@given(data=st.data())
def test_parts_of_two_files(suffix, data):
    one, other = (data.draw(st.sampled_from(SEEDS[suffix])) for _ in range(2))
    outcome(suffix, data.draw(spliced(one, other)))


@pytest.mark.parametrize("suffix", SEEDS)
@fuzzed
@given(content=st.binary(max_size=300), start=st.booleans())
def test_random_bytes(suffix, content, start):
    starts = {
        ".off": b"OFF\n",
        ".obj": b"v ",
        ".ply": b"ply\nformat ascii 1.0\n",
        ".stl": b"solid\n",
        ".glb": b"glTF\2\0\0\0",
        ".gltf": b"{",
    }
    first = starts[suffix]
    outcome(suffix, first + content if start else content)
