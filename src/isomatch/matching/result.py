"""What a match returns: the map, its quality, its outcome, and what to do about it."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from enum import Enum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.array_file import ArrayFormat, Stored, save_arrays
from isomatch._core.arrays import FloatArray
from isomatch._core.cached import cached_property
from isomatch._core.errors import FormatError, InputError
from isomatch._core.first_use import Shown, visualization
from isomatch._core.settings import Settings
from isomatch._core.threads import serial_blas
from isomatch.correspondence import UNMATCHED, Correspondence, wrap
from isomatch.io import Asset, Attribute, SurfaceLike, mesh_from, to_pyvista
from isomatch.matching.assessment.confidence import DoubtfulRegion, pack_regions, unpack_regions
from isomatch.settings import MatchSettings
from isomatch.surfaces import Mesh

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# the arrays of a map in a file, each with its kind and shape; n is the number of source vertices
MAP_ARRAYS = {
    "vertices": Stored("integer", ("n",)),
    "faces": Stored("integer", ("n", 3)),
    "barycentric": Stored("float", ("n", 3)),
}
HALF_CONFIDENCE_ERROR = 0.05  # √area; an image with this expected error has a confidence of ½; chosen
FORMAT = ArrayFormat(  # contents of the file of a result
    what="a match result",
    writer="MatchResult.save",
    version=1,  # to be raised if earlier versions of isomatch cannot read new files
    arrays={
        **MAP_ARRAYS,
        "n_target": Stored("integer"),
        "source_hash": Stored("text"),
        "target_hash": Stored("text"),
        **{f"alternative_{name}": Stored(a.kind, ("a", *a.shape)) for name, a in MAP_ARRAYS.items()},
        "expected_error": Stored("float", ("n",)),
        "descriptor_distance": Stored("float", ("m",)),
        "region_sizes": Stored("integer", ("r",), group="regions"),
        "region_vertices": Stored("integer", ("d",), index_of="n", group="regions"),
        "region_runners_up": Stored("integer", ("d",), group="regions"),
        "about": Stored("text"),
    },
)


@dataclass(frozen=True)
class Quality(Shown):
    """Measures of a map that need no ground truth; the report explains each, with its usual values.

    Large meshes are measured at the resolution at which they are matched. If shapes have several components,
    ``coverage`` and ``matched`` count all, and the other measures describe the largest. nan is unknown.

    Parameters
    ----------
    spectral_residual : float
        Mean distance from the images in the joint coordinates after the joint refinement; spectral coordinates have
        unit 1.
    runner_up : float
        Score of the best different map over the score of this one: 1 is a tie; below 1 the other fits better, but was
        not eligible; ``inf`` if no other map is close. For a part, costs are compared; for two parts, whose costs are
        negative, the ratio is inverted.
    mirrored : float
        The same ratio for the best map of the other orientation; if it is not allowed, ``inf`` unless below 0.6.
    residual : float
        Residual of the distance descriptors after the best rotation, in √(average distance); nan for a part.
    stretch : float
        Sum of squared lengths of the images of edges, each counted at most fourfold, over the sum for the edges
        themselves: 1 for an isometry.
    orientation : float
        Mean cosine between the normals of the smooth target and of its copy drawn on the source, −1 to 1.
    distortion_mean, distortion_p95 : float
        Mean and 95th percentile of ``|d_source(i, j) − d_target(f(i), f(j))|``, each distance in √area of its surface;
        nan for a part.
    coverage : float
        Share of the target's area within 0.05 √area, along edges, of an image (``Config.outcome.coverage_radius``).
    matched : float
        Share of the source's vertices that have an image.
    landmark_error, initial_map_error : float
        Mean distance of images of landmarks from their targets, and median distance from the images of the initial map,
        in √area of the target.
    descriptor_distance : float
        Mean of ``MatchResult.descriptor_distance`` over the area, in standard deviations.
    torn_off : float
        Share of the source's area in the largest piece that the map tears from the rest; nan for a part.
    stress : float
        For a part, how far distances between images lie outside the known bounds of distances, relative to these.
    bending_cost : float
        For shapes that are bent, mean ``|log|`` of the stretch of edges × mean distance from the other, in √area.
    doubt : float
        For a part, cost × ``bending_cost`` / lead, where the lead is 1 − cost / cost of the best different map.
    """

    spectral_residual: float
    runner_up: float
    mirrored: float
    residual: float
    stretch: float
    orientation: float
    distortion_mean: float
    distortion_p95: float
    coverage: float
    matched: float
    landmark_error: float
    initial_map_error: float
    descriptor_distance: float = math.nan
    torn_off: float = math.nan
    stress: float = math.nan
    bending_cost: float = math.nan
    doubt: float = math.nan


@dataclass(frozen=True, eq=False)
class Alternative:
    """Another map that may be right, with the energy, orientation and origin of its candidate."""

    extend: Callable[[], Correspondence] = field(repr=False)  # computes the map at first use
    energy: float  # energy or cost, by the model; lower is better
    orientation: float
    origin: str

    @cached_property
    def map(self) -> Correspondence:
        """Source → target, extended by its functional map, not refined."""
        with serial_blas():
            return self.extend()

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the map itself, and not the shapes from which it is computed."""
        return Alternative, (partial(_give_map, self.map), self.energy, self.orientation, self.origin)


