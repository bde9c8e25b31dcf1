"""Published sets of shapes with known correspondence, opened from the user's folders."""

from __future__ import annotations

import re
from pathlib import Path

from isomatch._core.errors import FormatError, MissingFileError
from isomatch._core.texts import text_lines
from isomatch_lab.sets.shape_files import SUFFIXES, shapes_in
from isomatch_lab.sets.shape_set import ShapeSet

OBTAIN = {  # where to obtain each set, in messages
    "tosca": "TOSCA, the high-resolution shapes of the project Numerical Geometry of Non-Rigid Shapes (Bronstein, "
    "Bronstein & Kimmel)",
    "scape": "SCAPE, from its authors at Stanford (Anguelov et al., SIGGRAPH 2005)",
    "faust": "MPI FAUST, after registration with the Max Planck Institute for Intelligent Systems (Bogo et al., CVPR "
    "2014); the set consists of its training registrations",
    "remeshed": "the remeshed sets, with the code of Ren et al., Continuous and Orientation-preserving Correspondences "
    "via Functional Maps, SIGGRAPH Asia 2018",
}


def tosca(root: str | Path) -> ShapeSet:
    """Open the shapes of TOSCA: ``cat0.mat``, ``cat0.vert`` and ``cat0.tri``, or any mesh files of those names.

    Parameters
    ----------
    root : path_like
        Folder of the shapes, at any depth. Poses of a class share their triangulation. A file ``cat.sym.vts`` with the
        mirror image of each vertex, counted from 1, adds mirrored truth.

    Returns
    -------
    ShapeSet
        The set; its shapes are read when they are asked for.

    Raises
    ------
    MissingFileError
        If there are no such shapes; the message says where to obtain them.
    FormatError
        If a shape is in two files.

    References
    ----------
    Bronstein, Bronstein & Kimmel, *Numerical Geometry of Non-Rigid Shapes*, Springer 2008.
    """
    return _open("tosca", root, r"[a-z]+\d+", shared=True)


def scape(root: str | Path) -> ShapeSet:
    """Open the registered shapes of SCAPE, ``mesh000`` onwards; otherwise as `tosca`.

    References
    ----------
    Anguelov et al., *SCAPE: Shape Completion and Animation of People*, SIGGRAPH 2005.
    """
    return _open("scape", root, r"mesh\d+", shared=True)


def faust(root: str | Path) -> ShapeSet:
    """Open the training registrations of FAUST, ``tr_reg_000`` onwards; otherwise as `tosca`. Scans are ignored.

    References
    ----------
    Bogo, Romero, Loper & Black, *FAUST: Dataset and Evaluation for 3D Mesh Registration*, CVPR 2014.
    """
    return _open("faust", root, r"tr_reg_\d+", shared=True)


def remeshed(root: str | Path) -> ShapeSet:
    """Open shapes that were remeshed independently, with corresponding vertices in ``.vts`` files.

    Parameters
    ----------
    root : path_like
        Holds, at any depth, the shapes and for each a file ``<shape>.vts`` with one vertex a line, counted from 1; line
        k of one shape corresponds to line k of the other. ``<shape>.sym.vts`` has their mirror images, if known.
        Alternatively ``<source>_<target>.map`` has the target vertex of each source vertex, counted from 1.
        ``test_pairs.txt`` lists the pairs to match, one a line.

    Returns
    -------
    ShapeSet
        The set; its shapes are read when they are asked for.

    Raises
    ------
    MissingFileError
        If there are no shapes; the message says where to obtain them.
    FormatError
        If a shape is in two files.

    References
    ----------
    Ren, Poulenard, Wonka & Ovsjanikov, *Continuous and Orientation-preserving Correspondences via Functional Maps*,
    SIGGRAPH Asia 2018.
    """
    return _open("remeshed", root, r".+", shared=False)


def _open(name: str, root: str | Path, pattern: str, shared: bool) -> ShapeSet:
    root = Path(root)
    shapes: dict[str, Path] = {}
    truths: dict[str, Path] = {}
    for path in sorted(root.rglob("*"), key=_natural):
        if path.suffix in (".vts", ".map"):
            truths[path.name.removesuffix(path.suffix)] = path
        if path.suffix not in SUFFIXES:
            continue
        for shape in filter(re.compile(pattern).fullmatch, shapes_in(path)):
            if shape in shapes:
                message = f"{shape} is both in {shapes[shape]} and in {path}; give a folder with one of them"
                raise FormatError(message)
            shapes[shape] = path
    if not shapes:
        raise MissingFileError(f"{root}: no shapes of the set {name!r} in this folder; obtain {OBTAIN[name]}")
    return ShapeSet(name, shapes, truths, shared, _read_pairs(root / "test_pairs.txt"))


def _read_pairs(path: Path) -> tuple[tuple[str, str], ...]:
    """Pairs of names in a text file, if there is one."""
    rows = [line.replace(",", " ").split() for _, line in text_lines(path)] if path.exists() else []
    return tuple((row[0], row[1]) for row in rows if len(row) > 1)


def _natural(path: Path) -> list[tuple[int, str]]:
    """Sort key in which cat2 comes before cat10."""
    return [(int(part or 0), "") if part.isdigit() else (0, part) for part in re.split(r"(\d+)", str(path))]
