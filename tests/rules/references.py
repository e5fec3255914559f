"""Whether what comments and pages name is there: pages, their sections, files, folders, links and commands."""
import glob
import re
import subprocess

TEXTS = (".h", ".hpp", ".c", ".cpp", ".inl", ".py", ".sh", ".cmake", ".txt", ".md")
LEFT_OUT = ("tests/fuzz/corpus/", "docs/studies/")
TOP = "common|precompute|runtime|schemas|tests|examples|docs"
PAGE = re.compile(r'(?<![\w/.-])((?:\.\./)*(?:[\w.-]+/)*[\w-]+\.md)\b`?(?:,? (?:section (\d+)|"([^"]+)"))?')
PATH = re.compile(rf"(?<![\w/.<-])((?:{TOP})(?:/[\w.{{}},*-]+)+)")
FILE = re.compile(r"(?<![\w/.<*{-])([a-z][a-z0-9_]*\.(?:h|hpp|cpp|inl|py|sh))\b(?!\()")
LINK = re.compile(r"\]\(([^)\s]+)\)")
COMMAND = re.compile(r"\bexmat-(precompute|runtime) ([^\n`]*)")
COMMON_OPTIONS = {"help", "version", "threads", "log-level", "progress"}
PLACEHOLDER = re.compile(r"(^|/)(NN_)?[A-Z][A-Z_]*[A-Z](\.|/|_|$)|NN_name|NAME")


def tracked(root):
    listed = subprocess.run(["git", "-C", str(root), "ls-files"], capture_output=True, text=True).stdout.splitlines()
    return listed or [path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file()]


def comment_blocks(name, text):
    """(line, text) of comments, those of adjacent lines as one; of pages all of it, paragraph by paragraph."""
    if name.endswith(".md"):
        mark, drop = re.compile(r"(.*\S.*)$"), None
    elif name.endswith((".h", ".hpp", ".c", ".cpp", ".inl")):
        mark, drop = re.compile(r"^\s*(?:///?<?!?|/?\*+/?)(.*)$"), re.compile(r"//[/!]?<?\s?(.*)$")
    else:
        mark, drop = re.compile(r"^\s*#(.*)$"), re.compile(r"\s#\s(.*)$")
    block, start = [], 0
    for number, line in enumerate(text.splitlines(), 1):
        match = mark.match(line)
        if match:
            start = start or number
            block.append(match.group(1).strip())
            continue
        if block:
            yield start, " ".join(block)
        block, start = [], 0
        trailing = drop.search(line) if drop else None
        if trailing:
            yield number, trailing.group(1)
    if block:
        yield start, " ".join(block)


def docstrings(text):
    for match in re.finditer(r'^\s*"""(.*?)"""', text, re.S | re.M):
        yield text.count("\n", 0, match.start()) + 1, " ".join(match.group(1).split())


def bare(heading):
    """Without its number, what stands in brackets behind it, and marks."""
    heading = re.sub(r"^\d+\.\s*", "", heading.strip())
    return re.sub(r"\s*\(.*\)$", "", heading).replace("`", "").strip().lower()


def slug(heading):
    """As links have it."""
    return re.sub(r"[^\w\- ]", "", heading.replace("`", "").lower()).strip().replace(" ", "-")


