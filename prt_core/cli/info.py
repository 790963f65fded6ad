"""`prt info`: what a bake holds."""

import json

from prt_core.bake import load
from prt_core.report import compressed_lines, object_lines, report_lines
from prt_core.store import BakeStore, compressed_facts


def add_info(commands):
    """Add `info` to the commands."""
    info = commands.add_parser("info", help="what a bake holds")
    info.add_argument("bake", help="NAME.prt")
    info.add_argument("--json", action="store_true")
    info.set_defaults(run=_info)


def _info(options):
    store = BakeStore(options.bake)
    facts, compressed = store.facts, compressed_facts(store)
    report = facts.get("report") or {}
    if options.json:
        keys = ("complete", "version", "settings", "objects", "lamps", "camera", "report")
        found = {key: facts.get(key) for key in keys}
        hidden = ("folder", "values", "arrays")
        found["compressed"] = compressed and {
            key: value for key, value in compressed.items() if key not in hidden
        }
        print(json.dumps({**found, **report, "bytes": store.nbytes()}))
        return 0
    if not facts.get("complete"):
        print(f"{options.bake}: not finished; the same 'prt bake' goes on with it")
        return 0
    print(*report_lines(options.bake, report), sep="\n")
    settings = ", ".join(f"{key} {value}" for key, value in facts["settings"].items())
    print(f"  made    by prt {report['versions']['prt_core']} with {settings}")
    print(*object_lines(facts["objects"]), sep="\n")
    for lamp in facts["lamps"]:
        print(f"  lamp    {lamp['name']}: {lamp['kind']}")
    if compressed:
        _print_compressed(options.bake, compressed)
    return 0


def _print_compressed(path, facts):
    fresh = load(path).transport.fingerprint() == facts["fingerprint"]
    print("compressed:" if fresh else "compressed (stale: the bake has changed, compress again):")
    print(*compressed_lines(facts), sep="\n")
