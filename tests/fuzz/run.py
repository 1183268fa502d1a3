"""Many executions over all doors: `python -m tests.fuzz.run COUNT SEED`; what breaks is written beside the count."""

from __future__ import annotations

import random
import resource
import shutil
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path

from tests.fuzz import guard
from tests.fuzz.door import knock
from tests.fuzz.doors import House

CORPUS = Path(__file__).parent / "corpus"


def soak(count: int, seed: int, *, only: str = "", keep: Path | None = None) -> tuple[Counter[str], list[str]]:
    """Return what became of `count` inputs, and what broke; with `keep`, files of that are put there."""
    told: Counter[str] = Counter()
    broken: list[str] = []
    kinds: set[str] = set()
    guard.install()
    with tempfile.TemporaryDirectory() as made, tempfile.TemporaryDirectory() as place:
        house = House(Path(made))
        names = [name for name in house.doors if only in name]
        weights = [house.doors[name].weight for name in names]
        for number in range(count):
            rng = random.Random(f"{seed} {number}")
            name = rng.choices(names, weights)[0]
            door = house.doors[name]
            files = door.make(rng)
            folder = Path(place) / "in"
            folder.mkdir()
            begin = time.process_time()
            try:
                with guard.watched():
                    told[f"{name}: {knock(door, folder, files)}"] += 1
            except KeyboardInterrupt:
                raise
            except BaseException as error:
                last = traceback.extract_tb(error.__traceback__)[-1]
                what = (
                    f"{name}: {type(error).__name__} at {Path(last.filename).name}:{last.lineno}: {str(error)[-300:]}"
                )
                kind = f"{name} {type(error).__name__} {last.filename} {last.lineno} {str(error)[-60:-20]}"
                told[f"{name}: broken"] += 1
                if kind not in kinds:
                    kinds.add(kind)
                    broken.append(f"{seed} {number} {what}")
                    print(broken[-1], flush=True)
                    for file, data in files.items() if keep is not None else ():
                        target = keep / name.replace(" ", "_") / f"{seed}-{number}" / file
                        target.parent.mkdir(parents=True, exist_ok=True)
                        target.write_bytes(data)
            took = time.process_time() - begin
            if took > 3.0:
                print(f"{seed} {number} {name}: {took:.1f} s", flush=True)
            told["s " + name] += int(took * 1e6)
            shutil.rmtree(folder)
    return told, broken


if __name__ == "__main__":
    begin = time.monotonic()
    only = sys.argv[3] if len(sys.argv) > 3 else ""
    told, broken = soak(int(sys.argv[1]), int(sys.argv[2]), only=only, keep=Path(tempfile.gettempdir()) / "broken")
    for name, number in sorted(told.items()):
        print(f"{number:>12}  {name}")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{sys.argv[1]} executions in {time.monotonic() - begin:.0f} s, {len(broken)} kinds broken, {peak:.0f} MiB")
    sys.exit(bool(broken))
