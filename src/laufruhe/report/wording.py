"""A result and its proof in sentences."""

from __future__ import annotations

import math

import numpy as np

from laufruhe.numerics.exact_angles import as_turn, reduced_turn
from laufruhe.numerics.spectrum import order_amplitude
from laufruhe.present.measures import breaks_a_limit, hardest_point, has_firing, is_changed
from laufruhe.present.numbers import figure, number, percent, share, trimmed, with_unit
from laufruhe.present.static_load import static_sentence
from laufruhe.prove.certificate import Certificate, Proof
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.stars.ranking import RankedStar
from laufruhe.solvers.values import AttainableLimit

# largest relative change that is printed as zero
NO_CHANGE = 5e-4
NO_BOUND = "no useful lower bound was found"
NEGLIGIBLE = 1e-9
"""Relative error of the objective that is not stated as a number."""
ADDED = 0.01
"""Share of the force of one piston or weight from which a load is one that a design adds."""
LARGE_RESIDUAL = 1e-3
"""Residual above which the optimality conditions count as not met."""


def headline(result: Result) -> str:
    """Return one sentence on a result: objective before and after, and how well it is proven."""
    o = result.objective
    if result.status in (Status.INFEASIBLE, Status.FAILED):
        return f"{result.message[:1].upper()}{result.message[1:]}." if result.message else "No design was found."
    if o is None:
        return "The initial design was evaluated; there is no objective."
    name = f"RMS{o.name[3:]}" if o.name.startswith("rms ") else o.name[:1].upper() + o.name[1:]
    if not is_changed(result):
        return f"{name} of the initial design: {figure(o.value, o.unit)}."
    if math.isinf(o.initial):
        text = f"{name} is {figure(o.value, o.unit)}, {_proven(result.certificate)}"
        return f"{text}; the initial design is on a resonance."
    if abs(o.value - o.initial) <= NO_CHANGE * max(abs(o.value), abs(o.initial)):
        return f"{name} stays at {figure(o.initial, o.unit)}, {_proven(result.certificate)}."
    # a zero objective has no relative change
    change = f" ({percent(-o.reduction)})" if o.initial else ""
    initial, decided = figure(o.initial, o.unit), figure(o.value, o.unit, scale=o.initial)
    sentence = f"{name} falls from {initial} to {decided}"
    if o.value > o.initial:
        why = ", which breaks a limit," if breaks_a_limit(result.problem, result.initial) else ""
        sentence = f"{name} goes from {initial}{why} to {decided}"
    return f"{sentence}{change}, {_proven(result.certificate)}."


def details(result: Result) -> list[str]:
    """Return the sentences below the headline: attainable limits, firing order, comparison of crank stars."""
    static = "" if result.objective is None else static_sentence(result.problem, result.final)
    sentences = (*attainable(result), static, *added_loads(result), fired(result), why_star(result))
    return [sentence for sentence in sentences if sentence]


def added_loads(result: Result) -> list[str]:
    """Return a sentence for each free force and couple of an order that the initial design does not have.

    A problem that minimises or limits a load on the block counts them, and has no such sentence.
    """
    if not is_changed(result) or any(m.is_load and m.load.is_block_load for m in result.problem.measures):
        return []
    k, engine = hardest_point(result), result.final.engine
    sizes = [part.reciprocating_mass * part.crank_radius for part in engine.slider_cranks]
    sizes += [abs(rotor.unbalance) for rotor in engine.rotors]
    force = max(sizes) * result.problem.points[k].speed ** 2
    length = float(np.ptp([*(part.x for part in engine.slider_cranks), *(rotor.x for rotor in engine.rotors)]))
    before, after = (design.loads[k].wrench for design in (result.initial, result.final))
    texts = []
    for name, unit, part, scale in (
        ("shaking force", "N", slice(0, 3), force), ("rocking couple", "N m", slice(4, 6), force * length or math.inf),
    ):  # fmt: skip
        old, new = (order_amplitude(wrench.coefficients[:, part]) for wrench in (before, after))
        count = min(len(old), len(new))
        added = np.flatnonzero((new[:count] > ADDED * scale) & (old[:count] < ADDED * new[:count]))
        if len(added):
            j = int(added[np.argmax(new[added])])
            texts.append(
                f"The design adds a {name} of order {j * float(after.base):g}, {figure(float(new[j]), unit)}, that "
                f"the initial design does not have; a limit on 'rms {name}' prevents it."
            )
    return texts


