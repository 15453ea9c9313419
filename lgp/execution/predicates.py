"""Start and end predicates of an action: its preconditions and effects, read off the tracked world."""

from __future__ import annotations

from dataclasses import dataclass

from lgp.execution.observation import View
from lgp.execution.recognise import Verdict, recognise
from lgp.logic import Action, Task
from lgp.logic.atom import Atom


@dataclass(frozen=True)
class Predicate:
    """An atom that is to hold, or with `wanted` False is not to hold."""

    atom: Atom
    wanted: bool = True

    def __str__(self) -> str:
        return str(self.atom) if self.wanted else f"not {self.atom}"

    def check(self, view: View, believed: bool) -> Verdict:
        """Return whether it holds.

        Args:
            view: the tracked world.
            believed: what the plan says about the atom, for those that have no geometry.
        """
        found = recognise(view, self.atom)
        if found is None:
            return Verdict(believed == self.wanted, f"{self} is not so by the plan")
        if self.wanted or found.holds is None:
            return Verdict(found.holds, found.why or f"{self} does not hold")
        return Verdict(not found.holds, f"{self.atom} holds")


def start_of(task: Task, action: Action) -> tuple[Predicate, ...]:
    """Return what is to hold before an action begins: its preconditions.

    Atoms without geometry come last, so that what is seen is told first.
    """
    return tuple(Predicate(atom) for atom in task.holding(action.needs)) + tuple(
        Predicate(atom, False) for atom in task.holding(action.forbids)
    )


def end_of(task: Task, action: Action) -> tuple[Predicate, ...]:
    """Return what is to hold for an action to be finished: what it brings about."""
    return tuple(Predicate(atom) for atom in task.holding(action.adds))


def check(predicates: tuple[Predicate, ...], view: View, task: Task, state: int) -> dict[str, Verdict]:
    """Return the verdict on each predicate, by its text.

    Args:
        predicates: of the start or the end of an action.
        view: the tracked world.
        task: whose atoms they are.
        state: what the plan says holds, for atoms without geometry.
    """
    believed = set(task.holding(state))
    return {str(one): one.check(view, one.atom in believed) for one in predicates}


def all_hold(verdicts: dict[str, Verdict]) -> bool:
    """Return whether all hold for sure."""
    return all(verdict.holds for verdict in verdicts.values())


def first_failing(verdicts: dict[str, Verdict]) -> str:
    """Return why the first that does not hold does not, "" if all hold."""
    return next((verdict.why for verdict in verdicts.values() if not verdict.holds), "")
