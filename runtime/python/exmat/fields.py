"""HDF5 files of exmat, read as they are asked for. Needs h5py."""
import os
from types import TracebackType
from typing import Any, Dict, Iterator, List, Mapping, Optional, Type, Union

import numpy as np

from .errors import BadInput

StrPath = Union[str, "os.PathLike[str]"]


class Field:
    """A dataset: shape, dtype, units and description at once, numbers when it is indexed or made an array."""

    def __init__(self, dataset: Any) -> None:
        self._dataset = dataset

    @property
    def name(self) -> str:
        """Its path in the file."""
        return str(self._dataset.name)

    @property
    def shape(self) -> Any:
        return self._dataset.shape

    @property
    def dtype(self) -> Any:
        return self._dataset.dtype

    @property
    def units(self) -> str:
        """Such as "m" or "kg^(1/2) m"; "" of indices."""
        return _text(self._dataset.attrs.get("units", ""))

    @property
    def dims(self) -> str:
        """Names of the dimensions, such as "F n 3"."""
        return _text(self._dataset.attrs.get("dims", ""))

    @property
    def description(self) -> str:
        return _text(self._dataset.attrs.get("description", ""))

    def __len__(self) -> int:
        return len(self._dataset)

    def __getitem__(self, index: Any) -> Any:
        """What numpy would give, read from the file."""
        return self._dataset[index]

    def __array__(self, dtype: Any = None) -> Any:
        return np.asarray(self._dataset[()], dtype=dtype)

    def __repr__(self) -> str:
        units = f" [{self.units}]" if self.units else ""
        return f"<field {self.name} {self.shape} {self.dtype}{units}: {self.description}>"


class _File(Mapping[str, Field]):
    """Fields by their paths, without the first slash; attributes in `attributes`."""

    _format = ""

    def __init__(self, path: StrPath) -> None:
        try:
            import h5py  # type: ignore[import]
        except ImportError:
            raise ImportError(f"exmat.{type(self).__name__} needs h5py; install python3-h5py") from None

        self._dataset_type = h5py.Dataset
        try:
            self._file: Any = h5py.File(path, "r")
        except (OSError, ValueError) as error:
            raise BadInput(f"{os.fspath(path)}: expected an HDF5 file of exmat, found {_found(path, str(error))}") from None
        found = _text(self._file.attrs.get("format", ""))
        if found != self._format:
            self._file.close()
            raise BadInput(f'{os.fspath(path)}: /@format: expected "{self._format}", found "{found}"')
        self._names: List[str] = []
        self._file.visititems(self._note)

    def _note(self, name: str, item: Any) -> None:
        if isinstance(item, self._dataset_type):
            self._names.append(name)

    @property
    def attributes(self) -> Dict[str, Any]:
        """Of the file, by name."""
        return {name: _plain(value) for name, value in self._file.attrs.items()}

    def attributes_of(self, path: str) -> Dict[str, Any]:
        """Of a group or field, by name. Raises KeyError."""
        return {name: _plain(value) for name, value in self._file[path.strip("/")].attrs.items()}

    def __getitem__(self, name: str) -> Field:
        wanted = name.strip("/")
        if wanted not in self._names:
            raise KeyError(f"there is no field {name}; there are {', '.join(self._names)}")
        return Field(self._file[wanted])

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def close(self) -> None:
        """Fields can no longer be read then."""
        self._file.close()

    def __enter__(self) -> Any:
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], error: Optional[BaseException], trace: Optional[TracebackType]) -> None:
        self.close()


class Trajectory(_File):
    """What a run wrote, frame by frame; fields are read as they are indexed. F frames, n vertices.

    >>> with exmat.Trajectory("run.h5") as run:                      # doctest: +SKIP
    ...     run.vertices[-1]           # (n, 3) [m], the last frame alone is read
    ...     run["energy/kinetic"][:]   # (F,) [J]
    """

    _format = "exmat-trajectory"

    @property
    def time(self) -> Any:
        """Of each frame, shape (F,) [s]."""
        return self["time"][:]

    @property
    def vertices(self) -> Field:
        """Positions, world frame, from `origin`, (F, n, 3) [m]."""
        return self["vertices"]

    @property
    def origin(self) -> Any:
        """What vertices are measured from, (3,) [m]: 0 unless single precision would lose them there."""
        return np.asarray(self.attributes.get("origin", (0.0, 0.0, 0.0)))

    @property
    def tets(self) -> Any:
        """Vertices of each tet, (n_t, 4)."""
        return self["tets"][:]

    @property
    def frames(self) -> int:
        """F."""
        return len(self["time"])


class Bundle(_File):
    """What exmat-precompute wrote: fields by their paths, with their units.

    >>> with exmat.Bundle("bar.h5") as bundle:                       # doctest: +SKIP
    ...     bundle["modal/frequencies"].units    # 'Hz'
    ...     bundle["modal/frequencies"][:]       # (r,)
    """

    _format = "exmat-bundle"

    @property
    def features(self) -> List[str]:
        """The groups that it has."""
        return list(self.attributes["features"])


def _found(path: StrPath, reason: str) -> str:
    """What is there in place of a file that HDF5 opens."""
    if not os.path.exists(path):
        return "no such file"
    if not os.path.isfile(path):
        return "a folder" if os.path.isdir(path) else "a pipe or a device, no regular file"
    if "lock" in reason or "already open" in reason:
        return "one that another program has open to write, or has locked; close it there, or read a copy"
    return "another kind of file" if "signature" in reason else "one that cannot be opened: " + " ".join(reason.split())


def _text(value: Any) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)


def _plain(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.decode()
    if isinstance(value, np.ndarray) and value.dtype.kind in "OS":
        return [_text(member) for member in value]
    return value.item() if isinstance(value, np.generic) else value
