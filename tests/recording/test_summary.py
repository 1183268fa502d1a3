"""A log at a glance."""

import pytest
from mcap.writer import Writer

from replay.recording.summary import summarize


def log(path, times):
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel("/a", "json", 0)
        for time in times:
            writer.add_message(channel, time, b"{}", time)
        writer.finish()
    return path


@pytest.mark.parametrize(
    ("times", "told"),
    [
        ([10**18, 10**18 + 86_400 * 10**9], ["2001-09-09 01:46:40 to 2001-09-10 01:46:40 UTC"]),
        ([10**18 - 1, 10**18 + 10**9], []),  # a clock that began with the machine, and ran for long
        ([0, 10**9], []),
        ([], None),
    ],
)
def test_log_times_of_this_century_are_told_as_dates(tmp_path, times, told):
    lines = [line.strip() for line in summarize(log(tmp_path / "a.mcap", times)).lines()]
    at = [k for k, line in enumerate(lines) if line.startswith("log times")]
    if told is None:
        assert at == []
        return
    assert lines[at[0]] == f"log times {times[0]} to {times[-1]} ns"
    assert [line for line in lines if line.endswith("UTC")] == told
