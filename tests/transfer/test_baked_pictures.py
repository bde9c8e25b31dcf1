"""Pictures are shown as their files say: looked up, wrapped, read, and named where they cannot be."""

import base64

import numpy as np
import pytest
from gltf_made import BLUE, GREY, RED, WHITE, Square, assert_stripes, onto, picture, shown

from isomatch import Correspondence, bake_texture, carry_attributes, read_asset, write_asset
from isomatch._core.errors import DescriptorError

CLAMP, MIRROR = {"wrapS": 33071}, {"wrapS": 33648}


def transformed(**transform):
    return {"extensions": {"KHR_texture_transform": transform}}


def webp(square):
    image = square.image(picture(kind="WEBP"), "image/webp")
    return square.lay().paint({"extensions": {"EXT_texture_webp": {"source": image}}})


def base64_picture(square):
    text = "data:image/png;base64," + base64.b64encode(picture()).decode()
    return square.lay().paint(image=square.gltf.append("images", {"uri": text}))


def unlit(square):
    square.lay().paint().json["materials"][0]["extensions"] = {"KHR_materials_unlit": {}}
    return square


def glossy(square):
    material = square.lay().paint().json["materials"][0]
    info = material.pop("pbrMetallicRoughness")["baseColorTexture"]
    material["extensions"] = {"KHR_materials_pbrSpecularGlossiness": {"diffuseTexture": info}}
    return square


def second(square, **info):
    return square.lay(u=1 - square.u).lay(key="TEXCOORD_1").paint(**info)


HALVES = {
    "plain": lambda s: s.lay().paint(),
    "texCoord 1": lambda s: second(s, texCoord=1),
    "texCoord 1 of the transform": lambda s: second(s, **transformed(texCoord=1)),
    "scale": lambda s: s.lay(u=s.u / 2).paint(**transformed(scale=[2, 1])),
    "offset": lambda s: s.lay(u=s.u + 0.25).paint(**transformed(offset=[-0.25, 0])),
    "quarter turn": lambda s: s.lay(u=1 - s.down, down=s.u).paint(
        **transformed(rotation=np.pi / 2, offset=[0, 1])
    ),
    "JPEG": lambda s: s.lay().paint(image=s.image(picture(kind="JPEG"), "image/jpeg")),
    "WebP": webp,
    "base64": base64_picture,
    "unlit": unlit,
    "emissive": lambda s: s.lay().paint(name="emissiveTexture"),
    "specular": glossy,
    "clamped": lambda s: s.lay(u=8 * s.u - 3.5).paint(sampler=CLAMP),
    "mirrored": lambda s: s.lay(u=s.u + 1).paint(image=s.image(picture((BLUE, RED))), sampler=MIRROR),
    "repeated": lambda s: s.lay(u=s.u - 2).paint(),
}
"""Ways to say that the square is red on the left and blue on the right."""
QUARTERS = {
    "mirrored": (lambda s: s.lay(u=2 * s.u).paint(sampler=MIRROR), (RED, BLUE, BLUE, RED)),
    "repeated": (lambda s: s.lay(u=2 * s.u).paint(), (RED, BLUE, RED, BLUE)),
    "clamped": (lambda s: s.lay(u=2 * s.u - 1).paint(sampler=CLAMP), (RED, RED, RED, BLUE)),
}


@pytest.mark.parametrize("way", HALVES)
def test_every_way_to_look_up_shows_the_same(way, tmp_path):
    pixels, notes = shown(HALVES[way](Square()).write(tmp_path / "a.glb"))
    assert_stripes(pixels, (RED, BLUE))
    assert notes == ()


@pytest.mark.parametrize("way", QUARTERS)
def test_beyond_the_borders(way, tmp_path):
    make, colours = QUARTERS[way]
    assert_stripes(shown(make(Square()).write(tmp_path / "a.glb"))[0], colours)


@pytest.mark.parametrize("suffix", [".glb", ".obj"])
@pytest.mark.parametrize("way", [*HALVES, *QUARTERS])
def test_what_is_carried_shows_the_same(way, suffix, tmp_path):
    """Also where the receiver has a picture of its own and other texture coordinates."""
    make, colours = QUARTERS[way] if way in QUARTERS else (HALVES.get(way), (RED, BLUE))
    giver = read_asset(make(Square()).write(tmp_path / "giver.glb"))
    own = Square().lay(u=0 * Square().u).paint(image=None)
    own.json["images"][0] = own.json["images"][own.image(picture((WHITE, GREY)))]
    receiver = read_asset(own.write(tmp_path / "receiver.glb"))
    carried = carry_attributes(Correspondence(np.arange(25), n_target=25), receiver, giver, "uv")
    write_asset(tmp_path / f"out{suffix}", carried.asset)
    assert_stripes(shown(tmp_path / f"out{suffix}")[0], colours)


