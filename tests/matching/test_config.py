"""Settings: checked when made, read from a file."""

import json
from dataclasses import fields, is_dataclass

import pytest

from isomatch import Config
from isomatch._core.settings import Settings
from isomatch.settings import SearchSettings


@pytest.mark.parametrize(
    "setting",
    [
        {"weights": "mass"},
        {"refinement": "magic"},
        {"rank": 3},
        {"n_columns": 7},
        {"n_refine": -1},
        {"n_search": True},
        {"engine": "teleport"},
        {"search": {"n_hypotheses": 3}},
    ],
)
def test_settings_that_make_no_sense(setting):
    (name,) = setting
    with pytest.raises(ValueError, match=f"{name} = "):
        Config(**setting)


def test_no_more_is_asked_for_than_there_is():
    with pytest.raises(ValueError, match="rank"):
        Config(rank=101)
    with pytest.raises(ValueError, match="n_refine"):
        Config(n_refine=100)


def test_read_from_a_file(tmp_path):
    (tmp_path / "config.toml").write_text('rank = 30\nweights = "uniform"\n', encoding="utf-8")
    assert Config.from_file(tmp_path / "config.toml") == Config(rank=30, weights="uniform")


def test_unknown_setting_in_a_file(tmp_path):
    (tmp_path / "config.toml").write_text("rang = 30\n", encoding="utf-8")
    with pytest.raises(ValueError, match="unknown"):
        Config.from_file(tmp_path / "config.toml")


def test_plain_values_make_the_same_settings():
    config = Config(rank=12, orientation="any", search=SearchSettings(n_hypotheses=9, extremity_counts=(5,)))
    assert Config.from_dict(json.loads(json.dumps(config.to_dict()))) == config


def test_stages_are_tables_of_a_file(tmp_path):
    (tmp_path / "config.toml").write_text(
        "rank = 30\n[search]\nn_hypotheses = 20\noff_diagonal = [0.01]\n", encoding="utf-8"
    )
    config = Config.from_file(tmp_path / "config.toml")
    assert config == Config(rank=30, search=SearchSettings(n_hypotheses=20, off_diagonal=(0.01,)))


def test_unknown_setting_of_a_stage(tmp_path):
    (tmp_path / "config.toml").write_text("[search]\npond = 20\n", encoding="utf-8")
    with pytest.raises(ValueError, match="unknown"):
        Config.from_file(tmp_path / "config.toml")


@pytest.mark.parametrize(
    "values",
    [
        {"off_diagonal": (0.1, -1.0)},
        {"off_diagonal": 0.1},
        {"off_diagonal": ()},
        {"unchanged": 1.5},
        {"n_hypotheses": 2.5},
        {"ridge": float("nan")},
    ],
)
def test_settings_of_a_stage_that_make_no_sense(values):
    (name,) = values
    with pytest.raises(ValueError, match=name):
        SearchSettings(**values)


def settings_classes():
    """Config and the settings of its stages."""
    stages = [type(getattr(Config(), setting.name)) for setting in fields(Config)]
    return [Config, *(stage for stage in stages if is_dataclass(stage))]


@pytest.mark.parametrize("kind", settings_classes(), ids=lambda kind: kind.__name__)
def test_every_default_names_its_source_and_is_documented(kind):
    assert issubclass(kind, Settings)
    for setting in fields(kind):
        if not issubclass(type(getattr(kind(), setting.name)), Settings):
            assert setting.metadata.get("source"), (
                f"{kind.__name__}.{setting.name} does not say where it comes from"
            )
        assert setting.name in kind.__doc__, f"{kind.__name__}.{setting.name} is not documented"


def test_what_was_changed():
    assert Config().changed() == {}
    config = Config(rank=30, search=SearchSettings(n_hypotheses=9))
    assert config.changed() == {"rank": 30, "search.n_hypotheses": 9}
