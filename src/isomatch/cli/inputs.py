"""The inputs of commands: what a file of points means; landmarks, an initial map, settings."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from isomatch import Config, Correspondence, IsomatchError, LandmarkError, Mesh, PointCloud
from isomatch._arrays import IntArray
from isomatch._files import opened
from isomatch.errors import FormatError, MissingFileError


def surface_of(mesh: Mesh) -> Mesh | PointCloud:
    """Take the vertices of a mesh without faces as a point cloud."""
    return mesh if mesh.n_faces else PointCloud(mesh.vertices)


@contextmanager
def naming_files(**files: Path) -> Iterator[None]:
    """Name the file of each role, such as ``source``, in errors whose message speaks of ``source:``."""
    try:
        yield
    except IsomatchError as error:
        message = re.sub(
            rf"(^|; )({'|'.join(files)}): ", lambda at: f"{at[1]}{at[2]} {files[at[2]]}: ", str(error)
        )
        raise type(error)(message) from error


def read_landmarks(path: Path) -> IntArray:
    """Read pairs of 0-based vertex indices (source, target); see `read_pairs`."""
    pairs = read_pairs(path, "a landmark", "of the source and of the target")
    if not len(pairs):
        raise LandmarkError(f"{path}: no landmarks; write one pair of 0-based vertex indices on each line")
    return pairs


def read_pairs(path: Path, what: str, whose: str) -> IntArray:
    """Read pairs of 0-based vertex indices.

    Each line has one pair, separated by a comma or blanks; ``#`` starts a comment. ``what`` a pair is and ``whose``
    vertices it names is for the message.
    """
    pairs = []
    with opened(path) as file:
        lines = file.read().decode("utf-8-sig", errors="replace").splitlines()
    for number, line in enumerate(lines, start=1):
        words = line.split("#")[0].replace(",", " ").split()
        if not words:
            continue
        try:
            source, target = (int(word) for word in words)
        except ValueError:
            raise FormatError(
                f"{path}:{number}: {' '.join(words)!r} is not {what}; write two 0-based vertex indices, {whose}"
            ) from None
        pairs.append((source, target))
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def read_initial_map(path: Path, n_target: int) -> IntArray:
    """Read the target vertex of each source vertex from text or ``.npz``; −1 if unknown."""
    return Correspondence.load(path, n_target).vertices


def read_config(path: Path | None) -> Config | None:
    """Read settings from a TOML file; None if there is no file."""
    if path is None:
        return None
    try:
        return Config.from_file(path)
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file; check the name and the folder") from None
    except (ValueError, TypeError) as error:
        message = str(error)
        where = "" if message.startswith(str(path)) else f"{path}: "
        raise FormatError(f"{where}{message}; see the documentation of isomatch.Config") from None
