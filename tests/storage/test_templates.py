"""Rendering of templates: what is compiled once, and when it is compiled again."""

import jinja2
from bubblefit.storage.templates import COMPILED, template_environment


def rendered(text, **context):
    loader = jinja2.DictLoader({"part of a test": text})
    return template_environment(loader).get_template("part of a test").render(context)


def test_template_is_compiled_once_until_its_text_changes(monkeypatch):
    compiled = []
    compile_source = jinja2.Environment.compile

    def heard(self, source, *arguments, **options):
        compiled.append(source)
        return compile_source(self, source, *arguments, **options)

    monkeypatch.setattr(jinja2.Environment, "compile", heard)
    monkeypatch.setattr(COMPILED, "codes", {})
    assert [rendered("load {{ n }}", n=n) for n in (1, 2)] == ["load 1", "load 2"]
    assert rendered("force {{ n }}", n=1) == "force 1"
    assert compiled == ["load {{ n }}", "force {{ n }}"]
