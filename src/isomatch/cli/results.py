"""The folder of a match: its files are written, listed, and read again by `choose` and `open`."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from json import loads
from math import nan
from os.path import normpath, relpath
from pathlib import Path
from typing import Any

import isomatch
from isomatch import matching, visualization
from isomatch._core.errors import FormatError, InputError, MissingFileError
from isomatch._core.files import claimed, made_folder, read_bytes, staged, write_text
from isomatch._core.texts import json_text
from isomatch.cli.inputs import Surface, read_surface
from isomatch.cli.outputs import say_notes
from isomatch.cli.terminal import INDENT, in_shell, say, say_rows, say_table, waited

# Names of files in the folder of a result: the result in plain values; the map of the other direction; a page
# to pick landmarks, written where no map was found.
RESULT, BACK, PICKER = "result.json", "map_back.npz", "picker.html"
# names of the files in the folder of a result, by what they hold
_FILES = {"map": "map.npz", "text": "map.txt", "result": RESULT, "picture": "map.png"}
_FILES |= {"report": "report.html", "map back": BACK}
# what is said when the chosen alternative makes the map of the other direction obsolete
BACK_REMOVED = "the map back belonged to the map before and was removed"

Back = tuple["isomatch.Correspondence", dict[str, Any]]
"""Map of the other direction, and its values in ``result.json``."""


def match_again(source: Path, target: Path, **options: Any) -> str:
    """Write the command that matches again with landmarks."""
    words = ["isomatch", "match", str(source), str(target)]
    for name, value in options.items():
        if value is not None and value is not False and (name, value) != ("seed", 0):
            option = f"--{name.replace('_', '-')}"
            for part in value if isinstance(value, list) else [value]:
                words += [option, *([] if part is True else [str(part)])]
    return shlex.join([*words, "--landmarks", "landmarks.txt", "--force"])


@dataclass(frozen=True)
class Inputs:
    """The inputs of a match, as its files record them."""

    source: Path
    target: Path
    again: str  # the command that matches again
    landmarks: Sequence[Sequence[int]] = ()  # pairs (source vertex, target vertex)
    facts: Mapping[str, object] = field(default_factory=dict)  # further rows of the table about the run
    initial_map: isomatch.Correspondence | None = None

    @property
    def names(self) -> tuple[str, str]:
        """Names of both files."""
        return self.source.name, self.target.name

    def shown(self, **first: object) -> dict[str, Any]:
        """Give the options of `visualization.write_report`; the facts begin with ``first``."""
        facts = {**first, "source": str(self.source), "target": str(self.target), **self.facts}
        marks = self.landmarks or None
        return {"names": self.names, "facts": facts, "landmarks": marks, "command": self.again}


@dataclass(frozen=True)
class ResultFolder:
    """The folder for the files of one match, perhaps with a report and a map of the other direction."""

    folder: Path
    report: bool = True
    both: bool = False

    @property
    def files(self) -> dict[str, str]:
        """Path of each file, by its kind."""
        wanted = {"report": self.report, "map back": self.both}
        return {kind: str(self.folder / name) for kind, name in _FILES.items() if wanted.get(kind, True)}

    @property
    def alternatives(self) -> list[Path]:
        """Paths of the maps of alternatives, as many as are kept."""
        numbers = range(1, visualization.MOST_ALTERNATIVES + 1)
        return [self.folder / f"alternative_{number}.npz" for number in numbers]

    @property
    def has_back(self) -> bool:
        """Whether a map of the other direction is there."""
        return (self.folder / BACK).exists()

    @contextmanager
    def claimed(self, force: bool) -> Iterator[None]:
        """Create the folder and claim its files (`_core.files.claimed`); an earlier result has to be forced."""
        new = [] if force else [*map(Path, self.files.values()), *self.alternatives]
        with made_folder(self.folder), claimed(self.folder / RESULT, new):
            yield

    def write(
        self,
        surfaces: tuple[Surface, Surface],
        result: isomatch.MatchResult,
        inputs: Inputs,
        *,
        titles: tuple[str, str] | None = None,
        more: Mapping[str, Any] | None = None,
        back: Back | None = None,
        meshes: Mapping[str, isomatch.Mesh] | None = None,
    ) -> dict[str, Any]:
        """Write all files, replace the earlier ones at the end; return what result.json has."""
        # The titles are below the shapes of the picture; drawings that fail are left out and named under
        # "undrawn"; meshes are written beside the map under their names.
        drawn = visualization.drawable(surfaces[0]), visualization.drawable(surfaces[1])
        this_folder = replace(self, both=back is not None)
        maps = {path.name: other.map for path, other in zip(self.alternatives, result.alternatives)}
        former = (*_FILES.values(), PICKER, *(path.name for path in self.alternatives))
        record: dict[str, Any] = {
            "isomatch": isomatch.__version__,
            "source": str(inputs.source),
            "target": str(inputs.target),
            "meshes": [_path_from(self.folder, path) for path in (inputs.source, inputs.target)],
            "match_again": inputs.again,
            "landmarks": [list(pair) for pair in inputs.landmarks],
            **(more or {}),
            **described(result),
        }
        if back:
            record["back"] = back[1]
        with staged(self.folder, last=RESULT, gone=former) as folder:
            files = replace(this_folder, folder=folder).files
            replace(result, alternatives=()).save(files["map"])
            result.map.save(files["text"])
            for name, mesh in (meshes or {}).items():
                isomatch.write_mesh(folder / name, mesh)
            for name, other in maps.items():
                other.save(folder / name)
            picture, undrawn = files["picture"], list[str]()
            with _note_failure("picture", undrawn):
                picture_titles = titles or (f"source: {inputs.names[0]}", f"target: {inputs.names[1]}")
                visualization.draw_map(*drawn, result.map, picture, titles=picture_titles)
            if self.report:
                report_options = inputs.shown(isomatch=isomatch.__version__) | {"given": inputs.initial_map}
                report_options |= {"picture": "" if undrawn else picture}
                with _note_failure("report", undrawn):
                    visualization.write_report(files["report"], *drawn, result, **report_options)
            if back:
                back[0].save(files["map back"])
            written = this_folder.files | {Path(name).stem: str(self.folder / name) for name in maps}
            file_names = {RESULT, *(path.name for path in folder.iterdir())}
            record["undrawn"] = undrawn
            record["files"] = {kind: path for kind, path in written.items() if Path(path).name in file_names}
            write_text(folder / RESULT, json_text(record))
        return record

    def write_picker(
        self, surfaces: tuple[Surface, Surface], error: isomatch.IsomatchError, inputs: Inputs
    ) -> isomatch.IsomatchError:
        """Write a page to pick landmarks; return the error with the page's name added."""
        undrawn, picker = list[str](), self.folder / PICKER
        if self.report:
            with _note_failure("page to pick landmarks", undrawn):
                drawn = visualization.drawable(surfaces[0]), visualization.drawable(surfaces[1])
                visualization.write_landmark_picker(picker, *drawn, str(error), **inputs.shown())
        if undrawn or not self.report:
            return error
        return type(error)(f"{error}. Both shapes are in {picker}, where you can pick landmarks")


