"""Each attack with as many cases as a fast suite can afford; `make hostile` makes thousands.

The seed is fixed, so the same cases come every time; FULLAM_FUZZ=N asks for N of each.
"""

import os

import pytest

pytest.importorskip("pyarrow", reason="the extra 'campaign' is not installed")

from attacks import ATTACKS
from hypothesis import HealthCheck, given, seed, settings

CASES = int(os.environ.get("FULLAM_FUZZ", "150"))


# Files are long, and hypothesis says so when it shows one that failed.
@pytest.mark.filterwarnings("ignore::hypothesis.errors.HypothesisWarning")
@pytest.mark.parametrize("attack", ATTACKS, ids=lambda attack: attack.name)
def test_an_attack_meets_an_answer_or_a_refusal(attack):
    @seed(20260101)
    @settings(
        max_examples=CASES,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(attack.cases)
    def attacked(case):
        attack.happen(case)

    attacked()


def test_wrong_types_meet_an_error_of_ours():
    import api

    count, bad = api.failures()
    assert count > 3000
    assert bad == []