def _give_map(map_: Correspondence) -> Correspondence:
    return map_


# fields of `MatchResult` that a file holds as they are
_PLAIN = ("timings", "notes", "engine", "origin", "reason", "seed", "way", "evidence", "symmetries")


def _restore_fields(summary: dict[str, Any]) -> dict[str, Any]:
    known = {"way": "", "evidence": (), "target_size": None, **summary}  # defaults for earlier versions
    outcome, plain = Outcome[summary["outcome"]], {name: known[name] for name in _PLAIN[:-1]}
    size = math.nan if known["target_size"] is None else known["target_size"]
    tuples = {name: tuple(plain[name]) for name in ("notes", "evidence")}
    return {**plain, **tuples, "outcome": outcome, "target_size": size}


def _settings(name: str, values: dict[str, Any]) -> MatchSettings:
    """Make the settings of `match` or of an imported baseline; a file imports nothing."""
    kinds = [Settings]
    for kind in kinds:
        kinds.extend(kind.__subclasses__())
        if kind.__name__ == name:
            return cast(MatchSettings, kind.from_dict(values))
    raise FormatError(
        f"its settings {name!r} are not known; import the method that made it first, as by isomatch_lab.baselines"
    )


@dataclass(frozen=True, eq=False)
class MatchResult(Shown):
    """Result of `match`, or of a baseline.

    Parameters
    ----------
    map : Correspondence
        Source → target.
    outcome : Outcome
        How sure the map is, and what to do.
    quality : Quality
        Measures without ground truth.
    expected_error : (n_source,) array of float
        Estimate of the geodesic error of each vertex's image, in √area of the target; nan where unmatched. Calibrated for
        maps that are right as a whole; where an alternative ties, the chance that it is right counts too.
    alternatives : tuple of Alternative
        Distinct other maps, best first.
    timings : dict of str to float
        Wall seconds of each stage, in order, and their sum as ``"total"``. Stages of a strategy are named after it, as
        ``"component 2: part: search"``. Stages of the shapes, as ``"source: distances"``, run in parallel within
        ``"prepare"`` and do not count towards the total.
    notes : tuple of str
        What was repaired, left out or replaced on the way.
    engine : str
        Geodesic engine of the source.
    origin, reason : str
        Origin of the map, and why it was selected; a baseline has no reason.
    config : Config or the settings of a baseline
    seed : int
    way : str
        Strategy that found the map, a name in `isomatch.matching.STRATEGIES` such as "isometry", "part" or "elastic";
        empty for a baseline.
    symmetries : tuple of str
        Maps of the source, and of the target, onto themselves, in words; empty if none was found.
    descriptor_distance : (n_source,) array of float, optional
        How differently the surfaces look in space around each vertex and its image, in standard deviations up to 2, see
        `BallSignature`; nan where unmatched or too close to a boundary; None for points, graphs, baselines and bent maps.
    regions : tuple of DoubtfulRegion
        Where on the source the map may be wrong, and why, the largest first; none for parts and baselines.
    evidence : tuple of str
        What speaks against the map being right and complete, and decides the outcome, the least sure first:
        "contradicted", "mirrored", "poor", "ambiguous", "partial", see `Evidence`; empty if the map has converged.
    target_size : float
        √area of the target, in its units; nan if it is not known.
    """

    map: Correspondence
    outcome: Outcome
    quality: Quality
    expected_error: FloatArray
    alternatives: tuple[Alternative, ...]
    timings: dict[str, float]
    notes: tuple[str, ...]
    engine: str
    origin: str
    reason: str
    config: MatchSettings
    seed: int
    way: str = ""
    symmetries: tuple[str, str] = ("", "")
    descriptor_distance: FloatArray | None = None
    regions: tuple[DoubtfulRegion, ...] = ()
    evidence: tuple[str, ...] = ()
    target_size: float = math.nan

    def __str__(self) -> str:
        """Say what was found, how sure it is and what to do."""
        return str(visualization().summary_of(self))

    def __repr__(self) -> str:
        return f"MatchResult({self.outcome.name}, {self.map!r})"

    @property
    def confidence(self) -> FloatArray:
        """(n_source,) confidence in each image: ½ at an expected error of 0.05 √area."""
        return 1 / (1 + self.expected_error / HALF_CONFIDENCE_ERROR)

    @property
    def overlap(self) -> tuple[float, float]:
        """Shares that correspond: ``quality.matched`` and ``quality.coverage``."""
        return self.quality.matched, self.quality.coverage

    def plot(self, source: SurfaceLike = None, target: SurfaceLike = None, **options: Any) -> Figure:
        """Draw both surfaces side by side, with the same colour at corresponding points."""
        return self.map.plot(source, target, **options)

    def show(
        self,
        source: SurfaceLike = None,
        target: SurfaceLike = None,
        *,
        landmarks: ArrayLike | None = None,
        height: int = 720,
    ) -> Any:
        """Show both shapes in 3D in a notebook, with layers of colour and landmarks to click.

        Parameters
        ----------
        source, target : Mesh, PointCloud, or what `surface_from` takes, optional
            By default the surfaces that were matched, if they still exist; `MapError` for other surfaces.
        landmarks : (q, 2) array_like of int, optional
            Pairs (source vertex, target vertex) with which the list of landmarks begins.
        height : int
            Height in pixels of the page.

        Returns
        -------
        ResultView
            With the extra ``notebook``, its ``landmarks`` are the pairs clicked so far, which `match` takes.
        """
        surfaces = self.map.surfaces(source, target)
        return visualization().show_result(self, *surfaces, landmarks=landmarks, height=height)

    def as_mesh(self, source: SurfaceLike, target: SurfaceLike) -> Mesh:
        """Bend the source onto the target, see `isomatch.wrap`; `MapError` for other surfaces."""
        return wrap(self.map, source, target).mesh

    def to_pyvista(self, source: SurfaceLike = None, target: SurfaceLike = None) -> Any:
        """Make a ``pyvista.PolyData`` of the source, with images and expected errors."""
        values = {"image": self.map.vertices, "expected error": self.expected_error}
        mesh = mesh_from(self.map.surfaces(source, target)[0])
        return to_pyvista(
            Asset.of_mesh(mesh, [Attribute(k, "point", "scalar", v) for k, v in values.items()])
        )

    def save(self, path: str | Path) -> None:
        """Write the result to an ``.npz`` file; `Correspondence.load` reads its map."""
        stacked = {}
        for name in MAP_ARRAYS:
            array = getattr(self.map, name)
            others = [getattr(other.map, name) for other in self.alternatives]
            stacked[f"alternative_{name}"] = np.array(others, dtype=array.dtype).reshape(-1, *array.shape)
        about = {
            **{name: getattr(self, name) for name in _PLAIN},
            "outcome": self.outcome.name,
            "target_size": self.target_size,
            "quality": asdict(self.quality),
            "alternatives": [[a.energy, a.orientation, a.origin] for a in self.alternatives],
            "regions": [[region.area, region.reason] for region in self.regions],
            "settings": type(self.config).__name__,
            "config": self.config.to_dict(),
        }
        arrays = {
            **vars(self.map),
            **stacked,
            "expected_error": np.nan_to_num(self.expected_error, nan=UNMATCHED),
            "descriptor_distance": np.zeros(0)
            if self.descriptor_distance is None
            else np.nan_to_num(self.descriptor_distance, nan=UNMATCHED),
            **pack_regions(self.regions),
            "about": json.dumps(about),
        }
        stored = {name: np.array(arrays[name]) for name in FORMAT.arrays}
        save_arrays(path, FORMAT.version, stored, compressed=True)

    @classmethod
    def load(cls, path: str | Path) -> MatchResult:
        """Read what `save` wrote.

        Raises
        ------
        FormatError
            If the file is missing (`MissingFileError`), holds something else, or was written by a newer isomatch.
        """
        arrays = FORMAT.read(path)
        others = zip(*(arrays.pop(f"alternative_{name}") for name in MAP_ARRAYS))
        try:
            about = json.loads(arrays.pop("about"))
            of_vertices = map(arrays.pop, ("expected_error", "descriptor_distance"))
            errors, distances = (np.where(values == UNMATCHED, np.nan, values) for values in of_vertices)
            regions = unpack_regions(arrays, about.get("regions", []))
            main = Correspondence(**{**arrays, "n_target": int(arrays["n_target"])})
            maps = [replace(main, **dict(zip(MAP_ARRAYS, parts))) for parts in others]
            restored = _restore_fields(about)
            evidence = zip(maps, about["alternatives"], strict=True)
            return cls(
                map=main,
                quality=Quality(**about["quality"]),
                expected_error=errors,
                descriptor_distance=distances if len(distances) else None,
                regions=regions,
                alternatives=tuple(
                    Alternative(partial(_give_map, map), *numbers) for map, numbers in evidence
                ),
                symmetries=tuple(about["symmetries"]),
                config=_settings(about["settings"], about["config"]),
                **restored,
            )
        except (InputError, KeyError, TypeError, ValueError, RecursionError) as error:
            raise FormatError(
                f"{path}: not a match result ({error}); expected a file written by {FORMAT.writer}"
            ) from None

    @classmethod
    def from_dict(cls, summary: dict[str, Any], found: Correspondence, config: MatchSettings) -> MatchResult:
        """Restore a result from ``to_dict``, without alternatives and expected errors."""
        quality = {name: math.nan if value is None else value for name, value in summary["quality"].items()}
        return cls(
            map=found,
            quality=Quality(**quality),
            expected_error=np.full(len(found.vertices), np.nan),
            alternatives=(),
            config=config,
            symmetries=(summary["symmetries"]["source"], summary["symmetries"]["target"]),
            regions=tuple(map(DoubtfulRegion.from_dict, summary.get("regions", []))),
            **_restore_fields(summary),
        )

    def _describe_errors(self) -> dict[str, float | None]:
        """Mean and 95th percentile of expected errors; share of confidences below ½."""
        errors = self.expected_error[np.isfinite(self.expected_error)]
        if not len(errors):
            return {"mean": None, "p95": None, "below_half": None}
        p95, below_half = float(np.quantile(errors, 0.95)), float((errors > HALF_CONFIDENCE_ERROR).mean())
        return {"mean": float(errors.mean()), "p95": p95, "below_half": below_half}

    def to_dict(self) -> dict[str, Any]:
        """Return everything except the maps as plain values for JSON; nan and inf become None."""

        def finite(value: float) -> float | None:
            return value if math.isfinite(value) else None

        return {
            "direction": "source -> target",
            "n_source": len(self.map.vertices),
            "n_target": self.map.n_target,
            "outcome": self.outcome.name,
            "advice": self.outcome.advice,
            "target_size": finite(self.target_size),
            "quality": {key: finite(value) for key, value in asdict(self.quality).items()},
            "expected_error": self._describe_errors(),
            "regions": [region.to_dict() for region in self.regions],
            "alternatives": [
                {"energy": finite(a.energy), "orientation": finite(a.orientation), "origin": a.origin}
                for a in self.alternatives
            ],
            "symmetries": dict(zip(("source", "target"), self.symmetries)),
            "timings": self.timings,
            "notes": list(self.notes),
            "engine": self.engine,
            "origin": self.origin,
            "reason": self.reason,
            "config": self.config.to_dict(),
            "seed": self.seed,
            "way": self.way,
            "evidence": list(self.evidence),
        }


