"""``isomatch asymmetry``: how far shapes are from their mirror images, where, and whether all in the same way."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

import isomatch
import isomatch.statistics as shape_statistics
from isomatch.assets import Axes
from isomatch.cli.inputs import ConfigFile, Force, Output, Seed, naming_files, read_config
from isomatch.cli.statistics import NOT_OF_THE_MEAN, Scale, read_cohort, say_doubts
from isomatch.cli.statistics_files import SCALES, StatisticsFolder, listed, tabulated
from isomatch.cli.terminal import TALK, Talk, Tell, part, say, say_rows
from isomatch.errors import FormatError, MeshError, NotConvergedError, SettingError
from isomatch.statistics import Asymmetry, CorrespondedShapes, SymmetryPlane
from isomatch.storage.texts import read_csv
from isomatch.values.arrays import FloatArray

OWN_SIDE = "had counterparts on their own side, and are left unmatched"
SIDE = re.compile(r"(?<![a-z])(left|right|l|r)(?![a-z])", re.IGNORECASE)  # a word of the name of a file
MOST_DRAWN = 3  # the most asymmetric shapes, which have pictures of their own
MOST_LISTED = 40  # rows of the page
HALF = "half of the difference of the sides, along the normal; red: stands out, blue: lies deeper"


def asymmetry(
    shapes: Path,
    /,
    *,
    output: Output,
    pairs: str = "auto",
    left_right: Path | None = None,
    landmarks: Path | None = None,
    individuals: Path | None = None,
    scale: Scale = "remove",
    space: Axes | None = None,
    config: ConfigFile = None,
    seed: Seed = 0,
    force: Force = False,
    talk: Talk = TALK,
) -> None:
    """Measure how far shapes are from their mirror images, where, and what of it all shapes have in common.

    The exit code is 1, after all files are written, if the map from left to right is not sure.

    Args:
        shapes: A mesh; or a folder of meshes in one topology, or the folder of isomatch collect.
        output: Folder for index.html, asymmetry.csv, anova.csv, asymmetry.json, pictures, and shapes/NAME.ply with the
            asymmetry at each vertex.
        pairs: Whether shapes are left and right organs, which are compared. auto (default): if they are named so, as
            left_1 and right_1, or 1_L and 1_R; none: each is compared with its own mirror image; or a table with the
            columns left and right, and perhaps name.
        left_right: File with the vertex on the other side of each vertex, as a map, or left_right.npz of an earlier
            result; by default a shape is matched with its mirror image.
        landmarks: Pairs of vertices or positions for this match, one on each line: a point, and its counterpart on the
            other side; one in the middle is its own. Three or more.
        individuals: Table with the columns name and group: shapes of one group are repeated measurements of one
            individual, which tell the error of measurement.
        scale: remove (default): all are brought to one size, and differ in shape alone. keep: size counts.
        space: RAS or LPS: where x points, so that sides are called left and right; by default as the file says.
    """
    if left_right and landmarks:
        raise SettingError("--left-right gives the map, and --landmarks help to find it; give one of them")
    into = StatisticsFolder(output, last="asymmetry.json")
    with talk.progress() as tell, into.claimed(force) as new:
        tell("reading", 0.0)
        cohort, labels, doubts, notes = _read(shapes, individuals)
        space = space or _axes_of(shapes)
        named = _paired(pairs, cohort.names)
        alone = sorted({*cohort.names} - {name for pair in named.values() for name in pair})
        doubts = [doubt for doubt in doubts if not (named and doubt.kind == "mirrored")]
        say_doubts(doubts)
        result, plane_map = None, None
        if named:
            both, turned = shape_statistics.paired_sides(cohort, list(named.values()))
            notes += [] if turned else ["left and right shapes are compared as they are; none was reflected"]
            notes += [f"without a partner, and left out: {', '.join(alone)}"] if alone else []
        else:
            with naming_files(source=shapes, target=shapes):
                plane_map, result, own = _left_right(cohort, left_right, landmarks, config, seed, tell)
            notes += own
            both = cohort.mirrored(plane_map)
        tell("comparing", 0.8)
        m = len(both) // 2
        names = tuple(named) if named else cohort.names
        held = np.ones(cohort.n_vertices) if plane_map is None else plane_map.matched.astype(float)
        share = cohort.area_weights * held
        aligned = shape_statistics.align_sides(both, share, scale, plane_map)
        of = [labels.get(name, name) for name in both.names[:m]]
        found = shape_statistics.asymmetry(*aligned, share, individuals=of, seed=seed)
        error = None if result is None else result.expected_error / 2
        sides = _Sides(cohort, both, names, found, share / share.sum(), held > 0, plane_map, error, space)
        lines = sides.lines(of if len(set(of)) < m else None)
        test = {
            name: getattr(found, name) for name in ("share", "p_value", "n_permutations", "is_exact", "seed")
        }
        matched: dict[str, Any] = {}
        if result is not None:
            notes += [note for note in result.notes if note.endswith(OWN_SIDE)]
            matched = {
                "outcome": result.outcome.value,
                "matched": float(held.mean()),
                "notes": list(result.notes),
            }
        record: dict[str, Any] = {
            "isomatch": isomatch.__version__,
            "of": str(shapes),
            "symmetry": "matching" if named else "object",
            "n_individuals": len(set(of)),
            "scale": scale,
            "seed": seed,
            "left_right": matched or (None if left_right is None else str(left_right)),
            "sides": sides.words(sides.plane),
            "shapes": lines,
            "anova": [row._asdict() for row in found.anova] if m > 1 else [],
            "test": test if len(set(of)) > 1 else None,
            "left_out": list(cohort.left_out),
            "doubts": [{**doubt._asdict(), "names": list(doubt.names)} for doubt in doubts],
            "notes": notes,
        }
        told = _told(record)
        tell("writing", 0.85)
        if plane_map is not None:
            plane_map.save(new.path("left_right.npz"))
        pictures = sides.write(new, record)
        unsure = result is not None and result.outcome not in shape_statistics.SURE
        doubtful = [f"{' and '.join(doubt.names)} {doubt.reason}" for doubt in doubts]
        if result is not None and unsure:
            doubtful = [f"{_unsure(result.outcome)} {REMEDY}", *doubtful]
        _write_page(new, output.resolve().name, record, told, doubtful, pictures)
        new.finish(record)
        tell("done", 1.0)

    def summary() -> None:
        say(told[0], "bold")
        say_rows(("", line) for line in told[1:])
        say(f"open first: {output / 'index.html'}; {len(into.written)} files are there")

    talk.result({**record, "output": str(output), "files": into.written}, summary)
    if result is not None and unsure:
        raise NotConvergedError(f"{_unsure(result.outcome)} The files are in {output}. {REMEDY}")


REMEDY = (
    "Look at the pictures; if colours of the two sides do not mirror each other, give pairs of landmarks, left and right "
    "(--landmarks). A single bone of a pair has no mirror half: give left and right ones in one topology (--pairs)."
)


def _unsure(outcome: isomatch.Outcome) -> str:
    return f"The map from left to right is not sure ({outcome.value}), so all numbers may be wrong."


def _read(
    source: Path, individuals: Path | None
) -> tuple[CorrespondedShapes, dict[str, str], list[shape_statistics.Doubt], list[str]]:
    """Read one shape, or those of a folder, see `read_cohort`."""
    if not source.is_dir():
        return shape_statistics.read_shapes([source]), {}, [], []
    cohort, labels, doubts, notes = read_cohort(source, individuals)
    if len(cohort) == 1 and cohort.left_out:
        raise MeshError(
            f"{source}: {len(cohort.left_out) + 1} meshes are not in one topology, so that their vertices do not "
            f"correspond; run isomatch collect {source} -o OUT, and give OUT, or give one file"
        )
    return cohort, labels, doubts, notes


def _axes_of(source: Path) -> Axes | None:
    frame = None if source.is_dir() else isomatch.read_asset(source).frame
    return frame.axes if frame else None


def _paired(pairs: str, names: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Left and right shapes by the names of the pairs; none if shapes are compared with themselves."""
    if pairs not in ("auto", "none"):
        rows, found = read_csv(Path(pairs)), dict[str, tuple[str, str]]()
        for number, row in enumerate(rows, 2):
            left, right = (row.get(side, "").strip() for side in ("left", "right"))
            if not left or not right:
                raise FormatError(f"{pairs}:{number}: no pair; write a table with the columns left and right")
            name = row.get("name", "").strip() or f"{left}_{right}"
            if name in found or "/" in name or {left, right} - {*names} or left == right:
                raise FormatError(
                    f"{pairs}:{number}: {left!r} and {right!r} are not the names of two shapes, or {name!r} is no "
                    "name of its own; shapes are named like their files"
                )
            found[name] = left, right
        if not found:
            raise FormatError(f"{pairs}: no pairs; write a table with the columns left and right")
        return found
    of_key = defaultdict[str, dict[str, str]](dict)
    for name in names if pairs == "auto" else ():
        if words := list(SIDE.finditer(name)):
            start, end = words[-1].span()
            key = re.sub(r"[\W_]{2,}", "_", name[:start] + name[end:]).strip("_- .") or "pair"
            of_key[key][words[-1][0][0].lower()] = name
    by_name = {key: (each["l"], each["r"]) for key, each in of_key.items() if len(each) == 2}
    return by_name if 4 * len(by_name) > len(names) else {}


