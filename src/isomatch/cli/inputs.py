"""The options that several commands have, and their inputs: surfaces, functions, maps, settings, outcomes."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, TypeAlias

import numpy as np
from cyclopts import Parameter

import isomatch
from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.errors import FormatError, IsomatchError, LandmarkError, MeshError, SettingError

Surface: TypeAlias = "isomatch.Mesh | isomatch.PointCloud"  # what surface files hold

# options that several commands have, by the types of their parameters
Output = Annotated[Path, Parameter(name=["--output", "-o"])]
OptionalOutput = Annotated[Path | None, Parameter(name=["--output", "-o"])]
Force = Annotated[bool, Parameter(alias="-f", help="Replace existing files.")]
Rounded = Annotated[
    bool,
    Parameter(
        help="Whether the format may move vertices by more than a thousandth of the mean edge. PLY is written with "
        "floats of 32 bits, for programs that read no doubles."
    ),
]
Seed = Annotated[int, Parameter(help="Seed of random choices.")]
Json = Annotated[
    bool,
    Parameter(alias="-j", help="Print JSON and nothing else: an object, of several files a list of them."),
]
Quiet = Annotated[bool, Parameter(alias="-q", help="Print only warnings and errors.")]
Details = Annotated[
    bool, Parameter(help="Print every measure too, with its bound, and the seconds of each stage.")
]
ConfigFile = Annotated[
    Path | None,
    Parameter(help="TOML file with settings of the match, see isomatch.Config; options take precedence."),
]
Weld = Annotated[
    bool,
    Parameter(
        negative="--no-weld",
        help="Take vertices at exactly the same position, as along texture seams, for one point.",
    ),
]


def surface_of(mesh: isomatch.Mesh) -> Surface:
    """Take the vertices of a mesh without faces as a point cloud."""
    return mesh if mesh.n_faces else isomatch.PointCloud(mesh.vertices)


def read_surface(path: Path) -> Surface:
    """Read a mesh, or points without faces as a point cloud."""
    mesh = isomatch.read_mesh(path)
    try:
        return surface_of(mesh)
    except MeshError as error:
        raise MeshError(f"{path}: has no faces, and its {error}") from None


@contextmanager
def naming_files(**files: Path) -> Iterator[None]:
    """Add the file name to ``source:``, or another role, in the messages of errors."""
    try:
        yield
    except IsomatchError as error:
        role = rf"(^|; )({'|'.join(files)}): "
        message = re.sub(role, lambda found: f"{found[1]}{found[2]} {files[found[2]]}: ", str(error))
        raise type(error)(message) from error


def read_functions(path: Path, names: list[str], n: int) -> FloatArray:
    """Read values (n, q) of scalars and colours of the points of a file, by their names."""
    asset = isomatch.read_asset(path)
    columns = []
    for name in names:
        attribute = asset.attribute(name, "point")
        if attribute.kind not in ("scalar", "colour"):
            raise FormatError(
                f"{path}: {name!r} is a {attribute.kind}; --function takes scalars and colours of points"
            )
        values = attribute.fractions[:, :3] if attribute.kind == "colour" else attribute.plain
        columns.append(values.astype(np.float64).reshape(len(values), -1))
    values = np.hstack(columns)
    if len(values) != n:
        raise FormatError(f"{path}: {len(values)} points have values, but the surface has {n} vertices")
    return values


def read_landmarks(path: Path | None, of_target: Path | None, ends: tuple[Path, Path]) -> IntArray | None:
    """Read pairs (q, 2) of vertices, from one file or from one of each shape; None if there is none."""
    if path is None and of_target is not None:
        raise LandmarkError("--target-landmarks needs --landmarks with the points of the source")
    return None if path is None else isomatch.read_landmarks(path, *ends, of_target)


def read_initial_map(path: Path | None, target: Surface) -> isomatch.Correspondence | None:
    """Read a map to start from; None if there is no file."""
    return None if path is None else isomatch.Correspondence.load(path, target.n_vertices)


def read_config(path: Path | None) -> isomatch.Config | None:
    """Read settings from a TOML file; None if there is no file."""
    if path is None:
        return None
    try:
        return isomatch.Config.from_file(path)
    except SettingError as error:
        raise FormatError(f"{error}; see the documentation of isomatch.Config") from None


def split_words(text: str | None, option: str) -> list[str]:
    """Split words of an option that are separated by commas: none of None, at least one of a text."""
    words = [*filter(None, map(str.strip, (text or "").split(",")))]
    if text is not None and not words:
        raise SettingError(f"{option} {text!r} names nothing; give words between commas, or leave it out")
    return words


def read_outcomes(names: str | None) -> tuple[isomatch.Outcome, ...]:
    """Read a list of outcomes, such as "low-confidence,ambiguous", where one word of a name will do."""
    by_name = {outcome.value.replace(" ", "-"): outcome for outcome in isomatch.Outcome}
    outcomes = []
    for word in split_words(names, "--fail-on"):
        named = [outcome for name, outcome in by_name.items() if word in (name, *name.split("-"))]
        if not named:
            raise SettingError(f"--fail-on {word!r} is not an outcome; known are {', '.join(by_name)}")
        outcomes += named
    return tuple(outcomes)
