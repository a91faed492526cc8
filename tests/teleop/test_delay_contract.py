"""The delay contract: what is agreed, and how long a silence may be."""

import pytest

from pilotfish.errors import InvalidInput
from pilotfish.teleop.delay_contract import ContractLimits, DelayContract, agree, allows_mode, nanoseconds

PERIOD = 20_000_000


def test_contract_ages_are_sums_of_budget_jitter_and_periods():
    contract = agree(ContractLimits(), 2.0, 0.25, PERIOD)
    assert contract == DelayContract(2_000_000_000, 250_000_000, PERIOD)
    assert contract.max_age == 2_250_000_000
    assert contract.loss_after == 290_000_000


@pytest.mark.parametrize(
    ("budget", "jitter"),
    [(5.1, 0.2), (1.0, 2.1), (1.0, 0.0), (-1.0, 0.2), (float("nan"), 0.2), (1.0, float("nan"))],
)
def test_agree_times_beyond_the_limits_gives_no_contract(budget, jitter):
    assert agree(ContractLimits(), budget, jitter, PERIOD) is None


def test_allows_mode_direct_up_to_its_budget_only():
    limits = ContractLimits()
    contracts = [DelayContract(nanoseconds(b), PERIOD, PERIOD) for b in (0.5, 0.51)]
    assert [allows_mode(limits, each, "direct") for each in contracts] == [True, False]
    assert all(allows_mode(limits, each, "shared") for each in contracts)


@pytest.mark.parametrize(
    "budgets", [{}, {"direct": 1.0}, {"direct": -1.0, "shared": 1, "autonomous": 1, "fixture": 1}]
)
def test_contract_limits_without_every_mode_are_refused(budgets):
    with pytest.raises(InvalidInput):
        ContractLimits(mode_budgets=budgets)
