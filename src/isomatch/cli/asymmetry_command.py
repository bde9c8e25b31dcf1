"""``isomatch asymmetry``: how far shapes are from their mirror images, where, and if all alike."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from isomatch import cohort
from isomatch._core.errors import NotConvergedError
from isomatch.cli.inputs import ConfigFile, Force, Output, Seed, read_config
from isomatch.cli.terminal import TALK, Talk, complain, say, say_rows


def asymmetry(
    shapes: Path,
    /,
    *,
    output: Output,
    pairs: Path | None = None,
    left_right: Path | None = None,
    landmarks: Path | None = None,
    individuals: Path | None = None,
    scale: Literal["keep", "remove"] = "remove",
    weights: Literal["area", "uniform"] = "area",
    degrees: Literal["shapes", "dimensions"] = "shapes",
    wireframe: Path | None = None,
    config: ConfigFile = None,
    seed: Seed = 0,
    force: Force = False,
    talk: Talk = TALK,
) -> None:
    """Measure how far shapes are from their mirror images, where, and what all share.

    The exit code is 4, after all files are written, if a map from left to right is not sure.

    Args:
        shapes: A mesh; or a folder of meshes in one topology, or the folder of isomatch collect; or landmarks: a .tps,
            .nts, .dta, morphologika or .csv file, or a folder with a .fcsv, .mrk.json, .pts, … of each specimen.
        output: Folder for index.html, tables, pictures, shapes/NAME.ply with the asymmetry at each vertex, and
            left_right/NAME.npz with the map from left to right.
        pairs: Table with the columns left and right, names of organs that are compared; without it, each shape is
            compared with its own mirror image.
        left_right: The folder left_right of an earlier result, or a file with the vertex on the other side of each vertex
            of all shapes, as a map; by default each shape is matched with its mirror image. Of landmarks, a table with
            pairs of left and right ones, by name or by number from 1; all others are in the middle.
        landmarks: Three or more pairs of vertices or positions of the first shape, one on each line: a point and its
            counterpart on the other side, the left one first; one in the middle is its own.
        individuals: Table with the columns name and group: shapes of one group are repeated measurements of one
            individual, which tell the error of measurement.
        scale: remove (default): all are brought to one size, and differ in shape alone. keep: size counts.
        weights: area: a vertex counts by its share of the area. uniform: all vertices count alike; landmarks always do.
        degrees: Degrees of freedom are counted in shapes (default), or in the dimensions of shapes, of landmarks alone.
        wireframe: Of landmarks, table of pairs, by name or by number from 1, that are joined by lines in pictures.
    """
    how: dict[str, Any] = {"pairs": pairs, "left_right": left_right, "landmarks": landmarks}
    how |= {"individuals": individuals, "scale": scale, "seed": seed, "force": force}
    how |= {"weights": weights, "degrees": degrees, "wireframe": wireframe}
    how["config"] = None if pairs or left_right else read_config(config)
    with talk.progress() as tell:
        found = cohort.asymmetry(shapes, output, **how, progress=tell, warn=complain)

    def summary() -> None:
        say(found.findings[0], "bold")
        say_rows(("", line) for line in found.findings[1:])
        say(f"open first: {output / 'index.html'}; {len(found.files)} files are there")

    talk.result(found.to_json(), summary)
    if found.unsure:
        raise NotConvergedError(f"{found.unsure} All numbers may be wrong. The files are in {output}.")
