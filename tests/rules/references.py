"""Names in comments and pages: of pages, their sections, files of the repository, and commands. Each is of one that exists.

What a user calls his own stands in capitals (SCENE.json, DIR/report.html, NN_name) and is no reference.
"""
import builtins
import os
import re
import subprocess
from functools import lru_cache

PROGRAMS = {"exmat-precompute": "precompute/app", "exmat-runtime": "runtime/app"}
OUT_OF_SCOPE = re.compile(r"^(build[^/]*|\.git|tests/fuzz/corpus)/|\.html$")
C_LIKE, HASHED = (".h", ".hpp", ".c", ".cpp", ".inl"), (".py", ".sh", ".cmake", ".txt", ".yml", "")
SOURCE_ENDINGS = ("", ".h", ".cpp", ".hpp", ".inl", ".py", ".sh")

C_COMMENT = re.compile(r'//[^\n]*|/\*.*?\*/|("(?:\\.|[^"\\\n])*")', re.S)
HASH_COMMENT = re.compile(r'(?<![^\s])#[^\n]*|^[ \t]*"""(?:.*?)"""|(""".*?"""|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\')', re.S | re.M)
FENCE = re.compile(r"^```.*?^```$", re.S | re.M)
HEADING = re.compile(r"^#+ +(.*?) *$", re.M)
PAGE = re.compile(r'(?<![\w./#-])((?:[\w.-]+/)*[\w-]+\.md)\b`?(?:,?\s+sections?\s+([\d.]*\d(?:(?:,| and|,? or)\s+[\d.]*\d)*)|,\s+"([^"]+)"|,\s+step\s+(\d+))?')
PATH = re.compile(r"(?<![\w./*}<-])((?:common|precompute|runtime|schemas|tests|examples|docs|\.ci|\.github)/[\w./*{},-]*[\w*}/])")
SOURCE = re.compile(r"(?<![\w./*}<-])(?!sanitizer/)((?:\w+/)*[a-z]\w*\.(?:h|hpp|cpp|inl|py|sh))\b")
RELATIVE = re.compile(r"(?<![\w./(\"$}])((?:\.\./)+[\w./-]*\w)")
LINK = re.compile(r"\]\(([^)\s]+)\)")
QUOTED = re.compile(r"`[^`\n]+`")
CODE = re.compile(QUOTED.pattern + r"|^ {4}.*(?:\n +[\[-].*)*|^```.*?\n(?s:.*?)^```$", re.M)  # of a page: with blocks, and lines that go on
PLACEHOLDER = re.compile(r"(^|/|_)(NN|[A-Z]{3,}|[A-Z]+_\w+|NAME)\b|NN_name|(^|/)x\.\w+$")
SCRIPT = re.compile(r"(?:^ {4}|`|&& )((?:examples|tests)/[\w./-]+\w) +[A-Z\-\w]", re.M)
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*")
# Names of ours in a page's code: of the C interface, of options and of types and tests.
SYMBOL = re.compile(r"(?<![\w./<:*-])(exmat_[a-z]\w*[a-z0-9]|EXMAT_[A-Z]\w*[A-Z0-9]|k?[A-Z][a-z0-9]+(?:[A-Z][a-z0-9]*)+)(?![\w*.-])")


def blank(text):
    """What no name reaches across; lines stay."""
    return re.sub(r"[^\n]", "\0", text)


def comments(text, pattern):
    """A source of which the comments alone are left, without what marks them."""
    parts, end = [], 0
    for match in pattern.finditer(text):
        comment = match.group()
        parts += [re.sub(r"[^\s]", "\0", text[end : match.start()]),
                  blank(comment) if match.group(1) else re.sub(r'^\s*(///?<?|/\*+|\*/?|#!?|""")', " ", comment, flags=re.M)]
        end = match.end()
    return "".join(parts) + blank(text[end:])


def files_of(root):
    listed = subprocess.run(["git", "-C", str(root), "ls-files", "--cached", "--others", "--exclude-standard"], capture_output=True, text=True)
    names = listed.stdout.splitlines() if listed.returncode == 0 else [path.relative_to(root).as_posix() for path in root.rglob("*")]
    return [name for name in sorted(names) if not OUT_OF_SCOPE.search(name) and (root / name).is_file()]


