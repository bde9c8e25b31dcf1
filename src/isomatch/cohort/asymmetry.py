"""A study of asymmetry: how far shapes are from their mirror images, where, and if all alike."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scipy.spatial import cKDTree

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.errors import FormatError, InputError, MeshError, SettingError
from isomatch._core.stage_timer import Progress
from isomatch._core.tables import read_table
from isomatch.cohort import shape_statistics
from isomatch.cohort.collection import Collection
from isomatch.cohort.finish import surface_as_written
from isomatch.cohort.plan import Layout
from isomatch.cohort.shape_statistics import Asymmetry, CorrespondedShapes, draw_values
from isomatch.cohort.snapshot import Snapshot
from isomatch.cohort.statistics import Scale, Weights
from isomatch.cohort.statistics_folder import SCALINGS, VERSION, Results, StatisticsFolder, listed, tabulated
from isomatch.cohort.study_input import doubts_in_words, read_study
from isomatch.cohort.workers import Listener, Warn
from isomatch.correspondence import UNMATCHED, Correspondence, nearest_rotation
from isomatch.landmarks import read_landmark_pairs, read_landmarks
from isomatch.settings import Config
from isomatch.surfaces import Mesh, nearest_on_surface

N_DRAWN = 3  # number of shapes that are drawn, the most asymmetric ones; chosen
DRAWN_DISPLACEMENT = 0.1  # largest displacement in a picture, after enlargement, over the mean's size; chosen
# titles of the columns of the table of variances
ANOVA_HEADS = ("variation", "sum of squares", "share", "degrees of freedom", "mean square", "F", "p")
# Parts of captions and labels of pictures.
WRONG_MAP_CAPTION = "; where they have one colour, the map between them is wrong"
DIRECTIONAL_CAPTION = "Directional asymmetry: what all have in common."
FLUCTUATING_CAPTION = "Fluctuating asymmetry: how far single ones differ from that."
NORMAL_LABEL = "half of the difference of the sides, along the normal; red: stands out, blue: lies deeper"
WHAT_WAS_MEASURED = (  # section of the page on what was measured
    "Each shape is reflected and laid onto itself, or a left one onto the right one; the middle of both is symmetric. "
    "The asymmetry at a point is its distance from there: +1 where it stands out 2 units farther than its opposite."
)
SAME_ERRORS_WARNING = (  # warning about meshes in one topology that are not of a collection
    "shapes were compared in one topology, where maps go wrong alike in all: asymmetry near their errors may look "
    "directional at a small p; give the folder of isomatch collect"
)
# advice if the maps from left to right are doubtful
REMEDY = "Give landmarks of both sides (--landmarks); a single bone has no mirror half: give left and right (--pairs)."


def asymmetry(
    shapes: str | Path,
    output: str | Path,
    *,
    pairs: Path | None = None,
    left_right: Path | None = None,
    landmarks: Path | None = None,
    individuals: Path | None = None,
    scale: Scale = "remove",
    weights: Weights = "area",
    degrees: Literal["shapes", "dimensions"] = "shapes",
    wireframe: Path | None = None,
    config: Config | None = None,
    seed: int = 0,
    force: bool = False,
    progress: Progress | None = None,
    warn: Warn | None = None,
) -> Results:
    """Measure how far shapes are from their mirror images, where, and what all have in common.

    Parameters
    ----------
    shapes : path_like
        A mesh; a folder of meshes in one topology, or of a collection; or landmarks, see
        `read_specimens`.
    output : path_like
        Folder for tables, pictures, shapes/NAME.ply with the asymmetry at each vertex, and
        left_right/NAME.npz.
    pairs, left_right, landmarks, individuals, scale, weights, degrees, wireframe, config, seed, force
        As the options of ``isomatch asymmetry``.
    progress, warn
        See `run`; warnings are about shapes to look at first.

    Returns
    -------
    Results
        The record of all numbers, and which maps are not sure.

    Raises
    ------
    FormatError, MeshError, SettingError
        If files cannot be read, shapes are not in one topology, or both maps and landmarks are
        given.
    InputError
        If there are landmarks without pairs, or individuals that are no shapes.
    """
    if left_right and landmarks:
        raise SettingError("--left-right gives the map, and --landmarks help to find it; give one of them")
    source, to = Path(shapes), Listener.of(progress, warn)
    into = StatisticsFolder(Path(output), last="asymmetry.json")
    with into.claimed(force) as new:
        to.tell("reading", 0.0)
        study = read_study(source, individuals, wireframe=wireframe)
        cohort, labels, notes = study.shapes, study.groups, study.notes
        is_mesh = len(cohort.faces) > 0
        weights = weights if is_mesh else "uniform"
        if is_mesh and degrees == "dimensions":
            reason = "a mesh has as many vertices as you like"
            raise SettingError(f"--degrees dimensions is for landmarks; {reason}")
        if not is_mesh and not pairs and not left_right:
            problem = "which landmarks are left and right, or which specimens, is not known"
            raise InputError(f"{source}: {problem}; give a table of pairs of them (--left-right, or --pairs)")
        if len(cohort) == 1 and cohort.left_out:
            raise MeshError(f"{source}: no two meshes are in one topology; run isomatch collect first")
        first = doubts_in_words(doubt for doubt in study.doubts if not (pairs and doubt.kind == "mirrored"))
        for line in first:
            to.warn(line)
        maps, about, unsure = list[Correspondence](), [dict[str, Any]()] * len(cohort), ""
        hints: IntArray | None = None
        if landmarks and is_mesh:
            hints = read_landmarks(landmarks, cohort.mesh(0), cohort.mesh(0))
        collection = Collection.open(source) if Layout(source).plan.exists() else None
        if pairs:
            named = [(row["left"], row["right"]) for row in read_table(pairs).records(("left", "right"))]
            both = shape_statistics.paired_sides(cohort, named)
            notes += [f"{name} has no partner" for name in cohort.names if name not in {*sum(named, ())}]
        elif left_right and not is_mesh:
            sides = read_landmark_pairs(left_right, cohort.marks)
            maps = [shape_statistics.left_right_of_pairs(cohort.n_vertices, sides)] * len(cohort)
        elif left_right:
            n, is_folder = cohort.n_vertices, left_right.is_dir()
            files = [left_right / f"{name}.npz" if is_folder else left_right for name in cohort.names]
            maps = [Correspondence.load(file, n, n) for file in files]
        else:
            settings = {"landmarks": hints, "config": config, "seed": seed}
            scans = Snapshot(collection, collection.rows()) if collection else None
            maps, about, unsure = _match_sides(cohort, scans, settings, notes, to.part(0.1, 0.8))
        both = both if pairs else cohort.mirrored(maps)
        to.tell("comparing", 0.8)
        of = [labels.get(name, name) for name in both.names[: len(both) // 2]]
        share, dimensions = _known_share(both, weights), (1, 1)
        if degrees == "dimensions":
            n, dim = both.vertices.shape[1:]
            sides_of = maps[0] if maps else None
            dimensions = shape_statistics.symmetry_dimensions(n, dim, sides_of, scale=scale)
        how: dict[str, Any] = {"individuals": of, "seed": seed}
        aligned = shape_statistics.align_sides(both, share, scale, maps)
        found = shape_statistics.asymmetry(*aligned, share, dimensions=dimensions, **how)
        if is_mesh:
            lines, captions = _draw_meshes(new, both, maps, share, found, hints)
        else:
            lines, captions = _draw_landmarks(new, both, not maps, share, found)
        of_sizes = None
        if pairs and len(of) > 1:
            sizes = shape_statistics.centroid_sizes(both.vertices, share)[:, None, None]
            of_sizes = shape_statistics.asymmetry(*np.split(sizes, 2), **how)
        record = {
            "isomatch": VERSION,
            "of": str(source),
            "symmetry": "matching" if pairs else "object",
            "n_individuals": len(set(of)),
            "in_one_topology": is_mesh and not pairs and not collection,
            "scale": scale,
            "weights": weights,
            "degrees": degrees,
            "seed": seed,
            "shapes": [line | more for line, more in zip(lines, about)],
            "anova": [row._asdict() for row in found.anova] if len(of) > 1 else [],
            "size_anova": [row._asdict() for row in of_sizes.anova] if of_sizes else [],
            **{name: getattr(found, name) for name in ("share", "p_value", "n_permutations")},
            "doubts": [unsure, *first] if unsure else first,
            "notes": notes,
        }
        for name, left_right_map in zip(cohort.names, maps if is_mesh else []):
            left_right_map.save(new.path(f"left_right/{name}.npz"))
        sentences, lines, rows = _sentences(record), record["shapes"], record["anova"]
        tables = {"asymmetry.csv": lines, "anova.csv": rows, "size_anova.csv": record["size_anova"]}
        tables["individuals.csv"] = _lines_of_individuals(found) if len(of) > 1 else []
        for file, table in tables.items():
            if table:
                new.table(file, **{key: [row[key] for row in table] for key in table[0]})
        columns = [name for name in lines[0] if not name.startswith("plane")]
        cells = [[line[name] for name in columns] for line in lines]
        sections = {
            "To look at first": listed([*filter(None, [_below_error(lines)[0]]), *record["doubts"]]),
            "What was measured": f"<p>{WHAT_WAS_MEASURED}</p>",
            "What was found": listed(sentences),
            "Where the variation lies": tabulated(ANOVA_HEADS, (row.values() for row in rows))
            if rows
            else "",
            "Where the asymmetry of sizes lies": tabulated(ANOVA_HEADS, of_sizes.anova) if of_sizes else "",
            "How asymmetric each is": tabulated(columns, cells),
        }
        title = f"Asymmetry of {lines[0]['name'] if len(of) == 1 else f'{len(of)} shapes'}"
        used = f"{SCALINGS[scale]}. Lengths are in the units of the files. Seed {seed}, isomatch {VERSION}."
        new.page(title, into.folder.resolve().name, used, sections, captions)
        new.finish(record)
        to.tell("done", 1.0)
    return Results(into.folder, into.written, record, sentences, unsure=unsure)


def _match_sides(
    cohort: CorrespondedShapes, scans: Snapshot | None, how: dict[str, Any], notes: list[str], to: Listener
) -> tuple[list[Correspondence], list[dict[str, Any]], str]:
    """Match shapes, or surfaces in their files, with their mirror images; tell which are unsure."""
    maps, about, unsure = list[Correspondence](), list[dict[str, Any]](), list[str]()
    whole = shape_statistics.filled(cohort, cohort.area_weights, "remove")
    for i, name in enumerate(cohort.names):
        mesh = scan = whole.mesh(i)
        if scans and cohort.seen[i].all():
            try:
                scan = surface_as_written(scans, name)
            except FormatError as error:
                notes.append(f"{name} is matched in the topology of all, where maps go wrong alike: {error}")
        progress = to.part(i / len(cohort), (i + 1) / len(cohort)).tell
        marks = how["landmarks"]
        if marks is not None and scan is not mesh:
            marks = cKDTree(scan.vertices).query(mesh.vertices[marks])[1]
        result = shape_statistics.left_right_map(scan, progress=progress, **how | {"landmarks": marks})
        sides, expected = result.map, result.expected_error
        if scan is not mesh:
            places = nearest_on_surface(scan, mesh.vertices)
            sides = _onto(mesh, places.interpolated(sides.pull_back(scan.vertices)))
            expected = places.interpolated(expected[:, None])[:, 0]
        maps.append(sides)
        # The error of the symmetric shape, the mean of both sides, is half of the error of the map.
        map_error = float(np.sqrt(np.nansum(mesh.vertex_areas * (expected / 2) ** 2)))
        about.append({"outcome": result.outcome.value, "map_error": map_error})
        notes += [f"{name}: {note}" for note in result.notes if note.endswith("are left unmatched")]
        if not result.outcome.is_called_right:
            unsure.append(f"{name} ({result.outcome.value})")
    doubt = f"The maps from left to right are doubtful in {', '.join(unsure)}. {REMEDY}" if unsure else ""
    return maps, about, doubt


def _onto(mesh: Mesh, images: FloatArray) -> Correspondence:
    """Map rows to the nearest points of a mesh; rows of nan are unmatched."""
    is_matched = np.asarray(np.isfinite(images).all(axis=1))
    points = nearest_on_surface(mesh, np.where(is_matched[:, None], images, 0.0))
    nearest = Correspondence.of_points(points, mesh.n_vertices)
    return replace(nearest, vertices=np.where(is_matched, nearest.vertices, UNMATCHED))


def _known_share(both: CorrespondedShapes, weights: Weights) -> FloatArray:
    """Weigh each vertex by the share of shapes in which it is known on both sides."""
    m = len(both) // 2
    known = (both.seen[:m] & both.seen[m:]).mean(axis=0)
    share = both.area_weights if weights == "area" else np.full(both.n_vertices, 1 / both.n_vertices)
    if not share @ known > 0:
        raise InputError("no vertex or landmark is known on both sides of a shape; give more of them a place")
    return np.asarray(share * known / (share @ known))


def _lines_of_individuals(found: Asymmetry) -> list[dict[str, Any]]:
    """Make a line for each individual: its asymmetry, and its scores along principal components."""
    lines = []
    for individual in found.individuals:
        line = individual._asdict()
        for kind in ("symmetric", "asymmetric"):
            line |= {f"{kind}_{i}": score for i, score in enumerate(line.pop(f"{kind}_scores"), start=1)}
        lines.append(line)
    return lines


def _line(both: CorrespondedShapes, found: Asymmetry, i: int, size: float) -> dict[str, Any]:
    """Make the first cells of the line of shape i."""
    amount = float(found.amounts[i])
    first = {"name": both.names[i], "asymmetry": amount, "over_size": amount / size}
    return {**first, "fluctuating": float(found.fluctuating[i])}


def _size(found: Asymmetry, share: FloatArray) -> float:
    """Root mean square distance of the symmetric mean from its centroid."""
    return float(shape_statistics.centroid_sizes(found.symmetric[None], share)[0] / np.sqrt(len(share)))


# lines of a table, one for each shape, and captions of pictures
LinesAndCaptions = tuple[list[dict[str, Any]], dict[str, str]]


def _draw_landmarks(
    new: StatisticsFolder, both: CorrespondedShapes, paired: bool, share: FloatArray, found: Asymmetry
) -> LinesAndCaptions:
    """Draw the asymmetry of landmarks, and make a line for each specimen."""
    m, size, mean, common = len(both) // 2, _size(found, share), found.symmetric, found.directional
    fluctuation = np.sqrt(((found.components - common) ** 2).sum(axis=2).mean(axis=0))
    axes = {f"directional_{axis}": column for axis, column in zip("xyz", common.T.tolist())}
    new.table("landmarks.csv", landmark=both.marks, **axes, fluctuating=fluctuation.tolist())
    factor = DRAWN_DISPLACEMENT * size / (float(np.linalg.norm(common, axis=1).max()) or 1.0)
    shown = {f"asymmetry × {factor:.2g}": mean + factor * common}
    shape_statistics.draw_landmarks(new.picture("directional"), shown, mean, both.links)
    spread = fluctuation, "standard deviation, in units of the shapes"
    shape_statistics.draw_landmarks(new.picture("fluctuating"), {"": mean}, mean, both.links, *spread)
    lines = []
    for i, lengths in enumerate(np.linalg.norm(found.components, axis=2)):
        most = int(lengths.argmax())
        line = _line(both, found, i, size) | {"most": float(lengths[most]), "most_landmark": both.marks[most]}
        lines.append(line | {"left": both.names[m + i]} if paired else line)
    enlarged = f"{DIRECTIONAL_CAPTION} Enlarged; grey: the symmetric mean."
    return lines, {"directional": enlarged, "fluctuating": FLUCTUATING_CAPTION}


def _draw_meshes(
    new: StatisticsFolder,
    both: CorrespondedShapes,
    maps: list[Correspondence],
    share: FloatArray,
    found: Asymmetry,
    left_right: IntArray | None = None,
) -> LinesAndCaptions:
    """Draw the asymmetry of meshes, turned like the mean, in one scale; make a line for each."""
    m, lines, captions = len(both) // 2, list[dict[str, Any]](), dict[str, str]()
    known, size = both.seen[:m] & both.seen[m:], _size(found, share)
    mean = both.mesh(0).moved(found.symmetric)
    # normals of the mean, which are smoother than those of the shapes
    normals = mean.vertex_normals * (1.0 if mean.volume >= 0 else -1.0)
    outward = np.where(known, np.einsum("mij,ij->mi", found.components, normals), np.nan)
    planes = [shape_statistics.symmetry_plane(*shape, share) for shape in zip(both.vertices, maps)]
    sides = [_sides(normal, shape, left_right) for shape, (normal, _) in zip(both.vertices, planes)]
    centred = found.symmetric - found.symmetric.mean(axis=0)
    turns = [nearest_rotation((shape - shape.mean(axis=0)).T @ centred) for shape in both.vertices[:m]]
    views = [dict[str, FloatArray]()] * m
    for i, ((normal, _), names) in enumerate(zip(planes, sides)):
        to = normal @ turns[i]
        seen = list(zip(names, (to, -to)))
        views[i] = dict(seen if i == 0 or to @ next(iter(views[0].values())) > 0 else seen[::-1])
    if m > 1:
        known_outward = np.where(known.any(axis=0), np.nan_to_num(outward), np.nan)
        common, deviation = known_outward.mean(axis=0), known_outward.std(axis=0)
        new.mesh("mean.ply", mean, {"directional": common, "fluctuating": deviation}, common)
        draw_values(new.picture("directional"), mean, common, NORMAL_LABEL, views=views[0])
        label = "standard deviation, along the normal"
        draw_values(new.picture("fluctuating"), mean, deviation, label, views=views[0])
        captions |= {"directional": DIRECTIONAL_CAPTION, "fluctuating": FLUCTUATING_CAPTION}
    drawn = np.argsort(-found.amounts, kind="stable")[:N_DRAWN].tolist()
    high = float(np.nanquantile(np.abs(outward[drawn]), 0.995))
    for i in drawn:
        name, mesh = f"shapes/{both.names[i]}", both.mesh(i)
        mesh = mesh.moved(mesh.vertices @ turns[i])
        draw_values(new.picture(name), mesh, outward[i], NORMAL_LABEL, views=views[i], high=high)
        captions[name] = f"{both.names[i]}: where its sides differ{WRONG_MAP_CAPTION if planes else ''}."
    for i, signed in enumerate(outward):
        mesh, most = both.mesh(i), int(np.nanargmax(np.abs(signed)))
        length = np.where(known[i], np.linalg.norm(found.components[i], axis=1), np.nan)
        new.mesh(f"shapes/{both.names[i]}.ply", mesh, {"asymmetry": length, "along_normal": signed}, signed)
        along = float(np.sqrt(share @ np.nan_to_num(signed) ** 2))
        line = _line(both, found, i, size) | {"along_normal": along, "most": float(signed[most])}
        line["most_vertex"] = most
        if planes:
            normal, offset = planes[i]
            line["most_side"] = sides[i][0 if mesh.vertices[most] @ normal > offset else 1]
            line |= dict(zip(("plane_x", "plane_y", "plane_z", "plane_offset"), (*normal.tolist(), offset)))
        lines.append(line if planes else line | {"left": both.names[m + i]})
    return lines, captions


def _sides(normal: FloatArray, vertices: FloatArray, left_right: IntArray | None) -> tuple[str, str]:
    """Name the side that a normal points to, and the other: left and right if all pairs agree."""
    if left_right is not None:
        left, right = left_right[left_right[:, 0] != left_right[:, 1]].T
        along = (vertices[left] - vertices[right]) @ normal
        if len(along) and (along > 0).all():
            return "the left side", "the right side"
        if len(along) and (along < 0).all():
            return "the right side", "the left side"
    axis = "xyz"[int(np.abs(normal).argmax())]
    return f"the +{axis} side", f"the −{axis} side"


def _below_error(lines: list[dict[str, Any]]) -> tuple[str, list[dict[str, Any]]]:
    """Tell which shapes have no asymmetry above the error of their maps; also return the others."""
    below = [line for line in lines if line["asymmetry"] <= line.get("map_error", -np.inf)]
    if not below:
        return "", lines
    ranges = []
    for name in ("asymmetry", "map_error"):
        least, most = (f"{of(line[name] for line in below):.3g}" for of in (min, max))
        ranges.append(least if least == most else f"{least} to {most}")
    named = "" if len(below) == len(lines) else f" in {', '.join(line['name'] for line in below)}"
    sentence = f"no asymmetry is shown{named}: it is below the error of the maps from left to right"
    shown = [line for line in lines if line not in below]
    return f"{sentence} (asymmetry {ranges[0]}, error {ranges[1]})", shown


def _sentences(record: dict[str, Any]) -> list[str]:
    rows, n = record["anova"], record["n_individuals"]
    first, shown = _below_error(record["shapes"])
    found = [first] if first else []
    if rows:
        symmetric_share, directional_share, fluctuating_share = (f"{row['share']:.1%}" for row in rows[:3])
        found += [
            f"{n} individuals: {symmetric_share} of all variation is between them and symmetric, "
            f"{directional_share} is directional asymmetry, the same in all, and {fluctuating_share} fluctuating, "
            "each in its own way",
            f"fluctuating asymmetry has {rows[2]['f']:.3g} times the mean square of the error of measurement, "
            f"p = {rows[2]['p_value']:.4g}"
            if len(rows) > 3
            else "nothing was measured twice: errors of measurement and of maps are part of the fluctuating asymmetry",
            *([SAME_ERRORS_WARNING] if record["in_one_topology"] else []),
            f"{record['share']:.1%} of the asymmetry is directional, p = {record['p_value']:.4g} "
            f"({record['n_permutations']} ways of exchanging sides; the smallest possible p is {2.0 ** (1 - n):.4g})",
        ]
    if record["size_anova"]:
        sides = record["size_anova"][1]
        line = f"of the variation of sizes, {sides['share']:.1%} is directional, p = {sides['p_value']:.4g}"
        has_error = len(record["size_anova"]) > 3
        found.append(f"{line}, and {record['size_anova'][2]['share']:.1%} fluctuating" if has_error else line)
    if shown:
        found.append(_most_asymmetric(shown, bool(rows)))
    return [*found, *(f"note: {note}" for note in record["notes"])]


def _most_asymmetric(lines: list[dict[str, Any]], is_compared: bool) -> str:
    most = max(lines, key=lambda line: line["asymmetry"])
    away = f"{most['asymmetry']:.4g} away from a symmetric shape (root mean square), {most['over_size']:.2%} of its size"
    if "most_landmark" in most:
        return f"{most['name']} is {away}, most at landmark {most['most_landmark']}, by {most['most']:.4g}"
    outward = "stands out" if most["most"] > 0 else "lies deeper"
    where = f"on {most['most_side']}, which" if "most_side" in most else f"where {most['name']}"
    return (
        f"{most['name']}{', the most asymmetric,' if is_compared else ''} is {away}, and {most['along_normal']:.4g} "
        f"along the normal, most at vertex {most['most_vertex']}, {where} {outward} by {abs(most['most']):.4g}"
    )
