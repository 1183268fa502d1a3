"""What libraries write to standard error is kept for later."""

import os
import subprocess
import sys
import tempfile

from replay.cli.diverted import diverted_stderr, lines_of


def test_what_anybody_writes_to_standard_error_goes_to_a_file_and_then_where_it_went_before(capfd):
    with tempfile.TemporaryFile() as file:
        with diverted_stderr(file) as shown:
            print("by Python", file=sys.stderr)
            os.write(2, b"by native code\nby native code  \n\n")
            subprocess.run([sys.executable, "-S", "-c", "import os; os.write(2, b'by a process\\n')"], check=True)
            print("for the user", file=shown)
        assert lines_of(file) == ["by Python", "by native code (2 times)", "by a process"]
        assert lines_of(file) == []
        os.write(2, b"afterwards\n")
        with diverted_stderr(file):
            os.write(2, b"once more\n")
        assert lines_of(file) == ["once more"]
    assert capfd.readouterr().err == "for the user\nafterwards\n"
