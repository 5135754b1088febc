"""The one exception class of the package."""


class Error(Exception):
    """Why a call has no answer: `kind` in one word, the message with the number seen, the number needed and the way out.

    Kinds: `input` (an argument that cannot be), `file`, `target`, `request`, `intrinsics`, `write`, those of the mathematics such as
    `too_few_points` and `outside_field`, and `panic`, a mistake of this library. What is wrong with one image or view is no exception: its
    answer has a status and a message.
    """

    kind: str

    def __init__(self, message: str, kind: str = "input") -> None:
        super().__init__(message)
        self.kind = kind

    def __reduce__(self) -> tuple[type["Error"], tuple[str, str]]:
        return Error, (str(self), self.kind)
