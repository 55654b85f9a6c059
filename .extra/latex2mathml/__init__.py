from importlib import metadata

__version__ = metadata.version("latex2mathml")