class Outcome(Shown, Enum):
    """How a match ended; ``advice`` says what to do. If several apply, it is the first."""

    PRIORS_CONTRADICTED = "priors contradicted"
    MIRROR_IMAGE = "mirror image"
    LOW_CONFIDENCE = "low confidence"
    SYMMETRY_AMBIGUOUS = "symmetry ambiguous"
    PARTIAL = "partial"
    CONVERGED = "converged"

    @property
    def advice(self) -> str:
        """One sentence: what happened, why, what to do."""
        return _ADVICE[self]

    @property
    def is_called_right(self) -> bool:
        """Whether the map is taken as right, and no other map fits as well: converged or partial."""
        return self.sureness >= Outcome.PARTIAL.sureness

    @property
    def is_doubtful(self) -> bool:
        """Whether the map may be wrong altogether."""
        return self.sureness <= Outcome.LOW_CONFIDENCE.sureness

    @property
    def sureness(self) -> int:
        """Rank among the outcomes; 0 is the least sure."""
        return list(Outcome).index(self)


# what each outcome means, and what to do
_ADVICE = {
    Outcome.PRIORS_CONTRADICTED: (
        "The map does not agree with the landmarks or the initial map. Either may be wrong: check that landmarks are "
        "pairs (source vertex, target vertex) that count from 0; if they are right, match with hypotheses = 'given'."
    ),
    Outcome.MIRROR_IMAGE: (
        "The mirror image of the source fits clearly better than any map that keeps the orientation of the faces, so "
        "this map is wrong: perhaps one shape is a left and the other a right one, or a file is mirrored. Match with "
        "orientation = 'any', or reflect one of the shapes."
    ),
    Outcome.LOW_CONFIDENCE: (
        "The shapes fit badly under this map, as a whole or in its regions of doubt; it may be wrong there or "
        "altogether. Look at the picture; give three to five landmark pairs at extremities, or start = 'pose' if the "
        "shapes are roughly aligned in space; or check that both shapes are complete and of one kind."
    ),
    Outcome.SYMMETRY_AMBIGUOUS: (
        "A second, symmetric map fits as well, or the priors led to the mirror image. If sides matter, give landmarks: "
        "three to five pairs, at least one on one side only (a left hand, a right ear), and say which orientation "
        "is meant; or start = 'pose' if the shapes are roughly aligned in space."
    ),
    Outcome.PARTIAL: (
        "One shape is a part of the other, both are parts of one body, or one has further components; what has no "
        "counterpart is marked unmatched (−1). "
        "The notes say what is missing. Landmarks on two components make them partners; if the picture looks wrong, give "
        "three to five at extremities."
    ),
    Outcome.CONVERGED: "The evidence agrees on one map.",
}
