"""What candidates of a search cost, each flown once, also when the search is stopped between."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fullam.analysis.cluster import Workers
from fullam.analysis.journal import Journal
from fullam.exceptions import CampaignError


@dataclass(frozen=True, eq=False)
class Prices:
    """Costs of candidates.

    Attributes:
        workers: Where candidates are flown.
        price: Cost of a candidate's settings; takes the keyword `flights`.
        journal: Keeps the costs; None keeps none.
        unchanged: Whether what flies is still what flew at the start of the search.
    """

    workers: Workers
    price: Callable[..., float]
    journal: Journal | None
    unchanged: Callable[[], bool]

    def of(
        self, candidates: Sequence[Mapping[str, Any]], flights: Sequence[tuple[str, int]]
    ) -> list[float]:
        """Costs of some candidates over some flights, in the candidates' order.

        Raises:
            CampaignError: A vehicle was edited while they flew; their costs are not kept.
        """
        costs: dict[int, float] = {}
        if self.journal is not None:
            known = [self.journal.get([c, flights]) for c in candidates]
            costs = {i: cost for i, cost in enumerate(known) if cost is not None}
        pending = [i for i in range(len(candidates)) if i not in costs]
        work = functools.partial(self.price, flights=flights)
        for k, cost in self.workers.map_unordered(work, [candidates[i] for i in pending]):
            if not self.unchanged():
                raise CampaignError(
                    "tuning", "vehicle", "was edited while candidates flew", "start it again"
                )
            costs[pending[k]] = cost
            if self.journal is not None:
                self.journal.put([candidates[pending[k]], flights], cost)
        return [costs[i] for i in range(len(candidates))]