def attainable(result: Result) -> list[str]:
    """Return a sentence on the attainable value of each conflicting limit, and one about the nearest design."""
    lead = "With the other limits met, " if len(result.problem.limits) > 1 else ""
    texts, design = [_attainable(limit, lead) for limit in result.reached], result.nearest
    if design is None:
        return texts
    value, required = figure(design.value, design.unit), f"{design.side} {with_unit(design.limit, design.unit)}"
    beyond = f", {share(design.violation, 3)} beyond" if design.limit else ""
    return [*texts, f"The nearest design found breaks '{design.name}' most: {value}; required: {required}{beyond}."]


def _attainable(limit: AttainableLimit, lead: str) -> str:
    value, bound = figure(limit.value, limit.unit), figure(limit.bound, limit.unit)
    required = f"{limit.side} {with_unit(limit.limit, limit.unit)} is required."
    if limit.why:
        is_known = math.isfinite(limit.value)
        known, unknown = f"stays at {value}: {limit.why}; {required}", f"is not known: {limit.why}."
        return f"'{limit.name}' {known}" if is_known else f"The range of '{limit.name}' {unknown}"
    minimum, beyond = ("smallest", "lower") if limit.side == "at most" else ("largest", "higher")
    best, none = f"the {minimum} value found of '{limit.name}' is {value}", f"; no design is {beyond} than {bound}"
    if value == bound or limit.proof == Proof.GLOBAL:
        text = f"the {minimum} value of '{limit.name}' is {value}, which is proven"
    elif limit.proof == Proof.WITHIN_GAP:
        text = f"{best}{none}"
    else:
        text = f"{best}, a local optimum{none if limit.bound > 0.0 else ' without a proof'}"
    ended = " Its search ended at the time limit; raise the time limit." if limit.ended else ""
    text = f"{lead}{text}; {required}{ended}"
    return text[:1].upper() + text[1:]


def fidelity_of(result: Result) -> str:
    """Return the model fidelity of a result in words: computed physics and numerical error of the objective."""
    f = result.problem.fidelity
    text = f"{f.summary.capitalize()}, {result.final.samples} steps over the working cycle."
    if result.objective is None:
        return text
    if f.tolerance is not None:
        text += f" Chosen for an error of {f.tolerance:g}."
    error = "negligible" if result.error_estimate < NEGLIGIBLE else f"at most {100.0 * result.error_estimate:.1g} %"
    text += f" Numerical error of the objective: {error}."
    if result.regret_bound is None or f.is_exact:
        return text
    return f"{text} By exact physics, the best design is better by at most {100.0 * result.regret_bound:.2g} %."


def fired(result: Result) -> str:
    """Return firing order, intervals and simultaneous firings in words; empty for one cylinder."""
    engine = result.final.engine
    if len(engine.cylinders) < 2:
        return ""
    firing = has_firing(result)
    fires = [as_turn(part.firing_angle) for part in engine.cylinders]
    turns = [float(reduced_turn(turn - fires[0], engine.cycle.turns)) for turn in fires]
    numbers = [1 + engine.slider_cranks.index(part) for part in engine.cylinders]
    order = "-".join(str(numbers[k]) for k in sorted(range(len(turns)), key=lambda k: (round(turns[k], 9), k)))
    angles = [trimmed(math.degrees(interval), 5) for interval in engine.firing_intervals]
    lead = f"Firing order {order}" if firing else f"Dead centres at the head end in the order {order}"
    spacing = f"intervals {', '.join(angles)} deg" if len(set(angles)) > 1 else f"every {angles[0]} deg"
    sentence, do = f"{lead}, {spacing}.", "fire" if firing else "reach it"
    groups = [f"{', '.join(names[:-1])} and {names[-1]} {do} at once" for names in engine.simultaneous_firings]
    text = "; ".join(groups)
    return f"{sentence} {text[:1].upper()}{text[1:]}." if text else sentence


def why_star(result: Result) -> str:
    """Return a sentence on why the best crank star beats the next in the ranking; empty for a single star."""
    stars = result.phasing.ranking if result.phasing is not None else ()
    k, rival = next(((k, star) for k, star in enumerate(stars, 1) if star.throws != stars[0].throws), (0, None))
    if rival is None or not rival.value:
        return ""
    gain, differences = 1.0 - stars[0].value / rival.value, _differences(result, stars[0], rival)
    less = [text for best_size, rival_size, text in differences if best_size < rival_size]
    more = [text for best_size, rival_size, text in differences if best_size > rival_size]
    if not differences:
        return f"Star {k} has the same free forces and couples as star 1." if abs(gain) < NO_CHANGE else ""
    if gain < NO_CHANGE:
        return f"Star {k} is as good as star 1."
    text = f"Star 1 beats star {k} by {share(gain, 3)}."
    text += f" Its throws leave a smaller {' and '.join(less)}." if less else ""
    lead = "It leaves" if less else "Its throws leave"
    return text + (f" {lead} a larger {' and '.join(more)}." if more else "")