def _left_right(
    cohort: CorrespondedShapes,
    given: Path | None,
    landmarks: Path | None,
    config: Path | None,
    seed: int,
    tell: Tell,
) -> tuple[isomatch.Correspondence, isomatch.MatchResult | None, list[str]]:
    """Read or find the left–right map, with the match that found it, and a note of what it is the map of."""
    n, first = cohort.n_vertices, cohort.mesh(0)
    if given is not None:
        return isomatch.Correspondence.load(given, n, n), None, []
    hints = None if landmarks is None else isomatch.read_landmarks(landmarks, first, first)
    how: dict[str, Any] = {"config": read_config(config), "seed": seed, "progress": part(tell, 0.1, 0.8)}
    if len(cohort) == 1:
        result = shape_statistics.left_right_map(first, hints, **how)
        return result.map, result, []
    placed = shape_statistics.filled(cohort, cohort.area_weights, "remove").vertices
    mean = shape_statistics.generalised_procrustes(placed, cohort.area_weights, "remove").mean
    result, of = shape_statistics.left_right_of_shapes(cohort, first.moved(mean), hints, **how)
    return result.map, result, [NOT_OF_THE_MEAN.format(of)] if of else []


@dataclass(frozen=True, eq=False)
class _Sides:
    """Shapes and their mirror images, or paired organs, and the asymmetry that was found."""

    cohort: CorrespondedShapes
    both: CorrespondedShapes
    names: tuple[str, ...]
    found: Asymmetry
    share: FloatArray
    held: np.ndarray[Any, np.dtype[np.bool_]]  # (n,) which vertices have a counterpart
    map: isomatch.Correspondence | None
    error: FloatArray | None  # (n,) that errors of the map make, in √area
    space: Axes | None

    @property
    def plane(self) -> SymmetryPlane | None:
        """Plane of symmetry of the mean."""
        return self._plane_of(self.found.symmetric)

    def _plane_of(self, vertices: FloatArray) -> SymmetryPlane | None:
        return None if self.map is None else shape_statistics.symmetry_plane(vertices, self.map, self.share)

    def words(self, plane: SymmetryPlane | None) -> tuple[str, str]:
        """Names of the side that the normal of a plane points to, and of the other one; of pairs, right and left."""
        if plane is None:
            return "right", "left"
        axis = int(np.abs(plane.normal).argmax())
        if axis == 0 and self.space:
            return ("right", "left") if self.space == "RAS" else ("left", "right")
        return f"+{'xyz'[axis]}", f"−{'xyz'[axis]}"

    def outward(self, symmetric: FloatArray, components: FloatArray) -> FloatArray:
        """(..., n) components along the outward normals of a symmetric shape; nan where nothing is compared."""
        mesh = self.cohort.mesh(0).moved(symmetric)
        normals = mesh.vertex_normals * (1.0 if mesh.volume >= 0 else -1.0)
        return np.where(self.held, np.einsum("...ij,ij->...i", components, normals), np.nan)

    def of_shape(self, i: int) -> FloatArray:
        """(n,) asymmetry of a shape along the normals of its symmetric component."""
        own, mean = self.found.components[i], self.found.symmetric
        # the symmetric component of a shape is near to that of the mean, whose normals are smoother
        return self.outward(mean, own)

    def lines(self, individuals: Sequence[str] | None) -> list[dict[str, Any]]:
        """Say how asymmetric each shape is, in plain values."""
        found, m, lines = self.found, len(self.names), []
        middle = found.symmetric - self.share @ found.symmetric
        size = float(np.sqrt(self.share @ (middle**2).sum(axis=1)))
        for i, name in enumerate(self.names):
            vertices, signed = self.both.vertices[i], self.of_shape(i)
            plane = self._plane_of(vertices)
            plus = self.held if plane is None else self.held & (vertices @ plane.normal > plane.offset)
            known = np.where(self.held, signed, 0.0)
            most = int(np.abs(known).argmax())
            ends = {"right": self.both.names[i], "left": self.both.names[m + i]} if plane is None else {}
            line: dict[str, Any] = {"name": name, **ends}
            line |= {} if individuals is None else {"individual": individuals[i]}
            line |= {
                "asymmetry": float(found.amounts[i]),
                "over_size": float(found.amounts[i]) / size,
                "along_normal": float(np.sqrt(self.share @ known**2)),
                "median": _weighted_median(np.abs(known), self.share),
                "fluctuating": float(found.fluctuating[i]),
                "stands_out": float(self.share[plus] @ known[plus] / self.share[plus].sum()),
                "most_vertex": most,
                "most": float(known[most]),
                "most_side": self.words(plane)[0 if plane is None or plus[most] else 1],
            }
            if plane is not None:
                line |= dict(zip(("plane_x", "plane_y", "plane_z"), plane.normal.tolist()))
                line["plane_offset"] = plane.offset
            if self.error is not None:
                area = self.cohort.mesh(0).moved(found.symmetric).area
                made = np.nan_to_num(self.error) * np.sqrt(area)
                line["map_error"] = float(np.sqrt(self.share @ made**2))
            lines.append(line)
        return lines

    def write(self, new: StatisticsFolder, record: dict[str, Any]) -> dict[str, str]:
        """Write tables, meshes and pictures; return the words beside each picture."""
        found, lines, m = self.found, record["shapes"], len(self.names)
        new.table("asymmetry.csv", **{name: [line[name] for line in lines] for name in lines[0]})
        plane, pictures = self.plane, dict[str, str]()
        seen = None if plane is None else (plane.normal, *self.words(plane))
        mean = self.cohort.mesh(0).moved(found.symmetric)
        if m > 1:
            rows = record["anova"]
            new.table("anova.csv", **{name: [row[name] for row in rows] for name in rows[0]})
            signed = self.outward(found.symmetric, found.directional)
            own = self.outward(found.symmetric, found.components - found.directional)
            spread = np.sqrt((own**2).mean(axis=0))
            values = {"directional": signed, "fluctuating": spread}
            highest = float(np.nanquantile(np.abs(signed), 0.98))
            new.mesh("mean.ply", mesh=mean, values=values, shown=signed, highest=highest, signed=True)
            label = f"directional asymmetry: {HALF}"
            shape_statistics.draw_values(
                new.picture("directional"), mean, signed, label, signed=True, sides=seen
            )
            label = "fluctuating asymmetry: standard deviation, along the normal"
            shape_statistics.draw_values(new.picture("fluctuating"), mean, spread, label, sides=seen)
            pictures = {"directional": DIRECTIONAL, "fluctuating": FLUCTUATING}
        if record["test"]:
            new.table("null.csv", share=found.null.tolist())
            label = "directional share of the asymmetry"
            shape_statistics.draw_null(new.picture("null"), found.null, found.share, label)
            pictures["null"] = NULL
        drawn = np.argsort(-found.amounts, kind="stable")[:MOST_DRAWN].tolist()
        for i, name in enumerate(self.names):
            mesh, signed = self.cohort.mesh(0).moved(self.both.vertices[i]), self.of_shape(i)
            length = np.where(self.held, np.linalg.norm(found.components[i], axis=1), np.nan)
            values = {"asymmetry": length, "along_normal": signed}
            if self.error is not None:
                values["map_error"] = self.error * np.sqrt(mesh.area)
            own_plane = self._plane_of(mesh.vertices)
            if own_plane is not None:
                values["from_plane"] = mesh.vertices @ own_plane.normal - own_plane.offset
            highest = float(np.nanquantile(np.abs(signed), 0.98))
            new.mesh(f"shapes/{name}.ply", mesh, values, signed, highest, signed=True)
            if i in drawn:
                seen = None if own_plane is None else (own_plane.normal, *self.words(own_plane))
                path = new.picture(f"shapes/{name}")
                shape_statistics.draw_values(path, mesh, signed, HALF, signed=True, sides=seen)
        for i in drawn:
            pictures[f"shapes/{self.names[i]}"] = f"{self.names[i]}: {WHERE}"
        return pictures


