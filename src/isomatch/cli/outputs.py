"""Write the files of a match, and print a summary."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from isomatch import IsomatchError, MatchResult, Mesh, Outcome, __version__
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

    def claim(self, force: bool) -> None:
        """Create the folder; refuse to replace an existing result unless forced."""
        existing = [path for path in self.files.values() if Path(path).exists()]
        if existing and not force:
            raise IsomatchError(
                f"{existing[0]}: already exists and would be replaced; choose another folder with -o, or pass --force"
            )
        self.folder.mkdir(parents=True, exist_ok=True)

    def write(self, result: MatchResult, more: dict[str, Any]) -> dict[str, Any]:
        """Write the map and ``result.json``; return the contents of the latter."""
        record = {"isomatch": __version__, **more, **result.to_dict(), "files": self.files}
        result.map.save(self.files["map"])
        result.map.save(self.files["text"])
        Path(self.files["result"]).write_text(json_text(record), encoding="utf-8")
        return record

    def draw(
        self,
        source: Mesh,
        target: Mesh,
        result: MatchResult,
        *,
        names: tuple[str, str],
        titles: tuple[str, str],
        facts: dict[str, Any],
    ) -> None:
        """Draw the picture, with ``titles`` below the shapes, and write the report, with ``facts`` about the run."""
        from isomatch.view import draw_map, write_report  # imports matplotlib, which is slow

        picture = self.files["picture"]
        draw_map(source, target, result.map, picture, titles=titles)
        facts = {"isomatch": __version__, **facts}
        write_report(self.files["report"], source, target, result, names=names, picture=picture, facts=facts)


_STYLES = {Outcome.CONVERGED: "bold green", Outcome.LOW_CONFIDENCE: "bold red"}


def say_result(result: MatchResult) -> None:
    """Print the outcome, the quality, the timings and the notes."""
    say(f"{result.outcome.value}: {result.outcome.advice}", _STYLES.get(result.outcome, "bold yellow"))
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


def say_files(files: dict[str, str]) -> None:
    """Print which files were written."""
    say("wrote " + ", ".join(files.values()))


def _quality_rows(result: MatchResult) -> list[tuple[str, str, str]]:
    """Give the name, value and unit of every measure of quality."""
    from isomatch.view import quality_measures  # imports matplotlib, which is slow

    return [
        (measure.name, measure.value(number), measure.unit) for measure, number, _ in quality_measures(result)
    ]
