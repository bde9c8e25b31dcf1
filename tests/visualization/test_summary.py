"""What came out of a match, in plain words."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from isomatch import Config, Mesh, Outcome, match
from isomatch.matching import DoubtfulRegion
from isomatch.visualization import HEADLINES, summary_of
from isomatch.visualization.summary import ANOTHER_IS_BETTER, MOSTLY_RIGHT, PARTLY_SURE
from shapes import icosphere

JARGON = re.compile(
    r"spectral residual|runner-up|residual|coverage|orientation-|isometr|stress|torn|bound", re.IGNORECASE
)


@pytest.fixture(scope="module")
def result():
    sphere = icosphere(2)
    shape = Mesh(sphere.vertices * [1.0, 2.0, 0.6] + 0.1 * sphere.vertices[:, ::-1] ** 2, sphere.faces)
    return match(
        shape, shape, config=Config(n_columns=40, rank=20, n_functions=60, n_search=100, n_refine=120)
    )


@pytest.fixture
def sure(result):
    errors = np.full(len(result.map.vertices), 0.01)
    return replace(result, outcome=Outcome.CONVERGED, regions=(), expected_error=errors, target_size=250.0)


@pytest.mark.parametrize("outcome", Outcome)
def test_every_outcome_has_a_sentence_and_advice_without_jargon(sure, outcome):
    summary = summary_of(replace(sure, outcome=outcome))
    assert summary.headline.endswith(".")
    assert summary.advice.endswith(".") or summary.advice.endswith("?")
    assert not JARGON.search(str(summary))
    assert len(summary.headline) < 80


def test_a_result_prints_as_its_summary_and_outside_a_notebook_says_how_it_is_shown(sure, caplog):
    assert str(sure) == str(summary_of(sure))
    assert repr(sure) == f"MatchResult(CONVERGED, {sure.map!r})"
    shape = Mesh(icosphere(2).vertices, icosphere(2).faces)
    unbound = replace(sure, map=replace(sure.map, source_hash="", target_hash=""))
    unbound.show(shape, shape)
    assert "write_report('report.html'" in caplog.text


@pytest.mark.parametrize("outcome", Outcome)
def test_settings_that_are_advised_exist(sure, outcome):
    summary = summary_of(replace(sure, outcome=outcome))
    for name, value in re.findall(r"--([a-z]+) ([a-z]+)", summary.advice):
        assert getattr(Config(**{name: value}), name) == value
        assert f"{name} = '{value}'" in summary.advice_in_python
    assert "--" not in summary.advice_in_python


def test_the_page_about_outcomes_has_each_sentence():
    page = (Path(__file__).parents[2] / "docs" / "understand.md").read_text(encoding="utf-8")
    for outcome, headline in HEADLINES.items():
        _, section = page.split(f"\n## {headline}\n")
        assert f"`{outcome.name}`" in section.split("\n## ")[0]
    assert all(f"*{headline}*" in page for headline in (PARTLY_SURE, MOSTLY_RIGHT, ANOTHER_IS_BETTER))


def test_doubt_is_a_share_of_the_surface(sure):
    regions = tuple(
        DoubtfulRegion(np.array([v]), area, "it looks unlike its image") for v, area in ((3, 0.05), (9, 0.01))
    )
    told = summary_of(replace(sure, outcome=Outcome.LOW_CONFIDENCE, regions=regions))
    assert (
        "6.0% of the surface is in doubt, most of it around vertex 3, where it looks unlike" in told.sureness
    )
    assert "Expected error" not in told.sureness
    told = "No region is in doubt. Expected error: 1.0% of the size (√area), or 2.5 in the target's units."
    assert summary_of(sure).sureness == told
    without = replace(sure, target_size=np.nan)
    assert summary_of(without).sureness == "No region is in doubt. Expected error: 1.0% of the size (√area)."


def test_points_that_may_be_far_off_are_counted(sure):
    errors = sure.expected_error.copy()
    errors[: len(errors) // 4] = 0.2
    many = summary_of(replace(sure, expected_error=errors))
    assert "more than 5% at 25% of the points" in many.sureness
    assert many.headline == PARTLY_SURE
    assert "No region is in doubt" not in many.sureness
    errors[len(errors) // 50 :] = 0.01
    few = summary_of(replace(sure, expected_error=errors))
    assert few.headline == HEADLINES[Outcome.CONVERGED]
    assert "No region is in doubt" not in few.sureness
    region = DoubtfulRegion(np.array([3]), 0.05, "it looks unlike its image")
    assert summary_of(replace(sure, regions=(region,))).headline == PARTLY_SURE


def test_a_headline_says_whether_all_or_some_is_in_doubt(sure):
    low = replace(sure, outcome=Outcome.LOW_CONFIDENCE)
    region = DoubtfulRegion(np.array([0]), 0.03, "it looks unlike its image")
    good = replace(
        low.quality,
        runner_up=np.inf,
        spectral_residual=0.1,
        residual=0.1,
        stretch=1.0,
        orientation=1.0,
        torn_off=0.0,
    )
    assert "may be wrong altogether" in summary_of(replace(low, quality=good)).sureness
    assert summary_of(replace(low, quality=good, regions=(region,))).headline.startswith(
        "Most of this map looks right"
    )
    bad = replace(good, spectral_residual=5.0)
    assert (
        summary_of(replace(low, quality=bad, regions=(region,))).headline == HEADLINES[Outcome.LOW_CONFIDENCE]
    )
    beaten = replace(good, runner_up=0.9)
    assert "another one fits" in summary_of(replace(low, quality=beaten)).headline


def test_where_doubt_was_not_looked_for_nothing_is_said(sure):
    part = replace(sure.quality, doubt=1e-6, matched=0.9, coverage=0.5)
    told = summary_of(replace(sure, outcome=Outcome.PARTIAL, quality=part, way="part")).sureness
    assert told.startswith("90% of the source's points and 50% of the target's surface have a partner.")
    assert "No region" not in told
