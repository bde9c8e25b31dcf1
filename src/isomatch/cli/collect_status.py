"""The messages of ``isomatch collect``: how far a collection is, and each step of a run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from isomatch import collections, view
from isomatch.cli.terminal import Talk, say, say_rows
from isomatch.matching import Outcome

OUTCOMES = 26  # columns of a number of pairs with their outcome


def tell_status(
    collection: collections.Collection,
    talk: Talk,
    landmarks: Mapping[str, Any] | None = None,
    *,
    is_answer: bool = False,
) -> None:
    """Tell how far a collection is, in words or as JSON, with the landmarks that were carried.

    As an answer, with all files that were damaged; a run has just compared most of them.
    """
    status = status_of(collection, collections.KEPT if is_answer else ("landmarks",))
    if landmarks:
        status["landmarks"] = landmarks
    talk.result(status, lambda: _say_status(status, collection.layout), is_answer=is_answer)


def status_of(collection: collections.Collection, folders: Iterable[str] = ()) -> dict[str, Any]:
    """Sum up how far a collection is, from the ledgers of all shards, with the damaged files of some folders."""
    rows = collection.rows()
    pairs = collection.wanted_pairs(rows)
    states = Counter(collections.state_of(rows.pairs.get(pair, {"state": "todo"})) for pair in pairs)
    outcomes = Counter(
        rows.pairs[pair]["there"]["outcome"]
        for pair in pairs
        if rows.pairs.get(pair, {}).get("state") == "done"
    )
    changed = collections.changed_files(collection.layout, rows, folders)
    damaged = {str(path.relative_to(collection.folder)): what for path, what in changed.items()}
    damaged |= dict.fromkeys(rows.damaged, "is no row of a collection, and was ignored")
    failures = {name: row["error"] for name, row in rows.shapes.items() if row["state"] == "failed"}
    failures |= {
        " and ".join(pair): row["error"] for pair, row in rows.pairs.items() if row["state"] == "failed"
    }
    mirrored = collections.mirror_images(collection, rows)
    prepared = sum(row["state"] == "done" for row in rows.shapes.values())
    return {
        "folder": str(collection.folder),
        "shapes": {"all": len(collection.shapes), "prepared": prepared},
        "template": collection.chosen_template(rows),
        "pairs": {"all": len(pairs), **states},
        "outcomes": dict(outcomes),
        "reflected": rows.reflected(collection.names),
        "mirror_images": {
            name: rows.pairs[pair].get("not_reflected", {}).get(name) for name, pair in mirrored.items()
        },
        "misfits": [misfit._asdict() for misfit in collections.misfits(collection, rows)],
        "agreement": collections.agreement_of(rows)._asdict(),
        "damaged": damaged,
        "failures": failures,
    }


def _say_status(status: dict[str, Any], layout: collections.Layout) -> None:
    shapes, pairs, agreement = status["shapes"], status["pairs"], status["agreement"]
    done = pairs.get("done", 0) + pairs.get("low", 0)
    failed = f", {pairs['failed']} failed" if pairs.get("failed") else ""
    say(
        f"{done} of {pairs['all']} pairs matched{failed}; {shapes['prepared']} of {shapes['all']} shapes prepared",
        "bold",
    )
    for outcome in Outcome:
        if count := status["outcomes"].get(outcome.name):
            say_rows([(f"{count} {outcome.value}", view.HEADLINES[outcome])], indent=OUTCOMES)
    say(f"template {status['template'] or 'not yet chosen'}")
    if agreement["compared"]:
        say(
            f"{agreement['compared']} pairs compared with compositions: {len(agreement['contradicted'])} contradicted, "
            f"{len(agreement['replaced'])} replaced"
        )
    if agreement["turned"]:
        say(
            f"maps to {', '.join(agreement['turned'])} mostly reverse the orientation: perhaps mirrored together",
            "bold red",
        )
    _say_sides(status)
    for misfit in status["misfits"]:
        if misfit["kind"] != "broken" and misfit["name"] not in status["mirror_images"]:
            say(f"look at {misfit['name']}: it {misfit['reason']}", "bold red")
    for name, what in status["damaged"].items():
        say(f"{name} {what}; run isomatch collect again, which makes it again", "bold red")
    for name, error in status["failures"].items():
        say(f"failed: {name}: {error}", "bold red")
    say(f"open first: {layout.page}; the table is {layout.table.name}")


def _say_sides(status: dict[str, Any]) -> None:
    """Name the shapes that were reflected, and those that seem to be mirror images of the others."""
    if status["reflected"]:
        say(f"reflected before they were matched: {', '.join(status['reflected'])}")
    untried = [name for name, reason in status["mirror_images"].items() if reason is None]
    if untried:
        say(
            f"seem to be mirror images of the others: {', '.join(untried)}; run again with --reflect auto, "
            "or with the names of those to reflect",
            "bold red",
        )
    for name, reason in status["mirror_images"].items():
        if reason is not None:
            say(f"seems to be a mirror image, but not reflected: {name}: {reason}", "bold red")


def told(event: collections.Event) -> tuple[str, float]:
    """Describe a step of a run, with the share of its steps that are done."""
    name = event.name if isinstance(event.name, str) else " and ".join(event.name)
    what = {
        "shape": "prepared",
        "misfit": "looked at",
        "pair": "matched",
        "reflection": "reflected",
        "agreement": "compared",
    }[event.what]
    reasons = reasons_of(event)
    again = f"; again, because {'; '.join(reasons)}" if reasons else ""
    return f"{what} {event.done} of {event.of}: {name}, {_ending(event.record)}{again}", event.done / event.of


def reasons_of(event: collections.Event) -> list[str]:
    """Return why a shape or a pair was done again, if it was."""
    return event.record.get("again", []) if event.what in ("shape", "pair") else []


def _ending(record: dict[str, Any]) -> str:
    if "reason" in record:
        return str(record["reason"])
    if record["state"] == "failed":
        return f"failed: {record['error']}"
    if "not_reflected" in record:
        return f"not kept: {', '.join(record['not_reflected'].values())}"
    if "refused" in record.get("agreement", {}):
        return f"contradicted, but not replaced: {record['agreement']['refused']}"
    if "replaced_by" in record:
        return f"replaced by the composition over {record['replaced_by'][1]}"
    return str(record["there"]["outcome"]).lower().replace("_", " ") if "there" in record else "done"
