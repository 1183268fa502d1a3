"""A night has room for so many drawings, and the pages say which scenarios are not wholly drawn."""

from replay.batch import drawings
from replay.cli.exit_codes import ExitCode
from tests.cli.nights import night, prepare


def test_what_there_is_no_room_for_is_told(tmp_path, monkeypatch):
    prepare(tmp_path, plain=1, bad=0, differing=3)
    names = ["differ_0", "differ_1", "differ_2", "plain_0"]
    pages = {}
    for room in (drawings.ROOM, 2500):
        monkeypatch.setattr(drawings, "ROOM", room)
        assert night(tmp_path, tmp_path / "out", "--rrd", "none") is ExitCode.DIFFERENT
        pages[room] = [(tmp_path / "out" / name / "report.html").read_text() for name in names]
    everything, some = pages.values()
    assert [part.count("Not all is drawn") for part in everything] == [0, 0, 0, 0]
    assert [part.count("Not all is drawn") for part in some] == [0, 1, 1, 0]
    drawn = [part.count("<svg") for part in some]
    assert drawn[0] == everything[0].count("<svg") > 0
    assert drawn[1] < everything[1].count("<svg")
    assert drawn[2:] == [0, 0]


def test_one_long_scenario_does_not_take_the_room_of_all(tmp_path, monkeypatch):
    prepare(tmp_path, plain=0, bad=0, differing=2)
    monkeypatch.setattr(drawings, "ROOM_OF_ONE", 1000)
    assert night(tmp_path, tmp_path / "out", "--rrd", "none") is ExitCode.DIFFERENT
    pages = [(tmp_path / "out" / f"differ_{k}" / "report.html").read_text() for k in range(2)]
    assert pages[0].count("<svg") == pages[1].count("<svg") > 0
    assert all("Not all is drawn" in page for page in pages)
