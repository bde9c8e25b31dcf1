"""Write the files of a match, and print a summary."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import isomatch
from isomatch import view
from isomatch.assets import Attribute, Frame
from isomatch.cli.terminal import INDENT, json_text, say, say_rows, say_table
from isomatch.storage.files import claimed, made_folder, staged, write_text
from isomatch.values.arrays import FloatArray

RESULT = "result.json"
BACK = "map_back.npz"
MESH_LEFT = (
    "{} is of the map before and was left; in Python, MatchResult.as_mesh gives the surface by this one"
)
BACK_REMOVED = "the map back belonged to the map before and was removed"

Back = tuple["isomatch.Correspondence", dict[str, Any]]
"""Map of the other direction, and its values in ``result.json``."""


@dataclass(frozen=True)
class ResultFolder:
    """The folder for the files of one match.

    Parameters
    ----------
    folder : Path
        Its path; it is created if it does not exist.
    picture : str
        File name of the picture.
    report : bool
        Whether there is a report.
    both : bool
        Whether there is a map of the other direction.
    """

    folder: Path
    picture: str = "map.png"
    report: bool = True
    both: bool = False

    @property
    def files(self) -> dict[str, str]:
        """Path of each file, by its kind."""
        names = {
            "map": "map.npz",
            "text": "map.txt",
            "result": RESULT,
            "picture": self.picture,
        }
        if self.report:
            names["report"] = "report.html"
        if self.both:
            names["map back"] = BACK
        return {what: str(self.folder / name) for what, name in names.items()}

    @property
    def result(self) -> Path:
        """Path of ``result.json``."""
        return self.folder / RESULT

    def alternative(self, number: int) -> Path:
        """Path of the map of an alternative, from 1."""
        return self.folder / f"alternative_{number}.npz"

    @property
    def has_back(self) -> bool:
        """Whether a map of the other direction is there."""
        return (self.folder / BACK).exists()

    @contextmanager
    def claimed(self, force: bool) -> Iterator[None]:
        """Create the folder and claim its files (`storage.files.claimed`); an earlier result has to be forced."""
        new = [] if force else [*map(Path, self.files.values()), *self._alternatives]
        with made_folder(self.folder), claimed(self.result, new):
            yield

    @property
    def _picker(self) -> str:
        return str(self.folder / "picker.html")

    @property
    def _alternatives(self) -> list[Path]:
        return [self.alternative(number) for number in range(1, view.MOST_ALTERNATIVES + 1)]

    def write(
        self,
        source: isomatch.Mesh,
        target: isomatch.Mesh,
        result: isomatch.MatchResult,
        *,
        names: tuple[str, str],
        titles: tuple[str, str],
        facts: dict[str, Any],
        more: dict[str, Any],
        back: Back | None = None,
        **shown: Any,
    ) -> dict[str, Any]:
        """Write all files, and let them replace earlier ones at once when they are complete, ``result.json`` last.

        The picture has ``titles`` below the shapes, the report ``facts`` about the run and what else is ``shown``, see
        `isomatch.view.write_report`; what cannot be drawn is left out, and named under ``undrawn``. Returns the contents
        of ``result.json``, which begin with ``more``.
        """
        own = replace(self, both=back is not None)
        others = dict(zip(self._alternatives, result.alternatives))
        record: dict[str, Any] = {"isomatch": isomatch.__version__, **more, **_described(result)}
        if back:
            record["back"] = back[1]
        facts = {"isomatch": isomatch.__version__, **facts}
        with staged(self.folder, last=RESULT) as folder:
            files = {what: str(folder / Path(path).name) for what, path in own.files.items()}
            replace(result, alternatives=()).save(files["map"])
            result.map.save(files["text"])
            for path, other in others.items():
                other.map.save(folder / path.name)
            picture = files["picture"]
            undrawn: list[str] = []
            with _noted("picture", undrawn):
                view.draw_map(source, target, result.map, picture, titles=titles)
            if self.report:
                shown["picture"] = picture if not undrawn else ""
                with _noted("report", undrawn):
                    view.write_report(
                        files["report"], source, target, result, names=names, facts=facts, **shown
                    )
            if back:
                back[0].save(files["map back"])
            written = own.files | {path.stem: str(path) for path in others}
            record["undrawn"] = undrawn
            record["files"] = {
                what: path
                for what, path in written.items()
                if path == str(self.result) or (folder / Path(path).name).exists()
            }
            write_text(folder / RESULT, json_text(record))
        every = ResultFolder(self.folder, self.picture, report=True, both=True).files.values()
        for name in (*every, *map(str, self._alternatives), self._picker):
            if name not in record["files"].values():
                Path(name).unlink(missing_ok=True)
        return record

    def write_picker(
        self, source: isomatch.Mesh, target: isomatch.Mesh, error: isomatch.IsomatchError, **shown: Any
    ) -> isomatch.IsomatchError:
        """Write a page for landmarks beside any earlier result; return the error that no map was found, with its name."""
        if not self.report:
            return error
        undrawn: list[str] = []
        with _noted("page to pick landmarks", undrawn):
            view.write_landmark_picker(self._picker, source, target, str(error), **shown)
        if undrawn:
            return error
        return type(error)(f"{error}. Both shapes are in {self._picker}, where you can pick landmarks")


@contextmanager
def _noted(what: str, undrawn: list[str]) -> Iterator[None]:
    """Note a drawing that fails, so that the map is not lost with it; a full disk is an error."""
    try:
        yield
    except OSError:
        raise
    except Exception as error:
        reason = (str(error) or type(error).__name__).partition("\n")[0]
        undrawn.append(f"there is no {what}: {reason}")


def _described(result: isomatch.MatchResult) -> dict[str, Any]:
    """Plain values of a result, with the bounds of its measures."""
    return {**result.to_dict(), "bounds": view.quality_bounds(result)}


def back_of(result: isomatch.MatchResult) -> Back:
    """Give what is written of the map of the other direction."""
    return result.map, _described(result)


@contextmanager
def claimed_files(*paths: Path | None, force: bool) -> Iterator[None]:
    """Claim single files, see `isomatch.storage.files.claimed`; those that exist have to be forced."""
    with ExitStack() as claims:
        for path in filter(None, paths):
            claims.enter_context(claimed(path, [] if force else [path]))
        yield


_STYLES = {"CONVERGED": "bold green", "LOW_CONFIDENCE": "bold red", "MIRROR_IMAGE": "bold red"}
MOST_NOTES = 2  # in a summary; the report has all


def say_result(result: isomatch.MatchResult, details: bool = False) -> None:
    """Print what came out in plain words; in detail, also every measure, the stages and all notes."""
    summary = view.summary_of(result)
    say(summary.headline, _STYLES.get(result.outcome.name, "bold yellow"))
    say_rows([("how sure", summary.sureness), ("what to do", summary.advice)])
    if details:
        _say_details(result)
    else:
        more = len(result.notes) - MOST_NOTES
        say_rows(("note", note) for note in result.notes[:MOST_NOTES])
        say_rows([("", f"{more} more {'note' if more == 1 else 'notes'}: --details")] if more > 0 else [])


def _say_details(result: isomatch.MatchResult) -> None:
    say("")
    say(f"{result.outcome.value}: {result.map!r}, from {result.origin}")
    for region in result.regions:
        say(f"doubtful: {region}")
    say_table(_quality_rows(result))
    for side, symmetry in zip(("source", "target"), result.symmetries):
        if symmetry:
            say(f"{side} maps onto itself: {symmetry}")
    one_by_one = {s: t for s, t in result.timings.items() if not s.startswith(("source: ", "target: "))}
    say_rows([("seconds", ", ".join(f"{stage} {seconds:.2f}" for stage, seconds in one_by_one.items()))])
    say_notes(result.notes)
    say("")


def write_wrapped(
    path: Path,
    asset: isomatch.Asset,
    frame: Frame | None,
    wrapped: isomatch.Wrapped,
    expected_error: FloatArray,
) -> dict[str, Any]:
    """Write the asset of the source in the shape of the target, and say how good it is.

    All that it carries is written too, shape keys turned with the surface, but no normals and tangents; the frame of the
    coordinates is that of the target. Where the format takes scalars, the expected error (n_source,) of each vertex is
    added, and whether it is extended.
    """
    moved = replace(asset.moved(wrapped.mesh.vertices[asset.point_of_vertex]), frame=frame)
    if asset.of_kind("key"):
        unmoved = isomatch.Correspondence(range(len(asset.points)), len(asset.points))
        moved = isomatch.carry_attributes(unmoved, moved, asset, "keys").asset
    turned = [
        attribute.name for attribute in moved.attributes if attribute.kind == "normal" or attribute.is_tangent
    ]
    errors = Attribute("expected_error", "point", "scalar", expected_error)
    extended = Attribute("extended", "point", "scalar", wrapped.extended.astype(float))
    own = (errors, extended)
    left = isomatch.write_asset(path, moved.without_attributes(*turned).with_attributes(*own))
    names = [attribute.name for attribute in left if all(attribute is not each for each in own)]
    return {"file": str(path), **asdict(wrapped.quality), "left_out": names}


def require_writable(path: Path) -> None:
    """Raise the error of a mesh file whose format is unknown, or needs a package that is not installed."""
    triangle = isomatch.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    with TemporaryDirectory() as folder:
        isomatch.write_mesh(Path(folder) / path.name, triangle)


def say_wrapped(record: dict[str, Any]) -> None:
    """Print where the target is in the source's topology, and how good it is."""
    extended = record["extended"]
    say(f"{'  as mesh':<{INDENT}}{record['file']}")
    lines = [
        f"the target with the faces of the source; {record['turned']:.2%} of them are turned over, almost no edge is "
        f"stretched by more than {record['stretch']:.2f} ×, vertices are {record['distance']:.2%} of the size (√area) "
        "off on average",
        f"materials: {', '.join(record['files_beside'])}" if record["files_beside"] else "",
        f"{extended} vertices have no counterpart and are placed by those around them" if extended else "",
    ]
    say_rows(("", line) for line in lines)
    say_left_out(record["left_out"], record["file"])
    say_notes(record["notes"])


