"""MTL: the libraries of materials that an OBJ file names, with their pictures, and what they show."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path, PurePosixPath

from isomatch.assets.materials import IN_PLACE, Layer, Look, Picture, Wrap, picture_in
from isomatch.errors import FormatError
from isomatch.storage.files import opened
from isomatch.storage.texts import decoded, encoding_of

_NUMBERS = {"-o": 3, "-s": 3, "-t": 3, "-mm": 2}
"""Options of a picture, with the most numbers that follow each."""
_WORDS = ("-blendu", "-blendv", "-bm", "-boost", "-cc", "-clamp", "-imfchan", "-texres", "-type")
_PICTURES = ("map_", "bump", "disp", "decal", "norm", "refl")
_MISSING = "there is no such file in the folder of the OBJ file"


def read_libraries(lines: tuple[str, ...], folder: Path) -> dict[str, bytes]:
    """Read the libraries that lines of ``mtllib`` name, and the pictures that these name, by their names."""
    libraries = {
        name: content
        for line in lines
        for name in (line, *line.split())  # one, whose name may have blanks, or several
        if (content := _content(name, folder)) is not None
        and any(keyword == "newmtl" for keyword, _ in _statements(content))  # nothing else is copied
    }
    pictures = {
        name: content
        for library in libraries.values()
        for keyword, rest in _statements(library)
        if keyword.startswith(_PICTURES)
        and (content := _content(name := _options(rest)[1], folder, picture_in)) is not None
    }
    return libraries | pictures


def materials_of_libraries(files: Mapping[str, bytes], libraries: tuple[str, ...]) -> dict[str, Look]:
    """Return the look of each material, by its name."""
    names = (name for line in libraries for name in (line, *line.split()))
    said: dict[str, dict[str, str]] = {}
    for library in dict.fromkeys(names):
        of_material: dict[str, str] = {}
        for keyword, rest in _statements(files.get(library, b"")):
            if keyword == "newmtl":
                of_material = said.setdefault(rest, {})
            else:
                of_material[keyword] = rest
    return {name: _look(name, each, files) for name, each in said.items()}


def library_of(
    names: tuple[str, ...],
    layers: tuple[Layer, ...],
    pictures: Mapping[Picture, str],
    encoding: str = "utf-8",
) -> bytes:
    """Write a library of layers under these names; pictures have names too, or keep their own."""
    lines = []
    for name, layer in zip(names, layers):
        lines += [f"newmtl {name}", "Kd " + " ".join(f"{x:.6g}" for x in layer.tint[:3])]
        if len(layer.tint) > 3 and layer.tint[3] < 1:
            lines.append(f"d {layer.tint[3]:.6g}")
        if layer.picture:
            lines.append(f"map_Kd {pictures.get(layer.picture, layer.picture.name)}")
    return _encoded("".join(f"{line}\n" for line in lines), encoding)


def renamed(library: bytes, names: Mapping[str, str]) -> bytes:
    """Return a library in which pictures have other names."""
    lines = []
    for line in _lines(library):
        keyword, _, rest = line.strip().replace("\t", " ").partition(" ")
        name = _options(rest.strip())[1]
        if keyword.lower().startswith(_PICTURES) and name in names and name in line:
            line = f"{line[: line.rindex(name)]}{names[name]}"
        lines.append(line)
    return _encoded("\n".join(lines), encoding_of(library))


def _encoded(text: str, encoding: str) -> bytes:
    """Write a text in an encoding, or in UTF-8 where that has no letters for it."""
    try:
        return text.encode(encoding)
    except UnicodeEncodeError:
        return text.encode(errors="backslashreplace")


def _look(name: str, said: Mapping[str, str], files: Mapping[str, bytes]) -> Look:
    kd = _numbers(said.get("kd", ""), 3) or [1.0, 1.0, 1.0]
    if "map_kd" in said and max(kd) == 0:  # which some programs write beside every picture
        kd = [1.0, 1.0, 1.0]
    opacity = _numbers(said.get("d", ""), 1) or [1 - x for x in _numbers(said.get("tr", ""), 1)] or [1.0]
    ke = _numbers(said.get("ke", ""), 3) or [1.0 if "map_ke" in said else 0.0] * 3
    emitted = _layer(said.get("map_ke", ""), (*ke, 1.0), files) if max(ke) > 0 else None
    return Look(name, _layer(said.get("map_kd", ""), (*kd, *opacity), files), emitted)


def _layer(text: str, tint: tuple[float, ...], files: Mapping[str, bytes]) -> Layer:
    if not text:
        return Layer(tint)
    options, name = _options(text)
    picture = Picture(name, files[name]) if name in files else Picture(name, missing=_MISSING)
    sx, sy = [*_numbers(" ".join(options.get("-s", [])), 1, 2), 1.0, 1.0][:2]
    x, y = [*_numbers(" ".join(options.get("-o", [])), 1, 2), 0.0, 0.0][:2]
    matrix = ((sx, 0.0, x), (0.0, sy, 1 - sy - y))  # v of OBJ goes up
    wrap: Wrap = "clamp" if options.get("-clamp") == ["on"] else "repeat"
    return Layer(
        tint, picture, matrix=matrix if (sx, sy, x, y) != (1, 1, 0, 0) else IN_PLACE, wrap=(wrap, wrap)
    )


def _options(text: str) -> tuple[dict[str, list[str]], str]:
    """Split what follows the keyword of a picture into its options and its name, which may have blanks."""
    words = text.split(" ")
    options: dict[str, list[str]] = {}
    while len(words) > 1 and (words[0] in _NUMBERS or words[0] in _WORDS or not words[0]):
        option, words = words[0], words[1:]
        most = _NUMBERS.get(option, 1 if option else 0)
        taken: list[str] = []
        while len(words) > 1 and len(taken) < most and (option in _WORDS or _numbers(words[0], 1)):
            taken.append(words.pop(0))
        options[option] = taken
    return options, " ".join(words)


def _numbers(text: str, least: int, most: int = 3) -> list[float]:
    """Return the numbers of a text; one alone stands for all; none if there are fewer than least and not one."""
    try:
        found = [float(word) for word in text.split()[:most]]
    except ValueError:
        return []
    if len(found) == 1 and least > 1:
        found *= least
    return found if len(found) >= least else []


def _statements(library: bytes) -> Iterator[tuple[str, str]]:
    for line in _lines(library):
        keyword, _, rest = line.strip().replace("\t", " ").partition(" ")
        if keyword and not keyword.startswith("#"):
            yield keyword.lower(), rest.strip()


def _lines(library: bytes) -> list[str]:
    return decoded(library).replace("\r\n", "\n").replace("\r", "\n").split("\n")


def _all_of(path: Path) -> bytes:
    with opened(path) as file:
        return file.read()


def _content(name: str, folder: Path, read: Callable[[Path], bytes | None] = _all_of) -> bytes | None:
    """Read a file of the folder or below, as no other may be copied; None if there is none."""
    clean = name.replace("\\", "/")
    # of a path on the machine of who made the file, the last name is sought here too
    for each in (clean, PurePosixPath(clean).name):
        with suppress(FormatError, OSError, ValueError):  # as of names too long, or with a zero byte
            path = (folder / each).resolve()
            if each and path.is_relative_to(folder.resolve()) and path.is_file():
                return read(path)
    return None
