"""Calls of the service as steps: a generator yields what is to be called and is sent the answer.

So what `Client` and `AsyncClient` do is written once; they differ only in how a call is made (`_drive`).
"""

from collections.abc import Generator
from typing import Any, Protocol, TypeVar

from attrs import field, frozen

from ._errors import refusal
from .core.types import Response

T = TypeVar("T")


class Operation(Protocol):
    """A module that the generator has made of an operation."""

    def sync_detailed(self, *args: Any, **kwargs: Any) -> Response[Any]: ...

    async def asyncio_detailed(self, *args: Any, **kwargs: Any) -> Response[Any]: ...


@frozen
class Call:
    """An operation with its arguments."""

    operation: Operation
    arguments: dict[str, Any] = field(factory=dict)
    is_repeatable: bool = True
    """Whether it may be sent again when its answer was lost."""


Steps = Generator[Call, Response[Any], T]


def ask(operation: Operation, expected: type[T], **arguments: Any) -> Steps[T]:
    """One call that is answered with a value of a type."""
    response = yield Call(operation, arguments)
    if not isinstance(response.parsed, expected):
        raise refusal(response)
    return response.parsed


def tell(operation: Operation, **arguments: Any) -> Steps[Response[Any]]:
    """One call whose answer has no content."""
    return succeeded((yield Call(operation, arguments)))


def succeeded(response: Response[Any]) -> Response[Any]:
    """An answer, if it is no refusal."""
    if not 200 <= int(response.status_code) < 300:
        raise refusal(response)
    return response
