"""Writes what of the clients follows from the contract: `api/openapi.json` in, types and one method per operation out.

    python3 api/clients/generate.py            writes the files
    python3 api/clients/generate.py --check    exit code 1 and a word for each file that is out of date

Only the standard library is used. What does not follow from the contract (connections, problems, events, resumed
downloads) is written by hand beside it: `transport.py` and `transport.js`.
"""
import json
import keyword
import re
import sys
import textwrap
from pathlib import Path

# Types that fit are written on one line of so many characters.
LINE = 121
HERE = Path(__file__).resolve().parent
CONTRACT = HERE.parent / "openapi.json"
NOTE = "Generated from api/openapi.json by api/clients/generate.py: do not edit."
#: What the parts by hand have already.
TAKEN = {"address", "ask", "fetch", "key", "output", "timeout", "upload", "wait"}
METHODS = ("get", "post", "put", "patch", "delete")
JSON_TYPE = re.compile(r"^application/(json|.*\+json)(;.*)?$")


def snake(name):
    """A name with underscores."""
    return re.sub(r"\W+", "_", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name)).lower()


def camel(name):
    """A name with humps."""
    first, *others = snake(name).split("_")
    return first + "".join(word.capitalize() for word in others)


def words(text):
    """The words of a description on one line."""
    return " ".join((text or "").split())


class Operation:
    """What a method needs to know of an operation."""

    def __init__(self, path, verb, item):
        self.path, self.verb, self.name = path, verb.upper(), item["operationId"]
        self.summary = words(item.get("summary"))
        self.about = words(item.get("description"))
        parameters = item.get("parameters", [])
        self.path_names = [p["name"] for p in parameters if p["in"] == "path"]
        self.options = [p for p in parameters if p["in"] in ("query", "header")]
        self.body = self.body_of(item)
        self.answer, self.accepts = self.answer_of(item)

    @staticmethod
    def body_of(item):
        """`None`, or the schema of a JSON body and whether other bytes are taken too."""
        content = item.get("requestBody", {}).get("content")
        if content is None:
            return None
        schemas = [value.get("schema", {}) for name, value in content.items() if JSON_TYPE.match(name)]
        return schemas[0] if schemas else {}, any(not JSON_TYPE.match(name) for name in content)

    @staticmethod
    def answer_of(item):
        """`json` with its schema, `events`, `bytes` or `nothing`; and what to accept."""
        good = [value for status, value in item["responses"].items() if status.startswith("2")]
        content = {name: value for response in good for name, value in response.get("content", {}).items()}
        # Of several files a caller without a wish gets the one that the service puts first, not the first of this list.
        files = "application/octet-stream" in content
        accepts = ", ".join([*(["application/octet-stream"] if files else content), "application/problem+json"])
        if not content:
            return ("nothing", None), accepts
        if "text/event-stream" in content:
            return ("events", None), accepts
        schemas = [value.get("schema", {}) for name, value in content.items() if JSON_TYPE.match(name)]
        if len(schemas) == len(content):
            return ("json", schemas[0]), accepts
        return ("bytes", None), accepts


class Language:
    """How types are said."""

    def say(self, schema):
        """The type of a schema; what a language cannot say is left open."""
        if "$ref" in schema:
            return schema["$ref"].rsplit("/", 1)[-1]
        if "const" in schema:
            return self.literal([schema["const"]])
        if "enum" in schema:
            return self.literal(schema["enum"])
        for choice in ("oneOf", "anyOf"):
            if choice in schema and "properties" not in schema:
                return self.union([self.say(part) for part in schema[choice]])
        if "allOf" in schema and len(schema["allOf"]) == 1 and "properties" not in schema:
            return self.say(schema["allOf"][0])
        kinds = schema.get("type")
        if isinstance(kinds, list):
            return self.union([self.say({**schema, "type": kind}) for kind in kinds])
        if kinds == "array":
            return self.array(self.say(schema.get("items") or {}))
        if kinds == "object" and isinstance(schema.get("additionalProperties"), dict):
            return self.mapping(self.say(schema["additionalProperties"]))
        return self.plain.get(kinds, self.anything)

    def union(self, types):
        """One of several types."""
        return " | ".join(dict.fromkeys(types))


class Python(Language):
    """The types of Python."""

    anything = "Any"
    plain = {"string": "str", "number": "float", "integer": "int", "boolean": "bool", "null": "None"}
    array = staticmethod("list[{}]".format)
    mapping = staticmethod("dict[str, {}]".format)

    @staticmethod
    def literal(values):
        return f"Literal[{', '.join(repr(value) for value in values)}]"


class TypeScript(Language):
    """The types of TypeScript."""

    anything = "unknown"
    plain = {"string": "string", "number": "number", "integer": "number", "boolean": "boolean", "null": "null"}
    array = staticmethod("Array<{}>".format)
    mapping = staticmethod("Record<string, {}>".format)

    @staticmethod
    def literal(values):
        return " | ".join(json.dumps(value) for value in values)


