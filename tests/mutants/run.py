"""Do the tests notice? Faults are planted one by one in a copy of the tree, and the tests about that module are run.

`make mutants` chooses 330 slips of the hand over all rooms (the same ones for the same seed), and plants the faults of
`planted.yaml`, which somebody found that no test noticed. What is known to change nothing stands with its reason in
`equivalent.yaml` and is left out. Results are kept in WORK/results.jsonl: a run that was stopped goes on.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from tests.mutants.mutations import Mutation, has_kernels, is_python, mutations_of
from tests.mutants.reach import Reach
from tests.mutants.targets import Targets
from tests.mutants.trial import Outcome, Tree, preload

HERE = Path(__file__).parent
CHECKOUT = HERE.parents[1]
MOST = 150  # tests that are asked about one mutant
EACH = 6.0  # seconds that a test may take with kernels as plain Python
COMPILING = 240.0  # seconds to compile what calls a kernel
WANTED = 0.95  # share of the mutants that tests must notice


@dataclass(frozen=True)
class Planted:
    """A fault that was found to survive once, and the tests that must notice it."""

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]

    def applied_to(self, source: str) -> str:
        """Return the source text with the fault; ValueError when it cannot be planted as it is written."""
        if source.count(self.old) != 1:
            raise ValueError(f"{self.name}: {self.file} holds its old text {source.count(self.old)} times, not once")
        return source.replace(self.old, self.new)


def planted_faults() -> list[Planted]:
    """Return the faults of `planted.yaml`."""
    return [Planted(**{**one, "tests": tuple(one["tests"])}) for one in _yaml("planted.yaml")]


def equivalents() -> set[tuple[str, str, str]]:
    """Return file, text and new text of mutations that are known to change nothing; "" where none of a line does."""
    return {(one["file"], one["old"].strip(), one.get("new", "").strip()) for one in _yaml("equivalent.yaml")}


def _yaml(name: str) -> list[dict[str, Any]]:
    loaded = YAML(typ="safe").load((HERE / name).read_text(encoding="utf-8"))
    return loaded or []


def chosen(root: Path, count: int, seed: int, rooms: Sequence[str]) -> tuple[list[Mutation], dict[str, int]]:
    """Return mutations of all rooms, by the root of the number of places a room has, and how many were left out.

    A mutation's turn depends on itself and the seed alone, so that most of a choice stays when code changes.
    """
    by_room: dict[str, list[Mutation]] = {}
    for path in sorted((root / "replay").rglob("*.py")):
        file = str(path.relative_to(root))
        for mutation in mutations_of(file, path.read_text(encoding="utf-8")):
            by_room.setdefault(mutation.room, []).append(mutation)
    weights = {room: math.sqrt(len(all_of_it)) for room, all_of_it in by_room.items()}
    known = equivalents()
    result: list[Mutation] = []
    left_out: dict[str, int] = {}
    for room, all_of_it in by_room.items():
        if rooms and room not in rooms:
            continue
        wanted = max(1, round(count * weights[room] / sum(weights.values())))
        lines: set[tuple[str, int]] = set()
        for mutation in sorted(all_of_it, key=lambda m: hashlib.sha256(f"{seed} {m.id}".encode()).digest()):
            if len(lines) == wanted:
                break
            if (mutation.file, mutation.line) in lines:
                continue
            old, new = mutation.old.strip(), mutation.new.strip()
            if not known.isdisjoint({(mutation.file, old, new), (mutation.file, old, "")}):
                left_out[room] = left_out.get(room, 0) + 1
            elif is_python(mutation.applied_to((root / mutation.file).read_text(encoding="utf-8"))):
                lines.add((mutation.file, mutation.line))
                result.append(mutation)
    return result, left_out


def standing_at(root: Path, places: Sequence[str]) -> list[Mutation]:
    """Return all mutations of lines, given as "replay/room/module.py:12"."""
    result: list[Mutation] = []
    for file, _, line in (place.rpartition(":") for place in places):
        source = (root / file).read_text(encoding="utf-8")
        result += [m for m in mutations_of(file, source) if m.line == int(line) and is_python(m.applied_to(source))]
    return result


def try_mutation(mutation: Mutation, tree: Tree, reach: Reach, plain: Plain, budget: float) -> tuple[Outcome, str]:
    """Return what became of a mutation and how its kernels were run.

    Kernels are tried as plain Python first, by the tests that are quick so, because compiling takes longer than most of
    them; what survives that meets compiled ones.
    """
    text = mutation.applied_to((tree.root / mutation.file).read_text(encoding="utf-8"))
    known = reach.tests(mutation)
    spent = 0.0
    if in_kernels := has_kernels(tree.root / mutation.file):
        outcome = plain.trial(mutation, text, list(known)[:MOST], budget)
        spent += outcome.seconds
        if outcome.verdict == "failed":
            return Outcome(outcome.verdict, spent, {}, outcome.text), "plain"
        known = dict(sorted(known.items(), key=lambda item: item[0] in outcome.by_test))
    tests = _within(known, budget)
    if not tests:
        return Outcome("passed", spent, {}, "no test is about it"), "compiled"
    limit = 30.0 + 3.0 * sum(known[test] for test in tests) + (COMPILING if in_kernels else 0.0)
    with tree.with_fault(mutation.file, text):
        outcome = tree.run(tests, limit, compiled=True)
    return Outcome(outcome.verdict, spent + outcome.seconds, {}, outcome.text), "compiled"


def _within(known: dict[str, float], budget: float) -> list[str]:
    """Return the first tests that take a time together; one at least."""
    chosen: list[str] = []
    for test, seconds in list(known.items())[:MOST]:
        if not chosen or seconds <= budget:
            chosen.append(test)
            budget -= seconds
    return chosen


class Plain:
    """Trials with kernels as plain Python; which tests pass so without a fault is kept in a file."""

    def __init__(self, tree: Tree, file: Path) -> None:
        self._tree = tree
        self._file = file
        self._sound: dict[str, bool] = json.loads(file.read_text()) if file.exists() else {}

    def trial(self, mutation: Mutation, text: str, tests: list[str], budget: float) -> Outcome:
        """Ask tests; one that fails and is not sound is not asked again."""
        while tests := [test for test in tests if self._sound.get(test, True)]:
            with self._tree.with_fault(mutation.file, text):
                outcome = self._tree.run(tests, 2.0 * budget, compiled=False, each=EACH)
            if outcome.verdict != "failed" or "::" not in outcome.failed_test or self._passes(outcome.failed_test):
                return outcome
        return Outcome("passed", 0.0, {}, "no test is about it")

    def _passes(self, test: str) -> bool:
        if test not in self._sound:
            outcome = self._tree.run([test], 120.0, compiled=False, faultless=True)
            self._sound[test] = outcome.verdict == "passed"
            self._file.write_text(json.dumps(self._sound, indent=1))
        return self._sound[test]


def run_mutants(tree: Tree, work: Path, options: argparse.Namespace) -> bool:
    """Try the chosen mutations, tell the survivors and the figure by room; return whether enough are noticed."""
    mutations, left_out = standing_at(tree.root, options.place), {}
    if not options.place:
        mutations, left_out = chosen(tree.root, options.count, options.seed, options.room)
    reach = Reach(tree, Targets(tree.root), work / "reach")
    plain = Plain(tree, work / "plain.json")
    results = _results(work / "results.jsonl", again=options.again)
    # rooms take turns, those first that need no compiler
    todo = sorted((m for m in mutations if m.id not in results), key=lambda m: (m.kernel, m.id))
    _say(f"{len(mutations)} mutants, {len(todo)} to be tried")
    for number, mutation in enumerate(todo, 1):
        outcome, how = try_mutation(mutation, tree, reach, plain, options.budget)
        result = {
            "id": mutation.id,
            "place": f"{mutation.file}:{mutation.line}",
            "function": mutation.function,
            "kernel": mutation.kernel,
            "kind": mutation.kind,
            "old": mutation.old.strip(),
            "new": mutation.new.strip(),
            "verdict": outcome.verdict,
            "kernels": how,
            "by": outcome.failed_test,
            "seconds": round(outcome.seconds, 1),
        }
        results[mutation.id] = result
        with (work / "results.jsonl").open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(result) + "\n")
        _say(f"{number}/{len(todo)} {result['place']} {outcome.verdict} {result['by']}")
    return _report([(mutation, results[mutation.id]) for mutation in mutations], left_out)


def _results(file: Path, *, again: bool) -> dict[str, dict[str, Any]]:
    """Return earlier results by id; with `again` only those that tests noticed."""
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    found = {result["id"]: result for result in map(json.loads, lines)}
    return {number: result for number, result in found.items() if not again or result["verdict"] != "passed"}


def _report(tried: list[tuple[Mutation, dict[str, Any]]], left_out: dict[str, int]) -> bool:
    for _, result in tried:
        if result["verdict"] == "passed":
            _say(f"\nsurvived: {result['place']} in {result['function'] or 'the module'} ({result['kind']})")
            _say(f"  - {result['old']}\n  + {result['new']}")
    rows = sorted({mutation.room for mutation, _ in tried})
    print(f"{'room':14}{'mutants':>9}{'noticed':>9}{'share':>8}{'equivalent, left out':>22}")
    for name in [*rows, "(kernels)", "all"]:
        of_it = [
            result["verdict"] != "passed"
            for mutation, result in tried
            if name in (mutation.room, "all") or (name == "(kernels)" and mutation.kernel)
        ]
        if of_it:
            less = sum(left_out.values()) if name == "all" else left_out.get(name, 0)
            print(f"{name:14}{len(of_it):9}{sum(of_it):9}{sum(of_it) / len(of_it):8.1%}{less:22}")
    return sum(result["verdict"] != "passed" for _, result in tried) >= WANTED * len(tried)


def run_planted(tree: Tree, names: Sequence[str]) -> bool:
    """Plant each fault of `planted.yaml`; return whether each is noticed by a test that is named for it."""
    faults = [fault for fault in planted_faults() if not names or fault.name in names]
    tests = dict.fromkeys(test for fault in faults for test in fault.tests)
    outcome = tree.run(list(tests), 3000.0, compiled=True, faultless=True)
    missing = [test for test in tests if not any(one.startswith(test) for one in outcome.by_test)]
    if outcome.verdict != "passed" or missing:
        _say(f"the tests fail without a fault, or are not there: {missing}\n{outcome.text}")
        return False
    good = True
    for fault in faults:
        text = fault.applied_to((tree.root / fault.file).read_text(encoding="utf-8"))
        with tree.with_fault(fault.file, text):
            outcome = tree.run(fault.tests, 300.0, compiled=True)
        noticed = outcome.verdict != "passed"
        print(f"{'noticed' if noticed else 'SURVIVED'}  {fault.name}  {outcome.failed_test}", flush=True)
        good = good and noticed
    return good


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def main() -> int:
    """Run what the command line asks for; 0 when the tests notice enough."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=330, help="mutants over all rooms")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--room", action="append", default=[], help="only this room's share; may be repeated")
    parser.add_argument(
        "--place", action="append", default=[], metavar="FILE:LINE", help="all mutants of a line instead"
    )
    parser.add_argument("--budget", type=float, default=40.0, help="seconds of tests that are asked about one mutant")
    parser.add_argument("--again", action="store_true", help="try survivors of an earlier run again")
    parser.add_argument("--planted", nargs="*", metavar="NAME", help="the faults of planted.yaml instead, or some")
    parser.add_argument("--work", type=Path, default=CHECKOUT / "recordings" / "mutants")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    preload()
    tree = Tree(CHECKOUT, options.work.resolve())
    good = (
        run_planted(tree, options.planted) if options.planted is not None else run_mutants(tree, options.work, options)
    )
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
