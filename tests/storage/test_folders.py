"""Folders of the user's cache."""

from pathlib import Path

from bubblefit.storage import writing


def test_cache_folder_follows_platform_and_environment(monkeypatch):
    named = {"BUBBLEFIT_CACHE": "", "XDG_CACHE_HOME": "bubblefit", "HOME": ".cache/bubblefit"}
    for name in named:
        monkeypatch.setenv(name, f"/{name}")
    for name, below in named.items():
        assert writing.cache_folder() == Path(f"/{name}", below)
        monkeypatch.delenv(name)
