"""Who takes part in a campaign: a controller with its settings and estimator."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from fullam.analysis.tuned_gains import tuned_settings
from fullam.checks import Checker, shown
from fullam.control.controllers import make_settings, plain_settings
from fullam.control.estimators import estimator_class
from fullam.exceptions import CampaignError


@dataclass(frozen=True)
class Contender:
    """A controller as it takes part: its settings, its estimator, the name of its rows.

    Attributes:
        controller: Name of a registered controller.
        settings: Settings that differ from its defaults, or "tuned" for the committed ones.
        estimator: Name of an estimator; None takes the campaign's, or else the controller's own.
        label: Name of its rows; made from the others if empty.
    """

    controller: str
    settings: dict[str, Any] | str = field(default_factory=dict)
    estimator: str | None = None
    label: str = ""

    def __post_init__(self) -> None:
        """Resolve the settings and check the names."""
        settings, suffix = self.settings, ""
        check = Checker("contender", CampaignError)
        check.text("controller", self.controller)
        check.text("label", self.label, prose=True)
        if self.estimator is not None:
            check.text("estimator", self.estimator)
        if isinstance(settings, str) and settings == "tuned":
            settings, suffix = tuned_settings(self.controller, self.estimator), ", tuned"
        if not isinstance(settings, dict):
            raise CampaignError(
                f"contender '{self.controller}'",
                "settings",
                f"is {shown(settings)}",
                "give 'tuned' or a mapping",
            )
        complete = plain_settings(self.controller, make_settings(self.controller, settings))
        object.__setattr__(self, "settings", complete)
        if self.estimator is not None:
            estimator_class(self.estimator)
        if not self.label:
            at = f"@{self.estimator}" if self.estimator else ""
            object.__setattr__(self, "label", f"{self.controller}{at}{suffix}")

    @classmethod
    def parse(cls, text: str, tuned: bool = False) -> Contender:
        """From "CONTROLLER" or "CONTROLLER@ESTIMATOR"."""
        Checker("contender", CampaignError).text("name", text)
        controller, _, estimator = text.strip().partition("@")
        return cls(controller, "tuned" if tuned else {}, estimator or None)
