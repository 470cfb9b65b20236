"""The named values of a field as attributes: ``field.exx`` is ``field.value("exx")``, ``sigma_exx`` its sigma."""

from __future__ import annotations

from typing import Protocol, Self, overload

from analysis.field.tensor import Floats
from analysis.field.uncertainty import combination


class Named(Protocol):
    """What knows values by their names."""

    def value(self, name: str, /) -> Floats: ...

    def sigma(self, name: str, /) -> Floats: ...


class Value:
    """An attribute that is the value of its own name, (R, C); ``text`` says which and in what unit."""

    def __init__(self, text: str) -> None:
        self.__doc__ = text

    def __set_name__(self, owner: type, name: str) -> None:
        combination(name)  # a name that is not known is refused here
        self.name = name

    @overload
    def __get__(self, field: None, owner: type) -> Self: ...

    @overload
    def __get__(self, field: Named, owner: type) -> Floats: ...

    def __get__(self, field: Named | None, owner: type) -> Self | Floats:
        return self if field is None else self.of(field)

    def of(self, field: Named) -> Floats:
        return field.value(self.name)


class Sigma(Value):
    """An attribute ``sigma_NAME`` that is the standard uncertainty of the value NAME, (R, C), in its unit."""

    def __init__(self) -> None:
        super().__init__("Standard uncertainty of the value of this name, (R, C), in its unit.")

    def __set_name__(self, owner: type, name: str) -> None:
        super().__set_name__(owner, name.removeprefix("sigma_"))

    def of(self, field: Named) -> Floats:
        return field.sigma(self.name)