class Repository:
    def __init__(self, root):
        self.root = root
        self.files = tracked(root)
        self.names = {name.rsplit("/", 1)[-1] for name in self.files}
        self.headings = {}
        self.commands = {program: self.words_of(f"{program}/app", r'add_subcommand\(\s*"(\w+)"') for program in ("precompute", "runtime")}
        options = r'add_(?:option|flag)[\w<>:]*\(\s*"[^"]*--([a-z-]+)'
        self.options = COMMON_OPTIONS | self.words_of("precompute/app", options) | self.words_of("runtime/app", options)

    def words_of(self, folder, pattern):
        return {word for path in (self.root / folder).glob("*.cpp") for word in re.findall(pattern, path.read_text())}

    def headings_of(self, page):
        if page not in self.headings:
            text = re.sub(r"^```.*?^```", "", (self.root / page).read_text(), flags=re.S | re.M)
            self.headings[page] = re.findall(r"^#+ (.*)$", text, re.M)
        return self.headings[page]

    def there(self, path):
        """A file, a folder, a pattern of them, or a source named without its ending."""
        path = path.rstrip(".,:")
        choices = [path]
        while any("{" in choice and "}" in choice for choice in choices):
            choices = [choice[:match.start()] + word + choice[match.end():] for choice in choices
                       for match in [re.search(r"\{([^{}]*)\}", choice)] if match for word in match.group(1).split(",")]
        return all((self.root / choice).exists() or glob.glob(str(self.root / choice)) or glob.glob(f"{self.root / choice}.*") for choice in choices)

    def resolve(self, page, target):
        """A page's or comment's name of another page, from the top of the repository or beside the page."""
        beside = (self.root / page).parent if page.endswith(".md") else self.root
        for folder in (self.root, beside):
            path = (folder / target).resolve()
            if path.exists() and path.is_relative_to(self.root):
                return path.relative_to(self.root).as_posix()
        return None


def faults_of_text(repository, name, text):
    """What a comment or a paragraph names and is not there."""
    for target, section, heading in PAGE.findall(text):
        page = repository.resolve(name, target)
        if page is None:
            if not PLACEHOLDER.search(target):
                yield f"no page {target}"
            continue
        headings = repository.headings_of(page)
        if section and not any(re.match(rf"{section}\.", found) for found in headings):
            yield f"{target} has no section {section}"
        if heading and bare(heading) not in {bare(found) for found in headings}:
            yield f'{target} has no section "{heading}"'
    for target in PATH.findall(text):
        if not PLACEHOLDER.search(target) and not repository.there(target):
            yield f"no file or folder {target}"
    for target in FILE.findall(text):
        if target not in repository.names:
            yield f"no file {target}"


def faults_of_links(repository, page, text):
    for match in LINK.finditer(text):
        target, _, anchor = match.group(1).partition("#")
        if re.match(r"\w+:", target):
            continue
        path = ((repository.root / page).parent / target).resolve() if target else repository.root / page
        if not path.exists():
            yield text.count("\n", 0, match.start()) + 1, f"no {target}"
        elif anchor and slug(anchor) not in {slug(found) for found in repository.headings_of(path.relative_to(repository.root).as_posix())}:
            yield text.count("\n", 0, match.start()) + 1, f"{target or page} has no section #{anchor}"


def code_of(text):
    """(line, code) of a page: spans and blocks."""
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("    "):
            yield number, line
        for span in re.findall(r"`([^`]+)`", line):
            yield number, span
    for match in re.finditer(r"^```.*?\n(.*?)^```", text, re.S | re.M):
        for number, line in enumerate(match.group(1).splitlines(), text.count("\n", 0, match.start()) + 2):
            yield number, line


def faults_of_commands(repository, text):
    for number, code in code_of(text):
        for program, rest in COMMAND.findall(code):
            words = rest.split()
            if words and re.fullmatch(r"[a-z]+", words[0]) and words[0] not in repository.commands[program]:
                yield number, f"exmat-{program} has no command {words[0]}"
            for option in re.findall(r"(?<!\S)\[?--([a-z][a-z-]*[a-z])(?![A-Za-z-])", rest):
                if option not in repository.options:
                    yield number, f"exmat-{program} has no option --{option}"


def references(root):
    """What comments and pages name is there."""
    root = root.resolve()
    repository = Repository(root)
    for name in repository.files:
        if not name.endswith(TEXTS) or name.startswith(LEFT_OUT) or not (root / name).is_file():
            continue
        text = (root / name).read_text()
        blocks = list(comment_blocks(name, text)) + (list(docstrings(text)) if name.endswith(".py") else [])
        for number, block in blocks:
            for fault in faults_of_text(repository, name, block):
                yield f"{name}:{number}: {fault}"
        if name.endswith(".md"):
            for number, fault in [*faults_of_links(repository, name, text), *faults_of_commands(repository, text)]:
                yield f"{name}:{number}: {fault}"
