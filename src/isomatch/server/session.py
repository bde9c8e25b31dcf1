"""The state behind the page: two shapes, prepared once; one job at a time; the latest result."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Protocol

from isomatch._core.errors import IsomatchError, SettingError
from isomatch._core.threads import Abandoned, Call, parallel_map, stop_if_abandoned
from isomatch.matching import MatchResult, continue_with, match
from isomatch.settings import Config, Hypotheses, Orientation, Start
from isomatch.shapes import PreparedShape, prepare
from isomatch.surfaces import Surface
from isomatch.visualization import WorkPage

Tell = Callable[[str, float], None]  # a function that is called with a stage and the share done
POLL_SECONDS = 0.05  # seconds between two checks whether a job has ended; chosen
logger = logging.getLogger(__name__)

Pairs = Sequence[Sequence[int]]  # pairs (source vertex, target vertex)
# share of a job's time that passes before drawing begins, for the progress bar alone; chosen
SHARE_BEFORE_DRAWING = 0.97


class Job(Call):
    """Runs a function on its own thread; the function reports its progress, and ends soon if abandoned."""

    def __init__(self, name: str, work: Callable[[Tell], Any]) -> None:
        super().__init__()
        self.name = name
        self.succeeded = False  # whether the function has returned, even if the job was abandoned before
        self._result: Any = None
        self._error: Exception | None = None
        self._now = ("", 0.0)  # the stage, and the share of the work that is done
        self._since, self._end = time.perf_counter(), 0.0  # seconds; the end is 0 as long as the job runs

        def run() -> None:
            try:
                self._result = work(self._tell)
                self.succeeded = True
            except Abandoned:
                pass
            except Exception as error:
                self._error = error
            finally:
                self._end = time.perf_counter()

        self._thread = self.thread(run)
        self._thread.start()

    def _tell(self, stage: str, share: float) -> None:
        self._now = stage, share

    @property
    def is_over(self) -> bool:
        """Whether its thread has ended."""
        return not self._thread.is_alive()

    @property
    def seconds(self) -> float:
        """How long it has run."""
        return (self._end or time.perf_counter()) - self._since

    def join(self) -> None:
        """Wait for the end of the thread; a wait in another job ends if that is abandoned."""
        while not self.is_over:
            stop_if_abandoned()
            self._thread.join(POLL_SECONDS)

    def wait(self) -> Any:
        """Wait until it is over (`join`), and return its result or raise its error."""
        self.join()
        if self._error:
            raise self._error
        return self._result

    def now(self) -> tuple[str, float]:
        """Return the stage, and the share of the work that is done."""
        while not self.messages.empty():
            if (message := self.messages.get()) is not None:
                message()
        return self._now


class Keeper(Protocol):
    """Writes the files of a result."""

    @property
    def folder(self) -> str:
        """The folder that it writes into, for the page; if empty, `write` raises `SettingError`."""

    def write(self, result: MatchResult, landmarks: Pairs) -> str:
        """Write the files into the folder, and return a sentence that says so."""

    def packed(self, result: MatchResult, landmarks: Pairs) -> bytes:
        """Return the files in a zip archive."""


class Session:
    """The state behind a page that is drawn by a `WorkPage`; its methods are called from one thread.

    The preparation of the surfaces, source and target, begins at once. If a ``result`` is given,
    ``landmarks`` are those with which it was found. If the page has a given map, a match starts
    from it.
    """

    def __init__(
        self,
        surfaces: tuple[Surface, Surface],
        page: WorkPage,
        keeper: Keeper,
        *,
        config: Config | None = None,
        seed: int = 0,
        result: MatchResult | None = None,
        landmarks: Pairs = (),
    ) -> None:
        self._surfaces, self._page, self._keeper = surfaces, page, keeper
        self._config, self._seed = config or Config(), seed
        self._result, self._landmarks = result, list(landmarks)
        self._shown: dict[str, Any] | None = None
        if result or page.given:
            self._shown = page.result(result, None, landmarks) if result else page.before_match()
        self._revision = int(self._shown is not None)
        self._saved = self._revision
        self._job: Job | None = None
        self._given_up: list[Job] = []
        self._last: dict[str, Any] | None = None
        self._error = ""
        self._written, self._packed = "", (0, b"")
        self._preparation = Job("prepare", self._prepare)

    def html(self) -> str:
        """Make the page, before it asks for a result."""
        return self._page.html(self._keeper.folder, self._config)

    def shown(self) -> dict[str, Any]:
        """Return all that the page shows of the result; `SettingError` if there is none."""
        if self._shown is None:
            raise SettingError("there is no result yet; match first")
        return self._shown

    def archive(self) -> bytes:
        """Return the archive that `pack` made last; empty if none was made."""
        return self._packed[1]

    def state(self) -> dict[str, Any]:
        """Return in plain values which job runs, how far it is, and what has changed."""
        self._settle()
        job = self._job
        stage, share = job.now() if job else ("", 0.0)
        if job and not stage and not self._preparation.is_over:
            stage, share = self._preparation.now()
        return {
            "job": job and job.name,
            "stage": stage,
            "share": share,
            "seconds": job.seconds if job else 0.0,
            "last": self._last,
            "error": self._error,
            "revision": self._revision,
            "unsaved": self._saved != self._revision,
            "written": self._written,
            "packed": self._packed[0],
        }

    def match(
        self,
        landmarks: Pairs,
        *,
        only: bool = False,
        hold: bool = False,
        start: Start = "auto",
        orientation: Orientation = "preserve",
    ) -> None:
        """Begin a match with landmarks, or without any if there are none.

        With ``only``, no map that ignores the landmarks can win. With ``hold``, the map goes
        through the landmarks, exactly or within the tolerance ``pin`` of the settings.
        """
        hypotheses: Hypotheses = "given" if only and landmarks else "all"
        pin = (self._config.pin or 0.0) if hold and landmarks else None
        config = replace(self._config, hypotheses=hypotheses, pin=pin, start=start, orientation=orientation)
        options: dict[str, Any] = {"initial_map": self._page.given, "config": config, "seed": self._seed}
        self._begin_result("match", partial(match, **options), landmarks, self._result)

    def choose(self, number: int) -> None:
        """Begin to make an alternative of the result, counted from 1, the map."""
        result, landmarks = self._matched(), self._landmarks
        self._begin_result("choose", partial(continue_with, result, number), landmarks, None)

    def _begin_result(
        self, name: str, find: Callable[..., MatchResult], landmarks: Pairs, before: MatchResult | None
    ) -> None:
        """Begin to find a result and to draw it, perhaps beside the map before."""

        def work(tell: Tell) -> tuple[MatchResult, Pairs, dict[str, Any]]:
            shapes = self._preparation.wait()
            tell(name, 0.0)

            def progress(stage: str, share: float) -> None:
                tell(stage, SHARE_BEFORE_DRAWING * share)

            result = find(*shapes, landmarks=landmarks or None, progress=progress)
            tell("drawing", SHARE_BEFORE_DRAWING)
            return result, landmarks, self._page.result(result, before.map if before else None, landmarks)

        self._begin(name, work)

    def write(self) -> None:
        """Begin to write the files of the result into the folder that was named at the start."""
        self._keep("save", self._keeper.write)

    def pack(self) -> None:
        """Begin to make an archive of the same files."""
        self._keep("download", self._keeper.packed)

    def _keep(self, name: str, work: Callable[[MatchResult, Pairs], Any]) -> None:
        result, landmarks, revision = self._matched(), self._landmarks, self._revision
        self._begin(name, lambda tell: (revision, work(result, landmarks)))

    def cancel(self) -> None:
        """Give up the present job and drop its result; files that it has saved remain."""
        self._settle()
        if self._job is not None:
            self._job.abandoned = True
            self._given_up.append(self._job)
            self._job = None

    def _matched(self) -> MatchResult:
        self._settle()
        if self._result is None:
            raise SettingError("there is no result yet; match first")
        return self._result

    def _begin(self, name: str, work: Callable[[Tell], Any]) -> None:
        self._settle()
        if self._job is not None:
            raise SettingError(f"isomatch is busy ({self._job.name}); wait, or cancel that first")
        self._error = ""
        given_up = tuple(self._given_up)

        def work_alone(tell: Tell) -> Any:
            for job in given_up:
                job.join()
            return work(tell)

        self._job = Job(name, work_alone)

    def _settle(self) -> None:
        """Take in the results of ended jobs; from abandoned jobs, only that they saved files."""
        ended = [job for job in self._given_up if job.is_over]
        self._given_up = [job for job in self._given_up if job not in ended]
        for job in ended:
            if job.name == "save" and job.succeeded:
                self._take_in(job)
        if self._job is not None and self._job.is_over:
            job, self._job = self._job, None
            self._take_in(job)

    def _take_in(self, job: Job) -> None:
        self._last = {"job": job.name, "seconds": job.seconds}
        try:
            outcome = job.wait()
        except Exception as error:
            self._error = _message_of(error)
            return
        if job.name in ("match", "choose"):
            self._result, self._landmarks, self._shown = outcome
            self._revision += 1
            self._written = ""
        elif job.name == "save":
            self._saved, self._written = outcome
        else:
            self._saved, archive = outcome
            self._packed = self._packed[0] + 1, archive

    def _prepare(self, tell: Tell) -> list[PreparedShape]:
        shares = [0.0, 0.0]

        def prepare_side(side: int) -> PreparedShape:
            def report(stage: str, share: float) -> None:
                shares[side] = share
                tell("both shapes are prepared, once", sum(shares) / 2)

            return prepare(self._surfaces[side], self._config, self._seed, progress=report)

        return parallel_map(prepare_side, (0, 1))


def _message_of(error: Exception) -> str:
    """Say what went wrong; the traceback of an unexpected error goes to the log."""
    if isinstance(error, IsomatchError):
        return str(error)
    if isinstance(error, MemoryError):
        return f"memory does not suffice ({str(error) or 'no more is given'}); close other programs"
    if isinstance(error, OSError):
        return f"{error.filename or 'a file'}: {(error.strerror or str(error)).lower()}"
    logger.error("unexpected error", exc_info=error)
    return f"this is a defect of isomatch: {type(error).__name__}: {error}"
