"""Files made to be slow or large: time and memory grow no faster than the file."""

import time
import tracemalloc

import numpy as np
import pytest

from isomatch._core.errors import FormatError
from isomatch.io import FORMATS

XYZ = "property float x\nproperty float y\nproperty float z\n"
FACES = "property list uchar uchar vertex_indices\n"
ROOM = 2**20  # bytes; what a reader needs for a file of any size
TIMES = 16  # how much longer the second file is
SLOWER = 50  # times as long it may take: a quadratic reader takes 256 times as long


def ply(header, body=b"", encoding="ascii"):
    return f"ply\nformat {encoding} 1.0\n{header}end_header\n".encode() + body


def binary(n_vertices, n_faces, faces):
    header = f"element vertex {n_vertices}\n{XYZ}element face {n_faces}\n{FACES}"
    return ply(header, bytes(12 * n_vertices) + faces, "binary_little_endian")


FILES = {
    "long comment with a backslash.obj": lambda n: b"v 0 0 0\n# " + b"a" * n + b"\\ b\n",
    "backslashes.obj": lambda n: b"v 0 0 0\n" + b"\\" * n,
    "continued lines.obj": lambda n: b"v 0 0 0\nf " + b"1 \\\n" * (n // 4),
    "old line ends and a path.obj": lambda n: b"mtllib C:\\a.mtl\r" + b"v 0 0 0\r" * (n // 8),
    "number signs.obj": lambda n: b"v 0 0 0\n" + b"#" * n,
    "empty comments.obj": lambda n: b"v 0 0 0\n" + b"#\n" * (n // 2),
    "blank lines.obj": lambda n: b"v 0 0 0\n" + b"\n" * n,
    "leading blanks.obj": lambda n: b"v 0 0 0\n" + b" " * n,
    "short lines.obj": lambda n: b"v 0 0 0\n" + b"ab\n" * (n // 3),
    "one long row.obj": lambda n: b"v 0 0 0" + b" 0" * (n // 2),
    "last row is no number.obj": lambda n: b"v 0 0 0\n" * (n // 8) + b"v 0 0 x\n",
    "one polygon.obj": lambda n: b"v 0 0 0\nf " + b"1 " * (n // 2),
    "one polygon with texture.obj": lambda n: b"v 0 0 0\nf " + b"1/ " * (n // 3),
    "slashes.obj": lambda n: b"v 0 0 0\nf " + b"1/" * (n // 2),
    "long texture index.obj": lambda n: b"v 0 0 0\nf 1/" + b"1" * n + b"x",
    "long number.obj": lambda n: b"v 0 0 " + b"1" * n,
    "faces of two kinds.off": lambda n: (
        b"OFF\n1 %d 0\n0 0 0\n" % (n // 18 * 2) + b"3 0 0 0\n4 0 0 0 0\n" * (n // 18)
    ),
    "words on the header.off": lambda n: b"OFF" + b" 1" * (n // 2),
    "elements.ply": lambda n: ply("".join(f"element e{i} 0\n" for i in range(n // 14))),
    "properties.ply": lambda n: ply("element vertex 0\n" + "property uchar x\n" * (n // 17)),
    "lists.ply": lambda n: ply("element a 1\n" + "property list uchar uchar x\n" * (n // 28), bytes(n)),
    "blank header.ply": lambda n: ply("\n" * n),
    "empty faces as text.ply": lambda n: ply(
        f"element vertex 1\n{XYZ}element face {n // 2}\n{FACES}", b"0 0 0\n" + b"0\n" * (n // 2)
    ),
    "empty and other faces.ply": lambda n: binary(1, n - 1, bytes(n - 2) + b"\1\0"),
    "faces of two kinds.ply": lambda n: binary(1, n // 9 * 2, b"\3\0\0\0\4\0\0\0\0" * (n // 9)),
    "positions of one byte.ply": lambda n: ply(
        f"element vertex {n // 3}\n{XYZ.replace('float', 'uchar')}", bytes(n // 3 * 3), "binary_little_endian"
    ),
    "declares more than it has.ply": lambda n: ply(f"element vertex 1{'0' * 12}\n{XYZ}", bytes(n), "binary_big_endian"),
    "random corners.stl": lambda n: (
        bytes(80) + (n // 50).to_bytes(4, "little") + np.random.default_rng(0).bytes(n // 50 * 50)
    ),
    "blanks before the first word.stl": lambda n: b" " * n + b"solid",
    "ends without corners.stl": lambda n: b"solid\n" + b"endloop\n" * (n // 8) + b"endsolid\n",
}  # fmt: skip


def read(name, data):
    try:
        return FORMATS[name[-4:]].read(data, name)
    except FormatError:
        return None


def seconds(name, data):
    def once():
        start = time.process_time()
        read(name, data)
        return time.process_time() - start

    return min(once() for _ in range(3))


@pytest.mark.long
@pytest.mark.parametrize("name", FILES)
def test_time_is_linear(name):
    small, large = (FILES[name](n) for n in (20_000, TIMES * 20_000))
    assert seconds(name, large) < SLOWER * max(seconds(name, small), 1e-3)


@pytest.mark.long
@pytest.mark.parametrize("name", FILES)
def test_memory_is_eighty_times_the_file_beside_the_mesh(name):
    data = FILES[name](300_000)
    read(name, data)  # loads the compiled loops, which take memory of their own
    tracemalloc.start()
    mesh = read(name, data)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    result = mesh.vertices.nbytes + mesh.faces.nbytes if mesh else 0
    assert peak < 80 * len(data) + result + ROOM
