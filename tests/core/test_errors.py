import pickle

from app.core.errors import GainlineError, InputError, Problem


def test_an_error_goes_from_one_process_to_another_as_it_is() -> None:
    error = InputError("This cannot be used.", problems=(Problem("name", "is empty"),), hint="Give it a name.")
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), again.message, again.hint, again.problems) == (
        InputError,
        error.message,
        error.hint,
        error.problems,
    )
    assert str(again) == "This cannot be used. name: is empty. Give it a name."


def test_one_without_fields_says_what_happened_and_what_to_do() -> None:
    assert str(GainlineError("It is full.", hint="Make room.")) == "It is full. Make room."
