"""raycheck list: the names that the other commands take."""

from raycheck.scene import variants
from raycheck.scene.techniques import ON_REQUEST, TECHNIQUES


def list() -> None:
    """List the canonical scenes and the techniques, each with what it is."""
    from raycheck.commands.terminal import Columns, Output

    console = Output()
    scenes = Columns(("scene", "parameters", "what it shows"), wrap=("parameters", "what it shows"))
    for name in variants.scene_names():
        defaults = variants.variant(name).document().defaults
        settings = " ".join(f"-D{key}={value}" for key, value in defaults.items())
        scenes.add_row(name, settings, variants.summary(name))
    scenes.show(console)
    console.print()
    techniques = Columns(("technique", "what it does"), wrap=("what it does",))
    for one in (*TECHNIQUES, *ON_REQUEST):
        techniques.add_row(one.name, one.summary)
    techniques.show(console)
