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
from tests.mutants.targets import Targets
from tests.mutants.trial import Outcome, Tree, preload

HERE = Path(__file__).parent
CHECKOUT = HERE.parents[1]
GUESS = 5.0  # seconds that a test file takes of which nothing is known yet
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


class Experience:
    """What earlier trials have told of the tests, kept in a file: how long each file takes, and which tests are sound.

    A test is sound when it passes without a fault: only then does its failing say anything.
    """

    def __init__(self, tree: Tree, targets: Targets, file: Path) -> None:
        self._tree = tree
        self._file = file
        self._tests = targets.tests
        known = json.loads(file.read_text()) if file.exists() else {}
        self._seconds: dict[str, dict[str, float]] = known.get("seconds", {"compiled": {}, "plain": {}})
        self._sound: dict[str, bool] = known.get("sound", {})

    def seconds(self, how: str) -> dict[str, float]:
        """Return the seconds of the test files that can be asked, with compiled or with plain kernels."""
        known = self._seconds[how]
        return {test: known.get(test, GUESS) for test in self._tests if known.get(test, GUESS) < math.inf}

    def learn(self, outcome: Outcome, how: str) -> None:
        """Take the times of a trial that passed."""
        self._seconds[how].update(outcome.by_file)
        self._keep()

    def is_sound(self, tests: Sequence[str], limit: float, how: str) -> bool:
        """Return whether tests pass without a fault within a limit; a file of those that do not is not asked again."""
        key = f"{how} {limit:.0f} {' '.join(tests)}" if len(tests) > 1 else f"{how} {tests[0]}"
        if key not in self._sound:
            outcome = self._tree.run(tests, limit, compiled=how == "compiled", faultless=True)
            self._sound[key] = outcome.verdict == "passed"
            if outcome.verdict == "passed" and len(tests) > 1:
                self.learn(outcome, how)
            elif outcome.verdict != "passed":
                _say(f"not asked ({how} kernels), {outcome.verdict} without a fault: {outcome.failed_test or tests}")
                worst = (outcome.failed_test or max(tests, key=self.seconds(how).__getitem__)).partition("::")[0]
                self._seconds[how][worst] = math.inf
            self._keep()
        return self._sound[key]

    def _keep(self) -> None:
        self._file.write_text(json.dumps({"seconds": self._seconds, "sound": self._sound}, indent=1))


def try_mutation(
    mutation: Mutation, tree: Tree, targets: Targets, experience: Experience, options: argparse.Namespace
) -> tuple[Outcome, str]:
    """Return what became of a mutation and how its kernels were run.

    Kernels are tried as plain Python first, by the tests that are quick so, because compiling takes longer than most of
    them; what survives that meets compiled ones.
    """
    text = mutation.applied_to((tree.root / mutation.file).read_text(encoding="utf-8"))
    ways = ["plain", "compiled"] if has_kernels(tree.root / mutation.file) else ["compiled"]
    ways = ways[:1] if options.plain else ways
    spent = 0.0
    for how in ways:
        while True:
            seconds = experience.seconds(how)
            tests = targets.of(mutation.file, seconds, options.budget)
            if how == "plain":
                tests = [test for test in tests if seconds[test] <= options.budget]
            if not tests:
                outcome = Outcome("passed", 0.0, {}, "no test is about it")
                break
            limit = 30.0 + 3.0 * sum(seconds[test] for test in tests)
            limit += 120.0 if ways == ["plain", "compiled"] and how == "compiled" else 0.0  # to compile what calls it
            with tree.with_fault(mutation.file, text):
                outcome = tree.run(tests, limit, compiled=how == "compiled")
            spent += outcome.seconds
            if outcome.verdict == "passed":
                experience.learn(outcome, how)
                break
            suspects = [outcome.failed_test] if "::" in outcome.failed_test else tests
            if experience.is_sound(suspects, limit, how):
                return Outcome(outcome.verdict, spent, {}, outcome.text), how
    return Outcome(outcome.verdict, spent, {}, outcome.text), how


def run_mutants(tree: Tree, work: Path, options: argparse.Namespace) -> bool:
    """Try the chosen mutations, tell the survivors and the figure by room; return whether enough are noticed."""
    mutations, left_out = chosen(tree.root, options.count, options.seed, options.room)
    targets = Targets(tree.root)
    experience = Experience(tree, targets, work / "experience.json")
    results = _results(work / "results.jsonl", again=options.again)
    todo = sorted((m for m in mutations if m.id not in results), key=lambda m: m.id)  # so that rooms take turns
    _say(f"{len(mutations)} mutants, {len(todo)} to be tried")
    for number, mutation in enumerate(todo, 1):
        outcome, how = try_mutation(mutation, tree, targets, experience, options)
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
    if outcome.verdict != "passed":
        _say(f"the tests fail without a fault:\n{outcome.text}")
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
    parser.add_argument("--budget", type=float, default=40.0, help="seconds of tests that are asked about one mutant")
    parser.add_argument("--plain", action="store_true", help="kernels as plain Python alone: quick, and more survive")
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
