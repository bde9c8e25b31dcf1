"""The page to work in: the report's view with a panel that matches, corrects and keeps; a server fills it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from html import escape
from typing import Any, get_args

import numpy as np

from isomatch.correspondence import UNMATCHED, Correspondence
from isomatch.matching import DoubtfulRegion, MatchResult, Question
from isomatch.settings import Config, Orientation
from isomatch.surfaces import Mesh
from isomatch.visualization import report
from isomatch.visualization.scene import DrawnPair, Layer, layers_of
from isomatch.visualization.summary import outcome_colour, share_elsewhere, summary_of
from isomatch.visualization.viewer import template, text_of

# two maps are called the same if the share of the source's area on which they differ is below this; chosen
MIN_CHANGED_SHARE = 0.001
MAP_BEFORE = "before"  # name of the map that the present map replaced


class WorkPage:
    """What a browser shows of two shapes while they are matched; options as for `write_report`."""

    def __init__(
        self,
        source: Mesh,
        target: Mesh,
        *,
        names: tuple[str, str] = report.SIDES,
        landmarks: Sequence[Sequence[int]] = (),
        given: Correspondence | None = None,
    ) -> None:
        self._source, self._target, self._names, self.given = source, target, names, given
        self._pairs = report.pairs_on(landmarks or None, source, target)
        self._drawn = DrawnPair(source, target, landmarks=self._pairs)

    def html(self, folder: str, config: Config) -> str:
        """Make the page before any match, for the folder where results are saved, if any, and settings to begin with."""
        scene = {**self._drawn.shapes(), "maps": []}
        chosen = {name: " selected" * (name == config.orientation) for name in get_args(Orientation)}
        panel = template("work.html").substitute(
            only=" checked" * (config.hypotheses == "given"),
            hold=" checked" * (config.pin is not None),
            pose=" checked" * (config.start == "pose"),
            orientations="".join(f"<option{is_chosen}>{name}</option>" for name, is_chosen in chosen.items()),
            unwritable="" if folder else " hidden",
            keeps=escape(
                f"Save writes into the folder {folder}; Download gives the same files."
                if folder
                else "Start isomatch open with -o DIR to save into a folder."
            ),
        )
        return report.page_of(
            (self._source, self._target),
            self._names,
            scene,
            self._pairs,
            style=text_of("work.css"),
            policy="; connect-src 'self'; form-action 'none'; base-uri 'none'",
            kind=' class="work"',
            work=f"<script>\n{text_of('work.js')}</script>",
            colour="var(--edge)",
            headline=escape(f"{self._names[0]} → {self._names[1]}"),
            advice="",
            remarks=report.paragraphs(report.simplified(scene)),
            picking=" checked",
            landmarks=panel,
        )

    def before_match(self) -> dict[str, Any]:
        """Return what `result` returns, for the given map before there is a result."""
        shown = [report.ShownMap(report.GIVEN, self.given)] if self.given else []
        return {
            "outcome": "",
            "headline": f"This is {report.GIVEN}.",
            "advice": "Press Match: isomatch starts from it, finds a map of its own and shows both.",
            "colour": "var(--edge)",
            **dict.fromkeys(("sure", "since", "questions", "details"), ""),
            "regions": [],
            "landmarks": [],
            **self._maps(shown, {}),
        }

    def result(
        self,
        result: MatchResult,
        before: Correspondence | None = None,
        landmarks: Sequence[Sequence[int]] = (),
    ) -> dict[str, Any]:
        """Return in plain values all that the page shows of a result.

        ``runners_up`` describes each map that is drawn. ``landmarks`` have the distance of each
        from its image, through space, in √area of the target. ``details`` are HTML.
        """
        shown, since = report.shown_maps(self._source, self._target, result, self.given), ""
        if before is not None:
            moved = share_elsewhere(self._source, self._target, result.map, before)
            about = f"The map that this one replaced. Differs on {moved:.0%} of the surface."
            shown.append(report.ShownMap(MAP_BEFORE, before, "", about))
            since = f"Against the map before, {moved:.1%} of the source has another image."
            if moved < MIN_CHANGED_SHARE:
                since = "It is the same map as before."
        pairs = report.pairs_on(landmarks or None, self._source, self._target)
        offsets = (
            result.map.pull_back(self._target.vertices)[pairs[:, 0]] - self._target.vertices[pairs[:, 1]]
        )
        errors = np.linalg.norm(offsets, axis=1) / np.sqrt(self._target.area)
        summary = summary_of(result)
        asked = report.open_questions_of(self._source, self._target, result)
        return {
            "outcome": result.outcome.name,
            "headline": summary.headline,
            "advice": summary.advice_in_python,
            "colour": outcome_colour(result.outcome),
            "sure": summary.sureness,
            "since": since,
            "questions": report.list_of_questions([self._move_to_shown(question) for question in asked]),
            "regions": [self._region(region, result.map) for region in result.regions],
            "landmarks": [
                {"pair": pair, "off": -1.0 if np.isnan(off) else off}
                for pair, off in zip(pairs.tolist(), errors.tolist())
            ],
            "details": template("work_details.html").substitute(
                quality=report.table_of_quality(result),
                notes=report.notes_of(result),
                run=report.tables_of_run(result, {}),
            ),
            **self._maps(shown, layers_of(result)),
        }

    def _maps(self, shown: Sequence[report.ShownMap], layers: Mapping[str, Layer]) -> dict[str, Any]:
        """Describe the maps that are drawn, and return the data to draw them."""
        described = [{"name": name, "origin": origin, "about": about} for name, _, origin, about in shown]
        drawn = self._drawn.maps({name: correspondence for name, correspondence, *_ in shown}, layers)
        return {"runners_up": described, "scene": drawn}

    def _move_to_shown(self, question: Question) -> Question:
        """Move a question to vertices that are shown."""
        places = tuple(self._drawn.shown_near("target", place) for place in question.places)
        return replace(question, vertex=self._drawn.shown_near("source", question.vertex), places=places)

    def _region(self, region: DoubtfulRegion, shown: Correspondence) -> dict[str, Any]:
        """Describe a region: its share, its most doubtful vertex, both images, and the reason."""
        vertex = self._drawn.shown_near("source", int(region.vertices[0]))
        description = {"area": f"{region.area:.1%}", "vertex": vertex, "reason": region.reason}
        other = None if region.runner_up is None else region.runner_up[0]
        for kind, goal in {"image": shown.vertices[vertex], "runner_up": other}.items():
            is_none = goal is None or goal == UNMATCHED
            description[kind] = None if is_none else self._drawn.shown_near("target", int(goal))
        return description
