"""Names of the product say what things are: the share of names that do not only falls."""

import ast

from .support.paths import product_modules

#: Words that name nothing: pronouns, determiners, adverbs, bare participles.
VAGUE = set(
    """own one other others every each whole some any many few more most least rest same such both
    here there now then found said told made ran given taken known asked wanted done seen shown kept
    meant begun ended gone held moved turned placed grown tilted lost drawn put got had been what
    which who whose when why how this that these those it its itself alike apart near far beside
    beyond again once never always only also too less next before after above below inside outside
    little much enough it_is is_it at_rest""".split()
)
#: Percent of the names that are assigned or are arguments. To be lowered, never raised.
CEILING = 0.35
#: Class names that mean two things. To be lowered, never raised.
SHARED_CLASS_NAMES = 0


def assigned_names(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id, node.lineno
        elif isinstance(node, ast.arg) and node.arg not in ("self", "cls"):
            yield node.arg, node.lineno


def test_share_of_vague_names_only_falls():
    names = [
        (name, path, line)
        for path, tree in product_modules().items()
        for name, line in assigned_names(tree)
    ]
    vague = [own for own in names if own[0].strip("_").lower() in VAGUE]
    share = 100 * len(vague) / len(names)
    examples = ", ".join(f"{path}:{line} {name}" for name, path, line in vague[::17])
    assert share < CEILING, f"{share:.2f} % of the names say nothing, such as {examples}"
    assert share > CEILING - 0.2, f"{share:.2f} %: lower the ceiling"


def test_class_name_means_one_thing():
    places = {}
    for path, tree in product_modules().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places.setdefault(node.name, []).append(str(path))
    shared = {name: paths for name, paths in places.items() if len(paths) > 1}
    assert len(shared) == SHARED_CLASS_NAMES, shared
