"""The page of claims: its text from given claims, and the committed method map that it reads."""

import csv
from pathlib import Path

import pytest

from bladefem.errors import InputError
from verification.paper.claim import Chapter, Claim
from verification.paper.claims import CHAPTERS, element
from verification.paper.method_maps import COLUMNS, count_outcomes, write_rows
from verification.paper.page import as_html, as_markdown, main

MAP = Path(__file__).resolve().parents[2] / "docs/paper/method_map.csv"


def test_page_shows_claim_number_verdict_and_picture(tmp_path):
    claims = list(element(tmp_path))
    chapters = [Chapter("Element", "One element.", (element,))]
    page, web = (write(chapters, {"Element": claims}) for write in (as_markdown, as_html))
    assert "**fails**" in page
    assert all(c.ours in page for c in claims)
    assert page.index("At a glance") < page.index("One element.")
    assert (tmp_path / "fig_4.png").stat().st_size > 10_000
    assert "fig_4.png" in web and "figcaption" in web


def test_html_escapes_what_claims_say():
    chapter = Chapter("x", "", ())
    assert "a &lt; b" in as_html([chapter], {"x": [Claim("Eq. 1", "a < b", "yes", "holds")]})


def test_one_chapter_is_remade_and_the_others_kept(tmp_path, monkeypatch):
    chapters = tuple(
        Chapter(t, "", (lambda _, t=t: iter([Claim("Eq. 1", "x", t, "holds")]),)) for t in "ab"
    )
    monkeypatch.setattr("verification.paper.claims.CHAPTERS", chapters)
    main(tmp_path)
    first = (tmp_path / "paper.md").read_text(encoding="utf-8")
    main(tmp_path, ["b"])
    assert (tmp_path / "paper.md").read_text(encoding="utf-8") == first
    with pytest.raises(InputError, match="unknown"):
        main(tmp_path, ["c"])


def test_committed_page_has_every_chapter_and_its_pictures():
    page = (MAP.parents[1] / "paper.md").read_text(encoding="utf-8")
    assert all(f"## {chapter.title}" in page for chapter in CHAPTERS)
    pictures = [
        line.split("(")[1].rstrip(")") for line in page.splitlines() if line.startswith("![")
    ]
    assert len(pictures) >= 22
    assert all((MAP.parents[1] / picture).is_file() for picture in pictures)
    assert page.count("**holds") + page.count("**fails**") == 2 * int(
        page.split(" claims: ")[0].split()[-1]
    )


def test_method_map_covers_every_method_on_at_least_250_points():
    with open(MAP, encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    table = count_outcomes(rows)
    assert len(table) == 10
    assert all(sum(counts.values()) >= 250 for counts in table.values())
    assert table["newton, fallbacks"] == {"converged": 272}
    assert max(float(r["residual"]) for r in rows if r["method"] == "newton, fallbacks") < 1e-8
    assert table["paper"]["false"] > 50


def test_rows_go_to_csv_and_back(tmp_path):
    row = dict.fromkeys(COLUMNS, 1.0) | {
        "method": "picard",
        "outcome": "false",
        "reason": "step 1e-2, small",
    }
    write_rows([row], tmp_path / "map.csv")
    with open(tmp_path / "map.csv", encoding="utf-8") as file:
        assert next(csv.DictReader(file))["reason"] == "step 1e-2, small"
