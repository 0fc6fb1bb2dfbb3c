"""The warning class of the package: something in the input was left out or replaced, and the work goes on."""


class FrazilWarning(UserWarning):
    """Something in the input was left out or replaced; the message begins with the path of the object."""
