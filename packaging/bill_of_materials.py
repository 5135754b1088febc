"""Lists the crates of the released program: a CycloneDX bill of materials and the texts of their licences.

    cargo metadata … | python3 bill_of_materials.py SBOM.json LICENSES.txt

The time of the list is SOURCE_DATE_EPOCH, so that the same commit gives the same files.
"""

import datetime
import json
import os
import pathlib
import sys


def shipped(metadata: dict) -> list[dict]:
    """Returns the packages that the program and the library for C are linked from, by name and version."""
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    names = {"resight-cli", "resight-c", "resight-python"}
    waiting = [package["id"] for package in metadata["packages"] if package["name"] in names]
    found = set()
    while waiting:
        key = waiting.pop()
        if key not in found:
            found.add(key)
            waiting += [
                needed["pkg"]
                for needed in nodes[key]["deps"]
                if any(kind["kind"] is None for kind in needed["dep_kinds"])
            ]
    packages = [package for package in metadata["packages"] if package["id"] in found]
    return sorted(packages, key=lambda package: (package["name"], package["version"]))


def component(package: dict) -> dict:
    """Returns a package as a component of CycloneDX 1.5."""
    return {
        "type": "library",
        "name": package["name"],
        "version": package["version"],
        "licenses": [{"expression": package["license"].replace("/", " OR ")}],
        "purl": f"pkg:cargo/{package['name']}@{package['version']}",
    }


def licence_texts(package: dict) -> list[str]:
    """Returns the texts that a package brings, or none where it only names its licence."""
    folder = pathlib.Path(package["manifest_path"]).parent
    files = [file for file in sorted(folder.iterdir()) if file.is_file()]
    files = [file for file in files if file.name.upper().startswith(("LICENSE", "LICENCE", "COPYING", "NOTICE", "UNLICENSE"))]
    return [file.read_text(encoding="utf-8", errors="replace").strip() for file in files]


def main() -> None:
    metadata = json.load(sys.stdin)
    packages = shipped(metadata)
    program = next(package for package in packages if package["name"] == "resight-cli")
    time = datetime.datetime.fromtimestamp(int(os.environ["SOURCE_DATE_EPOCH"]), datetime.timezone.utc)
    bill = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {
            "timestamp": time.strftime("%Y-%m-%dT%H:%M:%SZ"),
            "component": {"type": "application", "name": "resight", "version": program["version"]},
        },
        "components": [component(package) for package in packages if package["source"]],
    }
    pathlib.Path(sys.argv[1]).write_text(json.dumps(bill, indent=1) + "\n", encoding="utf-8")
    text = ["Crates that the program and the libraries are linked from, with their licences.\n"]
    said: dict[str, str] = {}  # The same text is printed once.
    for package in packages:
        if package["source"]:
            name = f"{package['name']} {package['version']}"
            text.append(f"\n{'=' * 100}\n{name}: {package['license']}\n")
            for licence in licence_texts(package):
                text.append(f"As of {said[licence]}.\n" if licence in said else f"\n{licence}\n")
                said.setdefault(licence, name)
    pathlib.Path(sys.argv[2]).write_text("".join(text), encoding="utf-8")


main()