def _differences(result: Result, best: RankedStar, rival: RankedStar) -> list[tuple[float, float, str]]:
    """Return the free loads in which two crank stars differ: the load of each star, and a text."""
    requested = {order for measure in result.problem.measures for order in measure.orders or best.orders}
    driven = {drive.rotor for decision in result.problem.unbalances for drive in decision.rotor_drives}
    acting = {abs(rotor.shaft.ratio) for rotor in result.final.engine.rotors if rotor.name in driven}
    differences = []
    for j, order in enumerate(best.orders):
        pairs = (("force", best.forces[j], rival.forces[j]), ("couple", best.couples[j], rival.couples[j]))
        for kind, best_size, rival_size in pairs if order in requested else ():
            if abs(best_size - rival_size) > NO_CHANGE * max(best_size, rival_size):
                also = ", the part that counterweights can cancel" if order in acting else ""
                sizes = f"{number(best_size, 3, 1.0)} against {number(rival_size, 3, 1.0)}"
                differences.append((best_size, rival_size, f"{kind} of order {order} ({sizes}{also})"))
    return differences


def _proven(certificate: Certificate | None) -> str:
    if certificate is None:
        return "not proven"
    if certificate.kind is not Proof.NONE and not certificate.is_useful:
        return NO_BOUND
    words = {
        "global": "the proven optimum",
        "global within gap": f"proven to within {share(max(certificate.gap, 0.0))} of the optimum",
        "local": "a local optimum",
    }
    return words.get(str(certificate.kind), "not proven")


def explained(result: Result) -> str:
    """Return the certificate in two sentences."""
    c, o = result.certificate, result.objective
    if result.status is Status.INFEASIBLE:
        ruled_out = "All allowed stars and firing orders are ruled out" if result.problem.phasing is not None else ""
        needed = bool(result.conflict) and {limit.name for limit in result.reached if limit.decisions} >= {
            *result.conflict
        }
        text = f"{ruled_out or 'It is proven that no design meets the limits named'}."
        return text + needed * " Without any one of these limits, the others can be met."
    if c is None or o is None:
        return "Nothing was decided, so there is nothing to prove."
    if result.status is Status.FAILED:
        bound = figure(c.lower_bound, o.unit, 6)
        minimum = f"No design within the bounds and limits has less than {bound}. " if c.is_useful else ""
        return f"{minimum}The design found breaks a limit, so it has no proof."
    between = "designs between this bound and this design are not ruled out"
    bound = f"no design is below {figure(c.lower_bound, o.unit, 6)}; {between}" if c.is_useful else NO_BOUND
    if c.kind is Proof.NONE:
        text = result.message or bound
        return f"{text[:1].upper()}{text[1:]}."
    if c.kind is Proof.LOCAL or not c.is_useful:
        return (
            f"The best of the local optima found ({c.method}), with {figure(o.value, o.unit, 6)}. "
            f"At this design {_conditions(c.kkt_residual)}. {bound[:1].upper()}{bound[1:]}."
        )
    gap = f"a gap of {share(c.gap)}" if c.gap > 0.0 else "which leaves no gap"
    # a large residual, as of a length at zero, says nothing beside a proof
    conditions = f", and {_conditions(c.kkt_residual)}" if c.kkt_residual <= LARGE_RESIDUAL else ""
    proven = f"{gap} (proof: {c.kind})"
    design = f"this one has {figure(o.value, o.unit, 6)}"
    optimum = result.ranks[0].minimum if result.ranks else o.value
    if o.value - optimum > NO_CHANGE * max(o.value, o.initial):
        design = f"the least found is {figure(optimum, o.unit, 6)}, {proven}; {design}, as `within` allows"
    else:
        design = f"{design}, {proven}"
    return (
        f"No design within the bounds and limits has less than {figure(c.lower_bound, o.unit, 6)}; {design}. "
        f"The bound was not taken from the solver but computed from the exact model ({c.method}){conditions}."
    )


def _conditions(residual: float) -> str:
    if not math.isfinite(residual):
        return "the optimality conditions are not known, because no search ended there"
    if residual > LARGE_RESIDUAL:
        return "the optimality conditions are not confirmed, as at a kink of the objective; no bound depends on them"
    how = f"with a residual of {residual:.1e}" if residual else "exactly"
    return f"the optimality conditions hold {how}"
