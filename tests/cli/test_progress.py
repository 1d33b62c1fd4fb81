"""Bars: silent when nobody looks, one for all ranks."""

from __future__ import annotations

import fcntl
import io
import os
import pty
import select
import struct
import subprocess
import sys
import termios

from bladefem.util import progress
from bladefem.util.progress import progress_wanted, with_progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_shown_on_a_terminal_only(monkeypatch):
    monkeypatch.delenv("BLADEFEM_TERMINAL", raising=False)
    monkeypatch.setattr(sys, "stderr", Terminal())
    assert progress_wanted() and not progress_wanted(quiet=True) and not progress_wanted(rank=1)
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    assert not progress_wanted()
    monkeypatch.setenv("BLADEFEM_TERMINAL", "1")
    assert progress_wanted() and not progress_wanted(rank=3)


def test_items_pass_through_and_short_loops_stay_silent(monkeypatch):
    for shown in (True, False):
        screen = Terminal()
        monkeypatch.setattr(sys, "stderr", screen)
        assert list(with_progress((i for i in range(5)), "loads", total=5, shown=shown)) == [
            0,
            1,
            2,
            3,
            4,
        ]
        assert "loads" not in screen.getvalue()


def test_a_long_loop_shows_its_label(monkeypatch):
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    assert len(list(with_progress(range(3), "loads", delay=0.0, mininterval=0.0))) == 3
    assert "loads" in screen.getvalue()


SIZELESS = """
from bladefem.util.progress import with_progress
for _ in with_progress(range(3), "loads", delay=0.0):
    pass
"""


def test_a_terminal_without_size_has_bars_too():
    """Some in containers say 0 x 0."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("4H", 0, 0, 0, 0))
    subprocess.run([sys.executable, "-c", SIZELESS], stderr=theirs, check=True)
    assert select.select([ours], [], [], 1.0)[0]
    text = os.read(ours, 10_000).decode()
    assert "loads:   0%|" in text and "0/3" in text
    os.close(ours)
    os.close(theirs)


def test_a_log_gets_a_line_once_in_a_while(monkeypatch, capsys):
    """The clock is the test's own: 25 s an item, a line a minute."""
    seconds = iter(range(0, 1000, 25))
    monkeypatch.setattr(progress, "monotonic", lambda: next(seconds))
    seen = list(with_progress(range(7), "reduction", shown=False, logged=True))
    assert seen == list(range(7))
    assert capsys.readouterr().err.splitlines() == [
        "bladefem: reduction: 2 of 7 after 75 s",
        "bladefem: reduction: 5 of 7 after 150 s",
    ]
    seconds = iter(range(0, 1000, 70))
    list(with_progress((i for i in range(2)), "points", shown=False, logged=True))
    assert "bladefem: points: 1 done after 140 s" in capsys.readouterr().err
    list(with_progress(range(9), "points", shown=False))
    assert capsys.readouterr().err == ""
