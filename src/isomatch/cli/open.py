"""``isomatch open``: a local page in which two shapes are matched and the map is corrected."""

from __future__ import annotations

import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread
from typing import Annotated, Any
from zipfile import ZIP_DEFLATED, ZipFile

from cyclopts import Parameter

import isomatch
from isomatch import serving, view
from isomatch.cli.earlier import Earlier
from isomatch.cli.inputs import read_config, read_surface
from isomatch.cli.match import with_landmarks
from isomatch.cli.outputs import BACK_REMOVED, Back, ResultFolder
from isomatch.cli.terminal import json_text, say
from isomatch.errors import SettingError

Surfaces = tuple[isomatch.Mesh | isomatch.PointCloud, isomatch.Mesh | isomatch.PointCloud]


def open_page(
    source: Path,
    target: Path | None = None,
    /,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    landmarks: Path | None = None,
    target_landmarks: Path | None = None,
    config: Path | None = None,
    port: int = 0,
    browser: Annotated[bool, Parameter(name="--browser", negative="--no-browser", show_default=False)] = True,
    seed: int | None = None,
    force: bool = False,
) -> None:
    """Work on two shapes in a page: match, look, correct landmarks, compare, save.

    The page is served to browsers of this machine alone, until Ctrl-C ends it. It needs the extra open.

    Parameters
    ----------
    source : Path
        Mesh to map from, or the folder of a result of isomatch match, to go on with it.
    target : Path
        Mesh to map to; not with a folder.
    output : Path
        Folder into which the page saves the files that isomatch match writes. Without it, the page offers them as a
        download. A result that is opened is saved into its own folder; once there is another map, without its map back.
    landmarks : Path
        Landmarks to begin with, as for isomatch match.
    target_landmarks : Path
        The points marked on the target, if they have a file of their own.
    config : Path
        TOML file with settings; see isomatch.Config.
    port : int
        Port on which the page is served; 0 for any that is free.
    browser : bool
        Whether to open the page in a browser. Its address is printed in any case.
    seed : int
        Seed of the sampling and of the eigensolver; 0 if it is left out. A result that is opened has its own.
    force : bool
        Replace an existing result in the folder; not with a result that is opened, which Save replaces.
    """
    serving.require_server()
    if target is None:
        own = {
            "-o": output,
            "--landmarks": landmarks,
            "--target-landmarks": target_landmarks,
            "--config": config,
            "--seed": seed,
            "--force": force or None,
        }
        _require_result(source, [option for option, value in own.items() if value is not None])
        earlier = Earlier.read(source)
        surfaces, again = earlier.surfaces(), earlier.record["match_again"]
        result = earlier.result(*surfaces)
        opened = _Opened(result, earlier, earlier.back(surfaces[0]))
        keeper = _Files(earlier.source, earlier.target, surfaces, earlier.folder, again, opened)
        begun: dict[str, Any] = {"result": result, "config": result.config, "seed": result.seed}
        pairs, force = earlier.landmarks, True
    else:
        if landmarks is None and target_landmarks is not None:
            raise isomatch.LandmarkError("--target-landmarks needs --landmarks with the points of the source")
        seed = seed or 0
        begun = {"config": read_config(config), "seed": seed}
        surfaces, pairs = (read_surface(source), read_surface(target)), []
        if landmarks is not None:
            pairs = isomatch.read_landmarks(landmarks, *surfaces, target_landmarks).tolist()
        again = with_landmarks(source, target, output=output or Path("out"), config=config, seed=seed)
        keeper = _Files(source, target, surfaces, ResultFolder(output) if output else None, again)
    page = view.WorkPage(*keeper.drawn, names=keeper.names, landmarks=pairs)
    with keeper.claimed(force):
        server = serving.PageServer(
            serving.Session(keeper.surfaces, page, keeper, landmarks=pairs, **begun), port
        )
        say(
            f"{server.address}\nBrowsers of this machine that have this address show the page. Ctrl-C ends it."
        )
        if browser:
            # a browser in a terminal returns when it is closed
            Thread(target=webbrowser.open, args=(server.once,), daemon=True).start()
        server.run()


def _require_result(folder: Path, options: list[str]) -> None:
    """Require the folder of a result, and no options that it has itself."""
    if not folder.is_dir():
        raise SettingError(
            f"{folder}: isomatch open needs two shapes, or the folder of a result of isomatch match"
        )
    if options:
        raise SettingError(
            f"{', '.join(options)}: the result in {folder} has its own, and Save replaces it; leave the option out"
        )


@dataclass(frozen=True)
class _Opened:
    """A result that was opened: its map back and its mesh file are kept with no other map."""

    result: isomatch.MatchResult
    earlier: Earlier
    back: Back | None


@dataclass(frozen=True)
class _Files:
    """Writes what `isomatch match` writes, see `serving.Keeper`; ``again`` is the command that matches again."""

    source: Path
    target: Path
    surfaces: Surfaces
    results: ResultFolder | None
    again: str
    opened: _Opened | None = None

    @property
    def names(self) -> tuple[str, str]:
        return self.source.name, self.target.name

    @property
    def drawn(self) -> tuple[isomatch.Mesh, isomatch.Mesh]:
        return view.drawable(self.surfaces[0]), view.drawable(self.surfaces[1])

    @property
    def folder(self) -> str:
        return str(self.results.folder) if self.results else ""

    @contextmanager
    def claimed(self, force: bool) -> Iterator[None]:
        """Claim the folder, if there is one, as long as the page is served."""
        if self.results is None:
            yield
        else:
            with self.results.claimed(force):
                yield

    def write(self, result: isomatch.MatchResult, landmarks: serving.Pairs) -> str:
        if self.results is None:
            raise SettingError("there is no folder to save into; start isomatch open with -o DIR")
        had_back = self.results.has_back
        record = self._write(self.results, result, landmarks)
        told = [*record["undrawn"], *([BACK_REMOVED] if had_back and not self.results.has_back else [])]
        if self.opened and result is not self.opened.result:
            told += self.opened.earlier.mesh_left
        names = ", ".join(Path(path).name for path in record["files"].values())
        return f"Saved {names} in {self.folder}{''.join(f'; {what}' for what in told)}."

    def packed(self, result: isomatch.MatchResult, landmarks: serving.Pairs) -> bytes:
        archive = BytesIO()
        with TemporaryDirectory() as folder, ZipFile(archive, "w", ZIP_DEFLATED) as zipped:
            results = ResultFolder(Path(folder))
            record = self._write(results, result, landmarks)
            names = {what: Path(path).name for what, path in record["files"].items()}
            results.result.write_text(json_text({**record, "files": names}), encoding="utf-8")
            for name in names.values():
                zipped.write(results.folder / name, name)
        return archive.getvalue()

    def _write(
        self, results: ResultFolder, result: isomatch.MatchResult, landmarks: serving.Pairs
    ) -> dict[str, Any]:
        source_name, target_name = self.names
        opened = self.opened if self.opened and result is self.opened.result else None
        return results.write(
            *self.drawn,
            result,
            names=self.names,
            titles=(f"source: {source_name}", f"target: {target_name}"),
            facts={"source": str(self.source), "target": str(self.target)},
            more={
                "source": str(self.source),
                "target": str(self.target),
                "match_again": self.again,
                "landmarks": [list(pair) for pair in landmarks],
                **({"as_mesh": opened.earlier.as_mesh} if opened and opened.earlier.as_mesh else {}),
            },
            back=opened.back if opened else None,
            landmarks=landmarks or None,
            command=self.again,
        )
