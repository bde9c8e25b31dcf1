"""Names in text files: a # in them is a letter, and bytes that are not UTF-8 come back as they were."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from isomatch import read_asset, write_asset
from isomatch.io.formats import obj

TRIANGLE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def obj_file(names, keyword=b"usemtl", library=b"skin.mtl"):
    """One face for each name."""
    faces = b"".join(keyword + b" " + name + b"\nf 1 2 3\n" for name in names)
    return b"mtllib " + library + b"\n" + TRIANGLE + faces


NAMES = {
    "numbered": [b"Material #1", b"Material #2", b"Material #3"],
    "hash between blanks": [b"Material # 1", b"Material # 2"],
    "hash first": [b"#1", b"#2"],
    "hash inside": [b"skin#1", b"skin#2", b"skin"],
    "Latin-1": ["Körper".encode("latin-1"), "Körber".encode("latin-1"), "Füße".encode("latin-1")],
    "one letter": [b"\xe4", b"\xf6", b"\xfc"],
    "no letter of Windows": [b"\x81", b"\x8d", b"\x90"],
    "Cyrillic": ["рука".encode("cp1251"), "нога".encode("cp1251")],
    "Japanese": ["手".encode("shift_jis"), "足".encode("shift_jis")],
    "UTF-8": ["体".encode(), "脚".encode(), "à".encode(), "Å".encode()],
    "UTF-8 and Latin-1": ["ü".encode(), "ü".encode("latin-1")],
    "blanks of Latin-1": [b"p\xa0q", b"p q", b"p\x85q"],
    "two blanks": [b"head  top", b"head top"],
}


@pytest.mark.parametrize("names", NAMES.values(), ids=NAMES)
@pytest.mark.parametrize(
    ("keyword", "attribute"), [(b"usemtl", "material"), (b"g", "group"), (b"o", "object")]
)
def test_names_stay_apart_and_come_back(tmp_path, names, keyword, attribute):
    library = b"skin " + names[0] + b".mtl"
    (tmp_path / "a.obj").write_bytes(obj_file(names, keyword, library))
    asset = read_asset(tmp_path / "a.obj")
    label = asset.attribute(attribute)
    assert label.values.tolist() == list(range(1, len(names) + 1))
    assert len(set(label.names.values())) == len(names) + 1  # with none
    assert write_asset(tmp_path / "b.obj", asset) == ()
    lines = (tmp_path / "b.obj").read_bytes().split(b"\n")
    assert [line for line in lines if line.startswith(keyword + b" ")] == [
        keyword + b" " + name for name in names
    ]
    assert lines[0] == b"mtllib " + library


@pytest.mark.parametrize(
    ("encoding", "name"),
    [("utf-8", "体"), ("latin-1", "Körper"), ("cp1252", "a – b"), ("ascii", "Material #1")],
)
def test_names_are_readable(encoding, name):
    asset = obj.read_asset(obj_file([name.encode(encoding)], library=f"{name}.mtl".encode(encoding)), "a.obj")
    assert asset.attribute("material").names[1] == name
    assert asset.document.libraries == (f"{name}.mtl",)


@pytest.mark.long
@given(st.lists(st.binary(min_size=1, max_size=6), min_size=1, max_size=4, unique=True))
@settings(max_examples=200, deadline=None)
def test_any_bytes_come_back(names):
    """Tabs of either kind, and form feeds, are blanks."""
    blank = bytes.maketrans(b"\t\v\f", b"   ")
    given = list(dict.fromkeys(b"x" + name.translate(None, b"\n\r\\") + b"y" for name in names))
    names = list(dict.fromkeys(name.translate(blank) for name in given))
    asset = obj.read_asset(obj_file(given), "a.obj")
    values = [1 + names.index(name.translate(blank)) for name in given]
    assert asset.attribute("material").values.tolist() == values
    assert (
        obj.read_asset(obj.write(asset), "b.obj").attribute("material").names
        == asset.attribute("material").names
    )
    for name in names:
        assert b"usemtl " + name + b"\n" in obj.write(asset)


def test_comments_end_lines_of_numbers_but_not_names():
    text = b"#v 9 9 9\n  # v 9 9 9\nv 0 0 0 # first\nv 1 0 0\t#second\nv 0 1 0\nusemtl a # b\ns 1 # on\nf 1 2 3 # last\n"
    asset = obj.read_asset(text, "a.obj")
    assert len(asset.points) == 3
    assert asset.attribute("material").names[1] == "a # b"
    assert asset.attribute("smoothing").names[1] == "1"


def test_comments_of_ply_headers_come_back(tmp_path):
    comment = "comment Größe # 1".encode("latin-1")
    text = (
        b"ply\nformat ascii 1.0\n" + comment + b"\nelement vertex 1\nproperty float x\nproperty float y\n"
        b"property float z\nproperty uchar H\xe4nde\nend_header\n0 0 0 1\n"
    )  # fmt: skip
    (tmp_path / "a.ply").write_bytes(text)
    write_asset(tmp_path / "b.ply", read_asset(tmp_path / "a.ply"))
    written = (tmp_path / "b.ply").read_bytes()
    assert comment in written
    assert b"property uchar H\xe4nde\n" in written
