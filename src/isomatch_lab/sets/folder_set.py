"""A set of one's own: a folder of shapes in any format, with truth beside them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from isomatch._core.arrays import IntArray
from isomatch._core.errors import FormatError, IsomatchError, MissingFileError, SettingError
from isomatch._core.texts import read_toml
from isomatch.correspondence import IndexBase
from isomatch.evaluation import Truth, read_indices, read_marked, read_truth
from isomatch.io import FORMATS
from isomatch.landmarks import read_landmarks
from isomatch.surfaces import Mesh
from isomatch_lab.sets.pair_list import FILES, PairList
from isomatch_lab.sets.shape_files import read_shape, shapes_in
from isomatch_lab.sets.shape_set import BenchmarkPair
from isomatch_lab.sets.stored_set import SHAPES, TRUTH, StoredSet, stored_set

SETTINGS = "set.toml"  # file with the settings of a folder
MAX_SETTINGS_BYTES = 2**20  # largest such file; it may list a folder for each of thousands of shapes (chosen)
KINDS = ("vertices", "vts", "pairs", "onto", "landmarks")  # kinds of files of truth, see `own_set`
SHAPE_FOLDERS = ("shapes", "off", "models")  # the first is ours, published sets use the others
TRUTH_FOLDERS = ("truth", "corres", "maps")  # the first that exists; published sets use the last two
SHAPE_SUFFIXES = {*FORMATS, ".mat", ".npz", ".vert"}  # suffixes of files of shapes
NAME_SEPARATORS = ("__", "-", "_")  # separate the names of a pair in a file name
MAX_KEPT_SHAPES = 100  # number of shapes in memory while files of truth are searched; chosen
MIRRORED_ENDINGS = (".sym", "_sym")  # endings of names of files with the mirrored truth
ONTO_SUFFIXES = {".vts", ".baryc_gt", ".baryc_gt_sym"}  # suffixes of published files that count from 1
LANDMARKS = "landmarks"  # kind of truth that is a file of landmarks for each shape
TRUTH_SUFFIXES: dict[str, set[str]] = {
    "vertices": set(),
    "vts": {".vts"},
    "pairs": {".txt", ".npy", ".npz", ".mat", ".map"},
    "onto": {".txt", *ONTO_SUFFIXES},
}
_WRITE_KIND = f"say which in {SETTINGS}: truth = " + " or ".join(f'"{kind}"' for kind in KINDS)


@dataclass(frozen=True)
class FolderSettings:
    """What ``set.toml`` says of a folder.

    Parameters
    ----------
    truth : {"vertices", "vts", "pairs", "onto", "landmarks"}, optional
        Where the truth is, see `own_set`; by default found by what is in the folder.
    counts_from : {0, 1}, optional
        What files of truth count from; by default from 1 where a file of the set shows that it does, and from 0 where one
        does.
    symmetric : bool
        Whether a mirrored truth is as good as the direct one.
    target : str, optional
        Target of all pairs, where no pairs are listed.
    shapes : tuple of str
        Folders of the shapes; by default ``shapes``, or else the folder itself.
    """

    truth: str | None = None
    counts_from: int | None = None
    symmetric: bool = False
    target: str | None = None
    shapes: tuple[str, ...] = ()

    @classmethod
    def read(cls, root: Path) -> FolderSettings:
        """Read the settings of a folder; the defaults if it has none."""
        path = root / SETTINGS
        if not path.is_file():
            return cls()
        values = read_toml(path, MAX_SETTINGS_BYTES)
        kinds: dict[str, Any] = {
            "truth": str, "counts_from": int, "symmetric": bool, "target": str, "shapes": (str, list),
        }  # fmt: skip
        for name, value in values.items():
            if name not in kinds:
                raise FormatError(f"{path}: unknown setting {name!r}; known are {', '.join(kinds)}")
            if not isinstance(value, kinds[name]) or (name == "counts_from" and value not in (0, 1)):
                raise FormatError(f"{path}: {name} = {value!r} is no value of this setting")
        folders = values.pop("shapes", ())
        folders = (folders,) if isinstance(folders, str) else tuple(map(str, folders))
        if values.get("truth") not in (None, *KINDS):
            raise FormatError(f"{path}: truth = {values['truth']!r} is not known; {_WRITE_KIND}")
        return cls(**values, shapes=folders)


@dataclass(frozen=True, eq=False)
class FolderSet:
    """A folder of shapes with truth, see `own_set`.

    Parameters
    ----------
    root : Path
        The folder.
    shapes : mapping of str to Path
        File of each shape.
    truths : mapping of str to Path
        Files of truth, or of landmarks, by their names without suffix.
    settings : FolderSettings
        What ``set.toml`` says, with the kind of truth.
    listed : PairList
        Its pairs.
    """

    root: Path
    shapes: Mapping[str, Path] = field(repr=False)
    truths: Mapping[str, Path] = field(repr=False)
    settings: FolderSettings
    listed: PairList = field(repr=False)

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Names of the pairs."""
        return self.listed.pairs

    @property
    def files(self) -> tuple[Path, ...]:
        """Its files."""
        others = (self.root / name for name in (SETTINGS, *FILES))
        every = (*self.shapes.values(), *self.truths.values(), *others)
        return tuple(dict.fromkeys(path for path in every if path.is_file()))

    def mesh(self, name: str) -> Mesh:
        """Read a shape; `FormatError` if it has no triangles."""
        mesh = read_shape(self.shapes[name], name)
        if not mesh.n_faces:
            raise FormatError(f"{self.shapes[name]}: has no triangles, so that distances on it are unknown")
        return mesh

    def pair(self, source: str, target: str) -> BenchmarkPair:
        """Read two shapes and the truth between them, in the order of the files.

        Raises
        ------
        MissingFileError
            If a file is missing.
        FormatError
            If a file cannot be read, or the truth does not fit the shapes.
        """
        meshes = self.mesh(source), self.mesh(target)
        truth, mirrored = self._known(source, target, meshes)
        for side, column, mesh in zip((source, target), truth.rows.T, meshes):
            if column.min() < 0 or column.max() >= mesh.n_vertices:
                raise FormatError(
                    f"{self.root}: the truth of {source} and {target} names vertices {column.min()}…{column.max()} of "
                    f"{side}, which has 0…{mesh.n_vertices - 1}; take shapes and truth from one source"
                )
        return BenchmarkPair(
            f"{source}-{target}", *meshes, truth.rows, mirrored, self.settings.symmetric,
            alone=truth.alone, points=truth.points, group=self.listed.group(source, target),
            notes=(truth.base.note,) if truth.base.note else (),
        )  # fmt: skip

    def _known(self, source: str, target: str, meshes: tuple[Mesh, Mesh]) -> tuple[Truth, IntArray | None]:
        """Read the truth of a pair, and rows of the mirrored truth if there is one."""
        kind = self.settings.truth
        if kind == "vertices":
            return _of_rows(self._equal_vertices(source, target, *meshes)), None
        if kind == "vts":
            rows = np.column_stack(self._marks(source, target, meshes, ""))
            for ending in MIRRORED_ENDINGS:
                if target + ending in self.truths:
                    images = self._marks(source, target, meshes, ending)[1]
                    return _of_rows(rows), np.column_stack([rows[:, 0], images])
            return _of_rows(rows), None
        if kind == LANDMARKS:
            files = self._file(source), self._file(target)
            if all(file.suffix == ".mat" for file in files):
                return read_marked(*files, meshes[1]), None
            return _of_rows(read_landmarks(files[0], *meshes, files[1])), None
        path, other = self._truth_of(source, target), self._mirrored_of(source, target)
        truth = self._truth(path, *meshes)
        if other is None:
            return truth, None
        flipped = self._truth(other, *meshes)
        if not np.array_equal(flipped.rows[:, 0], truth.rows[:, 0]):
            raise FormatError(f"{other}: tells of other source vertices than {path}; give the same")
        return truth, flipped.rows

    def _truth(self, path: Path, source: Mesh, target: Mesh) -> Truth:
        """Read a file of truth; what it counts from is decided by the settings, by itself, or by other files."""
        if path.suffix in ONTO_SUFFIXES:
            return read_truth(path, source, target, 1)
        truth = read_truth(path, source, target, self.settings.counts_from)
        if truth.base.is_certain or self.settings.counts_from is not None:
            return truth
        first = self._shown_to_count_from
        if truth.base.is_likely and first in (None, truth.base.counts_from):
            return truth
        if first is None:
            raise FormatError(
                f"{path}: can count from 0 or from 1, and so can all files of truth of this set; write counts_from = 0 "
                f"or counts_from = 1 into {self.root / SETTINGS}"
            )
        note = f"{path.name}: counts from {first}, as other files of truth of its set do"
        return read_truth(path, source, target, first)._replace(base=IndexBase(first, note=note))

    @cached_property
    def _shown_to_count_from(self) -> int | None:
        """What the first file of truth counts from that allows one reading only; None if there is none."""
        mesh = lru_cache(maxsize=MAX_KEPT_SHAPES)(self.mesh)
        for source, target in self.pairs:
            try:
                path = self._truth_of(source, target)
                if path.suffix in ONTO_SUFFIXES:
                    continue
                truth = read_truth(path, mesh(source), mesh(target))
            except IsomatchError:  # the error is reported with its own pair
                continue
            if truth.base.is_certain:
                return truth.base.counts_from
        return None

    def _equal_vertices(self, source: str, target: str, a: Mesh, b: Mesh) -> IntArray:
        """Rows (i, i); both meshes must share one triangulation."""
        if a.n_vertices != b.n_vertices or a.n_faces != b.n_faces or (_sides(a) != _sides(b)).any():
            raise FormatError(
                f"{self.root / SETTINGS}: says that equal vertices correspond, but {source} with {a.n_vertices} vertices "
                f"and {a.n_faces} faces and {target} with {b.n_vertices} and {b.n_faces} have other triangles; list "
                "pairs that share theirs, or give another truth"
            )
        return np.column_stack([np.arange(a.n_vertices)] * 2)

    def _marks(self, source: str, target: str, meshes: tuple[Mesh, Mesh], ending: str) -> list[IntArray]:
        """Vertices on equal lines of two files, counted from 1; of the target, of the file with an ending."""
        paths = [self._file(source), self._file(target + ending)]
        marks = [read_indices(path) for path in paths]
        for path, vertices, mesh in zip(paths, marks, meshes):
            if vertices.max(initial=-1) >= mesh.n_vertices:
                raise FormatError(
                    f"{path}: names vertex {vertices.max() + 1}, counted from 1, but the shape has {mesh.n_vertices}; "
                    "take shape and file from one source"
                )
        if len(marks[0]) != len(marks[1]):
            raise FormatError(
                f"{paths[0]}: {len(marks[0])} lines, but {paths[1]} has {len(marks[1])}; give files whose lines "
                "correspond"
            )
        return marks

    def _file(self, name: str) -> Path:
        if name not in self.truths:
            what = "landmarks" if self.settings.truth == LANDMARKS else f"{name}.vts"
            raise MissingFileError(f"{self.root}: there is no file {what} with the truth of {name}")
        return self.truths[name]

    def _stems(self, source: str, target: str) -> list[str]:
        """Names that the file of a pair may have."""
        return (
            [source]
            if self.settings.truth == "onto"
            else [f"{source}{sep}{target}" for sep in NAME_SEPARATORS]
        )

    def _truth_of(self, source: str, target: str) -> Path:
        stems = self._stems(source, target)
        truths = [self.truths[stem] for stem in stems if stem in self.truths]
        if not truths:
            raise MissingFileError(
                f"{self.root}: no truth of {source} and {target}; expected {TRUTH_FOLDERS[0]}/{stems[0]}.txt"
            )
        return truths[0]

    def _mirrored_of(self, source: str, target: str) -> Path | None:
        names = (stem + ending for stem in self._stems(source, target) for ending in MIRRORED_ENDINGS)
        return next((self.truths[name] for name in names if name in self.truths), None)


