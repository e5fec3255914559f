"""Exceptions of exmat. All are of Error; each also is the built-in one that it is a kind of."""


class Error(Exception):
    """Something that exmat says; its text is the library's or the program's message."""


class Failure(Error, RuntimeError):
    """Out of memory, a file that cannot be read to its end, a program that failed while working."""


class BadInput(Error, ValueError):
    """A bundle, scene or asset is wrong: the message has file, place, what was expected and found, and advice."""


class InvalidArgument(Error, ValueError):
    """An argument of a function is wrong."""


class NonFinite(Error, ArithmeticError):
    """A step met NaN or infinity; the body is as it was before that step."""


class Cancelled(Error):
    """A computation was cancelled; it has written nothing."""
