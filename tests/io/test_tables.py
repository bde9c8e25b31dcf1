"""The reader of tables: what csv, pandas, R and spreadsheets wrote is read as that, or refused with its line."""

import logging
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from written_tables import clouds, tables

from isomatch import Asset, FormatError, Mesh, read_asset
from isomatch._core.tables import parse_table, read_integers, read_table
from isomatch.io import read_attributes

MESH = Mesh(np.random.default_rng(0).random((7, 3)), [[0, 1, 2], [1, 2, 3], [2, 3, 4]])
SURFACE = Asset.of_mesh(MESH)
examples = settings(
    max_examples=30, derandomize=True, database=None, deadline=None, suppress_health_check=list(HealthCheck)
)


def values(folder, content, surface=SURFACE):
    (folder / "t.csv").write_bytes(content if isinstance(content, bytes) else content.encode())
    return {
        attribute.name: attribute.values.tolist() for attribute in read_attributes(folder / "t.csv", surface)
    }


def same(read, written):
    if written is None:
        return read == "" or (isinstance(read, float) and np.isnan(read))
    return (
        read == written if isinstance(written, str) or isinstance(read, str) else abs(read - written) < 1e-9
    )


def read_as_written_or_refused(folder, table):
    try:
        found = values(folder, table.data)
    except ValueError:  # as of another number of rows
        return False
    assert len(found) == len(table.columns), table
    for read, written in zip(found.values(), table.columns.values()):
        assert all(map(same, read, written)), (table, found)
    return True


@examples
@given(table=tables())
def test_a_table_is_read_as_it_was_written_or_refused(tmp_path_factory, table):
    read_as_written_or_refused(tmp_path_factory.getbasetemp(), table)


@pytest.mark.long
def test_most_tables_are_read(tmp_path):
    logging.disable(logging.WARNING)
    read = []

    @settings(examples, max_examples=2000)
    @given(table=tables())
    def count(table):
        read.append(read_as_written_or_refused(tmp_path, table))

    count()
    logging.disable(logging.NOTSET)
    assert np.mean(read) > 0.9


@examples
@given(cloud=clouds())
def test_a_cloud_is_read_as_it_was_written_or_refused(tmp_path_factory, cloud):
    path = tmp_path_factory.getbasetemp() / "t.xyz"
    path.write_bytes(cloud.data)
    with suppress(FormatError):
        points = read_asset(path).points
        np.testing.assert_allclose(points, cloud.columns["points"], atol=1e-9)


INDEX = ["vertex,part", *(f"{i},{3 * i}" for i in range(7))]
FROM_1 = ["vertex,part", *(f"{i + 1},{3 * i}" for i in range(7))]
OF_R = ['"","part"', *(f'"{i + 1}",{3 * i}' for i in range(7))]
SHORT = ['"part"', *(f'"{i + 1}" {3 * i}' for i in range(7))]
FLOATS = ["Vertex;Part", *(f"{i},0;{3 * i}" for i in range(7))]


@pytest.mark.parametrize("lines", [INDEX, FROM_1, OF_R, SHORT, FLOATS], ids=str)
@pytest.mark.parametrize("shuffled", [False, True])
def test_a_column_tells_which_vertex_a_row_is_of_and_that_is_said(tmp_path, caplog, lines, shuffled):
    rows = lines[1:] if not shuffled else lines[:3:-1] + lines[1:4]
    (found,) = values(tmp_path, "\n".join([lines[0], *rows])).values()
    assert found == [3 * i for i in range(7)]
    assert f"from {int(lines not in (INDEX, FLOATS))}" in caplog.text


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (["1,a", "2,b", "3,c"], r"t\.csv:4: .* may count from 0 or from 1"),
        (["0,a", "7,b"], r"t\.csv:3: .* there are 7"),
        (["0,a", "0,b"], r"t\.csv:3: .* each once"),
        (["0,a", "1.5,b"], r"t\.csv:3: .* each once"),
    ],
)
def test_a_column_of_vertices_that_does_not_fit_is_refused(tmp_path, rows, message):
    with pytest.raises(FormatError, match=message):
        values(tmp_path, "\n".join(["vertex,part", *rows]))


@pytest.mark.parametrize("none", ["", "NA", "nan", ".", '""'])
@pytest.mark.parametrize("row", range(7))
def test_a_missing_value_keeps_its_place(tmp_path, none, row):
    cells = [f"{i}.5" for i in range(7)]
    cells[row] = none
    found = values(tmp_path, "\n".join(["depth", *cells, ""]))["depth"]
    assert np.flatnonzero(np.isnan(found)).tolist() == [row]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1,5\n2,5\n2,25\n", r"t\.csv:1: .* decimal comma, or two"),
        ("-0,5,0,05,1,5\n0,5,0,5,0,5\n", r"t\.csv:1: .* semicolons"),
        ("depth\n1.5\nabc\n2.5\n", r"t\.csv:3: .* among numbers"),
        ("a;b\n1;2\n1\n", r"t\.csv:3: .* others 2"),
        ("a\n1\n\0\n", r"t\.csv:3: has bytes of zero"),
        ('a,"b\n1,2\n', r"t\.csv"),
        ("right front\nx y\nx z\n", r"t\.csv:.* quotes"),
    ],
)
def test_what_can_be_meant_in_two_ways_is_refused(tmp_path, text, message):
    with pytest.raises((FormatError, ValueError), match=message):
        values(tmp_path, text, None)


