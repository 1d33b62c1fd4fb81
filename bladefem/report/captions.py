"""Captions of the report's figures and tables: what is seen, and how to read it."""

from __future__ import annotations

__all__ = ["caption_of"]

CAPTIONS = {
    "mesh/mesh": "Mesh of blade and damper; coloured faces are those that have names.",
    "mesh/quality": "Size and quality of the mesh.",
    "modes/first_modes": "First mode shapes of the sector, coloured by displacement over its "
    "largest value; grey lines show the shape at rest. On the screen: choose a mode, drag to "
    "rotate, move the phase through one period.",
    "modes/mode_on_the_wheel": "The excited mode on the whole wheel: displacement along its main "
    "direction, with nodal lines in white.",
    "modes/frequencies_by_nodal_diameter": "Natural frequencies over nodal diameter, without "
    "damper; modes of one family are joined.",
    "modes/modes": "Modes in the excited nodal diameter, named after those of the clamped blade.",
    "modes/nodal_diameters": "Natural frequencies of all nodal diameters that were computed.",
    "modes/stresses": "Where the blade is stressed most: by rotation, and by the excited mode "
    "scaled to 1 mm at the probe (mesh values at Gauss points).",
    "contact/pressure_on_both_seats": "Contact pressure on both seats under the best load, seen "
    "along their normals.",
    "contact/pressure": "Seats under each static load: normal force, pressed share and pressure.",
    "contact/resultants": "Resultant contact force on the damper and its moment about the "
    "engine's origin, under each load.",
    "contact/friction_work": "Where one period at the best load's resonance wears the seats: "
    "friction work per area, and state of each contact point.",
    "contact/own_load": "Load of a seat by the damper's own mass at the operating speed.",
    "contact/wear": "Wear in an hour of steady vibration at each resonance.",
    "response/forced_response": "Amplitude over frequency for each normal load per seat, without "
    "damper (dashed) and in full stick (dotted). Dots are solved points, large dots the highest "
    "of each curve.",
    "response/optimum": "Amplitude and frequency of the resonance over the normal load per seat. "
    "The star marks the best load studied, dashed lines the blade without damper and in full "
    "stick.",
    "response/hysteresis": "Friction force over relative displacement, summed over each seat, "
    "in one period at each resonance; the enclosed area is the friction work.",
    "response/summary": "Resonance for each normal load. The error is that estimated for the "
    "resonance amplitude, without the mesh's part.",
    "accuracy/loads_with_doubtful_points": "Loads with points that did not converge or needed a "
    "fallback.",
}


def caption_of(name: str) -> str:
    """The caption of "section/name"; a name without one is written out.

    >>> caption_of("modes/some_curve")
    'Some curve.'
    """
    if name in CAPTIONS:
        return CAPTIONS[name]
    head, _, tail = name.rpartition("_")
    if head in CAPTIONS and tail[:1].isdigit():
        # a picture for each damper mass, "response/forced_response_12g"
        return f"{CAPTIONS[head]} Damper of {tail.removesuffix('g')} g."
    text = name.partition("/")[2].replace("_", " ")
    return f"{text[:1].upper()}{text[1:]}."
