"""Captions of the report's figures and tables: what is seen, and how to read it."""

from __future__ import annotations

import re

MODE_PICTURE = re.compile(r"modes/mode_(?P<number>\d+)(?P<wheel>_wheel)?")

CAPTIONS = {
    "mesh/mesh": "Mesh of blade and damper; coloured faces are those that have names.",
    "mesh/quality": "Size and quality of the mesh.",
    "modes/first_modes": "First mode shapes of the sector, coloured by displacement over its "
    "largest value; grey lines show the shape at rest. On the screen: choose a mode, drag to "
    "rotate, move the phase through one period.",
    "modes/mode_on_the_wheel": "The excited mode on the whole wheel: displacement along its main "
    "direction, with nodal lines in black.",
    "modes/frequencies_by_nodal_diameter": "Natural frequencies over nodal diameter, without "
    "damper; modes of one family have one sign, and are joined where neighbouring nodal diameters "
    "were computed.",
    "modes/modes": "Modes in the excited nodal diameter, named after those of the clamped blade. "
    "On the screen: choose a mode, drag to rotate, move the phase through one period.",
    "modes/excited_modes": "Modes in the excited nodal diameter, named after those of the clamped "
    "blade.",
    "modes/frequencies": "Natural frequencies of the nodal diameters asked for, without damper.",
    "modes/effective_masses": "Effective masses: the share of the moving mass that follows a "
    "motion of the root along each axis.",
    "modes/wave": "The excited mode as a wave that turns round the wheel.",
    "modes/campbell": "Campbell diagram: natural frequencies over speed, engine orders as rays; "
    "marked where an order meets the wave that it excites. Waves have Coriolis forces, backward "
    "ones are dashed where they are another line. Of orders 1 to 5 and those "
    "next to the scene's own the ones that cross a mode are drawn, with the nodal diameters that "
    "they excite; the table of crossings has all orders.",
    "modes/crossings": "Speeds at which an engine order excites a mode; the orders are those named "
    "under accuracy and method.",
    "modes/interference": "Interference diagram at the operating speed: engine orders against "
    "nodal diameters.",
    "modes/margins": "The mode closest to each engine order at the operating speed; at rest the "
    "lowest mode, which no order excites.",
    "modes/mac": "Modal assurance criterion against the modes of the other run.",
    "modes/nodal_diameters": "Natural frequencies over nodal diameter, without damper, by family.",
    "response/best_load": "The load that makes the resonance smallest, by exact search over the "
    "range of loads in the last columns. The search compares periodic solutions of the harmonic "
    "balance; where the one under the load found is unstable, the steady vibrations that the blade "
    "keeps under this and other loads are compared. Amplitude, frequency and error are those of "
    "the response under this load.",
    "response/influences": "What the best load depends on: each parameter over its range, by exact "
    "derivatives of the balances that its search compares (bars); the two with the largest effect "
    "solved again at both ends (diamonds).",
    "response/influences_at_ends": "Best load and its resonance amplitude at both ends of each "
    "parameter's range: by the exact derivatives, and solved again for the two with the largest "
    "effect; the amplitudes are those of balances, as the search compares them.",
    "response/influence_table": "What the best load depends on: each parameter, its range in "
    "multiples of its value, and the exact logarithmic derivatives: 0.5 means that 2 % more of the "
    "parameter give 1 % more.",
    "response/local_resonances": "Every local maximum of each response: how many motions (steady "
    "vibrations) were found at its frequency, and by which slow sweep it is reached (isolated: by "
    "neither; march in time: what an integration in time keeps, in place of an unstable periodic "
    "solution; from rest: another, lower motion at the frequency of the resonance, no maximum of "
    "its own). Stability is lost by a fold (the motion "
    "jumps, or moves on to one that branches off beside it), period doubling (it repeats after two "
    "periods) or a torus (a ripple of another frequency grows).",
    "response/resonances": "Linear resonances without damper.",
    "mesh/convergence": "Frequencies on refined meshes, with the estimated limit and order.",
    "response/side_by_side": "Resonance amplitude and frequency at the best load over the value, "
    "under the damper's own load where study.own_load asks for it, and amplitude over load for "
    "each value. Bars are estimated errors; diamonds are resonances that a march in time gives, or "
    "the stiff layer that a softer one stands for, squares unstable balances; hollow "
    "marks have an unknown error.",
    "response/study_map": "Resonance amplitude at the best of the loads studied, and that load, "
    "over the values of both fields, with its estimated error and what gives it where that is no "
    "stable balance; the smallest in bold.",
    "response/study_band": "Resonance amplitude over the loads that all samples have: median of "
    "the samples and the middle 80 % of them where there are ten at least, and all; in grey the "
    "blade without damper.",
    "response/band": "Resonance amplitude over the samples under each load.",
    "response/accuracy_of_methods_and_models": "Error of the resonance amplitude over computing "
    "time; the star is the automatic choice, the stairs are what no other setting beats.",
    "response/errors_of_each": "Errors of resonance amplitude and frequency of each setting.",
    "accuracy/methods": "Methods on the same model: time and errors.",
    "accuracy/models": "Models by the full balance of harmonics: time and errors.",
    "accuracy/meshes": "Meshes with the settings of the automatic choice: time and errors.",
    "modes/stresses": "Largest von Mises stress of the blade at Gauss points, and where: of "
    "rotation and heat, and of the mode studied alone with an amplitude of 1 mm at the probe.",
    "modes/stresses_of_modes": "Where the blade is stressed most: by rotation and heat, by each of "
    "the first modes in the excited nodal diameter scaled to a largest displacement of 1 mm, and, "
    "where a linear response was asked for, at each of its resonances. Stresses are values at "
    "nodes; von Mises also at Gauss points.",
    "modes/fatigue": "The places of the blade that use most of what the material lasts: "
    "alternating stress of the whole damped motion, mean stress of rotation (negative: "
    "compression), the amplitude allowed there, and the utilisation with the upper ends of its "
    "estimates.",
    "modes/utilisation": "Alternating stress over the amplitude that lasts at the mean stress "
    "there, at the resonance under the best load.",
    "response/backbone_resonances": "Resonances that the nonlinear mode alone predicts, next to "
    "those of the full balance, and the largest damping by friction. Detached motions are kept up "
    "by the force too, and not reached from rest.",
    "response/design_map": "Nonlinear modes: damping and frequency against amplitude for each "
    "load; dashed the damping that the force needs, so that crossings are resonances, dots those "
    "of the balance, diamonds where the mode turns back in amplitude. Right: resonance amplitude "
    "and forced response by the mode alone next to the "
    "balance.",
    "contact/fit": "The contact fitted to measured responses: values, and factors on the scene's; "
    "in the picture dots are readings, squares the fitted contact, crosses the scene's.",
    "contact/fit_readings": "Each reading, and its amplitude by the contact of the scene and by "
    "the fitted one.",
    "wheel/whole_wheel": "The whole wheel with its pattern: the highest blade next to the tuned "
    "wheel, and the alternating stress of its whole damped motion.",
    "wheel/blades": "Each blade: deviation of its first family, largest amplitude over the band, "
    "and friction work of its damper at the wheel's highest point.",
    "wheel/scatter": "Highest blade of the drawn wheels over the tuned wheel under the same load: "
    "quantiles with 95 % intervals, which hold what checked wheels are off the calibrated damper "
    "law, and the worst wheel. A dash: so few wheels leave that end of the interval open, below "
    "the lowest or above the highest wheel drawn.",
    "wheel/scatter_wheels": "Each drawn wheel under the load at which the tuned wheel is lowest: "
    "its highest blade, and where that has its resonance. The seed and the wheel's number give "
    "the same wheel again, under every load; scatter_wheels.csv has all loads.",
    "wheel/scatter_optima": "The load that is best for the tuned wheel, and the one that is best "
    "for 95 % of the drawn wheels, with 95 % intervals by the bootstrap over the wheels.",
    "wheel/scatter_utilisation": "What of the material's endurance the drawn wheels use: the tuned "
    "wheel's utilisation times the amplification of the highest blade, with the interval that the "
    "number of wheels leaves; then with the upper ends of the errors of mesh and loading history, "
    "and the factor by which the alternating stress could grow from there.",
    "wheel/scatter_chart": "Highest blade against the load: the tuned wheel, and quantiles of the "
    "drawn wheels with 95 % intervals; dashed the tuned optimum, dotted the robust one with its "
    "interval in grey.",
    "wheel/scatter_histogram": "How often an amplification occurs at the tuned wheel's best load.",
    "wheel/wheel_motion": "The wheel at its highest point, seen along its axis. On the screen: all "
    "blades in motion as plates that bend by the amplitude at the probe; play, or move the phase.",
    "wheel/fatigue_of_the_worst_blade": "The places that use most of what the material lasts, as "
    "for the tuned wheel, on the blade that uses most: the highest one, or that of another shape.",
    "wheel/utilisation_of_the_shapes": "The highest blade of each shape where it moves most, on "
    "the mesh of its shape: that which uses most of what its material lasts decides.",
    "wheel/utilisation_of_the_worst_blade": "Alternating stress of the blade that uses most over "
    "the amplitude that lasts at the mean stress there.",
    "contact/pressure_on_both_seats": "Contact pressure on both seats under the load in the "
    "title, seen along their normals.",
    "contact/pressure": "Seats under each static load: normal force, pressed share and pressure.",
    "contact/resultants": "Resultant contact force on the damper and its moment about the origin "
    "of the coordinates, under each load.",
    "contact/pressure_on_the_footprint": "Contact pressure under the pressed mass, and the points "
    "that carry its friction.",
    "response/loops": "Friction force along x over the relative displacement, less its mean, in "
    "one common period of foundation and load.",
    "response/spectra": "Amplitudes of the mass's motion along x over frequency.",
    "response/motion": "Steady motion of the mass under each frequency of the load: open loops of "
    "its hysteresis next to the denominator of the ratio of the frequencies, mean speeds, and the "
    "amplitude at the foundation's frequency.",
    "contact/friction_work": "Where one period at the best load's resonance wears the seats: "
    "friction work per area, and state of each contact point.",
    "contact/damper_mass": "Mass of the damper that makes each load at the operating speed: after "
    "the scene's history, without friction, and over all friction forces that could be left.",
    "contact/own_load": "Load of a seat by the damper's own mass at the operating speed.",
    "contact/wear": "Wear in an hour of steady vibration at each resonance.",
    "response/forced_response": "Amplitude over frequency for each normal load per seat, without "
    "damper (black, dashed) and in full stick (grey, dotted). Dots are solved points, large dots "
    "the highest of each curve that is not unstable, diamonds the resonances that a march in time "
    "gives, or the stiff layer that a softer one stands for, in place of it; squares are unstable "
    "motions, and coloured lines are dashed next to them. Open triangles are other, lower motions "
    "that the blade may keep to at the frequency of a resonance.",
    "response/forced_response_linear": "Linear response without damper: amplitude and phase at the "
    "probe over frequency. Dots are its resonances with the numbers of their modes, hollow where "
    "the amplitude has no maximum near the natural frequency, which stands there.",
    "response/optimum": "Amplitude and frequency of the resonance over the normal load per seat. "
    "The star marks the best load, by exact search where that was made, with the band of loads "
    "that keep within the accuracy of it; there is none where the answer names no optimum. Bars "
    "are estimated errors, dashed lines the blade without damper and in full stick; open triangles "
    "are lower motions that the blade may keep to at the frequency of the resonance.",
    "response/damped_motion": "Motion of blade and damper at the resonance under the best load, "
    "with all modes, harmonics and damper forces, about the mean position; the damper moves as a "
    "rigid body. Colours: amplitude of each node.",
    "response/hysteresis": "Friction force over relative displacement, summed over each seat, "
    "in one period at each resonance, along the direction in which the seat's mean motion is "
    "largest; the enclosed area is the friction work of that motion. Where a march in time gives "
    "the resonance the loops are those of its balance, and are called so; the friction work of the "
    "march is in the design table.",
    "response/flow": "Waves of the wheel in the flow, without dampers; positive nodal diameters "
    "run against the rotation, as engine orders up to half the number of blades do, negative ones "
    "with it.",
    "response/flutter": "Limit cycle of each fed wave under each load; the start decides which "
    "stays. Smaller motions grow to it, larger ones decay to it, up to the amplitude from which "
    "flutter grows.",
    "response/flow_damping": "Damping of each wave by blade and flow, without dampers. Waves below "
    "zero flutter unless friction holds them.",
    "response/summary": "Resonance for each normal load. The error is that estimated for the "
    "resonance amplitude: of the balance, of contact points, of the body's mesh and of the layer; "
    "without damper and in full stick (load ∞) the response is linear, and it is that of modes, "
    "contact points and meshes. "
    "The alternating stress is that of the whole motion, computed under the best load and under "
    "the damper's own; that of the excited mode alone leaves out other modes, higher harmonics and "
    "damper forces, and compares loads.",
    "accuracy/loads_with_doubtful_points": "Loads with points that did not converge or needed a "
    "fallback.",
}

