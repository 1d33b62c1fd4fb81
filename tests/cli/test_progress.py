"""Bars: silent when nobody looks, one for all ranks."""

from __future__ import annotations

import io
import sys

from bladefem.progress import wanted, watch


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_shown_on_a_terminal_only(monkeypatch):
    monkeypatch.delenv("BLADEFEM_TERMINAL", raising=False)
    monkeypatch.setattr(sys, "stderr", Terminal())
    assert wanted() and not wanted(quiet=True) and not wanted(rank=1)
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    assert not wanted()
    monkeypatch.setenv("BLADEFEM_TERMINAL", "1")
    assert wanted() and not wanted(rank=3)


def test_items_pass_through_and_short_loops_stay_silent(monkeypatch):
    for shown in (True, False):
        screen = Terminal()
        monkeypatch.setattr(sys, "stderr", screen)
        assert list(watch((i for i in range(5)), "loads", total=5, shown=shown)) == [0, 1, 2, 3, 4]
        assert "loads" not in screen.getvalue()


def test_a_long_loop_shows_its_label(monkeypatch):
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    assert len(list(watch(range(3), "loads", delay=0.0, mininterval=0.0))) == 3
    assert "loads" in screen.getvalue()
