"""Settings: checked when made, read from a file."""

import ast
import inspect
import json
from dataclasses import fields, is_dataclass
from itertools import pairwise

import pytest

from isomatch import Config, SettingError
from isomatch._core.settings import Settings
from isomatch.settings import SearchSettings


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"weights": "mass"}, "weights = "),
        ({"refinement": "magic"}, "refinement = "),
        ({"rank": 3}, "rank = "),
        ({"rank": 101}, "rank"),
        ({"n_columns": 7}, "n_columns = "),
        ({"n_refine": -1}, "n_refine = "),
        ({"n_refine": 100}, "n_refine"),
        ({"n_search": True}, "n_search = "),
        ({"engine": "teleport"}, "engine = "),
        ({"resolution": "half"}, "resolution = 'half' is not one of 'auto', 'full', 'fast'"),
        ({"rang": 30}, "unknown setting rang"),
        ({"search": 3}, "search = "),
        ({"search": {"pond": 20}}, "unknown setting pond"),
        ({"search": {"off_diagonal": (0.1, -1.0)}}, "off_diagonal"),
        ({"search": {"off_diagonal": 0.1}}, "off_diagonal"),
        ({"search": {"off_diagonal": ()}}, "off_diagonal"),
        ({"search": {"unchanged": 1.5}}, "unchanged"),
        ({"search": {"n_hypotheses": 2.5}}, "n_hypotheses"),
        ({"search": {"ridge": float("nan")}}, "ridge"),
        ({"levels": {"matched": 100}}, "matched = 100 is not an integer of at least 200"),
        ({"levels": {"spared": 0.5}}, "spared = 0.5 is not a number of at least 1"),
        ({"levels": {"polished": 3000}}, "polished = 3000 is below matched = 5000"),
        ({"levels": {"fast_polished": 2000}}, "fast_polished = 2000 is below fast_matched = 2500"),
        ({"refining": {"polished_sizes": []}}, "polished_sizes is empty"),
    ],
)
def test_settings_that_make_no_sense(values, message):
    with pytest.raises(SettingError, match=message):
        Config.from_dict(values)


def test_stages_are_tables_of_a_file(tmp_path):
    text = 'rank = 30\nweights = "uniform"\n[search]\nn_hypotheses = 20\noff_diagonal = [0.01]\n'
    (tmp_path / "config.toml").write_text(text, encoding="utf-8")
    search = SearchSettings(n_hypotheses=20, off_diagonal=(0.01,))
    assert Config.from_file(tmp_path / "config.toml") == Config(rank=30, weights="uniform", search=search)


def test_plain_values_make_the_same_settings():
    config = Config(rank=12, orientation="any", search=SearchSettings(n_hypotheses=9, extremity_counts=(5,)))
    assert Config.from_dict(json.loads(json.dumps(config.to_dict()))) == config


def settings_classes():
    """Config and the settings of its stages."""
    stages = [type(getattr(Config(), setting.name)) for setting in fields(Config)]
    return [Config, *(stage for stage in stages if is_dataclass(stage))]


def fields_with_sentence(kind):
    """Names of the fields of a class that a string below them describes."""
    body = ast.parse(inspect.getsource(kind)).body[0].body
    pairs = pairwise(body)
    return {a.target.id for a, b in pairs if isinstance(a, ast.AnnAssign) and isinstance(b, ast.Expr)}


@pytest.mark.parametrize("kind", settings_classes(), ids=lambda kind: kind.__name__)
def test_every_default_names_its_source_and_is_documented(kind):
    assert issubclass(kind, Settings)
    for setting in fields(kind):
        if not issubclass(type(getattr(kind(), setting.name)), Settings):
            assert setting.metadata.get("source"), (
                f"{kind.__name__}.{setting.name} does not say where it comes from"
            )
        is_documented = setting.name in kind.__doc__ or setting.name in fields_with_sentence(kind)
        assert is_documented, f"{kind.__name__}.{setting.name} is not documented"


def test_what_was_changed():
    assert Config().changed() == {}
    config = Config(rank=30, search=SearchSettings(n_hypotheses=9))
    assert config.changed() == {"rank": 30, "search.n_hypotheses": 9}
