"""A night's page has room for so many drawings, and says which scenarios are not drawn."""

import re

from replay.batch import drawings
from replay.cli.exit_codes import ExitCode
from tests.cli.nights import night, prepare


def test_what_there_is_no_room_for_is_told(tmp_path, monkeypatch):
    prepare(tmp_path, plain=1, bad=0, differing=3)
    pages = {}
    for room in (drawings.ROOM, 2500):
        monkeypatch.setattr(drawings, "ROOM", room)
        assert night(tmp_path, tmp_path / "out", "--rrd", "none") is ExitCode.DIFFERENT
        page = (tmp_path / "out" / "index.html").read_text()
        pages[room] = re.findall(r"<details class=.scenario.*?(?=<details class=.scenario|</main>)", page, re.DOTALL)
    everything, some = pages.values()
    assert [part.count("Not all is drawn") for part in everything] == [0, 0, 0, 0]
    assert [part.count("Not all is drawn") for part in some] == [0, 1, 1, 0]
    drawn = [part.count("<svg") for part in some]
    assert drawn[0] == everything[0].count("<svg") > 0
    assert drawn[1] < everything[1].count("<svg")
    assert drawn[2:] == [0, 0]
