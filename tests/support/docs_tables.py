"""The parts of the documentation that are written from the code: options, configuration keys, result keys, public
names, rooms, arrows.

Each function in `TABLES` gives the text between `<!-- generated: NAME -->` and `<!-- end -->` on a page.
"""

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

import click

import cylx
from cylx.cli import main
from cylx.config import Config, load_config
from cylx.config.yaml_writer import _allowed, _scalar
from cylx.deviation.document import deviation_schema
from cylx.results import rejections_schema, result_schema
from cylx.results.stems import stems_schema
from tests.support.arrows import MAY_IMPORT

PACKAGE = Path(__file__).resolve().parents[2] / "cylx"
UNITS = {
    "scene units": "scene units",
    "degrees": "degrees",
    "in radii": "radii",
    "in spacings": "spacings",
    "in noises": "noises",
}


def table(header, rows):
    """Write a Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", r"\|") for cell in line) + " |" for line in lines)


# --- the configuration


def config_sections():
    """Give (name, sentence, entries by key) of the top level, named '', and of every section."""
    schema = Config.model_json_schema()
    sections = {key: entry["$ref"].rpartition("/")[2] for key, entry in schema["properties"].items() if "$ref" in entry}
    top = {key: entry for key, entry in schema["properties"].items() if key not in sections}
    yield "", "", top
    for key, definition in sections.items():
        yield key, schema["properties"][key]["description"], schema["$defs"][definition]["properties"]


def config_keys():
    """Give every dotted key of the configuration."""
    for section, _, entries in config_sections():
        yield from (f"{section}.{key}".strip(".") for key in entries)


def unit_of(entry):
    """Name the unit that the sentence of a number speaks of."""
    numeric = {"number", "integer"} & {choice.get("type") for choice in [entry, *entry.get("anyOf", [])]}
    units = [unit for phrase, unit in UNITS.items() if phrase in entry["description"]]
    return units[0] if units and numeric and not entry["description"].startswith("Lambda") else ""


def configuration():
    """Write every key with its default, unit, range and sentence."""
    parts = []
    for section, sentence, entries in config_sections():
        rows = [
            [f"`{key}`", f"`{_scalar(entry['default'])}`", unit_of(entry), _allowed(entry), entry["description"]]
            for key, entry in entries.items()
        ]
        heading = f"### {section}\n\n{sentence}" if section else "### Top level"
        parts.append(f"{heading}\n\n" + table(["key", "default", "unit", "allowed", "meaning"], rows))
        parts += [entry_keys(key, entry) for key, entry in entries.items() if "$ref" in str(entry)]
    return "\n\n".join(parts)


def entry_keys(key, entry):
    """Write the keys of an entry of a list."""
    definition = Config.model_json_schema()["$defs"][re.search(r"#/\$defs/(\w+)", str(entry))[1]]
    rows = []
    for name, part in definition["properties"].items():
        default = f"`{_scalar(part['default'])}`" if "default" in part else "none"
        rows.append([f"`{name}`", default, unit_of(part), _allowed(part), part["description"]])
    return f"#### An entry of {key}\n\n" + table(["key", "default", "unit", "allowed", "meaning"], rows)


def dotted(values, prefix=""):
    """Flatten nested values."""
    for key, value in values.items():
        if isinstance(value, dict):
            yield from dotted(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def presets():
    """Write the keys in which the presets differ."""
    auto, paper = (dict(dotted(load_config(preset=name).model_dump(mode="json"))) for name in ("auto", "paper"))
    rows = [
        [f"`{key}`", f"`{_scalar(auto[key])}`", f"`{_scalar(paper[key])}`"] for key in auto if auto[key] != paper[key]
    ]
    return table(["key", "`auto`", "`paper`"], [row for row in rows if row[0] != "`preset`"])


# --- the command line


def commands(command=main, path="cylx") -> Iterator[tuple[str, click.Command]]:
    """Give the path and the command of everything that can be typed."""
    yield path, command
    if isinstance(command, click.Group):
        for name in command.list_commands(click.Context(command)):
            yield from commands(command.get_command(click.Context(command), name), f"{path} {name}")


def options_of(command):
    """Give the options of a command that a user sees; `--help` is told of once for all of them."""
    return [param for param in command.params if isinstance(param, click.Option) and not param.hidden]


def option_names(option):
    """Write an option as it is typed."""
    names = ", ".join(f"`{name}`" for name in [*option.opts, *option.secondary_opts])
    if option.is_flag:
        return names
    if isinstance(option.type, click.Choice):
        value = "|".join(option.type.choices)
    else:
        value = option.metavar or option.type.name.removesuffix(" range").upper()
    return f"{names[:-1]} {value}`"


def option_default(option):
    """Say what holds where an option is not given."""
    said = re.search(r"\[default: (.*)\]", option.help)
    if said:
        return said[1]
    return f"`{option.default}`" if option.show_default else ""


def command_line():
    """Write every command with its options."""
    parts = []
    for path, command in commands():
        arguments = " ".join(
            (param.metavar or param.name.upper()) if param.required else f"[{param.name.upper()}]"
            for param in command.params
            if isinstance(param, click.Argument)
        )
        what = " COMMAND" if isinstance(command, click.Group) else ""
        usage = f"{path} [OPTIONS] {arguments}".rstrip() + what
        prose = "\n\n".join(" ".join(part.split()) for part in command.help.split("\n\n"))
        rows = [
            [option_names(option), option_default(option), option.help.partition("  [default:")[0]]
            for option in options_of(command)
        ]
        parts.append(f"### {path}\n\n`{usage}`\n\n{prose}")
        if rows:
            parts.append(table(["option", "default", "what it does"], rows))
    return "\n\n".join(parts)


# --- the result


def parts_of(schema):
    """Give (title, entries by key, required keys) of a file and of every object in it, in the order they come."""
    names = [""]
    for name in names:
        part = schema["$defs"][name] if name else schema
        if "properties" not in part:  # any JSON value
            continue
        yield name, part["properties"], part.get("required", [])
        names += [inner for inner in re.findall(r"#/\$defs/(\w+)", str(part["properties"])) if inner not in names]


def type_of(entry):
    """Name the type of a value in a JSON file."""
    if "anyOf" in entry or "oneOf" in entry:
        return " or ".join(
            type_of(choice) for choice in entry.get("anyOf") or entry["oneOf"] if choice.get("type") != "null"
        )
    if "$ref" in entry:
        name = entry["$ref"].rpartition("/")[2]
        return f"[{name}](#{name.lower()})"
    if "const" in entry:
        return f'`"{entry["const"]}"`'
    if entry.get("type") == "array":
        count, inner = entry.get("minItems", ""), type_of(entry["items"])
        plural = (
            inner if inner.startswith("[") else inner.replace("list of", "lists of") if "list" in inner else f"{inner}s"
        )
        return f"list of {count} {plural}".replace("  ", " ")
    if entry.get("type") == "object":
        inner = entry.get("additionalProperties")
        return f"object of {type_of(inner)}s" if isinstance(inner, dict) and inner.get("type") else "object"
    return entry.get("type", "any")


def json_format(schema=None, known=()):
    """Write every key of the result, or of another file but for the objects that are known already."""
    parts = []
    for name, entries, required in parts_of(schema or result_schema()):
        if name in known:
            continue
        rows = [
            [
                f"`{key}`",
                type_of(entry),
                "yes" if key in required or entry.get("default") is not None else "no",
                entry["description"],
            ]
            for key, entry in entries.items()
        ]
        title = name or ("What was not accepted" if known else "The file")
        parts.append(f"### {title}\n\n" + table(["key", "type", "always there", "meaning"], rows))
    return "\n\n".join(parts)


def rejected_format():
    """Write every key of the file of what was not accepted that the result does not have."""
    return json_format(rejections_schema(), known=[name for name, _, _ in parts_of(result_schema()) if name])


def deviation_format():
    """Write every key of the file of a comparison with a design that the result does not have."""
    known = [name for name, _, _ in parts_of(result_schema()) if name]
    return json_format(deviation_schema(), known).replace("### What was not accepted", "### The comparison", 1)


def stems_format():
    """Write every key of the file of stems that the result does not have."""
    known = [name for name, _, _ in parts_of(result_schema()) if name]
    return json_format(stems_schema(), known).replace("### What was not accepted", "### The plot", 1)


# --- the Python interface


def first_paragraph(thing):
    """Give the first paragraph of a docstring on one line."""
    return " ".join(inspect.getdoc(thing).split("\n\n")[0].split())


def sections_of(thing):
    """Give the sections of a numpydoc docstring that list things: (name, type) and sentence of each, by heading."""
    parts = re.split(r"^(\w+)\n-+$", inspect.getdoc(thing), flags=re.MULTILINE)
    for heading, text in zip(parts[1::2], parts[2::2], strict=True):
        if heading in {"Parameters", "Returns", "Raises"}:
            entries = re.findall(r"^(\S.*)\n?((?:(?: +.*)?\n)*)", text.strip("\n") + "\n", re.MULTILINE)
            yield heading, [(name.partition(" : "), " ".join(told.split())) for name, told in entries]


def call_of(name, thing):
    """Write the call of a function or a class, without types, and without defaults that are no plain values."""
    parameters = []
    for parameter in inspect.signature(thing).parameters.values():
        plain = parameter.default in (parameter.empty, None) or isinstance(parameter.default, int | float | str | tuple)
        parameters.append(parameter.replace(annotation=parameter.empty, default=parameter.default if plain else ...))
    return f"`{name}{inspect.Signature(parameters)}`".replace("Ellipsis", "...")


def methods_of(thing):
    """Give the public methods and properties of a class that are its own, with what they say of themselves."""
    for name, value in vars(thing).items():
        method = value.__func__ if isinstance(value, classmethod | staticmethod) else value
        ours = inspect.isfunction(method) or isinstance(method, property)
        if ours and not name.startswith("_"):
            yield f"{name}{'' if isinstance(method, property) else '()'}", first_paragraph(method)


def section(heading, entries):
    """Write what a section of a docstring lists."""
    if not any(told for _, told in entries):
        names = ", ".join(f"`{name}`{' ' * bool(kind)}{kind}" for (name, _, kind), _ in entries)
        return f"{heading.removesuffix('s')}: {names}."
    if any(kind for (_, _, kind), _ in entries):
        rows = [[f"`{name}`", kind, told] for (name, _, kind), told in entries]
        return table([heading.lower().removesuffix("s"), "type", "meaning"], rows)
    return table([heading.lower(), "meaning"], [[f"`{name}`", told] for (name, _, _), told in entries])


def python():
    """Write every public name with its parameters."""
    names = [name for name in cylx.__all__ if name != "__version__"]
    parts = []
    for name in sorted(names, key=lambda name: (inspect.isclass(getattr(cylx, name)), name)):
        thing = getattr(cylx, name)
        parts.append(f"### {name}")
        if "Parameters" in dict(sections_of(thing)):
            parts.append(call_of(name, thing))
        parts.append(first_paragraph(thing))
        parts += [section(heading, entries) for heading, entries in sections_of(thing)]
        if inspect.isclass(thing) and (methods := list(methods_of(thing))):
            parts.append(table(["name", "what it is"], [[f"`{method}`", told] for method, told in methods]))
    return "\n\n".join(parts)


# --- the house

COMMENTS = {".js": r"^// (.*)$", ".css": r"^/\* (.*) \*/$", ".html": r"^<!-- (.*) -->$"}
TOLD = {".py", ".yaml", *COMMENTS}
"""Kinds of files that say what they are for."""


def purpose(path):
    """Give the first line of what a file says of itself."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".yaml":
        return text.splitlines()[0].lstrip("# ")
    if path.suffix in COMMENTS:
        return re.search(COMMENTS[path.suffix], text, re.MULTILINE)[1]
    return (ast.get_docstring(ast.parse(text)) or "").split("\n")[0]


def rooms():
    """Write every file of the package with its purpose."""
    parts = []
    for folder in [
        PACKAGE,
        *sorted(path for path in PACKAGE.rglob("*") if path.is_dir() and path.name != "__pycache__"),
    ]:
        files = sorted(path for path in folder.iterdir() if path.suffix in TOLD and path.stat().st_size)
        parts.append(f"`{folder.relative_to(PACKAGE.parent).as_posix()}/`\n")
        parts += [f"- `{path.name}`: {purpose(path)}" for path in files]
        parts.append("")
    return "\n".join(parts).rstrip()


def arrows():
    """Write which room may import which."""
    rows = []
    for room, others in MAY_IMPORT.items():
        names = ", ".join(f"`{other}`" for other in sorted(others)) or "nothing of ours"
        rows.append([f"`{room}`", names])
    return table(["room", "may import"], rows)


TABLES = {
    "configuration": configuration,
    "presets": presets,
    "command line": command_line,
    "json format": json_format,
    "rejected format": rejected_format,
    "deviation format": deviation_format,
    "stems format": stems_format,
    "python": python,
    "rooms": rooms,
    "arrows": arrows,
}