@contextmanager
def _note_failure(what: str, undrawn: list[str]) -> Iterator[None]:
    """Note that a drawing failed, and go on; a full disk remains an error."""
    try:
        yield
    except OSError:
        raise
    except Exception as error:
        reason = (str(error) or type(error).__name__).partition("\n")[0]
        undrawn.append(f"there is no {what}: {reason}")


def described(result: isomatch.MatchResult) -> dict[str, Any]:
    """Plain values of a result, with the bounds of its measures."""
    return {**result.to_dict(), "bounds": visualization.quality_bounds(result)}


def _path_from(folder: Path, mesh: Path) -> str:
    """Write a path relative to a folder, so that both can move; keep an absolute path."""
    same_drive = mesh.absolute().drive == folder.absolute().drive
    return relpath(mesh, folder) if same_drive and not mesh.is_absolute() else str(mesh.absolute())


def _find_mesh(folder: Path, seen: str, typed: str) -> Path:
    """Find a mesh by its path from the folder, as it was typed, in the folder or beside it."""
    name = Path(typed).name
    places = [Path(normpath(folder / seen))] if seen else []
    places += [Path(typed), folder / name, folder.parent / name]
    for place in places:
        if place.exists():
            return place
    raise MissingFileError(
        f"{places[0]}: no such file; it is a mesh of the result {folder}: give both meshes after it, or put it back"
    )


# types of the values that result.json must have for `choose` and `open`
_REQUIRED_FIELDS: dict[str, type] = dict.fromkeys(("source", "target", "match_again", "origin"), str)
_REQUIRED_FIELDS |= {"landmarks": list, "alternatives": list, "config": dict, "files": dict, "seed": int}


