"""How work that takes a while tells how far it is."""

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Called with (how much is done, how much there is in all) now and then."""
