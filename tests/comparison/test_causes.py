"""What has changed beside the results of two runs."""

import dataclasses

import pytest

from replay.comparison.causes import causes
from replay.recording.provenance import sha256
from tests.comparison import made_up


def written(path, text):
    """A recording whose scenario has a text."""
    files = {**made_up.FILES, "run.yaml": text.encode()}
    recording = dataclasses.replace(made_up.recording(), files=files)
    known = {**recording.provenance.files, "run.yaml": sha256(files["run.yaml"])}
    return made_up.write(made_up.with_provenance(recording, files=known), path)


@pytest.mark.parametrize(("changed", "added", "cut"), [(98, 0, 0), (98, 1, 0), (99, 0, 1), (300, 0, 403)])
def test_of_a_long_difference_of_texts_two_hundred_lines_are_kept_and_the_others_counted(tmp_path, changed, added, cut):
    """`diff -u` writes two lines of names, one of places, and what goes and what comes."""
    a = written(tmp_path / "a.mcap", "".join(f"# was {k}\n" for k in range(changed)))
    b = written(tmp_path / "b.mcap", "".join(f"# is {k}\n" for k in range(changed + added)))
    lines = causes(a, b).text.splitlines()
    total = 3 + 2 * changed + added
    assert total - cut == min(total, 200)
    assert len(lines) == total - cut + (cut > 0)
    assert lines[:4] == ["--- baseline/run.yaml", "+++ candidate/run.yaml", lines[2], "-# was 0"]
    assert (lines[-1] == f"... and {cut} more lines") == (cut > 0)
    assert causes(a, a).text == ""
