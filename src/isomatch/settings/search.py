"""Settings of the search for hypotheses."""

from __future__ import annotations

from dataclasses import dataclass

from isomatch.values.settings import Settings, setting


@dataclass(frozen=True)
class SearchSettings(Settings):
    """Settings of first maps and of the search among them.

    Parameters
    ----------
    rank : int
        Descriptor columns while hypotheses are compared; the others only sharpen a map already found.
    start_columns : int
        Leading columns that a few points determine.
    near_rigid : float
        Mean distance of positions and normals × 0.1, in √area, up to which shapes that are aligned in space are matched
        from their poses too; see `poses_between`. 0 does without.
    off_diagonal : tuple of float
        Penalties on mixing columns, each tried for landmarks; extremities take the first. See `alignments_from_points`.
    ridge : float
        Penalty on every entry of the alignment.
    extremity_counts : tuple of int
        Numbers of extremities of one shape that are assigned together.
    n_candidate_extremities : int
        Extremities of the other shape they may be assigned to.
    assignments : int
        Best assignments that are kept for each count and direction.
    eccentricity_weight : float
        Weight of differences of average distance, against those of mutual distances, in the cost of an assignment.
    start_steps, flip_steps : int
        Iterations of closest points from extremities; after flips and combinations.
    unchanged : float
        Share of unchanged images at which an iteration has converged.
    compare_every : int
        Iterations between comparisons of the maps under way; as many on the way back.
    same_start, same_map : float
        Mean distance of images, in √area, below which two starts, and two converged maps, are one.
    n_hypotheses : int
        Most hypotheses.
    flipped : int
        Best hypotheses whose flips are tried.
    flipped_functions : int
        Leading Laplace–Beltrami functions whose sign is flipped.
    both_ways : bool
        Whether maps are also searched from the target, and inverted.
    combined : int
        Best candidates that are combined with each other, one on one half of the source and one on the other.
    halves : int
        Laplace–Beltrami functions whose signs part the source in such halves.
    most_combined : int
        Most combinations, those of least residual, that are compared with the candidates.
    flip_landmarks : bool
        Whether flips of the map from landmarks are tried too, where no automatic hypotheses compete. Landmarks at
        extremities leave the front and the back of a thin body undecided.
    """

    rank: int = setting(30, "measured on 50 pairs: p = 60 and k = 30 as good as p = 100 and k = 50", least=4)
    start_columns: int = setting(20, "docs/lab/benchmarks.md, sensitivity", least=4)
    near_rigid: float = setting(
        0.05,
        "bones, teeth, skulls of one kind: 0.034 to 0.043; bodies in other poses: from 0.047 on",
        least=0,
    )
    off_diagonal: tuple[float, ...] = setting(
        (0.01, 0.001, 0.0001),
        "docs/lab/paper.md: the two further ones take centaur5–centaur2 from 4.3 to 2.6",
        least=0,
    )
    ridge: float = setting(0.001, "docs/lab/benchmarks.md, sensitivity", least=0)
    extremity_counts: tuple[int, ...] = setting(
        (4, 5, 6), "ablation: one set of extremities (cat4–cat9)", least=1
    )
    n_candidate_extremities: int = setting(7, "docs/lab/benchmarks.md, sensitivity", least=1)
    assignments: int = setting(
        8,
        "docs/lab/benchmarks.md, sensitivity; with flips, the right map was found on 86 of 86 pairs",
        least=1,
    )
    eccentricity_weight: float = setting(0.3, "docs/lab/benchmarks.md, sensitivity", least=0)
    start_steps: int = setting(12, "docs/lab/benchmarks.md, sensitivity", least=1)
    flip_steps: int = setting(4, "docs/lab/benchmarks.md, sensitivity", least=1)
    unchanged: float = setting(0.99, "docs/lab/benchmarks.md, sensitivity", least=0, most=1)
    compare_every: int = setting(2, "docs/lab/benchmarks.md, sensitivity", least=1)
    same_start: float = setting(
        0.02, "docs/lab/benchmarks.md, sensitivity; half the spacing of 400 samples", least=0
    )
    same_map: float = setting(
        0.05, "docs/lab/benchmarks.md, sensitivity; the spacing of 400 samples", least=0
    )
    n_hypotheses: int = setting(
        14, "measured: the right map was among the best 12 on 86 of 86 pairs", least=1
    )
    flipped: int = setting(3, "ablation: no flips", least=0)
    flipped_functions: int = setting(20, "ablation: no flips", least=0)
    both_ways: bool = setting(True, "docs/lab/design_notes.md: victoria2–victoria23, 18.4 without, 4.5 with")
    combined: int = setting(4, "docs/lab/design_notes.md", least=0)
    halves: int = setting(4, "docs/lab/design_notes.md", least=0)
    most_combined: int = setting(6, "docs/lab/design_notes.md", least=0)
    flip_landmarks: bool = setting(
        True, "docs/lab/paper.md: victoria12–victoria23 from landmarks, 7.9 without, 4.2 with"
    )
