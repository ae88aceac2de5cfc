"""How far things are."""

from collections.abc import Callable

Progress = Callable[[str, float], None]
"""Is told what is being done ("sending bun045.ply", "registering", ...) and how much of all is done, 0 to 1."""


def silent(_what: str, _done: float) -> None:
    """Tells nobody."""
