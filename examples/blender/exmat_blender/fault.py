"""What is wrong, in words for the panel."""


class Fault(Exception):
    """Something that the user can change; its text says what."""
