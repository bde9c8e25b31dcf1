"""Measure again what the pages report, and put the tables into the pages.

    python -m isomatch_lab.studies.results --data DIR [-o OUT] [STEP ...]    # all steps of result_steps.py by default
    python -m isomatch_lab.studies.results --pages                           # only fills the pages from docs/results
    python -m isomatch_lab.studies.results --list

The command of a step writes into ``OUT/STEP_STAMP``, where STAMP is a hash of all that its stamp says before it runs: a
step that was interrupted continues there if nothing has changed, and else begins anew. Its tables are copied to
``docs/results``, other files beside the pages. ``docs/results/stamps.json`` says of what each step is: the source, the
command, the machine, versions of packages, the revision, the date and the seconds. A step whose stamp is the present one
is skipped.

In a page, what is between ``<!-- result: NAME -->`` and ``<!-- end of result -->`` is ``docs/results/NAME.csv``, in
``<!-- result: NAME: A; B -->`` two of its columns. ``<!-- result: stamp -->`` tells where and when the tables of the
page were measured, ``<!-- result: stamp: STEP; STEP -->`` only for some steps, where a page has tables of several
revisions.
``<!-- result: beside -->`` puts the contests among published numbers.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
import platform
import re
import shutil
import signal
import subprocess
import sys
import time
from datetime import date
from importlib.metadata import version
from pathlib import Path
from typing import Any

from isomatch._core.machine import processor
from isomatch_lab.studies import published
from isomatch_lab.studies.result_steps import STEPS, Step

ROOT = Path(__file__).parents[3]  # folder of the repository
SHARED = ("shared.py", "hard_pairs.txt")  # files that several studies need
RESULTS = Path("docs", "results")  # folder of tables and stamps
PACKAGES = ("numpy", "scipy", "numba")  # packages whose versions a stamp has
# a marked place in a page: name of the result, part, and contents
MARKED = re.compile(r"<!-- result: ([\w-]+)(?:: ([^\n]+?))? -->\n(.*?)<!-- end of result -->", re.DOTALL)
NOT_TABLES = ("stamp", "beside")  # marked places that hold no table
Stamp = dict[str, Any]


def source_hash(folder: Path) -> str:
    """Hash of all files of a folder and of their names, without those that Python makes."""
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        if "__pycache__" in path.parts or not path.is_file():
            continue
        digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def present_stamp(step: Step, root: Path = ROOT) -> Stamp:
    """Say with what a step would be measured now."""
    study = step.command.split("-m ")[1].split()[0].rpartition(".")[2]
    folder = root / "src" / "isomatch_lab" / "studies"
    code = b"".join((folder / name).read_bytes() for name in (f"{study}.py", *SHARED))
    return {
        "source": source_hash(root / "src" / "isomatch"),
        "command": step.command,
        "scripts": hashlib.sha256(code).hexdigest()[:16],
        "machine": processor(),
        "versions": {name: version(name) for name in PACKAGES} | {"python": platform.python_version()},
    }


def revision(root: Path = ROOT) -> str:
    """Name the commit, and tell whether what measures was changed since."""
    head, changed = (
        subprocess.run(["git", *command], cwd=root, capture_output=True, encoding="utf-8").stdout.strip()
        for command in (("rev-parse", "--short", "HEAD"), ("status", "--porcelain", "src"))
    )
    return head + "-changed" * bool(changed)


def stamps(root: Path = ROOT) -> dict[str, Stamp]:
    """Stamps of all results."""
    path = root / RESULTS / "stamps.json"
    return dict(json.loads(path.read_text(encoding="utf-8"))) if path.exists() else {}


def is_present(step: Step, root: Path = ROOT) -> bool:
    """Tell whether a step was measured with what is there now."""
    before = stamps(root).get(step.name, {})
    return all(before.get(key) == value for key, value in present_stamp(step, root).items())


def measure(step: Step, data: str, output: Path, root: Path = ROOT) -> None:
    """Run the command of a step, copy what it wrote, and stamp it."""
    stamp = present_stamp(step, root)
    stamp_text = json.dumps(stamp, sort_keys=True).encode()
    out = output / f"{step.name}_{hashlib.sha256(stamp_text).hexdigest()[:16]}"
    out.mkdir(parents=True, exist_ok=True)
    clock = out / "seconds.txt"  # seconds of this run and of interrupted ones
    spent = float(clock.read_text(encoding="utf-8")) if clock.exists() else 0.0
    started = time.monotonic()
    try:
        words = [word.format(data=data, out=out) for word in step.command.split()]
        subprocess.run([sys.executable, *words[1:]], cwd=root, check=True)
    finally:
        seconds = round(spent + time.monotonic() - started)
        clock.write_text(str(seconds), encoding="utf-8")
    if present_stamp(step, root) != stamp:
        raise SystemExit(f"{step.name}: the source was changed while it was measured; measure it again")
    for target, file in [
        *((root / RESULTS / f"{name}.csv", file) for name, file in step.tables.items()),
        *((root / "docs" / name, file) for name, file in step.files.items()),
    ]:
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(out / file, target)
    stamp |= {"revision": revision(root), "date": date.today().isoformat(), "seconds": seconds}
    every = dict(sorted((stamps(root) | {step.name: stamp}).items()))
    (root / RESULTS / "stamps.json").write_text(json.dumps(every, indent=1) + "\n", encoding="utf-8")
    clock.unlink()


def tables_of(text: str) -> list[str]:
    """Names of the tables that a page shows."""
    return [place[1] for place in MARKED.finditer(text) if place[1] not in NOT_TABLES]


def steps_of(text: str) -> list[str]:
    """Names of the steps that make the tables of a page."""
    shown = set(tables_of(text))
    return [step.name for step in STEPS if shown & set(step.tables)]


def filled(text: str, stamps: dict[str, Stamp], results: Path = ROOT / RESULTS) -> str:
    """Fill the marked places of a page."""

    def fill(place: re.Match[str]) -> str:
        name, columns, old = place.groups()
        if name == "stamp":
            steps = columns.split("; ") if columns else steps_of(text)
            new = describe_measurement({step: stamps[step] for step in steps})
        elif name == "beside":
            new = published.beside(results)
        else:
            new = render_table(results / f"{name}.csv", columns)
        return place[0].replace(f"-->\n{old}<!--", f"-->\n{new}<!--")

    return MARKED.sub(fill, text)


def read_table(path: Path) -> list[list[str]]:
    """Read all lines, the head first."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.reader(file))


