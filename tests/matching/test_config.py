"""Settings: checked when made, read from a file."""

import json

import pytest

from isomatch import Config


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"weights": "mass"}, "weights = 'mass' is not one of 'area', 'uniform'"),
        ({"refinement": "magic"}, "refinement = 'magic' is not one of 'none', 'laplace_icp', 'joint'"),
        ({"hypotheses": "some"}, "hypotheses = 'some' is not one of 'all', 'given'"),
        ({"orientation": "up"}, "orientation = 'up' is not one of 'preserve', 'reverse', 'any'"),
        ({"rank": 3}, "rank = 3 is not an integer of at least 4"),
        ({"n_columns": 7}, "n_columns = 7 is not an integer of at least 8"),
        ({"n_functions": 19}, "n_functions = 19 is not an integer of at least 20"),
        ({"n_search": 0}, "n_search = 0 is not an integer of at least 100"),
        ({"n_refine": -1}, "n_refine = -1 is not an integer of at least 100"),
        ({"rank": 101}, "rank = 101 exceeds n_columns = 100"),
    ],
)
def test_settings_that_make_no_sense(setting, message):
    with pytest.raises(ValueError, match=message):
        Config(**setting)


def test_read_from_a_file(tmp_path):
    (tmp_path / "config.toml").write_text('rank = 30\nweights = "uniform"\n', encoding="utf-8")
    assert Config.from_file(tmp_path / "config.toml") == Config(rank=30, weights="uniform")


def test_unknown_setting_in_a_file(tmp_path):
    (tmp_path / "config.toml").write_text("rang = 30\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"config\.toml: unknown setting rang; known are n_columns, rank"):
        Config.from_file(tmp_path / "config.toml")


def test_plain_values_make_the_same_settings():
    config = Config(rank=12, orientation="any")
    assert Config(**json.loads(json.dumps(config.to_dict()))) == config