def _weighted_median(values: FloatArray, share: FloatArray) -> float:
    order = np.argsort(values, kind="stable")
    return float(values[order][np.searchsorted(np.cumsum(share[order]), 0.5)])


WHERE = (
    "where it differs from its mirror image. Red stands out farther than on the other side, blue lies deeper."
)
DIRECTIONAL = (
    "What is asymmetric in all alike (directional asymmetry). Red stands out, blue lies deeper, on average."
)
FLUCTUATING = "Where single shapes differ from that, each in its own way (fluctuating asymmetry)."
NULL = (
    "The test. If left and right were exchangeable, mirroring some individuals would change nothing: grey is how large "
    "the directional share is then, the line what was found. Far to the right of the grey bars, it is hardly chance."
)
MEASURED = {
    "object": (
        "Each shape is reflected and laid onto itself; the middle between both is symmetric. The asymmetry at a point is "
        "its way from there, half of the difference of the sides: a bump 2 high on one side alone shows as +1 there, and "
        "as −1 at the same place opposite."
    ),
    "matching": (
        "The left shape of each pair is reflected and laid onto the right one; the middle between both is symmetric. The "
        "asymmetry at a point is the way of the right one from there, half of the difference of the sides: where the "
        "right one stands out 2 farther, it is +1."
    ),
}


