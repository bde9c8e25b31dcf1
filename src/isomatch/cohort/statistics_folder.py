"""The folder of a study of shapes: meshes, tables, pictures, files of other tools, and a page."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from html import escape
from importlib.metadata import version
from itertools import accumulate, groupby
from pathlib import Path
from posixpath import basename, dirname
from typing import Any
from urllib.parse import quote

import numpy as np

from isomatch import visualization
from isomatch._core.arrays import FloatArray
from isomatch._core.errors import MissingDependencyError
from isomatch._core.files import claimed, made_folder, staged, write_text
from isomatch._core.texts import json_text, write_csv
from isomatch.cohort import shape_statistics
from isomatch.cohort.mode_view import mode_view
from isomatch.cohort.shape_statistics import (
    Classification,
    CorrespondedShapes,
    GroupTest,
    ScoredShape,
    ShapeAnova,
    ShapeModel,
    ShapeRegression,
)
from isomatch.cohort.specimen_page import template_of, text_of
from isomatch.cohort.study_page import LOCAL_SOURCES
from isomatch.io import Asset, Attribute, write_asset, write_mesh
from isomatch.surfaces import Mesh

VERSION = version("isomatch")  # version of isomatch that results record
MODE_DEVIATIONS = 2  # standard deviations by which the files of modes move the mean; chosen
LINKED_SUFFIXES = ".csv", ".npz", ".h5", ".ply", ".vtp"  # suffixes of the files that a page links
Groups = list[str] | None  # the group of each shape
GREY_LEVEL = 0.6  # red, green and blue, from 0 to 1, of vertices without a value; chosen
GEODESIC_LABEL = "difference of geodesic distances, in √area"  # label of charts of geodesic distances


@dataclass(frozen=True)
class StatisticsFolder:
    """The folder for statistics of shapes; ``written`` collects its files, ``last`` lists them."""

    folder: Path
    pictures: shape_statistics.PictureFormat = "png"
    last: str = "statistics.json"
    written: list[str] = field(default_factory=list)

    @contextmanager
    def claimed(self, force: bool) -> Iterator[StatisticsFolder]:
        """Claim a folder, whose files replace those of an earlier result when all are written."""
        record = self.folder / self.last
        with (
            made_folder(self.folder),
            claimed(record, [] if force else [record]),
            staged(self.folder, self.last, _files_of(record)) as new,
        ):
            yield replace(self, folder=new)

    def path(self, name: str) -> Path:
        """Return the path of a file that is about to be written."""
        self.written.append(name)
        path = self.folder / name
        path.parent.mkdir(exist_ok=True)
        return path

    def picture(self, name: str) -> Path:
        """Return the path of a picture that is about to be written."""
        return self.path(f"{name}.{self.pictures}")

    def table(self, file: str, /, **columns: Iterable[object]) -> None:
        """Write columns as CSV."""
        rows = [dict(zip(columns, row)) for row in zip(*columns.values())]
        write_csv(self.path(file), rows, list(columns))

    def mesh(
        self, name: str, mesh: Mesh, values: Mapping[str, FloatArray], shown: FloatArray, highest: float = 0.0
    ) -> None:
        """Write a mesh with values at its vertices; one colours it, from 0 or on both sides."""
        high = highest or float(np.nanquantile(np.abs(shown), 0.995)) or 1.0
        name_of, low = ("RdBu_r", -high) if (shown < 0).any() else ("viridis", 0.0)
        paint = visualization.colour_scale(name_of, low, high)
        rgb = np.nan_to_num(paint(shown[:, None]), nan=GREY_LEVEL)
        attributes = [Attribute(measure, "point", "scalar", numbers) for measure, numbers in values.items()]
        colours = Attribute("color", "point", "colour", np.round(255 * rgb).astype(np.uint8))
        write_asset(self.path(name), Asset.of_mesh(mesh, [*attributes, colours]), binary=True)

    def model(self, model: ShapeModel, shapes: CorrespondedShapes, n_modes: int, groups: Groups) -> None:
        """Write the model: meshes, scores, variances and the picture of the modes."""
        model.save(self.path("model.npz"))
        scores = np.diag(MODE_DEVIATIONS * model.deviations)[: min(n_modes, model.n_modes)]
        moved = {
            f"mode_{i}_{word}{MODE_DEVIATIONS}sd": model.vertices(sign * score)
            for i, score in enumerate(scores, start=1)
            for sign, word in ((-1, "minus"), (1, "plus"))
        }
        self.shapes("modes", shapes, {"mean": model.mean, **moved})
        if not len(shapes.faces):
            ratios = enumerate(model.variance_ratios, 1)
            ends = (f"mode {i} ({ratio:.1%}), {sign}2 sd" for i, ratio in ratios for sign in "−+")
            shown = dict(zip(ends, moved.values())) or {"mean; the shapes do not differ": model.mean}
            shape_statistics.draw_landmarks(self.picture("modes"), shown, model.mean, shapes.links)
        self.table("scores.csv", name=model.names, **_by_mode(model.scores))
        so_far = shape_statistics.compactness(model)[1:]
        if model.n_modes:
            shape_statistics.draw_scores(self.picture("scores"), model, groups)
            shares = {"share": model.variance_ratios.tolist(), "share_so_far": so_far.tolist()}
            numbers = range(1, model.n_modes + 1)
            self.table("variance.csv", mode=numbers, variance=model.variances.tolist(), **shares)
        variances = shape_statistics.measured_variances(model.aligned, shapes)
        deviations = np.sqrt(variances)
        values = {"variance": variances, "standard_deviation": deviations}
        if shapes.measured is not None:
            values["measured"] = shapes.measured.sum(axis=0).astype(np.float64)
        label = "standard deviation, in units of the shapes"
        self.values("variance", shapes, model.mean, values, deviations, label)

    def shapes(self, file: str, like: CorrespondedShapes, shown: Mapping[str, FloatArray]) -> None:
        """Write shapes (n, d) by name: meshes, or a table of landmarks for `read_specimens`."""
        if len(like.faces):
            for name, vertices in shown.items():
                write_mesh(self.path(f"{name}.ply"), like.mesh(0).moved(vertices), binary=True)
            return
        heads = [f"{mark}_{axis}" for mark in like.marks for axis in "XYZ"[: like.vertices.shape[2]]]
        columns = np.array([vertices.ravel() for vertices in shown.values()]).T.tolist()
        self.table(f"{file}.csv", specimen=[*shown], **dict(zip(heads, columns)))

    def values(
        self,
        file: str,
        like: CorrespondedShapes,
        at: FloatArray,
        values: Mapping[str, FloatArray],
        shown: FloatArray,
        label: str,
        highest: float = 0.0,
    ) -> None:
        """Write values at vertices or landmarks, and draw one of them, which may be nan."""
        if len(like.faces):
            mesh = like.mesh(0).moved(at)
            self.mesh(f"{file}.ply", mesh, values, shown, highest)
            shape_statistics.draw_values(self.picture(file), mesh, shown, label)
        else:
            columns = {name: array.tolist() for name, array in values.items()}
            self.table(f"{file}_landmarks.csv", landmark=like.marks, **columns)
            shape_statistics.draw_landmarks(self.picture(file), {"": at}, at, like.links, shown, label)

    def quality(self, model: ShapeModel, seed: int) -> None:
        """Write compactness, generalisation and specificity."""
        compact = shape_statistics.compactness(model)
        general = shape_statistics.generalisation(model, seed=seed)
        specific = shape_statistics.specificity(model, seed=seed)
        columns = {"compactness": compact}
        for name, curve in {"generalisation": general, "specificity": specific}.items():
            columns |= {name: curve.mean, f"{name}_standard_error": curve.standard_error}
        every = range(len(compact))
        listed = {name: [float(of[j]) if j < len(of) else "" for j in every] for name, of in columns.items()}
        self.table("quality.csv", modes=every, **listed)
        shape_statistics.draw_quality(self.picture("quality"), compact, general, specific)

    def sizes(
        self, shapes: CorrespondedShapes, sizes: FloatArray, allometry: ShapeRegression | None, groups: Groups
    ) -> None:
        """Write the sizes of the shapes, and how shape depends on them."""
        logarithms = np.log(sizes)
        self.table(
            "sizes.csv",
            name=shapes.names,
            centroid_size=sizes.tolist(),
            log_centroid_size=logarithms.tolist(),
            **({"area": [shapes.mesh(i).area for i in range(len(shapes))]} if len(shapes.faces) else {}),
            **({"regression_score": allometry.scores[:, 0].tolist()} if allometry else {}),
        )
        if allometry is None:
            return
        label = "logarithm of the centroid size"
        path = self.picture("allometry")
        shape_statistics.draw_regression(path, allometry, logarithms, shapes.names, label, groups)
        ends = {"allometry_smallest": logarithms.min(), "allometry_largest": logarithms.max()}
        away = {name: (end - logarithms.mean()) * allometry.coefficients[0] for name, end in ends.items()}
        self.shapes("allometry", shapes, {name: allometry.mean + change for name, change in away.items()})

    def structures(
        self, model: ShapeModel, poses: shape_statistics.StructurePoses, hidden: list[dict[str, Any]]
    ) -> list[dict[str, Any]]:
        """Write shares, poses and errors of the structures of subjects; return a line for each."""
        lines = []
        for (name, shares), pose_share in zip(model.structure_shares.items(), poses.shares.tolist()):
            share = float(shares @ model.variance_ratios)
            line = {"structure": name, "share": share, "pose_share": pose_share}
            error_rows = [[row["error"], row["mean_error"]] for row in hidden if row["structure"] == name]
            errors = np.mean(error_rows, axis=0).tolist() if error_rows else (None, None)
            lines.append({**line, **dict(zip(("hidden_error", "hidden_mean_error"), errors))})
        columns = {column: [line[column] for line in lines] for column in lines[0]}
        self.table("structures.csv", **columns, **_by_mode(np.array([*model.structure_shares.values()])))
        numbers = np.concatenate([np.degrees(poses.rotations), poses.translations], axis=2).reshape(-1, 6)
        named = list(zip(*((name, structure) for name in model.names for structure in model.structures)))
        axes = dict(zip(("degrees_x", "degrees_y", "degrees_z", "x", "y", "z"), numbers.T.tolist()))
        self.table("poses.csv", name=named[0], structure=named[1], **axes)
        if hidden:
            write_csv(self.path("hidden.csv"), hidden, list(hidden[0]))
        return lines

    def distances(
        self, shapes: CorrespondedShapes, geodesic: FloatArray | None, procrustes: FloatArray, groups: Groups
    ) -> None:
        """Write distances between shapes, their tree and places: geodesic ones if there are any."""
        for name, distances in (("distances.csv", geodesic), ("procrustes_distances.csv", procrustes)):
            if distances is not None:
                self.table(name, name=shapes.names, **dict(zip(shapes.names, distances.T.tolist())))
        label = GEODESIC_LABEL if geodesic is not None else "Procrustes distance, in units of the shapes"
        geodesic = procrustes if geodesic is None else geodesic
        points = shape_statistics.classical_scaling(geodesic)
        x, y = points.T.tolist()
        self.table("embedding.csv", name=shapes.names, x=x, y=y)
        shape_statistics.draw_embedding(self.picture("embedding"), points, shapes.names, label, groups)
        if len(shapes) > 1:
            shape_statistics.draw_tree(self.picture("dendrogram"), geodesic, shapes.names, label)

    def linear(
        self,
        anova: ShapeAnova | None,
        classes: Classification | None,
        classified: Sequence[str],
        labels: Mapping[str, str],
    ) -> dict[str, str]:
        """Write the tests of a model and classes of shapes; return sections of the page."""
        sections = {}
        tables = (("anova", "The terms of the model", "rows"), ("pairs", "Groups in pairs", "pairs"))
        for file, title, field_of in tables if anova else ():
            if rows := [row._asdict() for row in getattr(anova, field_of)]:
                write_csv(self.path(f"{file}.csv"), rows, [*rows[0]])
                sections[title] = tabulated([*rows[0]], (row.values() for row in rows))
        if classes:
            groups = [labels[name] for name in classified]
            numbered = enumerate(classes.variates.T.tolist(), start=1)
            variates = {f"variate_{i}": column for i, column in numbered}
            columns = {"name": classified, "group": groups, "predicted": classes.predicted}
            self.table("classification.csv", **columns, **variates)
            across = np.column_stack([classes.variates, np.zeros(len(groups))])[:, :2]
            label = f"canonical variates of {classes.n_modes} modes, in standard deviations within groups"
            shape_statistics.draw_embedding(self.picture("canonical"), across, classified, label, groups)
            counts = ([name, *row] for name, row in zip(classes.groups, classes.counts.tolist()))
            sections["Groups, and those that the others predict"] = tabulated(["", *classes.groups], counts)
        return sections

    def groups(self, like: CorrespondedShapes, model: ShapeModel, test: GroupTest) -> None:
        """Write the test of two groups."""
        length = np.linalg.norm(test.difference, axis=1)
        values = {"p_value": test.p_values, "q_value": test.q_values, "difference": length}
        shown = np.where(test.significant(), length, np.nan)
        somewhere = bool(test.significant().any())
        label, highest = "no difference is significant", 1.0
        if somewhere:
            label, highest = "distance of the group means; grey: not significant", float(np.nanmax(shown))
        self.values("groups", like, model.mean, values, shown, label, highest)
        columns = np.column_stack([test.t_squared, test.p_values, test.q_values, test.difference]).T.tolist()
        names = ("t_squared", "p_value", "q_value", "dx", "dy", "dz")
        point = {"vertex" if len(like.faces) else "landmark": like.marks}
        self.table("groups.csv", **point, **dict(zip(names, columns)))

    def scored(
        self, model: ShapeModel, scored: Mapping[str, ScoredShape], lines: Sequence[Mapping[str, Any]]
    ) -> None:
        """Write how, and where, shapes that are no part of the model differ from it."""
        columns = {column: [line[column] for line in lines] for column in lines[0]} if lines else {}
        columns |= _by_mode(np.array([shape.scores for shape in scored.values()]))
        self.table("scored.csv", **columns)
        errors = {name: shape.vertex_errors for name, shape in scored.items()}
        highest = max((float(np.nanquantile(values, 0.995)) for values in errors.values()), default=0.0)
        for name, shape in scored.items():
            distances = np.linalg.norm(shape.aligned - model.mean, axis=1)
            values = {"residual": errors[name], "distance_from_mean": distances}
            self.mesh(f"scored/{name}.ply", model.mesh().moved(shape.aligned), values, errors[name], highest)

    def exports(self, shapes: CorrespondedShapes, model: ShapeModel) -> list[str]:
        """Write aligned meshes, files of ShapeWorks and Scalismo; return what failed, and why."""
        aligned, inside = model.aligned, "aligned/" if len(shapes.faces) else ""
        self.shapes("aligned", shapes, {inside + name: x for name, x in zip(model.names, aligned)})
        if not inside:
            return []
        inner = self.path("shapeworks/project.swproj").parent
        shape_statistics.write_shapeworks(inner, shapes, aligned)
        endings = (".ply", "_local.particles", "_world.particles")
        self.written.extend(f"shapeworks/{name}{ending}" for name in shapes.names for ending in endings)
        if not model.n_modes:
            return ["model.h5 is not written: the shapes do not differ"]
        try:
            shape_statistics.write_statismo(self.folder / "model.h5", model)
        except MissingDependencyError as error:
            return [f"model.h5 for Scalismo is not written: {error}"]
        self.written.append("model.h5")
        return []

    def model_page(
        self,
        folder: str,
        model: ShapeModel,
        record: Mapping[str, Any],
        sentences: Sequence[str],
        more: Mapping[str, str],
    ) -> None:
        """Write the page with all pictures of a model, its modes in 3D, and what the command tells."""
        doubts = [f"{' and '.join(doubt['names'])} {doubt['reason']}" for doubt in record["doubts"]]
        n, scale, weights = len(record["shapes"]), SCALINGS[record["scale"]], WEIGHTINGS[record["weights"]]
        counted = f"{n} shapes" if record["mirror"] is None else f"{n // 2} shapes and their mirror images"
        modes = enumerate(zip(record["shares"][:10], accumulate(record["shares"])), 1)
        rows = [(str(i), f"{x:.1%}", f"{y:.1%}") for i, (x, y) in modes]
        scale += ", and projected on the tangent space" * record["tangent"]
        settings = f"{scale}; {weights}. Seed {record['seed']}, isomatch {record['isomatch']}."
        sections = {"To look at first": listed(doubts), "What was found": listed(sentences)}
        view, scripts = mode_view(model, record["modes"]) if len(model.faces) else ("", "")
        sections |= {**more, "Modes": view + tabulated(("mode", "share of the variance", "so far"), rows)}
        self.page(f"Statistics of {counted}", folder, settings, sections, PICTURE_CAPTIONS, scripts)

    def page(
        self,
        title: str,
        folder: str,
        settings: str,
        sections: Mapping[str, str],
        words: Mapping[str, str],
        scripts: str = "",
    ) -> None:
        """Write the page: sections that are not empty, with headings, pictures with words, and files."""
        ending = f".{self.pictures}"
        drawn = [name.removesuffix(ending) for name in self.written if name.endswith(ending)]
        body = template_of("statistics_folder.html").substitute(
            title=escape(title),
            settings=escape(settings),
            sections="".join(f"<h2>{escape(name)}</h2>\n{html}\n" for name, html in sections.items() if html),
            figures="".join(_figure(name + ending, words[name]) for name in words if name in drawn),
            files=_link_files(self.written),
            scripts=scripts,
        )
        style = text_of("cohort.css")
        page = visualization.html_page(f"{title}, {folder}", body, style=style, images=LOCAL_SOURCES)
        write_text(self.path("index.html"), page)

    def finish(self, record: Mapping[str, object]) -> None:
        """Write the record last: where it exists, the other files are complete."""
        write_text(self.folder / self.last, json_text({**record, "files": self.written}))


@dataclass(frozen=True)
class Results:
    """What a study has written."""

    folder: Path
    files: list[str]  #: names of the files that were written
    record: Mapping[str, Any]  #: settings and results in plain values, as in the file that is written last
    findings: list[str] = field(default_factory=list)  #: what was found, one sentence each
    model: ShapeModel | None = None  #: mean and modes of variation, of `statistics`
    unsure: str = ""  #: sentence of `asymmetry` on maps from left to right that are not sure

    def to_json(self) -> dict[str, Any]:
        """Return the record with where it is."""
        return {**self.record, "output": str(self.folder), "files": self.files}


def _by_mode(scores: FloatArray) -> dict[str, list[float]]:
    return {f"mode_{i}": column.tolist() for i, column in enumerate(scores.T, 1)}


def _files_of(record: Path) -> list[str]:
    """Names that an earlier record lists, if they are in its folder."""
    try:
        listed = json.loads(record.read_text(encoding="utf-8"))["files"]
        return [name for name in listed if not Path(name).is_absolute() and ".." not in Path(name).parts]
    except (OSError, ValueError, KeyError, TypeError):
        return []


PICTURE_CAPTIONS = {
    "modes": "The mean, and the mean moved along each mode.",
    "scores": "The shapes by their scores along the first two modes.",
    "variance": "How much each vertex varies.",
    "canonical": "Canonical variates: the directions in which the groups differ most, over how they vary.",
    "groups": "Where the means of the groups differ, and how far they are apart there.",
    "allometry": "How shape changes with size: the regression score of each shape against its size.",
    "quality": "By the number of modes: the share described, the error of shapes left out, how near random ones are.",
    "embedding": "The shapes by their distances: differences of geodesic ones, or of landmarks Procrustes distances.",
    "dendrogram": "A tree of the same distances.",
}
"""What each picture shows, in the order of the page."""

SCALINGS = {  # what each value of the setting ``scale`` does
    "keep": "Size is part of the shape (scale keep)",
    "remove": "All shapes are brought to one size (scale remove)",
}
WEIGHTINGS = {  # what each value of the setting ``weights`` does
    "area": "a vertex counts by its share of the area (weights area)",
    "uniform": "all vertices count alike (weights uniform)",
}


def _figure(file: str, words: str) -> str:
    image = f'<img src="{quote(file)}" alt="" loading=lazy>'
    shown = f'<a href="{quote(file)}">{escape(file) if file.endswith(".pdf") else image}</a>'
    return f"<figure>{shown}<figcaption>{escape(words)}</figcaption></figure>\n"


def _link_files(names: Iterable[str]) -> str:
    """Link tables and meshes of a folder; those in folders inside it open with a click."""
    html, linked = "", sorted((name for name in names if name.endswith(LINKED_SUFFIXES)), key=dirname)
    for folder, inner in groupby(linked, dirname):
        links = ", ".join(f'<a href="{quote(name)}">{escape(basename(name))}</a>' for name in inner)
        in_folder = f"<details><summary>{escape(folder)}</summary>{links}</details>"
        html += in_folder if folder else f"<p>{links}</p>"
    return html


def listed(lines: Sequence[str]) -> str:
    """Format lines as a list in HTML; nothing if there are none."""
    return "<ul>" + "".join(f"<li>{escape(line)}</li>" for line in lines) + "</ul>" if lines else ""


def tabulated(columns: Sequence[str], rows: Iterable[Iterable[object]]) -> str:
    """Format rows as a table in HTML, numbers with four digits, nan as nothing."""
    cells = ([f"{x:.4g}".replace("nan", "") if isinstance(x, float) else str(x) for x in row] for row in rows)
    heads = [name.replace("_", " ") for name in columns]
    return f"<div class=wide>{visualization.html_table([*cells], heads)}</div>"