def members(schema):
    """The members of an object, or nothing where it has none; which of them exclude each other is for the service to say."""
    return (schema["properties"], set(schema.get("required", []))) if schema.get("properties") else None


def comment(text, indent=""):
    """A comment of JSDoc."""
    lines = textwrap.wrap(words(text).replace("*/", "* /"), 110)
    if not lines:
        return ""
    if len(lines) == 1:
        return f"{indent}/** {lines[0]} */\n"
    return f"{indent}/**\n" + "".join(f"{indent} * {line}\n" for line in lines) + f"{indent} */\n"


def python_types(schemas):
    """Every schema as a type of Python."""
    said = Python()
    for name, schema in schemas.items():
        found = members(schema)
        if found is None:
            kind = said.say(schema)
            # A name that comes later can only be quoted.
            later = any(re.search(rf"\b{other}\b", kind) for other in schemas)
            yield f"{name}: TypeAlias = {repr(kind) if later else kind}\n"
            continue
        fields = []
        for member, value in found[0].items():
            kind = said.say(value)
            kind = kind if member in found[1] else f"NotRequired[{kind}]"
            fields.append(f"{member!r}: {kind!r}")
        line = f"{name} = TypedDict({name!r}, {{{', '.join(fields)}}})\n"
        listed = "".join(f"    {field},\n" for field in fields)
        yield line if len(line) <= LINE else f"{name} = TypedDict({name!r}, {{\n{listed}}})\n"


def python_method(operation):
    """A method of Python."""
    said = Python()
    names = [snake(name) for name in operation.path_names]
    arguments = ["self", *(f"{name}: str" for name in names)]
    if operation.body is not None:
        schema, also_bytes = operation.body
        kind = said.say(schema)
        arguments.append(f"body: {kind} | bytes | BinaryIO" if also_bytes else f"body: {kind}")
    options = [(snake(p["name"]), p) for p in operation.options]
    options = [(f"{name}_" if keyword.iskeyword(name) or name in names else name, p) for name, p in options]
    if operation.body is not None and operation.body[1]:
        options.append(("content_type", None))
    if options:
        arguments.append("*")
        arguments += [f"{name}: {said.union([said.say(p['schema']) if p else 'str', 'None'])} = None" for name, p in options]
    kind, schema = operation.answer
    result = {"json": said.say(schema or {}), "events": "Iterator[Event]", "bytes": "Answer", "nothing": "None"}[kind]
    path = re.sub(r"\{(\w+)\}", lambda match: "{quote(" + snake(match[1]) + ", safe='')}", operation.path)
    call = [f"{operation.verb!r}", f"f{path!r}" if names else repr(path)]
    for place in ("query", "header"):
        chosen = ", ".join(f"{p['name']!r}: {name}" for name, p in options if p and p["in"] == place)
        if chosen:
            call.append(f"{place}={{{chosen}}}")
    if operation.body is not None:
        call.append("body=body")
        if operation.body[1]:
            call.append("content_type=content_type")
    call.append(f"accept={operation.accepts!r}")
    about = [f'        """{operation.summary}\n']
    about += [f"\n{textwrap.fill(operation.about, 112, initial_indent=' ' * 8, subsequent_indent=' ' * 8)}\n"] if operation.about else []
    about.append('        """\n')
    doc = "".join(about) if len(about) > 2 else f'        """{operation.summary}"""\n'
    send = {"json": "return self._json", "events": "return self._events", "bytes": "return self._bytes", "nothing": "self._nothing"}[kind]
    return f"\n    def {operation.name}({', '.join(arguments)}) -> {result}:\n{doc}        {send}({', '.join(call)})\n"


def python(contract, operations):
    """The modules of Python: types, and what uses them."""
    schemas = contract["components"]["schemas"]
    types = f'''"""The types of lacuna\'s contract {contract["info"]["version"]}.

{NOTE}
"""
from typing import Any, Literal, NotRequired, TypeAlias, TypedDict

''' + "\n".join(python_types(schemas))
    methods = "".join(python_method(operation) for operation in operations)
    used = sorted(name for name in schemas if re.search(rf"\b{name}\b", re.sub(r'""".*?"""', "", methods, flags=re.DOTALL)))
    return types, f'''"""The operations of lacuna\'s contract {contract["info"]["version"]}: one method for each.

{NOTE}
"""
from __future__ import annotations

from collections.abc import Iterator
from typing import Any, BinaryIO, Literal
from urllib.parse import quote

from .transport import Answer, Event, Transport
from .types import {", ".join(used)}


class Api(Transport):
    """One method for each operation. What the service refuses is raised as a `Problem`."""
{methods}'''


def options_type(operation, said):
    """The options of a method of TypeScript."""
    fields = [f"{camel(p['name'])}?: {said.union([said.say(p['schema'])])}" for p in operation.options]
    if operation.body is not None and operation.body[1]:
        fields.append("contentType?: string")
    return "; ".join([*fields, "signal?: AbortSignal"])


