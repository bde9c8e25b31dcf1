"""Small files of unknown origin: landmarks, maps, lists of published sets, settings, rows, MATLAB files."""

import io
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mutations import fuzzed, mutated
from scipy.io import savemat

from isomatch import Config, Correspondence, Landmarks, Mesh, read_asset, read_landmarks
from isomatch._core.errors import IsomatchError
from isomatch.cli.inputs import read_config
from isomatch.cohort.plan import entries_of
from isomatch.cohort.study_input import read_shape_cells
from isomatch.cohort.subjects import structures_of
from isomatch.evaluation import read_indices, read_truth
from isomatch.io import read_attributes
from isomatch_lab.evaluation.ledger import IDENTITY, LEDGER_FILE, identity_of, read_rows
from isomatch_lab.sets import FolderSettings, tosca
from isomatch_lab.sets.pair_list import PairList
from zoo import grid


def matlab(compress):
    mesh = grid(3, 3)
    x, y, z = mesh.vertices.T
    buffer = io.BytesIO()
    savemat(buffer, {"surface": {"X": x, "Y": y, "Z": z, "TRIV": mesh.faces + 1.0}}, do_compression=compress)
    return buffer.getvalue()


def rows():
    row = dict.fromkeys(IDENTITY, "x") | {"error": 1.5, "curve": [0.1, 0.2], "notes": []}
    return "".join(json.dumps(row | {"pair": pair}) + "\n" for pair in "abc").encode()


def saved(array):
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


SETTINGS = b"""n_columns = 60
rank = 30
refinement = "joint"
[search]
n_hypotheses = 20
off_diagonal = [0.01, 0.1]
[outcome]
"""
MAP = b"# isomatch map, source -> target\n# 3 source vertices, 9 target vertices\n1\n-1\n8\n"
SLICER = b"""{"markups": [{"coordinateSystem": "RAS", "controlPoints":
[{"label": "nose", "position": [-1, 0, 0], "positionStatus": "defined"}]}]}"""
FIDUCIALS = b"""# CoordinateSystem = 0
# columns = id,x,y,z,label
a,-1,0,0,nose
"""
PICKED = b'<!DOCTYPE P><PickedPoints><point active="1" x="1" y="0" z="0" name="0"/></PickedPoints>'
SQUARE = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])


def marked(path, target_path=None):
    return read_landmarks(path, SQUARE, SQUARE, target_path)


FILES = {
    "landmarks.txt": (b"# mine\n1, 2\n3 4 # tail\n5\t6\n", marked),
    "landmarks.csv": (b"name,source,target\nnose,1,2\ntail,3,0\n", marked),
    "positions.txt": (b"0 0 0 1 0 0\n1,1,0,0,1,0\n", marked),
    "nose.mrk.json": (SLICER, lambda path: marked(path, path)),
    "nose.fcsv": (FIDUCIALS, lambda path: marked(path, path)),
    "nose.pp": (PICKED, lambda path: marked(path, path)),
    "nose.csv": (b"name,x,y,z\nnose,0,0,0\n", lambda path: marked(path, path)),
    "map.txt": (MAP, Correspondence.load),
    "map.npy": (saved(np.arange(5)), Correspondence.load),
    "truth.txt": (
        b"0 0.2 0.3 0.5\n-1 0 0 0\n1 1 0 0\n1 0 0 1\n",
        lambda path: read_truth(path, SQUARE, SQUARE),
    ),
    "pairs.txt": (b"# mine\ncats a b\nb a\n", lambda path: PairList.read(path.parent, "ab")),
    "set.toml": (b'truth = "pairs"\ncounts_from = 1\n', lambda path: FolderSettings.read(path.parent)),
    "config.toml": (SETTINGS, read_config),
    "cat0.vts": (b"1\n2.0\n3\n", read_indices),
    "cat0.mat": (matlab(False), lambda path: tosca(path.parent)["cat0"]),
    "cat1.mat": (matlab(True), lambda path: tosca(path.parent)["cat1"]),
    LEDGER_FILE: (rows(), lambda path: [identity_of(row) for row in read_rows(path.parent)]),
    "values.csv": (b"vertex,part,depth\n0,1,0.5\n1,NA,2.5\n3,2,7\n", read_attributes),
    "groups.csv": (b'"name";"group"\n"a";"m"\n"b";NA\n', lambda path: read_shape_cells(path, "ab")),
    "list.csv": (b"\xef\xbb\xbfname;path\r\n007;a.ply\r\n", entries_of),
    "subjects.csv": (b"subject,structure,file\ns1,bone,a.ply\ns2,bone,b.ply\n", structures_of),
    "cloud.xyz": (b"//X Y Z R G B\n0,5 1 2 3 4 5\n1,5 1 2 3 4 5\n", read_asset),
    "marks.csv": (b'"","name","x","y","z"\n"1","a",0,0,0\n"2","b",NA,NA,NA\n', Landmarks.read),
    "marks.fcsv": (FIDUCIALS, Landmarks.read),
}