def _of_rows(rows: IntArray) -> Truth:
    """Take rows of vertices as a truth that tells of these alone."""
    return Truth(rows, None, None, IndexBase(0))


def own_set(root: str | Path) -> FolderSet | StoredSet:
    """Open a folder of shapes with truth.

    Parameters
    ----------
    root : path_like
        Either two archives, ``shapes.npz`` and ``truth.npz``; or shapes in any format that `isomatch.read_mesh` reads, in
        ``shapes`` or in the folder itself, and their truth. ``pairs.txt`` lists a source and a target on each line,
        after the name of their group if there are groups; without it, all ordered pairs that have a truth are run.
        ``set.toml`` holds settings, see `FolderSettings`.

    Returns
    -------
    FolderSet or StoredSet
        The set; its shapes are read when they are asked for.

    Raises
    ------
    MissingFileError
        If there are no shapes or no truth.
    FormatError
        If the layout is ambiguous, or a list or setting cannot be read.

    Notes
    -----
    Kinds of truth:

    - ``vertices``: all shapes have one triangulation, and equal vertices correspond. This has to be said in ``set.toml``.
    - ``vts``: ``NAME.vts`` for each shape, one vertex a line counted from 1; equal lines correspond. ``NAME.sym.vts`` has
      the mirror images.
    - ``pairs``: ``truth/SOURCE__TARGET.txt`` for each pair, also ``.npy``, ``.npz`` and ``.mat``, see `read_truth`;
      ``SOURCE__TARGET.sym.txt`` has the mirrored truth.
    - ``onto``: ``NAME.vts`` or ``NAME.baryc_gt`` of a source leads to its target, whatever that is: the vertex, or the
      triangle and three weights, of each source vertex, counted from 1.
    - ``landmarks``: ``landmarks/NAME.mrk.json``, or another format that `isomatch.read_landmarks` reads, or ``.mat``
      as in SHREC'20.

    An archive ``shapes.npz`` has arrays NAME (n, 3) and NAME_faces (f, 3) for each shape; ``truth.npz`` has, for each
    pair, "SOURCE|TARGET" (m, 2) of a source vertex and a target vertex, −1 if it has no counterpart, and optionally
    "SOURCE|TARGET|mirror" (m,), the mirrored target vertices of these rows, and "SOURCE|TARGET|scale", by which errors
    are divided instead of √(target area).
    """
    root = Path(root)
    if not root.is_dir():
        raise MissingFileError(f"{root}: no such folder; check the name")
    settings = FolderSettings.read(root)
    if (root / SHAPES).is_file() and (root / TRUTH).is_file():
        return stored_set(root, settings.symmetric)
    folders = [root / name for name in settings.shapes]
    missing = [folder for folder in folders if not folder.is_dir()]
    if missing:
        raise MissingFileError(f"{root / SETTINGS}: there is no folder {missing[0]} of shapes")
    folders = folders or [root / name for name in SHAPE_FOLDERS if (root / name).is_dir()][:1] or [root]
    shapes: dict[str, Path] = {}
    for path in sorted(path for folder in folders for path in folder.iterdir()):
        if path.suffix.lower() not in SHAPE_SUFFIXES or not path.is_file():
            continue
        for name in shapes_in(path):
            if name in shapes:
                raise FormatError(f"{name} is both in {shapes[name]} and in {path}; keep one of them")
            shapes[name] = path
    if not shapes:
        raise MissingFileError(
            f"{root}: no shapes in this folder or its folder {SHAPE_FOLDERS[0]}; docs/how_to/own_benchmark.md describes "
            "what a set consists of"
        )
    beside = [*folders, root, *[root / name for name in TRUTH_FOLDERS if (root / name).is_dir()][:1]]
    kind = settings.truth or _kind_in(root, beside)
    settings = replace(settings, truth=kind)
    truths = _truth_files(root, kind, beside, set(shapes.values()))
    listed = PairList.read(root, shapes)
    opened = FolderSet(root, shapes, truths, settings, listed or PairList(()))
    return opened if listed else replace(opened, listed=PairList(_pairs_with_truth(opened)))