def _told(record: dict[str, Any]) -> list[str]:
    """Say what was found, one sentence each."""
    lines, plus = record["shapes"], record["sides"][0]
    told = _told_of_all(record) if len(lines) > 1 else []
    first = max(lines, key=lambda line: line["asymmetry"])
    name = f"{first['name']}, the most asymmetric," if told else first["name"]
    outward = ("lies deeper", "stands out")
    told += [
        f"{name} is {first['asymmetry']:.4g} away from a symmetric shape (root mean square), {first['over_size']:.2%} of "
        f"its size; {first['along_normal']:.4g} of it is outward or inward, as the pictures show, the rest is along the "
        f"surface; half of the surface is less than {first['median']:.4g} outward or inward",
        f"most at vertex {first['most_vertex']} on the {first['most_side']} side, which {outward[first['most'] > 0]} by "
        f"{abs(first['most']):.4g}; on average, the {plus} side {outward[first['stands_out'] > 0]} by "
        f"{abs(first['stands_out']):.4g}",
    ]
    if "plane_x" in first:
        x, y, z, offset = (first[f"plane_{key}"] for key in ("x", "y", "z", "offset"))
        told.append(f"its plane of symmetry is {x:.4f} x {y:+.4f} y {z:+.4f} z = {offset:.4g}")
    if "map_error" in first:
        told.append(
            f"errors of the map from left to right are expected to shift points by {first['map_error']:.4g} along the "
            "surface; what is outward or inward hardly depends on them"
        )
    return [*told, *(f"note: {note}" for note in record["notes"])]


