"""Write and sum up a match."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from math import isfinite, isnan
from pathlib import Path
from typing import Any

from isomatch import IsomatchError, MatchResult, Outcome, __version__
from isomatch.cli.terminal import json_text, say, say_table


@dataclass(frozen=True)
class ResultFolder:
    """Where the files of one match go.

    Parameters
    ----------
    folder : Path
        The folder; made if it is not there.
    picture : str
        Name of the picture.
    """

    folder: Path
    picture: str = "map.png"

    @property
    def files(self) -> dict[str, str]:
        """Path of each file, by what it is."""
        names = {"map": "map.npz", "text": "map.txt", "result": "result.json", "picture": self.picture}
        return {what: str(self.folder / name) for what, name in names.items()}

    def claim(self, force: bool) -> None:
        """Make the folder; refuse, unless forced, if it holds a result."""
        taken = [path for path in self.files.values() if Path(path).exists()]
        if taken and not force:
            raise IsomatchError(
                f"{taken[0]}: already exists and would be lost; choose another folder with -o, or pass --force"
            )
        self.folder.mkdir(parents=True, exist_ok=True)

    def write(self, result: MatchResult, more: dict[str, Any]) -> dict[str, Any]:
        """Write all but the picture; return what is in ``result.json``."""
        record = {"isomatch": __version__, **more, **result.to_dict(), "files": self.files}
        result.map.save(self.files["map"])
        result.map.save(self.files["text"])
        Path(self.files["result"]).write_text(json_text(record), encoding="utf-8")
        return record


_STYLES = {Outcome.CONVERGED: "bold green", Outcome.LOW_CONFIDENCE: "bold red"}


def say_result(result: MatchResult) -> None:
    """Print outcome, quality, timings and notes."""
    say(f"{result.outcome.value}: {result.outcome.advice}", _STYLES.get(result.outcome, "bold yellow"))
    say(f"{result.map!r}, from {result.origin}")
    say("")
    say_table(_quality_rows(result))
    say("")
    say("seconds: " + ", ".join(f"{stage} {seconds:.2f}" for stage, seconds in result.timings.items()))
    for note in result.notes:
        say(f"note: {note}")


def say_files(files: dict[str, str]) -> None:
    """Print what was written."""
    say("wrote " + ", ".join(files.values()))


# field of `isomatch.Quality`: what it is called, how it is written, in which unit
_MEASURES = {
    "misfit": ("misfit", "{:.2f}", "0: one shape; 0.4: right, of two people"),
    "rival_misfit": ("misfit of the next best map", "{:.2f} ×", "1 is a tie, large is clear"),
    "distortion_mean": ("distortion, mean", "{:.2%}", "of √area, between pairs of points"),
    "distortion_p95": ("distortion, 95th percentile", "{:.2%}", "of √area"),
    "coverage": ("coverage", "{:.1%}", "of the target's area is near an image"),
    "matched": ("matched", "{:.1%}", "of the source's vertices have an image"),
    "orientation": ("orientation", "{:.2f}", "1 keeps the outside, −1 inverts it"),
    "residual": ("descriptor residual", "{:.2f}", "of √(average distance)"),
    "stretch": ("stretch of edges", "{:.2f}", "mean square, 1 for an isometry"),
    "landmark_error": ("landmark error", "{:.2%}", "of √(target area)"),
}


def _quality_rows(result: MatchResult) -> list[tuple[str, str, str]]:
    """Name, value and unit of every measure that was taken."""
    rows = []
    for field, value in asdict(result.quality).items():
        name, written, unit = _MEASURES.get(field, (field, "{:.3g}", ""))
        if not isnan(value):
            rows.append((name, written.format(value) if isfinite(value) else "none", unit))
    return rows
