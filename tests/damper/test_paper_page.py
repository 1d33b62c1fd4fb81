"""The page of claims: its text from given claims, and the committed method map that it reads."""

import csv
from pathlib import Path

from bladefem.damper.maps import COLUMNS, count_outcomes, write_rows
from bladefem.report.claims import Claim, element
from bladefem.report.paper import as_html, as_markdown

MAP = Path(__file__).resolve().parents[2] / "docs/paper/method_map.csv"


def test_page_shows_claim_number_and_verdict(tmp_path):
    claims = list(element(tmp_path))
    page, web = as_markdown({"Element": claims}), as_html({"Element": claims})
    assert "**fails**" in page
    assert all(c.ours in page for c in claims)
    assert (tmp_path / "fig_4.png").stat().st_size > 10_000
    assert "fig_4.png" in web


def test_html_escapes_what_claims_say():
    assert "a &lt; b" in as_html({"x": [Claim("Eq. 1", "a < b", "yes", "holds")]})


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
    row = dict.fromkeys(COLUMNS, 1.0) | {"method": "picard", "outcome": "false", "reason": "step 1e-2, small"}
    write_rows([row], tmp_path / "map.csv")
    with open(tmp_path / "map.csv", encoding="utf-8") as file:
        assert next(csv.DictReader(file))["reason"] == "step 1e-2, small"