def words_of(path):
    """What of a file speaks to its reader; None of a file that does not."""
    kind = "" if path.name == "CMakeLists.txt" else path.suffix
    if kind not in (".md", ".json") + C_LIKE + HASHED or (kind == ".txt"):
        return None
    text = path.read_text(errors="replace")
    if kind == ".md":
        return text
    if kind == ".json":
        return text if path.parent.name == "schemas" else None
    if kind == "" and path.name != "CMakeLists.txt" and not text.startswith("#!"):
        return None
    return comments(text, C_COMMENT if kind in C_LIKE else HASH_COMMENT)


def plain(heading):
    return re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "")


def anchor(heading):
    """As GitHub makes it."""
    return re.sub(r"[^\w\- ]", "", plain(heading).lower()).replace(" ", "-")


@lru_cache(maxsize=None)
def headings(page):
    return HEADING.findall(FENCE.sub("", page.read_text()))


def has_section(page, number):
    return any(re.match(rf"{re.escape(number)}\.?\s", heading) for heading in headings(page))


def has_heading(page, name):
    name = " ".join(name.split())
    return any(re.sub(r"^[\d.]+ +", "", re.sub(r" \(`[^)]*`\)$", "", heading)).replace("`", "") == name or plain(heading) == name
               for heading in headings(page))


def is_placeholder(name):
    return bool(PLACEHOLDER.search(name)) and not re.search(r"(^|/)(README|CHANGELOG|CONTRIBUTING|LICENSE|CMakeLists)\b", name)


def expanded(name):
    """{a,b} and {a,b}/c."""
    match = re.search(r"\{([^{}]*)\}", name)
    return [x for part in match.group(1).split(",") for x in expanded(name[: match.start()] + part + name[match.end() :])] if match else [name]


def exists(root, name):
    return any(True for ending in SOURCE_ENDINGS for _ in root.glob(name.rstrip("/") + ending)) if "*" in name else any(
        (root / (name.rstrip("/") + ending)).exists() for ending in SOURCE_ENDINGS)


def page_faults(root, folder, text):
    for match in PAGE.finditer(text):
        name, sections, heading, step = match.groups()
        page = next((place / name for place in (root, folder) if place and (place / name).exists()), None)
        if is_placeholder(name) or name.startswith("build/"):
            continue
        if page is None:
            yield match.start(), f"there is no page {name}"
            continue
        for number in re.findall(r"[\d.]*\d", sections or ""):
            if not has_section(page, number):
                yield match.start(), f"{name} has no section {number}"
        if heading and not has_heading(page, heading):
            yield match.start(), f'{name} has no section "{heading}"'
        if step and not re.search(rf"^{step}\. ", page.read_text(), re.M):
            yield match.start(), f"{name} has no step {step}"


def path_faults(root, text, names):
    for match in PATH.finditer(text):
        for name in expanded(match.group(1)):
            if not is_placeholder(name) and not exists(root, name):
                yield match.start(), f"there is no {name}"
    for match in SOURCE.finditer(text):
        if is_placeholder(match.group(1)) or PATH.match(match.group(1)):
            continue
        found = [name for name in names if name == match.group(1) or name.endswith("/" + match.group(1))]
        if not found:
            yield match.start(), f"there is no source {match.group(1)}"


@lru_cache(maxsize=None)
def symbols(root):
    """Every word of the sources."""
    return {word for name in files_of(root) if name.endswith(C_LIKE + HASHED[:-1] + (".cmake", ".json"))
            for word in re.findall(r"\w+", (root / name).read_text(errors="replace"))}


def symbol_faults(root, text):
    for code in QUOTED.finditer(text):
        for match in SYMBOL.finditer(code.group()):
            if match.group(1) not in symbols(root) and not hasattr(builtins, match.group(1)):
                yield code.start() + match.start(), f"no source has {match.group(1)}"


def relative_faults(path, text):
    """Of what a page says of the folders around its own."""
    for match in RELATIVE.finditer(text):
        if not (path.parent / match.group(1)).exists():
            yield match.start(), f"there is no {match.group(1)}"