# where they differ for a single blade, which has no nodal diameters, and whose modes do not travel
SINGLE_BLADE_CAPTIONS = {
    "modes/first_modes": "First mode shapes of the blade, coloured by displacement over its "
    "largest value; grey lines show the shape at rest. On the screen: choose a mode, drag to "
    "rotate, move the phase through one period.",
    "modes/modes": "Modes, named after those of the clamped blade. On the screen: choose a mode, "
    "drag to rotate, move the phase through one period.",
    "modes/excited_modes": "Modes, named after those of the clamped blade.",
    "modes/frequencies": "Natural frequencies, without damper.",
    "modes/nodal_diameters": "Natural frequencies, without damper.",
    "modes/wave": "The excited mode through one period.",
    "modes/campbell": "Campbell diagram: natural frequencies over speed, engine orders as rays; "
    "marked where an order meets a mode. Of orders 1 to 5 and those next to the scene's own "
    "the ones that cross a mode are drawn; the table of crossings has all orders.",
    "modes/interference": "Natural frequencies against the engine orders at the operating speed.",
    "modes/stresses_of_modes": "Where the blade is stressed most: by rotation and heat, by each of "
    "the first modes scaled to a largest displacement of 1 mm, and, where a linear response was "
    "asked for, at each of its resonances. Stresses are values at nodes; von Mises also at Gauss "
    "points.",
}


