"""Everything flexpara raises on purpose.

    FlexparaError                 exit 1   root of the family; catch this one
    ├── InputError                exit 2   the file, the points or an option is wrong (also a ValueError)
    │   ├── MissingFileError               nothing lies at the path given (also a FileNotFoundError)
    │   ├── MeshError                      it is no mesh, or a mesh with nothing to unwrap
    │   ├── ShapeError                     an array has the wrong shape or dtype
    │   ├── BundleError                    an ONNX file that is not ours, or of another format version
    │   ├── NoRoomError                    the page is too small for so many charts with their padding
    │   └── ForeignFileError               the output would overwrite a file that flexpara did not write
    ├── MissingDependencyError    exit 3   torch, OpenGL, … is absent; the message has the remedy (an ImportError)
    ├── FinishError               exit 1   no valid atlas could be made (a defect worth reporting)
    └── ParityError               exit 1   torch and onnxruntime disagree; nothing was written

Each message says the value found, what was expected, and the remedy, in one line.
"""

from __future__ import annotations


class FlexparaError(Exception):
    """Root of the family.  ``exit_code`` is what the command line ends with."""

    exit_code = 1


class InputError(FlexparaError, ValueError):
    """What the user gave can't be used."""

    exit_code = 2


class MissingFileError(InputError, FileNotFoundError):
    """Nothing lies at the path given."""

    def __str__(self) -> str:
        """The message alone: OSError would show its errno pair."""
        return str(self.args[0])


class MeshError(InputError):
    """No mesh, or a mesh with nothing to unwrap."""


class ShapeError(InputError):
    """An array has the wrong shape or dtype."""


class BundleError(InputError):
    """An ONNX file that flexpara did not write, or one of another format version."""


class NoRoomError(InputError):
    """The page is too small for so many charts with their padding."""


class ForeignFileError(InputError):
    """The output would overwrite a file that flexpara did not write."""


class DiskFullError(InputError):
    """No room is left for the output: once there is, the same again may work."""


class MissingDependencyError(FlexparaError, ImportError):
    """An optional dependency is absent; the message names the package and the command that installs it."""

    exit_code = 3


class FinishError(FlexparaError):
    """No valid atlas could be made of this surface."""


class ParityError(FlexparaError):
    """The exported graph and the torch model disagree."""
