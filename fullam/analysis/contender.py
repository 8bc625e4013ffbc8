"""Who takes part in a campaign: a controller with its settings and estimator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fullam.analysis.tuned_gains import contender_name, tuned_settings
from fullam.checks import Checker, shown
from fullam.control.controllers import load_settings, make_settings, plain_settings
from fullam.control.estimators import estimator_class
from fullam.control.settings_file import SettingsFile
from fullam.exceptions import CampaignError


@dataclass(frozen=True)
class Contender:
    """A controller as it takes part: its settings, its estimator, the name of its rows.

    Attributes:
        controller: Name of a registered controller.
        settings: Settings that differ from its defaults, "tuned" for the committed ones, or what
            `load_settings` read from a file; afterwards all of them.
        estimator: Name of an estimator; None takes the one that a file of settings is made for, or
            the campaign's, or else the controller's own.
        label: Name of its rows; made from the others if empty.
        file: The file that its settings are from.
    """

    controller: str
    settings: Mapping[str, Any] | str = field(default_factory=dict)
    estimator: str | None = None
    label: str = ""
    file: SettingsFile | None = field(default=None, init=False, compare=False, repr=False)

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
        if isinstance(settings, SettingsFile):
            suffix = f", {Path(settings.path).stem}"
            object.__setattr__(self, "file", settings)
            object.__setattr__(self, "estimator", self.estimator or settings.estimator)
        elif not isinstance(settings, Mapping):
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
            name = f"{self.controller}@{self.estimator}" if self.estimator else self.controller
            if self.file is not None:
                name = contender_name(self.controller, self.estimator)
            object.__setattr__(self, "label", f"{name}{suffix}")

    @property
    def complete(self) -> Mapping[str, Any]:
        """All of its settings."""
        assert not isinstance(self.settings, str), "resolved when this was made"
        return self.settings

    @classmethod
    def parse(cls, text: str, tuned: bool = False) -> Contender:
        """From "CONTROLLER" or "CONTROLLER@ESTIMATOR", or the path of a file of settings (.toml).

        Raises:
            CampaignError: A file that does not say whose settings it holds.
        """
        Checker("contender", CampaignError).text("name", text)
        if text.strip().endswith(".toml"):
            file = load_settings(text.strip())
            if file.controller is None:
                raise CampaignError(
                    file.path, "controller", "is missing", 'say whose they are: controller = "..."'
                )
            return cls(file.controller, file)
        controller, _, estimator = text.strip().partition("@")
        return cls(controller, "tuned" if tuned else {}, estimator or None)


def with_files(
    contenders: Sequence[Contender], files: Sequence[SettingsFile], estimator: str | None = None
) -> tuple[Contender, ...]:
    """Contenders, each with the file of settings that is for it.

    A file is for the contenders of the controller that it names; where these fly with several
    estimators, for those of its own. One that names no controller is for the only contender.

    Args:
        contenders: Who takes part.
        files: The files.
        estimator: One that was asked for, whatever the files say.

    Raises:
        CampaignError: A file is for none of them, or does not say for whom.
    """
    found = list(contenders)
    for file in files:
        if file.controller is None and len(found) > 1:
            names = ", ".join(c.label for c in found)
            problem = f"is missing, and several fly ({names})"
            raise CampaignError(file.path, "controller", problem, "say there whose settings it has")
        mine = [i for i, c in enumerate(found) if file.controller in (None, c.controller)]
        if not mine:
            raise CampaignError(
                file.path,
                "controller",
                f"is '{file.controller}', which does not fly here",
                f"name it with --controllers, or give settings of {found[0].controller}",
            )
        own = [i for i in mine if found[i].estimator in (None, file.estimator)]
        for i in own or mine:
            c = found[i]
            found[i] = Contender(c.controller, file, c.estimator or estimator)
    return tuple(found)