def say_left_out(names: list[str], file: str | Path) -> None:
    """Print what the format of a file has no place for."""
    if names:
        say(f"a {Path(file).suffix} file has no place for {', '.join(names)}")


def notes_on(assets: Mapping[Path, isomatch.Asset]) -> list[str]:
    """Return what the readers of files left out or supposed."""
    return [f"{path}: {note}" for path, asset in assets.items() for note in asset.notes]


def say_notes(notes: Iterable[str]) -> None:
    """Print what is to be known of files or a result."""
    for note in notes:
        say(f"note: {note}")


def refuse_outcomes(result: isomatch.MatchResult, refused: tuple[isomatch.Outcome, ...], where: Path) -> None:
    """Raise an error if the outcome of a result is one that the user refuses."""
    if result.outcome in refused:
        raise isomatch.NotConvergedError(
            f"{result.outcome.value} ({result.map!r}); the files are in {where}. {result.outcome.advice}"
        )


def say_files(record: Mapping[str, Any]) -> None:
    """Print how long it took, which file to open first, what else was written, and what could not be drawn."""
    files = record["files"]
    first = next(files[kind] for kind in ("report", "picture", "map") if kind in files)
    names = {Path(file).name for file in files.values() if file != first}
    alternatives = {name for name in names if name.startswith("alternative_")}
    short = {"alternative_*.npz"} if len(alternatives) > 1 else alternatives
    sizes = f"{record['n_source']:,} → {record['n_target']:,} vertices"
    say_rows(("note", note) for note in record["undrawn"])
    say_rows([("took", f"{record['timings']['total']:.1f} s for the match, {sizes}")])
    say(f"{'  open first':<{INDENT}}{first}")  # whole, to be copied
    say_rows([("also there", ", ".join(sorted((names - alternatives) | short)))])


def _quality_rows(result: isomatch.MatchResult) -> list[tuple[str, ...]]:
    """Give the name, value, bound and unit of every measure of quality; a bound that is not held is marked by !."""
    return [
        (
            measure.name,
            measure.value(number),
            measure.bound.replace("at most", "≤").replace("at least", "≥") + (" !" if against else ""),
            measure.unit,
        )
        for measure, number, against in view.quality_measures(result)
    ]
