"""What can go wrong."""

from typing import Any

from .core.models import Job, JobError, Problem
from .core.types import Response


class VisageError(Exception):
    """Anything that went wrong with a service."""


class NoConnection(VisageError):
    """The service does not answer, however often it is asked."""


class Refused(VisageError):
    """The service has refused a request, and says why (RFC 9457)."""

    def __init__(self, status: int, code: str, detail: str, hint: str, scan: str | None = None):
        super().__init__(f"{detail} ({code}); {hint}" if hint else f"{detail} ({code})")
        self.status = status
        self.code = code
        """Stable: what to decide by."""
        self.detail = detail
        self.hint = hint
        self.scan = scan
        """The scan concerned, if it is one."""


class NotRegistered(VisageError):
    """The job has ended without a model."""

    def __init__(self, job: Job):
        error = job.error
        what = f"{error.message} ({error.code}); {error.hint}" if isinstance(error, JobError) else f"the job was {job.status}"
        super().__init__(what)
        self.job = job


def refusal(response: Response[Any]) -> Refused:
    """What an answer that is not the one expected says."""
    problem = response.parsed
    if isinstance(problem, Problem):
        scan = problem.scan if isinstance(problem.scan, str) else None
        return Refused(problem.status, problem.code, problem.detail, problem.hint, scan)
    status = int(response.status_code)
    hint = "look at what stands between this program and the service"
    return Refused(status, "unknown", f"the answer has the status {status}, and nothing of visage in it", hint)
