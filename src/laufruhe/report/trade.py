"""Report on time and error of every fidelity, with a recommendation."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict

from laufruhe.errors import counted
from laufruhe.present.numbers import DASH, figure, fixed, number
from laufruhe.present.static_load import static_sentence
from laufruhe.present.tables import Table
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.report.document import Block, Bullets, Code, Document, Illustration, Paragraph
from laufruhe.report.strict_json import strict
from laufruhe.studies.trade import KEEPS, NO_GAS, REFERENCE_NAME, RIGID, TWO_ORDER, Trade, TradeRow, is_open

TITLE = "Speed against accuracy"
ALIKE, WITHIN, SMALLEST = 1.3, 1e-3, 1e-4
"""Factor between times that count as equal, error of a good choice, and smallest share that is stated."""
HEAD = (
    "fidelity", "error", "error estimate", "evaluate", "solve", "scene of a sweep", "10,000 designs",
    "their largest error", "memory", "regret", "regret bound",
)  # fmt: skip
COLUMNS = (
    "**Evaluate, solve**: processor time of these calls of Python, of a problem that is loaded, after a first call. "
    "**Scene of a sweep**: mean solve of a study at other speeds. **10,000 designs**: `evaluate_many` of random "
    "designs between their bounds; only if all open numbers are unbalances. **Memory**: largest memory of the solve, "
    "or of the evaluation if nothing is open, in Python and NumPy (tracemalloc); a solve of 2 s or more is not "
    "repeated for it. "
    "**Regret**: exact objective of this fidelity's design over that of the best design known, minus one. "
    "**Regret bound**: what `solve` states of it. A design that breaks a limit by more than 0.1 % in the exact "
    "model shows that excess instead. `auto` computes all physics in a solve, and takes fewer samples for many designs."
)
INDEX = (
    "problem", "one solve", "its time", "ten thousand designs", "their time", "error of two-order",
    "error without gas", "error of auto 0.001", "regret of two-order", "regret of auto 0.001", "uneven speed",
    "reason of a dash",
)  # fmt: skip
INDEX_COLUMNS = (
    "*One solve, ten thousand designs*: the fastest fidelity whose design, and whose largest error, is within 0.1 %, "
    "and its processor time after a first call; one evaluation if nothing is open. "
    "*Regret*: exact objective of a fidelity's design over that of the best design known, minus one. "
    "*Beyond a limit*: share by which that design breaks a limit in the exact model, stated above 0.1 %. "
    "*Uneven speed*: change of the objective with a flywheel that leaves 2 % of irregularity."
)
OPEN_FLYWHEEL = "the flywheel is open; a cheap model chooses one that breaks its limits"


def trade_document(trade: Trade, picture: str | None, command: str) -> Document:
    """Return the report on the fidelities of one problem: table, picture (if `picture` names one) and advice."""
    problem = trade.problem
    initial, minimum = (figure(value, problem.objective_unit or "", 6) for value in (trade.value, trade.optimum))
    optimum = "" if math.isnan(trade.optimum) else f", of the optimum {minimum}"
    blocks: list[Block] = [
        Paragraph(
            f"Reference: {REFERENCE_NAME} over the cycle; {problem.objective_name} of the initial design {initial}"
            f"{optimum}."
        ),
        Paragraph(f"**Take** {advice(trade)}", marked=True),
    ]
    if picture:
        blocks.append(Illustration(picture, "Time of every fidelity against its regret and its error", False))
    elif not problem.load_terms:
        blocks.append(Paragraph("The objective depends on no load, so every fidelity gives the same number."))
    rows = [
        [row.name, _share(row.error), _share(row.estimate),
         *map(_time, (row.evaluation, row.solve, row.scene, row.batch)), _share(row.batch_error),
         DASH if math.isnan(row.memory) else f"{number(1e-6 * row.memory, 3)} MB", _regret(row),
         _share(row.regret_bound)]
        for row in trade.rows
    ]  # fmt: skip
    blocks.append(Table(HEAD, rows))
    if not trade.is_complete:
        blocks.append(Paragraph("Stopped at the time limit: fidelities beyond the last row were not measured."))
    blocks.append(Paragraph(COLUMNS, marked=True))
    static = static_sentence(problem, evaluate_start(problem)) if problem.load_terms else ""
    blocks.extend(Paragraph(line) for line in (*([static] if static else []), *trade.left_out, *_beyond(trade)))
    return Document(f"{TITLE}: {problem.title}", (*blocks, Code(command)))


def _beyond(trade: Trade) -> list[str]:
    """Return sentences on effects that no fidelity at constant speed or in the frequency domain includes."""
    lines = []
    if trade.flywheel is not None:
        inertia, change = trade.flywheel
        lines.append(
            f"Constant crank speed: with a flywheel of {inertia:.3g} kg m2 for all that turns, at which the speed "
            f"varies by some 2 %, the objective changes by {fixed(100.0 * change, 2, '+')} %. "
            "No fidelity at constant speed includes this."
        )
    if trade.time_domain is not None:
        time = trade.time_domain
        lines.append(
            f"Time domain ({time.point}): mount forces integrated in time agree with the same equations in the "
            f"frequency domain to {time.integration:.0e} of their peak. Hysteretic loss has no law in time. "
            f"Viscous damping, which replaces it, changes them by up to {100.0 * time.loss:.2g} % of the peak."
        )
    return lines


def advice(trade: Trade) -> str:
    """Return the recommended fidelities in words."""
    one, many = choices(trade)
    texts = []
    if one is not None:
        call, seconds = ("solve", one.solve) if is_open(trade.problem) else ("evaluation", one.evaluation)
        texts.append(f"`{one.name}` for one {call} ({_time(seconds)})")
    if many is not None:
        texts.append(f"`{many.name}` for ten thousand designs ({_time(many.batch)})")
    return ("; ".join(texts) or "the exact model: no other fidelity is within 0.1 %") + "."


def choices(trade: Trade) -> tuple[TradeRow | None, TradeRow | None]:
    """Return the fastest fidelities within 0.1 % for one solve, or one evaluation if nothing is open, and for a batch.

    A solve counts by its regret, and everything else by its error.
    """
    many = [row for row in trade.rows if row.batch_error <= WITHIN]
    if is_open(trade.problem):
        deciding = [row for row in trade.rows if row.decides and (row.regret <= WITHIN or trade.optimum == 0.0)]
        one = _fastest(deciding, lambda row: row.solve)
    else:
        one = _fastest([row for row in trade.rows if row.error <= WITHIN], lambda row: row.evaluation)
    return one, _fastest(many, lambda row: row.batch)


def _fastest(rows: Sequence[TradeRow], time: Callable[[TradeRow], float]) -> TradeRow | None:
    fastest = min(map(time, rows), default=math.nan)
    return min((row for row in rows if time(row) <= ALIKE * fastest), key=lambda row: row.estimate, default=None)


def as_json(trade: Trade) -> str:
    """Return the measurements as JSON."""
    return strict({
        "problem": trade.problem.name,
        "reference": {"objective": trade.value, "optimum": trade.optimum},
        "uneven_speed": trade.flywheel and dict(zip(("crank_inertia", "change"), trade.flywheel, strict=True)),
        "time_domain": trade.time_domain and asdict(trade.time_domain),
        "rows": [
            {"excess" if key == "violation" else key: value for key, value in asdict(row).items()}
            for row in trade.rows
        ],
    })  # fmt: skip


def index(trades: Sequence[Trade], refused: Sequence[str] = ()) -> Document:
    """Return the report on the fidelities of several problems: a row for each, and their common findings.

    `refused` names the problems that were left out.
    """
    rows = [*map(_index_row, trades), *([f"`{name}`", *[DASH] * (len(INDEX) - 2), OPEN_FLYWHEEL] for name in refused)]
    short = (
        "`auto` is the safe choice: a solve has all physics, and many designs the samples that keep them in tolerance.",
        f"{_cost(trades, TWO_ORDER, 'The two-order formulas of textbooks cost')} "
        "If the second order of an engine cancels, only orders remain that these formulas neglect.",
        f"{_cost(trades, NO_GAS, 'Neglecting gas costs')} Gas determines how the roll moment is balanced.",
        f"{_cost(trades, RIGID, 'Taking elastic mounts for rigid costs')} A reduced number of modes saves no time: "
        "all excited modes take the same time.",
        "More than 720 steps in a cycle improve peaks and proofs, not means.",
        "Regret may be far below the error, because an optimum is flat. It may also be far above it, because a shaft "
        "then balances the wrong load. Read both columns.",
    )
    lead = f"Which fidelity to take, measured on {len(trades)} problem{'s' * (len(trades) > 1)}. In short:"
    rows = sorted(rows, key=lambda row: row[0].strip("[`"))
    table = Table(INDEX, rows, left=(0, 1, 3, len(INDEX) - 1), marked=True)
    return Document(TITLE, (Bullets(lead, short, marked=True), table, Paragraph(INDEX_COLUMNS, marked=True)))


def _index_row(trade: Trade) -> list[str]:
    two, auto, gas = (_named(trade, name) for name in (TWO_ORDER, "auto 0.001", NO_GAS))
    one, many = choices(trade)
    seconds = math.nan if one is None else one.solve if is_open(trade.problem) else one.evaluation
    chosen = [cell for row, spent in ((one, seconds), (many, many.batch if many else math.nan))
              for cell in (f"`{row.name}`" if row else DASH, _time(spent))]  # fmt: skip
    uneven = DASH if trade.flywheel is None else f"{fixed(100.0 * trade.flywheel[1], 2, '+')} %"
    name, errors = trade.problem.name, [DASH if row is None else _share(row.error) for row in (two, gas, auto)]
    return [f"[{name}]({name}.md)", *chosen, *errors, _regret(two), _regret(auto), uneven, _why_dashes(trade)]


def _why_dashes(trade: Trade) -> str:
    """Return the reasons for missing numbers of the index."""
    problem, (one, many) = trade.problem, choices(trade)
    reasons = {
        "nothing is open": not is_open(problem),
        "not all that is open are unbalances": is_open(problem) and many is None,
        "no design within the limits was found": is_open(problem) and math.isnan(trade.optimum),
        "the optimum is zero": trade.optimum == 0.0,
        "no fidelity finds a design within 0.1 % of the best": one is None and trade.optimum > 0.0,
        "the objective depends on no load": not problem.load_terms,
        "there is no gas": _named(trade, NO_GAS) is None,
        "a load inside the crankcase needs constant speed": bool(problem.load_terms) and trade.flywheel is None,
    }
    return "; ".join(why for why, holds in reasons.items() if holds)


def _named(trade: Trade, name: str) -> TradeRow | None:
    return next((row for row in trade.rows if row.name == name), None)


def _cost(trades: Sequence[Trade], name: str, what: str) -> str:
    """Return a sentence on the errors of a fidelity in values and designs, largest and median over problems."""
    rows = [row for trade in trades if trade.problem.load_terms and (row := _named(trade, name)) is not None]
    errors = sorted(row.error for row in rows)
    regrets = sorted(row.regret for row in rows if row.decides and not math.isnan(row.regret))
    broken = sum(row.violation > KEEPS for row in rows)
    if not errors:
        return f"{what} nothing here: no problem has this fidelity."
    text = f"{what} {_up_to(errors[-1])} of the value{_median(errors)}"
    if regrets:
        text += f"; the design that it finds is worse than the best by {_up_to(regrets[-1])}{_median(regrets)}"
    if broken:
        text += f"; {counted(broken, 'design')} broke a limit"
    return text + "."


def _median(shares: Sequence[float]) -> str:
    count = len(shares)
    return f" (median of {count} problems: {_percent(shares[count // 2])})" if count > 2 else ""


def _up_to(share: float) -> str:
    return _percent(share) if share < SMALLEST else f"up to {_percent(share)}"


def _percent(share: float) -> str:
    if share < SMALLEST:
        return "less than 0.01 %"
    return f"{100.0 * share:.2g} %" if share < 0.995 else f"{100.0 * share:.0f} %"


def _time(seconds: float) -> str:
    if math.isnan(seconds):
        return DASH
    if seconds < 1e-3:
        return f"{1e6 * seconds:.0f} us"
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.3g} s"


def _share(error: float) -> str:
    if math.isnan(error):
        return DASH
    return f"{error:.1e}" if error else "0"


def _regret(row: TradeRow | None) -> str:
    if row is not None and row.violation > KEEPS:
        return f"{_percent(row.violation)} beyond a limit"
    if row is None or math.isnan(row.regret):
        return DASH
    # the cone solver is no more accurate
    return "0" if abs(row.regret) < 1e-8 else f"{row.regret:.1e}"
