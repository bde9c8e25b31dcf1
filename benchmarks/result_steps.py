"""The steps of ``results.py``: what is measured for the pages, with the minutes that it takes on two processors."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Step:
    """Commands, in which {data} and {out} are folders, the tables and other files that they write, and usual minutes.

    Tables are named by what they are called in ``docs/results``, files by their paths in ``docs``; both by their place in
    {out}.
    """

    name: str
    minutes: int
    commands: tuple[str, ...]
    tables: dict[str, str]
    files: dict[str, str] = field(default_factory=dict)


def study(name: str, minutes: int, *more: str, **tables: str) -> Step:
    """Make a step of a script of this folder; its table is NAME_table.csv if none is named, and some files are kept."""
    command = f"python benchmarks/{name}.py --data {{data}} -o {{out}}"
    kept = {f"benchmarks/{file}": file for file in more}
    return Step(name, minutes, (command,), tables or {name: f"{name}_table.csv"}, kept)


def copies(folder: str, *names: str) -> dict[str, str]:
    """Keep files of {out} under their names in a folder of ``docs``."""
    return {f"{folder}/{name}": name for name in names}


PAPER = (
    *(
        "basis-error",
        "basis-vectors",
        "descriptor-distance",
        "descriptor-field",
        "curves-5pt",
        "distortion-table",
    ),
    *("voronoi", "curves-initialised"),
)
SETS = "python benchmarks/accuracy.py --data {data} -o {out}"
STEPS = (
    Step(
        "accuracy",
        180,
        (SETS,),
        {"accuracy": "accuracy_table.csv"},
        copies("benchmarks", "pairs.csv", "summary.csv", "curves.png"),
    ),
    Step("organs", 5, (f"{SETS} organs",), {"organs": "classes_table.csv"}),
    Step("cross", 15, (f"{SETS} cross",), {"cross": "classes_table.csv"}),
    Step(
        "methods",
        180,
        ("python benchmarks/methods.py --data {data} -o {out}",),
        {"methods": "methods_table.csv", "starts": "starts_table.csv"},
        copies("benchmarks", "improvements.csv")
        | {f"benchmarks/methods{end}": name for end, name in ((".csv", "pairs.csv"), (".png", "curves.png"))}
        | {"benchmarks/methods_summary.csv": "summary.csv"},
    ),
    study("confidence", 15, "confidence.csv"),
    study("vertex_confidence", 6),
    study("ablation", 25, "ablation.csv", "ablation_pairs.csv", ablation="ablation.csv"),
    study("sensitivity", 25, "sensitivity.csv"),
    study("smoothness", 3, "smoothness.csv"),
    study("engines", 2, engines="engines_table.csv"),
    study("distance_bases", 6, "distance_bases.csv", "distance_bases.png", "distance_ratios.csv"),
    study("robustness", 30, "robustness.csv", "robustness.svg"),
    study("real_shapes", 30, parts="real_shapes_table.csv"),
    study("welds", 25, welds="welds_table.csv"),
    Step(
        "performance",
        35,
        ("python benchmarks/performance.py --data {data} -o {out}",),
        {"speed": "pairs_table.csv", "stages": "stages_table.csv"},
        copies("performance", "performance.csv", "performance.svg"),
    ),
    Step(
        "paper",
        60,
        ("isomatch paper all --data {data} -o {out} --force --points 500",),
        {},
        copies("paper", "index.md", *(f"{n}.{end}" for n in PAPER for end in ("png", "svg", "csv", "json"))),
    ),
    Step(
        "paper_deviations",
        8,
        ("python benchmarks/paper_deviations.py --data {data} -o {out}",),
        {"deviations": "deviations_table.csv"},
        copies("paper", "deviations.csv"),
    ),
    Step(
        "consistency",
        20,
        ("python benchmarks/consistency.py --data {data} -o {out}",),
        {"consistency": "consistency_table.csv", "cycles": "cycles_table.csv"},
    ),
    Step("scale", 20, ("python benchmarks/collection_scale.py -o {out}",), {"scale": "scale_table.csv"}),
)
