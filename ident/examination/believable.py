"""What would explain torques that the model as it is does not: every hypothesis that is believed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ident.equations.prepared import Prepared
from ident.examination.fits.bodies import beyond_own
from ident.examination.fits.hypothesis import CLEARLY, EXPLAINED, Asked, Hypothesis, bad
from ident.examination.fits.quick import Fit
from ident.examination.fits.stretches import RARE, Explained, steadily
from ident.examination.one_recording.another_clock import clock_of_all
from ident.examination.positions.coupled import coupled_positions
from ident.examination.positions.motions import by_themselves, moved_positions, signed
from ident.examination.positions.places import other_orders, other_torques, swapped, swapped_positions
from ident.examination.positions.units import degrees, geared, scaled_positions
from ident.examination.rivals.scales import scales, too_large, turned_scales
from ident.examination.robot.base import Tilt
from ident.examination.robot.geometry import beside_tilt, of_geometry
from ident.examination.robot.known_tables import known_tables
from ident.examination.robot.lengths import lengths
from ident.examination.torques.believed import believed
from ident.examination.torques.delays import delays
from ident.examination.torques.magnitudes import magnitudes
from ident.examination.torques.signs import all_signs, several_signs
from ident.examination.torques.turned import all_turned, one_turned, turned_positions
from ident.examination.torques.weightless import weightless

DOUBTFUL = 0.15  # error of a channel from which several faults at once are asked for
TURNED = 0.05  # and that of gravity, which a slow motion hardly feels upside down


def believable(prepared: Prepared, asked: Asked) -> list[Hypothesis]:
    """What would explain torques that the model as it is does not; one where nothing else is to be asked."""
    torques = all_signs(asked)
    everything = torques and all_turned(asked, torques)
    if everything and not _nonsense(asked.after(everything).fit):
        right = [h for h in _positions(asked) if believed(asked, h) and not _mirrored(asked, h)]
        return right or [everything]
    doubted = [c for s in prepared.streams for c in s.checks if c.check == "torque_scale" and c.hint]
    large = list(too_large(asked, {name for c in doubted for name in c.signals}))
    large = [h for h in large if believed(asked, h)][:1]
    if large:
        return large
    error = asked.fit.error[np.isfinite(asked.fit.error)]
    found = [*one_turned(asked), *magnitudes(asked)]
    if not prepared.study.without:  # a torque that misses a term of the model looks scaled
        found += scales(asked)
    if error.max() > DOUBTFUL:
        found += [*several_signs(asked), *swapped(asked), *other_torques(asked), *degrees(asked)]
        found += turned_scales(asked) if not prepared.study.without else []
        found += [*coupled_positions(asked), *_positions(asked)]
    if bad(asked.fit):
        found += [*geared(asked), *scaled_positions(asked), *other_orders(asked)]
    clocks = list(clock_of_all(asked))
    longer = list(lengths(prepared, asked)) if clocks else []  # by which bodies weigh otherwise, too
    clocks = [h for h in clocks if all(h.gain > its.gain for its in longer)]
    found += [*weightless(asked), *delays(asked), *clocks]
    found.sort(key=lambda h: h.gain)  # of what was asked in several ways the one that explains most
    once = {(h.check.check, h.check.signals): h for h in found}
    found = [h for h in once.values() if believed(asked, h)]
    found += [] if clocks else longer
    hidden = _hidden(asked, found) if error.max() > DOUBTFUL else []
    if error.max() > TURNED:
        best = max((h.gain for h in found), default=0.0)
        geometry = [*of_geometry(prepared, asked, best), *known_tables(prepared, asked, found)]
        each = max((its.each for its in geometry if isinstance(its, Hypothesis)), default=-np.inf)
        if hidden and hidden[0].gain > each + CLEARLY:
            return hidden
        for its in geometry:
            if isinstance(its, Tilt):
                found = [h for h in found if h.gain > its.gain or beside_tilt(prepared, asked, h, its)]
            else:
                found.append(its)
    return found


def _hidden(asked: Asked, found: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Positions recorded otherwise by what every torque by itself says, where no hypothesis is found that
    explains them by themselves about as well, and together, too."""
    each = by_themselves(asked)
    contradict = beyond_own(asked.fit.error, each.fit.error).any()
    if not contradict and not bad(asked.fit):
        return []
    told = list(moved_positions(asked, each, zeros=bool(contradict)))
    told = [h for h in told if not (unforeseen(asked.fit) and unforeseen(asked.after(h).fit))]
    if not told:
        return []
    others = [(by_themselves(asked.after(h)), h) for h in found]
    as_well = [(its, h) for its, h in others if its.fit.gain_over(each.fit) > told[0].gain - CLEARLY]
    together = signed(by_themselves(asked.after(told[0])))
    assert together is not None
    kept = [not steadily(Explained.by(its.quick, h.how), together, RARE) for its, h in as_well]
    return [] if any(kept) else told


def unforeseen(fit: Fit) -> bool:
    """Whether of a torque that judges the prediction is worse than none."""
    return fit.validate is not None and bool(np.nanmax(fit.validate, initial=0.0) > 1.0)


def _nonsense(fit: Fit) -> bool:
    """Whether it explains not all of what is fitted, nor foretells what judges: its friction may be anything.
    (A clean LWR4+'s first run, explained, foretells its second no better; of neither were turned positions
    told.)"""
    return bool(np.nanmax(fit.error) > EXPLAINED) and unforeseen(fit)


def _positions(asked: Asked) -> list[Hypothesis]:
    """Positions turned or swapped; without those of a mirrored arm, all of whose torques are then turned,
    where another one is not."""
    found = [*swapped_positions(asked), *turned_positions(asked)]
    return [h for h in found if not _mirrored(asked, h)] or found


def _mirrored(asked: Asked, h: Hypothesis) -> bool:
    return h.quick is not None and all_signs(asked.after(h)) is not None
