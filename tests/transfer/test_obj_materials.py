"""Materials of OBJ files: libraries and pictures are found, shown on the other surface, and written beside it."""

import json

import numpy as np
import pytest
from gltf_made import BLUE, GREY, RED, WHITE, Square, assert_stripes, onto, picture

from isomatch import Asset, Attribute, Correspondence, bake_texture, carry_attributes, read_asset, write_asset
from isomatch.cli import main
from isomatch.io import Polygons, looks_of

QUADS = [k + np.array([0, 1, 6, 5]) for k in range(20) if k % 5 != 4]
"""The corners of a square of 4 × 4 quads, whose points are those of `Square`."""


def square_obj(folder, u=None, v=None, uses=("skin",), head="mtllib scan.mtl\n", name="scan.obj"):
    """Write a square of quads; columns of them use the materials in turn."""
    x, y = np.tile(np.arange(5.0), 5), np.repeat(np.arange(5.0), 5)
    u, v = (x / 4 if u is None else u), (y / 4 if v is None else v)
    lines = [f"v {a} {b} 0\n" for a, b in zip(x, y)] + [f"vt {a} {b}\n" for a, b in zip(u, v)]
    for i, material in enumerate(uses):
        here = [quad for quad in QUADS if int(x[quad[0]] * len(uses) // 4) == i]
        lines.append(f"usemtl {material}\n")
        lines += ["f " + " ".join(f"{k + 1}/{k + 1}" for k in quad) + "\n" for quad in here]
    path = folder / name
    path.write_text(head + "".join(lines))
    return path


@pytest.fixture
def folder(tmp_path):
    """A scan with its library and its picture."""
    (tmp_path / "scan").mkdir()
    (tmp_path / "scan" / "scan.mtl").write_text("newmtl skin\nKd 1 1 1\nmap_Kd skin.png\n")
    (tmp_path / "scan" / "skin.png").write_bytes(picture())
    square_obj(tmp_path / "scan")
    return tmp_path / "scan"


def template(folder, suffix=".obj"):
    """A finer square without materials, in a folder of its own."""
    folder.mkdir(exist_ok=True)
    fine = Square(9)
    plain = Asset(fine.points, Polygons.of_triangles(fine.faces))
    uv = Attribute("uv", "point", "uv", np.column_stack([fine.u, 1 - fine.down]))
    write_asset(folder / f"template{suffix}", plain.with_attributes(uv))
    return folder / f"template{suffix}"


def seen(path):
    """The square of a file as it is seen."""
    giver = read_asset(path)
    plain = read_asset(Square().lay().write(path.with_name("seen.glb")))
    return bake_texture(onto(plain, giver), plain, giver, 64)


@pytest.mark.parametrize("suffix", [".obj", ".glb"])
def test_the_picture_goes_along_to_another_folder(suffix, folder, tmp_path, monkeypatch):
    monkeypatch.chdir("/")
    receiver = read_asset(template(tmp_path / "made", suffix))
    giver = read_asset(folder / "scan.obj")
    carried = carry_attributes(onto(receiver, giver), receiver, giver, "uv")
    assert write_asset(tmp_path / "made" / f"out{suffix}", carried.asset) == ()
    assert carried.notes == ()
    if suffix == ".obj":
        lines = (tmp_path / "made" / "out.obj").read_text().splitlines()
        assert [line for line in lines if line[:1] in "mu"] == ["mtllib scan.mtl", "usemtl skin"]
        assert (tmp_path / "made" / "scan.mtl").read_text() == "newmtl skin\nKd 1 1 1\nmap_Kd skin.png\n"
        assert (tmp_path / "made" / "skin.png").read_bytes() == picture()
    assert_stripes(seen(tmp_path / "made" / f"out{suffix}").picture[..., :3], (RED, BLUE))


def saved_map(path, receiver, giver):
    found = onto(read_asset(receiver), read_asset(giver))
    hashes = [read_asset(each).mesh.content_hash for each in (receiver, giver)]
    n = found.n_target
    Correspondence(found.vertices, n, found.faces, found.barycentric, *hashes).save(path)
    return [str(each) for each in (path, receiver, giver)]


def test_the_command_bakes_and_names_its_files(folder, tmp_path, capsys):
    receiver = template(tmp_path / "made")
    files = saved_map(tmp_path / "map.npz", receiver, folder / "scan.obj")
    out = tmp_path / "made" / "out.obj"
    words = ["transfer", *files, "-o", str(out), "--bake", "64", "--json"]
    assert main(words) == 0
    names = json.loads(capsys.readouterr().out)["files"]
    assert names == [str(out.with_suffix(suffix)) for suffix in (".obj", ".mtl", ".png")]
    assert "mtllib out.mtl\n" in out.read_text()
    assert "map_Kd out.png\n" in out.with_suffix(".mtl").read_text()
    assert_stripes(seen(out).picture[..., :3], (RED, BLUE))
    assert main(words) == 1
    assert "already exists" in capsys.readouterr().err
    assert main([*words, "--force"]) == 0


def test_the_command_names_what_goes_along_and_what_is_missing(folder, tmp_path, capsys):
    (folder / "skin.png").unlink()
    files = saved_map(tmp_path / "map.npz", template(tmp_path / "made"), folder / "scan.obj")
    assert main(["transfer", *files, "-o", str(tmp_path / "made" / "out.obj"), "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["files"] == [str(tmp_path / "made" / name) for name in ("out.obj", "scan.mtl")]
    assert len(record["notes"]) == 1
    assert record["notes"][0].startswith("'skin.png': there is no such file in the folder of the surface")


def test_other_files_are_not_replaced(folder, tmp_path):
    (tmp_path / "out").mkdir()
    for name in ("skin.png", "scan.mtl"):
        (tmp_path / "out" / name).write_bytes(b"of somebody else")
    asset = read_asset(folder / "scan.obj")
    for _ in range(2):
        write_asset(tmp_path / "out" / "copy.obj", asset)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "copy.obj", "copy_scan.mtl", "copy_skin.png", "scan.mtl", "skin.png",
    }  # fmt: skip
    assert (tmp_path / "out" / "skin.png").read_bytes() == b"of somebody else"
    assert_stripes(seen(tmp_path / "out" / "copy.obj").picture[..., :3], (RED, BLUE))


def test_in_its_own_folder_nothing_else_is_written(folder):
    before = {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}
    asset = read_asset(folder / "scan.obj")
    write_asset(folder / "copy.obj", asset)
    after = {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}
    assert before.items() <= after.items()
    assert after.keys() - before.keys() == {"copy.obj"}


@pytest.mark.parametrize(
    ("library", "name"),
    [
        ("newmtl skin\nmap_Kd my skin.png\n", "my skin.png"),
        ("newmtl skin\nmap_Kd C:\\Users\\me\\skin.png\n", "skin.png"),
        ("newmtl skin\nmap_Kd ../textures/skin.png\n", "skin.png"),
        ("newmtl skin\nmap_Kd tex\\skin.png\n", "tex/skin.png"),
        ("newmtl skin\r\n\tmap_Kd skin.png\r\n", "skin.png"),
        ("newmtl skin\nKd 0 0 0\nmap_Kd -blendu on -bm 0.5 skin.png\n", "skin.png"),
        ("newmtl skin\nmap_kd -o 0.5 -s 1 1 1 skin.png\n", "turned"),
        ("newmtl skin\nKd 0 0 0\nmap_Ke skin.png\n", "skin.png"),
        ("newmtl other\nKd 0 1 0\nnewmtl skin\nKd 1 1 1\nmap_Kd 2024.png\n", "2024.png"),
    ],
    ids=["blanks", "Windows", "elsewhere", "folder", "CRLF", "options", "offset", "emitted", "second"],
)
def test_libraries_as_others_write_them(library, name, tmp_path):
    (tmp_path / "tex").mkdir()
    colours = (BLUE, RED) if name == "turned" else (RED, BLUE)
    (tmp_path / ("skin.png" if name == "turned" else name)).write_bytes(picture(colours))
    (tmp_path / "scan.mtl").write_bytes(library.encode())
    path = square_obj(tmp_path)
    assert_stripes(seen(path).picture[..., :3], (RED, BLUE))
    (tmp_path / "out").mkdir()
    for suffix in (".obj", ".glb"):
        write_asset(tmp_path / "out" / f"copy{suffix}", read_asset(path))
        assert_stripes(seen(tmp_path / "out" / f"copy{suffix}").picture[..., :3], (RED, BLUE))


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-8-sig", "utf-16"])
def test_names_in_any_encoding(encoding, folder, tmp_path):
    for name in ("scan.obj", "scan.mtl"):
        text = (folder / name).read_text().replace("skin", "Straße")
        (folder / name).write_bytes(text.encode(encoding))
    (folder / "skin.png").rename(folder / "Straße.png")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "Straße.png").write_bytes(b"another")
    write_asset(tmp_path / "out" / "copy.obj", read_asset(folder / "scan.obj"))
    looks = looks_of(read_asset(tmp_path / "out" / "copy.obj"))
    assert [look.name for look in looks.looks] == ["Straße"]
    assert [each.data for each in looks.pictures] == [picture()]


@pytest.mark.parametrize("suffix", [".obj", ".glb"])
def test_colours_pictures_and_what_is_missing_side_by_side(suffix, tmp_path):
    library = "newmtl a\nKd 1 0 0\nnewmtl b\nmap_Kd b.png\nnewmtl c\nmap_Kd c.png\nnewmtl d\nKd 1 1 1\n"
    (tmp_path / "scan.mtl").write_text(library)
    (tmp_path / "b.png").write_bytes(picture((BLUE,)))
    path = square_obj(tmp_path, uses="abcd")
    (tmp_path / "out").mkdir()
    write_asset(tmp_path / "out" / f"copy{suffix}", read_asset(path))
    for each in (path, tmp_path / "out" / f"copy{suffix}"):
        baked = seen(each)
        assert_stripes(baked.picture[..., :3], (RED, BLUE, GREY, WHITE))
        assert [note.split(":")[0] for note in baked.notes] == ["'c.png'"]


def test_a_library_that_is_not_there_is_named(tmp_path):
    path = square_obj(tmp_path)
    asset = read_asset(path)
    carried = carry_attributes(Correspondence(np.arange(25), n_target=25), asset, asset)
    assert [note.split(":")[0] for note in carried.notes] == ["'scan.mtl'"]


def test_materials_and_libraries_that_are_not_there_are_grey_and_named(tmp_path):
    (tmp_path / "half.mtl").write_text("newmtl a\nKd 1 0 0\n")
    head = "mtllib gone.mtl half.mtl\n"
    path = square_obj(tmp_path, uses=("a", "GONE"), head=head)
    baked = seen(path)
    assert_stripes(baked.picture[..., :3], (RED, GREY))
    assert [note.split(":")[0] for note in baked.notes] == ["'GONE'", "'gone.mtl'"]
    asset = read_asset(path)
    (tmp_path / "made").mkdir()
    (tmp_path / "made" / "mine.mtl").write_text("newmtl mine\n")
    receiver = read_asset(square_obj(tmp_path / "made", uses=("mine",), head="mtllib mine.mtl\n"))
    for data in ("all", "uv"):
        carried = carry_attributes(Correspondence(np.arange(25), n_target=25), receiver, asset, data)
        assert [note.split(":")[0] for note in carried.notes] == ["'GONE'", "'gone.mtl'"]
        write_asset(tmp_path / "made" / "out.obj", carried.asset)
        lines = (tmp_path / "made" / "out.obj").read_text().splitlines()
        assert {line for line in lines if line[:1] in "mu"} == {head.strip(), "usemtl a", "usemtl GONE"}


@pytest.mark.parametrize(
    "names", [("a/x.png", "b/x.png", "x.png", "c/x.png"), ("copy_x.png", *(f"{i}/copy_x.png" for i in "abc"))]
)
def test_pictures_of_one_name_in_several_folders_stay_apart(names, tmp_path):
    scan, out = tmp_path / "scan", tmp_path / "out"
    colours = (RED, BLUE, WHITE, GREY)
    out.mkdir()
    for name, colour in zip(names, colours):
        (scan / name).parent.mkdir(parents=True, exist_ok=True)
        (scan / name).write_bytes(picture((colour,)))
    (scan / "scan.mtl").write_text("".join(f"newmtl {i}\nmap_Kd {names[i]}\n" for i in range(4)))
    path = square_obj(scan, uses=range(4))
    for _ in range(2):
        write_asset(out / "copy.obj", read_asset(path))
        assert_stripes(seen(out / "copy.obj").picture[..., :3], colours)


def test_what_can_be_seen_through_is_blended(tmp_path):
    (tmp_path / "scan.mtl").write_text("newmtl glass\nKd 1 0 0\nd 0.25\nnewmtl wall\nKd 1 0 0\n")
    write_asset(tmp_path / "a.glb", read_asset(square_obj(tmp_path, uses=("glass", "wall"))))
    materials = read_asset(tmp_path / "a.glb").document.json["materials"]
    assert [each.get("alphaMode", "OPAQUE") for each in materials] == ["BLEND", "OPAQUE"]


def test_a_glb_of_many_looks_becomes_an_obj(tmp_path):
    """Its second texture coordinates and their transform are those that an OBJ file has."""
    square = Square().lay(u=1 - Square().u).lay(u=Square().u / 2, key="TEXCOORD_1")
    transform = {"KHR_texture_transform": {"scale": [2, 1]}}
    square.paint(image=square.image(picture(kind="WEBP"), "image/webp"), texCoord=1, extensions=transform)
    asset = read_asset(square.write(tmp_path / "a.glb"))
    left = write_asset(tmp_path / "b.obj", asset)
    assert [a.name for a in left] == ["uv_1"]
    assert (tmp_path / "b.png").read_bytes()[:4] == b"\x89PNG"
    assert main(["repair", str(tmp_path / "a.glb"), "-o", str(tmp_path / "c.obj")]) == 0
    for name in ("b.obj", "c.obj"):
        assert_stripes(seen(tmp_path / name).picture[..., :3], (RED, BLUE))