@pytest.mark.parametrize("suffix", [".glb", ".obj"])
def test_each_face_takes_its_own_material(suffix, tmp_path):
    """The receiver has one primitive, the giver two, one of which shows another picture."""
    giver = read_asset(two_pictures().write(tmp_path / "giver.glb"))
    receiver = read_asset(Square(9).write(tmp_path / "receiver.glb"))
    carried = carry_attributes(onto(receiver, giver), receiver, giver, "uv")
    write_asset(tmp_path / f"out{suffix}", carried.asset)
    found = read_asset(tmp_path / f"out{suffix}")
    assert np.array_equal(found.points, receiver.points)
    assert len(found.polygons) == len(receiver.polygons)
    plain = read_asset(Square(9).lay().write(tmp_path / "plain.glb"))
    same = (plain.points[:, None, :] == found.points).all(axis=2).argmax(axis=1)
    baked = bake_texture(Correspondence(same, n_target=len(found.points)), plain, found, 64)
    assert_stripes(baked.picture[..., :3], (RED, BLUE))


def two_pictures(second=None):
    """Red on the left and blue on the right by two pictures, each with a material of its own."""
    square = Square().lay().paint()
    square.json["images"][0] = square.json["images"][square.image(picture((RED,)))]
    attributes = square.first["attributes"]
    left = square.points[square.faces, 0].mean(axis=1) < 2
    square.json["meshes"][0]["primitives"] = [
        {**square.primitive(square.faces[here]), "attributes": attributes, "material": i}
        for i, here in enumerate((left, ~left))
    ]
    image = square.image(picture((BLUE,))) if second is None else square.gltf.append("images", second)
    texture = square.gltf.append("textures", {"source": image})
    square.gltf.append("materials", {"pbrMetallicRoughness": {"baseColorTexture": {"index": texture}}})
    return square


@pytest.mark.parametrize(
    ("image", "told"),
    [
        ({"uri": "skin.png"}, "'skin.png': there is no such file"),
        ({"uri": "data:image/png;base64,AAAA"}, "'image 2': it is of no known kind"),
        ({"uri": "data:image/png;base64," + base64.b64encode(picture()[:60]).decode()}, "'image 2': "),
        ({"name": "skin"}, "'skin': it is not in the file"),
    ],
    ids=["not there", "no picture", "cut short", "nothing"],
)
def test_a_picture_that_cannot_be_read_is_named(image, told, tmp_path):
    path = two_pictures(image).write(tmp_path / "a.glb")
    pixels, notes = shown(path)
    assert_stripes(pixels, (RED, GREY))
    assert len(notes) == 1
    assert notes[0].startswith(told)
    giver = read_asset(path)
    carried = carry_attributes(Correspondence(np.arange(25), n_target=25), giver, giver, "uv")
    assert len(carried.notes) == 1
    assert carried.notes[0].startswith(told)


def test_no_picture_at_all_is_an_error_that_names_them(tmp_path):
    square = Square().lay().paint(image=0)
    square.json["images"] = [{"uri": "skin.png"}]
    with pytest.raises(DescriptorError, match="there"):
        shown(square.write(tmp_path / "a.glb"))


def test_a_kind_that_cannot_be_read_has_another_beside_it(tmp_path):
    square = Square().lay()
    unknown = square.image(b"\xabKTX 20\xbb\r\n\x1a\n", "image/ktx2")
    square.paint(
        {"source": square.image(picture()), "extensions": {"KHR_texture_basisu": {"source": unknown}}}
    )
    assert_stripes(shown(square.write(tmp_path / "a.glb"))[0], (RED, BLUE))


def test_texture_coordinates_of_other_names_are_found(tmp_path):
    """The names of both are in the file that is carried to; the receiver keeps its own under another number."""
    square = second(Square(), texCoord=1)
    for number, name in ((0, "atlas"), (1, "skin")):
        square.json["accessors"][square.first["attributes"][f"TEXCOORD_{number}"]]["extras"] = {"name": name}
    giver = read_asset(square.write(tmp_path / "giver.glb"))
    receiver = read_asset(Square().lay().write(tmp_path / "receiver.glb"))
    carried = carry_attributes(Correspondence(np.arange(25), n_target=25), receiver, giver)
    write_asset(tmp_path / "out.glb", carried.asset)
    assert {a.name for a in read_asset(tmp_path / "out.glb").of_kind("uv")} == {"uv", "atlas", "skin"}
    assert_stripes(shown(tmp_path / "out.glb")[0], (RED, BLUE))


def test_what_a_damaged_material_names_is_told(tmp_path):
    square = two_pictures()
    square.json["textures"][1]["source"] = 9
    pixels, notes = shown(square.write(tmp_path / "a.glb"))
    assert_stripes(pixels, (RED, GREY))
    assert [note.split(":")[0] for note in notes] == ["'image 9'"]
    square = two_pictures()
    square.json["meshes"][0]["primitives"][0]["material"] = 7
    assert_stripes(shown(square.write(tmp_path / "b.glb"))[0], (WHITE, BLUE))


def test_base_colours_beside_a_lost_picture(tmp_path):
    square = two_pictures({"uri": "skin.png"})
    square.json["materials"][0] = {"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}}
    assert_stripes(shown(square.write(tmp_path / "a.glb"))[0], (RED, GREY))
