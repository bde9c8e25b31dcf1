"""Names of files that are not UTF-8, from the folder of the user to the tables and pages."""

import os
import shutil
import sys
from urllib.parse import unquote_to_bytes

import pytest

from isomatch import read_mesh
from isomatch._core.files import legible
from isomatch._core.tables import read_table
from isomatch.cli import main
from isomatch.cohort import Collection
from small_collections import run

RAW = [b"b\xfchne 5%", b"b\xff\xfe", "bühne 5%".encode(), b"plain"]


@pytest.mark.parametrize("raw", [*RAW, bytes(range(128, 256)), b"100%"])
def test_a_legible_name_gives_the_bytes_again_and_others_stay(raw):
    name = raw.decode("utf-8", "surrogateescape")
    written = legible(name)
    written.encode()
    try:
        assert written == raw.decode()
    except UnicodeDecodeError:
        assert unquote_to_bytes(written) == raw


@pytest.mark.long
@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="names of files are Unicode")
def test_shapes_with_names_that_are_not_utf8_go_through_collect(small, tmp_path, capsys):
    shapes, out = tmp_path / "shapes", tmp_path / "out"
    shapes.mkdir()
    for raw, file in zip(RAW, sorted(small.shapes.iterdir())):
        shutil.copy(file, os.fsencode(shapes) + b"/" + raw + b".ply")
    (shapes / os.fsdecode(b"broken\xff.off")).write_text("nothing")
    names = {"b%FChne 5%25", "b%FF%FE", "bühne 5%", "plain"}
    argv = ["collect", str(shapes), "-o", str(out), "--template", "plain", "--config", str(small.settings)]
    assert main([*argv, "--jobs", "1", "--reports", "1"]) == 3  # one is broken
    collection = Collection.open(out)
    assert run(collection) == []
    assert {*collection.rows().shapes} == {*names, "broken%FF"}
    assert {pair[1] for pair in collection.rows().pairs} == names - {"plain"}
    assert (
        collection.maps("plain", "b%FF%FE").forward.n_target
        == read_mesh(collection.paths["b%FF%FE"]).n_vertices
    )
    assert {line["name"] for line in read_table(out / "shapes.csv").records()} >= names
    page = (out / "index.html").read_text(encoding="utf-8")
    assert "b%FF%FE" in page
    assert "broken%FF.off:1: " in page
    assert "\\ud" not in page
    assert main(["collect", "export", str(out), str(tmp_path / "exported")]) == 0
    assert {file.stem for file in (tmp_path / "exported" / "meshes").iterdir()} == names
