"""Write the files of a match, and print a summary."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import isomatch
from isomatch import view
from isomatch._files import claimed, write_text
from isomatch.cli.terminal import json_text, say, say_table


@dataclass(frozen=True)
class ResultFolder:
    """The folder for the files of one match.

    Parameters
    ----------
    folder : Path
        Its path; it is created if it does not exist.
    picture : str
        File name of the picture.
    """

    folder: Path
    picture: str = "map.png"

    @property
    def files(self) -> dict[str, str]:
        """Path of each file, by its kind."""
        names = {
            "map": "map.npz",
            "text": "map.txt",
            "result": "result.json",
            "picture": self.picture,
            "report": "report.html",
        }
        return {what: str(self.folder / name) for what, name in names.items()}

    def claimed(self, force: bool) -> AbstractContextManager[None]:
        """Create the folder and claim its files, see `isomatch._files.claimed`; an earlier result has to be forced."""
        self.folder.mkdir(parents=True, exist_ok=True)
        return claimed(self._result, [] if force else map(Path, self.files.values()))

    @property
    def _result(self) -> Path:
        return Path(self.files["result"])

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
    ) -> dict[str, Any]:
        """Write all files, ``result.json`` last: where it exists, the others are complete and belong to it.

        The picture has ``titles`` below the shapes, the report ``facts`` about the run. Returns the contents of
        ``result.json``, which begin with ``more``.
        """
        self._result.unlink(missing_ok=True)
        result.map.save(self.files["map"])
        result.map.save(self.files["text"])
        picture = self.files["picture"]
        view.draw_map(source, target, result.map, picture, titles=titles)
        facts = {"isomatch": isomatch.__version__, **facts}
        view.write_report(
            self.files["report"], source, target, result, names=names, picture=picture, facts=facts
        )
        record = {"isomatch": isomatch.__version__, **more, **result.to_dict(), "files": self.files}
        write_text(self._result, json_text(record))
        return record


@contextmanager
def claimed_files(*paths: Path | None, force: bool) -> Iterator[None]:
    """Claim single files, see `isomatch._files.claimed`; those that exist have to be forced."""
    with ExitStack() as claims:
        for path in filter(None, paths):
            claims.enter_context(claimed(path, [] if force else [path]))
        yield


_STYLES = {"CONVERGED": "bold green", "LOW_CONFIDENCE": "bold red"}


def say_result(result: isomatch.MatchResult) -> None:
    """Print the outcome, the quality, the timings and the notes."""
    say(f"{result.outcome.value}: {result.outcome.advice}", _STYLES.get(result.outcome.name, "bold yellow"))
    say(f"{result.map!r}, from {result.origin}")
    say("")
    say_table(_quality_rows(result))
    say("")
    for side, found in zip(("source", "target"), result.symmetries):
        if found:
            say(f"{side} maps onto itself: {found}")
    say("seconds: " + ", ".join(f"{stage} {seconds:.2f}" for stage, seconds in result.timings.items()))
    for note in result.notes:
        say(f"note: {note}")


def write_wrapped(path: Path, source: Path, wrapped: isomatch.Wrapped) -> dict[str, Any]:
    """Write the source in the shape of the target, with all that its file carries but normals; say what was mended."""
    asset = isomatch.read_asset(source)
    moved = asset.moved(wrapped.mesh.vertices[asset.point_of_vertex])
    normals = [attribute.name for attribute in moved.of_kind("normal")]
    isomatch.write_asset(path, moved.without_attributes(*normals))
    counts = {"inverted_before": wrapped.inverted_before, "inverted": wrapped.inverted}
    return {"file": str(path), **counts, "extended": wrapped.extended}


def say_wrapped(record: dict[str, Any]) -> None:
    """Print where the target is in the source's topology, and how many faces were mended."""
    say(
        f"wrote {record['file']}: the target with the faces of the source; {record['inverted_before']} faces were "
        f"inverted, {record['inverted']} are"
    )
    if record["extended"]:
        say(f"{record['extended']} vertices have no image and continue those around them")


def say_files(files: dict[str, str]) -> None:
    """Print which files were written."""
    say("wrote " + ", ".join(files.values()))


def _quality_rows(result: isomatch.MatchResult) -> list[tuple[str, str, str]]:
    """Give the name, value and unit of every measure of quality."""
    return [
        (measure.name, measure.value(number), measure.unit)
        for measure, number, _ in view.quality_measures(result)
    ]
