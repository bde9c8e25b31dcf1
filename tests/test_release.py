"""What is published repeats one version, address and DOI, and meets what the places ask for that can be tested here."""

import json
import re
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "release"))
import check_wording  # noqa: E402
import prepare  # noqa: E402

NOW = prepare.Release.read()
LATER = prepare.Release(
    NOW.version,
    "https://example.org/isomatch",
    "https://example.org/s",
    "10.1234/x",
    "2031-05-07",
    ("pip", "conda"),
)


def test_every_file_repeats_what_is_published():
    for file, text in prepare.prepared(NOW).items():
        assert (ROOT / file).read_text(encoding="utf-8") == text, f"run release/prepare.py: {file}"


def test_values_appear_everywhere_and_go_again(tmp_path):
    """Filled in, no line says that something is missing; emptied, the files are as before."""
    filled = prepare.prepared(LATER)
    assert not [file for file, text in filled.items() if prepare.PENDING in text]
    citation = yaml.safe_load(filled["CITATION.cff"])
    assert (citation["doi"], citation["repository-code"]) == (LATER.doi, LATER.address)
    assert str(citation["date-released"]) == LATER.date in filled["CHANGELOG.md"]
    assert tomllib.loads(filled["pyproject.toml"])["project"]["urls"]["Source"] == LATER.address
    assert yaml.safe_load(filled["release/recipe.yaml"])["about"]["homepage"] == LATER.address
    assert "date: 7 May 2031" in filled["release/joss/paper.md"]
    for file, text in filled.items():
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_text(text, encoding="utf-8")
    assert prepare.prepared(NOW, tmp_path) == prepare.prepared(NOW)


def test_a_line_that_is_gone_or_a_wrong_value_is_told():
    with pytest.raises(SystemExit, match=r"CITATION.cff has 0 lines 'doi: \{\}'"):
        prepare.Place("CITATION.cff", "doi: {}", "x").written("title: isomatch\n")
    for wrong in ({"address": "example.org/"}, {"doi": "https://x"}, {"date": "May"}, {"indexes": ("npm",)}):
        with pytest.raises(SystemExit, match=next(iter(wrong))):
            prepare.Release("1.2.3", **wrong)


def test_conda_forge_gets_the_sdist_and_slicer_an_entry_and_patents():
    recipe = (ROOT / "release" / "recipe.yaml").read_text(encoding="utf-8")
    source = yaml.safe_load(prepare.released_recipe(LATER, recipe, "ab12"))["source"]
    assert source.pop("url").startswith(f"{LATER.address}/releases/download/v")
    assert source == {"sha256": "ab12"}
    entry = json.loads(prepare.catalogue_entry(LATER))
    assert {"$schema", "category", "scm_url"} <= set(entry)
    assert (entry["scm_url"], entry["tier"]) == (f"{LATER.slicer_address}.git", 1)
    cmake = (ROOT / "extras" / "slicer" / "CMakeLists.txt").read_text(encoding="utf-8")
    assert re.search(r"EXTENSION_DESCRIPTION .*patents: US \d+", cmake)


def test_blender_gets_a_manifest_with_all_fields():
    folder = ROOT / "extras" / "blender" / "isomatch_blender"
    manifest = tomllib.loads((folder / "blender_manifest.toml").read_text(encoding="utf-8"))
    assert {*["schema_version", "id", "version", "name", "tagline", "maintainer", "type", "license"]} <= {
        *manifest
    }
    assert len(manifest["tagline"]) <= 64
    assert manifest["tagline"][-1].isalnum()
    assert "blender" not in manifest["name"].lower()
    assert all(len(why) <= 64 and why[-1].isalnum() for why in manifest["permissions"].values())


def test_zenodo_and_citation_say_what_the_project_says():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    record = json.loads((ROOT / ".zenodo.json").read_text(encoding="utf-8"))
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert {"upload_type", "title", "creators", "description", "license"} <= set(record)
    assert record["keywords"] == citation["keywords"] == project["keywords"]
    assert record["license"] == citation["license"] == project["license"]
    assert record["creators"] == citation["authors"]
    assert citation["abstract"].rstrip(".") == project["description"]


def test_the_paper_has_its_sections_references_and_measured_numbers():
    _, head, body = (ROOT / "release/joss/paper.md").read_text(encoding="utf-8").split("---\n", 2)
    assert {"title", "tags", "authors", "affiliations", "bibliography"} <= set(yaml.safe_load(head))
    assert re.findall("^# (.+)$", body, re.MULTILINE) == [
        *("Summary", "Statement of need", "State of the field", "Software design"),
        *("Research impact statement", "AI usage disclosure", "Acknowledgements", "References"),
    ]
    assert 750 <= len(body.split()) <= 1100  # with bars and rules of the tables
    entries = re.findall(
        r"^@\w+\{(\w+),", (ROOT / "release/joss/paper.bib").read_text(encoding="utf-8"), re.M
    )
    assert sorted(entries) == sorted(set(re.findall(r"@(\w+)", body)))
    readme = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    rows = [line for line in body.splitlines() if line.startswith("|")]
    assert len(rows) > 6
    assert not [row for row in rows if row not in readme]


def test_workflows_pin_their_actions_and_only_publishing_may_identify_itself():
    flows = {path.stem: yaml.safe_load(path.read_bytes()) for path in (ROOT / ".github/workflows").iterdir()}
    jobs = {f"{file}.{name}": job for file, flow in flows.items() for name, job in flow["jobs"].items()}
    actions = [step["uses"] for job in jobs.values() for step in job["steps"] if "uses" in step]
    assert actions
    assert all(re.fullmatch(r"[\w-]+/[\w-]+@[0-9a-f]{40}", action) for action in actions)
    assert [name for name, job in jobs.items() if "id-token" in job.get("permissions", {})] == [
        "publish.publish"
    ]
    assert jobs["publish.publish"]["permissions"] == {"id-token": "write"}
    matrix = jobs["tests.test"]["strategy"]["matrix"]
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert set(re.search(r"^PYTHONS \?= (.*)$", makefile, re.MULTILINE)[1].split()) <= set(matrix["python"])
    assert {name.partition("-")[0] for name in matrix["os"]} == {"ubuntu", "macos", "windows"}


def test_wording_that_readers_have_to_decipher_is_found(tmp_path):
    path = tmp_path / "a.py"
    path.write_text(
        "def add(own):\n    # over the least\n    return [each for each in own]  # all but for two\n"
    )
    assert [line for line, _ in check_wording.faults_of(path)] == [2, 3, 1, 3]
    path.write_text("def add(numbers):\n    # The sum is over all numbers.\n    return sum(numbers)\n")
    assert not [*check_wording.faults_of(path)]
