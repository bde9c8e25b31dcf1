"""The page to work in: the report's view with a panel that matches, corrects and keeps; a server fills it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from html import escape
from typing import Any, get_args

import numpy as np

from isomatch._core.arrays import IntArray
from isomatch.correspondence import UNMATCHED, Correspondence
from isomatch.matching import DoubtfulRegion, MatchResult, Question
from isomatch.settings import Config, Orientation
from isomatch.surfaces import Mesh
from isomatch.visualization.pair_page import (
    GIVEN,
    MOST_ALTERNATIVES,
    list_of_questions,
    maps_of,
    notes_of,
    open_questions_of,
    page_of,
    pairs_on,
    paragraphs,
    simplified,
    table_of_quality,
    tables_of_run,
)
from isomatch.visualization.scene import DrawnPair, layers_of
from isomatch.visualization.summary import (
    describe_alternative,
    describe_given_map,
    outcome_colour,
    share_elsewhere,
    summary_of,
)
from isomatch.visualization.viewer import template, text_of

MIN_SHARE_TOLD = 0.001  # of the surface; less is called the same map
MAP_BEFORE = "before"


class WorkPage:
    """What a browser shows of two shapes while they are matched; options as for `write_report`."""

    def __init__(
        self,
        source: Mesh,
        target: Mesh,
        *,
        names: tuple[str, str] = ("source", "target"),
        landmarks: Sequence[Sequence[int]] = (),
        given: Correspondence | None = None,
    ) -> None:
        self._source, self._target, self._names, self.given = source, target, names, given
        self._pairs = pairs_on(landmarks or None, source, target)
        self._drawn = DrawnPair(source, target, landmarks=self._pairs)

    def html(self, folder: str, config: Config) -> str:
        """Make the page before any match, for the folder where results are saved, if any, and settings to begin with."""
        scene = {**self._drawn.shapes(), "maps": []}
        panel = template("work.html").substitute(
            only=" checked" * (config.hypotheses == "given"),
            hold=" checked" * (config.pin is not None),
            pose=" checked" * (config.start == "pose"),
            orientations="".join(
                f"<option{' selected' * (x == config.orientation)}>{x}</option>"
                for x in get_args(Orientation)
            ),
            unwritable="" if folder else " hidden",
            keeps=escape(
                f"Save writes into the folder {folder}; Download gives the same files."
                if folder
                else "Start isomatch open with -o DIR to save into a folder."
            ),
        )
        return page_of(
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
            remarks=paragraphs(simplified(scene)),
            picking=" checked",
            landmarks=panel,
        )

    def before_match(self) -> dict[str, Any]:
        """Return what `result` returns, for the given map before there is a result."""
        maps = {GIVEN: self.given} if self.given else {}
        return {
            "outcome": "",
            "headline": f"This is {GIVEN}.",
            "advice": "Press Match: isomatch starts from it, finds a map of its own and shows both.",
            "colour": "var(--edge)",
            **dict.fromkeys(("sure", "since", "questions", "details"), ""),
            "regions": [],
            "landmarks": [],
            "runners_up": [{"name": name, "origin": "", "about": ""} for name in maps],
            "scene": self._drawn.maps(maps, {}),
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
        maps = maps_of(result, self.given) | ({MAP_BEFORE: before} if before else {})
        others = result.alternatives[:MOST_ALTERNATIVES]
        moved = 0.0 if before is None else share_elsewhere(self._source, self._target, result.map, before)
        since = f"Against the map before, {moved:.1%} of the source has another image."
        if moved < MIN_SHARE_TOLD:
            since = "" if before is None else "It is the same map as before."
        shapes = self._source, self._target
        about = [(result.origin, ""), *((x.origin, describe_alternative(*shapes, result, x)) for x in others)]
        about += [("", describe_given_map(*shapes, result, self.given))] if self.given else []
        about += [("", f"The map that this one replaced. Differs on {moved:.0%} of the surface.")]
        pairs = pairs_on(landmarks or None, self._source, self._target)
        errors, summary = self._landmark_errors(result.map, pairs), summary_of(result)
        return {
            "outcome": result.outcome.name,
            "headline": summary.headline,
            "advice": summary.advice_in_python,
            "colour": outcome_colour(result.outcome),
            "sure": summary.sureness,
            "since": since,
            "questions": list_of_questions(
                [self._move_to_shown(q) for q in open_questions_of(self._source, self._target, result)]
            ),
            "regions": [self._region(region, result.map) for region in result.regions],
            "runners_up": [
                dict(zip(("name", "origin", "about"), (name, *row))) for name, row in zip(maps, about)
            ],
            "landmarks": [{"pair": pair, "off": off} for pair, off in zip(pairs.tolist(), errors)],
            "details": template("work_details.html").substitute(
                quality=table_of_quality(result), notes=notes_of(result), run=tables_of_run(result, {})
            ),
            "scene": self._drawn.maps(maps, layers_of(result)),
        }

    def _move_to_shown(self, question: Question) -> Question:
        """Move a question to vertices that are shown."""
        places = (self._drawn.shown_near("target", place) for place in question.places)
        return replace(
            question, vertex=self._drawn.shown_near("source", question.vertex), places=tuple(places)
        )

    def _region(self, region: DoubtfulRegion, shown: Correspondence) -> dict[str, Any]:
        """Describe a region: its share, its most doubtful vertex, both images, and the reason."""
        vertex = self._drawn.shown_near("source", int(region.vertices[0]))
        description = {"area": f"{region.area:.1%}", "vertex": vertex, "reason": region.reason}
        other = None if region.runner_up is None else region.runner_up[0]
        for kind, goal in {"image": shown.vertices[vertex], "runner_up": other}.items():
            is_none = goal is None or goal == UNMATCHED
            description[kind] = None if is_none else self._drawn.shown_near("target", int(goal))
        return description

    def _landmark_errors(self, shown: Correspondence, pairs: IntArray) -> list[float]:
        """Measure the distances of landmarks from their images, in √area; −1 without an image."""
        images = shown.pull_back(self._target.vertices)[pairs[:, 0]]
        distances = np.linalg.norm(images - self._target.vertices[pairs[:, 1]], axis=1) / np.sqrt(
            self._target.area
        )
        return [-1.0 if np.isnan(far) else float(far) for far in distances]
