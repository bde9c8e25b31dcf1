"""CONTRIBUTING.md, "Add a file format", followed to the letter with a toy format.

The file says how many vertices and faces follow, lists them one to a line, and ends with ``end``::

    toy 3 1
    0 0 0
    1 0 0
    0 1 0
    0 1 2
    end
"""

import re

import numpy as np
import pytest

from isomatch._core.errors import FormatError
from isomatch.cli import main
from isomatch.io import FORMATS, Asset, MeshFormat, read_mesh, read_point_cloud, write_mesh
from isomatch.io.formats._text import format_rows, is_count, read_lines
from isomatch.surfaces import Mesh
from zoo import torus, zoo


def read(data: bytes, name: str) -> Mesh:
    """Read a toy file."""
    lines = read_lines(name, data)
    words = lines.row(0).split() if len(lines) else []
    if len(words) != 3 or words[0] != "toy" or not all(map(is_count, words[1:])):
        lines.fail(0, "'toy' and the numbers of vertices and of faces")
    n_vertices, n_faces = map(int, words[1:])
    last = 1 + n_vertices + n_faces
    if len(lines) <= last or lines.row(last).strip() != "end":
        lines.fail(last, f"'end' after {n_vertices} vertices and {n_faces} faces")
    if len(lines) > last + 1:
        lines.fail(last + 1, "nothing after 'end'")
    vertices = lines[1 : 1 + n_vertices].parse().leading(3, "3 numbers x y z of a vertex")
    rows = lines[1 + n_vertices : last].parse()
    rows.require(rows.counts == 3, "3 vertex indices of a face")
    return Mesh(vertices, rows.whole(np.arange(len(rows.values)), "whole vertex indices").reshape(-1, 3))


def write(contents: Asset) -> bytes:
    """Write a toy file."""
    return b"".join(
        [
            f"toy {len(contents.points)} {len(contents.polygons.triangles)}\n".encode(),
            format_rows("%r %r %r\n", contents.points),
            format_rows("%d %d %d\n", contents.polygons.triangles),
            b"end\n",
        ]
    )


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    """The one entry of step 1."""
    monkeypatch.setitem(FORMATS, ".toy", MeshFormat(read, write))


@pytest.mark.parametrize("specimen", zoo("sound") + zoo("extreme"), ids=repr)
def test_the_round_trip_returns_equal_arrays(tmp_path, specimen):
    path = tmp_path / "shape.TOY"
    write_mesh(path, specimen.mesh)
    mesh = read_mesh(path)
    np.testing.assert_array_equal(mesh.vertices, specimen.mesh.vertices)
    np.testing.assert_array_equal(mesh.faces, specimen.mesh.faces)


def test_a_file_cut_short_anywhere_is_refused():
    data = write(Asset.of_mesh(torus()))
    whole = len(data.rstrip())
    for end in range(whole):
        with pytest.raises(FormatError, match="expected"):
            read(data[:end], "file")
    np.testing.assert_array_equal(read(data[:whole], "file").faces, torus().faces)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "file:1: expected 'toy' and the numbers of vertices and of faces, found the end of the file"),
        ("toy three 0\nend", "file:1: expected 'toy' and the numbers"),
        ("toy 1 0\n0 0\nend", "file:2: expected 3 numbers x y z of a vertex, found '0 0'"),
        ("toy 1 0\n0 zero 0\nend", "file:2: expected numbers, found '0 zero 0'"),
        ("toy 1 1\n0 0 0\n0 0 0 0\nend", "file:3: expected 3 vertex indices of a face, found '0 0 0 0'"),
        ("toy 1 1\n0 0 0\n0 0.5 0\nend", "file:3: expected whole vertex indices, found '0 0.5 0'"),
        (
            "toy 1 0\n0 0 0\n1 1 1\nend",
            "file:3: expected 'end' after 1 vertices and 0 faces, found '1 1 1'",
        ),
        ("toy 1 0\n0 0 0\nend\n# why\nmore", "file:5: expected nothing after 'end', found 'more'"),
    ],
)
def test_each_kind_of_damage_is_named(text, message):
    with pytest.raises(FormatError, match=message):
        read(text.encode(), "file")


def test_unknown_suffixes_and_options_are_told_what_there_is(tmp_path):
    for refused in (lambda: read_mesh("a.abc"), lambda: write_mesh("a.abc", torus())):
        with pytest.raises(FormatError, match="format"):
            refused()
    with pytest.raises(FormatError, match="option"):
        write_mesh(tmp_path / "a.toy", torus(), binary=True)


def test_point_clouds_and_the_command_line_read_it_too(tmp_path, capsys):
    write_mesh(tmp_path / "shape.toy", torus())
    assert read_point_cloud(tmp_path / "shape.toy").n_vertices == 48
    assert main(["check", str(tmp_path / "shape.toy")]) == 0
    assert re.search(r"vertices +48", capsys.readouterr().out)
