"""The steps of ``results.py``: what is measured for the pages, with the minutes that it takes on two idle processors."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Step:
    """A command of Python, in which {data} and {out} are folders, and what of {out} is kept."""

    name: str
    minutes: int
    command: str
    tables: dict[str, str]  # table in docs/results: its file in {out}
    files: dict[str, str]  # file in docs: its file in {out}


def study(
    script: str,
    minutes: int,
    *files: str,
    of: str = "",
    options: str = "",
    folder: str = "dev/lab/benchmarks",
    **tables: str,
) -> Step:
    """Make a step of a script of this folder, or of one of its sets; its table is SCRIPT_table.csv if none is named."""
    # a file that is kept under another name is written NEW=OLD
    kept = {f"{folder}/{file.split('=')[0]}": file.split("=")[-1] for file in files}
    command = " ".join(
        filter(None, (f"python -m isomatch_lab.studies.{script} --data {{data}} -o {{out}}", of, options))
    )
    return Step(of or script, minutes, command, tables or {script: f"{script}_table.csv"}, kept)


FIGURES = (  # figures and tables of the paper that the documentation has
    *("basis-error", "basis-vectors", "descriptor-distance", "descriptor-field"),
    *("curves-5pt", "distortion-table", "voronoi", "curves-initialised"),
)
STEPS = (  # studies whose results the documentation has
    study("accuracy", 50, "pairs.csv", "summary.csv", "curves.png", folder="accuracy"),
    study(
        *("methods", 35),
        *(
            "improvements.csv",
            "methods.csv=pairs.csv",
            "methods.png=curves.png",
            "methods_summary.csv=summary.csv",
        ),
        methods="methods_table.csv",
    ),
    study(
        *("contests", 120, "contests.csv", "contest_curves.csv=curves.csv", "contest_curves.png=curves.png"),
        folder="accuracy",
        contests="contests_table.csv",
    ),
    study("confidence", 16, "confidence.csv", folder="accuracy"),
    study("vertex_confidence", 4),
    study("ablation", 16, "ablation.csv", "ablation_pairs.csv", ablation="ablation.csv"),
    study("sensitivity", 9, "sensitivity.csv"),
    study("smoothness", 2, "smoothness.csv"),
    study("engines", 1),
    study("distance_bases", 5, "distance_bases.csv", "distance_bases.png", "distance_ratios.csv"),
    Step(
        "robustness",
        15,
        "python -m isomatch_lab.studies.robustness --data {data} -o {out}",
        {},
        {f"dev/lab/benchmarks/robustness.{end}": f"robustness.{end}" for end in ("csv", "svg")},
    ),
    study("real_shapes", 21, parts="real_shapes_table.csv"),
    study(
        *("performance", 17, "performance.csv", "performance.svg"),
        options="--pyfm 30000",  # pyFM takes minutes for larger meshes
        folder="performance",
        speed="pairs_table.csv",
    ),
    study("budget", 3, "budget.csv", folder="performance"),
    study("paper_deviations", 2, "deviations.csv", folder="dev/lab/paper", deviations="deviations_table.csv"),
    Step(
        "paper",
        100,
        "python -m isomatch_lab.studies.paper_figures --data {data} -o {out}",
        {"paper": "paper_table.csv"},
        {f"dev/lab/paper/{name}.{end}": f"{name}.{end}" for name in FIGURES for end in ("png", "csv", "json")}
        | {"dev/lab/paper/index.md": "index.md"},
    ),
)