def typescript(contract, operations):
    """Types, the declarations that use them, and what runs."""
    said = TypeScript()
    types, methods, code = [], [], []
    for name, schema in contract["components"]["schemas"].items():
        found = members(schema)
        about = comment(schema.get("description"))
        if found is None:
            types.append(f"{about}export type {name} = {said.say(schema)};\n")
            continue
        fields = []
        for member, value in found[0].items():
            key = member if member.isidentifier() else json.dumps(member)
            note = words(value.get("description")).replace("*/", "* /")
            note = f"/** {note} */ " if note else ""
            fields.append(f"  {note}{key}{'' if member in found[1] else '?'}: {said.say(value)};\n")
        types.append(f"{about}export interface {name} {{\n{''.join(fields)}}}\n")
    for operation in operations:
        names = [camel(name) for name in operation.path_names]
        kind, schema = operation.answer
        result = {"json": said.say(schema or {}), "events": "", "bytes": "Response", "nothing": "void"}[kind]
        result = "AsyncGenerator<ServerEvent>" if kind == "events" else f"Promise<{result}>"
        arguments = [f"{name}: string" for name in names]
        if operation.body is not None:
            arguments.append(f"body: {said.say(operation.body[0])}{' | BodyInit' if operation.body[1] else ''}")
        arguments.append(f"options?: {{ {options_type(operation, said)} }}")
        about = comment(f"{operation.summary} {operation.about}", "  ")
        methods.append(f"{about}  {camel(operation.name)}({', '.join(arguments)}): {result};\n")
        path = re.sub(r"\{(\w+)\}", lambda match: "${encodeURIComponent(" + camel(match[1]) + ")}", operation.path)
        call = [f'"{operation.verb}"', f"`{path}`" if names else f'"{path}"']
        extra = []
        for place in ("query", "header"):
            chosen = ", ".join(f'"{p["name"]}": options.{camel(p["name"])}' for p in operation.options if p["in"] == place)
            if chosen:
                extra.append(f"{place}: {{ {chosen} }}")
        if operation.body is not None:
            extra.append("body")
            if operation.body[1]:
                extra.append("contentType: options.contentType")
        extra += [f'accept: "{operation.accepts}"', "signal: options.signal"]
        given = [*names, *(["body"] if operation.body is not None else []), "options = {}"]
        call.append("{ " + ", ".join(extra) + " }")
        code.append(f"\n  {camel(operation.name)}({', '.join(given)}) {{\n    return this._{kind}({', '.join(call)});\n  }}\n")
    declared = f"// {NOTE}\n\n" + "\n".join(types)
    used = sorted(name for name in contract["components"]["schemas"] if re.search(rf"\b{name}\b", re.sub(r"/\*\*.*?\*/", "", "".join(methods), flags=re.DOTALL)))
    declarations = f'''// {NOTE}
import {{ ServerEvent, Transport }} from "./transport.js";
import {{ {", ".join(used)} }} from "./types.js";

export * from "./types.js";

/** One method for each operation. What the service refuses is thrown as a `ProblemError`. */
export class Api extends Transport {{
{"".join(methods)}}}
'''
    runs = f'''// {NOTE}
import {{ Transport }} from "./transport.js";

/** One method for each operation. What the service refuses is thrown as a `ProblemError`. */
export class Api extends Transport {{{"".join(code)}}}
'''
    return declared, declarations, runs


def main():
    """Writes or compares the files."""
    contract = json.loads(CONTRACT.read_text())
    items = [(path, verb, item) for path, each in contract["paths"].items() for verb, item in each.items() if verb in METHODS]
    operations = [Operation(*item) for item in items]
    names = [operation.name for operation in operations]
    if len(set(names)) < len(names):
        sys.exit(f"operations share names: {sorted(name for name in set(names) if names.count(name) > 1)}")
    if taken := TAKEN.intersection(snake(name) for name in names):
        sys.exit(f"operations are called as members of the clients: {sorted(taken)}; give them another operation_id")
    types, methods = python(contract, operations)
    declared, declarations, runs = typescript(contract, operations)
    files = {
        HERE / "python/lacuna_client/types.py": types,
        HERE / "python/lacuna_client/api.py": methods,
        HERE / "typescript/types.d.ts": declared,
        HERE / "typescript/api.d.ts": declarations,
        HERE / "typescript/api.js": runs,
    }
    stale = [path for path, text in files.items() if not path.exists() or path.read_text() != text]
    for path in stale:
        if "--check" in sys.argv[1:]:
            print(f"{path.relative_to(HERE.parent.parent)} is out of date: run python3 api/clients/generate.py")
        else:
            path.write_text(files[path])
            print(f"wrote {path.relative_to(HERE.parent.parent)}")
    sys.exit(bool(stale) and "--check" in sys.argv[1:])


if __name__ == "__main__":
    main()
