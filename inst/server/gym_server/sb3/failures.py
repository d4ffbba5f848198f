"""What may go wrong with a job, in words for its user."""

from __future__ import annotations

from typing import Any


class JobError(Exception):
    """Something that the user can mend.

    Attributes:
        fields: what ``result.json`` says of it: the ``message``, a ``hint``, the ``argument`` that
            was wrong, and for an unknown name those that are ``known``.
    """

    def __init__(self, message: str, hint: str | None = None, **fields: Any) -> None:
        super().__init__(message)
        self.fields = {"message": message, "hint": hint, **fields}


def in_words(failure: BaseException) -> dict[str, Any]:
    """Return the fields of ``result.json`` for a failure of any kind."""
    if isinstance(failure, JobError):
        return failure.fields
    text = " ".join(str(failure).split())[:500]
    kind = type(failure).__name__
    if isinstance(failure, MemoryError) or "out of memory" in text or "allocate memory" in text:
        return {
            "message": f"The memory does not suffice: {text or kind}",
            "hint": "A smaller `buffer_size`, `batch_size` or `num_envs` takes less.",
        }
    # PyTorch's distributions check what a network returns.
    if "nan" in text.lower() and isinstance(failure, ValueError):
        return _diverged("The network's outputs have become NaN.")
    return {"message": f"{kind}: {text}" if text else kind, "hint": None}


def diverged(name: str, steps: int) -> JobError:
    """Return the error for a loss that is no number any more."""
    return JobError(**_diverged(f"`{name}` has become NaN or infinite after {steps} steps."))


def _diverged(message: str) -> dict[str, Any]:
    return {"message": message, "hint": "A smaller `learning_rate` may prevent that."}