def _told_of_all(record: dict[str, Any]) -> list[str]:
    """Say what several shapes have in common, and whether it is chance."""
    rows, n = {row["source"]: row for row in record["anova"]}, record["n_individuals"]
    told = [
        f"{n} individuals: {rows['individuals']['share']:.1%} of all variation is between them and symmetric, "
        f"{rows['sides']['share']:.1%} is directional asymmetry, the same in all, and "
        f"{rows['individuals × sides']['share']:.1%} fluctuating, each in its own way"
    ]
    if test := record["test"]:
        of = f"all {test['n_permutations']}" if test["is_exact"] else f"{test['n_permutations']} random"
        how = f"{of} ways to mirror some of the individuals"
        sure = (
            "one side differs from the other in all alike"
            if test["p_value"] <= 0.05
            else ("it may be chance that one side differs from the other in all alike")
        )
        told.append(
            f"{sure}: {test['share']:.1%} of the asymmetry is directional, p = {test['p_value']:.4g} ({how})"
        )
        least = 2.0 ** (1 - n)
        if least > 0.05:
            told.append(f"{n} individuals are too few for the test: p cannot be below {least:.3g}")
    if record["symmetry"] == "object":
        told.append(
            "one map from left to right serves all: where it is wrong, it is so in all alike, and looks like directional "
            "asymmetry; trust the test if the picture of that shows no spots where the map may be wrong"
        )
    if "error" in rows:
        f = rows["individuals × sides"]["f"]
        told.append(f"fluctuating asymmetry has {f:.3g} times the mean square of the error of measurement")
    else:
        told.append(
            "nothing was measured twice: errors of measurement and of maps are in the fluctuating asymmetry"
        )
    return told


