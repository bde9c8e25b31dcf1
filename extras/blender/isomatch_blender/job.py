"""A match under way, seen from Blender."""

import atexit
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from . import worker
from .meshes import Refused

NO_WINDOW = getattr(subprocess, "CREATE_NO_WINDOW", 0)  # On Windows, no console is opened.


class Job:
    """A match in a process of its own.

    Parameters
    ----------
    source, target : isomatch.Mesh
        The surfaces.
    landmarks : (m, 2) array of int or None
        Pairs of vertices, as for `isomatch.match`.
    config : isomatch.Config
        Settings.
    """

    def __init__(self, source, target, landmarks, config) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="isomatch-"))
        arrays = {
            f"{side}_{name}": getattr(mesh, name)
            for side, mesh in (("source", source), ("target", target))
            for name in ("vertices", "faces")
        }
        np.savez(
            self._folder / "surfaces.npz", **arrays, **({} if landmarks is None else {"landmarks": landmarks})
        )
        order = json.dumps({"path": sys.path, "config": config.to_dict()})
        (self._folder / "order.json").write_text(order, encoding="utf-8")
        with (self._folder / "log.txt").open("wb") as log:
            self._process = subprocess.Popen(
                [sys.executable, worker.__file__, str(self._folder)],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                creationflags=NO_WINDOW,
            )
        atexit.register(self.cancel)
        self.cancelled = False

    @property
    def is_running(self) -> bool:
        """Whether it goes on."""
        return self._process.poll() is None

    @property
    def progress(self) -> tuple[str, float]:
        """The stage, and the share of the work that is done."""
        lines = self._text("progress.txt").split("\n")[:-1]
        share, _, stage = (lines or ["0 starting"])[-1].partition(" ")
        return stage, float(share)

    def wait(self) -> None:
        """Wait for its end."""
        self._process.wait()

    def cancel(self) -> None:
        """End the process, and remove what it wrote."""
        self.cancelled = True
        self._process.kill()
        self._process.wait()
        self._clear()

    def result(self):
        """Return the `isomatch.MatchResult` of a match that is over.

        Raises
        ------
        Refused
            If there is none, in the words of isomatch.
        """
        from isomatch import MatchResult

        try:
            if error := self._text("error.txt"):
                raise Refused(error)
            if self._process.returncode:
                *_, last = ["nothing", *self._text("log.txt").strip().splitlines()]
                raise Refused(f"the match ended with exit code {self._process.returncode}; it said: {last}")
            return MatchResult.load(self._folder / "result.npz")
        finally:
            self._clear()

    def _text(self, name: str) -> str:
        file = self._folder / name
        return file.read_text(encoding="utf-8", errors="replace") if file.exists() else ""

    def _clear(self) -> None:
        atexit.unregister(self.cancel)
        shutil.rmtree(self._folder, ignore_errors=True)
