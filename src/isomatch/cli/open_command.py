"""``isomatch open``: a local page in which two shapes are matched and the map is corrected."""

from __future__ import annotations

import webbrowser
from contextlib import nullcontext
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread
from typing import Annotated, Any
from zipfile import ZIP_DEFLATED, ZipFile

from cyclopts import Parameter

import isomatch
from isomatch import visualization
from isomatch._core.errors import SettingError
from isomatch._core.texts import json_text
from isomatch.cli.inputs import (
    ConfigFile,
    Force,
    OptionalOutput,
    Surface,
    read_config,
    read_initial_map,
    read_landmarks,
    read_surface,
)
from isomatch.cli.results import BACK_REMOVED, RESULT, Back, Earlier, Inputs, ResultFolder, match_again
from isomatch.cli.terminal import say
from isomatch.server import PageServer, Pairs, Session, require_server


def open_page(
    source: Path,
    target: Path | None = None,
    other: Path | None = None,
    /,
    *,
    output: OptionalOutput = None,
    landmarks: Path | None = None,
    target_landmarks: Path | None = None,
    initial_map: Path | None = None,
    config: ConfigFile = None,
    port: int = 0,
    browser: Annotated[bool, Parameter(name="--browser", negative="--no-browser", show_default=False)] = True,
    seed: int | None = None,
    force: Force = False,
) -> None:
    """Work on two shapes in a page: match, look, correct landmarks, compare, save.

    The page is served to browsers of this machine alone, until Ctrl-C ends it. It needs the extra open.

    Args:
        source: Mesh to map from, or the folder of a result of isomatch match, to go on with it.
        target: Mesh to map to; with a folder, the mesh that was matched, if it is not where it was.
        other: With a folder, the mesh to which it was matched, likewise.
        output: Folder into which the page saves the files that isomatch match writes. Without it, the page offers them
            as a download. A result that is opened is saved into its own folder; its map back is
            removed once the map has changed.
        landmarks: Landmarks to begin with, as for isomatch match.
        target_landmarks: The points marked on the target, if they have a file of their own.
        initial_map: A map of any tool to look at; a match starts from it, and shows both.
        port: Port on which the page is served; 0 for any that is free.
        browser: Whether to open the page in a browser. Its address is printed in any case.
        seed: Seed of all that is drawn at random; 0 if it is left out. A result that is opened has its own.
    """
    require_server()
    if target is None or other is not None:
        options = "-o", "--landmarks", "--target-landmarks", "--initial-map", "--config", "--seed", "--force"
        values = output, landmarks, target_landmarks, initial_map, config, seed, force or None
        _require_result(source, [option for option, value in zip(options, values) if value is not None])
        earlier = Earlier.read(source, target, other)
        surfaces = earlier.surfaces()
        result, back = earlier.result(*surfaces), earlier.back(surfaces[0])
        keeper, force = _Files(earlier.inputs, surfaces, earlier.folder, earlier, result, back), True
        session: dict[str, Any] = {"result": result, "config": result.config, "seed": result.seed}
    else:
        session = {"config": read_config(config), "seed": seed or 0}
        surfaces = read_surface(source), read_surface(target)
        pairs = read_landmarks(landmarks, target_landmarks, (source, target))
        known = {"initial_map": initial_map, "config": config, "seed": seed or 0}
        again = match_again(source, target, output=output or Path("out"), **known)
        given, facts = read_initial_map(initial_map, surfaces[1]), {}
        if given:
            given.check_fits(*surfaces)
            facts = {"initial map": str(initial_map)}
        inputs = Inputs(source, target, again, [] if pairs is None else pairs.tolist(), facts, given)
        keeper = _Files(inputs, surfaces, ResultFolder(output) if output else None)
    marks, given = keeper.inputs.landmarks, keeper.inputs.initial_map
    meshes = visualization.drawable(surfaces[0]), visualization.drawable(surfaces[1])
    page = visualization.WorkPage(*meshes, names=keeper.inputs.names, landmarks=marks, given=given)
    with keeper.results.claimed(force) if keeper.results else nullcontext():
        server = PageServer(Session(surfaces, page, keeper, landmarks=marks, **session), port)
        say(server.address)
        say("Browsers of this machine that have this address show the page. Ctrl-C ends it.")
        if browser:
            # A browser in a terminal returns only when it is closed.
            Thread(target=webbrowser.open, args=(server.once,), daemon=True).start()
        server.run()


def _require_result(folder: Path, options: list[str]) -> None:
    """Require the folder of a result, and no options that it has itself."""
    if not folder.is_dir():
        message = f"{folder}: isomatch open needs two shapes, or the folder of a result of isomatch match"
        raise SettingError(message)
    if options:
        raise SettingError(
            f"{', '.join(options)}: the result in {folder} has its own, and Save replaces it; leave the option out"
        )


@dataclass(frozen=True)
class _Files:
    """Writes what `isomatch match` writes, see `server.Keeper`."""

    inputs: Inputs
    surfaces: tuple[Surface, Surface]
    results: ResultFolder | None
    earlier: Earlier | None = None  # the contents of the folder that was opened, if any
    opened: isomatch.MatchResult | None = None  # the result in that folder
    back: Back | None = None  # the map of the other direction in that folder

    @property
    def folder(self) -> str:
        return str(self.results.folder) if self.results else ""

    def write(self, result: isomatch.MatchResult, landmarks: Pairs) -> str:
        if self.results is None:
            raise SettingError("there is no folder to save into; start isomatch open with -o DIR")
        had_back = self.results.has_back
        record = self._write(self.results, result, landmarks)
        remarks = [*record["undrawn"], *([BACK_REMOVED] if had_back and not self.results.has_back else [])]
        if self.earlier and result is not self.opened:
            remarks += self.earlier.mesh_left
        names = ", ".join(Path(path).name for path in record["files"].values())
        return f"Saved {names} in {self.folder}{''.join(f'; {remark}' for remark in remarks)}."

    def packed(self, result: isomatch.MatchResult, landmarks: Pairs) -> bytes:
        archive = BytesIO()
        with TemporaryDirectory() as folder, ZipFile(archive, "w", ZIP_DEFLATED) as zipped:
            results = ResultFolder(Path(folder))
            record = self._write(results, result, landmarks)
            names = {what: Path(path).name for what, path in record["files"].items()}
            beside = {"files": names, "meshes": list(self.inputs.names)}
            (results.folder / RESULT).write_text(json_text(record | beside), encoding="utf-8")
            for name in names.values():
                zipped.write(results.folder / name, name)
        return archive.getvalue()

    def _write(self, results: ResultFolder, result: isomatch.MatchResult, landmarks: Pairs) -> dict[str, Any]:
        is_opened, inputs = result is self.opened, replace(self.inputs, landmarks=landmarks)
        as_mesh = self.earlier.as_mesh if self.earlier and is_opened else {}
        more = {"as_mesh": as_mesh} if as_mesh else {}
        return results.write(self.surfaces, result, inputs, more=more, back=self.back if is_opened else None)
