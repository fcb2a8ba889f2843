"""Edits of names."""

from .edits import attributes, edit
from .mutant import Mutant, NotApplicableError
from .xpath_functions import longest_word


@edit("misspell")
def misspell(mutant: Mutant, path: str) -> None:
    """Remove, duplicate or swap a letter of the longest word of a name."""
    ((element, key),) = attributes(mutant, path)
    name = element.get(key)
    word = longest_word(name)
    at = mutant.rng.randrange(1, len(word) - 1)
    wrong = mutant.pick(
        [
            word[:at] + word[at + 1 :],
            word[:at] + word[at] + word[at:],
            word[: at - 1] + word[at] + word[at - 1] + word[at + 1 :],
        ]
    )
    if wrong == word:
        raise NotApplicableError
    element.set(key, name.replace(word, wrong, 1))


@edit("swap_case_of_word")
def swap_case_of_word(mutant: Mutant, path: str) -> None:
    """Change the case of a random word of a name."""
    ((element, key),) = attributes(mutant, path)
    words = element.get(key).split("_")
    at = mutant.rng.randrange(len(words))
    words[at] = words[at].upper() if words[at].islower() else words[at].lower()
    element.set(key, "_".join(words))


@edit("write_decimal_comma")
def write_decimal_comma(mutant: Mutant, path: str) -> None:
    """Write the longest number of an attribute with a decimal comma."""
    ((element, key),) = attributes(mutant, path)
    words = element.get(key).split()
    longest = max(range(len(words)), key=lambda k: len(words[k]))
    words[longest] = words[longest].replace(".", ",") if "." in words[longest] else "0,1"
    element.set(key, " ".join(words))