def caption_of(name: str, of_wheel: bool = True) -> str:
    """The caption of "section/name"; a name without one is written out.

    Args:
        of_wheel: the scene has a bladed wheel; else a single blade.

    >>> caption_of("modes/some_curve")
    'Some curve.'
    >>> caption_of("modes/mode_2_wheel")
    'Mode 2 on the whole wheel; displacement over its largest value.'
    >>> caption_of("modes/mode_2", of_wheel=False)
    'Mode 2 of the blade, at rest in grey lines; displacement over its largest value.'
    """
    if not of_wheel and name in SINGLE_BLADE_CAPTIONS:
        return SINGLE_BLADE_CAPTIONS[name]
    if name in CAPTIONS:
        return CAPTIONS[name]
    mode = MODE_PICTURE.fullmatch(name)
    if mode:
        body = "on the sector" if of_wheel else "of the blade"
        where = "on the whole wheel" if mode["wheel"] else f"{body}, at rest in grey lines"
        return f"Mode {mode['number']} {where}; displacement over its largest value."
    head, _, tail = name.rpartition("_")
    if head in CAPTIONS and tail[:1].isdigit():
        # a picture for each damper mass, "response/forced_response_12g"
        return f"{CAPTIONS[head]} Damper of {tail.removesuffix('g')} g."
    text = name.partition("/")[2].replace("_", " ")
    return f"{text[:1].upper()}{text[1:]}."