def link_faults(path, text):
    for match in LINK.finditer(text):
        target, _, fragment = match.group(1).partition("#")
        if re.match(r"[a-z]+:", target):
            continue
        page = path.parent / target if target else path
        if not page.exists():
            yield match.start(), f"the link to {target} is broken"
        elif fragment and fragment not in map(anchor, headings(page)):
            yield match.start(), f"{target or path.name} has no anchor #{fragment}"


@lru_cache(maxsize=None)
def command_line(root, program):
    """Subcommands and long options of a program, as its sources name them."""
    text = "".join(path.read_text() for folder in (PROGRAMS[program], "common/console") for path in sorted((root / folder).glob("*.cpp")))
    literals = "".join(re.findall(r'"(?:\\.|[^"\\\n])*"', text))
    return set(re.findall(r'add_subcommand\(\s*"([a-z]+)"', text)), set(OPTION.findall(literals.replace(",--", " --"))) | {"--help"}


@lru_cache(maxsize=None)
def literals(root):
    """Texts of the sources, those that are written in pieces put together, without what stands for values."""
    sources = "".join((root / name).read_text() for name in files_of(root) if re.match(r"(common|precompute|runtime)/.*[.](cpp|h)$", name))
    return re.sub(r"\{[\d:.<>=+a-z]*\}", "\0", re.sub(r'"\s*"', "", sources).replace('\\"', '"'))


def message_faults(root, text):
    """A page's messages, in the first column of tables that begin with "message" or "symptom or message"."""
    for table in re.finditer(r"^\| (?:symptom or )?message .*\n(?:\|.*\n)*", text, re.M):
        for match in re.finditer(r"^\| (`[^|\n]*`)", table.group(), re.M):
            for part in re.split(r"\.\.\.|`", match.group(1)):
                if len(part.strip()) > 3 and part.strip() not in literals(root):
                    yield table.start() + match.start(), f'no program prints "{part.strip()}"'


def command_faults(root, text, code_of):
    for code in code_of.finditer(text):
        calls = list(re.finditer(r"(?<![\w./=-])(?:[\w./-]+/)?(exmat-precompute|exmat-runtime)(?![\w-])(?:[ ]+([a-z]+)(?![\w./-]))?", code.group()))
        for call, following in zip(calls, calls[1:] + [None]):
            commands, options = command_line(root, call.group(1))
            if call.group(2) and call.group(2) not in commands:
                yield code.start() + call.start(), f"{call.group(1)} has no command {call.group(2)}"
            rest = re.split(r" && | \| |;", code.group()[call.end() : following.start() if following else None])[0]
            for option in OPTION.findall(rest):
                if option not in options and not option.startswith(("--eps-", "--st-")):
                    yield code.start() + call.start(), f"{call.group(1)} has no option {option}"


def script_faults(root, text):
    """Of scripts that a page calls by their paths and with arguments."""
    for code in CODE.finditer(text):
        for match in SCRIPT.finditer(code.group()):
            script = root / match.group(1)
            if script.is_file() and not os.access(script, os.X_OK):
                yield code.start() + match.start(), f"{match.group(1)} is not executable"


def references(root):
    """Comments and pages name pages, sections, files and commands that exist."""
    names = files_of(root)
    for name in names:
        path = root / name
        text = words_of(path)
        if text is None:
            continue
        page = path.suffix == ".md"
        outside_code = FENCE.sub(lambda m: blank(m.group()), text) if page else text
        found = [*page_faults(root, path.parent if page else None, outside_code), *path_faults(root, outside_code, names), *command_faults(root, text, CODE if page else QUOTED),
                 *(relative_faults(path, outside_code) if page else ()), *(link_faults(path, outside_code) if page else ()), *(script_faults(root, text) if page else ()),
                 *(message_faults(root, outside_code) if page else ()), *(symbol_faults(root, outside_code) if page and name != "CHANGELOG.md" else ())]
        for position, what in sorted(found):
            yield f"{name}:{text.count(chr(10), 0, position) + 1}: {what}"