@dataclass(frozen=True)
class Earlier:
    """The contents of the folder of a result."""

    folder: ResultFolder
    record: dict[str, Any]  # contents of result.json
    inputs: Inputs

    @classmethod
    def read(cls, folder: Path, *meshes: Path | None) -> Earlier:
        """Read ``result.json`` and check its fields; ``meshes`` are files in place of its own."""
        path = folder / RESULT
        text, fields = read_bytes(path), dict[str, Any]()
        with suppress(ValueError):
            fields = record if isinstance(record := loads(text), dict) else {}
        missing = [name for name, kind in _REQUIRED_FIELDS.items() if not isinstance(fields.get(name), kind)]
        if missing:
            message = f"{path}: lacks {', '.join(missing)}; give the folder of a result of isomatch match"
            raise FormatError(message)
        seen = fields.get("meshes")
        seen = map(str, seen) if isinstance(seen, list) and len(seen) == 2 else ("", "")
        if len(meshes) not in (0, 2):
            raise InputError(f"{folder}: give both meshes after it, source and target, or none")
        names = zip(meshes or (None, None), seen, (fields["source"], fields["target"]))
        ends = [given or _find_mesh(folder, *places) for given, *places in names]
        inputs = Inputs(ends[0], ends[1], fields["match_again"], fields["landmarks"])
        return cls(ResultFolder(folder, report="report" in fields["files"]), fields, inputs)

    def surfaces(self) -> tuple[Surface, Surface]:
        """Read both shapes."""
        return read_surface(self.inputs.source), read_surface(self.inputs.target)

    def result(self, *surfaces: Surface) -> isomatch.MatchResult:
        """Read the map with all alternatives that were saved; `MapError` if it is of other surfaces."""
        n_saved = sum(name.startswith("alternative") for name in self.record["files"])
        result = isomatch.MatchResult.load(self.folder.files["map"])
        result.map.check_fits(*surfaces)
        n = surfaces[1].n_vertices
        maps = [isomatch.Correspondence.load(path, n) for path in self.folder.alternatives[:n_saved]]
        return replace(result, alternatives=tuple(map(_alternative, self.record["alternatives"], maps)))

    def back(self, source: Surface) -> Back | None:
        """Read the map of the other direction, if there is one."""
        values = self.record.get("back")
        if not isinstance(values, dict) or not self.folder.has_back:
            return None
        return isomatch.Correspondence.load(self.folder.folder / BACK, source.n_vertices), values

    @property
    def as_mesh(self) -> dict[str, Any]:
        """Record of the mesh file of the result; empty if there is none."""
        record = self.record.get("as_mesh")
        return record if isinstance(record, dict) and isinstance(record.get("file"), str) else {}

    @property
    def mesh_left(self) -> list[str]:
        """Say that the mesh file still shows the former map; empty if there is no such file."""
        remedy = "in Python, MatchResult.as_mesh gives the surface by this one"
        file = self.as_mesh.get("file")
        return [f"{file} is of the map before and was left; {remedy}"] if file else []


def _alternative(evidence: Mapping[str, Any], other: isomatch.Correspondence) -> matching.Alternative:
    numbers = (evidence.get(name) for name in ("energy", "orientation"))
    energy, orientation = (nan if number is None else number for number in numbers)
    return matching.Alternative(lambda: other, energy, orientation, evidence["origin"])


# styles of headlines in the terminal for some outcomes; headlines of all others are bold yellow
_STYLES = {"CONVERGED": "bold green", "LOW_CONFIDENCE": "bold red", "MIRROR_IMAGE": "bold red"}
MAX_NOTES = 2  # largest number of notes in a summary, chosen; the report has all


def say_result(result: isomatch.MatchResult, details: bool = False) -> None:
    """Print a result in plain words; with details, also every measure, the stages and all notes."""
    summary = visualization.summary_of(result)
    say(summary.headline, _STYLES.get(result.outcome.name, "bold yellow"))
    say_rows([("how sure", summary.sureness), ("what to do", summary.advice)])
    if details:
        _say_details(result)
    else:
        # notes on the map come before notes on one of the shapes
        notes = sorted(result.notes, key=lambda note: note.startswith(("source: ", "target: ")))
        more = len(notes) - MAX_NOTES
        say_rows(("note", in_shell(note)) for note in notes[:MAX_NOTES])
        say_rows([("", f"{more} more {'note' if more == 1 else 'notes'}: --details")] if more > 0 else [])


def _say_details(result: isomatch.MatchResult) -> None:
    say("")
    say(f"{result.outcome.value}: {result.map!r}, from {result.origin}")
    for region in result.regions:
        say(f"doubtful: {region}")
    rows = []
    for measure, number, against in visualization.quality_measures(result):
        bound = measure.bound.replace("at most", "≤").replace("at least", "≥") + " !" * against
        rows.append((measure.name, measure.value(number), bound, measure.unit))
    say_table(rows)
    for side, symmetry in zip(("source", "target"), result.symmetries):
        if symmetry:
            say(f"{side} maps onto itself: {symmetry}")
    one_by_one = {s: t for s, t in result.timings.items() if not s.startswith(("source: ", "target: "))}
    say_rows([("seconds", ", ".join(f"{stage} {seconds:.2f}" for stage, seconds in one_by_one.items()))])
    say_notes(result.notes)
    say("")


def say_files(record: Mapping[str, Any]) -> None:
    """Print how long it took, which file to open first, what else was written, and what could not be drawn."""
    files = record["files"]
    first_file = next(files[kind] for kind in ("report", "picture", "map") if kind in files)
    names = {Path(file).name for file in files.values() if file != first_file}
    alternatives = {name for name in names if name.startswith("alternative_")}
    short_names = {"alternative_*.npz"} if len(alternatives) > 1 else alternatives
    sizes = f"{record['n_source']:,} → {record['n_target']:,} vertices"
    say_rows(("note", note) for note in record["undrawn"])
    say_rows([("took", f"{waited():.1f} s, of which {record['timings']['total']:.1f} s to match {sizes}")])
    say(f"{'  open first':<{INDENT}}{first_file}")  # A long path is not broken, so that it can be copied.
    say_rows([("also there", ", ".join(sorted((names - alternatives) | short_names)))])
