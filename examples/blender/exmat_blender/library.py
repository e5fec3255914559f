"""Finding the Python package exmat."""
import importlib
import os
import sys

from .fault import Fault

ADVICE = ("in the add-on's preferences name the folder that holds the folder 'exmat' (build/release/python of a build, "
          "/usr/lib/python3/dist-packages of the Debian package), or start Blender with PYTHONPATH set to it")


def load(folder=""):
    """The module exmat, looked for in `folder` too. Raises Fault."""
    if folder and not os.path.isfile(os.path.join(folder, "exmat", "__init__.py")):
        raise Fault(f"There is no package exmat in {folder}: {ADVICE}.")
    if folder and folder not in sys.path:
        sys.path.insert(0, folder)
    python = "{}.{}".format(*sys.version_info)
    try:
        module = importlib.import_module("exmat")
    except ModuleNotFoundError as error:
        if error.name == "exmat":
            raise Fault(f"The Python package exmat was not found: {ADVICE}.") from None
        if error.name == "exmat._exmat":
            raise Fault(f"The package exmat that was found is made for another Python than Blender's {python}: build it with "
                        f"-DPython_EXECUTABLE=... of that version.") from None
        raise Fault(f"exmat needs the Python package {error.name}, which Blender's Python {python} does not have.") from None
    except ImportError as error:
        raise Fault(f"The package exmat cannot be loaded: {error}.") from None
    if not hasattr(module, "Model"):
        raise Fault(f"What was found as exmat is another package, in {getattr(module, '__path__', '?')}: {ADVICE}.")
    return module
