"""Files under their final names are whole, and only those of isomatch are touched."""

import csv
import errno
import json
import os
import stat
import subprocess
import sys
from contextlib import suppress

import pytest

from isomatch import UnwritableFileError
from isomatch._core.files import claimed, replaced, write_text
from isomatch._core.texts import text_lines, write_csv

CLAIM = """
import sys
from pathlib import Path
from isomatch._core.files import claimed
with claimed(Path(sys.argv[1])):
    print("claimed", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def claimant(tmp_path):
    """A process that has claimed ``result``."""
    argv = [sys.executable, "-c", CLAIM, str(tmp_path / "result")]
    with subprocess.Popen(argv, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline().strip() == b"claimed"
        yield process
        process.kill()


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_file_appears_when_it_is_complete_and_otherwise_stays_as_it_was(tmp_path):
    path = tmp_path / "file"
    with replaced(path) as file:
        file.write(b"one")
        assert not path.exists()
    with suppress(KeyboardInterrupt), replaced(path) as file:
        file.write(b"two")
        raise KeyboardInterrupt
    assert path.read_bytes() == b"one"
    assert names(tmp_path) == ["file"]


def test_the_system_is_quoted(tmp_path):
    with (
        pytest.raises(UnwritableFileError, match="written"),
        replaced(tmp_path / "file"),
    ):
        raise OSError(errno.ENOSPC, "No space left on device")
    with pytest.raises(UnwritableFileError, match="written"):
        write_text(tmp_path / "absent" / "file", "")
    assert names(tmp_path) == []


def test_a_dangling_link_is_not_followed_and_another_keeps_pointing(tmp_path):
    (tmp_path / "dangling").symlink_to(tmp_path / "absent")
    write_text(tmp_path / "dangling", "new")
    assert names(tmp_path) == ["dangling"]
    assert not (tmp_path / "dangling").is_symlink()
    (tmp_path / "link").symlink_to(tmp_path / "dangling")
    write_text(tmp_path / "link", "newer")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "dangling").read_text() == "newer"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_what_is_no_file_is_left_as_it_is(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    for name in names(tmp_path):
        with pytest.raises(UnwritableFileError, match="file"):
            write_text(tmp_path / name, "")
        with pytest.raises(UnwritableFileError, match="is not a file"), claimed(tmp_path / name):
            pass
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)


@pytest.mark.skipif(os.name == "nt", reason="needs modes of files")
@pytest.mark.parametrize("umask", [0o022, 0o027, 0o077])
def test_the_mode_follows_the_umask(tmp_path, umask):
    before = os.umask(umask)
    try:
        write_text(tmp_path / "file", "")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "file").stat().st_mode) == 0o666 & ~umask


def test_names_of_files_that_are_not_utf8_survive(tmp_path):
    name = os.fsdecode(b"a\xff\n$\xf0\x9f\x90\xba.ply")
    write_text(tmp_path / "file.json", json.dumps({"file": name}, ensure_ascii=False))
    assert json.loads((tmp_path / "file.json").read_text(encoding="utf-8")) == {"file": name}
    write_csv(tmp_path / "file.csv", [{"a": name, "b": 1, "c": 2}], ["a", "b"])
    with (tmp_path / "file.csv").open(newline="", encoding="utf-8") as file:
        assert list(csv.reader(file)) == [["a", "b"], ["a\\udcff\n$🐺.ply", "1"]]


def test_a_claim_excludes_others_until_it_ends(tmp_path, claimant):
    message = "result: is being written by another run; wait"
    with pytest.raises(UnwritableFileError, match=message), claimed(tmp_path / "result"):
        pass
    with claimed(tmp_path / "another"):
        pass
    claimant.communicate()
    with claimed(tmp_path / "result"), pytest.raises(UnwritableFileError), claimed(tmp_path / "result"):
        pass
    assert names(tmp_path) == []


def test_the_claim_of_a_killed_process_does_not_block(tmp_path, claimant):
    claimant.kill()
    claimant.wait()
    assert names(tmp_path) == [".result.lock"]
    with claimed(tmp_path / "result"):
        pass
    assert names(tmp_path) == []


def test_a_claim_makes_no_folder(tmp_path):
    with pytest.raises(UnwritableFileError, match="No such file"), claimed(tmp_path / "absent" / "result"):
        pass
    assert names(tmp_path) == []


def test_a_claim_refuses_what_exists_even_a_dangling_link(tmp_path):
    (tmp_path / "map").symlink_to(tmp_path / "absent")
    message = r"map: already exists .* --force"
    with pytest.raises(UnwritableFileError, match=message), claimed(tmp_path / "result", [tmp_path / "map"]):
        pass
    assert names(tmp_path) == ["map"]


def test_a_system_without_locks_is_noted(tmp_path, monkeypatch, caplog):
    def unable(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr("fcntl.flock", unable)
    with claimed(tmp_path / "result"):
        assert "not locked (No locks available)" in caplog.text
    assert names(tmp_path) == []


def test_lines_of_texts(tmp_path):
    path = tmp_path / "a.txt"
    path.write_bytes("\ufeff1 2 # near\r\n\r\n  # all\r3\t4 #last\np#3\n# end".encode())
    assert list(text_lines(path)) == [(1, "1 2"), (4, "3\t4"), (5, "p#3")]
    path.write_bytes(b"M\xfcller \x96 1\nM\xf6ller\x81\n")
    assert [line for _, line in text_lines(path)] == ["Müller \x96 1", "Möller\x81"]
    path.write_bytes(b"M\xfcller \x96 1\n")
    assert [line for _, line in text_lines(path)] == ["Müller – 1"]