def _kind_in(root: Path, beside: list[Path]) -> str:
    """Kind of truth that the files of a folder show, if they show one."""
    kinds = []
    if any(path.suffix == ".vts" for folder in beside for path in folder.iterdir()):
        kinds.append("vts")
    if any(path.suffix == ".baryc_gt" for folder in beside for path in folder.iterdir()):
        kinds.append("onto")
    if beside[-1] in (root / "truth", root / "maps") and not kinds:
        kinds.append("pairs")
    if (root / LANDMARKS).is_dir():
        kinds.append(LANDMARKS)
    if len(kinds) != 1:
        raise MissingFileError(
            f"{root}: "
            + (f"several kinds of truth, {', '.join(kinds)}" if kinds else "no truth beside the shapes")
            + f"; {_WRITE_KIND}; vertices means that all shapes share one triangulation and equal vertices correspond"
        )
    return kinds[0]


def _truth_files(root: Path, kind: str, beside: list[Path], shapes: set[Path]) -> dict[str, Path]:
    """Files of truth by their names without suffix, and with the ending of mirrored ones."""
    folders = [root / LANDMARKS] if kind == LANDMARKS else list(dict.fromkeys(beside))
    truths: dict[str, Path] = {}
    for path in sorted(path for folder in folders if folder.is_dir() for path in folder.iterdir()):
        if not path.is_file() or path in shapes or path.name in FILES:
            continue
        if kind != LANDMARKS and path.suffix not in TRUTH_SUFFIXES[kind]:
            continue
        name = path.name.removesuffix(path.suffix)
        if path.suffix == ".baryc_gt_sym":
            name += MIRRORED_ENDINGS[0]
        if kind == LANDMARKS:
            name = name.removesuffix(".mrk")
        if kind == "onto":
            name = name.removesuffix("_ref")  # as TOPKIDS names them
        if name in truths:
            raise FormatError(f"{name} is both in {truths[name]} and in {path}; keep one of them")
        truths[name] = path
    return truths