def _write_page(
    new: StatisticsFolder,
    folder: str,
    record: dict[str, Any],
    told: Sequence[str],
    doubts: Sequence[str],
    pictures: dict[str, str],
) -> None:
    """Write the page that says what was measured, what was found, and what to do."""
    lines = sorted(record["shapes"], key=lambda line: -line["asymmetry"])
    columns = (
        "name",
        "asymmetry",
        "over_size",
        "along_normal",
        "median",
        *(["fluctuating"] if len(lines) > 1 else []),
    )
    shown = [[_cell(line[name], name == "over_size") for name in columns] for line in lines[:MOST_LISTED]]
    words = ("variation", "share", "sum of squares", "degrees of freedom", "mean square", "F")
    rows = [
        (
            SOURCES[row["source"]],
            _cell(row["share"], True),
            *(_cell(row[key]) for key in list(row)[1:] if key != "share"),
        )
        for row in record["anova"]
    ]
    name = (
        lines[0]["name"]
        if len(lines) == 1
        else f"{len(lines)} {'shapes' if record['symmetry'] == 'object' else 'pairs'}"
    )
    sections = {
        "To look at first": listed(doubts),
        "What was measured": f"<p>{escape(MEASURED[record['symmetry']])}</p>",
        "What was found": listed(told),
        "Where the variation lies": tabulated(words, rows) if rows else "",
        "How asymmetric each is": tabulated([each.replace("_", " ") for each in columns], shown)
        if rows
        else "",
    }
    size = f"{SCALES[record['scale']]}. " if rows else ""
    settings = (
        f"{size}Lengths are in the units of the files. Seed {record['seed']}, isomatch {record['isomatch']}."
    )
    new.page(f"Asymmetry of {name}", folder, settings, sections, pictures)


SOURCES = {
    "individuals": "between individuals, symmetric",
    "sides": "sides: directional asymmetry",
    "individuals × sides": "individuals × sides: fluctuating asymmetry",
    "error": "error of measurement",
}


def _cell(value: object, percent: bool = False) -> str:
    if isinstance(value, float):
        return "" if np.isnan(value) else f"{value:.2%}" if percent else f"{value:.4g}"
    return str(value)
