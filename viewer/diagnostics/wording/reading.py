"""Messages that readers of several formats share."""

MESSAGES = {
    "F001.unreadable": "cannot be read: {reason:text}{near:+; {}}",
    "F001.no-file": "expected a file, found {found}",
    "F001.too-large": "expected at most {most} bytes, found {size} (--max-size)",
    "F002.number": "{item:text}: expected a number, found {found:quoted}",
    "F003.number": "{item:text}: expected a number{below:+ below {}}, found {found:quoted}",
    "F002.width": "{item:text}: expected {expected:#number}, found {found}",
    "F007.further-warnings": "further warnings are left out",
}

PHRASES: dict[str, str] = {}
