"""The JSON Schemas that docs/schemas publishes of what the commands print."""

import json
from pathlib import Path

from jsonschema import Draft202012Validator

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "schemas"


def published():
    """Every schema by the name that an output gives under the key schema."""
    schemas = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(FOLDER.glob("*.json"))]
    return {schema["title"]: schema for schema in schemas}


def violations(output):
    """What of an output its published schema does not allow; empty where it fits."""
    schema = published()[output["schema"]]
    return [f"{error.json_path}: {error.message}" for error in Draft202012Validator(schema).iter_errors(output)]