OURS = [name for name in FILES if not name.endswith(".mat")]  # scipy's reader crashes on some damaged files


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz")


def attempt(folder, name, content):
    """Read a file; only a named error may come of it."""
    path = folder / name
    path.write_bytes(content)
    try:
        FILES[name][1](path)
    except IsomatchError:
        return False
    finally:
        path.unlink()
    return True


@pytest.mark.parametrize("name", FILES)
def test_the_seeds_are_sound(folder, name):
    assert attempt(folder, name, FILES[name][0])


@pytest.mark.parametrize("name", OURS)
@fuzzed
@given(data=st.data())
def test_a_changed_file(folder, name, data):
    attempt(folder, name, data.draw(mutated(FILES[name][0])))


@pytest.mark.long
@pytest.mark.parametrize("name", OURS)
@settings(fuzzed, max_examples=300)
@given(data=st.data())
def test_many_changed_files(folder, name, data):
    attempt(folder, name, data.draw(mutated(FILES[name][0]) | st.binary(max_size=80)))


@pytest.mark.parametrize("name", OURS)
@fuzzed
@given(
    content=st.binary(max_size=200) | st.text(max_size=100).map(lambda text: text.encode("utf-8", "replace"))
)
def test_random_bytes(folder, name, content):
    attempt(folder, name, content)


PLAIN = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.just(10**400)
NESTED = st.recursive(
    PLAIN, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=2)
)


@pytest.mark.long
@fuzzed
@given(data=st.data())
def test_settings_of_any_type(data):
    defaults = Config().to_dict()
    name = data.draw(st.sampled_from(sorted(defaults)))
    value = data.draw(NESTED)
    if isinstance(defaults[name], dict) and data.draw(st.booleans()):
        value = {data.draw(st.sampled_from(sorted(defaults[name]))): value}
    try:
        Config.from_dict({name: value})
    except IsomatchError:
        return


@pytest.mark.parametrize(
    "content", [b"a = " + b"[" * 100_000, b"[" * 100_000, b"a" + b".a" * 100_000 + b" = 1"]
)
def test_settings_that_are_nested_too_deeply(folder, content):
    assert not attempt(folder, "config.toml", content)


@pytest.mark.parametrize(
    "line", [b"[" * 100_000, b'{"set": []}', b'{"set": {}}', b"[1]", b"3", b"null", b'"row"', b"1" * 5000]
)
def test_lines_that_are_no_rows(folder, line):
    assert not attempt(folder, LEDGER_FILE, rows() + line + b"\n")


def test_a_position_beyond_64_bits(folder):
    assert not attempt(folder, "positions.txt", b"18446744073709551616 0 0 1 0 0\n1,1,0,0,1,0\n")


@pytest.mark.long
def test_an_index_beyond_64_bits(folder):
    for name in ("landmarks.txt", "map.txt", "cat0.vts"):
        for word in (b"99999999999999999999", b"1" * 5000, b"1_0", "٣".encode(), b"nan"):
            assert not attempt(folder, name, word + b" " + (word if name == "landmarks.txt" else b"") + b"\n")
