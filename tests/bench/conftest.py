"""The pipeline's scene with a body of 1 000 triangles."""

from importlib import resources

import pytest

from replay.scenario.load import load


@pytest.fixture(scope="session")
def small(tmp_path_factory):
    text = resources.files("replay.bench").joinpath("pipeline.yaml").read_text()
    file = tmp_path_factory.mktemp("bench") / "small.yaml"
    file.write_text(text.replace("adult_male.stl", "adult_male_reduced_1000t.stl"))
    return load(file)