def render_table(path: Path, columns: str | None) -> str:
    """Give a table, or some of its columns, as Markdown."""
    lines = read_table(path)
    chosen = [lines[0].index(column) for column in columns.split("; ")] if columns else range(len(lines[0]))
    head, *rows = [[line[i] for i in chosen] for line in lines]
    return published.markdown(head, rows)


def describe_measurement(shown: dict[str, Stamp]) -> str:
    """Say where and when the tables of a page were measured; name tables of older revisions, which have no stamp."""
    lines = []
    stamped = {name: stamp for name, stamp in shown.items() if stamp["source"]}
    if stamped:
        require_one_stamp(stamped)
        last = max(stamped.values(), key=lambda stamp: stamp["date"])
        revisions = " and ".join(dict.fromkeys(stamp["revision"] for stamp in stamped.values()))
        packages = ", ".join(f"{name} {number}" for name, number in last["versions"].items())
        lines.append(
            f"Measured in revision {revisions} (source {last['source']}), {last['date']}, on "
            f"{last['machine']}, with {packages}.\n"
        )
    older = [
        f"{name} ({stamp['revision'] or 'not stated'})"
        for name, stamp in shown.items()
        if not stamp["source"]
    ]
    if older:
        lines.append(f"Measured earlier, in these revisions: {', '.join(older)}.\n")
    return "".join(lines)


def require_one_stamp(shown: dict[str, Stamp]) -> None:
    """Refuse tables on one page that were measured with different sources, machines or packages."""
    stamps = {
        name: {key: stamp[key] for key in ("source", "machine", "versions")} for name, stamp in shown.items()
    }
    if any(stamp != next(iter(stamps.values())) for stamp in stamps.values()):
        stated = "; ".join(f"{name}: {stamp}" for name, stamp in stamps.items())
        raise SystemExit(f"tables of one page have different stamps; measure the older ones again: {stated}")


def pages() -> list[Path]:
    """Pages that may show tables."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def main() -> None:
    """Run what is asked for, and fill the pages."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", help="folder of the benchmark sets")
    parser.add_argument(
        "-o", "--output", type=Path, default=ROOT / "results", help="folder for all that is written"
    )
    parser.add_argument("--pages", action="store_true", help="only fill the pages")
    parser.add_argument("--list", action="store_true", help="list the steps and their states")
    parser.add_argument("steps", nargs="*", metavar="STEP", help=", ".join(step.name for step in STEPS))
    asked = parser.parse_args()
    unknown = set(asked.steps) - {step.name for step in STEPS}
    if unknown:
        parser.error(
            f"no such step: {', '.join(sorted(unknown))}; there are {', '.join(s.name for s in STEPS)}"
        )
    if not (asked.data or asked.pages or asked.list):
        parser.error("--data is needed, or --pages, or --list")
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # keep the seconds spent so far
    for step in STEPS:
        if asked.pages or (asked.steps and step.name not in asked.steps):
            continue
        state = "present" if is_present(step) else "to be measured"
        print(f"{step.name}: {state}, some {step.minutes} minutes", flush=True)
        if not asked.list and state != "present":
            measure(step, str(Path(asked.data).resolve()), asked.output.resolve())
    if not asked.list:
        refused = []
        for page in pages():
            text = page.read_text(encoding="utf-8")
            try:
                page.write_text(filled(text, stamps()), encoding="utf-8")
            except SystemExit as error:
                refused.append(f"{page.relative_to(ROOT)}: {error}")
        if refused:
            raise SystemExit("\n".join(refused))


if __name__ == "__main__":
    main()
