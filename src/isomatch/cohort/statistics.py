"""The statistics of the shapes of a folder: mean, modes, groups, sizes, distances, and motion of a series."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal
from unicodedata import normalize

import numpy as np

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import FormatError, InputError, IsomatchError
from isomatch._core.skipped import noted
from isomatch._core.stage_timer import Progress
from isomatch._core.tables import NO_TEXT, read_csv, read_table
from isomatch.cohort import shape_statistics
from isomatch.cohort.collection import Collection
from isomatch.cohort.map_file import require_unchanged
from isomatch.cohort.plan import Layout
from isomatch.cohort.shape_statistics import MEASURED, CorrespondedShapes, Doubt, ShapeModel
from isomatch.cohort.statistics_folder import VERSION, Results, StatisticsFolder
from isomatch.cohort.workers import Listener, Warn
from isomatch.correspondence import Correspondence
from isomatch.io import FORMATS, Asset, Attribute, holds_values, read_asset, read_attributes, write_asset
from isomatch.surfaces import Mesh

Scale = Literal["keep", "remove"]
Weights = Literal["area", "uniform"]
Method = Literal["permutation", "parametric"]
TRUSTED = {"CONVERGED", "PARTIAL"}  # outcomes of maps that are not in doubt


def statistics(
    folder: str | Path,
    output: str | Path,
    *,
    scale: Scale = "keep",
    weights: Weights = "area",
    modes: int = 3,
    groups: Path | None = None,
    test: Method = "permutation",
    mirror: str | None = None,
    align: Literal["subject", "structure"] = "subject",
    hide: str | None = None,
    pictures: shape_statistics.PictureFormat = "png",
    seed: int = 0,
    force: bool = False,
    progress: Progress | None = None,
    warn: Warn | None = None,
) -> Results:
    """Compute the mean, the modes of variation and the distances of shapes in one topology, and write them to a folder.

    Parameters
    ----------
    folder : path_like
        Folder of meshes with the same faces, or of a collection.
    output : path_like
        Folder for mean, modes, model.npz, scores, variances, distances, pictures, and files for other tools.
    scale, weights, modes, groups, test, mirror, align, hide, pictures, seed, force
        As the options of ``isomatch statistics``.
    progress, warn : callable, optional
        Called with each step and the share that is done; and with shapes to look at first, which by default are logged.

    Returns
    -------
    Results
        The model, and the record of all numbers.

    Raises
    ------
    FormatError, MeshError, InputError
        If shapes or groups cannot be read, do not correspond, or are too few.
    """
    folder, to = Path(folder), Listener.of(progress, warn)
    into = StatisticsFolder(Path(output), pictures)
    with into.claimed(force) as new:
        to.tell("reading", 0.0)
        shapes, labels, doubts, notes = read_specimens(folder, groups)
        for line in told_doubts(doubts):
            to.warn(line)
        to.tell("model", 0.1)
        if mirror is not None:
            shapes, note = _mirrored(shapes, mirror, scale, weights, seed)
            notes += note
        share = shapes.area_weights if weights == "area" else None
        shapes = shape_statistics.filled(shapes, share, scale)
        missing = _missing(shapes)
        if (hide or align == "structure") and (mirror is not None or not shapes.structures):
            use = "subjects of several surfaces, without --mirror"
            raise InputError(f"--hide and --align structure are for {use}")
        hidden = shape_statistics.hidden_structures(shapes, hide.split(","), weights, scale) if hide else []
        poses = shape_statistics.aligned_structures(shapes, weights, scale) if shapes.structures else None
        shapes = poses.shapes if poses and align == "structure" else shapes
        lack = "of the vertices were not measured, and count as the mean of the others"
        notes += [f"{name}: {lacks:.1%} {lack}" for name, lacks in missing.items()]
        model = ShapeModel.fit(shapes, scale, weights)
        tested, of_groups = _tested(model, shapes, labels, test, seed) if groups else (None, None)
        groups_of = [labels.get(name, "") for name in model.names] if groups else None
        own = shapes if mirror is None else _first_half(shapes)
        sizes = shape_statistics.centroid_sizes(own.vertices, share)
        allometry, why_not = _allometry(own, sizes, share, seed)
        notes += why_not
        unlabelled = [name for name in own.names if groups and name not in labels]
        if unlabelled:
            notes.append(noted(f"without a group: {', '.join(unlabelled)}"))
        done = iter(range(len(shapes)))
        geodesic = shape_statistics.geodesic_distortions(
            shapes,
            progress=lambda name: to.tell(f"distances of {name}", 0.3 + 0.3 * next(done) / len(shapes)),
        )
        procrustes = shape_statistics.procrustes_distances(shapes.vertices, share, scale)
        to.tell("writing", 0.6)
        new.model(model, shapes, modes, groups_of)
        new.sizes(own, sizes, allometry, groups_of and groups_of[: len(own)])
        new.quality(model, seed)
        structures = new.structures(model, poses, hidden) if poses else []
        if tested:
            new.groups(model.mesh(), tested)
        new.distances(shapes, geodesic, procrustes, groups_of)
        notes += new.exports(shapes, model)
        record = {
            "isomatch": VERSION,
            "folder": str(folder),
            "shapes": list(model.names),
            "left_out": list(shapes.left_out),
            "missing": missing,
            "scale": scale,
            "weights": weights,
            "mirror": mirror,
            "align": align,
            "structures": structures,
            "seed": seed,
            "n_modes": model.n_modes,
            "total_variance": float(model.variances.sum()),
            "shares": model.variance_ratios.tolist(),
            "allometry": _of_test(allometry) if allometry else None,
            "groups": of_groups,
            "doubts": [{**doubt._asdict(), "names": list(doubt.names)} for doubt in doubts],
            "notes": notes,
        }
        told = _told_of(record)
        new.model_page(into.folder.resolve().name, record, told)
        new.finish(record)
        to.tell("done", 1.0)
    return Results(into.folder, into.written, record, told, model=model)


def _mirrored(
    shapes: CorrespondedShapes, mirror: str, scale: Scale, weights: Weights, seed: int
) -> tuple[CorrespondedShapes, list[str]]:
    """Add the mirror images by a left–right map, found or read; note of which shape it is, if not of the mean."""
    if mirror != "auto":
        given = Correspondence.load(Path(mirror), shapes.n_vertices)
        return shapes.mirrored([given] * len(shapes)), []
    mean = ShapeModel.fit(shapes, scale, weights).mesh()
    left_right, of = shape_statistics.left_right_of_shapes(shapes, mean, seed=seed)
    note = f"left and right are told by {of}, since the left–right map of the mean is not certain"
    return shapes.mirrored([left_right] * len(shapes)), [note] if of else []


def _tested(
    model: ShapeModel, shapes: CorrespondedShapes, labels: dict[str, str], method: Method, seed: int
) -> tuple[shape_statistics.GroupTest, dict[str, Any]]:
    """Test where two groups differ, and whether they do as a whole; with plain values about it."""
    rows = [i for i, name in enumerate(model.names) if name in labels]
    listed = [labels[model.names[i]] for i in rows]
    own = None if shapes.measured is None else shapes.measured[rows]
    test = shape_statistics.group_test(model.aligned[rows], listed, method=method, seed=seed, measured=own)
    is_second = np.array([group == test.groups[1] for group in listed], dtype=np.float64)
    whole = shape_statistics.shape_regression(model.aligned[rows], is_second, model.weights, seed=seed)
    return test, {
        **_of_test(whole),
        "names": list(test.groups),
        "counts": list(test.counts),
        "test": method,
        "significant_share_of_area": float(model.weights[test.significant()].sum()),
        "least_p_value": float(test.p_values.min()),
        "least_q_value": float(test.q_values.min()),
    }


def _first_half(shapes: CorrespondedShapes) -> CorrespondedShapes:
    """Return shapes without their mirror images, which are no further specimens."""
    m = len(shapes) // 2
    measured = None if shapes.measured is None else shapes.measured[:m]
    return replace(shapes, names=shapes.names[:m], vertices=shapes.vertices[:m], measured=measured)


def _allometry(
    shapes: CorrespondedShapes, sizes: FloatArray, weights: FloatArray | None, seed: int
) -> tuple[shape_statistics.ShapeRegression | None, list[str]]:
    """Regress shape, without size, on the logarithm of size; or say why not."""
    try:
        aligned = shape_statistics.generalised_procrustes(shapes.vertices, weights, "remove").aligned
        return shape_statistics.shape_regression(aligned, np.log(sizes), weights, seed=seed), []
    except IsomatchError as error:
        return None, [f"shape was not regressed on size: {error}"]


def _of_test(test: shape_statistics.ShapeRegression) -> dict[str, Any]:
    return {name: getattr(test, name) for name in ("r_squared", "p_value", "n_permutations", "seed")}


def _missing(shapes: CorrespondedShapes) -> dict[str, float]:
    """Share of the vertices that each shape lacks, of those that lack any."""
    if shapes.measured is None:
        return {}
    lacks = (~shapes.measured).mean(axis=1).tolist()
    return {name: share for name, share in zip(shapes.names, lacks) if share}


def _told(test: dict[str, Any]) -> str:
    drawn = f"{test['n_permutations']} permutations, seed {test['seed']}"
    return f"{test['r_squared']:.1%} of the variance of shape, p = {test['p_value']:.4g} ({drawn})"


def _told_of(record: dict[str, Any]) -> list[str]:
    lines = list[str]()
    for own in record["structures"]:
        line = f"{own['structure']} has {own['share']:.1%} of the variance; of its own {own['pose_share']:.1%} is pose"
        if own["hidden_error"] is not None:
            line += f"; hidden, it is completed to {own['hidden_error']:.4g}, the mean to {own['hidden_mean_error']:.4g}"
        lines.append(line)
    if tested := record["groups"]:
        first, second = (f"{name} ({count})" for name, count in zip(tested["names"], tested["counts"]))
        share = tested["significant_share_of_area"]
        none = "do not differ significantly at any vertex"
        differ = f"differ on {share:.1%} of the area" if share else none
        lines.append(f"{first} and {second} {differ}, at a false discovery rate of 5 %")
        lines.append(f"the groups describe {_told(tested)}")
    if record["allometry"]:
        lines.append(f"size describes {_told(record['allometry'])}")
    return [*lines, *(f"note: {note}" for note in record["notes"])]


Specimens = tuple[CorrespondedShapes, dict[str, str], list[Doubt], list[str]]
"""Shapes of a folder, the groups of those that have one, doubts, and notes."""


def read_specimens(folder: Path, groups: Path | None) -> Specimens:
    """Read the shapes of a folder of meshes or of a collection, or one mesh, with their groups."""
    require_unchanged(Layout(folder), ["corresponded"])
    shapes = shape_statistics.read_shapes([folder] if folder.is_file() else folder)
    labels = read_groups(groups, shapes.names, shapes.left_out) if groups else {}
    doubts = shape_statistics.doubtful_shapes(shapes)
    notes = [noted(f"left out: {reason}") for reason in shapes.left_out]
    for own in (folder / structure for structure in shapes.structures or ("",)):
        told = _doubts(own / "pairs.csv", shapes.names) + _reflected(own / "shapes.csv", shapes.names)
        notes += [f"{own.name}: {note}" if shapes.structures else note for note in told]
    return shapes, labels, list(doubts), notes


def told_doubts(doubts: Iterable[Doubt]) -> list[str]:
    """Put doubts in words."""
    return [f"{' and '.join(doubt.names)} {doubt.reason}" for doubt in doubts]


def _doubts(pairs: Path, names: tuple[str, ...]) -> list[str]:
    """Say which shapes of a collection rest on a map that may be wrong."""
    if not pairs.is_file():
        return []
    outcomes: dict[str, set[str]] = {name: set() for name in names}
    for row in read_csv(pairs):
        for end in ("source", "target"):
            outcomes.get(row.get(end) or "", set()).add(row.get("outcome") or "FAILED")
    doubtful = {name: ", ".join(sorted(own)) for name, own in outcomes.items() if own and not own & TRUSTED}
    return [f"{name} may be matched wrongly: {doubts}" for name, doubts in doubtful.items()]


def _reflected(table: Path, names: tuple[str, ...]) -> list[str]:
    """Say which shapes of a collection are mirror images of those in their files."""
    lines = read_csv(table) if table.is_file() else []
    turned = [name for line in lines if line.get("reflected") and (name := line.get("name")) in names]
    return [f"mirror images of the surfaces in their files: {', '.join(turned)}"] if turned else []


def read_groups(path: Path, names: Iterable[str], left_out: Sequence[str] = ()) -> dict[str, str]:
    """Read the group of each shape from a table, as spreadsheets and R write them; none of those without a value."""
    # Columns name and group, among others, or these two without a header; names may be those of files. Rows of shapes
    # that were left out, with reasons, are passed over.
    names_of = {normalize("NFC", name): name for name in names}
    spared = [name for name in (*names_of, *names_of.values()) if name.startswith("#")]
    table = read_table(path, spared)
    titled = table.titled({"name", "group"})
    named = titled.column("name", *[""] * (titled.titles[:1] == ("",)))  # or the names of rows, of R
    at = titled.column("group")
    i, j = (0, 1) if named is None or at is None else (named, at)
    table = table if named is None or at is None else titled
    labels: dict[str, str] = {}
    for row in table.filled:
        if len(row.cells) <= max(i, j) or (not table.titles and any(row.cells[2:])):
            table.refuse(
                row, "is not a shape and its group; write name,group, or a header with these columns"
            )
        where = f"{path}:{row.line}"
        name, group = row.cells[i], "" if row.cells[j].lower() in NO_TEXT else row.cells[j]
        shape = names_of.get(normalize("NFC", name)) or names_of.get(normalize("NFC", _stem(name)))
        if shape is None:
            if any(reason.startswith(f"{each}: ") for reason in left_out for each in (name, _stem(name))):
                continue
            raise FormatError(f"{where}: no shape is named {name!r}; shapes are named like their files")
        if labels.setdefault(shape, group) != group:
            both = f"in group {group!r} and in {labels[shape]!r}"
            raise FormatError(f"{where}: {name!r} is {both}; give each shape one group")
    return {name: group for name, group in labels.items() if group}


def _stem(name: str) -> str:
    """Name of a shape from that of its file."""
    last = name.replace("\\", "/").rpartition("/")[2]
    suffix = Path(last).suffix
    return last.removesuffix(suffix) if suffix.lower() in FORMATS else last


def series(
    folder: str | Path,
    output: str | Path,
    *,
    regions: Path | None = None,
    reference: str | None = None,
    force: bool = False,
    progress: Progress | None = None,
    warn: Warn | None = None,
) -> Results:
    """Tell how a series of shapes in one topology moves: area, volume, thickness and strain over time, by region.

    Parameters
    ----------
    folder : path_like
        Folder of meshes with the same faces, frame2 before frame10; or of a collection.
    output : path_like
        Folder for time.csv, time.png, and strain/NAME.vtp, each shape with the measures of its faces.
    regions, reference, force
        As the options of ``isomatch statistics time``.
    progress, warn : callable, optional
        Called with each step and the share that is done; and with shapes that are left out, which by default are logged.

    Returns
    -------
    Results
        The names of the shapes, the reference, and notes.

    Raises
    ------
    InputError
        If there are fewer than two shapes in one topology, or the reference is none of them.
    """
    folder, to = Path(folder), Listener.of(progress, warn)
    into = StatisticsFolder(Path(output), last="time.json")
    with into.claimed(force) as new:
        require_unchanged(Layout(folder), ["corresponded"])
        shapes = shape_statistics.read_shapes(folder)
        meshes = {name: shapes.mesh(i) for i, name in enumerate(shapes.names)}
        is_collection = Layout(folder).plan.exists()
        order = Collection.open(folder).names if is_collection else shapes.names
        names = [name for name in order if name in meshes]
        notes = [f"left out: {reason}" for reason in shapes.left_out]
        notes += [f"missing: {name}; see shapes.csv" for name in order if name not in meshes]
        notes += told_doubts(
            doubt for doubt in shape_statistics.doubtful_shapes(shapes) if doubt.kind == "units"
        )
        for note in notes:
            to.warn(note)
        if len(names) < 2:
            raise InputError(f"{folder}: a series has two shapes or more in one topology, not {len(names)}")
        first = names[0] if reference is None else reference
        if first not in meshes:
            raise InputError(f"--reference {first}: no such shape; they are {', '.join(names)}")
        labels = _labels(regions, meshes[first]) if regions else []
        rows = []
        for i, name in enumerate(names):
            to.tell(f"measuring {name}", i / len(names))
            motion = shape_statistics.face_motion(meshes[name], meshes[first])
            values = [Attribute(key, "face", "scalar", of) for key, of in motion.items()]
            write_asset(new.path(f"strain/{name}.vtp"), Asset.of_mesh(meshes[name], values))
            by_region = shape_statistics.motion_by_region(meshes[name], meshes[first], motion, labels)
            rows += [{"name": name, **row} for row in by_region]
        if np.isnan(rows[0]["volume"]):
            notes.append("no volume and thickness, as the surface is not closed")
        new.table("time.csv", **{key: [row[key] for row in rows] for key in rows[0]})
        shape_statistics.draw_motion(new.picture("time"), rows)
        about = {"isomatch": VERSION, "folder": str(folder), "reference": first}
        record = {**about, "shapes": names, "notes": notes}
        new.finish(record)
    told = f"{len(names)} shapes of {shapes.n_vertices:,} vertices; strain is relative to {first}"
    return Results(into.folder, into.written, record, [told])


def _labels(path: Path, mesh: Mesh) -> list[str]:
    """Read the name of the region of each vertex, "" for none."""
    found = read_attributes(path, Asset.of_mesh(mesh)) if holds_values(path) else read_asset(path).attributes
    labels = [at for at in found if at.domain == "point" and at.name != MEASURED and at.seems_labels]
    if len(labels) != 1 or len(labels[0]) != mesh.n_vertices:
        raise InputError(f"{path}: give one label for each of the {mesh.n_vertices} vertices, and no others")
    codes = np.nan_to_num(labels[0].plain, nan=-1).astype(int).tolist()
    return ["" if code < 0 else labels[0].coded.names.get(code, str(code)) for code in codes]
