"""How calls are made: again after a lost connection, and when the service asks for patience."""

import asyncio
import time
from typing import Any, TypeVar

import httpx
from attrs import frozen

from ._errors import NoConnection
from ._steps import Call, Steps
from .core import AuthenticatedClient
from .core import Client as Anonymous
from .core.types import Response

T = TypeVar("T")
Core = Anonymous | AuthenticatedClient

LOST = (httpx.TransportError, ValueError, KeyError)
"""No answer, or one that is not the service's: a proxy between may say anything."""

BUSY = {408, 429, 502, 503, 504}
"""Answers after which the same request may succeed."""


@frozen
class Patience:
    """How often and how long a call is tried."""

    attempts: int = 6
    first_pause: float = 0.5
    longest_pause: float = 20.0

    def pause(self, failed: int, response: Response[Any] | None) -> float | None:
        """Seconds before the next attempt; `None` if there is none."""
        if failed >= self.attempts:
            return None
        asked = response.headers.get("retry-after", "") if response is not None else ""
        pause = float(asked) if asked.isdigit() else self.first_pause * float(2 ** (failed - 1))
        return min(pause, self.longest_pause)


class _Attempts:
    """The attempts at one call: says after each whether there is another, and when."""

    def __init__(self, patience: Patience, call: Call):
        self.patience = patience
        self.call = call
        self.failed = 0

    def after(self, response: Response[Any]) -> float | None:
        if int(response.status_code) not in BUSY or not self.call.is_repeatable:
            return None
        self.failed += 1
        return self.patience.pause(self.failed, response)

    def after_loss(self, error: Exception) -> float:
        self.failed += 1
        # what was never connected has done nothing
        may_repeat = self.call.is_repeatable or isinstance(error, httpx.ConnectError)
        pause = self.patience.pause(self.failed, None) if may_repeat else None
        if pause is None:
            raise NoConnection(f"the service does not answer: {error or type(error).__name__}") from error
        return pause


def run(core: Core, patience: Patience, steps: Steps[T]) -> T:
    """Makes the calls one after the other."""
    try:
        call = next(steps)
        while True:
            try:
                response = _make(core, patience, call)
            except NoConnection as lost:
                call = steps.throw(lost)
            else:
                call = steps.send(response)
    except StopIteration as end:
        result: T = end.value
        return result


async def run_async(core: Core, patience: Patience, steps: Steps[T]) -> T:
    """The same where nothing may block."""
    try:
        call = next(steps)
        while True:
            try:
                response = await _make_async(core, patience, call)
            except NoConnection as lost:
                call = steps.throw(lost)
            else:
                call = steps.send(response)
    except StopIteration as end:
        result: T = end.value
        return result


def _make(core: Core, patience: Patience, call: Call) -> Response[Any]:
    attempts = _Attempts(patience, call)
    while True:
        try:
            response = call.operation.sync_detailed(client=core, **call.arguments)
            pause = attempts.after(response)
            if pause is None:
                return response
        except LOST as error:
            pause = attempts.after_loss(error)
        time.sleep(pause)


async def _make_async(core: Core, patience: Patience, call: Call) -> Response[Any]:
    attempts = _Attempts(patience, call)
    while True:
        try:
            response = await call.operation.asyncio_detailed(client=core, **call.arguments)
            pause = attempts.after(response)
            if pause is None:
                return response
        except LOST as error:
            pause = attempts.after_loss(error)
        await asyncio.sleep(pause)
