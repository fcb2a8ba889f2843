from terrainkit_robots.lint.report.github import to_text


def test_each_finding_is_a_command(report):
    said = "the mass is -1 kg; expected > 0%0AWeigh it."
    assert to_text([report]).splitlines() == [
        f"::error file=robot.urdf,line=12,title=INR002 negative-mass::{said}",
        f"::warning file=robot.urdf,line=40,title=JNT007 degrees::{said}",
        f"::warning file=robot.urdf,title=JNT007 degrees::{said}",
        f"::notice file=robot.urdf,line=1,title=LEG004 legs::{said}",
    ]
    assert to_text([]) == ""


def test_command_escapes_names(nasty):
    (line,) = to_text([nasty]).split("\n")[:-1]
    assert line.count("\r") == 0
    head, _, message = line.removeprefix("::error ").partition("::")
    properties = dict(part.split("=", 1) for part in head.split(","))
    assert list(properties) == ["file", "line", "title"]
    assert properties["file"].startswith("dir with space/a%2Cb%3Ac%25d|e")
    assert message.startswith("a,b:c%25d|e")
    assert "%0D%0A::error::x" in message
    line.encode()
