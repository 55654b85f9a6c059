"""What can go wrong in a way that its user can mend: each error is one plain sentence."""


class PlainError(Exception):
    """The sentence; the command line prints it and ends with exit status 2."""


class RenderError(PlainError):
    """A renderer that gave no usable image: one plain sentence."""


class RenderTimeout(RenderError):
    """A renderer that did not end in time."""


class OutOfTime(RenderError):
    """The time that the user gave was over before all pictures were there."""


class RenderLate(RenderError):
    """A picture that took longer than it may: none, where an assignment says so."""


class CannotRender(RenderError):
    """A renderer that says, by exit status 77 or a line "unsupported: why", that it does not support the
    scene.
    """


class NotFound(PlainError):
    """A renderer that cannot be started at all, or a request that makes no sense: nothing can be judged."""


class ImageError(PlainError):
    """A file that is not a usable image; one line that names the file."""


class PatchError(PlainError):
    """A patch that no longer applies, or sources that it breaks: one line."""


class ReferenceError_(PlainError, ValueError):
    """A scene or reference that is missing, stale or unreadable: one line that says what to do."""


class Lost(RenderError):
    """A piece whose process was killed: what it would have given is not known."""
