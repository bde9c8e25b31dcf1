"""Settings of the joint refinement."""

from __future__ import annotations

from dataclasses import dataclass

from isomatch.errors import SettingError
from isomatch.values.settings import Settings, setting


@dataclass(frozen=True)
class RefinementSettings(Settings):
    """Settings of the refinements.

    Parameters
    ----------
    sizes_without_positions, sizes_with_positions, final_sizes : tuple of int
        Functions in the steps of the three stages of the joint refinement; positions and normals take part in the last
        two. After each stage, maps that fit much worse than the best are given up.
    sizes_of_parts : tuple of int
        Functions in further steps without positions, of the map of a part.
    sizes_again : tuple of int
        Functions in the steps by which a map that ties with the best is refined once more, with positions and normals if
        the stages before end with them; the last step is theirs. The map of lower score stays.
    polished_sizes : tuple of int
        Functions in the steps that polish the map of a large mesh, on more vertices.
    position_unit : float
        Misfit of positions, in √area, that counts as one unit of the spectral coordinates.
    normal_weight : float
        Weight of normals.
    function_weight : float
        Weight of functions that are known on both shapes, as of their root mean square; see `match`.
    registration_steps : int
        Steps of the non-rigid registration that ends "joint".
    laplace_steps_at_once : int
        If above 0, "laplace_icp" takes all functions from the start, with an orthogonal functional map and at most so
        many iterations: the paper as it is written.
    """

    sizes_without_positions: tuple[int, ...] = setting(
        (20, 25, 30, 35, 40, 45, 50), "Melzi et al. 2019; docs/lab/design_notes.md", least=4, empty=True
    )
    sizes_with_positions: tuple[int, ...] = setting(
        (50, 75, 100), "ablation: no positions and normals", least=4, empty=True
    )
    final_sizes: tuple[int, ...] = setting(
        (125, 150), "ablation: no positions and normals", least=4, empty=True
    )
    sizes_of_parts: tuple[int, ...] = setting(
        (70, 100, 140), "docs/lab/design_notes.md, parts", least=4, empty=True
    )
    sizes_again: tuple[int, ...] = setting(
        (20, 30, 50, 80, 130), "docs/lab/design_notes.md", least=4, empty=True
    )
    polished_sizes: tuple[int, ...] = setting((100, 150), "docs/performance.md, resolution", least=4)
    position_unit: float = setting(0.08, "measured on 9 pairs: 0.08 2.06, 0.15 2.11, 0.3 2.14", least=1e-6)
    normal_weight: float = setting(0.3, "docs/lab/benchmarks.md, sensitivity", least=0)
    function_weight: float = setting(0.2, "docs/hints.md: functions known on both", least=0)
    registration_steps: int = setting(3, "docs/lab/design_notes.md", least=0)
    laplace_steps_at_once: int = setting(0, "docs/lab/paper.md, deviations: at once heals less", least=0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (self.sizes_without_positions or self.sizes_with_positions or self.final_sizes):
            raise SettingError(
                "the three stages of the joint refinement are all empty; give one of them a size"
            )

    @property
    def last_step(self) -> tuple[tuple[int, ...], bool]:
        """Size of the last step of the joint refinement, by which every map is measured; whether it has positions."""
        with_positions = (*self.sizes_with_positions, *self.final_sizes)
        return (with_positions or self.sizes_without_positions)[-1:], bool(with_positions)
