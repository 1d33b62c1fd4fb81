"""Units at the border: text to SI and back."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from bladefem.errors import InputError
from bladefem.scene.units import (
    newton_range,
    newtons,
    parse,
    plain_number,
    show,
    show_exactly,
    show_least,
    show_most,
)

# The right column is worked out by hand, not by the table of units.
VALUES = [
    ("140 mm", "m", 0.14),
    ("0.5 in", "m", 0.0127),
    ("3e-4 m", "m", 3e-4),
    ("12 µm", "m", 12e-6),
    ("1_000 mm", "m", 1.0),
    ("8000 rpm", "rad/s", 8000 * 2 * pi / 60),
    ("5 rad s^-1", "rad/s", 5.0),
    ("25 deg", "rad", 25 * pi / 180),
    ("25°", "rad", 25 * pi / 180),
    ("1 rev", "rad", 2 * pi),
    ("210 GPa", "Pa", 2.1e11),
    ("2.1e5 N/mm^2", "Pa", 2.1e11),
    ("60 g", "kg", 0.06),
    ("7.85 g/cm^3", "kg/m^3", 7850.0),
    ("7850 kg/m3", "kg/m^3", 7850.0),
    ("4e4 N/mm^3", "N/m^3", 4e13),
    ("40 N/mm³", "N/m^3", 4e10),
    ("1 kN/mm", "N/m", 1e6),
    ("20 %", "1", 0.2),
    ("20%", "1", 0.2),
    ("-5.5e-3mm", "m", -5.5e-6),
    ("3 kHz", "Hz", 3000.0),
    ("5 1/s", "Hz", 5.0),
    ("2 kg*m/s**2", "N", 2.0),
    ("2 kg·m/s/s", "N", 2.0),
    ("+.5 N", "N", 0.5),
    ("7", "m", 7.0),
    (7, "m", 7.0),
    (np.float64(7), "m", 7.0),
    (np.int64(7), "1", 7.0),
]


@pytest.mark.parametrize(("text", "unit", "value"), VALUES, ids=lambda v: str(v))
def test_text_becomes_si(text, unit, value):
    assert parse(text, unit) == pytest.approx(value, rel=4e-16)


WRONG = [
    ("20 mm", "rad", "a.b = 20 mm: 'mm' is not a unit of this field, expected deg or rad"),
    ("133 Hz", "rad/s", "not a unit of this field, expected rpm or rad/s"),
    ("3 m", "1", "expected a plain number or %"),
    ("nan", "m", "finite"),
    ("nan mm", "m", "finite"),
    ("-inf", "m", "finite"),
    ("1e400 m", "m", "finite"),
    (float("nan"), "m", "finite"),
    (float("inf"), "1", "finite"),
    ("3 mmm", "m", "unknown unit 'mmm', expected m or mm or um"),
    ("", "m", "expected a number"),
    ("mm", "m", "expected a number"),
    ("1,5 mm", "m", "expected a number"),
    ("12 34 mm", "m", "expected a number"),
    (True, "m", "expected a number"),
    (None, "m", "expected a number"),
    ([1.0], "m", "expected a number"),
    ("3 mm^2", "m", "not a unit of this field"),
    ("1e308 km", "m", "finite"),
]


@pytest.mark.parametrize(("text", "unit", "message"), WRONG, ids=lambda v: str(v))
def test_wrong_text_is_refused_in_one_sentence_with_the_field(text, unit, message):
    with pytest.raises(InputError) as refused:
        parse(text, unit, "a.b")
    assert message in str(refused.value) and str(refused.value).startswith("a.b = ")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.14, "m", "140 mm"),
        (1.5, "m", "1.5 m"),
        (2.5e-6, "m", "2.5 um"),
        (0.0, "m", "0 m"),
        (837.7580409572781, "rad/s", "8000 rpm"),
        (2.1e11, "Pa", "210 GPa"),
        (3e6, "Pa", "3 MPa"),
        (0.06, "kg", "60 g"),
        (20.0, "N", "20 N"),
        (2500.0, "N", "2.5 kN"),
        (pi / 7.2, "rad", "25 deg"),
        (1236.6, "Hz", "1236.6 Hz"),
        (0.3, "1", "0.3"),
        (4e10, "N/m^3", "40 N/mm^3"),
    ],
)
def test_values_are_shown_as_an_engineer_writes_them(value, unit, text):
    assert show(value, unit) == text


@pytest.mark.parametrize(
    "unit", ["m", "rad", "rad/s", "Pa", "kg", "kg/m^3", "N", "N/m", "N/m^3", "Hz", "1", "s"]
)
def test_exact_text_brings_the_very_same_number_back(unit):
    rng = np.random.default_rng(3)
    for value in [
        0.0,
        1.0,
        -1.0,
        1 / 3,
        *(rng.standard_normal(200) * 10.0 ** rng.integers(-12, 12, 200)),
    ]:
        assert parse(show_exactly(value, unit), unit) == value


@pytest.mark.parametrize(
    ("force", "said"),
    [
        (0.0, "0 N"),
        (2.25, "2.25 N"),
        (9999.4, "9999 N"),
        (9999.6, "10 kN"),
        (5e4, "50 kN"),
        (123456.0, "123.5 kN"),
        (3.4e7, "34000 kN"),
        (-5e4, "-50 kN"),
    ],
)
def test_forces_in_sentences_have_no_powers_of_ten(force, said):
    assert newtons(force, 4) == said


def test_two_forces_share_a_unit():
    assert newton_range(9000.0, 5e4, 3) == "9 to 50 kN"
    assert newton_range(900.0, 1100.0) == "900 to 1100 N"


def test_cells_write_out_what_people_do():
    assert plain_number(49999.0, 4) == "50000"
    assert plain_number(4.2e7, 2) == "4.2e+07" and plain_number(1e-9, 4) == "1e-09"


@pytest.mark.parametrize("unit", ["m", "Pa", "rad", "N/m^3"])
def test_limits_shown_keep_to_the_limit(unit):
    """A user copies the number out of the message: it must not be refused once more."""
    limits = 10 ** np.random.default_rng(3).uniform(-7, 12, 400)
    assert any(parse(show(x, unit), unit) > x for x in limits)
    for limit in limits:
        most, least = parse(show_most(limit, unit), unit), parse(show_least(limit, unit), unit)
        assert limit * (1 - 1e-5) <= most <= limit * (1 + 1e-12)
        assert limit * (1 - 1e-12) <= least <= limit * (1 + 1e-5)


def test_limits_that_are_round_numbers_stay_as_they_are():
    assert show_most(0.1 + 0.2, "m") == show_least(0.1 + 0.2, "m") == "300 mm"
    assert show_most(0.0, "m") == show_least(0.0, "m") == show(0.0, "m")
