"""What can go wrong in a way that its user can mend: each error is one plain sentence."""


class RenderError(Exception):
    """A renderer that gave no usable image: one plain sentence."""


class RenderTimeout(RenderError):
    """A renderer that did not end in time."""


class RenderLate(RenderError):
    """A picture that took longer than it may: none, where an assignment says so."""


class NotFound(Exception):
    """A renderer that cannot be started at all, or a request that makes no sense: nothing can be judged."""


class ImageError(Exception):
    """A file that is not a usable image; one line that names the file."""


class PatchError(Exception):
    """A patch that no longer applies, or sources that it breaks: one line."""


class ReferenceError_(ValueError):
    """A scene or reference that is missing, stale or unreadable: one line that says what to do."""


class Lost(RenderError):
    """A piece whose process was killed: what it would have given is not known."""