def _pairs_with_truth(opened: FolderSet) -> tuple[tuple[str, str], ...]:
    """All ordered pairs of shapes that have a truth."""
    names, truths, kind = list(opened.shapes), opened.truths, opened.settings.truth
    targets = names if opened.settings.target is None else [opened.settings.target]
    if any(name not in opened.shapes for name in targets):
        raise MissingFileError(f"{opened.root / SETTINGS}: there is no shape {targets[0]!r}, the target")
    every = [(a, b) for a in names for b in targets if a != b]
    if kind in ("vts", LANDMARKS):
        every = [(a, b) for a, b in every if a in truths and b in truths]
    elif kind == "pairs":
        every = [(a, b) for a, b in every if any(f"{a}{sep}{b}" in truths for sep in NAME_SEPARATORS)]
    elif kind == "onto":
        if opened.settings.target is None:
            raise SettingError(
                f"{opened.root}: files of truth are named by their source alone; list the pairs in {FILES[0]}, or write "
                f'target = "NAME" into {SETTINGS}'
            )
        every = [(a, b) for a, b in every if a in truths]
    if not every:
        raise MissingFileError(
            f"{opened.root}: no two shapes have a truth of kind {kind!r}; docs/how_to/own_benchmark.md describes its "
            "files"
        )
    return tuple(every)


def _sides(mesh: Mesh) -> IntArray:
    """Triangles of a mesh in an order that does not depend on how they are written."""
    corners = np.sort(mesh.faces, axis=1)
    return corners[np.lexsort(corners.T)]