def test_comments_and_names_that_begin_with_a_mark():
    table = parse_table("# made by hand\n#7,x\n5,y\n# the last\n6,z # of all\n", "t", ["#7"])
    assert [row.cells for row in table.rows] == [["#7", "x"], ["5", "y"], ["6", "z # of all"]]
    assert parse_table("#x y z\n0 1 2\n", "t").titled({"x"}).titles == ("x", "y", "z")


def test_a_row_of_numbers_and_a_word_is_read_without_trying_all_ways_to_split_the_numbers():
    (row,) = parse_table(" ".join([*["12"] * 60, "ape"]), "t").rows
    assert row.cells == [*["12"] * 60, "ape"]


def test_whole_numbers_may_be_written_as_floats(tmp_path):
    (tmp_path / "a.txt").write_text("1.0\n2e0\n1e+05\n-1\n")
    assert read_integers(tmp_path / "a.txt", 1, "is none").tolist() == [[1], [2], [100000], [-1]]
    (tmp_path / "a.txt").write_text('"","x"\n"1",5\n"2",7\n')
    assert read_integers(tmp_path / "a.txt", 1, "is none").tolist() == [[5], [7]]
    (tmp_path / "a.txt").write_text("# of two\n\n4\n\n5\n")
    with pytest.raises(FormatError, match=r"a\.txt:4: '' is none"):
        read_integers(tmp_path / "a.txt", 1, "is none")
    (tmp_path / "a.txt").write_text("1.5\n")
    with pytest.raises(FormatError, match=r"a\.txt:1: '1\.5' is none"):
        read_integers(tmp_path / "a.txt", 1, "is none")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "cp1252"])
@pytest.mark.parametrize("separator", ",;\t")
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r\r\n", "\r"])
def test_lists_are_read_like_other_tables(tmp_path, encoding, separator, end):
    rows = [["Name", "path"], ["007", "scans/ä.ply"], ["Größe", '"a,b;c.ply"'], ["", "d.ply"]]
    text = end.join(separator.join(row) for row in rows) + end
    (tmp_path / "list.csv").write_bytes(text.encode(encoding))
    found = read_table(tmp_path / "list.csv").records(["path"], ["name"])
    expected = [("007", "scans/ä.ply"), ("Größe", "a,b;c.ply"), ("", "d.ply")]
    assert [(row["name"], row["path"]) for row in found] == expected


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,path\na,b.ply,c\n", r"list\.csv:2: .* more cells"),
        ("name,path\na,\n", r"list\.csv:2: .* nothing in the column 'path'"),
        ("name,file\na,b\n", r"no column 'path'"),
        ("path,PATH\na,b\n", "several columns 'path'"),
    ],
)
def test_lists_with_a_fault_are_refused(tmp_path, text, message):
    (tmp_path / "list.csv").write_text(text)
    with pytest.raises(FormatError, match=message):
        read_table(tmp_path / "list.csv").records(["path"], ["name"])


XYZ = [(0.5, -1.25, 2), (3, 4.5, -6), (7, 8, 9.75), (1, 0, 0)]


@pytest.mark.parametrize(
    ("header", "order"),
    [
        ("x y z", (0, 1, 2)),
        ("Z X Y", (2, 0, 1)),
        ("# z y x", (2, 1, 0)),
        ("//X Y Z", (0, 1, 2)),
        ("id X Y Z", (None, 0, 1, 2)),
        ("x y z Height", (0, 1, 2, None)),
    ],
)
def test_positions_are_found_by_their_names(tmp_path, header, order):
    rows = [[7.5 + i if axis is None else row[axis] for axis in order] for i, row in enumerate(XYZ)]
    (tmp_path / "a.xyz").write_text("\n".join([header, *(" ".join(map(str, row)) for row in rows)]))
    asset = read_asset(tmp_path / "a.xyz")
    assert asset.points.tolist() == [list(map(float, row)) for row in XYZ]
    assert {attribute.name for attribute in asset.attributes} == {"id", "Height"} & {*header.split()}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("u v w\n0 1 2\n1 2 3\n", "expected columns x, y, z"),
        ("1 0.5 2 3\n2 0.5 2 3\n3 0.5 2 4\n", "counts the rows"),
        ("0 1 2\n0 1\n", r"a\.xyz:2: "),
        ("0 1 2\n0 one 2\n", r"a\.xyz:2: "),
        ("1,5,2,5,-0,5\n1,5,2,5,0,5\n", "semicolons"),
    ],
)
def test_positions_that_are_not_told_are_refused(tmp_path, text, message):
    (tmp_path / "a.xyz").write_text(text)
    with pytest.raises(FormatError, match=message):
        read_asset(tmp_path / "a.xyz")
